/* SPDX-License-Identifier: Apache-2.0 */
/* A loop on the scripted clock that takes requests: requests come from the host's turn while the
 * loop waits, or from the end of a tick. */
#ifndef TESTS_UNIT_RT_REQUEST_BENCH_H
#define TESTS_UNIT_RT_REQUEST_BENCH_H

#include "rt/request_machine.h"
#include "tests/unit/rt/loop_bench.h"

/* The machine behind the requests, and a script of what is asked when. */
struct request_bench {
    struct bench *bench;
    struct requests *requests;
    uint64_t kept[CHECKPOINT_SLOTS];
    int backs;
    double value;
    int sets, faults;
    uint64_t tickets;
    uint64_t paused_at; /* tick at whose end PAUSE is asked */
    int waits_left;     /* while paused, before on_paused */
    int waits;          /* seen while paused */
    void (*on_paused)(struct request_bench *sb);
    void (*each_tick)(struct request_bench *sb);
};

static struct request_bench sb;

static inline enum request_verdict fault(void *context, size_t index, bool on, int64_t time_ns)
{
    (void)context;
    (void)time_ns;
    assert_int_equal(index, 1);
    assert_true(on);
    sb.faults++;
    return REQUEST_OK;
}

static inline enum request_verdict save(void *context, size_t slot)
{
    (void)context;
    sb.kept[slot] = sb.bench->tick;
    return REQUEST_OK;
}

static inline void restore(void *context, size_t slot)
{
    (void)context;
    sb.bench->tick = sb.kept[slot];
    sb.bench->restored = true;
    sb.backs++;
}

static inline double get(void *context, size_t index)
{
    (void)context;
    (void)index;
    return sb.value;
}

static inline enum request_verdict set(void *context, size_t index, double value)
{
    (void)context;
    (void)index;
    sb.value = value;
    sb.sets++;
    return REQUEST_OK;
}

static inline uint64_t ask(enum request_kind kind, size_t index, uint64_t count, double value)
{
    struct loop_request request = {.ticket = ++sb.tickets,
                                   .kind = kind,
                                   .index = index,
                                   .count = count,
                                   .value = value,
                                   .on = true};

    assert_true(requests_ask(sb.requests, &request));
    return sb.tickets;
}

/* The next answer is to this ticket; returns it */
static inline struct request_answer answer(uint64_t ticket, enum request_verdict verdict)
{
    struct request_answer got;

    assert_true(requests_answer(sb.requests, &got));
    assert_int_equal(got.ticket, ticket);
    assert_string_equal(request_verdict_text(got.verdict), request_verdict_text(verdict));
    return got;
}

static inline void no_answer(void)
{
    struct request_answer got;

    assert_false(requests_answer(sb.requests, &got));
}

static inline void on_tick(struct bench *bench)
{
    (void)bench;
    if (sb.bench->tick == sb.paused_at) {
        ask(REQUEST_PAUSE, 0, 0, 0.0);
    }
    if (sb.each_tick) {
        sb.each_tick(&sb);
    }
}

static inline void on_wait(struct bench *bench)
{
    (void)bench;
    if (requests_paused(sb.requests)) {
        sb.waits++;
        if (sb.waits_left-- == 0) {
            sb.on_paused(&sb);
        }
    }
}

static inline struct bench *requested_create(enum loop_clock clock, uint64_t ticks)
{
    static const struct tunable tunable[] = {{"gain", "", 0.0, 10.0, true},
                                             {"supply_v", "V", -5.0, 5.0, false}};
    const struct request_machine machine = {
        .fault = fault,
        .set = set,
        .get = get,
        .save = save,
        .restore = restore,
        .nfault = 2,
        .ntunable = 2,
        .tunable = tunable,
    };
    struct bench *bench;
    struct error error;

    requests_destroy(sb.requests); /* of the previous test */
    memset(&sb, 0, sizeof sb);
    bench = bench_create(clock, ticks);
    sb.bench = bench;
    sb.paused_at = UINT64_MAX;
    bench->on_tick = on_tick;
    bench->on_wait = on_wait;
    assert_ok(requests_create(&machine, &bench->arena, &sb.requests, &error));
    bench->config.requests = sb.requests;
    return bench;
}

static inline void go_on(struct request_bench *unused)
{
    (void)unused;
    ask(REQUEST_RESUME, 0, 0, 0.0);
}

static inline void send_step(struct bench *bench, uint32_t expected, uint16_t ticks)
{
    uint8_t data[LOCKSTEP_LENGTH];
    struct bus_frame frame;

    put_u32_le(data, expected);
    put_u16_le(data + 4, ticks);
    frame = frame_make(LOCKSTEP_STEP_ID, LOCKSTEP_LENGTH, data);
    assert_int_equal(can_send(bench->host[1], &frame, 1), 1);
}

/* In a wait of the loop: takes the answers and asks anew, until its 90th turn. */
static inline void ask_often_and_stop(struct bench *bench)
{
    static int turns;
    struct request_answer unread;

    if (bench->waits == 1) {
        turns = 0;
    }
    while (requests_answer(sb.requests, &unread)) {
    }
    if (++turns == 90) {
        loop_stop(bench->loop);
    } else {
        ask(REQUEST_FAULT, 1, 0, 0.0);
    }
}

#endif
