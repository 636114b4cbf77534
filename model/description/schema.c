/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The keys of robot files and drive files: types, ranges and members of the structs of
 * model/description/yaml.h. docs/man/coman-hil-robot.5.scd explains them.
 */
#include "model/description/yaml.h"

#include <float.h>
#include <stddef.h>

#define AT(type, member) offsetof(struct type, member)

static const struct yaml_field body_fields[] = {
    YAML_TEXT("name", true, body_yaml, body.name, 1, 63),
    YAML_NUMBER("mass_kg", true, body_yaml, body.inertia.mass, 1e-15, 1e6),
    YAML_NUMBERS("com_m", true, body_yaml, body.inertia.com, 3, -1e3, 1e3),
    YAML_NUMBERS("inertia_kg_m2", true, body_yaml, body.inertia.I, 6, -1e6, 1e6),
};
YAML_TABLE(body, "a body", body_yaml);

static const struct yaml_field inertia_fields[] = {
    YAML_NUMBER("mass_kg", true, robot_inertia, mass, 0.0, 1e6),
    YAML_NUMBERS("com_m", true, robot_inertia, com, 3, -1e3, 1e3),
    YAML_NUMBERS("inertia_kg_m2", true, robot_inertia, I, 6, -1e6, 1e6),
};
YAML_TABLE(inertia, "the inertia below a sensor", robot_inertia, .unmarked = true);

static const struct yaml_field origin_fields[] = {
    YAML_NUMBERS("xyz_m", true, joint_yaml, joint.origin, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, joint_yaml, rpy, 3, -1e3, 1e3),
};
YAML_TABLE(origin, "an origin", joint_yaml, .unmarked = true);

static const struct yaml_field limits_fields[] = {
    YAML_NUMBER("lower_rad", false, robot_joint, lower, -1e6, 1e6),
    YAML_NUMBER("upper_rad", false, robot_joint, upper, -1e6, 1e6),
    YAML_NUMBER("torque_nm", false, robot_joint, torque_limit, 0.0, 1e6),
    YAML_NUMBER("lower_m", false, robot_joint, lower, -1e6, 1e6),
    YAML_NUMBER("upper_m", false, robot_joint, upper, -1e6, 1e6),
    YAML_NUMBER("force_n", false, robot_joint, torque_limit, 0.0, 1e6),
};
YAML_TABLE(limits, "the limits of a joint", robot_joint, .unmarked = true);

static const struct yaml_field stops_fields[] = {
    {"enabled", YAML_BOOL, false, .offset = AT(stops_yaml, enabled)},
    YAML_NUMBER("stiffness_nm_rad", false, stops_yaml, stop[JOINT_REVOLUTE].stiffness, 0.0, 1e9),
    YAML_NUMBER("damping_nm_s_rad", false, stops_yaml, stop[JOINT_REVOLUTE].damping, 0.0, 1e9),
    YAML_NUMBER("stiffness_n_m", false, stops_yaml, stop[JOINT_PRISMATIC].stiffness, 0.0, 1e9),
    YAML_NUMBER("damping_n_s_m", false, stops_yaml, stop[JOINT_PRISMATIC].damping, 0.0, 1e9),
};
const struct yaml_schema robot_stops_schema =
    YAML_SCHEMA("the stops of joints", struct stops_yaml, stops_fields);

static const struct yaml_field error_fields[] = {
    YAML_NUMBER("per_turn", true, harmonic_yaml, sine.per_turn, 1e-6, 1e6),
    YAML_NUMBER("rad", true, harmonic_yaml, sine.amplitude, 0.0, 1.0),
    YAML_NUMBER("phase_rad", false, harmonic_yaml, sine.phase, -1e3, 1e3),
};
YAML_TABLE(error, "a sine of the gear's error", harmonic_yaml);
static const struct yaml_field cogging_fields[] = {
    YAML_NUMBER("per_turn", true, harmonic_yaml, sine.per_turn, 1e-6, 1e6),
    YAML_NUMBER("nm", true, harmonic_yaml, sine.amplitude, 0.0, 1e6),
    YAML_NUMBER("phase_rad", false, harmonic_yaml, sine.phase, -1e3, 1e3),
};
YAML_TABLE(cogging, "a sine of the cogging torque", harmonic_yaml);

/* Rows of the keys of drives: electric drives (required keys first), hydraulic drives, then keys of
 * both kinds. */
#define DRIVE(word, member, low, high) YAML_NUMBER(word, false, drive_yaml, member, low, high)
static const struct yaml_field drive_fields[] = {
    DRIVE("J_kg_m2", sea.J, 1e-12, 1e9),
    DRIVE("Dm_nm_s_rad", sea.Dm, 0.0, 1e9),
    DRIVE("Ks_nm_rad", sea.Ks, 0.0, 1e9),
    DRIVE("Ds_nm_s_rad", sea.Ds, 0.0, 1e9),
    DRIVE("N", sea.N, 1e-6, 1e9),
    DRIVE("NKt_nm_a", sea.Kt, 1e-12, 1e9),
    DRIVE("NKw_v_s_rad", sea.Kw, 0.0, 1e9),
    DRIVE("R_ohm", sea.R, 0.0, 1e9),
    DRIVE("L_h", sea.L, 1e-12, 1e9),
    DRIVE("deflection_rad", sea.deflection, 1e-6, 1e9),
    DRIVE("stop_Ks_nm_rad", sea.stop.stiffness, 0.0, 1e9),
    DRIVE("stop_Ds_nm_s_rad", sea.stop.damping, 0.0, 1e9),
    DRIVE("current_loop_hz", sea.current_loop_hz, 1.0, 1e6),
    DRIVE("command_filter_s", sea.command_filter_s, 0.0, 10.0),
    DRIVE("command_delay_s", sea.command_delay_s, 0.0, 0.1),
    DRIVE("coulomb_nm", effects.coulomb, 0.0, 1e6),
    DRIVE("breakaway_nm", effects.breakaway, 0.0, 1e6),
    DRIVE("stribeck_rad_s", effects.stribeck, 1e-6, 1e6),
    DRIVE("stribeck_exponent", effects.stribeck_exponent, 0.25, 16.0),
    DRIVE("presliding_nm_rad", effects.presliding, 1e-6, 1e9),
    DRIVE("load_motor", effects.load.motor, 0.0, 0.95),
    DRIVE("load_external", effects.load.external, 0.0, 0.95),
    DRIVE("load_motor_stribeck", effects.load.motor_stribeck, 0.0, 10.0),
    DRIVE("load_external_stribeck", effects.load.external_stribeck, 0.0, 10.0),
    DRIVE("load_motor_per_nm", effects.load.motor_quadratic, 0.0, 1e3),
    DRIVE("load_external_per_nm", effects.load.external_quadratic, 0.0, 1e3),
    DRIVE("backlash_rad", effects.backlash, 0.0, 1.0),
    DRIVE("hysteresis_nm", effects.hysteresis, 0.0, 1e6),
    DRIVE("hysteresis_nm_rad", effects.hysteresis_stiffness, 1e-6, 1e6),
    DRIVE("winding_k_w", effects.thermal.winding_k_w, 1e-6, 1e6),
    DRIVE("housing_k_w", effects.thermal.housing_k_w, 1e-6, 1e6),
    DRIVE("winding_j_k", effects.thermal.winding_j_k, 1e-3, 1e9),
    DRIVE("housing_j_k", effects.thermal.housing_j_k, 1e-3, 1e9),
    DRIVE("ambient_c", effects.thermal.ambient_c, -60.0, 200.0),
    DRIVE("R_per_k", effects.thermal.R_per_k, 0.0, 0.01),
    DRIVE("NKt_per_k", effects.thermal.Kt_per_k, -0.01, 0.0),
    DRIVE("dead_time_s", effects.dead_time, 0.0, 1e-3),
    DRIVE("pwm_hz", effects.pwm, 1.0, 1e7),
    DRIVE("diode_v", effects.diode, 0.0, 10.0),
    DRIVE("switching_s", effects.switching, 0.0, 1e-3),
    DRIVE("bridge_ohm", effects.bridge_ohm, 0.0, 1e6),
    DRIVE("saturation_a", effects.saturation, 1e-6, 1e9),
    DRIVE("iron_nm_s_rad_a2", effects.iron, 0.0, 1e6),
    DRIVE("R_skin_ohm", effects.skin, 0.0, 1e6),
    DRIVE("standby_w", effects.standby, 0.0, 1e6),
    {"freewheel", YAML_BOOL, false, .offset = AT(drive_yaml, effects.freewheel)},
    YAML_ENTRIES("gear_error", YAML_LIST, false, drive_yaml, error, nerror, error_schema),
    YAML_ENTRIES("cogging", YAML_LIST, false, drive_yaml, cogging, ncogging, cogging_schema),
    DRIVE("bore_m", bore, 1e-4, 10.0),
    DRIVE("rod_m", rod, 0.0, 10.0),
    DRIVE("stroke_m", cylinder.stroke, 1e-4, 100.0),
    DRIVE("dead_volume_m3", cylinder.dead, 1e-9, 1.0),
    DRIVE("base_m", cylinder.base, 1e-4, 100.0),
    DRIVE("arm_m", cylinder.arm, 1e-4, 100.0),
    DRIVE("offset_rad", cylinder.offset, -10.0, 10.0),
    DRIVE("closed_m", cylinder.closed, 1e-4, 100.0),
    DRIVE("valve_hz", valve_hz, 1.0, 1e4),
    DRIVE("valve_damping", cylinder.valve_damping, 0.05, 0.99),
    DRIVE("valve_v", cylinder.valve_v, 1e-3, 1e4),
    DRIVE("valve_flow_m3_s", valve_flow, 1e-9, 10.0),
    DRIVE("valve_drop_pa", valve_drop, 1e3, 1e9),
    DRIVE("bulk_modulus_pa", cylinder.beta, 1e6, 1e11),
    DRIVE("valve_lap", cylinder.lap, 0.0, 0.5),
    DRIVE("leakage_m3_s_pa", cylinder.leakage, 0.0, 1e-6),
    DRIVE("viscous_n_s_m", cylinder.viscous, 0.0, 1e9),
    DRIVE("coulomb_n", cylinder.coulomb, 0.0, 1e9),
    DRIVE("coulomb_m_s", cylinder.coulomb_speed, 1e-6, 10.0),
    {"file", YAML_STRING, false, AT(drive_yaml, file), .min = 1, .max = 255},
};
enum {
    DRIVE_ROWS = sizeof drive_fields / sizeof *drive_fields,
    CYLINDER_ROWS = 19,
    ELECTRIC_ROWS = DRIVE_ROWS - CYLINDER_ROWS - 1,
};
const struct yaml_schema robot_drive_schema =
    YAML_SCHEMA("a drive", struct drive_yaml, drive_fields, .alone = "file");

/* The older key "hydraulic" for a hydraulic drive */
static const struct yaml_schema hydraulic_schema = {.what = "a hydraulic drive",
                                                    .size = sizeof(struct drive_yaml),
                                                    .fields = drive_fields + ELECTRIC_ROWS,
                                                    .field_count = CYLINDER_ROWS};

/* The drive in a catalogue file. It cannot refer to another file */
static const struct yaml_schema drive_own_schema = {.what = "a drive",
                                                    .size = sizeof(struct drive_yaml),
                                                    .fields = drive_fields,
                                                    .field_count = DRIVE_ROWS - 1};

const struct yaml_field *robot_drive_rows(enum drive_kind kind, size_t *count)
{
    *count = kind == DRIVE_HYDRAULIC ? CYLINDER_ROWS : kind == DRIVE_ELECTRIC ? ELECTRIC_ROWS : 0;
    return kind == DRIVE_HYDRAULIC ? drive_fields + ELECTRIC_ROWS : drive_fields;
}

static const struct yaml_field drive_file_fields[] = {
    YAML_TEXT("name", true, drive_file_yaml, made.name, 1, 63),
    {"description", YAML_STRING, true, AT(drive_file_yaml, made.description), .min = 1, .max = 400},
    {"source", YAML_STRING, false, .offset = AT(drive_file_yaml, made.source)},
    YAML_NUMBER("supply_v", false, drive_file_yaml, made.supply_v, DBL_MIN, 1e6),
    YAML_NUMBER("torque_nm", false, drive_file_yaml, made.torque, DBL_MIN, 1e6),
    YAML_NUMBER("peak_torque_nm", false, drive_file_yaml, made.peak_torque, DBL_MIN, 1e6),
    YAML_NUMBER("speed_rad_s", false, drive_file_yaml, made.speed, DBL_MIN, 1e6),
    YAML_NUMBER("pressure_pa", false, drive_file_yaml, made.pressure, 1e5, 1e9),
    YAML_NUMBER("mass_kg", false, drive_file_yaml, made.mass, DBL_MIN, 1e6),
    YAML_SECTION("drive", true, drive_file_yaml, drive, drive_own_schema),
};
const struct yaml_schema drive_file_schema =
    YAML_SCHEMA("a drive's file", struct drive_file_yaml, drive_file_fields, .format_version = 1);

#define SUPPLY(word, must, member, low, high)                                                      \
    YAML_NUMBER(word, must, robot_hydraulic_supply, member, low, high)
static const struct yaml_field hydraulic_supply_fields[] = {
    SUPPLY("pressure_pa", true, pressure, 1e5, 1e9),
    SUPPLY("return_pa", false, back, 0.0, 1e8),
    SUPPLY("pump_m3_s", false, pump, 0.0, 10.0),
    SUPPLY("accumulator_m3", false, accumulator, 0.0, 10.0),
    SUPPLY("precharge_pa", false, precharge, 0.0, 1e9),
    SUPPLY("line_m3", false, line, 1e-7, 1.0),
    SUPPLY("relief_pa", false, relief, 0.0, 1e9),
    SUPPLY("relief_m3_s_pa", false, relief_flow, 0.0, 1e-3),
};
YAML_TABLE(hydraulic_supply, "the hydraulic supply", robot_hydraulic_supply, .unmarked = true);

static const struct yaml_field spring_fields[] = {
    {"enabled", YAML_BOOL, true, .offset = AT(joint_yaml, joint.spring.enabled)},
    YAML_NUMBER("k_p_n_m", true, joint_yaml, joint.spring.k_p, 0.0, 1e9),
    YAML_NUMBER("d_p_n_s_m", true, joint_yaml, joint.spring.d_p, 0.0, 1e9),
    YAML_NUMBER("r_m", true, joint_yaml, joint.spring.r, 1e-6, 1e3),
    {"sense", YAML_INT, true, AT(joint_yaml, spring_sense), .min = -1, .max = 1},
};
YAML_TABLE(spring, "a parallel spring", joint_yaml, .unmarked = true);

static const struct yaml_field passive_fields[] = {
    YAML_NUMBER("stiffness_nm_rad", false, passive_yaml, passive.stiffness, 0.0, 1e9),
    YAML_NUMBER("damping_nm_s_rad", false, passive_yaml, passive.damping, 0.0, 1e9),
    YAML_NUMBER("rest_rad", false, passive_yaml, passive.rest, -1e9, 1e9),
    YAML_NUMBER("stiffness_n_m", false, passive_yaml, passive.stiffness, 0.0, 1e9),
    YAML_NUMBER("damping_n_s_m", false, passive_yaml, passive.damping, 0.0, 1e9),
    YAML_NUMBER("rest_m", false, passive_yaml, passive.rest, -1e9, 1e9),
};
YAML_TABLE(passive, "a passive spring", passive_yaml);

static const struct word joint_types[] = {
    {"revolute", JOINT_REVOLUTE}, {"prismatic", JOINT_PRISMATIC}, {NULL, 0}};

static const struct yaml_field joint_fields[] = {
    YAML_TEXT("name", true, joint_yaml, joint.name, 1, 63),
    YAML_COUNT("paper_index", false, joint_yaml, joint.paper_index, 0, 1000),
    {"type", YAML_ENUM, true, AT(joint_yaml, joint.type), .names = joint_types},
    YAML_TEXT("parent", true, joint_yaml, parent, 1, 63),
    YAML_TEXT("child", true, joint_yaml, child, 1, 63),
    YAML_NUMBERS("axis", true, joint_yaml, joint.axis, 3, -1.0, 1.0),
    {"origin", YAML_MAP, true, .schema = &origin_schema},
    YAML_SECTION("limits", true, joint_yaml, joint, limits_schema),
    YAML_SECTION("stops", false, joint_yaml, stops, robot_stops_schema),
    YAML_SECTION("drive", false, joint_yaml, drive, robot_drive_schema),
    YAML_SECTION("hydraulic", false, joint_yaml, hydraulic, hydraulic_schema),
    {"parallel_spring", YAML_MAP, false, .schema = &spring_schema},
    YAML_SECTION("passive", false, joint_yaml, passive, passive_schema),
};
YAML_TABLE(joint, "a joint", joint_yaml);

static const struct yaml_field coupling_fields[] = {
    YAML_TEXT("follower", true, coupling_yaml, follower, 1, 63),
    YAML_TEXT("leader", true, coupling_yaml, leader, 1, 63),
    YAML_NUMBER("multiplier", true, coupling_yaml, coupling.multiplier, -1e3, 1e3),
    YAML_NUMBER("offset_rad", false, coupling_yaml, coupling.offset, -1e3, 1e3),
    YAML_NUMBER("stiffness_nm_rad", false, coupling_yaml, coupling.stiffness, 1e-9, 1e9),
    YAML_NUMBER("damping_nm_s_rad", false, coupling_yaml, coupling.damping, 0.0, 1e9),
    YAML_NUMBER("offset_m", false, coupling_yaml, coupling.offset, -1e3, 1e3),
    YAML_NUMBER("stiffness_n_m", false, coupling_yaml, coupling.stiffness, 1e-9, 1e9),
    YAML_NUMBER("damping_n_s_m", false, coupling_yaml, coupling.damping, 0.0, 1e9),
};
YAML_TABLE(coupling, "a coupling", coupling_yaml);

static const struct yaml_field frame_fields[] = {
    YAML_TEXT("name", true, frame_yaml, frame.name, 1, 63),
    YAML_TEXT("body", true, frame_yaml, body, 1, 63),
    YAML_NUMBERS("xyz_m", true, frame_yaml, frame.position, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, frame_yaml, rpy, 3, -1e3, 1e3),
};
YAML_TABLE(frame, "a frame", frame_yaml);

static const struct yaml_field capsule_fields[] = {
    YAML_TEXT("name", true, capsule_yaml, capsule.name, 1, 63),
    YAML_TEXT("body", true, capsule_yaml, body, 1, 63),
    YAML_NUMBERS("xyz_m", true, capsule_yaml, capsule.position, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, capsule_yaml, rpy, 3, -1e3, 1e3),
    YAML_NUMBER("radius_m", false, capsule_yaml, capsule.radius, 1e-6, 1e3),
    YAML_NUMBER("length_m", false, capsule_yaml, capsule.length, 0.0, 1e3),
    {"flat", YAML_BOOL, false, .offset = AT(capsule_yaml, capsule.flat)},
    YAML_NUMBERS("half_extents_m", false, capsule_yaml, capsule.half, 3, 1e-6, 1e3),
};
YAML_TABLE(capsule, "a capsule", capsule_yaml);

const struct word robot_visual_shapes[] = {
    {"mesh", VISUAL_MESH},         {"box", VISUAL_BOX},         {"sphere", VISUAL_SPHERE},
    {"cylinder", VISUAL_CYLINDER}, {"capsule", VISUAL_CAPSULE}, {NULL, 0}};

static const struct yaml_field visual_fields[] = {
    YAML_TEXT("name", true, visual_yaml, visual.name, 1, 63),
    YAML_TEXT("body", true, visual_yaml, body, 1, 63),
    YAML_NUMBERS("xyz_m", false, visual_yaml, visual.position, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, visual_yaml, rpy, 3, -1e3, 1e3),
    {"shape", YAML_ENUM, true, AT(visual_yaml, visual.shape), .names = robot_visual_shapes},
    YAML_NUMBERS("half_extents_m", false, visual_yaml, visual.half, 3, DBL_MIN, 1e3),
    YAML_NUMBER("radius_m", false, visual_yaml, visual.radius, DBL_MIN, 1e3),
    YAML_NUMBER("length_m", false, visual_yaml, visual.length, 0.0, 1e3),
    {"file", YAML_STRING, false, AT(visual_yaml, file), .min = 1, .max = 255},
    {"missing", YAML_STRING, false, AT(visual_yaml, visual.missing), .min = 1, .max = 400},
    YAML_NUMBERS("color", false, visual_yaml, visual.color, 4, 0.0, 1.0),
};
YAML_TABLE(visual, "a visual", visual_yaml);

static const struct yaml_field ft_fields[] = {
    YAML_TEXT("name", true, ft_yaml, sensor.name, 1, 63),
    YAML_TEXT("frame", true, ft_yaml, frame, 1, 63),
    YAML_SECTION("distal", false, ft_yaml, sensor.distal, inertia_schema),
};
YAML_TABLE(ft, "a force-torque sensor", ft_yaml);

static const struct yaml_field imu_fields[] = {
    YAML_TEXT("frame", true, robot_yaml, imu_frame, 1, 63),
};
YAML_TABLE(imu, "the inertial sensor", robot_yaml, .unmarked = true);

static const struct yaml_field pose_fields[] = {
    YAML_NUMBERS("base_xyz_m", false, pose_yaml, pose.base_position, 3, -1e6, 1e6),
    YAML_NUMBERS("base_rpy_rad", false, pose_yaml, base_rpy, 3, -1e3, 1e3),
    {"joints_rad", YAML_REAL_DICT, false, AT(pose_yaml, joint_rad), AT(pose_yaml, njoint_rad),
     .min = -1e6, .max = 1e6},
    {"joints_m", YAML_REAL_DICT, false, AT(pose_yaml, joint_m), AT(pose_yaml, njoint_m),
     .min = -1e6, .max = 1e6},
};
YAML_TABLE(pose, "a pose", pose_yaml, .name_offset = AT(pose_yaml, pose.name));

static const struct word base_types[] = {{"floating", 1}, {"fixed", 0}, {NULL, 0}};

static const struct yaml_field base_fields[] = {
    {"type", YAML_ENUM, true, AT(robot_yaml, floating), .names = base_types},
    YAML_TEXT("body", true, robot_yaml, base, 1, 63),
};
YAML_TABLE(base, "the base", robot_yaml, .unmarked = true);

static const struct yaml_field variant_fields[] = {
    YAML_ENTRIES("bodies", YAML_LIST, false, variant_yaml, body, nbody, body_schema),
    YAML_ENTRIES("joints", YAML_LIST, false, variant_yaml, joint, njoint, joint_schema),
    YAML_ENTRIES("frames", YAML_LIST, false, variant_yaml, frame, nframe, frame_schema),
    YAML_ENTRIES("capsules", YAML_LIST, false, variant_yaml, capsule, ncapsule, capsule_schema),
    YAML_ENTRIES("ft_sensors", YAML_LIST, false, variant_yaml, ft, nft, ft_schema),
    YAML_SECTION("drive", false, variant_yaml, drive, robot_drive_schema),
    YAML_SECTION("passive", false, variant_yaml, passive, passive_schema),
};
YAML_TABLE(variant, "a variant", variant_yaml, .name_offset = AT(variant_yaml, name));

static const struct yaml_field robot_fields[] = {
    YAML_TEXT("name", true, robot_yaml, name, 1, 63),
    {"description", YAML_STRING, false, AT(robot_yaml, description), .min = 1, .max = 400},
    {"source", YAML_STRING, false, .offset = AT(robot_yaml, source)},
    YAML_NUMBERS("gravity_m_s2", true, robot_yaml, gravity, 3, -1e3, 1e3),
    {"base", YAML_MAP, true, .schema = &base_schema},
    YAML_SECTION("drive", false, robot_yaml, drive, robot_drive_schema),
    YAML_SECTION("hydraulic", false, robot_yaml, hydraulic, hydraulic_schema),
    YAML_SECTION("hydraulic_supply", false, robot_yaml, hydraulic_supply, hydraulic_supply_schema),
    YAML_SECTION("stops", false, robot_yaml, stops, robot_stops_schema),
    YAML_SECTION("passive", false, robot_yaml, passive, passive_schema),
    YAML_ENTRIES("bodies", YAML_LIST, true, robot_yaml, body, nbody, body_schema),
    YAML_ENTRIES("joints", YAML_LIST, false, robot_yaml, joint, njoint, joint_schema),
    YAML_ENTRIES("couplings", YAML_LIST, false, robot_yaml, coupling, ncoupling, coupling_schema),
    YAML_ENTRIES("frames", YAML_LIST, false, robot_yaml, frame, nframe, frame_schema),
    YAML_ENTRIES("capsules", YAML_LIST, false, robot_yaml, capsule, ncapsule, capsule_schema),
    YAML_ENTRIES("visuals", YAML_LIST, false, robot_yaml, visual, nvisual, visual_schema),
    YAML_ENTRIES("ft_sensors", YAML_LIST, false, robot_yaml, ft, nft, ft_schema),
    {"imu", YAML_MAP, false, .schema = &imu_schema},
    YAML_ENTRIES("poses", YAML_DICT, false, robot_yaml, pose, npose, pose_schema),
    YAML_ENTRIES("variants", YAML_DICT, false, robot_yaml, variant, nvariant, variant_schema),
};
const struct yaml_schema robot_file_schema =
    YAML_SCHEMA("a robot", struct robot_yaml, robot_fields, .hash_offset = AT(robot_yaml, hash),
                .format_version = 1);
