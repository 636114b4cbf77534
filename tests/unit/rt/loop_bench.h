/* SPDX-License-Identifier: Apache-2.0 */
/* A loop on the bench: a clock that tests script, a machine that records what it is asked to do,
 * and local buses with a host on the other side. */
#ifndef TESTS_UNIT_RT_LOOP_BENCH_H
#define TESTS_UNIT_RT_LOOP_BENCH_H

#include "boards/icub/protocol.h"
#include "rt/loop.h"
#include "tests/test.h"

#define TICK CLOCK_MS
#define START (INT64_C(5000) * CLOCK_SECOND + 123457)

enum { BENCH_BUSES = 3, BENCH_LOG = 65536, BENCH_SLEEPS = 4096 };

struct bench {
    struct clock clock; /* first: the clock's functions get the bench */
    int64_t now;
    int64_t deadline[BENCH_SLEEPS]; /* asked of sleep_until */
    size_t sleeps;
    size_t waits;      /* of wait_readable */
    size_t woken;      /* waits that a descriptor ended */
    int64_t wake_late; /* of every sleep */
    size_t late_sleep; /* this sleep (from 0) wakes late_by late instead */
    int64_t late_by;
    int64_t work[PHASE_COUNT + 1]; /* every tick; the last: of buses after the first, 0 */
    uint64_t slow_tick;            /* this tick (from 0) spends slow_by more in slow_phase */
    enum loop_phase slow_phase;
    int64_t slow_by;
    void (*on_wait)(struct bench *bench); /* the host's turn while the loop waits */
    void (*on_tick)(struct bench *bench); /* at the end of each tick */

    struct arena arena;
    struct local_bus *bus[BENCH_BUSES];
    struct can_port *port[BENCH_BUSES], *host[BENCH_BUSES];
    size_t transmit_max[BENCH_BUSES];
    struct loop_config config;
    struct loop *loop;

    char order[BENCH_LOG]; /* one letter a call, see the functions below */
    size_t calls;
    uint64_t tick;
    uint64_t begins;            /* calls of begin */
    int64_t begun_ns, begun_at; /* the last: virtual time, and that of the clock */
    bool restored;              /* time has gone back */
    struct bus_frame received[BENCH_LOG];
    uint64_t received_tick[BENCH_LOG];
    size_t received_bus[BENCH_LOG], received_count;
    size_t send_count; /* frames sent on each bus each tick */
    bool fault, broken;
    uint64_t controller_ticks; /* the inline controller ends after so many */
    uint64_t controlled;
    int shut_downs;
};

static inline int64_t bench_now(struct clock *clock)
{
    return ((struct bench *)clock)->now;
}

static inline void bench_sleep_until(struct clock *clock, int64_t deadline)
{
    struct bench *bench = (struct bench *)clock;
    int64_t late = bench->sleeps == bench->late_sleep ? bench->late_by : bench->wake_late;

    bench->deadline[bench->sleeps++ % BENCH_SLEEPS] = deadline;
    bench->now = (deadline > bench->now ? deadline : bench->now) + late;
}

static inline void bench_wait_readable(struct clock *clock, struct pollfd *fds, size_t count,
                                       int64_t deadline)
{
    struct bench *bench = (struct bench *)clock;

    assert_true(poll(fds, count, 0) == 0);
    assert_true(++bench->waits < 100000);
    bench->now = deadline;
    if (bench->on_wait) {
        bench->on_wait(bench);
    }
    bench->woken += poll(fds, count, 0) > 0;
}

static inline void bench_call(struct bench *bench, char letter, enum loop_phase phase)
{
    bench->order[bench->calls++ % BENCH_LOG] = letter;
    bench->now += bench->work[phase];
    if (bench->tick == bench->slow_tick && bench->slow_phase == phase) {
        bench->now += bench->slow_by;
        bench->slow_by = 0;
    }
}

/* Phases are told the tick's beginning until the plant has moved, then its end. */
static inline void bench_check_time(const struct bench *bench, int64_t now_ns, bool end)
{
    assert_int_equal(now_ns, (int64_t)(bench->tick + end) * TICK);
}

static inline void bench_begin(void *context, int64_t now_ns)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, false);
    assert_true(bench->begins == 0 || now_ns >= bench->begun_ns || bench->restored);
    bench->begun_ns = now_ns;
    bench->begun_at = bench->now;
    bench->begins++;
}

static inline bool bench_controller(void *context, int64_t now_ns)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, false);
    bench_call(bench, 'i', PHASE_WAIT);
    bench->controlled++;
    return bench->controlled < bench->controller_ticks;
}

static inline void bench_receive(void *context, int64_t now_ns, size_t bus,
                                 const struct bus_frame *frame)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, false);
    bench->received[bench->received_count % BENCH_LOG] = *frame;
    bench->received_bus[bench->received_count % BENCH_LOG] = bus;
    bench->received_tick[bench->received_count++ % BENCH_LOG] = bench->tick;
    bench_call(bench, 'r', PHASE_RECEIVE);
}

static inline void bench_control(void *context, int64_t now_ns)
{
    bench_check_time(context, now_ns, false);
    bench_call(context, 'c', PHASE_BOARDS);
}

static inline bool bench_plant(void *context, int64_t now_ns)
{
    bench_check_time(context, now_ns, false);
    bench_call(context, 'p', PHASE_PLANT);
    return !((struct bench *)context)->broken;
}

static inline bool bench_sample(void *context, int64_t now_ns)
{
    bench_check_time(context, now_ns, true);
    bench_call(context, 's', PHASE_SENSORS);
    return true;
}

static inline size_t bench_transmit(void *context, int64_t now_ns, size_t bus,
                                    struct bus_frame *frames, size_t max)
{
    struct bench *bench = context;
    uint8_t data[8] = {(uint8_t)bench->tick, (uint8_t)(bench->tick >> 8)};

    bench_check_time(bench, now_ns, true);
    assert_true(bench->send_count <= max);
    for (size_t i = 0; i < bench->send_count; i++) {
        frames[i] = frame_make(0x100 + (uint32_t)i, 8, data);
    }
    bench_call(bench, 't', bus == 0 ? PHASE_TRANSMIT : PHASE_COUNT);
    return bench->send_count;
}

static inline bool bench_fault(void *context)
{
    return ((struct bench *)context)->fault;
}

static inline void bench_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, true);
    bench_call(bench, 'u', PHASE_PUBLISH);
    bench->tick++;
    assert_int_equal(stats->ticks, bench->tick);
    assert_int_equal(stats->time_ns, now_ns);
    assert_true(bench->begins >= bench->tick || bench->restored);
    if (bench->on_tick) {
        bench->on_tick(bench);
    }
}

static inline void bench_shut_down(void *context, int64_t now_ns)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, false);
    bench->order[bench->calls++ % BENCH_LOG] = 'x';
    bench->shut_downs++;
}

static inline void bench_buses(struct bench *bench, size_t inbox)
{
    struct error error;

    for (size_t b = 0; b < BENCH_BUSES; b++) {
        static const char *const names[] = {"can0", "can1", "can2"};

        const struct local_bus_config config = {.name = names[b], .max_nodes = 2, .inbox = inbox};

        assert_ok(local_bus_create(&config, &bench->arena, &bench->bus[b], &error));
        assert_ok(local_bus_join(bench->bus[b], 1, NULL, 0, &bench->port[b], &error));
        assert_ok(local_bus_join(bench->bus[b], 1, NULL, 0, &bench->host[b], &error));
        bench->transmit_max[b] = 8;
    }
}

/* Returns the only bench of the program. Its plant works for 10 % of each tick. Closes the bench of
 * the previous test. Change the values that the test needs, then call bench_run. */
static inline struct bench *bench_create(enum loop_clock clock, uint64_t ticks)
{
    static const struct clock_ops ops = {bench_now, bench_sleep_until, bench_wait_readable};
    static struct bench the_bench, *const bench = &the_bench;
    struct error error;

    for (size_t b = 0; b < BENCH_BUSES && bench->bus[b]; b++) {
        bench->port[b]->ops->close(bench->port[b]);
        bench->host[b]->ops->close(bench->host[b]);
        local_bus_destroy(bench->bus[b]);
    }
    arena_fini(&bench->arena);
    memset(bench, 0, sizeof *bench);
    bench->clock.ops = &ops;
    bench->now = START;
    bench->work[PHASE_PLANT] = TICK / 10;
    bench->slow_tick = UINT64_MAX;
    bench->late_sleep = SIZE_MAX;
    bench->controller_ticks = UINT64_MAX;
    bench->send_count = 2;
    assert_ok(arena_init(&bench->arena, (size_t)64 << 20, &error));
    bench_buses(bench, 4096);
    bench->config = (struct loop_config){
        .clock = clock,
        .tick_ns = TICK,
        .overrun = LOOP_OVERRUN_SKIP,
        .stop_after = 1,
        .lockstep = {1, LOCKSTEP_STEP_ID, LOCKSTEP_DONE_ID, CLOCK_SECOND},
        .ticks = ticks,
        .nbus = BENCH_BUSES,
        .port = bench->port,
        .transmit_max = bench->transmit_max,
        .time = &bench->clock,
        .machine =
            {
                .context = bench,
                .begin = bench_begin,
                .receive = bench_receive,
                .control = bench_control,
                .plant = bench_plant,
                .sample = bench_sample,
                .transmit = bench_transmit,
                .fault = bench_fault,
                .publish = bench_publish,
                .shut_down = bench_shut_down,
            },
    };
    return bench;
}

static inline enum loop_end bench_run(struct bench *bench)
{
    struct error error;

    assert_ok(loop_create(&bench->config, &bench->arena, &bench->loop, &error));
    arena_seal(&bench->arena);
    return loop_run(bench->loop);
}

/* The number of events of one kind; *last is the last of them */
static inline size_t bench_events(struct bench *bench, enum loop_event_kind kind,
                                  struct loop_event *last)
{
    struct loop_event event;
    size_t count = 0;

    while (loop_next_event(bench->loop, &event)) {
        char text[256];

        loop_event_format(bench->loop, &event, text, sizeof text);
        assert_true(strlen(text) > 10);
        if (event.kind == kind) {
            *last = event;
            count++;
        }
    }
    return count;
}

#endif
