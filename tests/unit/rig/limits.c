/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Both sides of every limit that a rig file or a robot file has: the least and the greatest value
 * of each key are taken, what is just beyond is refused. The limits stand here once more, so that
 * one that moves is noticed; a key that is missing here, or here alone, is an error.
 */
#include "base/count.h"
#include "model/robot_yaml.h"
#include "rig/schema.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "tests/unit/arena_fixture.h"

enum { PATH = 160, TEXT = 8192 };

/* Of a number the least and the greatest value, least DBL_MIN: anything above zero; of a text its
 * length. Lists and dictionaries of mappings are [] in the path; "*." begins that of a key which
 * has the same limits wherever it stands. */
struct limit {
    const char *path;
    double min, max;
};

static const struct limit rig_limits[] = {
    {"name", 1, 63},
    {"description", 1, 400},
    {"robot.springs[].Ks_nm_rad", 0, 1e9},
    {"robot.springs[].Ds_nm_s_rad", 0, 1e9},
    {"tick_s", 1e-5, 0.1},
    {"substep_s", 1e-7, 1},
    {"tolerance", 1e-13, 0.1},
    {"supply_v", DBL_MIN, 1e4},
    {"initial.base_xyz_m", -1e3, 1e3},
    {"initial.base_height_m", -1e3, 1e3},
    {"initial.base_rpy_rad", -7, 7},
    {"scene.transition_velocity_m_s", 1e-6, 10},
    {"scene.materials[].young_pa", 1, 1e12},
    {"scene.materials[].thickness_m", 1e-6, 1},
    {"scene.materials[].dissipation_s_per_m", 0, 1e4},
    {"scene.materials[].static_friction", 0, 100},
    {"scene.materials[].dynamic_friction", 0, 100},
    {"scene.materials[].viscous_s_per_m", 0, 100},
    {"scene.bodies[].name", 1, 63},
    {"scene.bodies[].mass_kg", DBL_MIN, 1e6},
    {"scene.bodies[].com_m", -1e3, 1e3},
    {"scene.bodies[].inertia_kg_m2", -1e9, 1e9},
    {"scene.bodies[].box_m", 1e-6, 1e3},
    {"scene.bodies[].sphere_radius_m", 1e-6, 1e3},
    {"*.xyz_m", -1e3, 1e3},
    {"*.rpy_rad", -7, 7},
    {"scene.bodies[].velocity_m_s", -1e3, 1e3},
    {"scene.bodies[].rate_rad_s", -1e3, 1e3},
    {"scene.surfaces[].name", 1, 63},
    {"scene.surfaces[].radius_m", 1e-6, 1e3},
    {"scene.surfaces[].length_m", 0, 1e3},
    {"scene.surfaces[].half_extents_m", 1e-6, 1e3},
    {"scene.surfaces[].cells", 1, 200},
    {"motors.joint_ticks_per_rev", 1, 1e9},
    {"motors.motor_ticks_per_link_rev", 1, 1e9},
    {"motors.torque_full_scale_nm", 1, 65535},
    {"*.current_limit_a", DBL_MIN, 1e3},
    {"motors.temperature_limit_c", 0, 125},
    {"motors.command_timeout_s", 0, 60},
    {"motors.rotor_poles", 2, 126},
    {"motors.status_period_s", 0, 10},
    {"motors.boot_s", 0, 60},
    {"buses[].name", 1, 63},
    {"buses[].interface", 1, 15},
    {"buses[].bitrate", 10e3, 1e6},
    {"buses[].data_bitrate", 10e3, 8e6},
    {"buses[].sample_point", 0.5, 0.95},
    {"buses[].restart_ms", 0, 6e4},
    {"buses[].boards[].name", 1, 63},
    {"buses[].boards[].address", 1, 31},
    {"buses[].boards[].full_scale_n", 1, 65535},
    {"buses[].boards[].full_scale_nm", 1, 65535},
    {"buses[].boards[].period_s", 0.001, 0.255},
    {"wire.queue", 1, 4096},
    {"wire.restart_s", 0, 3600},
    {"lockstep.step_id", 0, 2047},
    {"lockstep.done_id", 0, 2047},
    {"lockstep.partner_timeout_s", 0.01, 3600},
    {"realtime.priority", 0, 99},
    {"realtime.cpu", -1, 1023},
    {"realtime.stop_after", 1, 1e9},
    {"record.directory", 1, 4000},
    {"*.kp_v_per_rad", 0, 1e6},
    {"*.ki_v_per_rad_s", 0, 1e6},
    {"*.kd_v_s_per_rad", 0, 1e6},
    {"*.kw_v_s_per_rad", 0, 1e6},
    {"*.trim_per_s", 0, 1e3},
    {"*.limit_v", DBL_MIN, 1e4},
    {"*.load_v_per_nm", 0, 1e4},
    {"tasks.servo.command_period_s", 1e-5, 1},
    {"*.sway_damping_per_s", 0, 1e3},
    {"tasks.squat.thigh_m", 0.01, 10},
    {"tasks.squat.shank_m", 0.01, 10},
    {"tasks.squat.depth_m", 0, 10},
    {"tasks.squat.period_s", 0.1, 1e3},
    {"tasks.squat.cycles", 1, 1e6},
    {"tasks.grasp.settle_s", 0.1, 1e3},
    {"tasks.grasp.path[].name", 1, 31},
    {"tasks.grasp.path[].until_s", DBL_MIN, 1e3},
    {"tasks.grasp.path[].arm_rad", -7, 7},
    {"tasks.grasp.hold_s", 0, 1e3},
    {"tasks.grasp.least_press_n", 0, 1e6},
    {"tasks.grasp.least_carry_n", 0, 1e6},
    {"*.gain_error", -1, 10},
    {"*.offset", -1e6, 1e6},
    {"*.noise_rms", 0, 1e6},
    {"*.drift_per_sqrt_s", 0, 1e6},
    {"*.ramp_per_s", -1e6, 1e6},
    {"*.full_scale", DBL_MIN, 1e9},
    {"*.lsb", DBL_MIN, 1e6},
    {"*.latency_s", 0, 1},
    {"*.ambient_c", -60, 100},
    {"*.k_per_w", 1e-6, 1e4},
    {"*.time_constant_s", 0.001, 1e6},
    {"*.crosstalk", 0, 1},
    {"seed", 0, 9e15},
    {"supply_ohm", 0, 1e3},
    {"supply_capacitance_f", 1e-4, 1e3},
    {"brake_chopper.on_v", DBL_MIN, 1e4},
    {"brake_chopper.off_v", DBL_MIN, 1e4},
    {"brake_chopper.ohm", 1e-3, 1e6},
};

static const struct limit robot_limits[] = {
    {"name", 1, 63},
    {"description", 1, 400},
    {"gravity_m_s2", -1e3, 1e3},
    {"*.body", 1, 63},
    {"*.J_kg_m2", 1e-12, 1e9},
    {"*.Dm_nm_s_rad", 0, 1e9},
    {"*.Ks_nm_rad", 0, 1e9},
    {"*.Ds_nm_s_rad", 0, 1e9},
    {"*.N", 1e-6, 1e9},
    {"*.NKt_nm_a", 1e-12, 1e9},
    {"*.NKw_v_s_rad", 0, 1e9},
    {"*.R_ohm", 0, 1e9},
    {"*.L_h", 1e-12, 1e9},
    {"*.deflection_rad", 1e-6, 1e9},
    {"*.stop_Ks_nm_rad", 0, 1e9},
    {"*.stop_Ds_nm_s_rad", 0, 1e9},
    {"*.coulomb_nm", 0, 1e6},
    {"*.breakaway_nm", 0, 1e6},
    {"*.stribeck_rad_s", 1e-6, 1e6},
    {"*.backlash_rad", 0, 1},
    {"*.hysteresis_nm", 0, 1e6},
    {"*.hysteresis_nm_rad", 1e-6, 1e6},
    {"*.winding_k_w", 1e-6, 1e6},
    {"*.housing_k_w", 1e-6, 1e6},
    {"*.winding_j_k", 1e-3, 1e9},
    {"*.housing_j_k", 1e-3, 1e9},
    {"*.ambient_c", -60, 200},
    {"*.R_per_k", 0, 0.01},
    {"*.NKt_per_k", -0.01, 0},
    {"*.dead_time_s", 0, 1e-3},
    {"*.pwm_hz", 1, 1e7},
    {"*.diode_v", 0, 10},
    {"*.per_turn", 1e-6, 1e6},
    {"*.rad", 0, 1},
    {"*.nm", 0, 1e6},
    {"*.phase_rad", -1e3, 1e3},
    {"*.stiffness_nm_rad", 0, 1e9},
    {"*.damping_nm_s_rad", 0, 1e9},
    {"*.stiffness_n_m", 0, 1e9},
    {"*.damping_n_s_m", 0, 1e9},
    {"bodies[].name", 1, 63},
    {"bodies[].mass_kg", 1e-9, 1e6},
    {"*.com_m", -1e3, 1e3},
    {"*.inertia_kg_m2", -1e6, 1e6},
    {"joints[].name", 1, 63},
    {"joints[].paper_index", 0, 1e3},
    {"joints[].parent", 1, 63},
    {"joints[].child", 1, 63},
    {"joints[].axis", -1, 1},
    {"*.xyz_m", -1e3, 1e3},
    {"*.rpy_rad", -1e3, 1e3},
    {"joints[].limits.lower_rad", -1e6, 1e6},
    {"joints[].limits.upper_rad", -1e6, 1e6},
    {"joints[].limits.torque_nm", 0, 1e6},
    {"joints[].limits.lower_m", -1e6, 1e6},
    {"joints[].limits.upper_m", -1e6, 1e6},
    {"joints[].limits.force_n", 0, 1e6},
    {"joints[].parallel_spring.k_p_n_m", 0, 1e9},
    {"joints[].parallel_spring.d_p_n_s_m", 0, 1e9},
    {"joints[].parallel_spring.r_m", 1e-6, 1e3},
    {"joints[].parallel_spring.sense", -1, 1},
    {"frames[].name", 1, 63},
    {"capsules[].name", 1, 63},
    {"*.radius_m", 1e-6, 1e3},
    {"*.length_m", 0, 1e3},
    {"ft_sensors[].name", 1, 63},
    {"*.frame", 1, 63},
    {"ft_sensors[].distal.mass_kg", 0, 1e6},
    {"poses[].base_xyz_m", -1e6, 1e6},
    {"poses[].base_rpy_rad", -1e3, 1e3},
    {"poses[].joints_rad", -1e6, 1e6},
    {"poses[].joints_m", -1e6, 1e6},
    {"variants[].bodies[].name", 1, 63},
    {"variants[].bodies[].mass_kg", 1e-9, 1e6},
    {"variants[].frames[].name", 1, 63},
    {"variants[].capsules[].name", 1, 63},
    {"variants[].ft_sensors[].name", 1, 63},
    {"variants[].ft_sensors[].distal.mass_kg", 0, 1e6},
};

struct walk {
    const struct yaml_schema *schema;
    const struct limit *limit;
    size_t nlimit;
    bool seen[256];
    size_t wrong;
};

/* ---- a document with one key ---- */

/* "a.b[].c" and V become {a: {b: [{c: V}]}}. */
static void write_document(const struct yaml_schema *schema, const char *path, const char *value,
                           char *text)
{
    char closing[64] = "";
    size_t used = 0, nclosing = 0;

    for (const char *at = path; *at; at += *at == '.') {
        size_t length = strcspn(at, ".["), f = 0;
        const struct yaml_field *field;
        const char *open = "", *close = "}";

        while (strncmp(schema->fields[f].key, at, length) != 0 ||
               schema->fields[f].key[length] != '\0') {
            f++;
            assert_true(f < schema->field_count);
        }
        field = &schema->fields[f];
        if (field->type == YAML_LIST) {
            open = "[";
            close = "]}";
        } else if (field->type == YAML_DICT) {
            open = "{entry: ";
            close = "}}";
        }
        used += (size_t)snprintf(text + used, TEXT - used, "{%.*s: %s", (int)length, at, open);
        for (size_t i = strlen(close); i > 0; i--) {
            closing[nclosing++] = close[i - 1];
        }
        schema = field->schema;
        at += length + (at[length] == '[' ? 2 : 0);
    }
    used += (size_t)snprintf(text + used, TEXT - used, "%s", value);
    while (nclosing > 0) {
        text[used++] = closing[--nclosing];
    }
    text[used] = '\0';
}

/* Whether the value is refused. Other keys are missing, which is refused, too, but later. */
static bool value_is_refused(const struct walk *walk, const char *path, const char *value)
{
    static char text[TEXT];
    static struct {
        max_align_t align;
        char room[65536];
    } out;
    struct error error = {0};
    enum error_code code;

    assert_true(walk->schema->size <= sizeof out);
    write_document(walk->schema, path, value, text);
    code = yaml_read_text("x", text, strlen(text), walk->schema, &arena, &out, &error);
    assert_true(code == ERROR_NONE || code == ERROR_INPUT);
    if (code && strstr(error.text, "found unknown")) {
        fail_msg("%s: %s", text, error.text);
    }
    return code && strstr(error.text, "without key") == NULL;
}

/* ---- values ---- */

static void write_value(const struct yaml_field *field, double value, char *text)
{
    size_t used = 0;

    switch (field->type) {
    case YAML_STRING:
        memset(text, 'x', (size_t)value);
        text[(size_t)value] = '\0';
        if (value == 0.0) {
            strcpy(text, "\"\"");
        }
        break;
    case YAML_INT:
        sprintf(text, "%.0f", value);
        break;
    case YAML_REALS: /* the last is the one that counts */
        text[used++] = '[';
        for (size_t i = 0; i + 1 < field->count; i++) {
            used += (size_t)sprintf(text + used, "%.17g, ", field->max);
        }
        sprintf(text + used, "%.17g]", value);
        break;
    case YAML_REAL_DICT:
        sprintf(text, "{entry: %.17g}", value);
        break;
    default:
        sprintf(text, "%.17g", value);
        break;
    }
}

static void judge_value(struct walk *walk, const struct yaml_field *field, const char *path,
                        double value, bool refused)
{
    static char text[TEXT];

    write_value(field, value, text);
    if (value_is_refused(walk, path, text) != refused) {
        print_error("%s: %.20s should be %s\n", path, text, refused ? "refused" : "taken");
        walk->wrong++;
    }
}

static void check_limit(struct walk *walk, const struct yaml_field *field, const char *path,
                        const struct limit *limit)
{
    bool real = field->type != YAML_INT && field->type != YAML_STRING;
    double below = limit->min == DBL_MIN ? 0.0
                   : real                ? nextafter(limit->min, -(double)INFINITY)
                                         : limit->min - 1.0;
    double above = real ? nextafter(limit->max, (double)INFINITY) : limit->max + 1.0;

    judge_value(walk, field, path, limit->min, false);
    judge_value(walk, field, path, limit->max, false);
    judge_value(walk, field, path, below, true);
    judge_value(walk, field, path, above, true);
}

/* ---- the walk over a schema ---- */

static bool path_is_listed(const char *listed, const char *path)
{
    size_t length = strlen(path), tail = strlen(listed + 1);

    if (listed[0] != '*') {
        return strcmp(listed, path) == 0;
    }
    return length > tail && strcmp(path + length - tail, listed + 1) == 0;
}

static void visit_field(struct walk *walk, const struct yaml_field *field, const char *path)
{
    for (size_t i = 0; i < walk->nlimit; i++) {
        if (path_is_listed(walk->limit[i].path, path)) {
            walk->seen[i] = true;
            check_limit(walk, field, path, &walk->limit[i]);
            return;
        }
    }
    print_error("not listed here: {\"%s\", %.17g, %.17g},\n", path, field->min, field->max);
    walk->wrong++;
}

static void walk_schema(struct walk *walk, const struct yaml_schema *schema, const char *prefix)
{
    for (size_t f = 0; f < schema->field_count; f++) {
        const struct yaml_field *field = &schema->fields[f];
        bool list = field->type == YAML_LIST || field->type == YAML_DICT;
        char path[PATH];

        snprintf(path, sizeof path, "%s%s%s", prefix, field->key, list ? "[]." : "");
        if (field->schema) {
            snprintf(path, sizeof path, "%s%s%s.", prefix, field->key, list ? "[]" : "");
            walk_schema(walk, field->schema, path);
        } else if (field->min != 0.0 || field->max != 0.0) {
            visit_field(walk, field, path);
        }
    }
}

static void check_schema(const struct yaml_schema *schema, const struct limit *limit, size_t nlimit)
{
    struct walk walk = {.schema = schema, .limit = limit, .nlimit = nlimit};

    assert_true(nlimit <= ARRAY_COUNT(walk.seen));
    walk_schema(&walk, schema, "");
    for (size_t i = 0; i < nlimit; i++) {
        if (!walk.seen[i]) {
            print_error("%s has no limits any more\n", limit[i].path);
            walk.wrong++;
        }
    }
    assert_int_equal(walk.wrong, 0);
}

static void limits_of_rig_files(void **state)
{
    (void)state;
    check_schema(&rig_file_schema, rig_limits, ARRAY_COUNT(rig_limits));
}

static void limits_of_robot_files(void **state)
{
    (void)state;
    check_schema(&robot_file_schema, robot_limits, ARRAY_COUNT(robot_limits));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(limits_of_rig_files, open_arena, close_arena),
        cmocka_unit_test_setup_teardown(limits_of_robot_files, open_arena, close_arena),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
