/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modules that are compiled and found again: what happens when their files are damaged, when others
 * may write where they are, and when the compiler fails.
 */
#include "base/instruction_set.h"
#include "model/symbolic/symbolic.h"
#include "tests/unit/model/symbolic/evaluate.h"
#include "tests/test.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static const struct symbolic_options options = {.lanes = 4, .fast_compile = true};
static char folder[64], tools[64], path_before[4096];
static struct random_tree tree;
static struct symbolic_library library;
static struct error error;

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-cache-XXXXXX");
    strcpy(tools, "/tmp/hil-tools-XXXXXX");
    snprintf(path_before, sizeof path_before, "%s", getenv("PATH"));
    return !mkdtemp(folder) || !mkdtemp(tools) || pendulum_make(&tree, &error);
}

FIXTURE(close_folder)
{
    char command[160];

    symbolic_close(&library);
    setenv("PATH", path_before, 1);
    snprintf(command, sizeof command, "rm -r '%s' '%s'", folder, tools);
    return system(command);
}

static void skip_without_compiler(void)
{
    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
}

/* A compiler of our own is found first; it may call the real one. */
static void put_compiler(const char *script)
{
    char path[96], search[sizeof path_before + 64];
    FILE *file;

    snprintf(path, sizeof path, "%s/cc", tools);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "#!/bin/sh\nPATH='%s'\n%s\n", path_before, script);
    fclose(file);
    assert_int_equal(chmod(path, 0700), 0);
    snprintf(search, sizeof search, "%s:%s", tools, path_before);
    setenv("PATH", search, 1);
}

/* How many entries the folder has; path: of the last one. */
static int list_folder(char path[384])
{
    DIR *listing = opendir(folder);
    const struct dirent *entry;
    int count = 0;

    while (listing && (entry = readdir(listing))) {
        if (entry->d_name[0] != '.') {
            snprintf(path, 384, "%s/%s", folder, entry->d_name);
            count++;
        }
    }
    closedir(listing);
    return count;
}

/* What was loaded computes. */
static void use_and_close(void)
{
    double q = 0.3, v = 0.5, tau = 0.1, vdot = 0.0;

    library.module->forward(NULL, &q, &v, &tau, NULL, &vdot);
    assert_true(vdot != 0.0);
    symbolic_close(&library);
}

static void build(void)
{
    if (symbolic_build(&tree.robot, &options, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    use_and_close();
}

static void assert_found(void)
{
    if (symbolic_find(&tree.robot, &options, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    use_and_close();
}

TEST_WITH(what_was_built_is_found, open_folder, close_folder)
{
    assert_int_equal(symbolic_find(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "there is no module"));
    skip_without_compiler();
    build();
    assert_found();
}

/* ---- damage ---- */

/* Each in a process of its own: a library that is too short kills who loads it. */
static void assert_damaged(const char *what)
{
    pid_t pid = fork();
    int status;

    if (pid == 0) {
        _exit(symbolic_find(&tree.robot, &options, folder, &library, &error) == ERROR_UNSUPPORTED &&
                      strstr(error.text, "damaged")
                  ? 0
                  : 1);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        fail_msg("%s: status %x", what, (unsigned)status);
    }
}

TEST_WITH(a_damaged_module_is_never_loaded, open_folder, close_folder)
{
    char path[384];
    struct stat status;

    skip_without_compiler();
    build();
    assert_int_equal(list_folder(path), 1);
    assert_int_equal(stat(path, &status), 0);
    assert_non_null(strstr(path, instruction_set_architecture));

    /* Truncated here and there, as by a full disk or a power cut */
    for (int part = 0; part < 8; part++) {
        assert_int_equal(truncate(path, part * status.st_size / 8), 0);
        assert_damaged("truncated");
    }
    build();
    assert_int_equal(truncate(path, status.st_size - 1), 0);
    assert_damaged("one byte short");
    build();

    /* One bit, which the loader would not notice */
    for (int part = 1; part < 8; part += 3) {
        int file = open(path, O_RDWR);
        unsigned char byte;

        assert_int_equal(pread(file, &byte, 1, part * status.st_size / 8), 1);
        byte ^= 0x10;
        assert_int_equal(pwrite(file, &byte, 1, part * status.st_size / 8), 1);
        close(file);
        assert_damaged("a bit");
        build();
    }
    assert_found();
    assert_int_equal(list_folder(path), 1);
}

TEST_WITH(a_folder_that_others_may_write_to_is_refused, open_folder, close_folder)
{
    assert_int_equal(chmod(folder, 0777), 0);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "others may write"));
    assert_int_equal(chmod(folder, 0700), 0);
    assert_int_equal(symbolic_build(&tree.robot, &options, "/nowhere/at/all", &library, &error),
                     ERROR_SYSTEM);
}

/* ---- the compiler ---- */

TEST_WITH(without_a_compiler_the_build_says_so, open_folder, close_folder)
{
    setenv("PATH", folder, 1);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "no C compiler"));
}

static void assert_nothing_is_left(const char *script, const char *cause)
{
    char path[384];

    put_compiler(script);
    assert_int_equal(symbolic_build(&tree.robot, &options, folder, &library, &error),
                     ERROR_UNSUPPORTED);
    if (!strstr(error.text, cause)) {
        fail_msg("%s: %s", cause, error.text);
    }
    assert_null(library.handle);
    assert_int_equal(list_folder(path), 0);
}

/* The file that is being made is what stands behind -o. */
#define HALF "for word; do [ \"$last\" = -o ] && echo half >\"$word\"; last=$word; done; "

TEST_WITH(a_compiler_that_fails_leaves_nothing, open_folder, close_folder)
{
    assert_nothing_is_left("exit 3", "failed with status 3");
    assert_nothing_is_left(HALF "exit 3", "failed with status 3");
    assert_nothing_is_left(HALF "kill -KILL $$", "killed by signal 9");
}
