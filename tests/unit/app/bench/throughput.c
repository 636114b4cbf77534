/* SPDX-License-Identifier: Apache-2.0 */
/* What follows from the cost of cases, by numbers that can be computed in the head. */
#include "app/bench/throughput.h"
#include "tests/test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static struct throughput all;

/* Three rounds of 2 s: starts of 0.1 s, cases of 0.6, 0.5, 1.1 s, ten in a range 0.5 s. */
FIXTURE(set_up)
{
    static const double whole[] = {0.6, 0.5, 1.1};

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

TEST_WITH(figures_follow_from_costs, set_up, NULL)
{
    struct throughput_figures figures;

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

TEST_WITH(a_case_cheaper_than_its_start_has_no_rate, set_up, NULL)
{
    struct throughput_figures figures;

    all.rig[0].sample[1].whole.cpu_s = 0.1;
    throughput_derive(&all, &all.rig[0], &figures);
    assert_true(isnan(figures.rate.median) && isnan(figures.rate.low));
    assert_true(isnan(figures.hourly.median));
    assert_false(isnan(figures.whole_ms.median));
}

TEST_WITH(json_has_null_where_nothing_was_counted, set_up, NULL)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);

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

TEST_WITH(tables_have_a_dash_there, set_up, NULL)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);

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
