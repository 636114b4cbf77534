/* SPDX-License-Identifier: Apache-2.0 */
/* Rate limiting of log lines, on a scripted clock. */
#include "rt/clock.h"
#include "app/cli/cli.h"
#include "tests/test.h"

/* what is printed goes into text */
struct bench {
    struct eventlog log;
    char text[16384];
};

static void bench_init(struct bench *bench)
{
    memset(bench, 0, sizeof *bench);
    bench->log.out = fmemopen(bench->text, sizeof bench->text, "w");
    bench->log.clear = "";
}

static size_t lines(struct bench *bench)
{
    size_t count = 0;

    fflush(bench->log.out);
    for (const char *c = bench->text; *c; c++) {
        count += *c == '\n';
    }
    return count;
}

static void bench_close(struct bench *bench)
{
    fclose(bench->log.out);
}

BENCH(bench_init, struct bench, bench_close)

TEST_ON(a_flood_is_summed_up_in_one_line, bench_init, bench)
{
    for (int i = 0; i < 137; i++) {
        eventlog_put(&bench->log, i * CLOCK_MS, 42, i == 136 ? "bus lost" : "bus found");
    }
    eventlog_flush(&bench->log, 999 * CLOCK_MS, false);
    assert_int_equal(lines(bench), EVENTLOG_BURST);
    eventlog_flush(&bench->log, 1000 * CLOCK_MS, false);
    assert_int_equal(lines(bench), EVENTLOG_BURST + 1);
    assert_non_null(strstr(bench->text, "... and 132 more like it, the last: bus lost\n"));
}

TEST_ON(a_summary_says_where_all_lines_are, bench_init, bench)
{
    bench->log.where = " (there)";
    for (int i = 0; i < 9; i++) {
        eventlog_put(&bench->log, 0, 42, "bus lost");
    }
    eventlog_flush(&bench->log, 0, true);
    assert_int_equal(lines(bench), EVENTLOG_BURST + 1);
    assert_non_null(strstr(bench->text, "... and 4 more like it (there), the last: bus lost\n"));
}

TEST_ON(other_keys_are_not_held_back, bench_init, bench)
{
    for (int i = 0; i < 100; i++) {
        eventlog_put(&bench->log, 0, 1, "loud");
    }
    eventlog_put(&bench->log, 0, 2, "quiet");
    assert_non_null(strstr((lines(bench), bench->text), "quiet\n"));
}

TEST_ON(nothing_is_lost_when_keys_share_a_place, bench_init, bench)
{
    unsigned long long told = 0;

    for (int i = 0; i < 20; i++) {
        for (uint64_t key = 0; key < 300; key++) {
            eventlog_put(&bench->log, 0, key, "x");
        }
    }
    /* with more keys than places every line is printed or summed up */
    assert_int_equal(bench->log.printed + bench->log.held, 6000);
    eventlog_flush(&bench->log, 0, true);
    fflush(bench->log.out);
    for (const char *c = bench->text; c && *c; c = strchr(c, '\n') + 1) {
        unsigned long long more = 1;

        (void)sscanf(c, "... and %llu more", &more);
        told += more;
    }
    assert_int_equal(told, 6000);
}

static const char *grave(uint64_t key)
{
    return key == 7 ? "<4>" : "";
}

TEST_ON(a_flood_under_many_keys_is_held_back_too, bench_init, bench)
{
    for (int64_t ms = 0; ms < 10000; ms++) {
        for (uint64_t key = 0; key < 300; key++) {
            eventlog_put(&bench->log, ms * CLOCK_MS, key, "x");
        }
        if (ms % 50 == 0) {
            eventlog_flush(&bench->log, ms * CLOCK_MS, false);
        }
    }
    /* the first lines of every place, and what was held back after 1, 3 and 7 s */
    assert_int_equal(lines(bench), (EVENTLOG_KEYS + 1) * (EVENTLOG_BURST + 3));
    assert_int_equal(bench->log.printed + bench->log.held, 3000000);
}

TEST_ON(a_prefix_stands_before_lines_and_sums, bench_init, bench)
{
    bench->log.prefix = grave;
    eventlog_put(&bench->log, 0, 1, "light");
    for (int i = 0; i < EVENTLOG_BURST + 2; i++) {
        eventlog_put(&bench->log, 0, 7, "heavy");
    }
    eventlog_flush(&bench->log, 0, true);
    fflush(bench->log.out);
    assert_ptr_equal(strstr(bench->text, "light\n<4>heavy\n<4>heavy\n"), bench->text);
    assert_non_null(strstr(bench->text, "\n<4>... and 2 more like it, the last: heavy\n"));
}

TEST_ON(one_held_line_is_printed_as_it_is, bench_init, bench)
{
    for (int i = 0; i <= EVENTLOG_BURST; i++) {
        eventlog_put(&bench->log, 0, 1, "line");
    }
    eventlog_flush(&bench->log, 0, true);
    assert_int_equal(lines(bench), EVENTLOG_BURST + 1);
    assert_null(strstr(bench->text, "more like it"));
}

TEST_ON(a_quiet_second_ends_the_flood, bench_init, bench)
{
    for (int i = 0; i < 3; i++) {
        eventlog_put(&bench->log, 0, 1, "a");
    }
    for (int i = 0; i < 10; i++) {
        eventlog_put(&bench->log, CLOCK_SECOND, 1, "b");
    }
    eventlog_flush(&bench->log, CLOCK_SECOND, true);
    assert_int_equal(lines(bench), 3 + EVENTLOG_BURST + 1);
}

TEST_ON(a_lasting_flood_is_told_of_ever_more_rarely, bench_init, bench)
{
    size_t at_ten_minutes;

    /* 1000 a second for ten minutes, flushed as the monitor does */
    for (int64_t ms = 0; ms < 600000; ms++) {
        eventlog_put(&bench->log, ms * CLOCK_MS, 1, "overrun");
        if (ms % 50 == 0) {
            eventlog_flush(&bench->log, ms * CLOCK_MS, false);
        }
    }
    /* after 1, 3, 7, 15, 31, 63 s (of 1 to 32 s), then every 60 s until 543 s */
    at_ten_minutes = lines(bench);
    assert_int_equal(at_ten_minutes, EVENTLOG_BURST + 6 + 8);
    assert_int_equal(bench->log.printed + bench->log.held, 600000);
}
