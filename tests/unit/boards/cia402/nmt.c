/* SPDX-License-Identifier: Apache-2.0 */
/* Network management of the nodes: states, boot-up, heartbeat, guarding, stored parameters. */
#include "tests/unit/boards/cia402/cia402_bench.h"

static void guard(struct board_bench *bench, unsigned node)
{
    const struct bus_frame frame = {.id = CIA402_HEARTBEAT + node, .flags = FRAME_REMOTE, .len = 1};

    boards_receive(bench->boards, bench->now_ns, 0, &frame);
}

BENCH(configure, struct board_bench, bench_stop)

TEST_ON(a_node_boots_into_pre_operational, configure, bench)
{
    bench->board[1].boot_ns = 3000000;
    bench->board[3].transmit_at_start = true;
    bench_start(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x704, "00");
    bench_expect(bench, 0, 0x71f, "00");
    bench_expect(bench, 1, 0x707, "00");
    assert_int_equal(bench_sent(bench, 0, 0x714), 0);

    /* the other one boots later; nothing else is said, but by the node that starts by itself */
    assert_int_equal(bench->count[0], 2);
    assert_int_equal(bench_sent(bench, 1, 0x187), 1);
    for (int t = 0; t < 2; t++) {
        bench_tick(bench);
        assert_int_equal(bench->count[0], t);
    }
    bench_expect(bench, 0, 0x714, "00");
}

/* After a reset it boots for restart_ns, so that a client can wait for the boot-up. */
TEST_ON(a_node_that_is_reset_takes_its_time, configure, bench)
{
    int ticks = 0;

    bench->board[0].restart_ns = 50000000;
    bench_start(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x704, "00"); /* a run begins with a node that is up */
    nmt(bench, CIA402_NMT_RESET_NODE, 4);
    do {
        bench_tick(bench);
        ticks++;
    } while (!bench_sent(bench, 0, 0x704) && ticks < 1000);
    assert_in_range(ticks, 50, 52);
}

/* Which services a node has in which state (CiA 301, 7.3.2.2.5): PDO, SDO, NMT. */
TEST_ON(states_have_their_services, start, bench)
{
    static const struct {
        unsigned command, state;
        bool pdo, sdo;
    } rows[] = {{CIA402_NMT_START, 5, true, true},  {CIA402_NMT_STOP, 4, false, false},
                {CIA402_NMT_START, 5, true, true},  {CIA402_NMT_PRE_OPERATIONAL, 127, false, true},
                {CIA402_NMT_STOP, 4, false, false}, {CIA402_NMT_PRE_OPERATIONAL, 127, false, true}};

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char hex[8];

        nmt(bench, rows[i].command, i % 2 ? 0 : 4);
        guard(bench, 4);
        bench_send(bench, 0, 0x604, "40 00 10 00 00 00 00 00");
        bench_say(bench, 0, 0x204, "06 00");
        snprintf(hex, sizeof hex, "%02X", rows[i].state | (i % 2 ? 0x80u : 0));
        bench_expect(bench, 0, 0x704, hex);
        assert_int_equal(bench_sent(bench, 0, 0x584), rows[i].sdo);
        assert_int_equal(bench_sent(bench, 0, 0x184), rows[i].pdo);
    }
}

TEST_ON(a_heartbeat_comes_every_period, start, bench)
{
    int beats = 0;

    WRITE(0x1017, 0, 2, 10);
    for (int t = 1; t <= 100; t++) {
        bench_tick(bench);
        if (bench_sent(bench, 0, 0x704)) {
            bench_expect(bench, 0, 0x704, t < 50 ? "7F" : "05");
            beats++;
            assert_int_equal(t % 10, 9); /* the request took a tick */
        }
        if (t == 50) {
            nmt(bench, CIA402_NMT_START, 4);
        }
    }
    assert_int_equal(beats, 10);

    /* a producer of heartbeats is not guarded */
    guard(bench, 4);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x704), 0);
}

static void operate(struct board_bench *bench_in)
{
    struct board_bench *b = bench_in;

    assert_int_equal(sdo_write(b, 0, 4, 0x6060, 0, 1, 0xff), 0);
    assert_int_equal(sdo_write(b, 0, 4, 0x6040, 0, 2, 0x06), 0);
    assert_int_equal(sdo_write(b, 0, 4, 0x6040, 0, 2, 0x07), 0);
    assert_int_equal(sdo_write(b, 0, 4, 0x6040, 0, 2, 0x0f), 0);
    assert_int_equal(sdo_read(b, 0, 4, 0x6041, 0) & 0x6f, 0x27);
}

/* Ticks until an EMCY of node 4 comes; it must be this one. */
static int ticks_until_emergency(struct board_bench *bench, const char *hex)
{
    for (int t = 1; t < 1000; t++) {
        bench_tick(bench);
        if (bench_sent(bench, 0, 0x084)) {
            bench_expect_frame(bench_find(bench, 0, 0x084), 0x084, hex);
            return t;
        }
    }
    return 0;
}

TEST_ON(a_lost_heartbeat_stops_the_axis, start, bench)
{
    WRITE(0x1016, 1, 4, 0x00640014); /* node 100, 20 ms */
    operate(bench);
    bench_ticks(bench, 50); /* none has been heard: none is lost */
    assert_int_equal(bench_sent(bench, 0, 0x084), 0);
    for (int i = 0; i < 5; i++) {
        bench_send(bench, 0, 0x764, "05");
        bench_ticks(bench, 15);
    }
    bench_send(bench, 0, 0x765, "05"); /* another node does not count */
    bench_send(bench, 0, 0x764, "05");
    assert_int_equal(ticks_until_emergency(bench, "30 81 11 00 00 01 00 00"), 21);
    bench_ticks(bench, 5);
    assert_int_equal(READ(0x6041, 0) & 0x4f, 0x08);
    assert_int_equal(READ(0x603f, 0), 0x8130);
    assert_int_equal(READ(0x1003, 1), 0x8130);
    assert_false(bench->motor[0].bridge_on);

    /* when the producer is heard again, that is told; the axis keeps its fault */
    assert_int_equal(READ(0x1001, 0), 0x11);
    bench_say(bench, 0, 0x764, "05");
    bench_expect(bench, 0, 0x084, "00 00 01 00 00 00 00 00");
    assert_int_equal(READ(0x1001, 0), 0x01);
    assert_int_equal(READ(0x6041, 0) & 0x4f, 0x08);

    /* it can be reset */
    bench_send(bench, 0, 0x764, "05");
    WRITE(0x6040, 0, 2, 0x80);
    assert_int_equal(READ(0x1001, 0), 0x00);
    assert_int_equal(READ(0x6041, 0) & 0x4f, 0x40);
}

TEST_ON(lost_guarding_is_reported_and_the_node_leaves_operation, start, bench)
{
    WRITE(0x100c, 0, 2, 10);
    WRITE(0x100d, 0, 1, 3);
    nmt(bench, CIA402_NMT_START, 4);
    for (int i = 0; i < 4; i++) {
        guard(bench, 4);
        bench_tick(bench);
        bench_expect(bench, 0, 0x704, i % 2 ? "85" : "05"); /* the toggle bit */
        bench_ticks(bench, 20);
    }
    assert_int_equal(ticks_until_emergency(bench, "30 81 11 00 00 01 00 00"), 31 - 21);
    guard(bench, 4);
    bench_tick(bench);
    bench_expect(bench, 0, 0x704, "7F");                      /* 0x1029 = 0: pre-operational */
    bench_expect(bench, 0, 0x084, "00 00 00 00 00 00 00 00"); /* guarded again */
    assert_int_equal(READ(0x1001, 0), 0);
}

/* What 0x1029 and 0x6007 make of a lost connection. */
TEST(error_behavior_and_option_code_are_obeyed)
{
    static const struct {
        unsigned behavior, option, nmt, status;
    } rows[] = {{0, 0, 127, 0x27}, {1, 0, 5, 0x27}, {2, 0, 4, 0x27},
                {1, 1, 5, 0x08},   {1, 2, 5, 0x40}, {1, 3, 5, 0x40}};

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct board_bench base, *bench = &base;
        const struct bus_frame *frame;

        start(bench);
        nmt(bench, CIA402_NMT_START, 4);
        WRITE(0x1800, 5, 2, 1); /* the statusword every millisecond */
        WRITE(0x1029, 1, 1, rows[i].behavior);
        WRITE(0x6007, 0, 2, rows[i].option);
        WRITE(0x1016, 1, 4, 0x0064000a);
        operate(bench);
        bench_send(bench, 0, 0x764, "05");
        bench_ticks(bench, 30);
        guard(bench, 4);
        bench_tick(bench);
        frame = bench_find(bench, 0, 0x704);
        assert_int_equal(frame->data[0] & 0x7f, rows[i].nmt);
        if (rows[i].nmt == 5) {
            frame = bench_find(bench, 0, 0x184);
            assert_int_equal(frame->data[0] & 0x6f, rows[i].status);
        }
        assert_int_equal(bench->motor[0].bridge_on, rows[i].status == 0x27);
        bench_stop(bench);
    }
}

TEST_ON(parameters_survive_a_reset_when_stored, start, bench)
{
    WRITE(0x1017, 0, 2, 500);
    WRITE(0x6081, 0, 4, 12345);
    WRITE(0x1010, 1, 4, 0x65766173); /* "save" */
    WRITE(0x1017, 0, 2, 600);
    WRITE(0x6081, 0, 4, 54321);

    /* communication alone */
    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, 4);
    bench_tick(bench);
    bench_expect(bench, 0, 0x704, "00");
    assert_int_equal(READ(0x1017, 0), 500);
    assert_int_equal(READ(0x6081, 0), 54321);

    /* the whole node, which boots */
    nmt(bench, CIA402_NMT_RESET_NODE, 4);
    bench_tick(bench);
    bench_expect(bench, 0, 0x704, "00");
    assert_int_equal(READ(0x1017, 0), 500);
    assert_int_equal(READ(0x6081, 0), 12345);

    /* "load" takes effect at the next reset */
    WRITE(0x1011, 1, 4, 0x64616f6c);
    assert_int_equal(READ(0x1017, 0), 500);
    nmt(bench, CIA402_NMT_RESET_NODE, 0);
    bench_tick(bench);
    assert_int_equal(READ(0x1017, 0), 0);
    assert_int_equal(READ(0x6081, 0), 100000);
}

TEST_ON(wrong_commands_are_counted, start, bench)
{
    struct boards_counters counters;

    nmt(bench, 3, 4);
    bench_send(bench, 0, 0x000, "01");
    nmt(bench, CIA402_NMT_START, 99); /* not here */
    bench_send(bench, 0, 0x001, "01 00");
    bench_send(bench, 0, 0x605, "40 00 10 00 00 00 00 00");
    guard(bench, 5);
    counters = bench_counters(bench);
    assert_int_equal(counters.unknown, 1);
    assert_int_equal(counters.malformed, 1);
    assert_int_equal(counters.foreign, 4);
}
