/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of a rig file: names, types, ranges and defaults, in tables for base/yaml.h. Those of
 * the section `sensors` are in sensors.c. */
#include "rig/schema.h"

#include "base/array.h"
#include "boards/protocol_list.h"
#include "canbus/lockstep.h"
#include "base/config.h"
#include "rig/rig.h"
#include "rt/recording/recorder.h"

#include <float.h>

#define AT(type, member) offsetof(struct type, member)

const struct word rig_integrator_words[] = {
    {"rk4", PLANT_RK4}, {"implicit", PLANT_IMPLICIT}, {"dopri5", PLANT_DOPRI5}, {NULL, 0}};
const struct word rig_dynamics_words[] = {
    {"fastest", RIG_DYNAMICS_FASTEST}, {"generic", RIG_DYNAMICS_GENERIC}, {NULL, 0}};
const struct word rig_engine_words[] = {
    {"none", RIG_CONTACT_NONE},
    {"native", RIG_CONTACT_NATIVE},
    {"simbody", RIG_CONTACT_SIMBODY},
    {NULL, 0},
};
const struct word rig_hold_words[] = {
    {"none", RIG_HOLD_NONE},
    {"until_enabled", RIG_HOLD_ENABLED},
    {"always", RIG_HOLD_ALWAYS},
    {NULL, 0},
};
const struct word rig_wire_words[] = {{"ideal", 0}, {"wire", 1}, {NULL, 0}};
static const struct word mesh_law_names[] = {
    {"pressure_field", CONTACT_PRESSURE_FIELD},
    {"elastic_foundation", CONTACT_ELASTIC_FOUNDATION},
    {NULL, 0},
};
static const struct word friction_names[] = {
    {"sticking", CONTACT_FRICTION_STICKING},
    {"regularized", CONTACT_FRICTION_REGULARIZED},
    {NULL, 0},
};
static const struct word shape_names[] = {
    {"half_space", CONTACT_HALF_SPACE},
    {"sphere", CONTACT_SPHERE},
    {"box", CONTACT_BOX},
    {"mesh", CONTACT_MESH},
    {"capsule", CONTACT_CAPSULE},
    {NULL, 0},
};
static const struct word kind_names[] = {
    {"motor", BOARD_MOTOR},       {"ft", BOARD_FT}, {"torque", BOARD_TORQUE},
    {"inertial", BOARD_INERTIAL}, {NULL, 0},
};
static const struct word follows_names[] = {{"position", 0}, {"torque", 1}, {NULL, 0}};

static const struct word wire_pace_names[] = {{"none", 0}, {"wire", 1}, {NULL, 0}};
static const struct word wire_order_names[] = {{"priority", 0}, {"fifo", 1}, {NULL, 0}};

static const struct yaml_field spring_fields[] = {
    {"Ks_nm_rad", YAML_REAL, true, AT(raw_spring, Ks_nm_rad), .min = 0.0, .max = 1e9},
    {"Ds_nm_s_rad", YAML_REAL, true, AT(raw_spring, Ds_nm_s_rad), .min = 0.0, .max = 1e9},
};
static const struct yaml_schema spring_schema = YAML_SCHEMA(
    "a series spring", struct raw_spring, spring_fields, .name_offset = AT(raw_spring, joint));

static const struct yaml_field robot_fields[] = {
    {"file", YAML_STRING, true, .offset = AT(raw_robot, file)},
    {"variant", YAML_STRING, false, .offset = AT(raw_robot, variant)},
    {"fixed_base", YAML_BOOL, false, .offset = AT(raw_robot, fixed_base)},
    {"springs", YAML_DICT, false, AT(raw_robot, spring), AT(raw_robot, nspring),
     .schema = &spring_schema},
    {"added_mass_kg", YAML_REAL_DICT, false, AT(raw_robot, mass), AT(raw_robot, nmass), .min = -1e3,
     .max = 1e3},
};
static const struct raw_robot robot_defaults = {.variant = ""};
static const struct yaml_schema robot_schema =
    YAML_SCHEMA("the robot", struct raw_robot, robot_fields, .defaults = &robot_defaults);

static const struct yaml_field initial_fields[] = {
    {"pose", YAML_STRING, true, .offset = AT(raw_initial, pose)},
    {"base_xyz_m", YAML_REALS, false, AT(raw_initial, base_xyz_m), .count = 3, .min = -1e3,
     .max = 1e3},
    {"base_height_m", YAML_REAL, false, AT(raw_initial, base_height_m), .min = -1e3, .max = 1e3},
    {"base_rpy_rad", YAML_REALS, false, AT(raw_initial, base_rpy_rad), .count = 3, .min = -7.0,
     .max = 7.0},
    {"joints_rad", YAML_REAL_DICT, false, AT(raw_initial, joint),
     .count_offset = AT(raw_initial, njoint)},
    {"hold", YAML_ENUM, false, AT(raw_initial, hold), .names = rig_hold_words},
    {"settle", YAML_BOOL, false, .offset = AT(raw_initial, settle)},
};
static const struct yaml_schema initial_schema =
    YAML_SCHEMA("the initial state", struct raw_initial, initial_fields);

static const struct yaml_field material_fields[] = {
    {"young_pa", YAML_REAL, true, AT(raw_material, material.young_pa), .min = 1.0, .max = 1e12},
    {"thickness_m", YAML_REAL, true, AT(raw_material, material.thickness_m), .min = 1e-6,
     .max = 1.0},
    {"backing_pa_per_m", YAML_REAL, false, AT(raw_material, material.backing_pa_per_m), .min = 0.0,
     .max = 1e12},
    {"dissipation_s_per_m", YAML_REAL, true, AT(raw_material, material.dissipation_s_per_m),
     .min = 0.0, .max = 1e4},
    {"static_friction", YAML_REAL, true, AT(raw_material, material.static_friction), .min = 0.0,
     .max = 100.0},
    {"dynamic_friction", YAML_REAL, true, AT(raw_material, material.dynamic_friction), .min = 0.0,
     .max = 100.0},
    {"viscous_s_per_m", YAML_REAL, true, AT(raw_material, material.viscous_friction), .min = 0.0,
     .max = 100.0},
};
static const struct yaml_schema material_schema = YAML_SCHEMA(
    "a material", struct raw_material, material_fields, .name_offset = AT(raw_material, name));

static const struct yaml_field surface_fields[] = {
    {"name", YAML_STRING, true, AT(raw_surface, surface.name), .min = 1, .max = 63},
    {"body", YAML_STRING, false, .offset = AT(raw_surface, body)},
    {"frame", YAML_STRING, false, .offset = AT(raw_surface, frame)},
    {"shape", YAML_ENUM, true, AT(raw_surface, surface.shape), .names = shape_names},
    {"xyz_m", YAML_REALS, false, AT(raw_surface, xyz_m), .count = 3, .min = -1e3, .max = 1e3},
    {"rpy_rad", YAML_REALS, false, AT(raw_surface, rpy_rad), .count = 3, .min = -7.0, .max = 7.0},
    {"radius_m", YAML_REAL, false, AT(raw_surface, surface.radius_m), .min = 1e-6, .max = 1e3},
    {"length_m", YAML_REAL, false, AT(raw_surface, surface.length_m), .min = 0.0, .max = 1e3},
    {"half_extents_m", YAML_REALS, false, AT(raw_surface, surface.half_extent_m), .count = 3,
     .min = 1e-6, .max = 1e3},
    {"cells", YAML_INT, false, AT(raw_surface, surface.cells_per_edge), .count = sizeof(int),
     .min = 1, .max = 200},
    {"mesh", YAML_STRING, false, .offset = AT(raw_surface, mesh)},
    {"material", YAML_STRING, true, .offset = AT(raw_surface, material)},
};
static const struct raw_surface surface_defaults = {.surface.cells_per_edge = 7};
static const struct yaml_schema surface_schema =
    YAML_SCHEMA("a surface", struct raw_surface, surface_fields, .defaults = &surface_defaults);

static const struct yaml_field body_fields[] = {
    {"name", YAML_STRING, true, AT(raw_body, body.name), .min = 1, .max = 63},
    {"static", YAML_BOOL, false, .offset = AT(raw_body, is_static)},
    {"mass_kg", YAML_REAL, false, AT(raw_body, body.inertia.mass), .min = DBL_MIN, .max = 1e6},
    {"com_m", YAML_REALS, false, AT(raw_body, body.inertia.com), .count = 3, .min = -1e3,
     .max = 1e3},
    {"inertia_kg_m2", YAML_REALS, false, AT(raw_body, body.inertia.I), .count = 6, .min = -1e9,
     .max = 1e9},
    {"box_m", YAML_REALS, false, AT(raw_body, box_m), .count = 3, .min = 1e-6, .max = 1e3},
    {"xyz_m", YAML_REALS, false, AT(raw_body, body.position), .count = 3, .min = -1e3, .max = 1e3},
    {"rpy_rad", YAML_REALS, false, AT(raw_body, rpy_rad), .count = 3, .min = -7.0, .max = 7.0},
    {"velocity_m_s", YAML_REALS, false, AT(raw_body, body.v), .count = 3, .min = -1e3, .max = 1e3},
    {"rate_rad_s", YAML_REALS, false, AT(raw_body, body.w), .count = 3, .min = -1e3, .max = 1e3},
};
static const struct yaml_schema body_schema =
    YAML_SCHEMA("a body of the scene", struct raw_body, body_fields);

static const struct yaml_field pair_fields[] = {
    {"between", YAML_NAME_LIST, true, .offset = AT(raw_pair, between),
     .count_offset = AT(raw_pair, nbetween)},
};
static const struct yaml_schema pair_schema =
    YAML_SCHEMA("a pair of surfaces", struct raw_pair, pair_fields);

static const struct yaml_field exclude_fields[] = {
    {"between", YAML_NAME_LIST, true, .offset = AT(raw_pair, between),
     .count_offset = AT(raw_pair, nbetween)},
    {"reason", YAML_STRING, false, .offset = AT(raw_pair, reason)},
};
static const struct yaml_schema exclude_schema =
    YAML_SCHEMA("a pair of surfaces to leave out", struct raw_pair, exclude_fields);

static const struct yaml_field robot_surfaces_fields[] = {
    {"material", YAML_STRING, true, .offset = AT(raw_robot_surfaces, material)},
    {"self_collision", YAML_BOOL, false, .offset = AT(raw_robot_surfaces, self_collision)},
    {"exclude", YAML_LIST, false, AT(raw_robot_surfaces, exclude), AT(raw_robot_surfaces, nexclude),
     .schema = &exclude_schema},
};
static const struct raw_robot_surfaces robot_surfaces_defaults = {.self_collision = true};
static const struct yaml_schema robot_surfaces_schema =
    YAML_SCHEMA("the surfaces of the robot", struct raw_robot_surfaces, robot_surfaces_fields,
                .defaults = &robot_surfaces_defaults);

static const struct yaml_field scene_fields[] = {
    {"engine", YAML_ENUM, true, AT(raw_scene, engine), .names = rig_engine_words},
    {"friction", YAML_ENUM, false, AT(raw_scene, contact.friction), .names = friction_names},
    {"transition_velocity_m_s", YAML_REAL, false, AT(raw_scene, contact.transition_velocity_m_s),
     .min = 1e-6, .max = 10.0},
    {"mesh_law", YAML_ENUM, false, AT(raw_scene, contact.mesh_law), .names = mesh_law_names},
    {"materials", YAML_DICT, false, AT(raw_scene, material), AT(raw_scene, nmaterial),
     .schema = &material_schema},
    {"bodies", YAML_LIST, false, AT(raw_scene, body), AT(raw_scene, nbody), .schema = &body_schema},
    {"surfaces", YAML_LIST, false, AT(raw_scene, surface), AT(raw_scene, nsurface),
     .schema = &surface_schema},
    {"pairs", YAML_LIST, false, AT(raw_scene, pair), AT(raw_scene, npair), .schema = &pair_schema},
    {"robot_surfaces", YAML_MAP, false, AT(raw_scene, robot_surfaces),
     .schema = &robot_surfaces_schema},
};
static const struct raw_scene scene_defaults = {.engine = RIG_CONTACT_NONE,
                                                .contact.transition_velocity_m_s = 0.01,
                                                .contact.mesh_law = CONTACT_PRESSURE_FIELD};
static const struct yaml_schema scene_schema =
    YAML_SCHEMA("the scene", struct raw_scene, scene_fields, .defaults = &scene_defaults);

static const struct yaml_field board_fields[] = {
    {"name", YAML_STRING, false, AT(raw_board, board.name), .min = 1, .max = 63},
    {"kind", YAML_ENUM, true, AT(raw_board, board.kind), .names = kind_names},
    {"address", YAML_INT, true, AT(raw_board, address), .min = 1, .max = 31},
    {"axes", YAML_NAME_LIST, false, .offset = AT(raw_board, axis),
     .count_offset = AT(raw_board, naxis)},
    {"current_limit_a", YAML_REAL, false, AT(raw_board, current_limit_a), .min = DBL_MIN,
     .max = 1e3},
    {"joints", YAML_NAME_LIST, false, .offset = AT(raw_board, joint),
     .count_offset = AT(raw_board, njoint)},
    {"sensor", YAML_STRING, false, .offset = AT(raw_board, sensor)},
    {"full_scale_n", YAML_REALS, false, AT(raw_board, board.full_scale), .count = 3, .min = 1,
     .max = 65535},
    {"full_scale_nm", YAML_REALS, false, AT(raw_board, board.full_scale[3]), .count = 3, .min = 1,
     .max = 65535},
    {"period_s", YAML_REAL, false, AT(raw_board, board.period_ns), .ns = true, .min = 0.001,
     .max = 0.255},
    {"transmit_at_start", YAML_BOOL, false, .offset = AT(raw_board, board.transmit_at_start)},
    {"external", YAML_BOOL, false, .offset = AT(raw_board, board.external)},
    {"external_follows", YAML_ENUM, false, AT(raw_board, external_torque), .names = follows_names},
    {"external_timeout_s", YAML_REAL, false, AT(raw_board, board.external_timeout_ns), .ns = true,
     .min = 0.001, .max = 60.0},
};
static const struct raw_board board_defaults = {.board.period_ns = 1000000,
                                                .board.external_timeout_ns = 20000000};
static const struct yaml_schema board_schema =
    YAML_SCHEMA("a board", struct raw_board, board_fields, .defaults = &board_defaults);

static const struct yaml_field bus_fields[] = {
    {"name", YAML_STRING, true, AT(raw_bus, bus.name), .min = 1, .max = 63},
    {"interface", YAML_STRING, true, AT(raw_bus, bus.interface), .min = 1, .max = 15},
    {"bitrate", YAML_INT, false, AT(raw_bus, bus.bitrate), .min = 10000, .max = 1000000},
    {"fd", YAML_BOOL, false, .offset = AT(raw_bus, bus.fd)},
    {"data_bitrate", YAML_INT, false, AT(raw_bus, bus.data_bitrate), .min = 10000, .max = 8000000},
    {"personality", YAML_ENUM, false, AT(raw_bus, personality), .names = protocol_words},
    {"protocol", YAML_STRING, false, AT(raw_bus, protocol), .min = 1, .max = 400},
    {"padded_frames", YAML_BOOL, false, .offset = AT(raw_bus, padded)},
    {"configure", YAML_BOOL, false, .offset = AT(raw_bus, bus.configure)},
    {"sample_point", YAML_REAL, false, AT(raw_bus, bus.sample_point), .min = 0.5, .max = 0.95},
    {"restart_ms", YAML_INT, false, AT(raw_bus, bus.restart_ms), .min = 0, .max = 60000},
    {"boards", YAML_LIST, true, AT(raw_bus, board), AT(raw_bus, bus.nboard),
     .schema = &board_schema, .entry_key = "address"},
};
static const struct raw_bus bus_defaults = {.bus.bitrate = 1000000};
static const struct yaml_schema bus_schema =
    YAML_SCHEMA("a bus", struct raw_bus, bus_fields, .defaults = &bus_defaults);

static const struct yaml_field switches_fields[] = {
    {"negative_limit_rad", YAML_REAL, false, AT(raw_switches, switches.negative_rad), .min = -1e3,
     .max = 1e3},
    {"positive_limit_rad", YAML_REAL, false, AT(raw_switches, switches.positive_rad), .min = -1e3,
     .max = 1e3},
    {"home_rad", YAML_REALS, false, AT(raw_switches, switches.home_rad), .count = 2, .min = -1e3,
     .max = 1e3},
    {"index_pulse", YAML_BOOL, false, .offset = AT(raw_switches, index_pulse)},
};
static const struct yaml_schema switches_schema =
    YAML_SCHEMA("the switches of a joint", struct raw_switches, switches_fields,
                .name_offset = AT(raw_switches, joint));

static const struct yaml_field motors_fields[] = {
    {"joint_ticks_per_rev", YAML_REAL, true, AT(raw_motors, joint_ticks_per_rev), .min = 1.0,
     .max = 1e9},
    {"motor_ticks_per_link_rev", YAML_REAL, true, AT(raw_motors, motor_ticks_per_link_rev),
     .min = 1.0, .max = 1e9},
    {"torque_full_scale_nm", YAML_REAL, true, AT(raw_motors, axis.torque_full_scale_nm), .min = 1,
     .max = 65535},
    {"current_limit_a", YAML_REAL, true, AT(raw_motors, axis.current_limit_a), .min = DBL_MIN,
     .max = 1e3},
    {"temperature_limit_c", YAML_REAL, false, AT(raw_motors, axis.temperature_limit_c), .min = 0.0,
     .max = 125.0},
    {"command_timeout_s", YAML_REAL, false, AT(raw_motors, board.command_timeout_ns), .ns = true,
     .min = 0.0, .max = 60.0},
    {"rotor_poles", YAML_INT, false, AT(raw_motors, rotor_poles), .count = sizeof(int), .min = 2,
     .max = 126},
    {"status_period_s", YAML_REAL, false, AT(raw_motors, board.status_period_ns), .ns = true,
     .min = 0.0, .max = 10.0},
    {"boot_s", YAML_REAL, false, AT(raw_motors, board.boot_ns), .ns = true, .min = 0.0,
     .max = 60.0},
    {"strict", YAML_BOOL, false, .offset = AT(raw_motors, board.strict)},
    {"require_calibration", YAML_BOOL, false, .offset = AT(raw_motors, board.require_calibration)},
    {"keep_firmware", YAML_BOOL, false, .offset = AT(raw_motors, board.keep_firmware)},
    {"discovery_stops_motors", YAML_BOOL, false,
     .offset = AT(raw_motors, board.discovery_stops_motors)},
    {"switches", YAML_DICT, false, AT(raw_motors, switches), AT(raw_motors, nswitches),
     .schema = &switches_schema},
};
static const struct raw_motors motors_defaults = {
    .rotor_poles = 8, .board.command_timeout_ns = 100000000, .axis.temperature_limit_c = 70.0};
static const struct yaml_schema motors_schema =
    YAML_SCHEMA("the motor boards", struct raw_motors, motors_fields, .defaults = &motors_defaults);

static const struct yaml_field wire_fields[] = {
    {"mode", YAML_ENUM, false, AT(raw_wire, mode), .names = rig_wire_words},
    {"pace", YAML_ENUM, false, AT(raw_wire, pace), .names = wire_pace_names},
    {"order", YAML_ENUM, false, AT(raw_wire, order), .names = wire_order_names},
};
static const struct yaml_schema wire_schema = YAML_SCHEMA("the wire", struct raw_wire, wire_fields);

static const struct yaml_field lockstep_fields[] = {
    {"bus", YAML_STRING, false, .offset = AT(raw_lockstep, bus)},
    {"step_id", YAML_INT, false, AT(raw_lockstep, lockstep.step_id), .count = sizeof(int), .min = 0,
     .max = 0x7ff},
    {"done_id", YAML_INT, false, AT(raw_lockstep, lockstep.done_id), .count = sizeof(int), .min = 0,
     .max = 0x7ff},
    {"partner_timeout_s", YAML_REAL, false, AT(raw_lockstep, lockstep.partner_timeout_ns),
     .ns = true, .min = 0.01, .max = 3600.0},
};
static const struct raw_lockstep lockstep_defaults = {
    .lockstep = {.step_id = LOCKSTEP_STEP_ID,
                 .done_id = LOCKSTEP_DONE_ID,
                 .partner_timeout_ns = 1000000000}};
static const struct yaml_schema lockstep_schema =
    YAML_SCHEMA("lockstep", struct raw_lockstep, lockstep_fields, .defaults = &lockstep_defaults);

static const struct yaml_field realtime_fields[] = {
    {"priority", YAML_INT, false, AT(rig_realtime, priority), .count = sizeof(int), .min = 0,
     .max = 99},
    {"cpu", YAML_INT, false, AT(rig_realtime, cpu), .count = sizeof(int), .min = -1, .max = 1023},
    {"lock_memory", YAML_BOOL, false, .offset = AT(rig_realtime, lock_memory)},
    {"overrun", YAML_ENUM, false, AT(rig_realtime, overrun), .names = loop_overrun_words},
};
static const struct rig_realtime realtime_defaults = {
    .priority = 80, .cpu = -1, .lock_memory = true, .overrun = LOOP_OVERRUN_SKIP};
static const struct yaml_schema realtime_schema =
    YAML_SCHEMA("the real-time settings", struct rig_realtime, realtime_fields, .unmarked = true,
                .defaults = &realtime_defaults);

static const struct yaml_field record_fields[] = {
    {"directory", YAML_STRING, false, AT(rig_record, directory), .min = 1, .max = 4000},
    {"format", YAML_ENUM, false, AT(rig_record, format), .names = recorder_format_words},
};
static const struct rig_record record_defaults = {.format = RECORDER_CSV};
static const struct yaml_schema record_schema = YAML_SCHEMA(
    "the record", struct rig_record, record_fields, .unmarked = true, .defaults = &record_defaults);

static const struct yaml_field page_fields[] = {
    {"listen", YAML_STRING, true, AT(rig_page, listen), .min = 1, .max = 80},
};
static const struct yaml_schema page_schema =
    YAML_SCHEMA("the page", struct rig_page, page_fields, .unmarked = true);

static const struct yaml_field gains_fields[] = {
    {"joints", YAML_NAME_LIST, true, .offset = AT(raw_gains, joint),
     .count_offset = AT(raw_gains, njoint)},
    {"kp_v_per_rad", YAML_REAL, false, AT(raw_gains, gains.kp_v_per_rad), .min = 0.0, .max = 1e6},
    {"ki_v_per_rad_s", YAML_REAL, false, AT(raw_gains, gains.ki_v_per_rad_s), .min = 0.0,
     .max = 1e6},
    {"kd_v_s_per_rad", YAML_REAL, false, AT(raw_gains, gains.kd_v_s_per_rad), .min = 0.0,
     .max = 1e6},
    {"kw_v_s_per_rad", YAML_REAL, false, AT(raw_gains, gains.kw_v_s_per_rad), .min = 0.0,
     .max = 1e6},
    {"trim_per_s", YAML_REAL, false, AT(raw_gains, gains.trim_per_s), .min = 0.0, .max = 1e3},
    {"sway_damping_per_s", YAML_REAL, false, AT(raw_gains, gains.sway_damping_per_s), .min = 0.0,
     .max = 1e3},
    {"limit_v", YAML_REAL, false, AT(raw_gains, gains.limit_v), .min = DBL_MIN, .max = 1e4},
    {"load_v_per_nm", YAML_REAL, false, AT(raw_gains, gains.load_v_per_nm), .min = 0.0, .max = 1e4},
};
const struct yaml_schema gains_schema =
    YAML_SCHEMA("the gains of some joints", struct raw_gains, gains_fields);

static const struct yaml_field servo_fields[] = {
    {"kp_v_per_rad", YAML_REAL, true, AT(raw_servo, gains.kp_v_per_rad), .min = 0.0, .max = 1e6},
    {"ki_v_per_rad_s", YAML_REAL, true, AT(raw_servo, gains.ki_v_per_rad_s), .min = 0.0,
     .max = 1e6},
    {"kd_v_s_per_rad", YAML_REAL, false, AT(raw_servo, gains.kd_v_s_per_rad), .min = 0.0,
     .max = 1e6},
    {"kw_v_s_per_rad", YAML_REAL, true, AT(raw_servo, gains.kw_v_s_per_rad), .min = 0.0,
     .max = 1e6},
    {"trim_per_s", YAML_REAL, false, AT(raw_servo, gains.trim_per_s), .min = 0.0, .max = 1e3},
    {"sway_damping_per_s", YAML_REAL, false, AT(raw_servo, gains.sway_damping_per_s), .min = 0.0,
     .max = 1e3},
    {"limit_v", YAML_REAL, false, AT(raw_servo, gains.limit_v), .min = DBL_MIN, .max = 1e4},
    {"load_v_per_nm", YAML_REAL, false, AT(raw_servo, gains.load_v_per_nm), .min = 0.0, .max = 1e4},
    {"others", YAML_LIST, false, AT(raw_servo, other), AT(raw_servo, nother),
     .schema = &gains_schema},
    {"command_period_s", YAML_REAL, true, AT(raw_servo, command_period_s), .min = 1e-5, .max = 1.0},
};
static const struct yaml_schema servo_schema =
    YAML_SCHEMA("the servo", struct raw_servo, servo_fields);

static const struct yaml_field squat_fields[] = {
    {"thigh_m", YAML_REAL, true, AT(squat_config, thigh_m), .min = 0.01, .max = 10.0},
    {"shank_m", YAML_REAL, true, AT(squat_config, shank_m), .min = 0.01, .max = 10.0},
    {"depth_m", YAML_REAL, true, AT(squat_config, depth_m), .min = 0.0, .max = 10.0},
    {"period_s", YAML_REAL, true, AT(squat_config, period_s), .min = 0.1, .max = 1e3},
    {"cycles", YAML_INT, true, AT(squat_config, cycles), .count = sizeof(int), .min = 1,
     .max = 1e6},
};
static const struct yaml_schema squat_schema =
    YAML_SCHEMA("the squat", struct squat_config, squat_fields, .unmarked = true);

static const struct yaml_field phase_fields[] = {
    {"name", YAML_STRING, true, AT(grasp_phase, name), .min = 1, .max = 31},
    {"until_s", YAML_REAL, true, AT(grasp_phase, until_s), .min = DBL_MIN, .max = 1e3},
    {"arm_rad", YAML_REALS, true, AT(grasp_phase, arm_rad), .count = GRASP_JOINTS, .min = -7.0,
     .max = 7.0},
    {"closed", YAML_BOOL, false, .offset = AT(grasp_phase, closed)},
};
static const struct yaml_schema phase_schema =
    YAML_SCHEMA("a phase", struct grasp_phase, phase_fields, .unmarked = true);

static const struct yaml_field grasp_fields[] = {
    {"settle_s", YAML_REAL, true, AT(grasp_config, settle_s), .min = 0.1, .max = 1e3},
    {"path", YAML_LIST, true, AT(grasp_config, phase), AT(grasp_config, nphase),
     .schema = &phase_schema},
    {"hold_s", YAML_REAL, true, AT(grasp_config, hold_s), .min = 0.0, .max = 1e3},
    {"least_press_n", YAML_REAL, true, AT(grasp_config, least_press_n), .min = 0.0, .max = 1e6},
    {"least_carry_n", YAML_REAL, true, AT(grasp_config, least_carry_n), .min = 0.0, .max = 1e6},
};
static const struct yaml_schema grasp_schema =
    YAML_SCHEMA("the grasp", struct grasp_config, grasp_fields, .unmarked = true);

static const struct yaml_field hold_fields[] = {
    {"duration_s", YAML_REAL, false, AT(hold_config, duration_s), .min = 0.0, .max = 1e6},
    {"tolerance_rad", YAML_REAL, false, AT(hold_config, tolerance_rad), .min = 1e-6, .max = 10.0},
};
static const struct hold_config hold_defaults = {.duration_s = 10.0, .tolerance_rad = 0.05};
static const struct yaml_schema hold_schema = YAML_SCHEMA(
    "the hold task", struct hold_config, hold_fields, .unmarked = true, .defaults = &hold_defaults);

/* A number of the walk: the member of a struct in struct raw_walk that has the key's name. */
#define WALK(must, of, key, low, high)                                                             \
    {                                                                                              \
#key, YAML_REAL, must, AT(raw_walk, of.key), .min = low, .max = high                       \
    }
static const struct yaml_field walk_fields[] = {
    WALK(true, config, begin_s, 0.0, 1e3),
    {"steps", YAML_INT, true, AT(raw_walk, config.steps), .min = 0, .max = 1e9},
    WALK(false, config, distance_m, 0.0, 1e6),
    WALK(true, config, forward_m_s, -2.0, 2.0),
    WALK(true, config, left_m_s, -2.0, 2.0),
    WALK(true, config, turn_rad_s, -2.0, 2.0),
    WALK(true, config.balance.estimate, attitude_per_s, 0.0, 1e3),
    WALK(false, config.balance.estimate, lean_per_s, 0.0, 1.0),
    WALK(true, config.balance.estimate, com_per_s, 0.0, 200.0),
    WALK(false, config.balance.estimate, com_walking_per_s, 0.0, 200.0),
    WALK(false, config.balance.estimate, com_walking_m_s, 0.0, 2.0),
    WALK(true, config.balance.estimate, loaded_n, 1.0, 1e4),
    WALK(true, config.balance.gait, swing_s, 0.05, 10.0),
    WALK(true, config.balance.gait, transfer_s, 0.01, 10.0),
    WALK(true, config.balance.gait, start_s, 0.1, 10.0),
    WALK(true, config.balance.gait, clearance_m, 0.0, 0.5),
    WALK(true, config.balance.gait, width_m, 0.01, 2.0),
    WALK(true, config.balance.gait, least_width_m, 0.0, 2.0),
    WALK(true, config.balance.gait, zmp_ahead_m, -1.0, 1.0),
    WALK(true, config.balance.gait, zmp_inward_m, -1.0, 1.0),
    WALK(true, config.balance.gait, reach_ahead_m, 0.0, 2.0),
    WALK(true, config.balance.gait, reach_back_m, 0.0, 2.0),
    WALK(true, config.balance.gait, reach_out_m, 0.0, 2.0),
    WALK(true, config.balance.gait, adjust, 0.0, 1.0),
    WALK(true, config.balance.gait, ankle_m, 0.0, 1.0),
    WALK(true, config.balance.gait, lower_m_s, 0.001, 10.0),
    WALK(true, config.balance.gait, lower_m, 0.0, 1.0),
    WALK(true, config.balance.gait, press_n, 1.0, 1e4),
    WALK(true, config.balance.gait, ground_follow, 0.0, 1.0),
    WALK(true, config.balance.gait, tilt_s, 0.0, 10.0),
    WALK(true, servo, kp_v_per_rad, 0.0, 1e6),
    WALK(true, servo, kd_v_s_per_rad, 0.0, 1e6),
    WALK(true, servo, kw_v_s_per_rad, 0.0, 1e6),
    WALK(true, servo, load_v_per_nm, 0.0, 1e4),
    WALK(true, servo, torque_limit_nm, 0.0, 1e4),
    {"others", YAML_LIST, false, AT(raw_walk, other), AT(raw_walk, nother),
     .schema = &gains_schema},
    WALK(true, config.balance, ankle_roll_kp_v_per_rad, 0.0, 1e6),
    WALK(true, config.balance, pelvis_height_m, 0.01, 10.0),
    WALK(true, config.balance, lean_rad, -1.0, 1.0),
    WALK(true, config.balance.gait, sole_front_m, 0.0, 1.0),
    WALK(true, config.balance.gait, sole_back_m, -1.0, 0.0),
    WALK(true, config.balance.gait, sole_side_m, 0.0, 1.0),
    WALK(true, config.balance.gait, sole_margin_m, 0.0, 1.0),
    WALK(false, config.balance.gait, catch_swing_s, 0.0, 10.0),
    WALK(false, config.balance.gait, catch_margin_m, -1.0, 1.0),
    WALK(false, config.balance.gait, catch_reach_m, 0.0, 2.0),
    WALK(false, config.balance.gait, catch_clearance_m, 0.0, 0.5),
    WALK(true, config.balance, touch_n, 0.0, 1e4),
    WALK(true, config.balance, touch_s, 0.0, 1.0),
    WALK(true, config.balance, flat_n, 1.0, 1e4),
    WALK(true, config.balance, height_s, 0.0, 10.0),
    WALK(true, config.balance, dcm_gain, 1.0, 10.0),
    WALK(true, config.balance, cop_pitch_rad_s_nm, 0.0, 1.0),
    WALK(true, config.balance, cop_roll_rad_s_nm, 0.0, 1.0),
    WALK(true, config.balance, land_turn_rad_s_nm, 0.0, 10.0),
    WALK(true, config.balance, cop_leak_per_s, 0.0, 100.0),
    WALK(true, config.balance, force_m_s_n, 0.0, 0.1),
    WALK(true, config.balance, force_leak_per_s, 0.0, 100.0),
    WALK(true, config.balance, swing_follow, 0.0, 1.0),
    WALK(true, config.balance, carry_s, 0.0, 1.0),
    WALK(true, config.balance, swing_torque, 0.0, 4.0),
    WALK(true, config.balance, ankle_follow, 0.0, 1.0),
};

static const struct yaml_schema walk_schema = YAML_SCHEMA("the walk", struct raw_walk, walk_fields);

static const struct yaml_field tasks_fields[] = {
    {"servo", YAML_MAP, false, AT(raw_rig, servo), .schema = &servo_schema},
    {"squat", YAML_MAP, false, AT(raw_rig, rig.squat), .schema = &squat_schema},
    {"grasp", YAML_MAP, false, AT(raw_rig, rig.grasp), .schema = &grasp_schema},
    {"hold", YAML_MAP, false, AT(raw_rig, rig.hold_task), .schema = &hold_schema},
    {"walk", YAML_MAP, false, AT(raw_rig, walk), .schema = &walk_schema},
};
static const struct yaml_schema tasks_schema =
    YAML_SCHEMA("the tasks", struct raw_rig, tasks_fields, .unmarked = true);

static const struct yaml_field chopper_fields[] = {
    {"on_v", YAML_REAL, true, AT(raw_rig, rig.supply_bus.on_v), .min = DBL_MIN, .max = 1e4},
    {"off_v", YAML_REAL, true, AT(raw_rig, rig.supply_bus.off_v), .min = DBL_MIN, .max = 1e4},
    {"ohm", YAML_REAL, true, AT(raw_rig, rig.supply_bus.brake_ohm), .min = 1e-3, .max = 1e6},
};
static const struct yaml_schema chopper_schema =
    YAML_SCHEMA("a brake chopper", struct raw_rig, chopper_fields, .unmarked = true);

static const struct yaml_field rig_fields[] = {
    {"name", YAML_STRING, true, AT(raw_rig, rig.name), .min = 1, .max = 63},
    {"description", YAML_STRING, false, AT(raw_rig, description), .min = 1, .max = 400},
    {"robot", YAML_MAP, true, AT(raw_rig, robot), .schema = &robot_schema},
    {"clock", YAML_ENUM, false, AT(raw_rig, rig.clock), .names = loop_clock_words},
    {"tick_s", YAML_REAL, false, AT(raw_rig, tick_s), .min = 1e-5, .max = 0.1},
    {"substep_s", YAML_REAL, false, AT(raw_rig, substep_s), .min = 1e-7, .max = 1.0},
    {"integrator", YAML_ENUM, false, AT(raw_rig, rig.integrator), .names = rig_integrator_words},
    {"tolerance", YAML_REAL, false, AT(raw_rig, rig.tolerance), .min = 1e-13, .max = 0.1},
    {"dynamics", YAML_ENUM, false, AT(raw_rig, rig.dynamics), .names = rig_dynamics_words},
    {"personality", YAML_ENUM, false, AT(raw_rig, personality), .names = protocol_words},
    {"protocol", YAML_STRING, false, AT(raw_rig, protocol), .min = 1, .max = 400},
    {"supply_v", YAML_REAL, true, AT(raw_rig, rig.supply_v), .min = DBL_MIN, .max = 1e4},
    {"initial", YAML_MAP, true, AT(raw_rig, initial), .schema = &initial_schema},
    {"scene", YAML_MAP, false, AT(raw_rig, scene), .schema = &scene_schema},
    {"motors", YAML_MAP, true, AT(raw_rig, motors), .schema = &motors_schema},
    {"buses", YAML_LIST, true, AT(raw_rig, bus), AT(raw_rig, rig.nbus), .schema = &bus_schema,
     .entry_key = "name"},
    {"undriven", YAML_NAME_LIST, false, .offset = AT(raw_rig, undriven),
     .count_offset = AT(raw_rig, nundriven)},
    {"wire", YAML_MAP, false, AT(raw_rig, wire), .schema = &wire_schema},
    {"lockstep", YAML_MAP, false, AT(raw_rig, lockstep), .schema = &lockstep_schema},
    {"realtime", YAML_MAP, false, AT(raw_rig, rig.realtime), .schema = &realtime_schema},
    {"record", YAML_MAP, false, AT(raw_rig, rig.record), .schema = &record_schema},
    {"page", YAML_MAP, false, AT(raw_rig, rig.page), .schema = &page_schema},
    {"tasks", YAML_MAP, false, .schema = &tasks_schema},
    {"sensors", YAML_MAP, false, AT(raw_rig, sensors), .schema = &rig_sensors_schema},
    {"faults", YAML_NAME_LIST, false, .offset = AT(raw_rig, rig.fault),
     .count_offset = AT(raw_rig, rig.nfault)},
    {"seed", YAML_INT, false, AT(raw_rig, rig.seed), .min = 0, .max = 9e15},
    {"voltage_delay_s", YAML_REAL, false, AT(raw_rig, voltage_delay_s), .min = 0.0, .max = 0.1},
    {"supply_ohm", YAML_REAL, false, AT(raw_rig, rig.supply_ohm), .min = 0.0, .max = 1e3},
    {"supply_capacitance_f", YAML_REAL, false, AT(raw_rig, rig.supply_bus.capacitance_f),
     .min = 1e-4, .max = 1e3},
    {"supply_returns", .type = YAML_BOOL, .offset = AT(raw_rig, rig.supply_bus.returns)},
    {"brake_chopper", YAML_MAP, false, .schema = &chopper_schema},
};
static const struct raw_rig rig_defaults = {
    .tick_s = 0.001,
    .rig = {.clock = LOOP_CLOCK_REAL, .integrator = PLANT_IMPLICIT, .tolerance = 1e-9}};
const struct yaml_schema rig_file_schema = YAML_SCHEMA(
    "the rig", struct raw_rig, rig_fields, .hash_offset = AT(raw_rig, rig.hash),
    .defaults = &rig_defaults, .format_version = 1, .extendable = true, .locate = rig_locate_from);
