/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of a rig file: names, types, ranges and defaults, as tables for base/yaml.h.
 * rig/sensors.c has the keys of the section `sensors`. */
#include "rig/schema.h"

#include "canbus/lockstep.h"
#include "base/config.h"
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
    {"cylinder", CONTACT_CYLINDER},
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
    YAML_NUMBER("Ks_nm_rad", true, raw_spring, Ks_nm_rad, 0.0, 1e9),
    YAML_NUMBER("Ds_nm_s_rad", true, raw_spring, Ds_nm_s_rad, 0.0, 1e9),
};
YAML_TABLE(spring, "a series spring", raw_spring, .name_offset = AT(raw_spring, joint));

static const struct yaml_field robot_fields[] = {
    {"file", YAML_STRING, true, .offset = AT(raw_robot, file)},
    {"variant", YAML_STRING, false, .offset = AT(raw_robot, variant)},
    {"fixed_base", YAML_BOOL, false, .offset = AT(raw_robot, fixed_base)},
    YAML_ENTRIES("springs", YAML_DICT, false, raw_robot, spring, nspring, spring_schema),
    {"added_mass_kg", YAML_REAL_DICT, false, AT(raw_robot, mass), AT(raw_robot, nmass), .min = -1e3,
     .max = 1e3},
};
static const struct raw_robot robot_defaults = {.variant = ""};
YAML_TABLE(robot, "the robot", raw_robot, .defaults = &robot_defaults);

static const struct yaml_field initial_fields[] = {
    {"pose", YAML_STRING, true, .offset = AT(raw_initial, pose)},
    YAML_NUMBERS("base_xyz_m", false, raw_initial, base_xyz_m, 3, -1e3, 1e3),
    YAML_NUMBER("base_height_m", false, raw_initial, base_height_m, -1e3, 1e3),
    YAML_NUMBERS("base_rpy_rad", false, raw_initial, base_rpy_rad, 3, -7.0, 7.0),
    {"joints_rad", YAML_REAL_DICT, false, AT(raw_initial, joint),
     .count_offset = AT(raw_initial, njoint)},
    {"hold", YAML_ENUM, false, AT(raw_initial, hold), .names = rig_hold_words},
    {"settle", YAML_BOOL, false, .offset = AT(raw_initial, settle)},
};
YAML_TABLE(initial, "the initial state", raw_initial);

static const struct yaml_field material_fields[] = {
    YAML_NUMBER("young_pa", true, raw_material, material.young_pa, 1.0, 1e12),
    YAML_NUMBER("thickness_m", true, raw_material, material.thickness_m, 1e-6, 1.0),
    YAML_NUMBER("backing_pa_per_m", false, raw_material, material.backing_pa_per_m, 0.0, 1e12),
    YAML_NUMBER("dissipation_s_per_m", true, raw_material, material.dissipation_s_per_m, 0.0, 1e4),
    YAML_NUMBER("static_friction", true, raw_material, material.static_friction, 0.0, 100.0),
    YAML_NUMBER("dynamic_friction", true, raw_material, material.dynamic_friction, 0.0, 100.0),
    YAML_NUMBER("viscous_s_per_m", true, raw_material, material.viscous_friction, 0.0, 100.0),
};
YAML_TABLE(material, "a material", raw_material, .name_offset = AT(raw_material, name));

static const struct yaml_field surface_fields[] = {
    YAML_TEXT("name", true, raw_surface, surface.name, 1, 63),
    {"body", YAML_STRING, false, .offset = AT(raw_surface, body)},
    {"frame", YAML_STRING, false, .offset = AT(raw_surface, frame)},
    {"shape", YAML_ENUM, true, AT(raw_surface, surface.shape), .names = shape_names},
    YAML_NUMBERS("xyz_m", false, raw_surface, xyz_m, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, raw_surface, rpy_rad, 3, -7.0, 7.0),
    YAML_NUMBER("radius_m", false, raw_surface, surface.radius_m, 1e-6, 1e3),
    YAML_NUMBER("length_m", false, raw_surface, surface.length_m, 0.0, 1e3),
    YAML_NUMBERS("half_extents_m", false, raw_surface, surface.half_extent_m, 3, 1e-6, 1e3),
    YAML_COUNT("cells", false, raw_surface, surface.cells_per_edge, 1, 200),
    {"mesh", YAML_STRING, false, .offset = AT(raw_surface, mesh)},
    {"material", YAML_STRING, true, .offset = AT(raw_surface, material)},
};
static const struct raw_surface surface_defaults = {.surface.cells_per_edge = 7};
YAML_TABLE(surface, "a surface", raw_surface, .defaults = &surface_defaults);

static const struct yaml_field body_fields[] = {
    YAML_TEXT("name", true, raw_body, body.name, 1, 63),
    {"static", YAML_BOOL, false, .offset = AT(raw_body, is_static)},
    YAML_NUMBER("mass_kg", false, raw_body, body.inertia.mass, DBL_MIN, 1e6),
    YAML_NUMBERS("com_m", false, raw_body, body.inertia.com, 3, -1e3, 1e3),
    YAML_NUMBERS("inertia_kg_m2", false, raw_body, body.inertia.I, 6, -1e9, 1e9),
    YAML_NUMBERS("box_m", false, raw_body, box_m, 3, 1e-6, 1e3),
    YAML_NUMBERS("xyz_m", false, raw_body, body.position, 3, -1e3, 1e3),
    YAML_NUMBERS("rpy_rad", false, raw_body, rpy_rad, 3, -7.0, 7.0),
    YAML_NUMBERS("velocity_m_s", false, raw_body, body.v, 3, -1e3, 1e3),
    YAML_NUMBERS("rate_rad_s", false, raw_body, body.w, 3, -1e3, 1e3),
};
YAML_TABLE(body, "a body of the scene", raw_body);

static const struct yaml_field pair_fields[] = {
    {"between", YAML_NAME_LIST, true, AT(raw_pair, between),
     .count_offset = AT(raw_pair, nbetween)},
};
YAML_TABLE(pair, "a pair of surfaces", raw_pair);

static const struct yaml_field exclude_fields[] = {
    {"between", YAML_NAME_LIST, true, AT(raw_pair, between),
     .count_offset = AT(raw_pair, nbetween)},
    {"reason", YAML_STRING, false, .offset = AT(raw_pair, reason)},
};
YAML_TABLE(exclude, "a pair of surfaces to leave out", raw_pair);

static const struct yaml_field robot_surfaces_fields[] = {
    {"material", YAML_STRING, true, .offset = AT(raw_robot_surfaces, material)},
    {"base_material", YAML_STRING, false, .offset = AT(raw_robot_surfaces, base_material)},
    {"self_collision", YAML_BOOL, false, .offset = AT(raw_robot_surfaces, self_collision)},
    YAML_ENTRIES("exclude", YAML_LIST, false, raw_robot_surfaces, exclude, nexclude,
                 exclude_schema),
};
static const struct raw_robot_surfaces robot_surfaces_defaults = {.self_collision = true};
YAML_TABLE(robot_surfaces, "the surfaces of the robot", raw_robot_surfaces,
           .defaults = &robot_surfaces_defaults);

static const struct yaml_field scene_fields[] = {
    {"engine", YAML_ENUM, true, AT(raw_scene, engine), .names = rig_engine_words},
    {"friction", YAML_ENUM, false, AT(raw_scene, contact.friction), .names = friction_names},
    YAML_NUMBER("transition_velocity_m_s", false, raw_scene, contact.transition_velocity_m_s, 1e-6,
                10.0),
    {"mesh_law", YAML_ENUM, false, AT(raw_scene, contact.mesh_law), .names = mesh_law_names},
    YAML_ENTRIES("materials", YAML_DICT, false, raw_scene, material, nmaterial, material_schema),
    YAML_ENTRIES("bodies", YAML_LIST, false, raw_scene, body, nbody, body_schema),
    YAML_ENTRIES("surfaces", YAML_LIST, false, raw_scene, surface, nsurface, surface_schema),
    YAML_ENTRIES("pairs", YAML_LIST, false, raw_scene, pair, npair, pair_schema),
    YAML_SECTION("robot_surfaces", false, raw_scene, robot_surfaces, robot_surfaces_schema),
};
static const struct raw_scene scene_defaults = {.engine = RIG_CONTACT_NONE,
                                                .contact.transition_velocity_m_s = 0.01,
                                                .contact.mesh_law = CONTACT_PRESSURE_FIELD};
YAML_TABLE(scene, "the scene", raw_scene, .defaults = &scene_defaults);

static const struct yaml_field board_fields[] = {
    YAML_TEXT("name", false, raw_board, board.name, 1, 63),
    {"kind", YAML_ENUM, true, AT(raw_board, board.kind), .names = kind_names},
    {"address", YAML_INT, true, AT(raw_board, address), .min = 1, .max = BOARD_ADDRESS_MAX},
    {"model", YAML_STRING, false, .offset = AT(raw_board, model)},
    {"axes", YAML_NAME_LIST, false, AT(raw_board, axis), .count_offset = AT(raw_board, naxis)},
    YAML_NUMBER("current_limit_a", false, raw_board, current_limit_a, DBL_MIN, 1e3),
    YAML_NUMBER("current_gain", false, raw_board, current_gain, 0.01, 100.0),
    YAML_NUMBER("torque_gain", false, raw_board, torque_gain, 0.01, 100.0),
    YAML_NUMBER("torque_offset_nm", false, raw_board, torque_offset_nm, -1e3, 1e3),
    {"joints", YAML_NAME_LIST, false, AT(raw_board, joint), .count_offset = AT(raw_board, njoint)},
    {"sensor", YAML_STRING, false, .offset = AT(raw_board, sensor)},
    YAML_NUMBERS("full_scale_n", false, raw_board, board.full_scale, 3, 1, 65535),
    YAML_NUMBERS("full_scale_nm", false, raw_board, board.full_scale[3], 3, 1, 65535),
    YAML_SECONDS("period_s", false, raw_board, board.period_ns, 0.001, 0.255),
    {"transmit_at_start", YAML_BOOL, false, .offset = AT(raw_board, board.transmit_at_start)},
    {"external", YAML_BOOL, false, .offset = AT(raw_board, board.external)},
    {"external_follows", YAML_ENUM, false, AT(raw_board, external_torque), .names = follows_names},
    YAML_SECONDS("external_timeout_s", false, raw_board, board.external_timeout_ns, 0.001, 60.0),
    YAML_SECONDS("reply_delay_s", false, raw_board, board.reply.delay_ns, 0.0, BOARD_REPLY_MAX_S),
    YAML_SECONDS("reply_spread_s", false, raw_board, board.reply.spread_ns, 0.0, BOARD_REPLY_MAX_S),
};
static const struct raw_board board_defaults = {.board.period_ns = 1000000};
const struct yaml_schema rig_board_schema =
    YAML_SCHEMA("a board", struct raw_board, board_fields, .defaults = &board_defaults);

static const struct yaml_field bus_fields[] = {
    YAML_TEXT("name", true, raw_bus, bus.name, 1, 63),
    YAML_TEXT("interface", true, raw_bus, bus.interface, 1, 15),
    {"bitrate", YAML_INT, false, AT(raw_bus, bus.bitrate), .min = 10000, .max = 1000000},
    {"fd", YAML_BOOL, false, .offset = AT(raw_bus, bus.fd)},
    {"data_bitrate", YAML_INT, false, AT(raw_bus, bus.data_bitrate), .min = 10000, .max = 8000000},
    YAML_TEXT("protocol", false, raw_bus, protocol, 1, 400),
    {"padded_frames", YAML_BOOL, false, .offset = AT(raw_bus, padded)},
    {"configure", YAML_BOOL, false, .offset = AT(raw_bus, bus.configure)},
    YAML_NUMBER("sample_point", false, raw_bus, bus.sample_point, 0.5, 0.95),
    {"restart_ms", YAML_INT, false, AT(raw_bus, bus.restart_ms), .min = 0, .max = 60000},
    {"boards", YAML_LIST, true, AT(raw_bus, board), AT(raw_bus, bus.nboard),
     .schema = &rig_board_schema, .entry_key = "address"},
};
static const struct raw_bus bus_defaults = {.bus.bitrate = 1000000};
YAML_TABLE(bus, "a bus", raw_bus, .defaults = &bus_defaults);

static const struct yaml_field switches_fields[] = {
    YAML_NUMBER("negative_limit_rad", false, raw_switches, switches.negative_rad, -1e3, 1e3),
    YAML_NUMBER("positive_limit_rad", false, raw_switches, switches.positive_rad, -1e3, 1e3),
    YAML_NUMBERS("home_rad", false, raw_switches, switches.home_rad, 2, -1e3, 1e3),
    {"index_pulse", YAML_BOOL, false, .offset = AT(raw_switches, index_pulse)},
};
YAML_TABLE(switches, "the switches of a joint", raw_switches,
           .name_offset = AT(raw_switches, joint));

static const struct yaml_field motors_fields[] = {
    YAML_NUMBER("joint_ticks_per_rev", true, raw_motors, joint_ticks_per_rev, 1.0, 1e9),
    YAML_NUMBER("motor_ticks_per_link_rev", true, raw_motors, motor_ticks_per_link_rev, 1.0, 1e9),
    YAML_NUMBER("torque_full_scale_nm", true, raw_motors, axis.torque_full_scale_nm, 1, 65535),
    YAML_NUMBER("current_limit_a", true, raw_motors, axis.current_limit_a, DBL_MIN, 1e3),
    YAML_NUMBER("limit_margin_rad", false, raw_motors, limit_margin_rad, 0.0, 1e3),
    YAML_NUMBER("temperature_limit_c", false, raw_motors, axis.temperature_limit_c, 0.0, 125.0),
    YAML_SECONDS("command_timeout_s", false, raw_motors, board.command_timeout_ns, 0.0, 60.0),
    YAML_COUNT("rotor_poles", false, raw_motors, rotor_poles, 2, 126),
    YAML_SECONDS("status_period_s", false, raw_motors, board.status_period_ns, 0.0, 10.0),
    YAML_SECONDS("boot_s", false, raw_motors, board.boot_ns, 0.0, 60.0),
    YAML_SECONDS("reply_delay_s", false, raw_motors, board.reply.delay_ns, 0.0, BOARD_REPLY_MAX_S),
    YAML_SECONDS("reply_spread_s", false, raw_motors, board.reply.spread_ns, 0.0,
                 BOARD_REPLY_MAX_S),
    {"strict", YAML_BOOL, false, .offset = AT(raw_motors, board.strict)},
    {"require_calibration", YAML_BOOL, false, .offset = AT(raw_motors, board.require_calibration)},
    {"keep_firmware", YAML_BOOL, false, .offset = AT(raw_motors, board.keep_firmware)},
    {"discovery_stops_motors", YAML_BOOL, false,
     .offset = AT(raw_motors, board.discovery_stops_motors)},
    YAML_ENTRIES("switches", YAML_DICT, false, raw_motors, switches, nswitches, switches_schema),
};
static const struct raw_motors motors_defaults = {.rotor_poles = 8,
                                                  .board = {.command_timeout_ns = 100000000,
                                                            .boot_ns = -1,
                                                            .reply = {-1, -1},
                                                            .period_ns = 1000000,
                                                            .external_timeout_ns = 20000000},
                                                  .axis.temperature_limit_c = 70.0};
YAML_TABLE(motors, "the motor boards", raw_motors, .defaults = &motors_defaults);

static const struct yaml_field wire_fields[] = {
    {"mode", YAML_ENUM, false, AT(rig_wire, timed), .names = rig_wire_words},
    {"pace", YAML_ENUM, false, AT(rig_wire, paced), .names = wire_pace_names},
    {"order", YAML_ENUM, false, AT(rig_wire, fifo), .names = wire_order_names},
};
YAML_TABLE(wire, "the wire", rig_wire, .unmarked = true);

static const struct yaml_field lockstep_fields[] = {
    {"bus", YAML_STRING, false, .offset = AT(raw_lockstep, bus)},
    YAML_COUNT("step_id", false, raw_lockstep, lockstep.step_id, 0, 0x7ff),
    YAML_COUNT("done_id", false, raw_lockstep, lockstep.done_id, 0, 0x7ff),
    YAML_SECONDS("partner_timeout_s", false, raw_lockstep, lockstep.partner_timeout_ns, 0.01,
                 3600.0),
};
static const struct raw_lockstep lockstep_defaults = {
    .lockstep = {.step_id = LOCKSTEP_STEP_ID,
                 .done_id = LOCKSTEP_DONE_ID,
                 .partner_timeout_ns = 1000000000}};
YAML_TABLE(lockstep, "lockstep", raw_lockstep, .defaults = &lockstep_defaults);

static const struct yaml_field realtime_fields[] = {
    YAML_COUNT("priority", false, rig_realtime, priority, 0, 99),
    YAML_COUNT("cpu", false, rig_realtime, cpu, -1, 1023),
    {"lock_memory", YAML_BOOL, false, .offset = AT(rig_realtime, lock_memory)},
    {"overrun", YAML_ENUM, false, AT(rig_realtime, overrun), .names = loop_overrun_words},
};
static const struct rig_realtime realtime_defaults = {
    .priority = 80, .cpu = -1, .lock_memory = true, .overrun = LOOP_OVERRUN_SKIP};
YAML_TABLE(realtime, "the real-time settings", rig_realtime, .unmarked = true,
           .defaults = &realtime_defaults);

static const struct yaml_field record_fields[] = {
    YAML_TEXT("directory", false, rig_record, directory, 1, 4000),
    {"format", YAML_ENUM, false, AT(rig_record, format), .names = recorder_format_words},
};
static const struct rig_record record_defaults = {.format = RECORDER_CSV};
YAML_TABLE(record, "the record", rig_record, .unmarked = true, .defaults = &record_defaults);

static const struct yaml_field page_fields[] = {
    YAML_TEXT("listen", true, rig_page, listen, 1, 80),
};
YAML_TABLE(page, "the page", rig_page, .unmarked = true);

static const struct yaml_field gains_fields[] = {
    {"joints", YAML_NAME_LIST, true, AT(raw_gains, joint), .count_offset = AT(raw_gains, njoint)},
    YAML_NUMBER("kp_v_per_rad", false, raw_gains, gains.kp_v_per_rad, 0.0, 1e6),
    YAML_NUMBER("ki_v_per_rad_s", false, raw_gains, gains.ki_v_per_rad_s, 0.0, 1e6),
    YAML_NUMBER("kd_v_s_per_rad", false, raw_gains, gains.kd_v_s_per_rad, 0.0, 1e6),
    YAML_NUMBER("kw_v_s_per_rad", false, raw_gains, gains.kw_v_s_per_rad, 0.0, 1e6),
    YAML_NUMBER("trim_per_s", false, raw_gains, gains.trim_per_s, 0.0, 1e3),
    YAML_NUMBER("sway_damping_per_s", false, raw_gains, gains.sway_damping_per_s, 0.0, 1e3),
    YAML_NUMBER("limit_v", false, raw_gains, gains.limit_v, DBL_MIN, 1e4),
    YAML_NUMBER("load_v_per_nm", false, raw_gains, gains.load_v_per_nm, 0.0, 1e4),
};
const struct yaml_schema gains_schema =
    YAML_SCHEMA("the gains of some joints", struct raw_gains, gains_fields);

static const struct yaml_field servo_fields[] = {
    YAML_NUMBER("kp_v_per_rad", true, raw_servo, gains.kp_v_per_rad, 0.0, 1e6),
    YAML_NUMBER("ki_v_per_rad_s", true, raw_servo, gains.ki_v_per_rad_s, 0.0, 1e6),
    YAML_NUMBER("kd_v_s_per_rad", false, raw_servo, gains.kd_v_s_per_rad, 0.0, 1e6),
    YAML_NUMBER("kw_v_s_per_rad", true, raw_servo, gains.kw_v_s_per_rad, 0.0, 1e6),
    YAML_NUMBER("trim_per_s", false, raw_servo, gains.trim_per_s, 0.0, 1e3),
    YAML_NUMBER("sway_damping_per_s", false, raw_servo, gains.sway_damping_per_s, 0.0, 1e3),
    YAML_NUMBER("limit_v", false, raw_servo, gains.limit_v, DBL_MIN, 1e4),
    YAML_NUMBER("load_v_per_nm", false, raw_servo, gains.load_v_per_nm, 0.0, 1e4),
    YAML_ENTRIES("others", YAML_LIST, false, raw_servo, other, nother, gains_schema),
    YAML_NUMBER("command_period_s", true, raw_servo, command_period_s, 1e-5, 1.0),
};
YAML_TABLE(servo, "the servo", raw_servo);

static const struct yaml_field squat_fields[] = {
    YAML_NUMBER("thigh_m", true, squat_config, thigh_m, 0.01, 10.0),
    YAML_NUMBER("shank_m", true, squat_config, shank_m, 0.01, 10.0),
    YAML_NUMBER("depth_m", true, squat_config, depth_m, 0.0, 10.0),
    YAML_NUMBER("period_s", true, squat_config, period_s, 0.1, 1e3),
    YAML_COUNT("cycles", true, squat_config, cycles, 1, 1e6),
};
YAML_TABLE(squat, "the squat", squat_config, .unmarked = true);

static const struct yaml_field phase_fields[] = {
    YAML_TEXT("name", true, grasp_phase, name, 1, 31),
    YAML_NUMBER("until_s", true, grasp_phase, until_s, DBL_MIN, 1e3),
    YAML_NUMBERS("arm_rad", true, grasp_phase, arm_rad, GRASP_JOINTS, -7.0, 7.0),
    {"closed", YAML_BOOL, false, .offset = AT(grasp_phase, closed)},
};
YAML_TABLE(phase, "a phase", grasp_phase, .unmarked = true);

static const struct yaml_field grasp_fields[] = {
    YAML_NUMBER("settle_s", true, grasp_config, settle_s, 0.1, 1e3),
    YAML_ENTRIES("path", YAML_LIST, true, grasp_config, phase, nphase, phase_schema),
    YAML_NUMBER("hold_s", true, grasp_config, hold_s, 0.0, 1e3),
    YAML_NUMBER("least_press_n", true, grasp_config, least_press_n, 0.0, 1e6),
    YAML_NUMBER("least_carry_n", true, grasp_config, least_carry_n, 0.0, 1e6),
};
YAML_TABLE(grasp, "the grasp", grasp_config, .unmarked = true);

static const struct yaml_field hold_fields[] = {
    YAML_NUMBER("duration_s", false, hold_config, duration_s, 0.0, 1e6),
    YAML_NUMBER("tolerance_rad", false, hold_config, tolerance_rad, 1e-6, 10.0),
};
static const struct hold_config hold_defaults = {.duration_s = 10.0, .tolerance_rad = 0.05};
YAML_TABLE(hold, "the hold task", hold_config, .unmarked = true, .defaults = &hold_defaults);

/* Row for a number of the walk. `of`: path to a struct in struct raw_walk. `key`: also the name of
 * the number's member in this struct. */
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
    YAML_ENTRIES("others", YAML_LIST, false, raw_walk, other, nother, gains_schema),
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
    YAML_SECTION("servo", false, raw_rig, servo, servo_schema),
    YAML_SECTION("squat", false, raw_rig, rig.squat, squat_schema),
    YAML_SECTION("grasp", false, raw_rig, rig.grasp, grasp_schema),
    YAML_SECTION("hold", false, raw_rig, rig.hold_task, hold_schema),
    YAML_SECTION("walk", false, raw_rig, walk, walk_schema),
};
YAML_TABLE(tasks, "the tasks", raw_rig, .unmarked = true);

static const struct yaml_field chopper_fields[] = {
    YAML_NUMBER("on_v", true, raw_rig, rig.supply_bus.on_v, DBL_MIN, 1e4),
    YAML_NUMBER("off_v", true, raw_rig, rig.supply_bus.off_v, DBL_MIN, 1e4),
    YAML_NUMBER("ohm", true, raw_rig, rig.supply_bus.brake_ohm, 1e-3, 1e6),
};
YAML_TABLE(chopper, "a brake chopper", raw_rig, .unmarked = true);

static const struct yaml_field rig_fields[] = {
    YAML_TEXT("name", true, raw_rig, rig.name, 1, 63),
    YAML_TEXT("description", false, raw_rig, description, 1, 400),
    YAML_SECTION("robot", true, raw_rig, robot, robot_schema),
    {"clock", YAML_ENUM, false, AT(raw_rig, rig.clock), .names = loop_clock_words},
    YAML_NUMBER("tick_s", false, raw_rig, tick_s, 1e-5, 0.1),
    YAML_NUMBER("substep_s", false, raw_rig, substep_s, 1e-7, 1.0),
    {"integrator", YAML_ENUM, false, AT(raw_rig, rig.integrator), .names = rig_integrator_words},
    YAML_NUMBER("tolerance", false, raw_rig, rig.tolerance, 1e-13, 0.1),
    {"dynamics", YAML_ENUM, false, AT(raw_rig, rig.dynamics), .names = rig_dynamics_words},
    YAML_TEXT("protocol", false, raw_rig, protocol, 1, 400),
    {"personality", YAML_STRING, false, .offset = AT(raw_rig, personality)},
    YAML_NUMBER("supply_v", true, raw_rig, rig.supply_v, DBL_MIN, 1e4),
    YAML_SECTION("initial", true, raw_rig, initial, initial_schema),
    YAML_SECTION("scene", false, raw_rig, scene, scene_schema),
    YAML_SECTION("motors", true, raw_rig, motors, motors_schema),
    {"buses", YAML_LIST, true, AT(raw_rig, bus), AT(raw_rig, rig.nbus), .schema = &bus_schema,
     .entry_key = "name"},
    {"undriven", YAML_NAME_LIST, false, AT(raw_rig, undriven),
     .count_offset = AT(raw_rig, nundriven)},
    YAML_SECTION("wire", false, raw_rig, rig.wire, wire_schema),
    YAML_SECTION("lockstep", false, raw_rig, lockstep, lockstep_schema),
    YAML_SECTION("realtime", false, raw_rig, rig.realtime, realtime_schema),
    YAML_SECTION("record", false, raw_rig, rig.record, record_schema),
    YAML_SECTION("page", false, raw_rig, rig.page, page_schema),
    {"tasks", YAML_MAP, false, .schema = &tasks_schema},
    YAML_SECTION("sensors", false, raw_rig, sensors, rig_sensors_schema),
    {"faults", YAML_NAME_LIST, false, AT(raw_rig, rig.fault),
     .count_offset = AT(raw_rig, rig.nfault)},
    {"seed", YAML_INT, false, AT(raw_rig, rig.seed), .min = 0, .max = 9e15},
    YAML_NUMBER("voltage_delay_s", false, raw_rig, voltage_delay_s, 0.0, 0.1),
    YAML_NUMBER("supply_ohm", false, raw_rig, rig.supply_ohm, 0.0, 1e3),
    YAML_NUMBER("supply_capacitance_f", false, raw_rig, rig.supply_bus.capacitance_f, 1e-4, 1e3),
    {"supply_returns", .type = YAML_BOOL, .offset = AT(raw_rig, rig.supply_bus.returns)},
    {"brake_chopper", YAML_MAP, false, .schema = &chopper_schema},
};
static const struct raw_rig rig_defaults = {
    .tick_s = 0.001,
    .rig = {.clock = LOOP_CLOCK_REAL, .integrator = PLANT_IMPLICIT, .tolerance = 1e-9}};
static const struct yaml_renamed rig_renamed = {"personality", "protocol", "described"};
const struct yaml_schema rig_file_schema = YAML_SCHEMA(
    "the rig", struct raw_rig, rig_fields, .hash_offset = AT(raw_rig, rig.hash),
    .defaults = &rig_defaults, .format_version = 1, .extendable = true, .locate = rig_locate_from,
    .renamed = &rig_renamed, .old_offset = AT(raw_rig, rig.old_key));
