/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil generate: the file that it writes, and its exit statuses. */
#include "model/symbolic/symbolic.h"
#include "app/cli/cli.h"
#include "base/options.h"
#include "tests/test.h"

#include <sys/wait.h>
#include <unistd.h>

#define COMAN HIL_SOURCE_DIR "/config/robots/coman.yaml"

static char folder[64];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-generate-XXXXXX");
    return !mkdtemp(folder);
}

FIXTURE(close_folder)
{
    char command[128];

    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

/* The command in a child with its output thrown away; its exit status. */
static int run(const char *robot, const char *directory, const char *lanes)
{
    pid_t pid;
    int status;

    fflush(NULL);
    pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        char words[6][256];
        char *argv[7] = {words[0], words[1], words[2], words[3], words[4], words[5], NULL};
        const char *const given[6] = {"generate", robot, "-o", directory, "--lanes", lanes};

        for (int n = 0; n < 6; n++) {
            snprintf(words[n], sizeof words[n], "%s", given[n]);
        }
        if (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)) {
            _exit(99);
        }
        _exit(cmd_generate(6, argv));
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

TEST_WITH(it_writes_what_the_library_generates, open_folder, close_folder)
{
    const struct symbolic_options options = {.lanes = 2};
    static char found[4 << 20], expected[4 << 20];
    const struct robot *robot;
    struct arena arena;
    struct error error;
    char path[128];
    FILE *file;

    assert_int_equal(run(COMAN, folder, "2"), STATUS_OK);
    snprintf(path, sizeof path, "%s/coman_dynamics.c", folder);
    file = fopen(path, "r");
    assert_non_null(file);
    assert_true(fread(found, 1, sizeof found - 1, file) > 100000);
    fclose(file);

    assert_ok(arena_init(&arena, 1 << 26, &error));
    assert_ok(robot_load(COMAN, NULL, &arena, &robot, &error));
    file = fmemopen(expected, sizeof expected, "w");
    assert_non_null(file);
    assert_ok(symbolic_generate(robot, &options, file, NULL, &error));
    fclose(file);
    arena_fini(&arena);
    assert_string_equal(found, expected);
}

TEST_WITH(wrong_arguments_and_files_have_their_exit_statuses, open_folder, close_folder)
{
    assert_int_equal(run("/nowhere/robot.yaml", folder, "4"), STATUS_INPUT);
    assert_int_equal(run(COMAN, folder, "3"), STATUS_INPUT);
    assert_int_equal(run(COMAN, "/nowhere/at/all", "4"), STATUS_SYSTEM);
}

TEST_WITH(a_failed_run_leaves_nothing_behind, open_folder, close_folder)
{
    char command[128];

    assert_int_equal(run("/nowhere/robot.yaml", folder, "4"), STATUS_INPUT);
    snprintf(command, sizeof command, "test -z \"$(ls -A '%s')\"", folder);
    assert_int_equal(system(command), 0);
}
