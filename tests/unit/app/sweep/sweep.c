/* SPDX-License-Identifier: Apache-2.0 */
/* Sweeps: what is drawn, against the distributions it is drawn from, and what is refused. */
#include "app/sweep/plan.h"
#include "app/sweep/sweep.h"

#include "tests/unit/schema_limits.h"

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

/* The same file gives the same cases everywhere. These were computed by another program, with the
 * quantiles of another library. */
TEST_WITH(a_seed_draws_its_own_samples, open_arena, close_arena)
{
    static const struct {
        const char *head;
        const char *drawn[2][5];
    } known[] = {
        {"seed: 0\nsamples: 5\n",
         {{"1.11246834", "1.89988034", "0.416508877", "-0.627213063", "2.50283816"},
          {"0.767455833", "2.01670081", "1.83650936", "2.64588302", "2.18782452"}}},
        {"seed: 1\nsamples: 5\n",
         {{"-0.434852219", "0.140091244", "0.935389101", "2.6724229", "1.99586015"},
          {"2.34090332", "2.45616156", "1.77521607", "1.92129553", "1.53327996"}}},
        {"seed: 4294967297\nsamples: 5\n",
         {{"1.13233644", "2.41807014", "1.49111575", "0.216184891", "-0.731364736"},
          {"2.06935698", "2.43320407", "1.52225173", "2.20468131", "1.6487913"}}},
        {"seed: 1\nsamples: 5\nsampling: random\n",
         {{"1.82573891", "0.700456222", "0.676945507", "1.36211452", "1.97930076"},
          {"2.35572446", "1.34766723", "2.16931419", "1.55606702", "2.57878932"}}},
    };
    char text[256];

    for (size_t k = 0; k < ARRAY_COUNT(known); k++) {
        snprintf(text, sizeof text,
                 "%sparameters:\n  a: {uniform: [-1, 3]}\n  b: {normal: [2, 0.5]}\n",
                 known[k].head);
        assert_ok(read_sweep(text));
        for (size_t i = 0; i < 10; i++) {
            assert_string_equal(sweep.parameter[i / 5].drawn[i % 5], known[k].drawn[i / 5][i % 5]);
        }
    }
}

/* Counts the strata of 100 that have a sample, and the samples that are followed by larger ones. */
static void count_strata(const char *sampling, size_t *taken, size_t *rises, size_t *alike)
{
    bool seen[100] = {false};
    char text[256];

    snprintf(text, sizeof text,
             "samples: 100\nsampling: %s\nparameters:\n  a: {uniform: [0, 1]}\n"
             "  b: {uniform: [0, 1]}\n",
             sampling);
    assert_ok(read_sweep(text));
    *taken = *rises = *alike = 0;
    for (size_t i = 0; i < 100; i++) {
        *taken += !seen[(size_t)(100.0 * drawn(0, i))];
        seen[(size_t)(100.0 * drawn(0, i))] = true;
        *rises += i > 0 && drawn(0, i) > drawn(0, i - 1);
        *alike += (drawn(0, i) > 0.5) == (drawn(1, i) > 0.5);
    }
}

/* A hypercube in the order of its strata would pair low with low; a random sample has no strata. */
TEST_WITH(strata_come_in_random_order, open_arena, close_arena)
{
    size_t taken, rises, alike;

    count_strata("latin_hypercube", &taken, &rises, &alike);
    assert_int_equal(taken, 100);
    assert_true(rises > 35 && rises < 65 && alike > 25 && alike < 75);
    count_strata("random", &taken, &rises, &alike);
    assert_true(taken > 50 && taken < 80);
    assert_true(rises > 35 && rises < 65 && alike > 25 && alike < 75);
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

/* Six standard deviations on either side, unless the file says otherwise; both ends are allowed. */
TEST_WITH(a_normal_distribution_is_cut_off_at_six_sigma, open_arena, close_arena)
{
    assert_ok(read_sweep("parameters:\n  a: {normal: [1, 2]}\n"));
    assert_true(sweep.parameter[0].limits[0] == -11.0 && sweep.parameter[0].limits[1] == 13.0);
    assert_ok(read_sweep("parameters:\n  a: {normal: [1, 2], limits: [13, 14]}\n"));
    assert_true(drawn(0, 0) >= 13.0 && drawn(0, 0) <= 14.0);
    assert_ok(read_sweep("parameters:\n  a: {normal: [1, 2], limits: [-12, -11]}\n"));
    assert_true(drawn(0, 0) >= -12.0 && drawn(0, 0) <= -11.0);
}

/* Combinations are of grids and words alone; what is drawn belongs to the sample. */
TEST_WITH(the_last_of_grid_and_words_varies_fastest, open_arena, close_arena)
{
    static const char *const expected[][2] = {{"1", "x"}, {"1", "y"}, {"2.5", "x"}, {"2.5", "y"}};
    struct scenario_value value[3];

    assert_ok(read_sweep("samples: 3\nparameters:\n  a: {grid: [1, 2.5]}\n"
                         "  u: {uniform: [0, 1]}\n  b: {words: [x, y]}\n"));
    assert_int_equal(sweep.combinations, 4);
    for (size_t c = 0; c < 12; c++) {
        assert_ok(sweep_values(&sweep, c / 3, c % 3, &arena, value, &error));
        assert_string_equal(value[0].text, expected[c / 3][0]);
        assert_string_equal(value[1].text, sweep.parameter[1].drawn[c % 3]);
        assert_string_equal(value[2].text, expected[c / 3][1]);
        assert_string_equal(value[2].name, "b");
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
    refused("parameters:\n  a: {uniform: [1, 2], limits: [1, 2]}\n", "of no known form");
    refused("parameters:\n  a: {grid: [1], limits: [1, 2]}\n", "of no known form");
    refused("parameters:\n  a: {words: [x], limits: [1, 2]}\n", "of no known form");
    refused("parameters:\n  a: {grid: [1], words: [x]}\n", "of no known form");
    refused("parameters:\n  a: {uniform: [0, 1], normal: [0, 1]}\n", "of no known form");
    refused("parameters:\n  a: {}\n", "of no known form");
    refused("parameters:\n  \"a b\": {grid: [1]}\n", "of no known form");
    refused("parameters:\n  a: {uniform: [1, 1]}\n", "found uniform [1, 1]");
    refused("parameters:\n  a: {normal: [0, -1]}\n", "found a standard deviation of -1");
    refused("parameters:\n  a: {normal: [0, 1], limits: [1, 1]}\n", "found limits [1, 1]");
    refused("parameters:\n  a: {normal: [1, 2], limits: [13.01, 14]}\n",
            "found limits [13.01, 14]");
    refused("parameters:\n  a: {normal: [1, 2], limits: [-12, -11.01]}\n", "found limits [-12, ");
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
