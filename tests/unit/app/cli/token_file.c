/* SPDX-License-Identifier: Apache-2.0 */
/* The file of a page's tokens: what is written is read again, and nothing else is believed. */
#include "app/cli/cli.h"
#include "tests/unit/app/put_file.h"

#include <sys/stat.h>
#include <unistd.h>

#define LOOK "0123456789abcdef0123456789abcdef"
#define CONTROL "fedcba9876543210fedcba9876543210"

static char folder[] = "/tmp/token-file-XXXXXX";
static char path[128];
static struct error error;

FIXTURE(set_up)
{
    if (!mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/state/pages/one", folder);
    return 0;
}

FIXTURE(tear_down)
{
    char other[160];

    unlink(path);
    snprintf(other, sizeof other, "%s.link", path);
    unlink(other);
    snprintf(other, sizeof other, "%s/state/pages", folder);
    rmdir(other);
    snprintf(other, sizeof other, "%s/state", folder);
    rmdir(other);
    return rmdir(folder);
}

TEST(what_is_written_is_read_again)
{
    struct page_tokens tokens = {{LOOK, CONTROL}, 8080}, found;
    struct stat status;

    assert_ok(token_file_read(path, &found, &error));
    assert_int_equal(found.port, 0);
    for (int i = 0; i < 2; i++) {
        tokens.port++;
        assert_ok(token_file_write(path, &tokens, &error));
        assert_ok(token_file_read(path, &found, &error));
        assert_int_equal(found.port, tokens.port);
        assert_string_equal(found.token[0], LOOK);
        assert_string_equal(found.token[1], CONTROL);
    }
    assert_int_equal(stat(path, &status), 0);
    assert_int_equal(status.st_mode & 0777, 0600);
}

TEST(a_file_of_others_is_refused)
{
    struct page_tokens found;
    char link[160];

    chmod(path, 0640);
    assert_int_equal(token_file_read(path, &found, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "0600"));
    chmod(path, 0600);
    snprintf(link, sizeof link, "%s.link", path);
    assert_int_equal(symlink(path, link), 0);
    assert_int_equal(token_file_read(link, &found, &error), ERROR_SYSTEM);
    assert_int_equal(token_file_read(folder, &found, &error), ERROR_INPUT);
    assert_int_equal(found.port, 0);
}

TEST(other_content_is_refused)
{
    static const char *const texts[] = {
        "",
        "port 0\nlook " LOOK "\ncontrol " CONTROL "\n",
        "port 65536\nlook " LOOK "\ncontrol " CONTROL "\n",
        "port 80\nlook " LOOK "\n",
        "port 80\nlook " LOOK "\ncontrol " CONTROL "0\n",
        "port 80\nlook " LOOK "\ncontrol " CONTROL "\nmore\n",
        "port 80\nlook 0123456789ABCDEF0123456789abcdef\ncontrol " CONTROL "\n",
        "port 80\nlook \"><script>\ncontrol " CONTROL "\n",
    };
    struct page_tokens found;

    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        put_file(path, texts[i]);
        assert_int_equal(token_file_read(path, &found, &error), ERROR_INPUT);
        assert_int_equal(found.port, 0);
    }
}

TEST(each_directory_has_its_own)
{
    char here[512], there[512];

    setenv("XDG_STATE_HOME", "/somewhere", 1);
    assert_true(token_file_default(here, sizeof here));
    assert_int_equal(strncmp(here, "/somewhere/coman-hil/pages/", 27), 0);
    assert_int_equal(chdir("/"), 0);
    assert_true(token_file_default(there, sizeof there));
    assert_string_not_equal(here, there);
    setenv("XDG_STATE_HOME", "relative", 1);
    setenv("HOME", "/home/somebody", 1);
    assert_true(token_file_default(here, sizeof here));
    assert_int_equal(strncmp(here, "/home/somebody/.local/state/coman-hil/pages/", 44), 0);
    unsetenv("HOME");
    assert_false(token_file_default(here, sizeof here));
}

TEST_GROUP(set_up, tear_down)
