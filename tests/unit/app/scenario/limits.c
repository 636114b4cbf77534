/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Both sides of every limit that a scenario file has (see tests/unit/schema_limits.h), and of how
 * many stimuli, expectations, mutations, parameters, combinations and bytes there may be.
 */
#include "app/scenario/private.h"

#include "tests/unit/schema_limits.h"

static const struct limit scenario_limits[] = {
    {"name", 1, 63},
    {"description", 1, 1000},
    {"rig", 1, 255},
    {"seed", 0, 9e15},
    {"duration_s", 1e-3, 1e4},
    {"clean_up_s", 0, 1e3},
    {"cpu_limit_s", 0.1, 1e5},
    {"wall_limit_s", 0.1, 1e5},
    {"task", 1, 31},
    {"*.label", 1, 63},
    {"*.after", 1, 63},
    {"*.at_s", 0, 1e5},
    {"*.for_s", DBL_MIN, 1e5},
    {"*.every_s", 1e-4, 1e5},
    {"*.frame.bus", 1, 63},
    {"*.frame.id", 0, 0x1fffffff},
    {"*.frame.copies", 1, 256},
    {"*.voltage.joint", 1, 63},
    {"*.voltage.volts", -1e3, 1e3},
    {"*.motor.joint", 1, 63},
    {"*.push.body", 1, 63},
    {"*.push.force_n", -1e5, 1e5},
    {"*.push.moment_nm", -1e5, 1e5},
    {"stimuli[].fault", 1, 140},
    {"clean_up[].fault", 1, 140},
    {"expectations[].name", 1, 95},
    {"expectations[].from_s", 0, 1e5},
    {"expectations[].to_s", 0, 1e5},
    {"expectations[].within_s", 0, 1e5},
    {"expectations[].signal", 1, 95},
    {"expectations[].event", 1, 127},
    {"expectations[].frame.id_mask", 0, 0x1fffffff},
    {"expectations[].count", 0, 1e9},
    {"expectations[].period_s", 0, 1e5},
    {"mutations[].name", 1, 63},
    {"mutations[].fault", 1, 159},
    {"mutations[].without", 1, 63},
};

TEST_WITH(limits_of_scenario_files, open_arena, close_arena)
{
    check_schema(&scenario_file_schema, scenario_limits, ARRAY_COUNT(scenario_limits));
}

/* ---- how many ---- */

/* Entries of the form, each with its number for #, between the lines before and those after. */
static bool file_is_taken(const char *before, const char *form, int many, const char *after)
{
    static char text[1 << 16];
    struct scenario *cases;
    struct error error = {0};
    size_t count, used = 0;

    used += (size_t)snprintf(text, sizeof text,
                             "name: x\ndescription: d\nrig: r.yaml\nduration_s: 1\n%s", before);
    for (int i = 0; i < many; i++) {
        const size_t length = strcspn(form, "#");

        used += (size_t)snprintf(text + used, sizeof text - used, "%.*s", (int)length, form);
        if (form[length]) {
            used += (size_t)snprintf(text + used, sizeof text - used, "%d%s", i, form + length + 1);
        }
    }
    used += (size_t)snprintf(text + used, sizeof text - used, "%s", after);
    assert_true(used < sizeof text);
    arena_fini(&arena);
    assert_ok(arena_init(&arena, (size_t)64 << 20, NULL));
    return scenario_read_text("x.yaml", text, used, &arena, &cases, &count, &error) == ERROR_NONE;
}

#define EXPECTED "expectations:\n  - {name: e, event: e}\n"

TEST_WITH(limits_of_how_many, open_arena, close_arena)
{
    static const struct {
        const char *before, *form, *after;
        int most;
    } lists[] = {
        {"stimuli:\n", "  - {label: l#}\n", EXPECTED, 128},
        /* those of the cleaning up count, too */
        {"stimuli:\n  - {label: one}\nclean_up:\n", "  - {label: l#}\n", EXPECTED, 127},
        {"expectations:\n", "  - {name: e#, event: e}\n", "", 32},
        {EXPECTED "mutations:\n", "  - {name: m#, fault: f}\n", "", 32},
        {"parameters:\n", "  p#: {values: [1]}\n", EXPECTED, 16},
        /* 128 * 32 combinations = 4096 */
        {"parameters:\n  p: {values: [", "#, ",
         "0]}\n  q: {values: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, "
         "19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31]}\n" EXPECTED,
         127},
        {"stimuli:\n  - frame: {bus: b, id: 1, data: \"", "00", "\"}\n" EXPECTED, 8},
        {"expectations:\n  - {name: e, frame: {bus: b, id: 1, data: \"", "x0", "\"}}\n", 64},
    };

    for (size_t i = 0; i < ARRAY_COUNT(lists); i++) {
        assert_true(file_is_taken(lists[i].before, lists[i].form, lists[i].most, lists[i].after));
        assert_false(
            file_is_taken(lists[i].before, lists[i].form, lists[i].most + 1, lists[i].after));
    }
}
