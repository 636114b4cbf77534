/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Homing by switches and index pulses: the place that each method of CiA 402-2 finds, from either
 * side of the home switch and from on it, in the drawings of the standard; what it says meanwhile.
 */
#include "tests/unit/boards/cia402/cia402_motor.h"

#define NEGATIVE_RAD (-1.0)
#define POSITIVE_RAD 1.0
#define HOME_LEFT_RAD 0.2
#define HOME_RIGHT_RAD 0.4
#define PITCH_RAD 0.07

enum { HOMING = 6, START = 0x1f, REST = 0x0f, TICKS_MOST = 9000 };

static void open_motor(struct motor *motor, double angle)
{
    memset(motor, 0, sizeof *motor);
    configure(&motor->bench);
    motor->bench.board[0].axis[0].switches = (struct board_switches){
        .negative = true,
        .positive = true,
        .home = true,
        .negative_rad = NEGATIVE_RAD,
        .positive_rad = POSITIVE_RAD,
        .home_rad = {HOME_LEFT_RAD, HOME_RIGHT_RAD},
        .index_rad = PITCH_RAD,
    };
    motor->angle = angle;
    motor->bench.sense[0].q = motor->bench.sense[0].qm = angle;
    start_motor(motor, HOMING);
    put(motor, 0x6099, 1, 4, 100000); /* 1 rad/s to the switch, 0.1 to its edge */
    put(motor, 0x6099, 2, 4, 10000);
    put(motor, 0x609a, 0, 4, 1000000);
}

/* Homes; the statusword at the end. */
static unsigned home(struct motor *motor, int method)
{
    put(motor, 0x6098, 0, 1, method);
    put(motor, 0x6040, 0, 2, START);
    for (int t = 0; t < TICKS_MOST; t++) {
        unsigned status = (unsigned)get(motor, 0x6041);

        if (status & 0x0400 && status & 0x3000) {
            return status & 0x3400;
        }
    }
    return (unsigned)get(motor, 0x6041) & 0x3400;
}

TEST(every_method_finds_its_place)
{
    enum { LEFT = 1, ON = 2, RIGHT = 4, ANY = 7 };
    static const double starts[] = {-0.5, 0.3, 0.7};
    static const struct {
        int method, from;
        double place;
    } rows[] = {
        {1, ANY, -14 * PITCH_RAD},        {2, ANY, 14 * PITCH_RAD},
        {3, LEFT | ON, 2 * PITCH_RAD},    {4, LEFT | ON, 3 * PITCH_RAD},
        {5, RIGHT | ON, 6 * PITCH_RAD},   {6, RIGHT | ON, 5 * PITCH_RAD},
        {7, ANY, 2 * PITCH_RAD},          {8, ANY, 3 * PITCH_RAD},
        {9, ANY, 5 * PITCH_RAD},          {10, ANY, 6 * PITCH_RAD},
        {11, ANY, 6 * PITCH_RAD},         {12, ANY, 5 * PITCH_RAD},
        {13, ANY, 3 * PITCH_RAD},         {14, ANY, 2 * PITCH_RAD},
        {17, ANY, NEGATIVE_RAD},          {18, ANY, POSITIVE_RAD},
        {19, LEFT | ON, HOME_LEFT_RAD},   {20, LEFT | ON, HOME_LEFT_RAD},
        {21, RIGHT | ON, HOME_RIGHT_RAD}, {22, RIGHT | ON, HOME_RIGHT_RAD},
        {23, ANY, HOME_LEFT_RAD},         {24, ANY, HOME_LEFT_RAD},
        {25, ANY, HOME_RIGHT_RAD},        {26, ANY, HOME_RIGHT_RAD},
        {27, ANY, HOME_RIGHT_RAD},        {28, ANY, HOME_RIGHT_RAD},
        {29, ANY, HOME_LEFT_RAD},         {30, ANY, HOME_LEFT_RAD},
        {33, LEFT, -8 * PITCH_RAD},       {34, LEFT, -7 * PITCH_RAD},
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        for (int from = 0; from < 3; from++) {
            struct motor motor;
            double found;

            if (!(rows[i].from >> from & 1)) {
                continue;
            }
            open_motor(&motor, starts[from]);
            put(&motor, 0x607c, 0, 4, 5000); /* 0 is 0.05 rad beyond the home position */
            assert_int_equal(home(&motor, rows[i].method), 0x1400);
            turn(&motor, 50);
            found = motor.angle - (double)get(&motor, 0x6064) * 1e-5 - 0.05;
            if (fabs(found - rows[i].place) > 0.6e-3) {
                fail_msg("method %d from %g rad: %.5f rad, not %.5f", rows[i].method, starts[from],
                         found, rows[i].place);
            }
            bench_stop(&motor.bench);
        }
    }
}

TEST_WITH(a_search_into_a_limit_switch_is_an_error, NULL, motor_tear_down)
{
    open_motor(&the_motor, 0.7);
    assert_int_equal(home(&the_motor, 19), 0x2400);
    assert_near(the_motor.velocity, 0.0, 0.05);
    assert_near(the_motor.angle, POSITIVE_RAD, 0.1);
    assert_int_equal(get(&the_motor, 0x6041) & 0x6f, 0x27); /* enabled, no fault */
}

TEST_WITH(homing_stops_when_it_is_no_longer_asked_for, NULL, motor_tear_down)
{
    double before;

    open_motor(&the_motor, -0.5);
    put(&the_motor, 0x6098, 0, 1, 17);
    control(&the_motor, START, 200);
    assert_int_equal(get(&the_motor, 0x6041) & 0x3400, 0); /* on its way */
    assert_near(the_motor.velocity, -1.0, 0.05);

    /* halt keeps it waiting */
    control(&the_motor, START | 0x100, 200);
    assert_near(the_motor.velocity, 0.0, 1e-2);
    control(&the_motor, START, 120);
    assert_near(the_motor.velocity, -1.0, 0.05);

    control(&the_motor, REST, 200);
    before = the_motor.angle;
    turn(&the_motor, 200);
    assert_near(the_motor.angle, before, 1e-3);
    assert_int_equal(get(&the_motor, 0x6041) & 0x3400, 0x0400); /* neither home nor an error */
}

TEST(inputs_and_methods_are_those_of_the_switches)
{
    static const struct {
        double angle;
        unsigned inputs;
    } rows[] = {{-1.2, 1}, {-0.5, 0}, {0.3, 4}, {0.5, 0}, {1.1, 2}};
    static const int8_t all[] = {1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 17, 18,
                                 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 33, 34, 35, 37};
    struct board_bench base, *bench = &base;
    struct motor motor;

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        open_motor(&motor, rows[i].angle);
        assert_int_equal(get(&motor, 0x60fd), rows[i].inputs);
        bench_stop(&motor.bench);
    }
    open_motor(&motor, 0.0);
    for (unsigned i = 0; i < sizeof all; i++) {
        assert_int_equal(sdo_read(&motor.bench, 0, 4, 0x60e3, i + 1) & 0xff, all[i]);
        assert_int_equal(sdo_write(&motor.bench, 0, 4, 0x6098, 0, 1, (uint8_t)all[i]), 0);
    }
    assert_int_equal(sdo_write(&motor.bench, 0, 4, 0x6098, 0, 1, 36), 0x06090030);
    bench_stop(&motor.bench);

    /* a joint without switches is home where it stands */
    start(bench);
    assert_int_equal(READ(0x60e3, 1) & 0xff, 35);
    assert_int_equal(READ(0x60e3, 2) & 0xff, 37);
    assert_int_equal(READ(0x60e3, 3) & 0xff, 0);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6098, 0, 1, 33), 0x06090030);
    bench_stop(bench);
}
