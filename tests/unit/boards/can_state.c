/* SPDX-License-Identifier: Apache-2.0 */
/* What boards tell of their CAN controllers: by hand, and with a wire that counts. */
#include "boards/foc/protocol.h"
#include "canbus/wire/wire.h"
#include "tests/unit/boards/board_bench.h"
#include "tests/unit/canbus/wire/wire_force.h"

enum { CAN_STATUS = 4, TX_ERRORS = 6, RX_ERRORS = 7 };

static void start(struct board_bench *bench)
{
    bench_configure(bench);
    bench->board[0].transmit_at_start = true;
    bench_start(bench);
    bench_ticks(bench, 8);
}

static void set(struct board_bench *bench, unsigned tec, unsigned rec, bool bus_off)
{
    const struct board_can_state can = {.tec = tec, .rec = rec, .bus_off = bus_off};

    boards_set_can_state(bench->boards, 0, &can);
}

BENCH(start, struct board_bench, bench_stop)

TEST_ON(status_tells_a_new_state_once_and_at_once, start, bench)
{
    set(bench, 95, 95, false); /* nothing to tell before its time */
    assert_null(bench_next_status(bench));
    set(bench, 95, 96, false);
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 00 00 00 20 00 5F 60");
    assert_null(bench_next_status(bench));
    set(bench, 128, 130, false);
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 00 00 00 2C 00 21 22");
    assert_null(bench_next_status(bench));
    set(bench, 0, 0, false); /* better: no hurry */
    assert_null(bench_next_status(bench));
    set(bench, 0, 96, false); /* but worse again is news */
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 00 00 00 20 00 80 DE");
}

/* Hosts add up bytes 6 and 7 as signed numbers; what they get is the counter. */
TEST_ON(error_bytes_add_up_to_the_counters, start, bench)
{
    static const struct {
        unsigned tec, rec;
    } steps[] = {{8, 1}, {16, 9}, {250, 135}, {250, 135}, {0, 127}, {0, 0}, {0, 0}};
    int tec = 0, rec = 0;

    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        const struct bus_frame *frame;

        set(bench, steps[i].tec, steps[i].rec, false);
        bench_send(bench, 0, 0x001, i % 2 ? "09 09" : "09 50"); /* a change of mode makes it due */
        frame = bench_next_status(bench);
        assert_non_null(frame);
        tec += (int8_t)frame->data[TX_ERRORS];
        rec += (int8_t)frame->data[RX_ERRORS];
        assert_true(abs((int)steps[i].tec - tec) <= (i == 2 || i == 4 ? 130 : 0));
        assert_true(abs((int)steps[i].rec - rec) <= (i == 4 ? 8 : 0));
    }
    assert_int_equal(tec, 0);
    assert_int_equal(rec, 0);
}

TEST_ON(bus_off_is_told_when_the_board_is_back, start, bench)
{
    set(bench, 256, 0, true);
    bench_send(bench, 0, 0x001, "89 50");
    for (int i = 0; i < 10; i++) {
        assert_null(bench_next_status(bench));
    }
    set(bench, 0, 0, false);
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 00 00 50 06 00 00 00");
    bench_send(bench, 0, 0x001, "89 09");
    bench_expect_frame(bench_next_status(bench), BENCH_STATUS, "00 00 00 00 00 00 00 00");
}

static uint32_t foc_faults(struct board_bench *bench)
{
    bench_say(bench, 0, FOC_DESIRED_TARGETS_ID, "00 00");
    return get_u32_le(bench_find(bench, 0, 0x113)->data + 4);
}

TEST_ON(a_2foc_tells_states_in_its_fault_bits_and_remembers_them, bench_configure, bench)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_foc}};
    uint32_t was;

    bench->config.bus = buses;
    bench->config.nboard = 1;
    bench->board[0].axis[0].gear = 100.0;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "5B 01 06");
    assert_int_equal(foc_faults(bench), 0);
    set(bench, 0, 96, false);
    assert_int_equal(foc_faults(bench), UINT32_C(1) << 10 | UINT32_C(1) << 28);
    set(bench, 128, 0, false);
    assert_int_equal(foc_faults(bench),
                     UINT32_C(1) << 11 | UINT32_C(1) << 13 | UINT32_C(1) << 28 | UINT32_C(1) << 31);
    set(bench, 0, 128, false);
    was = UINT32_C(1) << 28 | UINT32_C(1) << 30 | UINT32_C(1) << 31;
    assert_int_equal(foc_faults(bench), UINT32_C(1) << 10 | UINT32_C(1) << 12 | was);
    set(bench, 0, 0, false);
    assert_int_equal(foc_faults(bench), was);
    assert_false(boards_fault(bench->boards)); /* none of them stops the motor */
}

/* ---- with a wire ---- */

struct line {
    struct board_bench bench;
    struct arena arena;
    struct wire *wire;
    int tec, rec; /* as a host has added them up */
    unsigned can_status;
    unsigned status_seen;
};

static void hear(void *context, const struct wire_event *event)
{
    struct line *line = context;

    if (event->node == 0 && event->frame->id == BENCH_STATUS) {
        line->tec += (int8_t)event->frame->data[TX_ERRORS];
        line->rec += (int8_t)event->frame->data[RX_ERRORS];
        line->can_status |= event->frame->data[CAN_STATUS];
        line->status_seen++;
    }
}

static void begin(struct line *line)
{
    const struct wire_config config = {.bitrate = 1000000,
                                       .nodes = 2,
                                       .queue = 64,
                                       .restart_delay_ns = 1000000,
                                       .seed = 3,
                                       .notify = hear,
                                       .context = line,
                                       .events = 1u << WIRE_TRANSMIT};
    struct error error;

    memset(line, 0, sizeof *line);
    start(&line->bench);
    assert_ok(arena_init(&line->arena, 8u << 20, &error));
    assert_ok(wire_create(&config, &line->arena, &line->wire, &error));
}

static void end(struct line *line)
{
    arena_fini(&line->arena);
    bench_stop(&line->bench);
}

/* A millisecond: board 1's frames go over the wire, its controller's state goes to the board. */
static void pass(struct line *line)
{
    struct wire_node_stats stats;

    bench_tick(&line->bench);
    for (size_t i = 0; i < line->bench.count[0]; i++) {
        if ((line->bench.frame[0][i].id >> 4 & 0xf) == 1) {
            wire_transmit(line->wire, 0, &line->bench.frame[0][i]);
        }
    }
    wire_advance(line->wire, line->bench.sensors.time_ns + 1000000);
    wire_node_stats(line->wire, 0, &stats);
    set(&line->bench, stats.tec, stats.rec, stats.state == WIRE_BUS_OFF);
}

BENCH(begin, struct line, end)

TEST_ON(a_burst_of_errors_shows_in_status_until_the_counter_is_down, begin, line)
{
    const struct wire_fault burst = {
        .kind = WIRE_FAULT_CORRUPT, .node = 0, .probability = 1.0, .count = 20};
    struct wire_node_stats stats;

    assert_true(wire_inject(line->wire, &burst) >= 0);
    for (int ms = 0; ms < 20; ms++) {
        pass(line);
    }
    wire_node_stats(line->wire, 0, &stats);
    assert_in_range(stats.tec_peak, 8 * 20, 255);
    assert_int_equal(line->can_status, ICUB_CAN_TX_ERROR);
    for (int ms = 0; ms < 2000; ms++) {
        pass(line);
    }
    for (int i = 0; i < 3; i++) {
        bench_send(&line->bench, 0, 0x001, i % 2 ? "09 09" : "09 50");
        for (int ms = 0; ms < 8; ms++) {
            pass(line);
        }
    }
    wire_node_stats(line->wire, 0, &stats);
    assert_int_equal(stats.tec, 0);
    assert_int_equal(line->tec, 0);
}

TEST_ON(a_board_that_was_bus_off_says_so_after_its_recovery, begin, line)
{
    struct wire_node_stats stats;
    unsigned before;

    pass(line);
    wire_force_bus_off(line->wire, 0);
    for (int ms = 0; ms < 20; ms++) {
        pass(line);
    }
    wire_node_stats(line->wire, 0, &stats);
    assert_int_equal(stats.bus_offs, 1);
    assert_int_equal(stats.state, WIRE_ERROR_ACTIVE);
    assert_true(line->can_status & ICUB_CAN_BUS_OFF);
    before = line->status_seen;
    line->can_status = 0;
    bench_send(&line->bench, 0, 0x001, "09 50");
    for (int ms = 0; ms < 20; ms++) {
        pass(line);
    }
    assert_true(line->status_seen > before);
    assert_int_equal(line->can_status, 0);
}
