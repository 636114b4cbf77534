/* SPDX-License-Identifier: Apache-2.0 */
/* The file of --ready: whole, its owner's, read by a shell to the very bytes, gone at the end. */
#include "app/cli/cli.h"
#include "tests/unit/app/put_file.h"

#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static struct error error;

static char folder[64], path[96];

FIXTURE(begin)
{
    strcpy(folder, "/tmp/hil-ready-XXXXXX");
    if (!mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/ready", folder);
    return 0;
}

FIXTURE(end)
{
    unlink(path);
    return rmdir(folder); /* fails when something else was left there */
}

/* What sh makes of the file when it prints the value of a name. */
static void assert_shell_reads(const char *name, const char *expected)
{
    char command[256], text[256];
    FILE *shell;
    size_t count;

    snprintf(command, sizeof command, "set -eu; . '%s'; printf %%s \"${%s-none}\"", path, name);
    shell = popen(command, "re");
    assert_non_null(shell);
    count = fread(text, 1, sizeof text - 1, shell);
    text[count] = '\0';
    assert_int_equal(pclose(shell), 0);
    assert_string_equal(text, expected);
}

TEST_WITH(a_shell_reads_what_was_written, begin, end)
{
    static const char strange[] = "/tmp/it's $HOME `id` \"a\\b\"\n;#&/control";
    const struct ready ready = {.clock = "lockstep",
                                .control = strange,
                                .gateway_host = "::1",
                                .gateway_port = 65535,
                                .page = "http://127.0.0.1:1/#token=5&x=1",
                                .page_view = ""};
    struct stat info;
    char pid[16];

    assert_ok(ready_write(path, &ready, &error));
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 07777, 0600);
    snprintf(pid, sizeof pid, "%ld", (long)getpid());
    assert_shell_reads("pid", pid);
    assert_shell_reads("clock", "lockstep");
    assert_shell_reads("control", strange);
    assert_shell_reads("gateway_host", "::1");
    assert_shell_reads("gateway_port", "65535");
    assert_shell_reads("page", "http://127.0.0.1:1/#token=5&x=1");
    assert_shell_reads("page_view", "none");
}

TEST_WITH(what_a_run_has_not_has_no_line, begin, end)
{
    assert_ok(ready_write(path, &(struct ready){.page_view = "a"}, &error));
    assert_shell_reads("page_view", "a");
    assert_shell_reads("clock", "none");
    assert_shell_reads("control", "none");
    assert_shell_reads("gateway_host", "none");
    assert_shell_reads("gateway_port", "none");
}

TEST_WITH(it_is_gone_before_the_start_and_after_the_end, begin, end)
{
    assert_ok(ready_begin(path, &error)); /* none is there */
    for (int i = 0; i < 2; i++) {
        assert_ok(ready_write(path, &(struct ready){.control = "x"}, &error));
        assert_int_equal(access(path, F_OK), 0);
        if (i == 0) {
            assert_ok(ready_begin(path, &error));
        } else {
            ready_end(path);
        }
        assert_int_equal(access(path, F_OK), -1);
    }
}

/* The file of a run that goes on, until it has ended: a start and a slower start leave it alone. */
TEST_WITH(a_file_of_a_living_run_stays, begin, end)
{
    const pid_t child = fork();
    FILE *file;

    if (child == 0) {
        pause();
        _exit(0);
    }
    assert_true(child > 0);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "pid='%ld'\nclock='real'\n", (long)child);
    fclose(file);
    assert_int_equal(ready_begin(path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "is running"));
    assert_int_equal(ready_write(path, &(struct ready){.clock = "free"}, &error), ERROR_INPUT);
    ready_end(path);
    assert_shell_reads("clock", "real");
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, NULL, 0), child);
    assert_ok(ready_begin(path, &error));
    assert_int_equal(access(path, F_OK), -1);
}

/* A run refuses a link to a file and a link to nothing. It writes through a link to a device. */
TEST_WITH(a_link_stays, begin, end)
{
    static const char *const to[] = {"there", "not-there", "/dev/null"};
    char file[128], where[128];

    snprintf(file, sizeof file, "%s/there", folder);
    fclose(fopen(file, "w"));
    for (int i = 0; i < 3; i++) {
        assert_int_equal(symlink(to[i], path), 0);
        assert_int_equal(ready_begin(path, &error), i < 2 ? ERROR_INPUT : ERROR_NONE);
        assert_int_equal(ready_write(path, &(struct ready){.clock = "free"}, &error),
                         i < 2 ? ERROR_INPUT : ERROR_NONE);
        ready_end(path);
        assert_int_equal(readlink(path, where, sizeof where), strlen(to[i]));
        assert_int_equal(unlink(path), 0);
    }
    unlink(file);
}

TEST_WITH(what_is_no_file_of_ours_stays, begin, end)
{
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_ok(ready_begin(path, &error));
    ready_end(path);
    assert_int_equal(access(path, F_OK), 0);
}

TEST_WITH(a_file_of_somebody_else_stays, begin, end)
{
    put_file(path, "name: my rig\n");
    assert_int_equal(ready_begin(path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, path));
    assert_int_equal(access(path, F_OK), 0);

    /* An empty one, as mktemp makes it, is nobody's */
    assert_int_equal(truncate(path, 0), 0);
    assert_ok(ready_begin(path, &error));
    assert_int_equal(access(path, F_OK), -1);
}

TEST_WITH(a_place_that_cannot_be_written_is_an_error, begin, end)
{
    char nowhere[128];

    snprintf(nowhere, sizeof nowhere, "%s/none/ready", folder);
    assert_int_equal(ready_write(nowhere, &(struct ready){.control = "x"}, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, nowhere));
}

TEST_WITH(nothing_happens_without_a_path, begin, end)
{
    assert_ok(ready_begin(NULL, &error));
    assert_ok(ready_write(NULL, &(struct ready){.control = "x"}, &error));
    ready_end(NULL);
}
