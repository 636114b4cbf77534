/* SPDX-License-Identifier: Apache-2.0 */
/* Tables of numbers: rows as they are, and the line of what is wrong. */
#include "base/csv.h"

#include "base/array.h"
#include "tests/test.h"

static struct error error;

TEST(rows_are_read_one_by_one)
{
    static const char text[] = "time_s,a b\r\n0,-1.5\r\n1e3,2";
    struct csv *csv;
    bool end;

    assert_ok(csv_open_memory("x.csv", text, strlen(text), &csv, &error));
    assert_int_equal(csv->ncolumn, 2);
    assert_string_equal(csv->title[1], "a b");
    assert_ok(csv_next(csv, &end, &error));
    assert_true(!end && csv->line == 2 && csv->cell[0] == 0 && csv->cell[1] == -1.5);
    assert_ok(csv_next(csv, &end, &error));
    assert_true(!end && csv->line == 3 && csv->cell[0] == 1000 && csv->cell[1] == 2);
    assert_ok(csv_next(csv, &end, &error));
    assert_true(end);
    csv_close(csv);
    csv_close(NULL);
}

TEST(what_is_wrong_has_a_line)
{
    static const struct {
        const char *text, *expected;
    } wrong[] = {
        {"a,b\n1,2\n3\n", "x.csv:3: column 2 (b): found \"\", expected a number"},
        {"a,b\n1,2,3\n", "x.csv:2: found more than 2 columns"},
        {"a\n 1\n", "x.csv:2: column 1 (a): found \" 1\", expected a number"},
        {"a\n1\n\n", "x.csv:3: column 1 (a): found \"\", expected a number"},
        {"\xef\xbb\xbf# b\n# c\r\na\n1\nx\n",
         "x.csv:5: column 1 (a): found \"x\", expected a number"},
        {"\xef\xbb\xbf"
         "a,b\n1,2\n#\n",
         "x.csv:3: column 1 (a): found \"#\", expected a number"},
    };
    struct csv *csv;

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        enum error_code code = ERROR_NONE;
        bool end = false;

        assert_ok(csv_open_memory("x.csv", wrong[i].text, strlen(wrong[i].text), &csv, &error));
        while (!code && !end) {
            code = csv_next(csv, &end, &error);
        }
        assert_int_equal(code, ERROR_INPUT);
        assert_string_equal(error.text, wrong[i].expected);
        csv_close(csv);
    }
}

TEST(limits_and_zero_bytes_are_refused)
{
    static char text[CSV_LINE_BYTES + 8];
    struct csv *csv;

    memset(text, 'a', sizeof text);
    assert_int_equal(csv_open_memory("x.csv", text, sizeof text, &csv, &error), ERROR_INPUT);
    assert_string_equal(error.text, "x.csv:1: found a line of more than 65534 bytes");
    memset(text, ',', sizeof text);
    assert_int_equal(csv_open_memory("x.csv", text, 2000, &csv, &error), ERROR_INPUT);
    assert_string_equal(error.text, "x.csv:1: found more than 1024 columns");
    assert_int_equal(csv_open_memory("x.csv", "a\0b\n", 4, &csv, &error), ERROR_INPUT);
    assert_string_equal(error.text, "x.csv:1: found a zero byte, expected text");
    assert_int_equal(csv_open("/nowhere/x.csv", &csv, &error), ERROR_INPUT);
    assert_ok(csv_open_memory("x.csv", NULL, 0, &csv, &error));
    assert_true(csv->ncolumn == 1 && csv->title[0][0] == '\0');
    csv_close(csv);
}
