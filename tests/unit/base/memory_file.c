/* SPDX-License-Identifier: Apache-2.0 */
/* A stream into memory is complete, or says that it is not. */
#include "base/memory_file.h"
#include "tests/test.h"

static struct error error;

TEST(what_is_written_stands_in_memory)
{
    struct memory_file memory;
    FILE *file = memory_file_open(&memory);

    assert_non_null(file);
    fprintf(file, "%d and %s", 1, "two");
    assert_ok(memory_file_close(file, &memory, "a text", &error));
    assert_int_equal(memory.size, strlen("1 and two"));
    assert_string_equal(memory.text, "1 and two");
    free(memory.text);
}

TEST(nothing_written_is_the_empty_text)
{
    struct memory_file memory;
    FILE *file = memory_file_open(&memory);

    assert_non_null(file);
    assert_ok(memory_file_close(file, &memory, "a text", &error));
    assert_int_equal(memory.size, 0);
    assert_string_equal(memory.text, "");
    free(memory.text);
}

TEST(the_memory_grows_with_the_text)
{
    enum { LINES = 20000 };
    struct memory_file memory;
    FILE *file = memory_file_open(&memory);

    assert_non_null(file);
    for (int i = 0; i < LINES; i++) {
        fprintf(file, "%06d\n", i);
    }
    assert_ok(memory_file_close(file, &memory, "a text", &error));
    assert_int_equal(memory.size, 7 * LINES);
    for (int i = 0; i < LINES; i++) {
        char line[8];

        snprintf(line, sizeof line, "%06d\n", i);
        assert_memory_equal(memory.text + 7 * i, line, 7);
    }
    free(memory.text);
}

TEST(a_text_that_lost_a_piece_is_an_error)
{
    struct memory_file memory;
    FILE *file = memory_file_open(&memory);

    assert_non_null(file);
    fputs("before", file);
    fflush(file);
    memory.failed = true; /* as when memory ran out here */
    fputs("behind", file);
    assert_int_equal(memory_file_close(file, &memory, "the report", &error), ERROR_MEMORY);
    assert_string_equal(error.text, "no memory left for the report");
    assert_null(memory.text);
}
