/* SPDX-License-Identifier: Apache-2.0 */
/* When lines get a priority for the journal. */
#include "base/journal.h"

#include "base/array.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

/* Device and inode of standard error, the inode off by some */
static void name_stream(char text[64], unsigned long long off)
{
    struct stat file;

    assert_int_equal(fstat(STDERR_FILENO, &file), 0);
    snprintf(text, 64, "%llu:%llu", (unsigned long long)file.st_dev,
             (unsigned long long)file.st_ino + off);
}

TEST(lines_for_the_journal_say_how_grave_they_are)
{
    char stream[64];

    name_stream(stream, 0);
    setenv("JOURNAL_STREAM", stream, 1);
    assert_string_equal(journal_prefix(JOURNAL_ERROR), "<3>");
    assert_string_equal(journal_prefix(JOURNAL_WARNING), "<4>");
    assert_string_equal(journal_prefix(JOURNAL_NOTICE), "<5>");
    assert_string_equal(journal_prefix(JOURNAL_INFO), "<6>");
}

TEST(lines_for_others_do_not)
{
    char stream[64];

    unsetenv("JOURNAL_STREAM");
    assert_string_equal(journal_prefix(JOURNAL_ERROR), "");
    /* Inherited, and standard error has been sent elsewhere */
    name_stream(stream, 1);
    setenv("JOURNAL_STREAM", stream, 1);
    assert_string_equal(journal_prefix(JOURNAL_ERROR), "");
}

TEST(refuses_what_is_no_stream)
{
    static const char *const wrong[] = {"", "1", "1:", ":1", "a:b", "1:2x"};

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        assert_false(journal_stream_is(wrong[i], STDERR_FILENO));
    }
    assert_false(journal_stream_is("1:2", -1));
    assert_false(journal_stream_is(NULL, STDERR_FILENO));
}
