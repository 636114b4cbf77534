/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A robot that takes requests from another thread with every kind of request, as fast as answers
 * come, while a third reads its state, its tunables and its log and a fourth talks on its buses.
 * The thread sanitizer looks on; without it the test still counts the answers.
 */
#include "base/random.h"
#include "tests/rig_run.h"
#include "tests/tunables.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

enum { ROUNDS = 120, KINDS = REQUEST_SET + 1 };

struct crowd {
    struct simulator *simulator;
    struct bus_ports ports;
    size_t nbus;
    atomic_bool stop;
    uint64_t verdicts[REQUEST_CUT + 1];
    uint64_t lines, frames;
    uint64_t wrong; /* answers that no request of theirs can have */
};

/* Mostly in range. */
static struct loop_request next_request(struct crowd *crowd, struct random_stream *random,
                                        uint64_t ticket)
{
    const struct requests *requests = simulator_requests(crowd->simulator);
    struct loop_request request = {.ticket = ticket,
                                   .kind = (enum request_kind)(random_bits(random) % KINDS),
                                   .index = random_bits(random) % (CHECKPOINT_SLOTS + 1),
                                   .count = random_bits(random) % 4,
                                   .value = 100.0 * random_uniform(random),
                                   .on = random_bits(random) & 1,
                                   .force_n = {random_uniform(random), 0.0, 1.0},
                                   .duration_ns = (int64_t)(random_bits(random) % 5) * 1000000};

    if (request.kind == REQUEST_SET) {
        request.index = random_bits(random) % requests_tunables(requests);
        request.value = requests_value(requests, request.index);
    } else if (request.kind == REQUEST_SPEED) {
        request.value *= 10.0;
    }
    return request;
}

/* What may be said to a request of each kind; any is REQUEST_OK or _RANGE, going back or on is
 * REQUEST_BUSY during a step, and there is no checkpoint while thousands of frames wait for the
 * task, which reads none when it has given up. */
static bool verdict_fits(enum request_kind kind, enum request_verdict verdict)
{
    static const unsigned further[KINDS] = {
        [REQUEST_RESUME] = 1u << REQUEST_BUSY,
        [REQUEST_STEP] = 1u << REQUEST_BUSY | 1u << REQUEST_CUT,
        [REQUEST_RESET] = 1u << REQUEST_BUSY,
        [REQUEST_CHECKPOINT] = 1u << REQUEST_UNAVAILABLE,
        [REQUEST_RESTORE] = 1u << REQUEST_BUSY | 1u << REQUEST_EMPTY,
    };
    unsigned always = 1u << REQUEST_OK;

    if (kind != REQUEST_PAUSE && kind != REQUEST_RESUME && kind != REQUEST_RESET) {
        always |= 1u << REQUEST_RANGE;
    }
    return (always | further[kind]) >> verdict & 1;
}

static void await_answer(struct crowd *crowd, const struct loop_request *request)
{
    struct requests *requests = simulator_requests(crowd->simulator);
    struct loop_request resume = {.kind = REQUEST_RESUME};
    struct request_answer answer;

    for (;;) {
        while (!requests_answer(requests, &answer)) {
            sched_yield();
        }
        if (answer.ticket == request->ticket) {
            crowd->wrong += !verdict_fits(request->kind, answer.verdict);
            crowd->verdicts[answer.verdict]++;
            break;
        }
        crowd->wrong += answer.ticket != 0; /* 0 = to the RESUMEs below */
    }
    while (!requests_ask(requests, &resume)) {
        sched_yield();
    }
    while (!requests_answer(requests, &answer)) {
        sched_yield();
    }
}

static void *asks(void *context)
{
    struct crowd *crowd = context;
    struct random_stream random = random_named(7, "asks");

    for (uint64_t i = 1; i <= ROUNDS; i++) {
        struct loop_request request = next_request(crowd, &random, i);

        while (!requests_ask(simulator_requests(crowd->simulator), &request)) {
            sched_yield();
        }
        await_answer(crowd, &request);
    }
    simulator_stop(crowd->simulator);
    return NULL;
}

static void *looks(void *context)
{
    struct crowd *crowd = context;
    const struct requests *requests = simulator_requests(crowd->simulator);
    struct task_runner_status task;
    struct simulator_status status;
    char text[256];
    uint64_t key;
    double sum = 0.0;

    while (!atomic_load(&crowd->stop)) {
        while (simulator_next_event(crowd->simulator, &key, text, sizeof text)) {
            crowd->lines++;
        }
        for (size_t i = 0; i < requests_tunables(requests); i++) {
            sum += requests_value(requests, i);
        }
        simulator_read(crowd->simulator, &status);
        task_runner_read(simulator_task_runner(crowd->simulator), &task);
        sum += requests_speed(requests) + requests_paused(requests);
        sched_yield();
    }
    assert_true(sum == sum);
    return NULL;
}

static void *talks(void *context)
{
    struct crowd *crowd = context;
    const struct bus_frame hello = frame_make(0x7ff, 2, (const uint8_t[]){1, 2});

    while (!atomic_load(&crowd->stop)) {
        for (size_t b = 0; b < crowd->nbus; b++) {
            struct bus_frame frame[16];

            crowd->frames += can_receive(crowd->ports.port[b], frame, 16);
            can_send(crowd->ports.port[b], &hello, 1);
        }
        sched_yield();
    }
    return NULL;
}

/* With an observer the run goes on when the task has given up. */
static void nothing(void *context, int64_t time_ns)
{
    (void)context;
    (void)time_ns;
}

static void hammer(bool timed)
{
    static const struct simulator_observer observer = {NULL, nothing};
    static const char *const fault[] = {"sensor imu off manual", "bus left_arm loss 0.5 manual",
                                        "board left_arm/1 stuck manual", "motor LElbj jam manual",
                                        "supply sag 1 manual"};
    struct simulator_config config = {
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .task = "squat",
        .observer = &observer,
        .guests = 1,
        .requests = true,
        .fault = fault,
        .nfault = sizeof fault / sizeof fault[0],
    };
    struct crowd crowd = {.nbus = 0};
    pthread_t thread[3];
    struct arena arena;
    struct rig rig;

    rig_run_load("coman", &arena, &rig);
    rig_run_without_contact(&rig);
    rig.wire.timed = timed;
    config.rig = &rig;
    crowd.nbus = rig.nbus;
    crowd.simulator = rig_run_open(&config, &arena, &crowd.ports);
    assert_int_equal(pthread_create(&thread[0], NULL, asks, &crowd), 0);
    assert_int_equal(pthread_create(&thread[1], NULL, looks, &crowd), 0);
    assert_int_equal(pthread_create(&thread[2], NULL, talks, &crowd), 0);
    assert_int_equal(simulator_run(crowd.simulator), LOOP_END_STOPPED);
    atomic_store(&crowd.stop, true);
    for (int i = 0; i < 3; i++) {
        pthread_join(thread[i], NULL);
    }
    assert_true(crowd.verdicts[REQUEST_OK] > ROUNDS / 3);
    assert_int_equal(crowd.wrong, 0);
    assert_true(crowd.lines > 20);
    assert_true(crowd.frames > 20);
    rig_run_close(crowd.simulator, &arena, &crowd.ports);
}

TEST(every_request_from_another_thread_on_ideal_buses)
{
    hammer(false);
}

TEST(every_request_from_another_thread_on_wires)
{
    hammer(true);
}
