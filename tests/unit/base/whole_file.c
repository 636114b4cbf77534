/* SPDX-License-Identifier: Apache-2.0 */
/* Files that are there whole or as they were before. */
#include "base/input_file.h"
#include "base/whole_file.h"
#include "tests/test.h"

#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

static struct error error;

static char folder[] = "/tmp/whole-file-XXXXXX";
static char path[64], other[64];

static const char *content(const char *name)
{
    static char text[64];
    FILE *in = fopen(name, "r");
    size_t size = in ? fread(text, 1, sizeof text - 1, in) : 0;

    if (!in) {
        return NULL;
    }
    fclose(in);
    text[size] = '\0';
    return text;
}

FIXTURE(make_folder)
{
    if (!mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/file", folder);
    snprintf(other, sizeof other, "%s/other", folder);
    return 0;
}

/* A folder in which something else is left is not removed, which fails. */
FIXTURE(remove_folder)
{
    unlink(path);
    unlink(other);
    return rmdir(folder);
}

/* Counts what is in the folder, hidden files too. */
static int count_entries(void)
{
    DIR *entries = opendir(folder);
    int count = 0;

    assert_non_null(entries);
    for (struct dirent *entry; (entry = readdir(entries));) {
        count += strcmp(entry->d_name, ".") && strcmp(entry->d_name, "..");
    }
    closedir(entries);
    return count;
}

static enum error_code write_file(const char *name, const char *text, enum error_code code)
{
    struct whole_file file;

    assert_ok(whole_file_open(&file, name, &error));
    fputs(text, file.out);
    return whole_file_close(&file, code, &error);
}

TEST(has_its_name_when_it_is_whole)
{
    struct whole_file file;

    assert_ok(whole_file_open(&file, path, &error));
    fputs("first", file.out);
    assert_null(content(path));
    assert_ok(whole_file_close(&file, ERROR_NONE, &error));
    assert_string_equal(content(path), "first");
    assert_int_equal(count_entries(), 1);
}

TEST(leaves_what_was_there_when_writing_fails)
{
    assert_ok(write_file(path, "first", ERROR_NONE));
    assert_int_equal(write_file(path, "second", ERROR_MEMORY), ERROR_MEMORY);
    assert_string_equal(content(path), "first");
    assert_int_equal(count_entries(), 1);
}

TEST(replaces_a_link_and_leaves_what_it_points_to)
{
    struct stat there;

    assert_ok(write_file(other, "precious", ERROR_NONE));
    unlink(path);
    assert_int_equal(symlink(other, path), 0);
    assert_ok(write_file(path, "text", ERROR_NONE));
    assert_int_equal(lstat(path, &there), 0);
    assert_true(S_ISREG(there.st_mode));
    assert_string_equal(content(other), "precious");
    assert_string_equal(content(path), "text");
    assert_int_equal(unlink(other), 0);
}

TEST(is_never_writable_by_others)
{
    mode_t mask = umask(0);
    struct stat there;

    assert_ok(write_file(path, "text", ERROR_NONE));
    umask(mask);
    assert_int_equal(stat(path, &there), 0);
    assert_int_equal(there.st_mode & 0777, 0664);
}

TEST(stays_in_the_folder_that_it_was_opened_in)
{
    char moved[64];
    struct whole_file file;

    snprintf(moved, sizeof moved, "%s-moved", folder);
    assert_ok(whole_file_open(&file, path, &error));
    fputs("text", file.out);
    assert_int_equal(rename(folder, moved), 0);
    assert_int_equal(symlink("/", folder), 0);
    assert_ok(whole_file_close(&file, ERROR_NONE, &error));
    assert_int_equal(unlink(folder), 0);
    assert_int_equal(rename(moved, folder), 0);
    assert_string_equal(content(path), "text");
    assert_int_equal(count_entries(), 1);
}

TEST(a_device_behind_the_link_of_another_user_is_not_written)
{
    enum { NOBODY = 65534 };
    struct whole_file file;

    unlink(path);
    assert_int_equal(symlink("/dev/null", path), 0);
    if (geteuid() == 0) {
        assert_int_equal(lchown(path, NOBODY, NOBODY), 0);
        assert_int_equal(whole_file_open(&file, path, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "link of another user"));
    }
    assert_int_equal(unlink(path), 0);
}

TEST(refuses_a_folder)
{
    struct whole_file file;

    assert_int_equal(whole_file_open(&file, folder, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "Is a directory"));
    assert_int_equal(count_entries(), 0);
}

/* By links of its own: what would be replaced by mistake, as root too, is a link. */
TEST(writes_to_a_device_in_place_and_says_that_it_is_full)
{
    struct stat link;

    unlink(path);
    assert_int_equal(symlink("/dev/null", path), 0);
    assert_ok(write_file(path, "text", ERROR_NONE));
    assert_int_equal(lstat(path, &link), 0);
    assert_true(S_ISLNK(link.st_mode));
    assert_int_equal(unlink(path), 0);
    assert_int_equal(symlink("/dev/full", path), 0);
    assert_int_equal(write_file(path, "text", ERROR_NONE), ERROR_SYSTEM);
    assert_int_equal(lstat(path, &link), 0);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(count_entries(), 0);
}

TEST(names_a_folder_that_is_not_there)
{
    struct whole_file file;

    assert_int_equal(whole_file_open(&file, "/nowhere/file", &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/nowhere/file"));
}

/* ---- files that grow ---- */

static void growing_write(const char *name, const char *text)
{
    int descriptor;

    assert_ok(growing_file_open(name, &descriptor, &error));
    assert_int_equal(write(descriptor, text, strlen(text)), (ssize_t)strlen(text));
    close(descriptor);
}

TEST(growing_has_its_name_at_once_and_is_not_writable_by_others)
{
    mode_t mask = umask(0);
    struct stat there;

    growing_write(path, "first");
    umask(mask);
    assert_string_equal(content(path), "first");
    assert_int_equal(stat(path, &there), 0);
    assert_int_equal(there.st_mode & 0777, 0664);
    assert_int_equal(unlink(path), 0);
}

TEST(growing_may_be_written_anew_after_it_was_read_back)
{
    FILE *file;

    growing_write(path, "first");
    assert_ok(input_file_stream(path, &file, &error));
    fclose(file);
    growing_write(path, "second");
    assert_string_equal(content(path), "second");
    assert_int_equal(unlink(path), 0);
}

/* Else whoever has made the file, or has another name of it, would have a part in the new one. */
TEST(growing_is_another_file_than_the_one_that_was_there)
{
    assert_ok(write_file(other, "precious", ERROR_NONE));
    assert_int_equal(link(other, path), 0);
    growing_write(path, "text");
    assert_string_equal(content(other), "precious");
    assert_string_equal(content(path), "text");
    assert_int_equal(unlink(other), 0);
    assert_int_equal(unlink(path), 0);
}

TEST(growing_refuses_links_to_files)
{
    int descriptor;

    assert_ok(write_file(other, "precious", ERROR_NONE));
    assert_int_equal(symlink(other, path), 0);
    assert_int_equal(growing_file_open(path, &descriptor, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a symbolic link, expected a file"));
    assert_string_equal(content(other), "precious");
    assert_int_equal(unlink(other), 0);
    assert_int_equal(growing_file_open(path, &descriptor, &error), ERROR_INPUT);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(count_entries(), 0);
}

TEST(growing_into_a_pipe_that_nobody_reads_is_an_error)
{
    int descriptor;

    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(growing_file_open(path, &descriptor, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "a pipe that nobody reads"));
    assert_int_equal(unlink(path), 0);
}

TEST(whole_into_a_pipe_that_nobody_reads_is_an_error_and_never_a_wait)
{
    struct whole_file file;

    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(whole_file_open(&file, path, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "a pipe that nobody reads"));
    assert_ok(whole_file_probe(path, &error));
    assert_int_equal(unlink(path), 0);
}

TEST(a_probe_leaves_everything_as_it_is)
{
    assert_ok(whole_file_probe(path, &error));
    assert_int_equal(count_entries(), 0);
    assert_int_equal(whole_file_probe("/nowhere/file", &error), ERROR_SYSTEM);
    assert_int_equal(whole_file_probe(folder, &error), ERROR_SYSTEM);
}

/* ---- folders ---- */

/* Below the folder that was given no link is followed, by which it is itself reached. */
TEST(links_below_the_folder_given_are_not_followed)
{
    char given[64], below[80], link[96];
    struct whole_file file;
    int descriptor;

    snprintf(given, sizeof given, "%s/given", folder);
    snprintf(below, sizeof below, "%s/below", given);
    snprintf(link, sizeof link, "%s/link", below);
    assert_int_equal(symlink(".", given), 0);
    folder_enclose(given, strlen(given));
    assert_ok(folder_make_all(below, &error));
    assert_ok(folder_make(below, NULL, &error));
    assert_int_equal(symlink(folder, link), 0);
    assert_int_equal(folder_make(link, NULL, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a symbolic link"));
    assert_int_equal(folder_make_all(link, &error), ERROR_INPUT);
    snprintf(link, sizeof link, "%s/link/deep", below);
    assert_int_equal(folder_make_all(link, &error), ERROR_INPUT);
    assert_int_equal(whole_file_open(&file, link, &error), ERROR_INPUT);
    assert_int_equal(growing_file_open(link, &descriptor, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a symbolic link"));
    snprintf(link, sizeof link, "%s/link", below);
    assert_int_equal(unlink(link), 0);
    assert_ok(write_file(link, "text", ERROR_NONE));
    assert_int_equal(unlink(link), 0);

    /* A folder that is named after what was given may itself be none */
    folder_enclose(given, (size_t)(strrchr(given, '/') - given) + 1);
    assert_int_equal(folder_make(given, NULL, &error), ERROR_INPUT);
    folder_enclose("", 0);
    assert_ok(folder_make(given, NULL, &error));
    assert_int_equal(rmdir(below), 0);
    assert_int_equal(unlink(given), 0);
}

TEST(folders_are_made_and_others_cannot_write_into_them)
{
    mode_t mask = umask(0);
    char deep[96];
    struct stat there;
    bool made;

    snprintf(deep, sizeof deep, "%s/a/b//c", folder);
    assert_int_equal(folder_make(deep, &made, &error), ERROR_SYSTEM);
    assert_ok(folder_make_all(deep, &error));
    umask(mask);
    for (int level = 0; level < 3; level++) {
        assert_int_equal(stat(deep, &there), 0);
        assert_int_equal(there.st_mode & 0777, 0775);
        assert_ok(folder_make(deep, &made, &error));
        assert_false(made);
        assert_int_equal(rmdir(deep), 0);
        assert_ok(folder_make(deep, &made, &error));
        assert_true(made);
        assert_int_equal(rmdir(deep), 0);
        *strrchr(deep, '/') = '\0';
        deep[strlen(deep) - (deep[strlen(deep) - 1] == '/')] = '\0';
    }
    assert_int_equal(folder_make_all("", &error), ERROR_INPUT);
}

TEST(a_folder_behind_the_link_of_another_user_is_not_taken)
{
    enum { NOBODY = 65534 };

    assert_int_equal(symlink("/", path), 0);
    assert_ok(folder_make(path, NULL, &error));
    if (geteuid() == 0) {
        assert_int_equal(lchown(path, NOBODY, NOBODY), 0);
        assert_int_equal(folder_make(path, NULL, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "link of another user"));
        assert_int_equal(folder_make_all(path, &error), ERROR_INPUT);
    }
    assert_int_equal(unlink(path), 0);
}

TEST_GROUP(make_folder, remove_folder)
