/* SPDX-License-Identifier: Apache-2.0 */
/* Windings that heat: what the boards tell of their temperature and when they stop. */
#include "boards/sensing/sensing.h"
#include "tests/protocol_file.h"
#include "tests/unit/boards/board_bench.h"

#define LIMIT_C 70.0

enum { BOARD_STATUS = 5 };

static void configure(struct board_bench *bench)
{
    bench_configure(bench);
    for (int i = 0; i < BENCH_BOARDS; i++) {
        bench->board[i].transmit_at_start = true;
        for (int k = 0; k < BOARD_AXES_MAX; k++) {
            bench->board[i].axis[k].temperature_limit_c = LIMIT_C;
        }
    }
    for (int j = 0; j < BENCH_JOINTS; j++) {
        bench->sense[j].winding_c = 25.0;
    }
}

static inline void set_up(struct board_bench *bench)
{
    configure(bench);
    bench_start(bench);
    bench_send(bench, 0, 0x001, "09 50; 89 50");
    bench_ticks(bench, 8);
    assert_true(bench->motor[0].bridge_on && bench->motor[1].bridge_on);
}

BENCH(set_up, struct board_bench, bench_stop)

TEST_ON(an_axis_above_its_limit_stops_and_says_so_in_status, set_up, bench)
{
    struct board_event event;

    bench->sense[0].winding_c = LIMIT_C; /* not yet above */
    assert_null(bench_next_status(bench));
    assert_true(bench->motor[0].bridge_on);
    bench->sense[0].winding_c = LIMIT_C + 0.1;
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 A0 00 50 00 02 00 00");
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench->motor[1].bridge_on);
    assert_true(bench_event(bench, BOARD_EVENT_OVER_HEATED, &event));
    assert_int_equal(event.axis, 0);
    assert_int_equal(event.a, 701);
    bench->sense[1].winding_c = 90.0;
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 A0 00 A0 00 06 00 00");
    assert_int_equal(bench_counters(bench).trips, 2);
}

TEST_ON(a_hot_axis_trips_again_until_it_has_cooled, set_up, bench)
{
    bench->sense[0].winding_c = 80.0;
    bench_ticks(bench, 8);
    bench_say(bench, 0, 0x001, "09 09; 09 50");
    assert_false(bench->motor[0].bridge_on);
    bench->sense[0].winding_c = 69.9;
    bench_ticks(bench, 8);
    bench_send(bench, 0, 0x001, "09 09; 09 50");
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 50 00 50 00 00 00 00");
}

TEST_ON(the_host_reads_and_moves_the_limit, set_up, bench)
{
    bench_ask(bench, "7A", "7A BC 02"); /* 700: 0.1 degree C a count */
    bench_send(bench, 0, 0x001, "79 2C 01");
    bench_ask(bench, "7A", "7A 2C 01");
    bench_ask(bench, "FA", "FA BC 02"); /* the other axis has its own */
    bench->sense[0].winding_c = bench->sense[1].winding_c = 30.1;
    bench_ticks(bench, 2);
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench->motor[1].bridge_on);
    bench_send(bench, 0, 0x001, "F9 00 00"); /* no limit at all */
    bench->sense[1].winding_c = 500.0;
    bench_ticks(bench, 10);
    assert_true(bench->motor[1].bridge_on);
}

TEST_ON(a_thermometer_without_a_number_is_told_and_stops_nothing, set_up, bench)
{
    bench->sense[1].winding_c = NAN;
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 50 00 50 00 10 00 00");
    assert_true(bench->motor[1].bridge_on);
}

/* T(t) = ambient + R I^2 Rth (1 - exp(-t / tau)); from 70.05 C on a reading rounds up to 70.1 C,
 * which is above the limit. */
TEST_ON(the_trip_comes_when_the_winding_s_law_says, set_up, bench)
{
    const struct sensor_thermal thermal = {
        .ambient_c = 25.0, .resistance_ohm = 0.664, .k_per_w = 1.5, .time_constant_s = 0.5};
    struct sensor_joint joint[BENCH_JOINTS] = {{.name = "hip", .thermal = thermal}};
    struct sensing_config config = {
        .njoint = BENCH_JOINTS, .nft = 1, .joint = joint, .tick_ns = 1000000, .seed = 1};
    const double current_a = 10.0, end = 0.664 * 100.0 * 1.5;
    double expected_s = -0.5 * log(1.0 - (70.05 - 25.0) / end);
    struct plant_sensors truth;
    struct motor_sense true_sense[BENCH_JOINTS] = {{.current_a = current_a}};
    struct sensing *sensing;
    struct arena arena CLOSED_BY(arena_fini);
    struct error error;
    int ms = 0;

    for (int j = 1; j < BENCH_JOINTS; j++) {
        joint[j].name = "other";
    }
    assert_ok(arena_init(&arena, 8u << 20, &error));
    assert_ok(sensing_create(&config, &arena, &sensing, &error));
    truth = bench->sensors;
    truth.motor = true_sense;
    do {
        bench->sensors = *sensing_sample(sensing, truth.time_ns, &truth);
        bench_tick(bench);
        truth.time_ns += config.tick_ns;
    } while (bench->motor[0].bridge_on && ms++ < 1000);
    assert_near(ms * 1e-3, expected_s, 0.002);
}

/* ---- the other protocols ---- */

TEST_ON(a_2foc_with_a_thermometer_trips_with_over_heating, board_bench, bench)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_foc}};

    for (int thermometer = 0; thermometer < 2; thermometer++) {
        configure(bench);
        bench->config.bus = buses;
        bench->config.nboard = 1;
        bench->board[0].axis[0].gear = 100.0;
        bench_start(bench);
        bench_send(bench, 0, 0x001, "5B 01 06");
        bench_send(bench, 0, 0x001, thermometer ? "77 05 00 10 00 00 0E" : "77 01 00 10 00 00 0E");
        bench_send(bench, 0, 0x001, "48 00 A0 0F 40 1F 20 4E; 65 92 00 E3 00 00 00 0F; 09 50");
        bench_send(bench, 0, 0x10f, "00 00");
        bench->sense[0].winding_c = LIMIT_C;
        bench_ticks(bench, 2);
        assert_true(bench->motor[0].bridge_on);
        bench->sense[0].winding_c = LIMIT_C + 0.1;
        bench_tick(bench);
        bench_say(bench, 0, 0x10f, "00 00");
        assert_int_equal(bench->motor[0].bridge_on, !thermometer);
        bench_expect(bench, 0, 0x113,
                     thermometer ? "A0 00 00 00 00 02 00 00" : "50 00 00 00 00 00 00 00");
    }
}

BENCH(configure, struct board_bench, bench_stop)

TEST_ON(a_compact_board_tells_whole_degrees_and_trips_at_its_limit, configure, bench)
{
    const struct boards_bus_config buses[BENCH_BUSES] = {
        {.protocol = &protocol_compact, .described = protocol_file("compact")}};

    bench->config.bus = buses;
    bench->config.nboard = 1;
    bench->board[0].axis[2].joint = bench->board[0].axis[3].joint = -1;
    bench_start(bench);
    bench_send(bench, 0, 0x020, "01 03 00 00 00");
    bench->sense[0].winding_c = 70.4;
    bench_ticks(bench, 2);
    assert_true(bench->motor[0].bridge_on && bench->motor[1].bridge_on);
    bench->sense[0].winding_c = 70.6;
    bench_ticks(bench, 2);
    bench_expect(bench, 0, 0x200, "07 40 00 80 BB 47 00 00");
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench->motor[1].bridge_on);
}
