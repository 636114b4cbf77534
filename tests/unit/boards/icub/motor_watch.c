/* SPDX-License-Identifier: Apache-2.0 */
/* What iCub motor boards watch: time-outs, torque sources, faults, joint limits. */
#include "tests/unit/boards/icub/motor_bench.h"

static void count_to_timeout(bool strict, int64_t timeout_ns, int *ticks)
{
    struct board_bench bench;

    bench_configure(&bench);
    bench.board[0].strict = strict;
    bench.board[0].command_timeout_ns = timeout_ns;
    bench_start(&bench);
    bench_send(&bench, 0, 0x001, "5B 01 06; 52 00 00 00 00 00 00 00; 54 00 00 35 05 35 05");
    set_mode(&bench, 0x50);
    bench_tick(&bench);
    bench_send(&bench, 0, 0x001, "72 4D 01");
    for (*ticks = 0; *ticks < 10000; ++*ticks) {
        bench_tick(&bench);
        if (bench.motor[0].voltage_v == 0.0) {
            break;
        }
    }
    assert_int_equal(bench_counters(&bench).timeouts, *ticks < 10000);
    assert_true(bench.motor[0].bridge_on);
    bench_stop(&bench);
}

TEST(a_stale_voltage_becomes_zero_after_our_time_out)
{
    int ticks;

    count_to_timeout(false, 100000000, &ticks);
    assert_int_equal(ticks, 100);
    count_to_timeout(false, 0, &ticks); /* off */
    assert_int_equal(ticks, 10000);
    count_to_timeout(true, 100000000, &ticks); /* a strict board drives on */
    assert_int_equal(ticks, 10000);
}

TEST_ON(a_fresh_voltage_resumes_after_the_time_out, bench_configure, bench)
{
    struct board_event event;

    bench->board[0].command_timeout_ns = 50000000;
    bench_start(bench);
    set_mode(bench, 0x50);
    for (int i = 0; i < 500; i++) { /* fresh often enough: no time-out */
        if (i % 40 == 0) {
            bench_send(bench, 0, 0x001, "72 4D 01");
        }
        bench_tick(bench);
        assert_true(bench->motor[0].voltage_v > 11.0);
    }
    assert_int_equal(bench_counters(bench).timeouts, 0);
    bench_ticks(bench, 60);
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_counters(bench).timeouts, 1);
    assert_true(bench_event(bench, BOARD_EVENT_TIMEOUT, &event));
    assert_int_equal(event.a, 0x50);
    assert_int_equal(event.axis, 0);
    bench_ticks(bench, 500); /* once, not again and again */
    assert_int_equal(bench_counters(bench).timeouts, 1);
    bench_say(bench, 0, 0x001, "72 4D 01");
    assert_true(bench->motor[0].voltage_v > 11.0);
}

TEST_ON(a_velocity_without_fresh_commands_becomes_zero, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "56 64 00"); /* 100 ms */
    set_mode(bench, 0x02);
    bench_send(bench, 0, 0x001, "1C 20 00 00 01"); /* 32/16 = 2 ticks/ms, reached at once */
    bench_ticks(bench, 50);
    bench_ask(bench, "3A", "3A 20 00");
    bench_send(bench, 0, 0x001, "1C 20 00 00 01");
    bench_ticks(bench, 101);
    bench_ask(bench, "18", "18 00 00");
    assert_int_equal(bench_counters(bench).timeouts, 1);
    bench_ask(bench, "3A", "3A 00 00");
    assert_int_equal(mode_of(bench), 0x02);
}

/* The time-out of 100 ms is over in the tick that begins later, not in the one that begins then. */
TEST_ON(a_velocity_lives_as_long_as_its_time_out, bench_open, bench)
{
    int ticks = 0;

    bench_send(bench, 0, 0x001, "56 64 00");
    set_mode(bench, 0x02);
    bench_tick(bench);
    bench_send(bench, 0, 0x001, "1C 20 00 00 01");
    while (bench_counters(bench).timeouts == 0 && ticks < 1000) {
        bench_tick(bench);
        ticks++;
    }
    assert_int_equal(ticks, 101);
}

TEST_ON(a_silent_torque_source_disables_torque_modes, board_bench, bench)
{
    static const unsigned modes[] = {0x03, 0x04, 0x05};
    struct board_event event;
    int ticks;

    for (size_t i = 0; i < 3; i++) {
        bench_open(bench);
        bench_send(bench, 0, 0x20c, "07 00");                   /* the pseudo-STRAIN speaks */
        bench_send(bench, 0, 0x001, "34 0C 01 00 00 00 00 00"); /* and the axis listens */
        bench_ticks(bench, 10);
        set_mode(bench, modes[i]);
        bench_ticks(bench, 1000);
        assert_int_equal(mode_of(bench), modes[i]);
        bench_send(bench, 0, 0x20c, "07 01");
        for (ticks = 0; bench->motor[0].bridge_on && ticks < 1000; ticks++) {
            bench_tick(bench);
        }
        assert_int_equal(ticks, 198); /* the last frame is two ticks old */
        assert_int_equal(mode_of(bench), 0x00);
        assert_false(bench->motor[0].bridge_on);
        assert_true(bench_event(bench, BOARD_EVENT_SOURCE_LOST, &event));
        assert_int_equal(event.a, 0x0c);
        assert_int_equal(bench_counters(bench).timeouts, 1);
    }
}

TEST_ON(torque_of_real_strain_boards_on_the_bus_is_heard, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "34 05 04 00 00 00 00 00; 49 00 01 00 00"); /* DEBUG */
    to_slot_0(bench);
    bench_send(bench, 0, 0x35b, "00 80 10 80 F0 7F"); /* channels 3 4 5 */
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x119, "10 00 00 00 00 00 00 00");
}

/* What axis 0 takes its torque for, from the DEBUG frame. */
static int torque_of(struct board_bench *bench)
{
    to_slot_0(bench);
    bench_ticks(bench, 4);
    assert_int_equal(bench_sent(bench, 0, 0x119), 1);
    return (int16_t)get_u16_le(bench_find(bench, 0, 0x119)->data);
}

/* 0x0C is the address of our own pseudo-STRAIN: whoever else sends as it is an impostor. */
TEST_ON(strain_frames_with_an_address_of_ours_are_not_believed, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "34 0C 00 00 00 00 00 00; 49 00 01 00 00"); /* DEBUG */
    bench_send(bench, 0, 0x3ca, "10 80 00 80 00 80");
    assert_int_equal(torque_of(bench), 0);
    bench->sense[0].torque_nm = 27.5; /* half of the full scale: what the board itself sends */
    bench_send(bench, 0, 0x20c, "07 00");
    bench_ticks(bench, 8);
    bench_send(bench, 0, 0x3ca, "10 80 00 80 00 80");
    assert_int_equal(torque_of(bench), 0x4000);

    /* where it moves is its own too, and what it left is not */
    bench_send(bench, 0, 0x20c, "32 05");
    bench_send(bench, 0, 0x001, "34 05 00 00 00 00 00 00");
    bench_ticks(bench, 8);
    bench_send(bench, 0, 0x35a, "10 80 00 80 00 80");
    assert_int_equal(torque_of(bench), 0x4000);
    bench_send(bench, 0, 0x001, "34 0C 00 00 00 00 00 00");
    bench_send(bench, 0, 0x3ca, "10 80 00 80 00 80");
    assert_int_equal(torque_of(bench), 0x10);
    bench_send(bench, 0, 0x3ca, "20 80 00 80 00 80 05"); /* saturated, and it is heard still */
    assert_int_equal(torque_of(bench), 0x20);
    bench_send(bench, 0, 0x3ca, "30 80 00 80 00"); /* no length of theirs */
    bench_send(bench, 0, 0x3ca, "30 80 00 80 00 80 00 00");
    assert_int_equal(torque_of(bench), 0x20);
}

/* ---- faults ---- */

TEST_ON(over_current_trips_once_and_is_told_once, board_bench, bench)
{
    static const char *const limit[] = {"48 E8 03 00 00", "C8 E8 03 00 00"}; /* 1000 mA */
    static const char *const run[] = {"09 50", "89 50"};
    static const char *const status[] = {"08 A0 00 00 00 00 00 00", "00 00 08 A0 00 00 00 00"};

    for (int axis = 0; axis < 2; axis++) {
        struct board_event event;

        bench_open(bench);
        bench_send(bench, 0, 0x001, "49 04 00 00 00");
        bench_send(bench, 0, 0x001, limit[axis]);
        bench_send(bench, 0, 0x001, run[axis]);
        bench_ticks(bench, 4);
        bench->sense[axis].current_a = 1.0; /* at the limit is not above it */
        bench_ticks(bench, 1000);
        assert_int_equal(bench_counters(bench).trips, 0);
        bench->sense[axis].current_a = -4.0;
        bench_ticks(bench, 2);
        assert_false(bench->motor[axis].bridge_on);
        assert_near(bench->motor[axis].voltage_v, 0.0, 0.0);
        assert_int_equal(bench_counters(bench).trips, 1);
        assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
        assert_int_equal(event.a, 0x08);
        assert_int_equal(event.axis, axis);
        bench_tick(bench); /* slot 2 */
        bench_expect(bench, 0, 0x113, status[axis]);
        for (int i = 0; i < 40; i++) {
            bench_tick(bench);
            assert_int_equal(bench_sent(bench, 0, 0x113), 0);
        }
        /* whatever is told later, the trip is not told again */
        bench_send(bench, 0, 0x001, axis ? "89 09" : "09 09");
        bench_ticks(bench, 4);
        bench_expect(bench, 0, 0x113, "00 00 00 00 00 00 00 00");
        assert_int_equal(bench_counters(bench).trips, 1);
    }
}

/* COMAN's drive with a quarter of 48 V from standstill: 15 A, above 12 A for 3 ms. */
TEST_ON(the_inrush_of_a_voltage_step_does_not_trip, bench_open, bench)
{
    static const double inrush_a[] = {14.88, 14.44, 12.17, 10.03, 8.27, 6.85};

    set_mode(bench, 0x50);
    bench_send(bench, 0, 0x001, "72 4D 01");
    for (size_t i = 0; i < sizeof inrush_a / sizeof *inrush_a; i++) {
        bench_tick(bench);
        bench->sense[0].current_a = inrush_a[i];
    }
    bench_ticks(bench, 100);
    assert_int_equal(bench_counters(bench).trips, 0);
}

/* An axis that rests saves no heat for later. It trips above 10 ms of heat: twice the limit heats
 * it by 3 a ms, 1.5 times the limit by 1.25. */
TEST_ON(a_rest_gives_no_credit_to_an_over_current, board_bench, bench)
{
    for (int half = 0; half < 2; half++) {
        int ticks = 0;

        bench_open(bench);
        bench_send(bench, 0, 0x001, "48 E8 03 00 00"); /* 1000 mA */
        set_mode(bench, 0x50);
        bench_ticks(bench, 1000);
        bench->sense[0].current_a = half ? 1.5 : 2.0;
        boards_sample(bench->boards, bench->now_ns, &bench->sensors);
        while (bench_counters(bench).trips == 0 && ticks < 1000) {
            bench_tick(bench);
            ticks++;
        }
        assert_int_equal(ticks, half ? 9 : 4);
    }
}

/* A count is 0.1 degree C: 100.0 is the limit, 100.1 is above it. A thermometer whose value is not
 * a number trips no motor, also after a hot value, and STATUS reports the thermometer as bad. */
TEST_ON(a_hot_winding_trips_and_a_failed_thermometer_does_not, bench_open, bench)
{
    struct board_event event;

    bench_send(bench, 0, 0x001, "49 04 00 00 00");
    set_mode(bench, 0x50);
    bench->sense[0].winding_c = 100.0;
    bench_ticks(bench, 8); /* a limit of 0 is none */
    assert_true(bench->motor[0].bridge_on);
    bench_send(bench, 0, 0x001, "79 E8 03"); /* SET_TEMPERATURE_LIMIT */
    bench_ticks(bench, 8);
    assert_true(bench->motor[0].bridge_on);
    bench->sense[0].winding_c = 100.1;
    bench_ticks(bench, 3);
    assert_false(bench->motor[0].bridge_on);
    assert_int_equal(bench_counters(bench).trips, 1);
    assert_true(bench_event(bench, BOARD_EVENT_OVER_HEATED, &event));
    assert_int_equal(event.axis, 0);
    assert_int_equal(event.a, 1001);
    bench_ticks(bench, 4);
    bench->sense[0].winding_c = (double)NAN;
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 A0 00 00 00 08 00 00");
    set_mode(bench, 0x09);
    set_mode(bench, 0x50);
    bench_ticks(bench, 20);
    assert_true(bench->motor[0].bridge_on);
    assert_int_equal(bench_counters(bench).trips, 1);
}

/* The state of the CAN controller begins at 96 and at 128, of each counter by itself. */
TEST_ON(can_states_begin_at_their_counts, board_bench, bench)
{
    static const struct {
        unsigned tec, rec, status;
    } cases[] = {{127, 0, 0x00}, {128, 0, 0x04}, {0, 95, 0x00},
                 {0, 96, 0x20},  {0, 127, 0x20}, {0, 128, 0x28}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct board_can_state can = {.tec = cases[i].tec, .rec = cases[i].rec};
        const struct bus_frame *frame;

        bench_open(bench);
        bench_send(bench, 0, 0x001, "49 04 00 00 00");
        bench_ticks(bench, 8);
        boards_set_can_state(bench->boards, 0, &can);
        set_mode(bench, 0x50); /* each change of mode gives an event */
        frame = bench_next_status(bench);
        assert_non_null(frame);
        assert_int_equal(frame->data[4], cases[i].status);
    }
}

TEST_ON(under_voltage_is_a_fault_as_long_as_it_lasts, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "49 04 00 00 00");
    set_mode(bench, 0x50);
    bench_ticks(bench, 4);
    bench->sensors.supply_v = 20.0;
    bench_ticks(bench, 3);
    bench_expect(bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    set_mode(bench, 0x09);
    set_mode(bench, 0x50); /* trips again at once */
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x113, "01 A0 01 00 00 00 00 00");
    bench->sensors.supply_v = 48.0;
    bench_ticks(bench, 4);
    assert_int_equal(bench_sent(bench, 0, 0x113), 0);
    bench_send(bench, 0, 0x001, "09 09");
    bench_ticks(bench, 4);
    bench_expect(bench, 0, 0x113, "00 00 00 00 00 00 00 00");
}

TEST_ON(a_sensor_without_a_number_is_an_encoder_fault, bench_configure, bench)
{
    bench->sense[0].q = 0.25;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "49 04 00 00 00");
    set_mode(bench, 0x50);
    bench_ticks(bench, 4);
    bench->sense[0].q = (double)NAN;
    bench_ticks(bench, 3);
    bench_expect(bench, 0, 0x113, "20 A0 00 00 00 00 00 00");
    bench_ask(bench, "14", "14 C4 09 00 00 00 00"); /* the last that it knew */
    bench->sense[0].q = 0.25;
    bench->sense[0].current_a = (double)INFINITY;
    bench_ticks(bench, 8);
    assert_int_equal(mode_of(bench), 0xa0);
}

TEST_ON(voltage_beyond_a_joint_limit_is_refused_both_ways, bench_open, bench)
{
    struct board_event event;

    bench_send(bench, 0, 0x001, "49 20 00 00 00"); /* PRINT */
    set_mode(bench, 0x50);
    bench->sense[0].q = 2.5; /* at the limit */
    bench_send(bench, 0, 0x001, "72 4D 01");
    bench_ticks(bench, 3);
    assert_true(bench->motor[0].voltage_v > 11.0);
    bench->sense[0].q = 2.5002;
    bench_ticks(bench, 2);
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_sent(bench, 0, 0x116), 3);
    bench_expect_frame(&bench->frame[0][0], 0x116, "06 00 4F 55 54 20 4F 46"); /* "OUT OF" */
    bench_expect_frame(&bench->frame[0][1], 0x116, "06 01 20 4C 49 4D 49 54"); /* " LIMIT" */
    bench_expect_frame(&bench->frame[0][2], 0x116, "86 02 53");                /* "S", the last */
    bench_ask(bench, "73", "73 00 00");
    bench_say(bench, 0, 0x001, "72 B3 FE"); /* back is refused, too */
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    assert_int_equal(bench_sent(bench, 0, 0x116), 0); /* told once */
    assert_true(bench_event(bench, BOARD_EVENT_LIMIT, &event));
    assert_false(bench_event(bench, BOARD_EVENT_LIMIT, &event));
    bench->sense[0].q = -2.1;
    bench_tick(bench);
    bench_say(bench, 0, 0x001, "72 4D 01");
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
    bench->sense[0].q = 0.0;
    bench_tick(bench);
    bench_say(bench, 0, 0x001, "72 4D 01");
    assert_true(bench->motor[0].voltage_v > 11.0);
}
