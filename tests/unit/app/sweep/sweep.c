/* SPDX-License-Identifier: Apache-2.0 */
/* Sweeps: what is drawn, against the distributions it is drawn from, and what is refused. */
#include "app/sweep/plan.h"
#include "app/sweep/sweep.h"

#include "tests/unit/schema_limits.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct sweep sweep;
static struct error error;
static char path[] = "/tmp/sweep-XXXXXX";

/* A file of these lines, read. */
static enum error_code read_sweep(const char *text)
{
    FILE *out;
    int fd;

    memcpy(path + sizeof path - 7, "XXXXXX", 6);
    fd = mkstemp(path);
    assert_true(fd >= 0);
    out = fdopen(fd, "w");
    assert_non_null(out);
    fprintf(out, "name: s\nscenarios: [a]\n%s", text);
    fclose(out);
    error.text[0] = '\0';
    enum error_code code = sweep_read(path, &arena, &sweep, &error);
    unlink(path);
    return code;
}

static void refused(const char *text, const char *message)
{
    assert_int_equal(read_sweep(text), ERROR_INPUT);
    if (!strstr(error.text, message)) {
        fail_msg("%s\nexpected: %s", error.text, message);
    }
}

static double drawn(size_t parameter, size_t sample)
{
    return strtod(sweep.parameter[parameter].drawn[sample], NULL);
}

/* ---- what is drawn ---- */

/* Against erf of libm. */
TEST(quantiles_of_the_normal_distribution)
{
    for (double p = 1e-6; p < 1.0; p += 0.0099) {
        double x = sweep_normal_quantile(p);

        assert_true(fabs(0.5 * erfc(-x / sqrt(2.0)) - p) < 1e-13);
    }
}

/* One sample in each of n equally likely strata, of both distributions. */
TEST_WITH(latin_hypercube_has_one_sample_a_stratum, open_arena, close_arena)
{
    enum { COUNT = 200 };
    bool taken[2][COUNT] = {{false}};

    assert_ok(read_sweep("samples: 200\nseed: 7\nparameters:\n"
                         "  a: {uniform: [-1, 3]}\n  b: {normal: [2, 0.5]}\n"));
    for (size_t i = 0; i < COUNT; i++) {
        double a = (drawn(0, i) + 1.0) / 4.0;
        double b = 0.5 * erfc(-(drawn(1, i) - 2.0) / 0.5 / sqrt(2.0));

        taken[0][(size_t)(a * COUNT)] = true;
        taken[1][(size_t)(b * COUNT)] = true;
    }
    for (size_t i = 0; i < COUNT; i++) {
        assert_true(taken[0][i] && taken[1][i]);
    }
}

TEST_WITH(a_parameter_more_leaves_the_others_as_they_were, open_arena, close_arena)
{
    double before[20];

    assert_ok(read_sweep("samples: 20\nparameters:\n  b: {uniform: [0, 1]}\n"));
    for (size_t i = 0; i < 20; i++) {
        before[i] = drawn(0, i);
    }
    assert_ok(read_sweep("samples: 20\nparameters:\n  a: {uniform: [0, 1]}\n"
                         "  b: {uniform: [0, 1]}\n"));
    for (size_t i = 0; i < 20; i++) {
        assert_true(drawn(1, i) == before[i] && drawn(0, i) != before[i]);
    }
}

TEST_WITH(a_normal_distribution_ends_at_its_limits, open_arena, close_arena)
{
    assert_ok(read_sweep("samples: 300\nsampling: random\nparameters:\n"
                         "  a: {normal: [0, 1], limits: [0.5, 0.75]}\n"));
    for (size_t i = 0; i < 300; i++) {
        assert_true(drawn(0, i) >= 0.5 && drawn(0, i) <= 0.75);
    }
}

TEST_WITH(the_last_of_grid_and_words_varies_fastest, open_arena, close_arena)
{
    static const char *const expected[][2] = {{"1", "x"}, {"1", "y"}, {"2.5", "x"}, {"2.5", "y"}};
    struct scenario_value value[2];

    assert_ok(read_sweep("parameters:\n  a: {grid: [1, 2.5]}\n  b: {words: [x, y]}\n"));
    assert_int_equal(sweep.combinations, 4);
    for (size_t c = 0; c < 4; c++) {
        assert_ok(sweep_values(&sweep, c, 0, &arena, value, &error));
        assert_string_equal(value[0].text, expected[c][0]);
        assert_string_equal(value[1].text, expected[c][1]);
    }
}

/* ---- what is refused ---- */

TEST_WITH(refuses_what_makes_no_sense, open_arena, close_arena)
{
    refused("parameters:\n  a: {uniform: [2, 1]}\n", ":4:6: found uniform [2, 1], expected the");
    refused("parameters:\n  a: {normal: [0, 0]}\n", "found a standard deviation of 0");
    refused("parameters:\n  a: {normal: [0, 1], limits: [7, 9]}\n", "found limits [7, 9]");
    refused("parameters:\n  a: {uniform: [1, 2], grid: [1]}\n", "of no known form");
    refused("parameters:\n  a: {limits: [1, 2]}\n", "of no known form");
    refused("parameters:\n  a: {words: [\"x; y\"]}\n", "found word \"x; y\"");
    refused("parameters:\n  a: {unifrom: [1, 2]}\n", "4:7: ");
    refused("samples: 100000\nparameters:\n  a: {grid: [1, 2]}\n", "more than 100000 cases");
    refused("samples: 0\n", "3:10: found 0, expected an integer from 1 to 100000");
}

static const struct limit sweep_limits[] = {
    {"name", 1, 63},
    {"description", 1, 1000},
    {"program", 1, 1000},
    {"seed", 0, 9e15},
    {"samples", 1, 100000},
    {"parameters[].uniform", -1e9, 1e9},
    {"parameters[].normal", -1e9, 1e9},
    {"parameters[].limits", -1e10, 1e10},
};

TEST_WITH(limits_of_sweep_files, open_arena, close_arena)
{
    check_schema(&sweep_file_schema, sweep_limits, ARRAY_COUNT(sweep_limits));
}

/* ---- shares ---- */

/* Newcombe (1998), table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29. */
/* A case is another with another text, rig, seed or program. */
TEST(a_case_is_what_its_hash_is_made_of)
{
    const struct scenario scenario = {.text_hash = 1}, other = {.text_hash = 2};
    char hash[6][PLAN_HASH];

    plan_hash_case(&scenario, 1, 1, NULL, hash[0]);
    plan_hash_case(&other, 1, 1, NULL, hash[1]);
    plan_hash_case(&scenario, 2, 1, NULL, hash[2]);
    plan_hash_case(&scenario, 1, 2, NULL, hash[3]);
    plan_hash_case(&scenario, 1, 1, "./controller", hash[4]);
    plan_hash_case(&scenario, 1, 1, "./other", hash[5]);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(strspn(hash[i], "0123456789abcdef"), PLAN_HASH - 1);
        for (int j = 0; j < i; j++) {
            assert_string_not_equal(hash[i], hash[j]);
        }
    }
}

TEST(wilson_intervals_are_those_of_the_literature)
{
    static const struct {
        size_t passed, count;
        double low, high;
    } known[] = {{81, 263, 0.2553, 0.3662},
                 {15, 148, 0.0624, 0.1605},
                 {0, 20, 0.0, 0.1611},
                 {1, 29, 0.0061, 0.1718}};

    for (size_t i = 0; i < ARRAY_COUNT(known); i++) {
        double low, high;

        plan_wilson_interval(known[i].passed, known[i].count, &low, &high);
        assert_true(fabs(low - known[i].low) < 6e-5 && fabs(high - known[i].high) < 6e-5);
    }
}
