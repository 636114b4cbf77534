/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Nothing in a tick allocates, nor does what is asked of it between two: the whole of COMAN with
 * boards, buses, recorder and the squat task runs with every malloc of the loop's thread counted.
 * The contact engine is left out, for Simbody allocates by nature.
 */
#include "tests/rig_run.h"

#include <unistd.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

TEST(a_tick_does_not_allocate)
{
    print_message("SKIP: the sanitizers have an allocator of their own\n");
    skip();
}

TEST(a_request_does_not_allocate)
{
    a_tick_does_not_allocate(test_state);
}

#else

/* Glibc's own, behind the counting ones below */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);

static _Thread_local bool counting;
static _Thread_local size_t allocations;
static size_t answers;

void *malloc(size_t size)
{
    allocations += counting;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    allocations += counting;
    return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    allocations += counting;
    return __libc_realloc(block, size);
}

/* Every kind of request, over and over, in the loop's own thread. */
static void ask_all(void *context, int64_t time_ns)
{
    struct simulator *simulator = *(struct simulator **)context;
    static uint64_t turn;
    struct loop_request request = {.kind = (enum request_kind)(turn++ % (REQUEST_SET + 1)),
                                   .index = 1,
                                   .count = 2,
                                   .value = 1.0,
                                   .on = true,
                                   .force_n = {1.0, 0.0, 0.0},
                                   .duration_ns = 3 * CLOCK_MS};
    struct request_answer answer;

    (void)time_ns;
    if (request.kind == REQUEST_PAUSE) {
        requests_ask(simulator_requests(simulator), &request);
        request.kind = REQUEST_RESUME; /* in the same breath, for nobody else would */
    } else if (request.kind == REQUEST_STEP) {
        request.kind = REQUEST_FAULT;
    } else if (request.kind == REQUEST_RESET) {
        request.kind = REQUEST_RESTORE;
        request.index = 2; /* empty: the run shall come to its end */
    } else if (request.kind == REQUEST_RESTORE) {
        struct loop_request checkpoint = {.kind = REQUEST_CHECKPOINT, .index = 1};

        requests_ask(simulator_requests(simulator), &checkpoint);
    } else if (request.kind == REQUEST_SPEED) {
        request.value = 0.0;
    }
    requests_ask(simulator_requests(simulator), &request);
    while (requests_answer(simulator_requests(simulator), &answer)) {
        answers += answer.verdict == REQUEST_OK;
    }
}

static size_t allocations_of(enum loop_clock clock, const char *directory, bool asked)
{
    static const char *const fault[] = {
        "sensor l_leg_ft delayed 0.01", "sensor imu intermittent",
        "bus left_arm late 0.001",      "bus right_arm duplicate 0.1",
        "motor LElbj jam 0.2..",        "board left_arm/1 delayed 0.002"};
    struct simulator_config config = {
        .fault = fault,
        .nfault = sizeof fault / sizeof fault[0],
        .clock = clock,
        .transport = TRANSPORT_LOCAL,
        .ticks = 400,
        .task = "squat",
        .record = directory,
        .overwrite = true,
        .row_period_ns = 10 * CLOCK_MS,
    };
    struct simulator *simulator;
    const struct simulator_observer observer = {&simulator, ask_all};
    struct recorder_counters counters;
    struct arena arena;
    struct error error;
    struct rig rig;
    size_t found;

    rig_run_load("coman", &arena, &rig);
    rig_run_without_contact(&rig);
    rig.realtime.priority = 0;
    config.rig = &rig;
    config.requests = asked;
    config.observer = asked ? &observer : NULL;
    simulator = rig_run_open(&config, &arena, NULL);
    allocations = 0;
    counting = true;
    assert_int_equal(simulator_run(simulator), LOOP_END_LENGTH);
    counting = false;
    found = allocations;
    assert_ok(simulator_finish_recording(simulator, &counters, &error));
    assert_true(!directory || counters.frames > 1000);
    assert_int_equal(counters.rows, directory ? 40 : 0);
    rig_run_close(simulator, &arena, NULL);
    return found;
}

TEST(a_tick_does_not_allocate)
{
    char directory[] = "/tmp/loop-quiet-XXXXXX";

    assert_non_null(mkdtemp(directory));
    assert_int_equal(allocations_of(LOOP_CLOCK_FREE, directory, false), 0);
    assert_int_equal(allocations_of(LOOP_CLOCK_LOCKSTEP, directory, false), 0);
    static const char *const names[] = {"candump.log", "signals.csv"};
    char file[200];

    for (size_t i = 0; i < 2; i++) {
        snprintf(file, sizeof file, "%s/%s", directory, names[i]);
        unlink(file);
    }
    rmdir(directory);
}

TEST(a_request_does_not_allocate)
{
    assert_int_equal(allocations_of(LOOP_CLOCK_FREE, NULL, true), 0);
    assert_int_equal(allocations_of(LOOP_CLOCK_LOCKSTEP, NULL, true), 0);
    assert_true(answers > 400);
}

#endif
