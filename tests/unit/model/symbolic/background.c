/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modules that are compiled in the background: what is said while they are, when they are there,
 * and when the compiler or the build has failed, hangs or was killed.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "model/symbolic/background.h"
#include "tests/unit/model/symbolic/cache_scene.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

enum { PATIENCE_MS = 60000, STEP_MS = 20 };

static struct error reason;

static void sleep_step(void)
{
    nanosleep(&(struct timespec){.tv_nsec = STEP_MS * 1000000L}, NULL);
}

static enum symbolic_state begin(void)
{
    return symbolic_build_in_background(&tree.robot, &options, folder, -1, &reason);
}

/* The state when nobody compiles any more. */
static enum symbolic_state outcome(void)
{
    enum symbolic_state state = SYMBOLIC_COMPILING;

    for (int ms = 0; ms < PATIENCE_MS && state == SYMBOLIC_COMPILING; ms += STEP_MS) {
        sleep_step();
        state = symbolic_state(&tree.robot, &options, folder, &reason);
    }
    return state;
}

static void assert_in_reason(const char *text)
{
    if (!strstr(reason.text, text)) {
        fail_msg("%s: %s", text, reason.text);
    }
}

/* Waits for a number that a compiler writes into a file of the tools. */
static int number_in(const char *name)
{
    char path[96];
    int number = 0;

    snprintf(path, sizeof path, "%s/%s", tools, name);
    for (int ms = 0; ms < PATIENCE_MS && number <= 0; ms += STEP_MS) {
        FILE *file = fopen(path, "r");

        if (file) {
            if (fscanf(file, "%d", &number) != 1) {
                number = 0;
            }
            fclose(file);
        }
        sleep_step();
    }
    return number;
}

/* Dead or, where init does not wait for children, a zombie. */
static bool has_ended(int pid)
{
    char path[64], state = 'Z';
    FILE *file;

    snprintf(path, sizeof path, "/proc/%d/stat", pid);
    file = fopen(path, "r");
    if (file) {
        if (fscanf(file, "%*d (%*[^)]) %c", &state) != 1) {
            state = '?';
        }
        fclose(file);
    }
    return state == 'Z' || state == 'X';
}

/* The build's folder and its claim go after the module has come. */
static void assert_alone(const char *end)
{
    char path[384] = "";

    for (int ms = 0; ms < PATIENCE_MS && list_cache(path) > 1; ms += STEP_MS) {
        sleep_step();
    }
    assert_int_equal(list_cache(path), 1);
    assert_non_null(strstr(path, end));
}

static void the_next_start_finds_what_was_compiled(void **state)
{
    char path[384];

    (void)state;
    skip_without_compiler();
    put_compiler("sleep 1; exec cc \"$@\"");
    assert_int_equal(symbolic_state(&tree.robot, &options, folder, &reason), SYMBOLIC_MISSING);
    assert_string_equal(reason.text, "");
    assert_int_equal(list_cache(path), 0);
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_string_equal(reason.text, "");
    assert_int_equal(symbolic_find(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);

    /* A second one does not compile, and there is no child to wait for */
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_in_reason("another start");
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
    assert_int_equal(outcome(), SYMBOLIC_COMPILED);
    assert_int_equal(symbolic_find(&tree.robot, &options, folder, &library, &error), ERROR_NONE);
    assert_true(library.cached);
    assert_int_equal(begin(), SYMBOLIC_COMPILED);
    assert_alone(".so");
}

static void a_failure_is_told_and_not_tried_again(void **state)
{
    char path[384];

    (void)state;
    skip_without_compiler();
    put_compiler("echo x >>\"${0%cc}times\"; echo 'cause: no such thing' >&2; exit 3");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);
    assert_in_reason("status 3");
    assert_alone(".failed");
    assert_int_equal(list_cache(path), 1);
    assert_in_reason(path);
    assert_int_equal(begin(), SYMBOLIC_FAILED);
    assert_in_reason("status 3");
    assert_alone(".failed");

    /* Again when the note is gone */
    assert_int_equal(unlink(path), 0);
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);

    /* Or is not whole */
    assert_int_equal(truncate(path, 80), 0);
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);

    /* Or with another compiler */
    put_compiler("exec cc \"$@\"");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_COMPILED);
    assert_alone(".so");
    snprintf(path, sizeof path, "test $(wc -l <'%s/times') = 3", tools);
    assert_int_equal(system(path), 0);
}

static void a_build_that_is_waited_for_forgets_the_failure(void **state)
{
    (void)state;
    skip_without_compiler();
    put_compiler("exit 1");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);
    setenv("PATH", path_before, 1);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error), ERROR_NONE);
    assert_alone(".so");
}

static void what_the_compiler_says_is_kept_up_to_a_limit(void **state)
{
    char path[384];
    struct stat status;

    (void)state;
    put_compiler("yes 'a long line' | head -c 1000000; exit 1");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);
    assert_in_reason("status 1");
    assert_alone(".failed");
    list_cache(path);
    assert_int_equal(stat(path, &status), 0);
    assert_in_range(status.st_size, 10000, 40000);
}

static void a_compiler_that_hangs_is_killed_with_its_children(void **state)
{
    struct symbolic_options limited = options;

    (void)state;
    limited.limit_s = 1.0;
    put_compiler("trap '' TERM; sleep 1000 & echo $! >\"${0%cc}sleeps\"; wait");
    assert_int_equal(symbolic_build_in_background(&tree.robot, &limited, folder, -1, &reason),
                     SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);
    assert_in_reason("more than 1 s");
    assert_alone(".failed");
    assert_true(has_ended(number_in("sleeps")));
}

static void a_build_that_is_killed_is_begun_again(void **state)
{
    struct timespec old[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    char path[384], claim[384] = "";
    int compiler;

    (void)state;
    skip_without_compiler();
    put_compiler("echo $$ >\"${0%cc}compiler\"; echo $PPID >\"${0%cc}builder\"; exec sleep 1000");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    compiler = number_in("compiler");
    assert_int_equal(kill(number_in("builder"), SIGKILL), 0);
    assert_int_equal(outcome(), SYMBOLIC_MISSING);
    assert_string_equal(reason.text, "");
    assert_int_equal(kill(compiler, SIGKILL), 0);

    /* Its folder and its claim: the next build removes them */
    for (DIR *listing = opendir(folder); listing; listing = NULL) {
        const struct dirent *entry;

        while ((entry = readdir(listing))) {
            if (!strncmp(entry->d_name, "build-", 6)) {
                snprintf(claim, sizeof claim, "%s/%s", folder, entry->d_name);
                assert_int_equal(utimensat(AT_FDCWD, claim, old, 0), 0);
            }
        }
        closedir(listing);
    }
    assert_int_equal(list_cache(path), 2);
    put_compiler("exec cc \"$@\"");
    assert_int_equal(begin(), SYMBOLIC_COMPILING);
    assert_int_equal(outcome(), SYMBOLIC_COMPILED);
    assert_alone(".so");
}

static void the_processor_of_the_loop_is_left_alone(void **state)
{
    cpu_set_t before, alone, set;
    int loop_cpu = 0, compiler;

    (void)state;
    assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
    if (CPU_COUNT(&before) < 2) {
        print_message("SKIP: one processor\n");
        skip();
    }
    while (!CPU_ISSET((size_t)loop_cpu, &before)) {
        loop_cpu++;
    }
    put_compiler("echo $$ >\"${0%cc}compiler\"; exec sleep 1000");

    /* As in a run that follows another: this thread is already where the loop was */
    CPU_ZERO(&alone);
    CPU_SET((size_t)loop_cpu, &alone);
    assert_int_equal(sched_setaffinity(0, sizeof alone, &alone), 0);
    assert_int_equal(symbolic_build_in_background(&tree.robot, &options, folder, loop_cpu, &reason),
                     SYMBOLIC_COMPILING);
    compiler = number_in("compiler");
    assert_int_equal(sched_setaffinity(0, sizeof before, &before), 0);
    assert_int_equal(sched_getaffinity(compiler, sizeof set, &set), 0);
    assert_false(CPU_ISSET((size_t)loop_cpu, &set));
    assert_true(CPU_COUNT(&set) >= 1);
    assert_int_equal(sched_getscheduler(compiler), SCHED_IDLE);
    assert_int_equal(kill(compiler, SIGKILL), 0);
    assert_int_equal(outcome(), SYMBOLIC_FAILED);
    assert_in_reason("killed by signal 9");
}

static void where_it_cannot_be_compiled_the_reason_is_told(void **state)
{
    char path[384];

    (void)state;
    setenv("PATH", folder, 1);
    assert_int_equal(begin(), SYMBOLIC_MISSING);
    assert_in_reason("no C compiler");
    assert_int_equal(list_cache(path), 0);
    assert_int_equal(chmod(folder, 0777), 0);
    assert_int_equal(begin(), SYMBOLIC_MISSING);
    assert_in_reason("others may write");
    assert_int_equal(chmod(folder, 0700), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_next_start_finds_what_was_compiled, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(a_failure_is_told_and_not_tried_again, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(a_build_that_is_waited_for_forgets_the_failure, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(what_the_compiler_says_is_kept_up_to_a_limit, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(a_compiler_that_hangs_is_killed_with_its_children,
                                        open_cache, close_cache),
        cmocka_unit_test_setup_teardown(a_build_that_is_killed_is_begun_again, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(the_processor_of_the_loop_is_left_alone, open_cache,
                                        close_cache),
        cmocka_unit_test_setup_teardown(where_it_cannot_be_compiled_the_reason_is_told, open_cache,
                                        close_cache),
    };

    return cmocka_run_group_tests_name("symbolic_background", tests, NULL, NULL);
}
