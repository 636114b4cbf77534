/* SPDX-License-Identifier: Apache-2.0 */
/* What follows from the cost of cases, by numbers that can be computed in the head. */
#include "app/bench/throughput.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct throughput all;

/* Three rounds of 2 s: starts of 0.1 s, cases of 0.6, 0.5, 1.1 s, ten in a range 0.5 s. */
static int set_up(void **state)
{
    static const double whole[] = {0.6, 0.5, 1.1};

    (void)state;
    all = (struct throughput){.rounds = 3, .nrig = 1, .seconds = 2.0, .mujoco = "9.9"};
    all.rig[0] = (struct throughput_rig){.rig = "a\"b", .task = "hold", .tick_s = 0.001};
    for (int i = 0; i < 3; i++) {
        all.rig[0].sample[i] = (struct throughput_sample){
            .start = {0.1, 1e6, 10.0},
            .whole = {whole[i], 5e6, 12.0},
            .range = {0.5, NAN, 11.0},
            .way_s = {0.01, 0.02, 0.04, 0.05, NAN},
        };
    }
    return 0;
}

static void assert_near(double value, double wanted)
{
    assert_true(fabs(value - wanted) <= 1e-9 * wanted);
}

static void figures_follow_from_costs(void **state)
{
    struct throughput_figures figures;

    (void)state;
    throughput_derive(&all, &all.rig[0], &figures);
    assert_near(figures.rate.median, 14400.0); /* 3600 2/0.5 */
    assert_near(figures.rate.low, 7200.0);
    assert_near(figures.rate.high, 18000.0);
    assert_near(figures.way[WAY_BODIES].median, 720000.0);
    assert_near(figures.way[WAY_BODIES_EULER].median, 360000.0);
    assert_near(figures.way[WAY_BODIES_IMPLICIT].median, 180000.0);
    assert_near(figures.way[WAY_STANDING].median, 144000.0);
    assert_true(isnan(figures.way[WAY_STANDING_EULER].median));
    assert_near(figures.hourly.median, 3600.0 / 0.55);
    assert_near(figures.start_ms.median, 100.0);
    assert_near(figures.range_ms.median, 50.0);
    assert_near(figures.whole_ms.median, 600.0);
    assert_near(figures.whole_mb.high, 12.0);
    assert_near(figures.start_instructions.median, 1e6);
    assert_near(figures.tick_instructions.median, 2000.0); /* 4e6 in 2000 ticks */
}

static void a_case_cheaper_than_its_start_has_no_rate(void **state)
{
    struct throughput_figures figures;

    (void)state;
    all.rig[0].sample[1].whole.cpu_s = 0.1;
    throughput_derive(&all, &all.rig[0], &figures);
    assert_true(isnan(figures.rate.median) && isnan(figures.rate.low));
    assert_true(isnan(figures.hourly.median));
    assert_false(isnan(figures.whole_ms.median));
}

static void json_has_null_where_nothing_was_counted(void **state)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);

    (void)state;
    assert_non_null(out);
    all.rig[0].sample[2].start.instructions = NAN;
    all.rig[0].sample[0].way_s[WAY_BODIES_EULER] = NAN;
    throughput_write_json(&all, out);
    fclose(out);
    assert_non_null(strstr(text, "{\"format_version\": 1, "));
    assert_non_null(strstr(text, "\"rig\": \"a\\\"b\""));
    assert_non_null(strstr(text, "\"simulated_s_per_core_hour\": {\"median\": 14400, "));
    assert_non_null(strstr(text, "\"mujoco_s_per_core_hour\": null"));
    assert_non_null(strstr(text, "\"bodies_s_per_core_hour\": {\"median\": 720000, "));
    assert_non_null(strstr(text, "\"start_instructions\": null"));
    assert_null(strstr(text, "nan"));
    free(text);
}

static void tables_have_a_dash_there(void **state)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);

    (void)state;
    assert_non_null(out);
    all.mujoco = NULL;
    all.rig[0].sample[0].way_s[WAY_BODIES_EULER] = NAN;
    throughput_print(&all, out);
    fclose(out);
    assert_non_null(strstr(text, "14400 (7200 .. 18000)"));
    assert_non_null(strstr(text, "no MuJoCo was found"));
    assert_null(strstr(text, "nan"));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(figures_follow_from_costs, set_up),
        cmocka_unit_test_setup(a_case_cheaper_than_its_start_has_no_rate, set_up),
        cmocka_unit_test_setup(json_has_null_where_nothing_was_counted, set_up),
        cmocka_unit_test_setup(tables_have_a_dash_there, set_up),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
