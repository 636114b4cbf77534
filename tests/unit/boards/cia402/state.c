/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state machine against the table of transitions of IEC 61800-7-201 (CiA 402-2), 6.2.3: every
 * state, every command, and the reactions that the option codes choose. The table is written from
 * the standard's text, not from the program's; a case is passed, failed, or not applicable where a
 * state lasts less than a tick. The list goes to standard output with CIA402_TABLE set.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

enum { SHUTDOWN, SWITCH_ON, DISABLE_VOLTAGE, QUICK_STOP, ENABLE, RESET, WORDS };

static const struct {
    const char *name;
    uint16_t word;
} words[WORDS] = {{"shutdown", 0x06},   {"switch on", 0x07},        {"disable voltage", 0x00},
                  {"quick stop", 0x02}, {"enable operation", 0x0f}, {"fault reset", 0x80}};

/* Bits of the statusword that tell a state, and the state in them (table "state coding") */
static const struct {
    const char *name;
    uint16_t mask, bits;
} codes[CIA402_STATES] = {
    {"not ready to switch on", 0x4f, 0x00}, {"switch on disabled", 0x4f, 0x40},
    {"ready to switch on", 0x6f, 0x21},     {"switched on", 0x6f, 0x23},
    {"operation enabled", 0x6f, 0x27},      {"quick stop active", 0x6f, 0x07},
    {"fault reaction active", 0x4f, 0x0f},  {"fault", 0x4f, 0x08}};

enum { SAME = 0 };

/* The number of the transition, 0: stays. Rows: states from SWITCH ON DISABLED on. All commands
 * but the fault reset have bit 7 = 0 in the table "command coding", so that a word with bit 7 is
 * none of them. */
static const struct {
    enum cia402_state from;
    int transition[WORDS];
} table[] = {
    {CIA402_SWITCH_ON_DISABLED, {2, SAME, SAME, SAME, SAME, SAME}},
    {CIA402_READY_TO_SWITCH_ON, {SAME, 3, 7, 7, 4, SAME}},
    {CIA402_SWITCHED_ON, {6, SAME, 10, 10, 4, SAME}},
    {CIA402_OPERATION_ENABLED, {8, 5, 9, 11, SAME, SAME}},
    {CIA402_QUICK_STOP_ACTIVE, {SAME, SAME, 12, SAME, 16, SAME}},
    {CIA402_FAULT, {SAME, SAME, SAME, SAME, SAME, 15}},
};

/* Where a transition leads; the fourth from READY TO SWITCH ON passes the third */
static const enum cia402_state to[] = {
    [2] = CIA402_READY_TO_SWITCH_ON,  [3] = CIA402_SWITCHED_ON,
    [4] = CIA402_OPERATION_ENABLED,   [5] = CIA402_SWITCHED_ON,
    [6] = CIA402_READY_TO_SWITCH_ON,  [7] = CIA402_SWITCH_ON_DISABLED,
    [8] = CIA402_READY_TO_SWITCH_ON,  [9] = CIA402_SWITCH_ON_DISABLED,
    [10] = CIA402_SWITCH_ON_DISABLED, [11] = CIA402_QUICK_STOP_ACTIVE,
    [12] = CIA402_SWITCH_ON_DISABLED, [15] = CIA402_SWITCH_ON_DISABLED,
    [16] = CIA402_OPERATION_ENABLED};

static void report(const char *from, const char *by, int number, const char *verdict)
{
    if (getenv("CIA402_TABLE")) {
        printf("%-22s %-22s transition %2d  %s\n", from, by, number, verdict);
    }
}

static bool is_in(struct board_bench *bench, enum cia402_state state)
{
    return (sdo_read(bench, 0, 4, 0x6041, 0) & codes[state].mask) == codes[state].bits;
}

static void control(struct board_bench *bench, unsigned word)
{
    assert_int_equal(sdo_write(bench, 0, 4, 0x6040, 0, 2, word), 0);
}

/* In voltage mode, by the shortest way. */
static void bring_to(struct board_bench *bench, enum cia402_state state)
{
    static const struct {
        int count;
        uint16_t word[4];
    } ways[CIA402_STATES] = {
        [CIA402_READY_TO_SWITCH_ON] = {1, {0x06}},
        [CIA402_SWITCHED_ON] = {2, {0x06, 0x07}},
        [CIA402_OPERATION_ENABLED] = {3, {0x06, 0x07, 0x0f}},
        [CIA402_QUICK_STOP_ACTIVE] = {4, {0x06, 0x07, 0x0f, 0x02}},
    };

    start(bench);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6060, 0, 1, 0xff), 0);
    assert_int_equal(sdo_write(bench, 0, 4, 0x605a, 0, 2, 6), 0); /* stays */
    for (int i = 0; i < ways[state].count; i++) {
        control(bench, ways[state].word[i]);
    }
    if (state == CIA402_FAULT) {
        bench->sensors.supply_v = 10.0;
        bench_ticks(bench, 3);
        bench->sensors.supply_v = SUPPLY_V;
        bench_ticks(bench, 3);
    }
    assert_true(is_in(bench, state));
}

TEST(every_command_in_every_state_makes_its_transition)
{
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        for (int w = 0; w < WORDS; w++) {
            const int number = table[i].transition[w];
            const enum cia402_state wanted = number ? to[number] : table[i].from;
            struct board_bench base, *bench = &base;
            bool passed;

            bring_to(bench, table[i].from);
            control(bench, words[w].word);
            bench_ticks(bench, 3);
            passed = is_in(bench, wanted);
            report(codes[table[i].from].name, words[w].name, number, passed ? "passed" : "FAILED");
            if (!passed) {
                fail_msg("from %s by %s: status 0x%04x, not %s", codes[table[i].from].name,
                         words[w].name, READ(0x6041, 0), codes[wanted].name);
            }
            assert_int_equal(bench->motor[0].bridge_on, wanted == CIA402_OPERATION_ENABLED ||
                                                            wanted == CIA402_QUICK_STOP_ACTIVE);
            bench_stop(bench);
        }
    }

    /* Those that no controlword makes */
    report("start", "power-up", 0, "passed: see the next test");
    report("not ready to switch on", "automatic", 1, "passed: see the next test");
    report("any", "a fault", 13, "passed: see the tests of faults");
    report("fault reaction active", "automatic", 14, "passed: see the tests of faults");
    report("fault reaction active", "any controlword", 0, "not applicable in voltage mode");
}

TEST_ON(a_drive_starts_not_ready_and_then_disabled, start, bench)
{
    struct board_event event;

    assert_true(bench_event(bench, BOARD_EVENT_MODE, &event));
    assert_int_equal(event.a, CIA402_NOT_READY); /* 0 and 1 */
    assert_int_equal(event.b, CIA402_SWITCH_ON_DISABLED);
    assert_true(is_in(bench, CIA402_SWITCH_ON_DISABLED));
}

/* Bit 4 voltage enabled, 9 remote */
TEST_ON(the_statusword_tells_supply_and_remote, start, bench)
{
    assert_int_equal(sdo_read(bench, 0, 4, 0x6041, 0) & 0x0290, 0x0210);
    bench->sensors.supply_v = 10.0;
    bench_ticks(bench, 3);
    assert_int_equal(sdo_read(bench, 0, 4, 0x6041, 0) & 0x0290, 0x0200);
}

TEST_ON(a_fault_reset_needs_an_edge_and_the_cause_gone, board_bench, bench)
{
    bring_to(bench, CIA402_OPERATION_ENABLED);
    bench->sensors.supply_v = 10.0;
    bench_ticks(bench, 3);
    assert_true(is_in(bench, CIA402_FAULT));
    assert_false(bench->motor[0].bridge_on);
    control(bench, 0x80);
    assert_true(is_in(bench, CIA402_FAULT));
    bench->sensors.supply_v = SUPPLY_V;
    bench_ticks(bench, 3);
    control(bench, 0x80); /* no edge */
    assert_true(is_in(bench, CIA402_FAULT));
    control(bench, 0x00);
    control(bench, 0x8f); /* a command beside it does not count */
    assert_true(is_in(bench, CIA402_SWITCH_ON_DISABLED));
    control(bench, 0x86);
    assert_true(is_in(bench, CIA402_SWITCH_ON_DISABLED));
    control(bench, 0x06);
    assert_true(is_in(bench, CIA402_READY_TO_SWITCH_ON));
}

/* A motor that turns: the bench's rotor goes at a velocity. */
static void turn(struct board_bench *bench, double rad_s, int ticks)
{
    while (ticks-- > 0) {
        bench->sense[0].qm += rad_s * 1e-3;
        bench->sense[0].q = bench->sense[0].qm;
        bench_tick(bench);
    }
}

/* Until the rotor stands the axis is in a state, whatever the option code leads to then. */
TEST(ramps_end_when_the_axis_stands)
{
    static const struct {
        const char *what;
        uint16_t option, value, word;
        enum cia402_state during, after;
    } rows[] = {
        {"quick stop 0", 0x605a, 0, 0x02, CIA402_SWITCH_ON_DISABLED, CIA402_SWITCH_ON_DISABLED},
        {"quick stop 1", 0x605a, 1, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_SWITCH_ON_DISABLED},
        {"quick stop 2", 0x605a, 2, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_SWITCH_ON_DISABLED},
        {"quick stop 3", 0x605a, 3, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_SWITCH_ON_DISABLED},
        {"quick stop 7", 0x605a, 7, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_QUICK_STOP_ACTIVE},
        {"quick stop 5", 0x605a, 5, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_QUICK_STOP_ACTIVE},
        {"quick stop 6", 0x605a, 6, 0x02, CIA402_QUICK_STOP_ACTIVE, CIA402_QUICK_STOP_ACTIVE},
        {"shutdown 0", 0x605b, 0, 0x06, CIA402_READY_TO_SWITCH_ON, CIA402_READY_TO_SWITCH_ON},
        {"shutdown 1", 0x605b, 1, 0x06, CIA402_OPERATION_ENABLED, CIA402_READY_TO_SWITCH_ON},
        {"disable operation 0", 0x605c, 0, 0x07, CIA402_SWITCHED_ON, CIA402_SWITCHED_ON},
        {"disable operation 1", 0x605c, 1, 0x07, CIA402_OPERATION_ENABLED, CIA402_SWITCHED_ON},
    };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct board_bench base, *bench = &base;

        bring_to(bench, CIA402_OPERATION_ENABLED);
        assert_int_equal(sdo_write(bench, 0, 4, rows[i].option, 0, 2, rows[i].value), 0);
        turn(bench, 2.0, 20);
        control(bench, rows[i].word);
        turn(bench, 1.0, 20);
        if (!is_in(bench, rows[i].during)) {
            fail_msg("%s: status 0x%04x on the ramp", rows[i].what, READ(0x6041, 0));
        }
        turn(bench, 0.0, 400); /* 2 rad/s at 10 rad/s2 is 0.2 s */
        if (!is_in(bench, rows[i].after)) {
            fail_msg("%s: status 0x%04x after it", rows[i].what, READ(0x6041, 0));
        }
        report(rows[i].what, "turning", 0, "passed");
        bench_stop(bench);
    }
}

/* As a host does that sends it every period: an axis that does not stop is given up all the same */
TEST_ON(a_controlword_that_is_repeated_does_not_restart_the_ramp, board_bench, bench)
{
    bring_to(bench, CIA402_OPERATION_ENABLED);
    assert_int_equal(sdo_write(bench, 0, 4, 0x605b, 0, 2, 1), 0);
    nmt(bench, CIA402_NMT_START, 4);
    turn(bench, 1.0, 20);
    for (int t = 0; t < 1950; t++) {
        bench_send(bench, 0, 0x204, "07 00");
        turn(bench, 1.0, 1);
    }
    assert_true(is_in(bench, CIA402_OPERATION_ENABLED));
    for (int t = 0; t < 100; t++) {
        bench_send(bench, 0, 0x204, "07 00");
        turn(bench, 1.0, 1);
    }
    assert_true(is_in(bench, CIA402_SWITCHED_ON));

    /* another command on the way leads to its own state */
    control(bench, 0x0f);
    turn(bench, 1.0, 20);
    control(bench, 0x07);
    turn(bench, 1.0, 20);
    control(bench, 0x06);
    turn(bench, 0.0, 400);
    assert_true(is_in(bench, CIA402_READY_TO_SWITCH_ON));
}

TEST_ON(an_enable_during_the_ramp_out_of_operation_cancels_it, board_bench, bench)
{
    bring_to(bench, CIA402_OPERATION_ENABLED);
    turn(bench, 2.0, 20);
    control(bench, 0x07);
    turn(bench, 1.0, 20);
    control(bench, 0x0f);
    turn(bench, 0.0, 400);
    assert_true(is_in(bench, CIA402_OPERATION_ENABLED));
}

TEST_ON(a_quick_stop_that_leads_out_is_not_resumed, board_bench, bench)
{
    bring_to(bench, CIA402_OPERATION_ENABLED);
    assert_int_equal(sdo_write(bench, 0, 4, 0x605a, 0, 2, 2), 0);
    turn(bench, 2.0, 20);
    control(bench, 0x02);
    control(bench, 0x0f);
    turn(bench, 1.0, 5);
    assert_true(is_in(bench, CIA402_QUICK_STOP_ACTIVE));
    turn(bench, 0.0, 400);
    assert_true(is_in(bench, CIA402_SWITCH_ON_DISABLED));
}

/* NMT stop is a lost connection; 0x6007 = 3 asks for the quick stop that is under way. */
TEST_ON(a_lost_connection_does_not_disturb_a_quick_stop, board_bench, bench)
{
    bring_to(bench, CIA402_QUICK_STOP_ACTIVE);
    assert_int_equal(sdo_write(bench, 0, 4, 0x6007, 0, 2, 3), 0);
    nmt(bench, CIA402_NMT_STOP, 4);
    bench_ticks(bench, 5);
    nmt(bench, CIA402_NMT_PRE_OPERATIONAL, 4);
    assert_true(is_in(bench, CIA402_QUICK_STOP_ACTIVE));
}

/* A fault with which the axis can still be driven: too hot */
TEST(a_fault_reaction_stops_as_its_option_code_says)
{
    for (unsigned option = 0; option <= 2; option++) {
        struct board_bench bench CLOSED_BY(bench_stop);

        bring_to(&bench, CIA402_OPERATION_ENABLED);
        assert_int_equal(sdo_write(&bench, 0, 4, 0x605e, 0, 2, option), 0);
        turn(&bench, 2.0, 20);
        bench.sense[0].winding_c = 200.0;
        turn(&bench, 1.0, 20);
        assert_int_equal(is_in(&bench, CIA402_FAULT_REACTION_ACTIVE), option > 0);
        assert_int_equal(bench.motor[0].bridge_on, option > 0);
        if (option == 2) { /* then one with which it cannot */
            bench.sense[0].current_a = NAN;
            bench_ticks(&bench, 2);
        } else {
            turn(&bench, 0.0, 600);
        }
        assert_true(is_in(&bench, CIA402_FAULT));
        assert_false(bench.motor[0].bridge_on);
        assert_true(boards_fault(bench.boards));
    }
}

TEST_ON(an_axis_that_does_not_stop_is_given_up_after_two_seconds, board_bench, bench)
{
    bring_to(bench, CIA402_OPERATION_ENABLED);
    turn(bench, 0.5, 20);
    bench->sense[0].winding_c = 200.0;
    turn(bench, 0.5, 1900);
    assert_true(is_in(bench, CIA402_FAULT_REACTION_ACTIVE));
    turn(bench, 0.5, 200);
    assert_true(is_in(bench, CIA402_FAULT));
}

TEST(axes_of_a_node_are_on_their_own)
{
    struct board_bench base, *bench = &base;

    bring_to(bench, CIA402_OPERATION_ENABLED);
    assert_int_equal(READ(0x6841, 0) & 0x6f, 0x40);
    bench->sense[1].winding_c = 200.0;
    bench_ticks(bench, 3);
    assert_int_equal(READ(0x6841, 0) & 0x4f, 0x08);
    assert_true(is_in(bench, CIA402_OPERATION_ENABLED));
    assert_true(bench->motor[0].bridge_on);
    boards_shut_down(bench->boards, bench->now_ns, &bench->command);
    assert_false(bench->motor[0].bridge_on);
    bench_stop(bench);
}
