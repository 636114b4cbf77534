/* SPDX-License-Identifier: Apache-2.0 */
/* Frames between two ticks of the real clock (rt/loop.h): they are answered at once, within limits
 * of number and time, and never at the cost of a deadline. */
#include "loop_bench.h"

#include "base/array.h"

#include <sys/eventfd.h>
#include <unistd.h>

/* What the host sends on a bus while the loop waits: once, in the wait that reaches at_ns. */
static struct {
    int64_t at_ns; /* of the bench's clock; 0 = nothing left */
    size_t bus, count;
    int64_t answer_work_ns;
    int64_t received_at_ns, answered_at_ns; /* of the last frame and answer */
    bool nobody;                            /* machine.listens says no */
    /* Virtual times: delay of the answer, its due time, by when answers are due, arrival */
    int64_t delay_ns, answer_due_ns, due_ns, arrival_ns;
} script;

/* Sends the frames of the script, if they are due before until_ns. Returns whether they are. */
static bool send_due(struct bench *bench, int64_t until_ns)
{
    const struct bus_frame frame = frame_make(0x20, 0, NULL);

    if (script.at_ns == 0 || script.at_ns >= until_ns) {
        return false;
    }
    for (size_t i = 0; i < script.count; i++) {
        can_send(bench->host[script.bus], &frame, 1);
    }
    script.at_ns = 0;
    return true;
}

static void wait_readable(struct clock *clock, struct pollfd *fds, size_t count, int64_t deadline)
{
    struct bench *bench = (struct bench *)clock;
    const int64_t at_ns = script.at_ns;

    assert_true(++bench->waits < 100000);
    bench->now = send_due(bench, deadline) ? at_ns : deadline;
    poll(fds, count, 0);
}

static void sleep_until(struct clock *clock, int64_t deadline)
{
    send_due((struct bench *)clock, deadline);
    bench_sleep_until(clock, deadline);
}

static void receive(void *context, int64_t now_ns, size_t bus, const struct bus_frame *frame)
{
    bench_receive(context, now_ns, bus, frame);
    script.received_at_ns = ((struct bench *)context)->now;
}

/* Returns one answer per call, for any number of received frames. */
static size_t answer(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                     size_t max)
{
    struct bench *bench = context;

    bench_check_time(bench, now_ns, false);
    assert_int_equal(bus, script.bus);
    assert_int_equal(max, bench->transmit_max[bus]);
    bench->now += script.answer_work_ns;
    script.answered_at_ns = bench->now;
    frames[0] = frame_make(0x30, 0, NULL);
    return 1;
}

static bool listens(void *context)
{
    (void)context;
    return !script.nobody;
}

/* A bench whose host sends `count` frames on bus 1, at a share of tick 3's wait. */
static struct bench *arrivals_create(enum loop_clock clock, double share, size_t count)
{
    static const struct clock_ops ops = {bench_now, sleep_until, wait_readable};
    struct bench *bench = bench_create(clock, 6);

    memset(&script, 0, sizeof script);
    script.at_ns = START + 2 * TICK + (int64_t)(share * (double)TICK);
    script.bus = 1;
    script.count = count;
    bench->clock.ops = &ops;
    bench->send_count = 0;
    bench->config.machine.receive = receive;
    bench->config.machine.answer = answer;
    bench->config.machine.listens = listens;
    return bench;
}

TEST(a_frame_between_ticks_is_answered_at_once)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.5, 1);
    const int64_t at_ns = script.at_ns;
    const struct loop_stats *stats;
    struct bus_frame got;

    bench_run(bench);
    stats = loop_stats(bench->loop);
    assert_int_equal(bench->received_count, 1);
    assert_int_equal(bench->received_tick[0], 3);
    assert_int_equal(script.received_at_ns, at_ns);
    assert_int_equal(script.answered_at_ns, at_ns);
    assert_int_equal(can_receive(bench->host[1], &got, 1), 1);
    assert_int_equal(got.id, 0x30);
    assert_int_equal(stats->arrivals, 1);
    assert_int_equal(stats->phase[PHASE_ARRIVALS].count, 1);
    assert_int_equal(stats->overrun_total, 0);
}

TEST(the_loop_keeps_its_deadlines_and_the_rest_of_a_flood_waits_for_the_tick)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.5, 1000);
    const struct loop_stats *stats;
    struct loop_event event;

    bench_run(bench);
    stats = loop_stats(bench->loop);
    assert_int_equal(bench->received_count, 1000);
    assert_int_equal(bench->received_tick[999], 3);
    assert_int_equal(stats->arrivals, LOOP_ARRIVALS_MAX);
    assert_int_equal(stats->arrivals_full, 1);
    assert_int_equal(bench_events(bench, LOOP_EVENT_ARRIVALS, &event), 1);
    assert_int_equal(event.bus, 1);
    assert_int_equal(bench->deadline[2], START + 3 * TICK);
    assert_int_equal(stats->overrun_total, 0);
}

static void receive_for_later(void *context, int64_t now_ns, size_t bus,
                              const struct bus_frame *frame)
{
    receive(context, now_ns, bus, frame);
    script.arrival_ns = frame->time_ns;
    script.answer_due_ns = frame->time_ns + script.delay_ns;
}

static void set_due(void *context, int64_t due_ns)
{
    (void)context;
    script.due_ns = due_ns;
}

static int64_t next_answer(void *context)
{
    (void)context;
    return script.answer_due_ns;
}

static size_t answer_later(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                           size_t max)
{
    if (bus != script.bus || script.answer_due_ns > script.due_ns) {
        return 0;
    }
    script.answer_due_ns = INT64_MAX;
    return answer(context, now_ns, bus, frames, max);
}

/* An answer with a delay leaves at its time between two ticks, here or in a later wait, whether the
 * frame came in a wait or in a tick. */
TEST(an_answer_leaves_when_it_is_due)
{
    static const struct {
        double share, delay; /* ticks */
    } rows[] = {{0.25, 0.5}, {0.5, 1.25}, {0.99, 0.5}, {0.25, 2.5}};

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, rows[i].share, 1);
        /* Shortly before the deadline the frame waits for the tick */
        const double share = rows[i].share > 0.9 ? 1.0 : rows[i].share;
        const int64_t begin_ns = script.at_ns + (int64_t)((share - rows[i].share) * (double)TICK);

        script.delay_ns = (int64_t)(rows[i].delay * (double)TICK);
        script.answer_due_ns = INT64_MAX;
        bench->config.machine.receive = receive_for_later;
        bench->config.machine.answer = answer_later;
        bench->config.machine.set_due = set_due;
        bench->config.machine.next_answer = next_answer;
        bench_run(bench);
        assert_int_equal(script.arrival_ns, (int64_t)((2.0 + share) * (double)TICK));
        assert_int_equal(script.answered_at_ns, begin_ns + script.delay_ns);
        assert_int_equal(loop_stats(bench->loop)->overrun_total, 0);
    }
}

TEST(a_frame_just_before_the_deadline_waits_for_the_tick)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.99, 1);

    bench_run(bench);
    assert_int_equal(loop_stats(bench->loop)->arrivals, 0);
    assert_int_equal(bench->received_count, 1);
    assert_int_equal(bench->received_tick[0], 3);
    assert_int_equal(script.received_at_ns, START + 3 * TICK);
}

TEST(work_for_arrivals_that_ends_late_is_charged_to_them)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.5, 1);
    const struct loop_stats *stats;

    script.answer_work_ns = 2 * TICK;
    bench_run(bench);
    stats = loop_stats(bench->loop);
    assert_int_equal(stats->overruns[PHASE_ARRIVALS], 1);
    assert_int_equal(stats->overrun_total, 1);
    assert_int_equal(stats->phase[PHASE_ARRIVALS].max, 2 * TICK);
    assert_true(stats->phase[PHASE_WAIT].max < TICK);
}

TEST(without_a_listener_or_without_the_real_clock_the_loop_only_sleeps)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.5, 1);

    script.nobody = true;
    bench_run(bench);
    assert_int_equal(bench->waits, 0);

    bench = arrivals_create(LOOP_CLOCK_FREE, 0.5, 1);
    bench_run(bench);
    assert_int_equal(bench->waits, 0);
    assert_int_equal(loop_stats(bench->loop)->arrivals, 0);
}

/* A port of an interface that is lost: readable for ever, without a frame */
static int lost_descriptor(const struct can_port *port)
{
    (void)port;
    return script.count ? (int)script.count : -1;
}

TEST(a_descriptor_without_frames_does_not_keep_the_loop_awake)
{
    struct bench *bench = arrivals_create(LOOP_CLOCK_REAL, 0.5, 0);
    struct can_port_ops ops = *bench->port[0]->ops;
    const struct can_port_ops *whole = bench->port[0]->ops;

    script.at_ns = 0;
    script.count = (size_t)eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK);
    ops.descriptor = lost_descriptor;
    bench->port[0]->ops = &ops;
    bench_run(bench);
    assert_true(bench->waits <= 6);
    bench->port[0]->ops = whole;
    close((int)script.count);
}
