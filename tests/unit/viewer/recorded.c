/* SPDX-License-Identifier: Apache-2.0 */
/* Files of a recording as they are found by time, also when they are cut, odd or wrong. */
#include "viewer/recorded.h"
#include "tests/test.h"

#include <unistd.h>

static char path[] = "/tmp/recorded-XXXXXX";
static struct arena arena;
static struct error error;

FIXTURE(set_up)
{
    int descriptor = mkstemp(path);

    close(descriptor);
    return descriptor < 0 || arena_init(&arena, (size_t)16 << 20, &error) ? -1 : 0;
}

FIXTURE(tear_down)
{
    arena_fini(&arena);
    return unlink(path);
}

static void write_file(const char *text)
{
    FILE *out = fopen(path, "w");

    assert_non_null(out);
    fputs(text, out);
    fclose(out);
}

CLOSED_BENCH(recorded_table, struct recorded_table, recorded_table_close)

TEST_ON(rows_are_found_by_time, recorded_table, table)
{
    double value[3];

    write_file("time_s,a,b\n0.01,1,2\n0.02,3,-4e-3\n0.02,5,6\n0.04,7,8\n0.05,9");
    assert_int_equal(recorded_table_open(path, &arena, table, &error), 0);
    assert_int_equal(table->ncolumn, 2);
    assert_string_equal(table->title[1], "b");
    assert_int_equal(table->nrow, 4); /* the last line has no end */
    assert_int_equal(recorded_table_find(table, INT64_MIN), 0);
    assert_int_equal(recorded_table_find(table, 10000000), 0);
    assert_int_equal(recorded_table_find(table, 19999999), 0);
    assert_int_equal(recorded_table_find(table, 20000000), 2);
    assert_int_equal(recorded_table_find(table, 39999999), 2);
    assert_int_equal(recorded_table_find(table, INT64_MAX), 3);
    recorded_table_read(table, 1, 2, NULL, value);
    assert_true(value[0] == 3 && value[1] == -4e-3);
}

TEST_ON(odd_cells_are_no_numbers, recorded_table, table)
{
    double value[3];

    write_file("time_s,a,b,c\n1,,x,\n2,5\n3\n4,1 2,0x10,3z\n5,6,7,8,9\n");
    assert_int_equal(recorded_table_open(path, &arena, table, &error), 0);
    for (size_t row = 0; row < 4; row++) {
        recorded_table_read(table, row, 3, NULL, value);
        assert_true(row == 1 ? value[0] == 5 : isnan(value[0]));
        assert_true(isnan(value[2]));
    }
    recorded_table_read(table, 4, 3, NULL, value);
    assert_true(value[0] == 6 && value[1] == 7 && value[2] == 8);
}

TEST_ON(columns_that_are_not_wanted_are_left_alone, recorded_table, table)
{
    static const bool wanted[] = {false, true, false, true};
    double value[] = {-1, -1, -1, -1};

    write_file("time_s,a,b,c,d\n1,5,6,7,8\n2,x,9\n");
    assert_int_equal(recorded_table_open(path, &arena, table, &error), 0);
    recorded_table_read(table, 0, 4, wanted, value);
    assert_true(value[0] == -1 && value[1] == 6 && value[2] == -1 && value[3] == 8);
    recorded_table_read(table, 1, 4, wanted, value);
    assert_true(value[0] == -1 && value[1] == 9 && value[2] == -1 && isnan(value[3]));
}

TEST(what_is_no_table_is_refused)
{
    static const char *const texts[] = {
        "",
        "time_s,a",
        "time_s,a\n",
        "seconds,a\n1,2\n",
        "time_s,\n1,2\n",
        "time_s,a\nnan,2\n",
        "time_s,a\n1e300,2\n",
        "time_s,a\n\n",
        "time_s,a\n2,1\n1,1\n",
    };
    struct recorded_table table;

    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        write_file(texts[i]);
        assert_int_equal(recorded_table_open(path, &arena, &table, &error), ERROR_INPUT);
        recorded_table_close(&table);
    }
    assert_non_null(strstr(error.text, ":3: found a time before"));
    assert_int_equal(recorded_table_open("/nowhere", &arena, &table, &error), ERROR_INPUT);
    assert_int_equal(recorded_table_open("/tmp", &arena, &table, &error), ERROR_INPUT);
}

TEST(frames_are_found_and_counted)
{
    static const char *const bus[] = {"can0", "can1"};
    struct recorded_traffic traffic[2];
    struct recorded_log log;
    struct bus_frame frame;
    size_t at, which;

    write_file("(0.000000) can0 001#01\n(0.050000) can1 002#0102\n(0.120000) vcan7 003#\n"
               "(0.200000) can0 004#FF\n(0.300000) can1 005#\n(0.350000) can0 0");
    assert_int_equal(recorded_log_open(path, bus, 2, &log, &error), 0);
    assert_int_equal(log.strange, 1);
    assert_int_equal(log.last_ns, 300000000);
    at = recorded_log_find(&log, 50000001);
    assert_true(recorded_log_next(&log, &at, &which, &frame));
    assert_true(frame.id == 4 && which == 0);
    assert_true(recorded_log_next(&log, &at, &which, &frame) && frame.id == 5 && which == 1);
    assert_false(recorded_log_next(&log, &at, &which, &frame));
    at = recorded_log_find(&log, -1);
    assert_true(recorded_log_next(&log, &at, &which, &frame) && frame.id == 1);
    recorded_log_count(&log, 250000000, traffic);
    assert_int_equal(traffic[0].frames, 2);
    assert_int_equal(traffic[0].bits, 2 * (47 + 8));
    assert_int_equal(traffic[1].frames, 1);
    recorded_log_count(&log, INT64_MAX, traffic);
    assert_int_equal(traffic[1].frames, 2);
    recorded_log_close(&log);

    write_file("(0.000000) can0 001#01\nnonsense\n");
    assert_int_equal(recorded_log_open(path, bus, 2, &log, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":2: "));
    recorded_log_close(&log);
    write_file("");
    assert_int_equal(recorded_log_open(path, bus, 2, &log, &error), 0);
    recorded_log_count(&log, 0, traffic);
    assert_int_equal(traffic[0].frames, 0);
    recorded_log_close(&log);
}

TEST_GROUP(set_up, tear_down)
