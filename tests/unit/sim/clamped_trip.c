/* SPDX-License-Identifier: Apache-2.0 */
/* A host of one limb drives one motor: against a clamp it trips, and the log says why; on the bench
 * it moves its link. */
#include "sim/simulator.h"

#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

enum { LEFT_LEG = 1, TICKS = 200 };

/* Sends what it takes to switch axis 0 of board 1 on, of strict boards too, then a quarter of the
 * supply: 12 V on 0.66 ohm at standstill, 18 A where 12 A are allowed. */
struct limb_host {
    struct bus_ports ports;
    int sent;
};

static void limb_host_step(void *context, int64_t now_ns)
{
    static const struct bus_frame frames[] = {
        {.id = 0x001, .len = 3, .data = {0x5b, 1, 6}},
        {.id = 0x001, .len = 8, .data = {0x52}},
        {.id = 0x001, .len = 7, .data = {0x54, 0, 0, 0x35, 0x05, 0x35, 0x05}},
        {.id = 0x001, .len = 2, .data = {0x09, 0x50}},
        {.id = 0x001, .len = 3, .data = {0x72, 0x4d, 0x01}},
    };
    struct limb_host *host = context;
    size_t which = host->sent < 4 ? (size_t)host->sent : 4;

    (void)now_ns;
    can_send(host->ports.port[LEFT_LEG], &frames[which], 1);
    host->sent++;
}

/* Drives the hip of a rig for TICKS; text is the line of the log that names the clamp, or empty. */
static void drive_hip(const char *name, enum rig_hold hold, char *text, size_t size,
                      struct boards_counters *counters, double *moved_rad)
{
    struct limb_host host = {.sent = 0};
    const struct simulator_observer observer = {&host, limb_host_step};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .hold = hold,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = TICKS,
                                      .observer = &observer,
                                      .guests = 1,
                                      .row_period_ns = 1000000};
    struct simulator *simulator;
    struct realtime_report report;
    char notice[256], file[512], line[512];
    struct arena arena;
    struct error error;
    uint64_t key;
    int joint;

    assert_int_equal(arena_init(&arena, (size_t)1 << 30, &error), ERROR_NONE);
    snprintf(file, sizeof file, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, name);
    if (rig_load(file, &arena, &config.rig, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(config.rig->hold, hold);
    if (simulator_create(&config, &arena, &simulator, notice, &error) ||
        simulator_join(simulator, &host.ports, &error) ||
        simulator_start(simulator, &report, &error)) {
        fail_msg("%s", error.text);
    }
    joint = config.rig->boards.board[config.rig->bus[LEFT_LEG].first_board].axis[0].joint;
    assert_int_equal(simulator_run(simulator), LOOP_END_LENGTH);

    /* The log: the fault of the axis, and what there is to say of it */
    text[0] = '\0';
    while (simulator_next_event(simulator, &key, line, sizeof line)) {
        if (strstr(line, "clamp")) {
            assert_string_equal(text, ""); /* once */
            assert_int_equal(simulator_event_priority(key), JOURNAL_WARNING);
            snprintf(text, size, "%s", line);
        }
    }
    boards_counters(simulator_boards(simulator), counters);
    *moved_rad =
        plant_sensors(simulator_plant(simulator))->motor[joint].q - config.rig->joint[joint];
    bus_ports_close(&host.ports);
    simulator_destroy(simulator);
    arena_fini(&arena);
}

static void a_trip_against_the_clamp_is_explained(void **state)
{
    struct boards_counters counters;
    double moved_rad;
    char text[512];

    (void)state;
    drive_hip("coman", RIG_HOLD_ENABLED, text, sizeof text, &counters, &moved_rad);
    assert_int_equal(counters.trips, 1);
    assert_true(moved_rad == 0.0);
    assert_non_null(strstr(text, " s: an axis has tripped against the clamp: the rig holds all "
                                 "links until all 23 motors are on, and 0 were. Switch on the "
                                 "others too, or take a rig that holds nothing "
                                 "(initial: {hold: none}), as coman-bench"));
}

static void on_the_bench_a_limb_moves(void **state)
{
    struct boards_counters counters;
    double moved_rad;
    char text[512];

    (void)state;
    drive_hip("coman-bench", RIG_HOLD_NONE, text, sizeof text, &counters, &moved_rad);
    assert_int_equal(counters.trips, 0);
    assert_int_equal(counters.malformed + counters.unknown + counters.timeouts, 0);
    assert_string_equal(text, "");
    assert_true(moved_rad > 0.1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_trip_against_the_clamp_is_explained),
        cmocka_unit_test(on_the_bench_a_limb_moves),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
