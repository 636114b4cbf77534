/* SPDX-License-Identifier: Apache-2.0 */
/* Files to be read: regular ones within their limit, which no output replaces. */
#include "base/input_file.h"

#include "base/whole_file.h"
#include "tests/test.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

static char folder[] = "/tmp/input-file-XXXXXX";
static char path[64], other[64], link_name[64];

FIXTURE(make_folder)
{
    if (!mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/file", folder);
    snprintf(other, sizeof other, "%s/other", folder);
    snprintf(link_name, sizeof link_name, "%s/link", folder);
    return 0;
}

FIXTURE(empty_folder)
{
    unlink(path);
    unlink(other);
    return 0;
}

FIXTURE(remove_folder)
{
    return rmdir(folder);
}

static void put(const char *name, const char *text)
{
    FILE *file = fopen(name, "w");

    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void read_it(const char *name)
{
    struct error error;
    size_t size;
    int fd;

    assert_ok(input_file_open(name, &fd, &size, &error));
    close(fd);
}

static void assert_refused(const char *name, const char *why)
{
    struct error error;
    size_t size;
    char *text = folder;
    FILE *file = stdin;

    assert_int_equal(input_file_load(name, 1000, &text, &size, &error), ERROR_INPUT);
    assert_null(text);
    assert_memory_equal(error.text, name, strlen(name));
    assert_non_null(strstr(error.text, why));
    assert_int_equal(input_file_stream(name, &file, &error), ERROR_INPUT);
    assert_null(file);
}

/* Writes to a file as an output does; returns the outcome. */
static enum error_code write_to(const char *name, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, name, error);

    return code ? code : whole_file_close(&file, ERROR_NONE, error);
}

/* The first file that the process reads; its names are made before. */
TEST_WITH(an_input_is_no_output_by_any_name, NULL, empty_folder)
{
    static const struct timespec tick = {.tv_nsec = 20000000}; /* more than of the clock of files */
    const char *const names[] = {path, other, link_name};
    struct error error;
    int fd;

    put(path, "input");
    assert_int_equal(link(path, other), 0);
    assert_int_equal(symlink(path, link_name), 0);
    nanosleep(&tick, NULL);
    read_it(path);
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(write_to(names[i], &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, names[i]));
        assert_int_equal(whole_file_probe(names[i], &error), ERROR_INPUT);
        assert_int_equal(growing_file_open(names[i], &fd, &error), ERROR_INPUT);
    }
    unlink(link_name);
    unlink(other);
    assert_ok(write_to(other, &error));
}

/* The time limit of the test is the assertion that none of them waits. */
TEST_WITH(what_is_no_regular_file_is_refused_at_once, NULL, empty_folder)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int listener = socket(AF_UNIX, SOCK_STREAM, 0);

    assert_int_equal(mkfifo(path, 0600), 0);
    memcpy(address.sun_path, other, sizeof other);
    assert_int_equal(bind(listener, (struct sockaddr *)&address, sizeof address), 0);
    assert_refused(path, "found no regular file, expected a file");
    assert_refused(other, "found no regular file, expected a file");
    assert_refused("/dev/zero", "found no regular file, expected a file");
    assert_refused(folder, "found a directory, expected a file");
    assert_refused("/nowhere/file", "cannot be read: No such file");
    close(listener);
}

TEST_WITH(a_file_is_read_up_to_its_limit, NULL, empty_folder)
{
    struct error error;
    size_t size;
    char *text;

    put(path, "four");
    assert_ok(input_file_load(path, 4, &text, &size, &error));
    assert_int_equal(size, 4);
    assert_string_equal(text, "four");
    free(text);
    assert_int_equal(input_file_load(path, 3, &text, &size, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found more than 3 bytes, expected at most that"));
    assert_null(text);
}

/* As an import does, which checks what it has made. */
TEST_WITH(what_was_written_and_read_back_may_be_written_again, NULL, empty_folder)
{
    struct error error;

    for (int i = 0; i < 3; i++) {
        assert_ok(write_to(path, &error));
        read_it(path);
    }
}

/* File systems give the inode of a file that was removed to the next one. */
TEST_WITH(a_file_in_the_place_of_an_input_that_is_gone_is_none, NULL, empty_folder)
{
    struct error error;
    struct stat there;

    put(path, "input");
    read_it(path);
    assert_int_equal(rename(path, other), 0);
    assert_int_equal(stat(other, &there), 0);
    assert_ok(input_file_check_output(other, &there, &error));
}

TEST_GROUP(make_folder, remove_folder)
