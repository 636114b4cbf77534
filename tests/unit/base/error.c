/* SPDX-License-Identifier: Apache-2.0 */
/* Errors as values: codes, messages, and what a message may hold. */
#include "base/error.h"

#include "base/array.h"
#include "tests/test.h"

#include <errno.h>

static struct error error;

TEST(a_failing_path_returns_the_code_that_it_sets)
{
    assert_int_equal(error_set(&error, ERROR_INPUT, "found %d, expected %s", 3, "four"),
                     ERROR_INPUT);
    assert_int_equal(error.code, ERROR_INPUT);
    assert_string_equal(error.text, "found 3, expected four");
}

TEST(nobody_has_to_want_the_message)
{
    assert_int_equal(error_set(NULL, ERROR_MEMORY, "no memory"), ERROR_MEMORY);
    assert_int_equal(error_set_errno(NULL, EIO, "cannot write"), ERROR_SYSTEM);
    assert_int_equal(error_set_file(NULL, ENOENT, "x", "cannot be read"), ERROR_INPUT);
    assert_int_equal(error_prefix(NULL, "file"), ERROR_INPUT);
}

TEST(a_refused_call_says_why)
{
    assert_int_equal(error_set_errno(&error, EACCES, "cannot open %s", "can0"), ERROR_SYSTEM);
    assert_string_equal(error.text, "cannot open can0: Permission denied");
}

TEST(a_wrong_file_name_is_the_persons_error_and_a_broken_disk_the_systems)
{
    static const int wrong_name[] = {ENOENT, ENOTDIR, EISDIR, EACCES, ENAMETOOLONG, ELOOP};

    for (size_t i = 0; i < ARRAY_COUNT(wrong_name); i++) {
        assert_int_equal(error_set_file(&error, wrong_name[i], "rig.yaml", "cannot be read"),
                         ERROR_INPUT);
    }
    assert_int_equal(error_set_file(&error, EIO, "rig.yaml", "cannot be read"), ERROR_SYSTEM);
    assert_string_equal(error.text, "rig.yaml: cannot be read: Input/output error");
}

TEST(a_prefix_keeps_code_and_text)
{
    error_set(&error, ERROR_UNSUPPORTED, "no CAN");
    assert_int_equal(error_prefix(&error, "bus %d", 2), ERROR_UNSUPPORTED);
    assert_string_equal(error.text, "bus 2: no CAN");
}

TEST(control_characters_of_the_input_reach_no_terminal)
{
    error_set(&error, ERROR_INPUT, "found \"%s\"", "a\n\x1b[2J\x7f");
    assert_string_equal(error.text, "found \"a??[2J?\"");
    error_set_errno(&error, EIO, "%s", "a\tb");
    assert_string_equal(error.text, "a?b: Input/output error");
    error_set(&error, ERROR_INPUT, "x");
    error_prefix(&error, "%s", "\r");
    assert_string_equal(error.text, "?: x");
}

TEST(long_messages_are_cut_at_the_end)
{
    char text[2000];

    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    error_set(&error, ERROR_INPUT, "%s", text);
    assert_int_equal(strlen(error.text), sizeof error.text - 1);
    error_prefix(&error, "%s", text);
    assert_true(strlen(error.text) < sizeof error.text);
    error_set_errno(&error, EIO, "%s", text);
    assert_int_equal(strlen(error.text), sizeof error.text - 1);
}
