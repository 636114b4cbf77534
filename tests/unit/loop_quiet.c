/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Nothing in a tick allocates: the whole of COMAN with boards, buses, recorder and the squat task
 * runs with every malloc of the loop's thread counted. The contact engine is left out, for Simbody
 * allocates by nature.
 */
#include "rt/simulator.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#define RIG HIL_SOURCE_DIR "/config/rigs/coman.yaml"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

static void a_tick_does_not_allocate(void **state)
{
    (void)state;
    print_message("SKIP: the sanitizers have an allocator of their own\n");
    skip();
}

#else

/* glibc's own, behind the counting ones below */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);

static _Thread_local bool counting;
static _Thread_local size_t allocations;

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

static void remove_directory(const char *path)
{
    static const char *const names[] = {"candump.log", "signals.csv"};
    char file[200];

    for (size_t i = 0; i < 2; i++) {
        snprintf(file, sizeof file, "%s/%s", path, names[i]);
        unlink(file);
    }
    rmdir(path);
}

static size_t allocations_of(enum rig_clock clock, const char *directory)
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
    struct recorder_counters counters;
    struct realtime_report report;
    struct simulator *simulator;
    const struct rig *loaded;
    struct arena arena;
    struct error error;
    char notice[256];
    struct rig rig;
    size_t found;

    assert_int_equal(arena_init(&arena, (size_t)256 << 20, &error), ERROR_NONE);
    assert_int_equal(rig_load(RIG, &arena, &loaded, &error), ERROR_NONE);
    rig = *loaded;
    rig.contact_engine = RIG_CONTACT_NONE;
    rig.contact = (struct contact_config){0}; /* as rig.h has it without an engine */
    rig.realtime.priority = 0;
    config.rig = &rig;
    if (simulator_create(&config, &arena, &simulator, notice, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(simulator_start(simulator, &report, &error), ERROR_NONE);
    allocations = 0;
    counting = true;
    assert_int_equal(simulator_run(simulator), LOOP_END_LENGTH);
    counting = false;
    found = allocations;
    assert_int_equal(simulator_finish_recording(simulator, &counters, &error), ERROR_NONE);
    assert_true(counters.frames > 1000);
    assert_int_equal(counters.rows, 40);
    simulator_destroy(simulator);
    arena_fini(&arena);
    return found;
}

static void a_tick_does_not_allocate(void **state)
{
    char directory[] = "/tmp/loop-quiet-XXXXXX";

    (void)state;
    assert_non_null(mkdtemp(directory));
    assert_int_equal(allocations_of(RIG_CLOCK_FREE, directory), 0);
    assert_int_equal(allocations_of(RIG_CLOCK_LOCKSTEP, directory), 0);
    remove_directory(directory);
}

#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tick_does_not_allocate),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
