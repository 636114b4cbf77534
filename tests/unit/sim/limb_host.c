/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A host of one limb drives one motor of COMAN. Against a clamp it trips, and the log says why; on
 * the bench it moves its link, with the gains of docs/icub-software.md to where it is told.
 */
#include "base/array.h"
#include "tests/rig_run.h"

enum { LEFT_LEG = 1, FRAMES = 8 };

#define DEGREE (M_PI / 180.0)
#define TICK (2.0 * M_PI / 4096) /* of the joint's encoder, rad */

/* Sends a frame a tick, the last one again and again where it is a voltage. */
struct limb_host {
    const char *rig;
    enum rig_hold hold; /* of the rig, to say what is tested */
    uint64_t ticks;
    struct bus_frame frame[FRAMES];
    size_t nframe;

    struct bus_ports ports;
    struct simulator *simulator;
    int joint;
    size_t sent;
    struct boards_counters counters;
    double q, q_min, q_max; /* rad: at the end, and in the last second */
    char clamp[512];        /* the line of the log that names the clamp, or empty */
    char owed[512];         /* what the last line about switching on says of axis 0, or empty */
};

static void limb_host_step(void *context, int64_t now_ns)
{
    struct limb_host *host = context;
    const struct bus_frame *last = &host->frame[host->nframe - 1];
    const struct plant_sensors *sensors = simulator_measured(host->simulator);

    if (host->sent < host->nframe) {
        can_send(host->ports.port[LEFT_LEG], &host->frame[host->sent++], 1);
    } else if (last->data[0] == 0x72) {
        can_send(host->ports.port[LEFT_LEG], last, 1);
    }
    if (!sensors) {
        return;
    }
    host->q = sensors->motor[host->joint].q;
    if (now_ns == 0 || now_ns + INT64_C(1000000000) <= (int64_t)host->ticks * 1000000) {
        host->q_min = host->q_max = host->q;
    }
    host->q_min = fmin(host->q_min, host->q);
    host->q_max = fmax(host->q_max, host->q);
}

static void run_limb(struct limb_host *host)
{
    const struct simulator_observer observer = {host, limb_host_step};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .hold = host->hold,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = host->ticks,
                                      .observer = &observer,
                                      .guests = 1,
                                      .row_period_ns = 1000000};
    struct arena arena;
    struct rig rig;

    rig_run_load(host->rig, &arena, &rig);
    config.rig = &rig;
    assert_int_equal(rig.hold, host->hold);
    host->joint = config.rig->boards.board[config.rig->bus[LEFT_LEG].first_board].axis[0].joint;
    host->simulator = rig_run_open(&config, &arena, &host->ports);
    assert_int_equal(simulator_run(host->simulator), LOOP_END_LENGTH);
    char line[512];
    uint64_t key;

    while (simulator_next_event(host->simulator, &key, line, sizeof line)) {
        if (strstr(line, "clamp")) {
            assert_string_equal(host->clamp, ""); /* once */
            assert_int_equal(simulator_event_priority(key), JOURNAL_WARNING);
            snprintf(host->clamp, sizeof host->clamp, "%s", line);
        }
        if (strstr(line, "not switched on")) {
            snprintf(host->owed, sizeof host->owed, "%s", strstr(line, "axis 0"));
        }
    }
    boards_counters(simulator_parts(host->simulator).boards, &host->counters);
    rig_run_close(host->simulator, &arena, &host->ports);
}

/* What it takes to switch axis 0 of board 1 on, of strict boards too, then a quarter of the supply:
 * 12 V on 0.66 ohm at standstill, 18 A where 12 A are allowed. */
static struct limb_host host_of_voltage(const char *rig, enum rig_hold hold)
{
    return (struct limb_host){.rig = rig,
                              .hold = hold,
                              .ticks = 200,
                              .frame = {{.id = 0x001, .len = 3, .data = {0x5b, 1, 6}},
                                        {.id = 0x001, .len = 8, .data = {0x52}},
                                        {.id = 0x001, .len = 7, .data = {0x54}},
                                        {.id = 0x001, .len = 2, .data = {0x09, 0x50}},
                                        {.id = 0x001, .len = 3, .data = {0x72, 0x4d, 0x01}}},
                              .nframe = 5};
}

TEST(a_trip_against_the_clamp_is_explained)
{
    struct limb_host host = host_of_voltage("coman", RIG_HOLD_ENABLED);

    run_limb(&host);
    assert_int_equal(host.counters.trips, 1);
    assert_true(host.q_max == host.q_min);
    assert_non_null(strstr(host.clamp,
                           " s: an axis has tripped against the clamp: the rig holds all links "
                           "until all 23 motors are on, and 0 were on then. Switch on the others "
                           "too, or take a rig that holds nothing (initial: {hold: none}), as "
                           "coman-bench"));
}

TEST(on_the_bench_a_limb_moves)
{
    static const char *const rigs[] = {"coman-bench", "coman-strict"};

    for (size_t i = 0; i < ARRAY_COUNT(rigs); i++) {
        struct limb_host host = host_of_voltage(rigs[i], RIG_HOLD_NONE);

        run_limb(&host);
        assert_int_equal(host.counters.trips, 0);
        assert_int_equal(host.counters.malformed + host.counters.unknown + host.counters.timeouts,
                         0);
        assert_string_equal(host.clamp, "");
        assert_true(host.q > 0.1);
    }
}

/* The frames of the README: a lenient board moves, a strict one says what it wants first. */
TEST(a_motor_is_switched_on_by_hand_where_boards_are_lenient)
{
    struct limb_host host = {.rig = "coman-bench",
                             .hold = RIG_HOLD_NONE,
                             .ticks = 200,
                             .frame = {{.id = 0x001, .len = 2, .data = {0x09, 0x50}},
                                       {.id = 0x001, .len = 3, .data = {0x72, 0x4d, 0x01}}},
                             .nframe = 2};

    run_limb(&host);
    assert_int_equal(host.counters.trips, 0);
    assert_true(host.q_max > 0.1);
    host.rig = "coman-strict";
    host.sent = 0;
    run_limb(&host);
    assert_string_equal(host.owed, "axis 0 is not switched on: a strict board first wants "
                                   "GET_FIRMWARE_VERSION with its protocol");
}

/* The hip goes to -20 degrees (-228 ticks) in two seconds and has three more to settle. */
static struct limb_host host_of_position(uint8_t kp_low, uint8_t kp_high, uint8_t ki)
{
    return (struct limb_host){
        .rig = "coman-strict",
        .hold = RIG_HOLD_NONE,
        .ticks = 5000,
        .frame = {{.id = 0x001, .len = 3, .data = {0x5b, 1, 6}},
                  {.id = 0x001, .len = 8, .data = {0x52, kp_low, kp_high, ki, 0, 0xe8, 0x03, 8}},
                  {.id = 0x001, .len = 7, .data = {0x54, 0, 0, 0x35, 0x05, 0x35, 0x05}},
                  {.id = 0x001, .len = 2, .data = {0x09, 0x01}},
                  {.id = 0x001, .len = 7, .data = {0x1b, 0x1c, 0xff, 0xff, 0xff, 11, 0}}},
        .nframe = 5};
}

TEST(the_gains_of_the_guide_bring_the_hip_where_it_is_told)
{
    struct limb_host host = host_of_position(0x58, 0x02, 0); /* kp 600, kd 1000, ki 0, shift 8 */

    run_limb(&host);
    assert_int_equal(host.counters.trips, 0);
    assert_true(fabs(host.q + 20.0 * DEGREE) < 2.0 * DEGREE);
    assert_true(host.q_max - host.q_min < TICK); /* at rest, as far as its encoder can tell */
}

TEST(greater_gains_make_it_oscillate)
{
    struct limb_host host = host_of_position(0x20, 0x03, 3); /* kp 800, ki 3 */

    run_limb(&host);
    assert_true(host.q_max - host.q_min > 3.0 * TICK);
}
