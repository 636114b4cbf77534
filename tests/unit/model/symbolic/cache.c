/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modules that are compiled and kept: what happens to the files when they are damaged, when the
 * compiler or a whole build is killed, and what is said meanwhile.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/instruction_set.h"
#include "model/symbolic/cache.h"
#include "tests/unit/model/symbolic/cache_scene.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

/* Builds it and says whether it was there; what is loaded computes. */
static bool build_or_find(void)
{
    double q = 0.3, v = 0.5, tau = 0.1, vdot = 0.0;
    bool cached;

    if (symbolic_build(&tree.robot, &options, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    library.module->forward(NULL, &q, &v, &tau, NULL, &vdot);
    assert_true(vdot != 0.0);
    cached = library.cached;
    symbolic_close(&library);
    return cached;
}

/* ---- damage ---- */

/* Each in a process of its own: a library that is too short kills who loads it. */
static void assert_made_anew(const char *what)
{
    pid_t pid = fork();
    int status;

    if (pid == 0) {
        _exit(!symbolic_build(&tree.robot, &options, folder, &library, &error) && !library.cached
                  ? 0
                  : 1);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        fail_msg("%s: status %x", what, (unsigned)status);
    }
    assert_true(build_or_find());
}

static void a_damaged_module_is_never_loaded(void **state)
{
    char path[384];
    struct stat status;

    (void)state;
    skip_without_compiler();
    assert_false(build_or_find());
    assert_true(build_or_find());
    assert_int_equal(list_cache(path), 1);
    assert_int_equal(stat(path, &status), 0);
    assert_non_null(strstr(path, instruction_set_architecture));

    /* Truncated here and there, as by a full disk or a power cut */
    for (int part = 0; part < 8; part++) {
        assert_int_equal(truncate(path, part * status.st_size / 8), 0);
        assert_made_anew("truncated");
    }
    assert_int_equal(truncate(path, status.st_size - 1), 0);
    assert_made_anew("one byte short");

    /* One bit, which the loader would not notice */
    for (int part = 1; part < 8; part += 3) {
        int file = open(path, O_RDWR);
        unsigned char byte;

        assert_int_equal(pread(file, &byte, 1, part * status.st_size / 8), 1);
        byte ^= 0x10;
        assert_int_equal(pwrite(file, &byte, 1, part * status.st_size / 8), 1);
        close(file);
        assert_made_anew("a bit");
    }
    assert_int_equal(list_cache(path), 1);
}

static void a_folder_that_others_may_write_to_is_refused(void **state)
{
    (void)state;
    assert_int_equal(chmod(folder, 0777), 0);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "others may write"));
    assert_int_equal(chmod(folder, 0700), 0);
    assert_int_equal(symbolic_build(&tree.robot, &options, "/nowhere/at/all", &library, &error),
                     ERROR_SYSTEM);
}

/* ---- the compiler ---- */

static void without_a_compiler_the_build_says_so(void **state)
{
    (void)state;
    setenv("PATH", folder, 1);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "no C compiler"));
}

static void a_killed_compiler_leaves_nothing(void **state)
{
    char path[384];

    (void)state;
    put_compiler("echo half >\"$TMPDIR/cc1234.s\"; kill -KILL $$");
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "killed by signal 9"));
    assert_int_equal(list_cache(path), 0);
}

static void what_dead_builds_have_left_is_removed_and_no_other(void **state)
{
    char dead[96], living[96], young[96], path[384];
    struct timespec old[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    int lock;

    (void)state;
    skip_without_compiler();
    snprintf(dead, sizeof dead, "%s/build-dead00", folder);
    snprintf(living, sizeof living, "%s/build-living", folder);
    snprintf(young, sizeof young, "%s/build-young0", folder);
    assert_int_equal(mkdir(dead, 0700) | mkdir(living, 0700) | mkdir(young, 0700), 0);
    snprintf(path, sizeof path, "%s/module.c", dead);
    fclose(fopen(path, "w"));
    lock = open(living, O_RDONLY | O_DIRECTORY);
    assert_int_equal(flock(lock, LOCK_EX), 0);
    assert_int_equal(utimensat(AT_FDCWD, dead, old, 0) | utimensat(AT_FDCWD, living, old, 0), 0);
    assert_false(build_or_find());
    assert_int_equal(access(dead, F_OK), -1);
    assert_int_equal(access(living, F_OK) | access(young, F_OK), 0);
    assert_int_equal(list_cache(path), 3);
    close(lock);
}

/* ---- claims ---- */

static void a_claim_is_one_builders_until_it_is_closed(void **state)
{
    char path[96];
    int first, second;

    (void)state;
    snprintf(path, sizeof path, "%s/module" CACHE_CLAIM, folder);
    assert_false(cache_is_claimed(path));
    assert_int_equal(cache_claim(path, &first, &error), ERROR_NONE);
    assert_true(first >= 0 && cache_is_claimed(path));
    assert_int_equal(cache_claim(path, &second, &error), ERROR_NONE);
    assert_int_equal(second, -1);

    /* One that was removed by who had it is another file */
    unlink(path);
    assert_int_equal(cache_claim(path, &second, &error), ERROR_NONE);
    assert_true(second >= 0 && cache_is_claimed(path));
    close(first);
    assert_true(cache_is_claimed(path));
    close(second);
    assert_false(cache_is_claimed(path));
    snprintf(path, sizeof path, "%s/nowhere/module" CACHE_CLAIM, folder);
    assert_int_equal(cache_claim(path, &first, &error), ERROR_SYSTEM);
    assert_int_equal(first, -1);
}

static void dead_claims_are_removed_and_no_other(void **state)
{
    char dead[96], living[96], path[384];
    int lock;

    (void)state;
    skip_without_compiler();
    snprintf(dead, sizeof dead, "%s/dead" CACHE_CLAIM, folder);
    snprintf(living, sizeof living, "%s/living" CACHE_CLAIM, folder);
    fclose(fopen(dead, "w"));
    assert_int_equal(cache_claim(living, &lock, &error), ERROR_NONE);
    assert_false(build_or_find());
    assert_int_equal(access(dead, F_OK), -1);
    assert_int_equal(access(living, F_OK), 0);
    assert_int_equal(list_cache(path), 2);
    close(lock);
}

/* ---- progress ---- */

struct told {
    int count;
    double last_s;
    bool rising;
};

static void note_progress(void *context, const char *robot, double elapsed_s)
{
    struct told *told = context;

    assert_string_equal(robot, tree.robot.name);
    told->rising = (told->count == 0 || told->rising) && elapsed_s > told->last_s;
    told->last_s = elapsed_s;
    told->count++;
}

static void a_long_compilation_is_told(void **state)
{
    struct told told = {0};
    const struct symbolic_options telling = {
        .lanes = 4, .fast_compile = true, .progress = {note_progress, &told}};

    (void)state;
    skip_without_compiler();
    put_compiler("sleep 1; exec cc \"$@\"");
    if (symbolic_build(&tree.robot, &telling, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    print_message("# told %d times in %.2f s\n", told.count, told.last_s);
    assert_true(told.count >= 2 && told.rising && told.last_s > 0.5);
    assert_true(told.count <= 1 + (int)(told.last_s / 0.25));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_damaged_module_is_never_loaded, open_cache, close_cache),
        cmocka_unit_test_setup_teardown(a_folder_that_others_may_write_to_is_refused, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(without_a_compiler_the_build_says_so, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(a_killed_compiler_leaves_nothing, open_cache, close_cache),
        cmocka_unit_test_setup_teardown(what_dead_builds_have_left_is_removed_and_no_other,
                                        open_cache, close_cache),
        cmocka_unit_test_setup_teardown(a_claim_is_one_builders_until_it_is_closed, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(dead_claims_are_removed_and_no_other, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(a_long_compilation_is_told, open_cache, close_cache),
    };

    return cmocka_run_group_tests_name("symbolic_cache", tests, NULL, NULL);
}
