/* SPDX-License-Identifier: Apache-2.0 */
/* A name in a robot file leads to files of its folder, and to no other. */
#include "app/import/path.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

static char made[] = "/tmp/hil-import-path-XXXXXX", folder[PATH_MAX], inside[PATH_MAX + 8];

static void put(const char *name)
{
    char path[PATH_MAX + 64];
    FILE *out;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_non_null(out = fopen(path, "we"));
    assert_int_equal(fclose(out), 0);
}

/* secret, in/here, in/a/b/deep, in/link -> ../secret, in/pipe; made anew for each test. */
FIXTURE(set_up)
{
    char path[PATH_MAX + 64];

    strcpy(made + sizeof made - 7, "XXXXXX");
    if (!mkdtemp(made) || !realpath(made, folder)) {
        return -1;
    }
    snprintf(inside, sizeof inside, "%s/in", folder);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/in%s", folder, i == 0 ? "" : i == 1 ? "/a" : "/a/b");
        if (mkdir(path, 0700)) {
            return -1;
        }
    }
    put("secret");
    put("in/here");
    put("in/a/b/deep");
    snprintf(path, sizeof path, "%s/in/link", folder);
    if (symlink("../secret", path)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/in/pipe", folder);
    return mkfifo(path, 0600);
}

FIXTURE(tear_down)
{
    char command[PATH_MAX + 16];

    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

static enum import_path resolve(const char *name, bool trust)
{
    char path[PATH_MAX];

    return import_resolve_path(inside, inside, name, trust, path);
}

TEST_WITH(names_of_the_folder_are_found, set_up, tear_down)
{
    static const char *const names[] = {
        "here",      "./here",         "a/b/deep",     "a/../here",
        "a//b/deep", "a/b/../../here", "./a/./b/deep", "a/b/../../a/../here"};
    char absolute[PATH_MAX + 64], path[PATH_MAX];

    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (resolve(names[i], false) != IMPORT_PATH_FOUND) {
            fail_msg("%s was not found", names[i]);
        }
    }
    snprintf(absolute, sizeof absolute, "%s/here", inside);
    assert_int_equal(import_resolve_path(inside, inside, absolute, false, path), IMPORT_PATH_FOUND);
    assert_string_equal(path, absolute);
}

/* Also where it comes back, where it is not there, and where it is only a prefix of the folder. */
TEST_WITH(names_that_lead_out_are_refused, set_up, tear_down)
{
    static const char *const names[] = {"../secret",
                                        "../none",
                                        "a/../../secret",
                                        "..",
                                        "../in/here",
                                        "a/../../in/here",
                                        "./../in/here",
                                        "a/b/../../../x",
                                        "../in2/here",
                                        "a/../../in/none",
                                        "link"};
    char absolute[PATH_MAX + 64];

    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (resolve(names[i], false) != IMPORT_PATH_OUTSIDE) {
            fail_msg("%s was not refused", names[i]);
        }
    }
    snprintf(absolute, sizeof absolute, "%s/secret", folder);
    assert_int_equal(resolve(absolute, false), IMPORT_PATH_OUTSIDE);
    snprintf(absolute, sizeof absolute, "%s2/here", inside);
    assert_int_equal(resolve(absolute, false), IMPORT_PATH_OUTSIDE);
}

TEST_WITH(whoever_is_trusted_may_lead_out, set_up, tear_down)
{
    assert_int_equal(resolve("../secret", true), IMPORT_PATH_FOUND);
    assert_int_equal(resolve("link", true), IMPORT_PATH_FOUND);
    assert_int_equal(resolve("../none", true), IMPORT_PATH_MISSING);
}

TEST_WITH(only_regular_files_are_found, set_up, tear_down)
{
    char longest[PATH_MAX + 8];

    assert_int_equal(resolve("none", false), IMPORT_PATH_MISSING);
    assert_int_equal(resolve("a", false), IMPORT_PATH_MISSING);
    assert_int_equal(resolve("pipe", false), IMPORT_PATH_MISSING);

    /* A name that does not fit is not cut to one that is there */
    for (size_t i = 0; i < sizeof longest - 1; i++) {
        longest[i] = i % 2 ? '/' : '.';
    }
    longest[sizeof longest - 1] = '\0';
    assert_int_equal(resolve(longest, false), IMPORT_PATH_MISSING);
}

TEST_WITH(a_file_has_the_folder_without_its_name, set_up, tear_down)
{
    char path[PATH_MAX + 64], found[PATH_MAX];

    snprintf(path, sizeof path, "%s/a/../a/b/deep", inside);
    assert_true(import_find_folder(path, found));
    snprintf(path, sizeof path, "%s/a/b", inside);
    assert_string_equal(found, path);
    snprintf(path, sizeof path, "%s/none", inside);
    assert_false(import_find_folder(path, found));
}
