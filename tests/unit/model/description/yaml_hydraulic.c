/* SPDX-License-Identifier: Apache-2.0 */
/* Hydraulic joints of robot files: the shipped leg, and what is refused. */
#include "base/array.h"
#include "model/hydraulics/hydraulic.h"

#include <unistd.h>

#include "tests/unit/arena_fixture.h"

#define LEG HIL_SOURCE_DIR "/config/robots/hyq-leg.yaml"

/* The same as it was written before the catalogue had hydraulic drives. */
#define OLD_LEG HIL_SOURCE_DIR "/tests/old/robots/oil.yaml"

TEST_WITH(the_leg_has_its_cylinders, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;
    double lever[2];

    assert_no_error(robot_load(LEG, NULL, &arena, &robot, &error), error.text);
    for (size_t j = 0; j < 2; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const struct robot_hydraulic *c = &joint->hydraulic;

        assert_true(c->present && !joint->sea.present && robot_joint_is_driven(joint));
        assert_true(fabs(c->A1 * robot->hydraulic_supply.pressure - 3217.0) < 0.5);
        assert_true(fabs(c->A2 * robot->hydraulic_supply.pressure - 1960.0) < 0.5);
        assert_true(fabs(c->K * sqrt(3.5e6) - 1.25e-4) < 1e-12);
        assert_true(fabs(c->valve_w - 1570.796) < 1e-2);
        assert_true(c->coulomb_speed == 0.01); /* the leg's file has none */

        /* half out in the middle of the range */
        assert_true(fabs(hydraulic_length(c, 0.5 * (joint->lower + joint->upper), &lever[j]) -
                         c->closed - 0.04) < 1e-6);
    }
    assert_true(fabs(lever[0] - lever[1]) < 1e-9);
}

/* To the last bit: the catalogue has the numbers that the file had. */
TEST_WITH(the_leg_takes_its_cylinders_from_the_catalogue, open_arena, close_arena)
{
    const struct robot *robot, *old;
    struct error error;

    if (robot_load(LEG, NULL, &arena, &robot, &error) ||
        robot_load(OLD_LEG, NULL, &arena, &old, &error)) {
        fail_msg("%s", error.text);
    }
    for (size_t j = 0; j < 2; j++) {
        assert_memory_equal(&robot->joint[j].hydraulic, &old->joint[j].hydraulic,
                            sizeof old->joint[j].hydraulic);
    }
}

/* The leg with one part of its text replaced is refused so. */
TEST_WITH(a_faulty_cylinder_is_refused_at_its_place, open_arena, close_arena)
{
    static const struct {
        const char *part, *other, *text;
    } fault[] = {
        {"stroke_m: 0.080 ", "stroke_m: 0.040 ", "hip: found the piston at"},
        {"upper_rad: 0.85", "upper_rad: 1.55", "expected it within"},
        {"hydraulic: {}", "hydraulic: {offset_rad: 3.0}", "hip: found"},
        {"rod_m: 0.010 ", "rod_m: 0.016 ", "found a rod as thick as its bore"},
        {"valve_hz: 250.0 ", "valve_khz: 250.0 ", "expected \"valve_hz\""},
        {"  valve_v: 10.0 ", "  # ", "without key \"valve_v\""},
        {"hydraulic: {}", "hydraulic: {}\n    drive: {}",
         "found a hydraulic drive on driven joint"},
        {"hydraulic:\n", "drive: {bore_m: 0.02}\nhydraulic:\n",
         "found key \"hydraulic\" beside a hydraulic \"drive\""},
        {"  base_m: 0.32 ", "  # ", "without key \"base_m\", expected it here (the triangle"},
        {"precharge_pa: 9.0e+6", "precharge_pa: 2.0e+7", "found an accumulator of precharge_pa"},
        {"return_pa: 2.0e+5", "return_pa: 2.0e+7", "found a supply of"},
        {"return_pa: 2.0e+5", "return_pa: -1", "expected a number"},
    };
    static char text[16384];
    FILE *leg = fopen(OLD_LEG, "re");
    size_t size;

    assert_non_null(leg);
    size = fread(text, 1, sizeof text - 1, leg);
    fclose(leg);
    text[size] = '\0';
    for (size_t i = 0; i < ARRAY_COUNT(fault); i++) {
        char path[] = "/tmp/hil-hydraulic-XXXXXX", place[64];
        int fd = mkstemp(path);
        FILE *file = fdopen(fd, "w");
        const char *at = strstr(text, fault[i].part);
        const struct robot *robot;
        struct error error;

        assert_non_null(file);
        assert_non_null(at);
        fprintf(file, "%.*s%s%s", (int)(at - text), text, fault[i].other,
                at + strlen(fault[i].part));
        assert_int_equal(fclose(file), 0);
        assert_int_equal(robot_load(path, NULL, &arena, &robot, &error), ERROR_INPUT);
        unlink(path);
        snprintf(place, sizeof place, "%s:", path);
        if (!strstr(error.text, fault[i].text) || !strstr(error.text, place)) {
            fail_msg("%s\n  is not %s", error.text, fault[i].text);
        }
    }
}

/* The leg of before the catalogue with this supply: NULL and an error, or the robot. */
static const struct robot *load_supply(const char *keys, struct error *error)
{
    static char text[16384];
    char path[] = "/tmp/hil-hydraulic-XXXXXX";
    const struct robot *robot = NULL;
    FILE *leg = fopen(OLD_LEG, "re"), *file = fdopen(mkstemp(path), "w");
    const char *from, *to;

    assert_true(leg && file);
    text[fread(text, 1, sizeof text - 1, leg)] = '\0';
    fclose(leg);
    from = strstr(text, "hydraulic_supply:");
    to = strstr(text, "bodies:");
    fprintf(file, "%.*shydraulic_supply: {%s}\n%s", (int)(from - text), text, keys, to);
    assert_int_equal(fclose(file), 0);
    if (robot_load(path, NULL, &arena, &robot, error)) {
        robot = NULL;
    }
    unlink(path);
    return robot;
}

/* Each key fills its own member; what is left out is 0, and the line a tenth of the accumulator. */
TEST_WITH(a_supply_is_as_its_keys_say, open_arena, close_arena)
{
    const struct robot_hydraulic_supply *supply;
    struct error error = {0};
    const struct robot *robot = load_supply(
        "pressure_pa: 1.6e+7, return_pa: 2.0e+5, pump_m3_s: 5.0e-5, accumulator_m3: 2.0e-4, "
        "precharge_pa: 9.0e+6, line_m3: 3.0e-5, relief_pa: 1.7e+7, relief_m3_s_pa: 1.0e-9",
        &error);

    assert_non_null(robot);
    supply = &robot->hydraulic_supply;
    assert_true(supply->pressure == 1.6e7 && supply->back == 2e5 && supply->pump == 5e-5);
    assert_true(supply->accumulator == 2e-4 && supply->precharge == 9e6 && supply->line == 3e-5);
    assert_true(supply->relief == 1.7e7 && supply->relief_flow == 1e-9);
    robot = load_supply("pressure_pa: 1.6e+7", &error);
    assert_non_null(robot);
    supply = &robot->hydraulic_supply;
    assert_true(supply->pressure == 1.6e7 && supply->back == 0.0 && supply->pump == 0.0);
    assert_true(supply->accumulator == 0.0 && supply->precharge == 0.0 && supply->line == 0.0);
    assert_true(supply->relief == 0.0 && supply->relief_flow == 0.0);
    robot = load_supply("pressure_pa: 1.6e+7, accumulator_m3: 2.0e-4, precharge_pa: 9.0e+6, "
                        "relief_pa: 1.7e+7",
                        &error);
    assert_non_null(robot);
    assert_true(fabs(robot->hydraulic_supply.line - 2e-5) < 1e-18);
}

/* Both sides of each limit that two keys make together. */
TEST_WITH(a_supply_has_pressures_in_their_order, open_arena, close_arena)
{
    static const struct {
        const char *keys, *text; /* NULL: taken */
    } rows[] = {
        {"pressure_pa: 3.0e+6, return_pa: 2999999", NULL},
        {"pressure_pa: 3.0e+6, return_pa: 3.0e+6", "found a supply of 3e+06 Pa"},
        {"pressure_pa: 3e+6, return_pa: 1e+6, accumulator_m3: 1e-3, precharge_pa: 3e+6, "
         "relief_pa: 4e+6",
         NULL},
        {"pressure_pa: 3e+6, return_pa: 1e+6, accumulator_m3: 1e-3, precharge_pa: 3000001, "
         "relief_pa: 4e+6",
         "found an accumulator of"},
        {"pressure_pa: 3e+6, return_pa: 1e+6, accumulator_m3: 1e-3, precharge_pa: 1000001, "
         "relief_pa: 4e+6",
         NULL},
        {"pressure_pa: 3e+6, return_pa: 1e+6, accumulator_m3: 1e-3, precharge_pa: 1e+6, "
         "relief_pa: 4e+6",
         "found an accumulator of"},
        {"pressure_pa: 3e+6, accumulator_m3: 1e-3, precharge_pa: 1e+6, relief_pa: 0",
         "found an accumulator of"},
        {"pressure_pa: 3e+6, accumulator_m3: 1e-3, precharge_pa: 1e+6, relief_pa: 1", NULL},
        /* Without an accumulator the others mean nothing */
        {"pressure_pa: 3e+6, accumulator_m3: 0, precharge_pa: 5e+6, relief_pa: 0", NULL},
        {"pressure_pa: 3e+6, precharge_pa: 5e+6", NULL},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct error error = {0};
        const struct robot *robot = load_supply(rows[i].keys, &error);

        if ((robot == NULL) != (rows[i].text != NULL) ||
            (rows[i].text && !strstr(error.text, rows[i].text))) {
            fail_msg("%s: %s", rows[i].keys, error.text);
        }
    }
}
