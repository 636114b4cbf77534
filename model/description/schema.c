/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The keys of a robot file and of a drive's: their types, ranges and places in struct robot_yaml
 * and struct drive_file_yaml. What they mean is described in docs/man/coman-hil-robot.5.scd.
 */
#include "model/description/yaml.h"

#include "base/array.h"

#include <float.h>
#include <stddef.h>

#define SCHEMA(text, type, table)                                                                  \
    {                                                                                              \
        .what = text, .size = sizeof(type), .fields = table, .field_count = ARRAY_COUNT(table)     \
    }

#define NAME(owner)                                                                                \
    {                                                                                              \
        .key = "name", .type = YAML_STRING, .required = true, .offset = offsetof(owner, name),     \
        .min = 1, .max = 63                                                                        \
    }
#define REFERENCE(word, owner, member)                                                             \
    {                                                                                              \
        .key = word, .type = YAML_STRING, .required = true, .offset = offsetof(owner, member),     \
        .min = 1, .max = 63, .mark_offset = offsetof(owner, member##_mark)                         \
    }
#define VECTOR(word, owner, member, must)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REALS, .required = must, .offset = offsetof(owner, member),      \
        .count = 3, .min = -1e3, .max = 1e3                                                        \
    }
#define TENSOR(owner)                                                                              \
    .key = "inertia_kg_m2", .type = YAML_REALS, .required = true, .offset = offsetof(owner, I),    \
    .count = 6, .min = -1e6, .max = 1e6
#define LIST(word, kind, owner, member, counter, entry)                                            \
    {                                                                                              \
        .key = word, .type = kind, .offset = offsetof(owner, member),                              \
        .count_offset = offsetof(owner, counter), .schema = &entry                                 \
    }

static const struct yaml_field body_fields[] = {
    NAME(struct body_yaml),
    {.key = "mass_kg",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct body_yaml, mass),
     .min = 1e-15,
     .max = 1e6},
    VECTOR("com_m", struct body_yaml, com, true),
    {TENSOR(struct body_yaml), .mark_offset = offsetof(struct body_yaml, inertia_mark)},
};
static const struct yaml_schema body_schema = SCHEMA("a body", struct body_yaml, body_fields);

static const struct yaml_field inertia_fields[] = {
    {.key = "mass_kg",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct inertia_yaml, mass),
     .min = 0.0,
     .max = 1e6},
    VECTOR("com_m", struct inertia_yaml, com, true),
    {TENSOR(struct inertia_yaml)},
};
static const struct yaml_schema inertia_schema =
    SCHEMA("the inertia below a sensor", struct inertia_yaml, inertia_fields);

static const struct yaml_field place_fields[] = {
    VECTOR("xyz_m", struct place_yaml, xyz, true),
    VECTOR("rpy_rad", struct place_yaml, rpy, false),
};
static const struct yaml_schema place_schema = SCHEMA("an origin", struct place_yaml, place_fields);

#define LIMIT(word, member, flag, lowest)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct limits_yaml, member),            \
        .min = lowest, .max = 1e6, .given_offset = offsetof(struct limits_yaml, flag)              \
    }
static const struct yaml_field limits_fields[] = {
    LIMIT("lower_rad", lower_rad, angular[0], -1e6),
    LIMIT("upper_rad", upper_rad, angular[1], -1e6),
    LIMIT("torque_nm", torque_nm, angular[2], 0.0),
    LIMIT("lower_m", lower_m, linear[0], -1e6),
    LIMIT("upper_m", upper_m, linear[1], -1e6),
    LIMIT("force_n", force_n, linear[2], 0.0),
};
static const struct yaml_schema limits_schema =
    SCHEMA("the limits of a joint", struct limits_yaml, limits_fields);

#define STOP(word, joint, parameter)                                                               \
    {                                                                                              \
        .key = word, .type = YAML_REAL,                                                            \
        .offset = offsetof(struct stops_yaml, value[joint][parameter]), .max = 1e9,                \
        .given_offset = offsetof(struct stops_yaml, given[joint][parameter])                       \
    }
static const struct yaml_field stops_fields[] = {
    {.key = "enabled",
     .type = YAML_BOOL,
     .offset = offsetof(struct stops_yaml, enabled),
     .given_offset = offsetof(struct stops_yaml, has_enabled)},
    STOP("stiffness_nm_rad", JOINT_REVOLUTE, STOP_STIFFNESS),
    STOP("damping_nm_s_rad", JOINT_REVOLUTE, STOP_DAMPING),
    STOP("stiffness_n_m", JOINT_PRISMATIC, STOP_STIFFNESS),
    STOP("damping_n_s_m", JOINT_PRISMATIC, STOP_DAMPING),
};
static const struct yaml_schema stops_schema =
    SCHEMA("the stops of joints", struct stops_yaml, stops_fields);

#define DRIVE(index, word, lowest)                                                                 \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct drive_yaml, value[index]),       \
        .min = lowest, .max = 1e9, .given_offset = offsetof(struct drive_yaml, given[index]),      \
        .mark_offset = offsetof(struct drive_yaml, value_mark[index])                              \
    }
#define EFFECT(index, word, lowest, most)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct drive_yaml, value[index]),       \
        .min = lowest, .max = most, .given_offset = offsetof(struct drive_yaml, given[index]),     \
        .mark_offset = offsetof(struct drive_yaml, value_mark[index])                              \
    }
#define HARMONIC(word, lowest, most, must, member)                                                 \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .required = must,                                          \
        .offset = offsetof(struct harmonic_yaml, member), .min = lowest, .max = most               \
    }
static const struct yaml_field error_fields[] = {
    HARMONIC("per_turn", 1e-6, 1e6, true, per_turn),
    HARMONIC("rad", 0.0, 1.0, true, amplitude),
    HARMONIC("phase_rad", -1e3, 1e3, false, phase),
};
static const struct yaml_schema error_schema =
    SCHEMA("a sine of the gear's error", struct harmonic_yaml, error_fields);
static const struct yaml_field cogging_fields[] = {
    HARMONIC("per_turn", 1e-6, 1e6, true, per_turn),
    HARMONIC("nm", 0.0, 1e6, true, amplitude),
    HARMONIC("phase_rad", -1e3, 1e3, false, phase),
};
static const struct yaml_schema cogging_schema =
    SCHEMA("a sine of the cogging torque", struct harmonic_yaml, cogging_fields);
#define HARMONICS(word, member, entry)                                                             \
    {                                                                                              \
        .key = word, .type = YAML_LIST, .offset = offsetof(struct drive_yaml, member),             \
        .count_offset = offsetof(struct drive_yaml, n##member), .schema = &entry,                  \
        .given_offset = offsetof(struct drive_yaml, has_##member)                                  \
    }
#define CYLINDER(index, word, lowest, most)                                                        \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct drive_yaml, cylinder[index]),    \
        .min = lowest, .max = most,                                                                \
        .given_offset = offsetof(struct drive_yaml, has_cylinder[index]),                          \
        .mark_offset = offsetof(struct drive_yaml, cylinder_mark[index])                           \
    }
enum { FIRST_CYLINDER_FIELD = PARAMETER_COUNT + 3 };
static const struct yaml_field drive_fields[] = {
    DRIVE(PARAMETER_J, "J_kg_m2", 1e-12),
    DRIVE(PARAMETER_DM, "Dm_nm_s_rad", 0.0),
    DRIVE(PARAMETER_KS, "Ks_nm_rad", 0.0),
    DRIVE(PARAMETER_DS, "Ds_nm_s_rad", 0.0),
    DRIVE(PARAMETER_N, "N", 1e-6),
    DRIVE(PARAMETER_KT, "NKt_nm_a", 1e-12),
    DRIVE(PARAMETER_KW, "NKw_v_s_rad", 0.0),
    DRIVE(PARAMETER_R, "R_ohm", 0.0),
    DRIVE(PARAMETER_L, "L_h", 1e-12),
    DRIVE(PARAMETER_DEFLECTION, "deflection_rad", 1e-6),
    DRIVE(PARAMETER_STOP_KS, "stop_Ks_nm_rad", 0.0),
    DRIVE(PARAMETER_STOP_DS, "stop_Ds_nm_s_rad", 0.0),
    EFFECT(PARAMETER_COULOMB, "coulomb_nm", 0.0, 1e6),
    EFFECT(PARAMETER_BREAKAWAY, "breakaway_nm", 0.0, 1e6),
    EFFECT(PARAMETER_STRIBECK, "stribeck_rad_s", 1e-6, 1e6),
    EFFECT(PARAMETER_STRIBECK_EXPONENT, "stribeck_exponent", 0.25, 16.0),
    EFFECT(PARAMETER_LOAD_MOTOR, "load_motor", 0.0, 0.95),
    EFFECT(PARAMETER_LOAD_EXTERNAL, "load_external", 0.0, 0.95),
    EFFECT(PARAMETER_LOAD_MOTOR_STRIBECK, "load_motor_stribeck", 0.0, 10.0),
    EFFECT(PARAMETER_LOAD_EXTERNAL_STRIBECK, "load_external_stribeck", 0.0, 10.0),
    EFFECT(PARAMETER_LOAD_MOTOR_QUADRATIC, "load_motor_per_nm", 0.0, 1e3),
    EFFECT(PARAMETER_LOAD_EXTERNAL_QUADRATIC, "load_external_per_nm", 0.0, 1e3),
    EFFECT(PARAMETER_BACKLASH, "backlash_rad", 0.0, 1.0),
    EFFECT(PARAMETER_HYSTERESIS, "hysteresis_nm", 0.0, 1e6),
    EFFECT(PARAMETER_HYSTERESIS_KS, "hysteresis_nm_rad", 1e-6, 1e6),
    EFFECT(PARAMETER_WINDING_K_W, "winding_k_w", 1e-6, 1e6),
    EFFECT(PARAMETER_HOUSING_K_W, "housing_k_w", 1e-6, 1e6),
    EFFECT(PARAMETER_WINDING_J_K, "winding_j_k", 1e-3, 1e9),
    EFFECT(PARAMETER_HOUSING_J_K, "housing_j_k", 1e-3, 1e9),
    EFFECT(PARAMETER_AMBIENT, "ambient_c", -60.0, 200.0),
    EFFECT(PARAMETER_R_PER_K, "R_per_k", 0.0, 0.01),
    EFFECT(PARAMETER_KT_PER_K, "NKt_per_k", -0.01, 0.0),
    EFFECT(PARAMETER_DEAD_TIME, "dead_time_s", 0.0, 1e-3),
    EFFECT(PARAMETER_PWM, "pwm_hz", 1.0, 1e7),
    EFFECT(PARAMETER_DIODE, "diode_v", 0.0, 10.0),
    EFFECT(PARAMETER_SWITCHING, "switching_s", 0.0, 1e-3),
    EFFECT(PARAMETER_BRIDGE_OHM, "bridge_ohm", 0.0, 1e6),
    {.key = "freewheel",
     .type = YAML_BOOL,
     .offset = offsetof(struct drive_yaml, freewheel),
     .given_offset = offsetof(struct drive_yaml, has_freewheel)},
    HARMONICS("gear_error", error, error_schema),
    HARMONICS("cogging", cogging, cogging_schema),
    CYLINDER(HYDRAULIC_BORE, "bore_m", 1e-4, 10.0),
    CYLINDER(HYDRAULIC_ROD, "rod_m", 0.0, 10.0),
    CYLINDER(HYDRAULIC_STROKE, "stroke_m", 1e-4, 100.0),
    CYLINDER(HYDRAULIC_DEAD, "dead_volume_m3", 1e-9, 1.0),
    CYLINDER(HYDRAULIC_BASE, "base_m", 1e-4, 100.0),
    CYLINDER(HYDRAULIC_ARM, "arm_m", 1e-4, 100.0),
    CYLINDER(HYDRAULIC_OFFSET, "offset_rad", -10.0, 10.0),
    CYLINDER(HYDRAULIC_CLOSED, "closed_m", 1e-4, 100.0),
    CYLINDER(HYDRAULIC_VALVE_HZ, "valve_hz", 1.0, 1e4),
    CYLINDER(HYDRAULIC_VALVE_DAMPING, "valve_damping", 0.05, 0.99),
    CYLINDER(HYDRAULIC_VALVE_V, "valve_v", 1e-3, 1e4),
    CYLINDER(HYDRAULIC_VALVE_FLOW, "valve_flow_m3_s", 1e-9, 10.0),
    CYLINDER(HYDRAULIC_VALVE_DROP, "valve_drop_pa", 1e3, 1e9),
    CYLINDER(HYDRAULIC_BETA, "bulk_modulus_pa", 1e6, 1e11),
    CYLINDER(HYDRAULIC_LAP, "valve_lap", 0.0, 0.5),
    CYLINDER(HYDRAULIC_LEAKAGE, "leakage_m3_s_pa", 0.0, 1e-6),
    CYLINDER(HYDRAULIC_VISCOUS, "viscous_n_s_m", 0.0, 1e9),
    CYLINDER(HYDRAULIC_COULOMB, "coulomb_n", 0.0, 1e9),
    CYLINDER(HYDRAULIC_COULOMB_SPEED, "coulomb_m_s", 1e-6, 10.0),
    {.key = "file",
     .type = YAML_STRING,
     .offset = offsetof(struct drive_yaml, file),
     .min = 1,
     .max = 255,
     .mark_offset = offsetof(struct drive_yaml, file_mark)},
};
static const struct yaml_schema drive_schema = {.what = "a drive",
                                                .size = sizeof(struct drive_yaml),
                                                .fields = drive_fields,
                                                .field_count = ARRAY_COUNT(drive_fields),
                                                .alone = "file"};

/* The older spelling of a hydraulic one */
static const struct yaml_schema hydraulic_schema = {.what = "a hydraulic drive",
                                                    .size = sizeof(struct drive_yaml),
                                                    .fields = drive_fields + FIRST_CYLINDER_FIELD,
                                                    .field_count = HYDRAULIC_PARAMETERS};

/* A drive of the catalogue, which is made from no other */
static const struct yaml_schema drive_own_schema = {.what = "a drive",
                                                    .size = sizeof(struct drive_yaml),
                                                    .fields = drive_fields,
                                                    .field_count = ARRAY_COUNT(drive_fields) - 1};

#define RATING(index, word, lowest, most)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct drive_file_yaml, rating[index]), \
        .min = lowest, .max = most,                                                                \
        .mark_offset = offsetof(struct drive_file_yaml, rating_mark[index])                        \
    }
enum { FIRST_RATING_FIELD = 3 };
static const struct yaml_field drive_file_fields[] = {
    NAME(struct drive_file_yaml),
    {.key = "description",
     .type = YAML_STRING,
     .required = true,
     .offset = offsetof(struct drive_file_yaml, description),
     .min = 1,
     .max = 400},
    {.key = "source", .type = YAML_STRING, .offset = offsetof(struct drive_file_yaml, source)},
    RATING(RATING_SUPPLY, "supply_v", DBL_MIN, 1e6),
    RATING(RATING_TORQUE, "torque_nm", DBL_MIN, 1e6),
    RATING(RATING_PEAK_TORQUE, "peak_torque_nm", DBL_MIN, 1e6),
    RATING(RATING_SPEED, "speed_rad_s", DBL_MIN, 1e6),
    RATING(RATING_PRESSURE, "pressure_pa", 1e5, 1e9),
    RATING(RATING_MASS, "mass_kg", DBL_MIN, 1e6),
    {.key = "drive",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct drive_file_yaml, drive),
     .schema = &drive_own_schema},
};
const struct yaml_schema drive_file_schema = {.what = "a drive's file",
                                              .size = sizeof(struct drive_file_yaml),
                                              .fields = drive_file_fields,
                                              .field_count = ARRAY_COUNT(drive_file_fields),
                                              .format_version = 1};

#define SUPPLY(word, must, member, lowest, most)                                                   \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .required = must,                                          \
        .offset = offsetof(struct hydraulic_supply_yaml, member), .min = lowest, .max = most       \
    }
static const struct yaml_field hydraulic_supply_fields[] = {
    SUPPLY("pressure_pa", true, pressure, 1e5, 1e9),
    SUPPLY("return_pa", false, back, 0.0, 1e8),
    SUPPLY("pump_m3_s", false, pump, 0.0, 10.0),
    SUPPLY("accumulator_m3", false, accumulator, 0.0, 10.0),
    SUPPLY("precharge_pa", false, precharge, 0.0, 1e9),
    {.key = "line_m3",
     .type = YAML_REAL,
     .offset = offsetof(struct hydraulic_supply_yaml, line),
     .min = 1e-7,
     .max = 1.0,
     .given_offset = offsetof(struct hydraulic_supply_yaml, has_line)},
    SUPPLY("relief_pa", false, relief, 0.0, 1e9),
    SUPPLY("relief_m3_s_pa", false, relief_flow, 0.0, 1e-3),
};
static const struct yaml_schema hydraulic_supply_schema =
    SCHEMA("the hydraulic supply", struct hydraulic_supply_yaml, hydraulic_supply_fields);

static const struct yaml_field spring_fields[] = {
    {.key = "enabled",
     .type = YAML_BOOL,
     .required = true,
     .offset = offsetof(struct spring_yaml, enabled)},
    {.key = "k_p_n_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, k_p),
     .max = 1e9},
    {.key = "d_p_n_s_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, d_p),
     .max = 1e9},
    {.key = "r_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, r),
     .min = 1e-6,
     .max = 1e3},
    {.key = "sense",
     .type = YAML_INT,
     .required = true,
     .offset = offsetof(struct spring_yaml, s),
     .min = -1,
     .max = 1,
     .mark_offset = offsetof(struct spring_yaml, s_mark)},
};
static const struct yaml_schema spring_schema =
    SCHEMA("a parallel spring", struct spring_yaml, spring_fields);

#define PASSIVE(word, joint, parameter, lowest)                                                    \
    {                                                                                              \
        .key = word, .type = YAML_REAL,                                                            \
        .offset = offsetof(struct passive_yaml, value[joint][parameter]), .min = lowest,           \
        .max = 1e9, .given_offset = offsetof(struct passive_yaml, given[joint][parameter])         \
    }
static const struct yaml_field passive_fields[] = {
    PASSIVE("stiffness_nm_rad", JOINT_REVOLUTE, PASSIVE_STIFFNESS, 0.0),
    PASSIVE("damping_nm_s_rad", JOINT_REVOLUTE, PASSIVE_DAMPING, 0.0),
    PASSIVE("rest_rad", JOINT_REVOLUTE, PASSIVE_REST, -1e9),
    PASSIVE("stiffness_n_m", JOINT_PRISMATIC, PASSIVE_STIFFNESS, 0.0),
    PASSIVE("damping_n_s_m", JOINT_PRISMATIC, PASSIVE_DAMPING, 0.0),
    PASSIVE("rest_m", JOINT_PRISMATIC, PASSIVE_REST, -1e9),
};
static const struct yaml_schema passive_schema =
    SCHEMA("a passive spring", struct passive_yaml, passive_fields);

static const struct word joint_types[] = {
    {"revolute", JOINT_REVOLUTE}, {"prismatic", JOINT_PRISMATIC}, {NULL, 0}};

static const struct yaml_field joint_fields[] = {
    NAME(struct joint_yaml),
    {.key = "paper_index",
     .type = YAML_INT,
     .offset = offsetof(struct joint_yaml, paper_index),
     .max = 1000},
    {.key = "type",
     .type = YAML_ENUM,
     .required = true,
     .offset = offsetof(struct joint_yaml, type),
     .names = joint_types},
    REFERENCE("parent", struct joint_yaml, parent),
    REFERENCE("child", struct joint_yaml, child),
    {.key = "axis",
     .type = YAML_REALS,
     .required = true,
     .offset = offsetof(struct joint_yaml, axis),
     .count = 3,
     .min = -1.0,
     .max = 1.0,
     .mark_offset = offsetof(struct joint_yaml, axis_mark)},
    {.key = "origin",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct joint_yaml, origin),
     .schema = &place_schema},
    {.key = "limits",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct joint_yaml, limits),
     .schema = &limits_schema},
    {.key = "stops",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, stops),
     .schema = &stops_schema},
    {.key = "drive",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, drive),
     .schema = &drive_schema,
     .given_offset = offsetof(struct joint_yaml, has_drive)},
    {.key = "hydraulic",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, hydraulic),
     .schema = &hydraulic_schema,
     .given_offset = offsetof(struct joint_yaml, has_hydraulic)},
    {.key = "parallel_spring",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, spring),
     .schema = &spring_schema,
     .given_offset = offsetof(struct joint_yaml, has_spring)},
    {.key = "passive",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, passive),
     .schema = &passive_schema,
     .given_offset = offsetof(struct joint_yaml, has_passive)},
};
static const struct yaml_schema joint_schema = SCHEMA("a joint", struct joint_yaml, joint_fields);

#define COUPLING(word, joint, parameter, lowest, most)                                             \
    {                                                                                              \
        .key = word, .type = YAML_REAL,                                                            \
        .offset = offsetof(struct coupling_yaml, value[joint][parameter]), .min = lowest,          \
        .max = most, .given_offset = offsetof(struct coupling_yaml, given[joint][parameter])       \
    }
static const struct yaml_field coupling_fields[] = {
    REFERENCE("follower", struct coupling_yaml, follower),
    REFERENCE("leader", struct coupling_yaml, leader),
    {.key = "multiplier",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct coupling_yaml, multiplier),
     .min = -1e3,
     .max = 1e3,
     .mark_offset = offsetof(struct coupling_yaml, multiplier_mark)},
    COUPLING("offset_rad", JOINT_REVOLUTE, COUPLING_OFFSET, -1e3, 1e3),
    COUPLING("stiffness_nm_rad", JOINT_REVOLUTE, COUPLING_STIFFNESS, 1e-9, 1e9),
    COUPLING("damping_nm_s_rad", JOINT_REVOLUTE, COUPLING_DAMPING, 0.0, 1e9),
    COUPLING("offset_m", JOINT_PRISMATIC, COUPLING_OFFSET, -1e3, 1e3),
    COUPLING("stiffness_n_m", JOINT_PRISMATIC, COUPLING_STIFFNESS, 1e-9, 1e9),
    COUPLING("damping_n_s_m", JOINT_PRISMATIC, COUPLING_DAMPING, 0.0, 1e9),
};
static const struct yaml_schema coupling_schema =
    SCHEMA("a coupling", struct coupling_yaml, coupling_fields);

static const struct yaml_field frame_fields[] = {
    NAME(struct frame_yaml),
    REFERENCE("body", struct frame_yaml, body),
    VECTOR("xyz_m", struct frame_yaml, xyz, true),
    VECTOR("rpy_rad", struct frame_yaml, rpy, false),
};
static const struct yaml_schema frame_schema = SCHEMA("a frame", struct frame_yaml, frame_fields);

static const struct yaml_field capsule_fields[] = {
    NAME(struct capsule_yaml),
    REFERENCE("body", struct capsule_yaml, body),
    VECTOR("xyz_m", struct capsule_yaml, xyz, true),
    VECTOR("rpy_rad", struct capsule_yaml, rpy, false),
    {.key = "radius_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct capsule_yaml, radius),
     .min = 1e-6,
     .max = 1e3},
    {.key = "length_m",
     .type = YAML_REAL,
     .offset = offsetof(struct capsule_yaml, length),
     .min = 0.0,
     .max = 1e3},
};
static const struct yaml_schema capsule_schema =
    SCHEMA("a capsule", struct capsule_yaml, capsule_fields);

static const struct word visual_shapes[] = {
    {"mesh", VISUAL_MESH},         {"box", VISUAL_BOX},         {"sphere", VISUAL_SPHERE},
    {"cylinder", VISUAL_CYLINDER}, {"capsule", VISUAL_CAPSULE}, {NULL, 0}};

static const struct yaml_field visual_fields[] = {
    NAME(struct visual_yaml),
    REFERENCE("body", struct visual_yaml, body),
    VECTOR("xyz_m", struct visual_yaml, xyz, false),
    VECTOR("rpy_rad", struct visual_yaml, rpy, false),
    {.key = "shape",
     .type = YAML_ENUM,
     .required = true,
     .offset = offsetof(struct visual_yaml, shape),
     .names = visual_shapes},
    {.key = "half_extents_m",
     .type = YAML_REALS,
     .offset = offsetof(struct visual_yaml, half_extents),
     .count = 3,
     .min = DBL_MIN,
     .max = 1e3,
     .given_offset = offsetof(struct visual_yaml, has_half_extents)},
    {.key = "radius_m",
     .type = YAML_REAL,
     .offset = offsetof(struct visual_yaml, radius),
     .min = DBL_MIN,
     .max = 1e3,
     .given_offset = offsetof(struct visual_yaml, has_radius)},
    {.key = "length_m",
     .type = YAML_REAL,
     .offset = offsetof(struct visual_yaml, length),
     .min = 0.0,
     .max = 1e3,
     .given_offset = offsetof(struct visual_yaml, has_length)},
    {.key = "file",
     .type = YAML_STRING,
     .offset = offsetof(struct visual_yaml, file),
     .min = 1,
     .max = 255,
     .mark_offset = offsetof(struct visual_yaml, file_mark)},
    {.key = "missing",
     .type = YAML_STRING,
     .offset = offsetof(struct visual_yaml, missing),
     .min = 1,
     .max = 400},
    {.key = "color",
     .type = YAML_REALS,
     .offset = offsetof(struct visual_yaml, color),
     .count = 4,
     .min = 0.0,
     .max = 1.0,
     .given_offset = offsetof(struct visual_yaml, has_color)},
};
static const struct yaml_schema visual_schema =
    SCHEMA("a visual", struct visual_yaml, visual_fields);

static const struct yaml_field ft_fields[] = {
    NAME(struct ft_yaml),
    REFERENCE("frame", struct ft_yaml, frame),
    {.key = "distal",
     .type = YAML_MAP,
     .offset = offsetof(struct ft_yaml, distal),
     .schema = &inertia_schema},
};
static const struct yaml_schema ft_schema =
    SCHEMA("a force-torque sensor", struct ft_yaml, ft_fields);

static const struct yaml_field imu_fields[] = {
    REFERENCE("frame", struct imu_yaml, frame),
};
static const struct yaml_schema imu_schema =
    SCHEMA("the inertial sensor", struct imu_yaml, imu_fields);

#define POSITIONS(word, member, counter)                                                           \
    {                                                                                              \
        .key = word, .type = YAML_REAL_DICT, .offset = offsetof(struct pose_yaml, member),         \
        .count_offset = offsetof(struct pose_yaml, counter), .min = -1e6, .max = 1e6               \
    }
static const struct yaml_field pose_fields[] = {
    {.key = "base_xyz_m",
     .type = YAML_REALS,
     .offset = offsetof(struct pose_yaml, base_xyz),
     .count = 3,
     .min = -1e6,
     .max = 1e6,
     .given_offset = offsetof(struct pose_yaml, has_xyz)},
    {.key = "base_rpy_rad",
     .type = YAML_REALS,
     .offset = offsetof(struct pose_yaml, base_rpy),
     .count = 3,
     .min = -1e3,
     .max = 1e3,
     .given_offset = offsetof(struct pose_yaml, has_rpy)},
    POSITIONS("joints_rad", joint_rad, njoint_rad),
    POSITIONS("joints_m", joint_m, njoint_m),
};
static const struct yaml_schema pose_schema = {.what = "a pose",
                                               .size = sizeof(struct pose_yaml),
                                               .fields = pose_fields,
                                               .field_count = ARRAY_COUNT(pose_fields),
                                               .name_offset = offsetof(struct pose_yaml, name)};

static const struct word base_types[] = {{"floating", 1}, {"fixed", 0}, {NULL, 0}};

static const struct yaml_field base_fields[] = {
    {.key = "type",
     .type = YAML_ENUM,
     .required = true,
     .offset = offsetof(struct base_yaml, floating),
     .names = base_types},
    REFERENCE("body", struct base_yaml, body),
};
static const struct yaml_schema base_schema = SCHEMA("the base", struct base_yaml, base_fields);

static const struct yaml_field variant_fields[] = {
    LIST("bodies", YAML_LIST, struct variant_yaml, body, nbody, body_schema),
    LIST("joints", YAML_LIST, struct variant_yaml, joint, njoint, joint_schema),
    LIST("frames", YAML_LIST, struct variant_yaml, frame, nframe, frame_schema),
    LIST("capsules", YAML_LIST, struct variant_yaml, capsule, ncapsule, capsule_schema),
    LIST("ft_sensors", YAML_LIST, struct variant_yaml, ft, nft, ft_schema),
    {.key = "drive",
     .type = YAML_MAP,
     .offset = offsetof(struct variant_yaml, drive),
     .schema = &drive_schema},
    {.key = "passive",
     .type = YAML_MAP,
     .offset = offsetof(struct variant_yaml, passive),
     .schema = &passive_schema,
     .given_offset = offsetof(struct variant_yaml, has_passive)},
};
static const struct yaml_schema variant_schema = {.what = "a variant",
                                                  .size = sizeof(struct variant_yaml),
                                                  .fields = variant_fields,
                                                  .field_count = ARRAY_COUNT(variant_fields),
                                                  .name_offset =
                                                      offsetof(struct variant_yaml, name)};

static const struct yaml_field robot_fields[] = {
    NAME(struct robot_yaml),
    {.key = "description",
     .type = YAML_STRING,
     .offset = offsetof(struct robot_yaml, description),
     .min = 1,
     .max = 400},
    {.key = "source", .type = YAML_STRING, .offset = offsetof(struct robot_yaml, source)},
    {.key = "gravity_m_s2",
     .type = YAML_REALS,
     .required = true,
     .offset = offsetof(struct robot_yaml, gravity),
     .count = 3,
     .min = -1e3,
     .max = 1e3},
    {.key = "base",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct robot_yaml, base),
     .schema = &base_schema},
    {.key = "drive",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, drive),
     .schema = &drive_schema},
    {.key = "hydraulic",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, hydraulic),
     .schema = &hydraulic_schema},
    {.key = "hydraulic_supply",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, hydraulic_supply),
     .schema = &hydraulic_supply_schema,
     .given_offset = offsetof(struct robot_yaml, has_hydraulic_supply)},
    {.key = "stops",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, stops),
     .schema = &stops_schema},
    {.key = "passive",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, passive),
     .schema = &passive_schema},
    {.key = "bodies",
     .type = YAML_LIST,
     .required = true,
     .offset = offsetof(struct robot_yaml, body),
     .count_offset = offsetof(struct robot_yaml, nbody),
     .schema = &body_schema},
    LIST("joints", YAML_LIST, struct robot_yaml, joint, njoint, joint_schema),
    LIST("couplings", YAML_LIST, struct robot_yaml, coupling, ncoupling, coupling_schema),
    LIST("frames", YAML_LIST, struct robot_yaml, frame, nframe, frame_schema),
    LIST("capsules", YAML_LIST, struct robot_yaml, capsule, ncapsule, capsule_schema),
    LIST("visuals", YAML_LIST, struct robot_yaml, visual, nvisual, visual_schema),
    LIST("ft_sensors", YAML_LIST, struct robot_yaml, ft, nft, ft_schema),
    {.key = "imu",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, imu),
     .schema = &imu_schema,
     .given_offset = offsetof(struct robot_yaml, has_imu)},
    LIST("poses", YAML_DICT, struct robot_yaml, pose, npose, pose_schema),
    LIST("variants", YAML_DICT, struct robot_yaml, variant, nvariant, variant_schema),
};
const struct yaml_schema robot_file_schema = {.what = "a robot",
                                              .size = sizeof(struct robot_yaml),
                                              .fields = robot_fields,
                                              .field_count = ARRAY_COUNT(robot_fields),
                                              .hash_offset = offsetof(struct robot_yaml, hash),
                                              .format_version = 1};

const char *robot_drive_key(enum drive_parameter parameter)
{
    return drive_fields[parameter].key;
}

const char *robot_hydraulic_key(enum hydraulic_parameter parameter)
{
    return drive_fields[FIRST_CYLINDER_FIELD + parameter].key;
}

const char *robot_rating_key(enum drive_rating rating)
{
    return drive_file_fields[FIRST_RATING_FIELD + rating].key;
}
