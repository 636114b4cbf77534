/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every allocation of ours between a rig file and a simulator that is ready to run fails once, from
 * the heap or from the arena: the call that needed it says ERROR_MEMORY in a sentence that speaks
 * of memory, and what was made until then is given back: memory, descriptors, threads, files. (What
 * libraries allocate for us fails in service/fail_nth.py.)
 *
 * The linker puts the functions __wrap_... in front of those of the same name.
 */
#include "base/arena.h"
#include "base/memory_file.h"
#include "rig/rig.h"
#include "sim/simulator.h"
#include "tests/test.h"

#include <dirent.h>
#include <stdatomic.h>
#include <time.h>
#include <unistd.h>

enum { SPREAD = 250, CLOSE = 250 };

static atomic_size_t allocations, failing; /* failing: the one that does; 0 = none */
static atomic_size_t blocks;               /* of the heap, in our hands */

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__real_arena_alloc(struct arena *arena, size_t count, size_t size);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void __wrap_free(void *memory);
void *__wrap_arena_alloc(struct arena *arena, size_t count, size_t size);

static bool fails(void)
{
    return atomic_fetch_add(&allocations, 1) + 1 == atomic_load(&failing);
}

static void *taken(void *memory)
{
    atomic_fetch_add(&blocks, memory != NULL);
    return memory;
}

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : taken(__real_malloc(size));
}

void *__wrap_calloc(size_t count, size_t size)
{
    return fails() ? NULL : taken(__real_calloc(count, size));
}

void *__wrap_realloc(void *memory, size_t size)
{
    if (fails()) {
        return NULL;
    }
    return memory ? __real_realloc(memory, size) : taken(__real_realloc(memory, size));
}

void __wrap_free(void *memory)
{
    atomic_fetch_sub(&blocks, memory != NULL);
    __real_free(memory);
}

void *__wrap_arena_alloc(struct arena *arena, size_t count, size_t size)
{
    return fails() ? NULL : __real_arena_alloc(arena, count, size);
}

/* ---- what is held ---- */

struct holdings {
    size_t blocks, descriptors, threads;
};

static size_t entries(const char *path)
{
    DIR *directory = opendir(path);
    size_t count = 0;

    assert_non_null(directory);
    while (readdir(directory)) {
        count++;
    }
    closedir(directory);
    return count;
}

static struct holdings holdings(void)
{
    struct holdings now = {.descriptors = entries("/proc/self/fd")};

    now.threads = entries("/proc/self/task");
    now.blocks = atomic_load(&blocks);
    return now;
}

/* A thread that was joined may still be listed for a moment. */
static struct holdings settled_holdings(const struct holdings *before)
{
    struct holdings now = holdings();

    for (int tries = 0; tries < 100 && now.threads > before->threads; tries++) {
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
        now = holdings();
    }
    return now;
}

/* ---- a start ---- */

static enum error_code start(const char *name, const char *task,
                             const struct gateway_config *gateway, const char *record,
                             struct error *error)
{
    struct simulator_config config = {
        .clock = LOOP_CLOCK_FREE,
        .transport = TRANSPORT_LOCAL,
        .ticks = 10,
        .task = task,
        .requests = true,
        .gateway = gateway,
        .record = record,
        .row_period_ns = 10000000,
    };
    struct simulator *simulator = NULL;
    struct realtime_report report;
    const struct rig *rig;
    struct arena arena;
    enum error_code code;
    char notice[256];

    code = arena_init(&arena, (size_t)512 << 20, error);
    if (code) {
        return code;
    }
    code = rig_load(name, &arena, &rig, error);
    if (!code) {
        config.rig = rig;
        config.hold = rig->hold;
        code = simulator_create(&config, &arena, &simulator, notice, error);
    }
    if (!code) {
        code = simulator_start(simulator, &report, error);
    }
    simulator_destroy(simulator);
    arena_fini(&arena);
    return code;
}

/* false: the start came to its end before its n-th allocation */
static bool survives(const char *name, const char *task, const char *record, size_t n)
{
    const struct gateway_config gateway = {.port = 0};
    struct error error = {.text = ""};
    struct holdings before = holdings(), after;
    enum error_code code;

    atomic_store(&allocations, 0);
    atomic_store(&failing, n);
    code = start(name, task, &gateway, record, &error);
    atomic_store(&failing, 0);
    after = settled_holdings(&before);
    if (access(record, F_OK) == 0) {
        fail_msg("allocation %zu: leaves %s", n, record);
    }
    if (after.blocks != before.blocks || after.descriptors != before.descriptors ||
        after.threads != before.threads) {
        fail_msg("allocation %zu (%s): holds %td blocks, %td descriptors, %td threads more", n,
                 error.text, (ptrdiff_t)(after.blocks - before.blocks),
                 (ptrdiff_t)(after.descriptors - before.descriptors),
                 (ptrdiff_t)(after.threads - before.threads));
    }
    if (n == 0 || n > atomic_load(&allocations)) {
        if (code) {
            fail_msg("undisturbed: %s", error.text);
        }
        return false;
    }
    if (code != ERROR_MEMORY || !strstr(error.text, "memory")) {
        fail_msg("allocation %zu: code %d, \"%s\"", n, code, error.text);
    }
    return true;
}

/* All of the last allocations, which are those of the simulator, and some of those before, most of
 * which are values of the rig file. HIL_FAIL_NTH=full in the environment: all of them. */
static void try_all(const char *rig, const char *task)
{
    const char *wish = getenv("HIL_FAIL_NTH");
    char folder[] = "/tmp/fail-memory-XXXXXX", record[64], path[512];
    size_t count, step = 1, tried = 0;

    assert_non_null(mkdtemp(folder));
    snprintf(record, sizeof record, "%s/record", folder);
    snprintf(path, sizeof path, HIL_SOURCE_DIR "/config/rigs/%s.yaml", rig);
    survives(path, task, record, 0);
    count = atomic_load(&allocations);
    if (count > CLOSE && !(wish && strcmp(wish, "full") == 0)) {
        step = (count - CLOSE) / SPREAD + 1;
    }
    for (size_t n = 1; n <= count; n += n + CLOSE < count ? step : 1) {
        assert_true(survives(path, task, record, n));
        tried++;
    }
    assert_false(survives(path, task, record, count + 1));
    print_message("# %s: %zu of %zu allocations failed\n", rig, tried, count);
    rmdir(folder);
}

TEST(coman_gives_back_what_it_holds)
{
    try_all("coman", "squat");
}

TEST(grasp_gives_back_what_it_holds)
{
    try_all("grasp", "grasp");
}

TEST(coman_fd_gives_back_what_it_holds)
{
    try_all("coman-fd", "squat");
}

/* Text that grows the memory several times; false: the text came whole. */
static bool loses_text(size_t n)
{
    struct memory_file memory;
    struct error error;
    size_t written = 0;
    FILE *file;

    atomic_store(&allocations, 0);
    atomic_store(&failing, n);
    file = memory_file_open(&memory);
    for (int i = 0; file && i < 10000; i++) {
        written += (size_t)fprintf(file, "line %d\n", i);
    }
    if (file && !memory_file_close(file, &memory, "a text", &error)) {
        assert_int_equal(memory.size, written);
        assert_int_equal(strlen(memory.text), written);
        free(memory.text);
        atomic_store(&failing, 0);
        return false;
    }
    atomic_store(&failing, 0);
    assert_null(memory.text);
    if (file) {
        assert_int_equal(error.code, ERROR_MEMORY);
        assert_string_equal(error.text, "no memory left for a text");
    }
    return true;
}

TEST(a_text_in_memory_is_whole_or_not_there)
{
    struct holdings before = holdings();
    size_t n = 1;

    while (loses_text(n)) {
        n++;
    }
    assert_true(n > 5);
    assert_int_equal(holdings().blocks, before.blocks);
}
