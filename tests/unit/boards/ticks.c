/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Boards whose milliseconds are not those of the simulation: ticks of 0.5 and 2 ms, and of 0.3, 0.7
 * and 1.5 ms, which divide neither a millisecond nor the periods of the telemetry. What comes
 * periodically comes at the first tick that it can, heat and integrals take the milliseconds that
 * have passed, nothing drifts.
 */
#include "base/array.h"
#include "tests/protocol_file.h"
#include "tests/unit/boards/board_bench.h"

#define MS INT64_C(1000000)

static const int64_t ticks_ns[] = {500000, 2000000, 300000, 700000, 1500000, 1000000};

enum { RUN_MS = 2100 }; /* a whole number of each tick */

static const struct boards_bus_config foc_bus[BENCH_BUSES] = {{.protocol = &protocol_foc},
                                                              {.protocol = &protocol_icub}};
static struct boards_bus_config compact_bus[BENCH_BUSES] = {{.protocol = &protocol_compact},
                                                            {.protocol = &protocol_icub}};

/* One board: a 2FOC of address 1 (joint 0), or a compact node 4 (joints 0, 1). */
static void start_foc(struct board_bench *bench, int64_t tick_ns)
{
    bench_configure(bench);
    bench->board[0] = bench_motor("hip", 0, 1, 0, -1);
    bench->board[0].axis[0].gear = 100.0;
    bench->config.nboard = 1;
    bench->config.bus = foc_bus;
    bench->config.tick_ns = tick_ns;
    bench_start(bench);
    bench_send(bench, 0, 0x001, "5B 01 06; 77 01 00 10 00 00 0E");
    bench_send(bench, 0, 0x001, "48 00 A0 0F 40 1F 20 4E"); /* 4, 8 and 20 A */
    bench_send(bench, 0, 0x001, "65 00 00 00 08 00 00 0F"); /* v += (e + e') / 32 */
}

static void start_compact(struct board_bench *bench, int64_t tick_ns)
{
    bench_configure(bench);
    bench->board[0] = bench_motor("leg 1", 0, 4, 0, 1);
    for (int axis = 0; axis < 2; axis++) {
        bench->board[0].axis[axis].winding_ohm = 1.0;
        bench->board[0].axis[axis].winding_h = 1e-3;
    }
    bench->board[0].axis[2].joint = bench->board[0].axis[3].joint = -1;
    bench->board[0].period_ns = 3 * MS;
    bench->board[0].transmit_at_start = true;
    bench->board[0].command_timeout_ns = 20 * MS;
    bench->config.nboard = 1;
    if (!compact_bus[0].described) {
        compact_bus[0].described = protocol_file("compact");
    }
    bench->config.bus = compact_bus;
    bench->config.tick_ns = tick_ns;
    bench_start(bench);
}

/* ---- telemetry ---- */

/* A frame whose n-th is due n periods after the start, or first_ms plus so many. */
struct periodic {
    size_t bus;
    uint32_t id;
    int64_t period_ms, first_ms;
};

static void expect_periodic(struct board_bench *bench, const struct periodic *frame, size_t count)
{
    size_t sent[4] = {0};

    while (bench->now_ns < RUN_MS * MS) {
        bench_tick(bench);
        for (size_t i = 0; i < count; i++) {
            const int64_t since_ns = bench->now_ns - frame[i].first_ms * MS;
            const int64_t due = since_ns < 0 ? 0 : since_ns / (frame[i].period_ms * MS) + 1;

            sent[i] += bench_sent(bench, frame[i].bus, frame[i].id);
            if ((int64_t)sent[i] != due) {
                fail_msg("tick %lld ns: at %lld ns %zu frames 0x%x, not %lld",
                         (long long)bench->config.tick_ns, (long long)bench->now_ns, sent[i],
                         (unsigned)frame[i].id, (long long)due);
            }
        }
    }
    bench_stop(bench);
}

TEST(telemetry_keeps_its_period_whatever_the_tick)
{
    static const struct periodic strain[] = {{0, 0x3ca, 4, 4}, {0, 0x3da, 5, 5}};
    static const struct periodic compact[] = {
        {0, 0x100, 3, 3}, {0, 0x101, 3, 3}, {0, 0x200, 50, 1}, {0, 0x201, 50, 2}};

    for (size_t t = 0; t < ARRAY_COUNT(ticks_ns); t++) {
        struct board_bench bench;

        bench_configure(&bench);
        bench.board[2].transmit_at_start = bench.board[3].transmit_at_start = true;
        bench.config.tick_ns = ticks_ns[t];
        bench_start(&bench);
        expect_periodic(&bench, strain, ARRAY_COUNT(strain));
        start_compact(&bench, ticks_ns[t]);
        expect_periodic(&bench, compact, ARRAY_COUNT(compact));
    }
}

/* ---- heat ---- */

/* ms until the board trips with this current; the host says what keeps the board going. */
static double ms_to_trip(struct board_bench *bench, double current_a, uint32_t id, const char *hex)
{
    const int64_t from_ns = bench->now_ns;
    const uint64_t before = bench_counters(bench).trips;

    bench->sense[0].current_a = current_a;
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
    while (bench_counters(bench).trips == before) {
        assert_true(bench->now_ns - from_ns < 10000 * MS);
        bench_say(bench, 0, id, hex);
    }
    return (double)(bench->now_ns - from_ns) / (double)MS;
}

/* 1.05 times the limit heats by 0.1025 a ms of 10; 12 A of nominal 4 and peak 8 last 3.84 s. */
TEST_ON(an_over_current_trips_at_its_time_whatever_the_tick, board_bench, bench)
{
    for (size_t t = 0; t < ARRAY_COUNT(ticks_ns); t++) {
        const double tick_ms = (double)ticks_ns[t] / (double)MS;

        bench_configure(bench);
        bench->config.tick_ns = ticks_ns[t];
        bench_start(bench);
        bench_send(bench, 0, 0x001, "48 E8 03 00 00"); /* 1 A */
        bench_say(bench, 0, 0x001, "09 50");
        assert_near(ms_to_trip(bench, 1.05, 0x001, "72 00 00"), 10.0 / 0.1025, tick_ms + 1.0);

        start_compact(bench, ticks_ns[t]);
        bench_say(bench, 0, 0x020, "01 03 00 00 00");
        assert_near(ms_to_trip(bench, 1.05 * 12.0, 0x040, "00 00"), 10.0 / 0.1025, tick_ms + 1.0);

        start_foc(bench, ticks_ns[t]);
        bench_say(bench, 0, 0x001, "09 50");
        assert_near(ms_to_trip(bench, 12.0, 0x10f, "00 00"), 3840.0, tick_ms + 1.0);
    }
}

/* ---- integrals and time-outs ---- */

/* How many steps of a millisecond the boards have taken when the last tick began at now - tick. */
static double steps_since(const struct board_bench *bench, int64_t from_ns)
{
    return (double)(bench->now_ns / MS - from_ns / MS);
}

TEST_ON(integrals_grow_with_time_whatever_the_tick, board_bench, bench)
{
    for (size_t t = 0; t < ARRAY_COUNT(ticks_ns); t++) {
        int64_t from_ns;

        /* A speed of 50 wanted, none there: 17 x 50 mA, and 2 x 50 more with every ms */
        start_foc(bench, ticks_ns[t]);
        bench_ticks(bench, 7);
        bench_send(bench, 0, 0x001, "09 0B");
        for (from_ns = bench->now_ns; bench->now_ns < from_ns + 13 * MS;) {
            double n;

            bench_say(bench, 0, 0x10f, "32 00");
            n = steps_since(bench, from_ns);
            assert_near(n > 0.0 ? bench->motor[0].law.current_a : 0.0,
                        n > 0.0 ? 0.85 + 0.1 * (n - 1.0) : 0.0, 1e-9);
        }
    }
}

/* A set-point lives for 20 ms, or 50, and is gone in the tick that ends later. */
TEST_ON(commands_time_out_in_ms_whatever_the_tick, board_bench, bench)
{
    for (size_t t = 0; t < ARRAY_COUNT(ticks_ns); t++) {
        for (int foc = 0; foc < 2; foc++) {
            const int64_t lives_ns = (foc ? 50 : 20) * MS;
            int64_t from_ns;

            if (foc) {
                start_foc(bench, ticks_ns[t]);
            } else {
                start_compact(bench, ticks_ns[t]);
            }
            bench_ticks(bench, 7);
            bench_send(bench, 0, foc ? 0x001 : 0x020, foc ? "09 50" : "01 01 00 00 00");
            bench_send(bench, 0, foc ? 0x10f : 0x040, "E8 03");
            for (from_ns = bench->now_ns; bench_counters(bench).timeouts == 0;) {
                assert_true(bench->now_ns - from_ns <= lives_ns);
                bench_tick(bench);
            }
            assert_true(bench->now_ns - from_ns > lives_ns);
        }
    }
}
