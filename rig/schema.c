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

#define AT(member) offsetof(struct STRUCT, member)

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
static const struct word budget_names[] = {
    {"warn", RIG_BUDGET_WARN},
    {"refuse", RIG_BUDGET_REFUSE},
    {"ignore", RIG_BUDGET_IGNORE},
    {NULL, 0},
};

#define STRUCT raw_spring
static const struct yaml_field spring_fields[] = {
    {"Ks_nm_rad", YAML_REAL, true, AT(Ks_nm_rad), .min = 0.0, .max = 1e9},
    {"Ds_nm_s_rad", YAML_REAL, true, AT(Ds_nm_s_rad), .min = 0.0, .max = 1e9},
};
#undef STRUCT
static const struct yaml_schema spring_schema = {
    .what = "a series spring",
    .size = sizeof(struct raw_spring),
    .fields = spring_fields,
    .field_count = ARRAY_COUNT(spring_fields),
    .name_offset = offsetof(struct raw_spring, joint),
};

#define STRUCT raw_robot
static const struct yaml_field robot_fields[] = {
    {"file", YAML_STRING, true, AT(file), .mark_offset = AT(file_mark)},
    {"variant", YAML_STRING, false, .offset = AT(variant)},
    {"fixed_base", YAML_BOOL, false, .offset = AT(fixed_base)},
    {"springs", YAML_DICT, false, AT(spring), AT(nspring), .schema = &spring_schema},
    {"added_mass_kg", YAML_REAL_DICT, false, AT(mass), AT(nmass), .min = -1e3, .max = 1e3},
};
#undef STRUCT
static const struct raw_robot robot_defaults = {.variant = ""};
static const struct yaml_schema robot_schema = {
    .what = "the robot",
    .size = sizeof(struct raw_robot),
    .fields = robot_fields,
    .field_count = ARRAY_COUNT(robot_fields),
    .defaults = &robot_defaults,
};

#define STRUCT raw_initial
static const struct yaml_field initial_fields[] = {
    {"pose", YAML_STRING, true, AT(pose), .mark_offset = AT(pose_mark)},
    {"base_xyz_m", YAML_REALS, false, AT(base_xyz_m), .count = 3, .min = -1e3, .max = 1e3,
     .given_offset = AT(position_given)},
    {"base_height_m", YAML_REAL, false, AT(base_height_m), .min = -1e3, .max = 1e3,
     .given_offset = AT(height_given)},
    {"base_rpy_rad", YAML_REALS, false, AT(base_rpy_rad), .count = 3, .min = -7.0, .max = 7.0,
     .given_offset = AT(rpy_given)},
    {"joints_rad", YAML_REAL_DICT, false, AT(joint), .count_offset = AT(njoint)},
    {"hold", YAML_ENUM, false, AT(hold), .names = rig_hold_words},
    {"settle", YAML_BOOL, false, .offset = AT(settle)},
};
#undef STRUCT
static const struct yaml_schema initial_schema = {
    .what = "the initial state",
    .size = sizeof(struct raw_initial),
    .fields = initial_fields,
    .field_count = ARRAY_COUNT(initial_fields),
};

#define STRUCT raw_material
static const struct yaml_field material_fields[] = {
    {"young_pa", YAML_REAL, true, AT(young_pa), .min = 1.0, .max = 1e12},
    {"thickness_m", YAML_REAL, true, AT(thickness_m), .min = 1e-6, .max = 1.0},
    {"backing_pa_per_m", YAML_REAL, false, AT(backing_pa_per_m), .min = 0.0, .max = 1e12},
    {"dissipation_s_per_m", YAML_REAL, true, AT(dissipation_s_per_m), .min = 0.0, .max = 1e4},
    {"static_friction", YAML_REAL, true, AT(static_friction), .min = 0.0, .max = 100.0},
    {"dynamic_friction", YAML_REAL, true, AT(dynamic_friction), .min = 0.0, .max = 100.0},
    {"viscous_s_per_m", YAML_REAL, true, AT(viscous_s_per_m), .min = 0.0, .max = 100.0},
};
#undef STRUCT
static const struct yaml_schema material_schema = {
    .what = "a material",
    .size = sizeof(struct raw_material),
    .fields = material_fields,
    .field_count = ARRAY_COUNT(material_fields),
    .name_offset = offsetof(struct raw_material, name),
};

#define STRUCT raw_surface
static const struct yaml_field surface_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 63, .mark_offset = AT(name_mark)},
    {"body", YAML_STRING, false, AT(body), .mark_offset = AT(body_mark),
     .given_offset = AT(body_given)},
    {"frame", YAML_STRING, false, AT(frame), .mark_offset = AT(frame_mark),
     .given_offset = AT(frame_given)},
    {"shape", YAML_ENUM, true, AT(shape), .names = shape_names},
    {"xyz_m", YAML_REALS, false, AT(xyz_m), .count = 3, .min = -1e3, .max = 1e3},
    {"rpy_rad", YAML_REALS, false, AT(rpy_rad), .count = 3, .min = -7.0, .max = 7.0},
    {"radius_m", YAML_REAL, false, AT(radius_m), .min = 1e-6, .max = 1e3,
     .given_offset = AT(radius_given)},
    {"length_m", YAML_REAL, false, AT(length_m), .min = 0.0, .max = 1e3,
     .given_offset = AT(length_given)},
    {"half_extents_m", YAML_REALS, false, AT(half_extents_m), .count = 3, .min = 1e-6, .max = 1e3,
     .given_offset = AT(half_extents_given)},
    {"cells", YAML_INT, false, AT(cells), .min = 1, .max = 200, .given_offset = AT(cells_given)},
    {"mesh", YAML_STRING, false, AT(mesh), .mark_offset = AT(mesh_mark),
     .given_offset = AT(mesh_given)},
    {"material", YAML_STRING, true, AT(material), .mark_offset = AT(material_mark)},
};
#undef STRUCT
static const struct raw_surface surface_defaults = {.cells = 7};
static const struct yaml_schema surface_schema = {
    .what = "a surface",
    .size = sizeof(struct raw_surface),
    .fields = surface_fields,
    .field_count = ARRAY_COUNT(surface_fields),
    .defaults = &surface_defaults,
};

#define STRUCT raw_body
static const struct yaml_field body_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 63, .mark_offset = AT(name_mark)},
    {"static", YAML_BOOL, false, .offset = AT(is_static)},
    {"mass_kg", YAML_REAL, false, AT(mass_kg), .min = DBL_MIN, .max = 1e6,
     .mark_offset = AT(mass_mark), .given_offset = AT(mass_given)},
    {"com_m", YAML_REALS, false, AT(com_m), .count = 3, .min = -1e3, .max = 1e3,
     .given_offset = AT(com_given)},
    {"inertia_kg_m2", YAML_REALS, false, AT(inertia_kg_m2), .count = 6, .min = -1e9, .max = 1e9,
     .mark_offset = AT(inertia_mark), .given_offset = AT(inertia_given)},
    {"box_m", YAML_REALS, false, AT(box_m), .count = 3, .min = 1e-6, .max = 1e3,
     .given_offset = AT(box_given)},
    {"sphere_radius_m", YAML_REAL, false, AT(sphere_radius_m), .min = 1e-6, .max = 1e3,
     .given_offset = AT(sphere_given)},
    {"xyz_m", YAML_REALS, false, AT(xyz_m), .count = 3, .min = -1e3, .max = 1e3},
    {"rpy_rad", YAML_REALS, false, AT(rpy_rad), .count = 3, .min = -7.0, .max = 7.0},
    {"velocity_m_s", YAML_REALS, false, AT(velocity_m_s), .count = 3, .min = -1e3, .max = 1e3,
     .given_offset = AT(velocity_given)},
    {"rate_rad_s", YAML_REALS, false, AT(rate_rad_s), .count = 3, .min = -1e3, .max = 1e3,
     .given_offset = AT(rate_given)},
};
#undef STRUCT
static const struct yaml_schema body_schema = {
    .what = "a body of the scene",
    .size = sizeof(struct raw_body),
    .fields = body_fields,
    .field_count = ARRAY_COUNT(body_fields),
};

#define STRUCT raw_pair
static const struct yaml_field pair_fields[] = {
    {"between", YAML_NAME_LIST, true, AT(between), AT(nbetween), .mark_offset = AT(between_mark)},
};
#undef STRUCT
static const struct yaml_schema pair_schema = {
    .what = "a pair of surfaces",
    .size = sizeof(struct raw_pair),
    .fields = pair_fields,
    .field_count = ARRAY_COUNT(pair_fields),
};

#define STRUCT raw_pair
static const struct yaml_field exclude_fields[] = {
    {"between", YAML_NAME_LIST, true, AT(between), AT(nbetween), .mark_offset = AT(between_mark)},
    {"reason", YAML_STRING, false, .offset = AT(reason)},
};
#undef STRUCT
static const struct yaml_schema exclude_schema = {
    .what = "a pair of surfaces to leave out",
    .size = sizeof(struct raw_pair),
    .fields = exclude_fields,
    .field_count = ARRAY_COUNT(exclude_fields),
};

#define STRUCT raw_robot_surfaces
static const struct yaml_field robot_surfaces_fields[] = {
    {"material", YAML_STRING, true, AT(material), .mark_offset = AT(material_mark)},
    {"self_collision", YAML_BOOL, false, .offset = AT(self_collision)},
    {"exclude", YAML_LIST, false, AT(exclude), AT(nexclude), .schema = &exclude_schema},
};
#undef STRUCT
static const struct raw_robot_surfaces robot_surfaces_defaults = {.self_collision = true};
static const struct yaml_schema robot_surfaces_schema = {
    .what = "the surfaces of the robot",
    .size = sizeof(struct raw_robot_surfaces),
    .fields = robot_surfaces_fields,
    .field_count = ARRAY_COUNT(robot_surfaces_fields),
    .defaults = &robot_surfaces_defaults,
};

#define STRUCT raw_scene
static const struct yaml_field scene_fields[] = {
    {"engine", YAML_ENUM, true, AT(engine), .names = rig_engine_words},
    {"friction", YAML_ENUM, false, AT(friction), .mark_offset = AT(friction_mark),
     .given_offset = AT(friction_given), .names = friction_names},
    {"transition_velocity_m_s", YAML_REAL, false, AT(transition_velocity_m_s), .min = 1e-6,
     .max = 10.0},
    {"mesh_law", YAML_ENUM, false, AT(mesh_law), .names = mesh_law_names},
    {"materials", YAML_DICT, false, AT(material), AT(nmaterial), .schema = &material_schema},
    {"bodies", YAML_LIST, false, AT(body), AT(nbody), .schema = &body_schema},
    {"surfaces", YAML_LIST, false, AT(surface), AT(nsurface), .schema = &surface_schema},
    {"pairs", YAML_LIST, false, AT(pair), AT(npair), .schema = &pair_schema},
    {"robot_surfaces", YAML_MAP, false, AT(robot_surfaces), .schema = &robot_surfaces_schema,
     .given_offset = AT(robot_surfaces_given)},
};
#undef STRUCT
static const struct raw_scene scene_defaults = {.engine = RIG_CONTACT_NONE,
                                                .transition_velocity_m_s = 0.01,
                                                .mesh_law = CONTACT_PRESSURE_FIELD};
static const struct yaml_schema scene_schema = {
    .what = "the scene",
    .size = sizeof(struct raw_scene),
    .fields = scene_fields,
    .field_count = ARRAY_COUNT(scene_fields),
    .defaults = &scene_defaults,
};

#define STRUCT raw_board
static const struct yaml_field board_fields[] = {
    {"name", YAML_STRING, false, AT(name), .min = 1, .max = 63},
    {"kind", YAML_ENUM, true, AT(kind), .names = kind_names},
    {"address", YAML_INT, true, AT(address), .min = 1, .max = 31, .mark_offset = AT(address_mark)},
    {"axes", YAML_NAME_LIST, false, AT(axis), AT(naxis), .mark_offset = AT(axis_mark),
     .given_offset = AT(axis_given)},
    {"current_limit_a", YAML_REAL, false, AT(current_limit_a), .min = DBL_MIN, .max = 1e3,
     .given_offset = AT(current_given)},
    {"joints", YAML_NAME_LIST, false, AT(joint), AT(njoint), .mark_offset = AT(joint_mark),
     .given_offset = AT(joint_given)},
    {"sensor", YAML_STRING, false, AT(sensor), .mark_offset = AT(sensor_mark),
     .given_offset = AT(sensor_given)},
    {"full_scale_n", YAML_REALS, false, AT(full_scale_n), .count = 3, .min = 1, .max = 65535,
     .mark_offset = AT(full_scale_n_mark), .given_offset = AT(full_scale_n_given)},
    {"full_scale_nm", YAML_REALS, false, AT(full_scale_nm), .count = 3, .min = 1, .max = 65535,
     .mark_offset = AT(full_scale_nm_mark), .given_offset = AT(full_scale_nm_given)},
    {"period_s", YAML_REAL, false, AT(period_s), .min = 0.001, .max = 0.255,
     .mark_offset = AT(period_mark), .given_offset = AT(period_given)},
    {"transmit_at_start", YAML_BOOL, false, .offset = AT(transmit_at_start)},
    {"external", YAML_BOOL, false, .offset = AT(external), .mark_offset = AT(external_mark)},
    {"external_follows", YAML_ENUM, false, AT(external_torque), .names = follows_names,
     .mark_offset = AT(external_follows_mark), .given_offset = AT(external_follows_given)},
    {"external_timeout_s", YAML_REAL, false, AT(external_timeout_s), .min = 0.001, .max = 60.0,
     .mark_offset = AT(external_timeout_mark), .given_offset = AT(external_timeout_given)},
};
#undef STRUCT
static const struct raw_board board_defaults = {.period_s = 0.001, .external_timeout_s = 0.02};
static const struct yaml_schema board_schema = {
    .what = "a board",
    .size = sizeof(struct raw_board),
    .fields = board_fields,
    .field_count = ARRAY_COUNT(board_fields),
    .defaults = &board_defaults,
};

#define STRUCT raw_bus
static const struct yaml_field bus_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 63, .mark_offset = AT(name_mark)},
    {"interface", YAML_STRING, true, AT(interface), .min = 1, .max = 15,
     .mark_offset = AT(interface_mark)},
    {"bitrate", YAML_INT, false, AT(bitrate), .min = 10000, .max = 1000000},
    {"fd", YAML_BOOL, false, .offset = AT(fd), .mark_offset = AT(fd_mark)},
    {"data_bitrate", YAML_INT, false, AT(data_bitrate), .min = 10000, .max = 8000000,
     .mark_offset = AT(data_bitrate_mark), .given_offset = AT(data_bitrate_given)},
    {"personality", YAML_ENUM, false, AT(personality), .names = protocol_words,
     .given_offset = AT(personality_given)},
    {"protocol", YAML_STRING, false, AT(protocol), .min = 1, .max = 400,
     .mark_offset = AT(protocol_mark)},
    {"padded_frames", YAML_BOOL, false, .offset = AT(padded), .mark_offset = AT(padded_mark)},
    {"configure", YAML_BOOL, false, .offset = AT(configure)},
    {"sample_point", YAML_REAL, false, AT(sample_point), .min = 0.5, .max = 0.95,
     .mark_offset = AT(sample_point_mark), .given_offset = AT(sample_point_given)},
    {"restart_ms", YAML_INT, false, AT(restart_ms), .min = 0, .max = 60000,
     .mark_offset = AT(restart_mark), .given_offset = AT(restart_given)},
    {"boards", YAML_LIST, true, AT(board), AT(nboard), .schema = &board_schema,
     .entry_key = "address"},
};
#undef STRUCT
static const struct raw_bus bus_defaults = {.bitrate = 1000000};
static const struct yaml_schema bus_schema = {
    .what = "a bus",
    .size = sizeof(struct raw_bus),
    .fields = bus_fields,
    .field_count = ARRAY_COUNT(bus_fields),
    .defaults = &bus_defaults,
};

#define STRUCT raw_switches
static const struct yaml_field switches_fields[] = {
    {"negative_limit_rad", YAML_REAL, false, AT(negative_rad), .min = -1e3, .max = 1e3,
     .mark_offset = AT(negative_mark), .given_offset = AT(negative_given)},
    {"positive_limit_rad", YAML_REAL, false, AT(positive_rad), .min = -1e3, .max = 1e3,
     .given_offset = AT(positive_given)},
    {"home_rad", YAML_REALS, false, AT(home_rad), .count = 2, .min = -1e3, .max = 1e3,
     .mark_offset = AT(home_mark), .given_offset = AT(home_given)},
    {"index_pulse", YAML_BOOL, false, .offset = AT(index_pulse)},
};
#undef STRUCT
static const struct yaml_schema switches_schema = {
    .what = "the switches of a joint",
    .size = sizeof(struct raw_switches),
    .fields = switches_fields,
    .field_count = ARRAY_COUNT(switches_fields),
    .name_offset = offsetof(struct raw_switches, joint),
};

#define STRUCT raw_motors
static const struct yaml_field motors_fields[] = {
    {"joint_ticks_per_rev", YAML_REAL, true, AT(joint_ticks_per_rev), .min = 1.0, .max = 1e9},
    {"motor_ticks_per_link_rev", YAML_REAL, true, AT(motor_ticks_per_link_rev), .min = 1.0,
     .max = 1e9},
    {"torque_full_scale_nm", YAML_REAL, true, AT(torque_full_scale_nm), .min = 1, .max = 65535,
     .mark_offset = AT(torque_full_scale_mark)},
    {"current_limit_a", YAML_REAL, true, AT(current_limit_a), .min = DBL_MIN, .max = 1e3},
    {"temperature_limit_c", YAML_REAL, false, AT(temperature_limit_c), .min = 0.0, .max = 125.0},
    {"command_timeout_s", YAML_REAL, false, AT(command_timeout_s), .min = 0.0, .max = 60.0},
    {"rotor_poles", YAML_INT, false, AT(rotor_poles), .min = 2, .max = 126},
    {"status_period_s", YAML_REAL, false, AT(status_period_s), .min = 0.0, .max = 10.0},
    {"boot_s", YAML_REAL, false, AT(boot_s), .min = 0.0, .max = 60.0},
    {"strict", YAML_BOOL, false, .offset = AT(strict)},
    {"require_calibration", YAML_BOOL, false, .offset = AT(require_calibration),
     .mark_offset = AT(require_calibration_mark)},
    {"keep_firmware", YAML_BOOL, false, .offset = AT(keep_firmware)},
    {"discovery_stops_motors", YAML_BOOL, false, .offset = AT(discovery_stops_motors)},
    {"switches", YAML_DICT, false, AT(switches), AT(nswitches), .schema = &switches_schema},
};
#undef STRUCT
static const struct raw_motors motors_defaults = {
    .rotor_poles = 8, .command_timeout_s = 0.1, .temperature_limit_c = 70.0};
static const struct yaml_schema motors_schema = {
    .what = "the motor boards",
    .size = sizeof(struct raw_motors),
    .fields = motors_fields,
    .field_count = ARRAY_COUNT(motors_fields),
    .defaults = &motors_defaults,
};

#define STRUCT raw_wire
static const struct yaml_field wire_fields[] = {
    {"mode", YAML_ENUM, false, AT(mode), .names = rig_wire_words},
    {"pace", YAML_ENUM, false, AT(pace), .names = wire_pace_names},
    {"order", YAML_ENUM, false, AT(order), .names = wire_order_names},
    {"queue", YAML_INT, false, AT(queue), .min = 1, .max = 4096},
    {"restart_s", YAML_REAL, false, AT(restart_s), .min = 0.0, .max = 3600.0},
    {"budget", YAML_ENUM, false, AT(budget), .names = budget_names},
};
#undef STRUCT
static const struct raw_wire wire_defaults = {.queue = 256, .restart_s = 0.1};
static const struct yaml_schema wire_schema = {
    .what = "the wire",
    .size = sizeof(struct raw_wire),
    .fields = wire_fields,
    .field_count = ARRAY_COUNT(wire_fields),
    .defaults = &wire_defaults,
};

#define STRUCT raw_lockstep
static const struct yaml_field lockstep_fields[] = {
    {"bus", YAML_STRING, false, AT(bus), .mark_offset = AT(bus_mark)},
    {"step_id", YAML_INT, false, AT(step_id), .min = 0, .max = 0x7ff, .mark_offset = AT(step_mark)},
    {"done_id", YAML_INT, false, AT(done_id), .min = 0, .max = 0x7ff, .mark_offset = AT(done_mark)},
    {"partner_timeout_s", YAML_REAL, false, AT(partner_timeout_s), .min = 0.01, .max = 3600.0},
};
#undef STRUCT
static const struct raw_lockstep lockstep_defaults = {
    .step_id = LOCKSTEP_STEP_ID, .done_id = LOCKSTEP_DONE_ID, .partner_timeout_s = 1.0};
static const struct yaml_schema lockstep_schema = {
    .what = "lockstep",
    .size = sizeof(struct raw_lockstep),
    .fields = lockstep_fields,
    .field_count = ARRAY_COUNT(lockstep_fields),
    .defaults = &lockstep_defaults,
};

#define STRUCT raw_realtime
static const struct yaml_field realtime_fields[] = {
    {"priority", YAML_INT, false, AT(priority), .min = 0, .max = 99},
    {"cpu", YAML_INT, false, AT(cpu), .min = -1, .max = 1023},
    {"lock_memory", YAML_BOOL, false, .offset = AT(lock_memory)},
    {"overrun", YAML_ENUM, false, AT(overrun), .names = loop_overrun_words},
    {"stop_after", YAML_INT, false, AT(stop_after), .min = 1, .max = 1e9},
};
#undef STRUCT
static const struct raw_realtime realtime_defaults = {
    .priority = 80, .cpu = -1, .lock_memory = true, .overrun = LOOP_OVERRUN_SKIP, .stop_after = 1};
static const struct yaml_schema realtime_schema = {
    .what = "the real-time settings",
    .size = sizeof(struct raw_realtime),
    .fields = realtime_fields,
    .field_count = ARRAY_COUNT(realtime_fields),
    .defaults = &realtime_defaults,
};

#define STRUCT raw_record
static const struct yaml_field record_fields[] = {
    {"directory", YAML_STRING, false, AT(directory), .min = 1, .max = 4000,
     .mark_offset = AT(directory_mark)},
    {"format", YAML_ENUM, false, AT(format), .names = recorder_format_words},
};
#undef STRUCT
static const struct raw_record record_defaults = {.format = RECORDER_CSV};
static const struct yaml_schema record_schema = {
    .what = "the record",
    .size = sizeof(struct raw_record),
    .fields = record_fields,
    .field_count = ARRAY_COUNT(record_fields),
    .defaults = &record_defaults,
};

#define STRUCT raw_page
static const struct yaml_field page_fields[] = {
    {"listen", YAML_STRING, true, AT(listen), .min = 1, .max = 80, .mark_offset = AT(listen_mark)},
};
#undef STRUCT
static const struct yaml_schema page_schema = {
    .what = "the page",
    .size = sizeof(struct raw_page),
    .fields = page_fields,
    .field_count = ARRAY_COUNT(page_fields),
};

#define STRUCT raw_gains
static const struct yaml_field gains_fields[] = {
    {"joints", YAML_NAME_LIST, true, .offset = AT(joint), .count_offset = AT(njoint)},
    {"kp_v_per_rad", YAML_REAL, false, AT(kp_v_per_rad), .min = 0.0, .max = 1e6,
     .given_offset = AT(kp_given)},
    {"ki_v_per_rad_s", YAML_REAL, false, AT(ki_v_per_rad_s), .min = 0.0, .max = 1e6,
     .given_offset = AT(ki_given)},
    {"kd_v_s_per_rad", YAML_REAL, false, AT(kd_v_s_per_rad), .min = 0.0, .max = 1e6,
     .given_offset = AT(kd_given)},
    {"kw_v_s_per_rad", YAML_REAL, false, AT(kw_v_s_per_rad), .min = 0.0, .max = 1e6,
     .given_offset = AT(kw_given)},
    {"trim_per_s", YAML_REAL, false, AT(trim_per_s), .min = 0.0, .max = 1e3,
     .given_offset = AT(trim_given)},
    {"sway_damping_per_s", YAML_REAL, false, AT(sway_damping_per_s), .min = 0.0, .max = 1e3,
     .given_offset = AT(damping_given)},
    {"limit_v", YAML_REAL, false, AT(limit_v), .min = DBL_MIN, .max = 1e4,
     .given_offset = AT(limit_given)},
    {"load_v_per_nm", YAML_REAL, false, AT(load_v_per_nm), .min = 0.0, .max = 1e4,
     .given_offset = AT(load_given)},
};
#undef STRUCT
const struct yaml_schema gains_schema = {
    .what = "the gains of some joints",
    .size = sizeof(struct raw_gains),
    .fields = gains_fields,
    .field_count = ARRAY_COUNT(gains_fields),
};

#define STRUCT raw_servo
static const struct yaml_field servo_fields[] = {
    {"kp_v_per_rad", YAML_REAL, true, AT(gains.kp_v_per_rad), .min = 0.0, .max = 1e6},
    {"ki_v_per_rad_s", YAML_REAL, true, AT(gains.ki_v_per_rad_s), .min = 0.0, .max = 1e6},
    {"kd_v_s_per_rad", YAML_REAL, false, AT(gains.kd_v_s_per_rad), .min = 0.0, .max = 1e6},
    {"kw_v_s_per_rad", YAML_REAL, true, AT(gains.kw_v_s_per_rad), .min = 0.0, .max = 1e6},
    {"trim_per_s", YAML_REAL, false, AT(gains.trim_per_s), .min = 0.0, .max = 1e3},
    {"sway_damping_per_s", YAML_REAL, false, AT(gains.sway_damping_per_s), .min = 0.0, .max = 1e3},
    {"limit_v", YAML_REAL, false, AT(gains.limit_v), .min = DBL_MIN, .max = 1e4},
    {"load_v_per_nm", YAML_REAL, false, AT(gains.load_v_per_nm), .min = 0.0, .max = 1e4},
    {"others", YAML_LIST, false, AT(other), AT(nother), .schema = &gains_schema},
    {"command_period_s", YAML_REAL, true, AT(command_period_s), .min = 1e-5, .max = 1.0,
     .mark_offset = AT(command_period_mark)},
};
#undef STRUCT
static const struct yaml_schema servo_schema = {
    .what = "the servo",
    .size = sizeof(struct raw_servo),
    .fields = servo_fields,
    .field_count = ARRAY_COUNT(servo_fields),
};

#define STRUCT raw_squat
static const struct yaml_field squat_fields[] = {
    {"thigh_m", YAML_REAL, true, AT(thigh_m), .min = 0.01, .max = 10.0},
    {"shank_m", YAML_REAL, true, AT(shank_m), .min = 0.01, .max = 10.0},
    {"depth_m", YAML_REAL, true, AT(depth_m), .min = 0.0, .max = 10.0},
    {"period_s", YAML_REAL, true, AT(period_s), .min = 0.1, .max = 1e3},
    {"cycles", YAML_INT, true, AT(cycles), .min = 1, .max = 1e6},
};
#undef STRUCT
static const struct yaml_schema squat_schema = {
    .what = "the squat",
    .size = sizeof(struct raw_squat),
    .fields = squat_fields,
    .field_count = ARRAY_COUNT(squat_fields),
};

#define STRUCT raw_phase
static const struct yaml_field phase_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 31},
    {"until_s", YAML_REAL, true, AT(until_s), .min = DBL_MIN, .max = 1e3},
    {"arm_rad", YAML_REALS, true, AT(arm_rad), .count = GRASP_JOINTS, .min = -7.0, .max = 7.0},
    {"closed", YAML_BOOL, false, .offset = AT(closed)},
};
#undef STRUCT
static const struct yaml_schema phase_schema = {
    .what = "a phase",
    .size = sizeof(struct raw_phase),
    .fields = phase_fields,
    .field_count = ARRAY_COUNT(phase_fields),
};

#define STRUCT raw_grasp
static const struct yaml_field grasp_fields[] = {
    {"settle_s", YAML_REAL, true, AT(settle_s), .min = 0.1, .max = 1e3},
    {"path", YAML_LIST, true, AT(path), AT(npath), .schema = &phase_schema},
    {"hold_s", YAML_REAL, true, AT(hold_s), .min = 0.0, .max = 1e3},
    {"least_press_n", YAML_REAL, true, AT(least_press_n), .min = 0.0, .max = 1e6},
    {"least_carry_n", YAML_REAL, true, AT(least_carry_n), .min = 0.0, .max = 1e6},
};
#undef STRUCT
static const struct yaml_schema grasp_schema = {
    .what = "the grasp",
    .size = sizeof(struct raw_grasp),
    .fields = grasp_fields,
    .field_count = ARRAY_COUNT(grasp_fields),
};

#define STRUCT raw_hold
static const struct yaml_field hold_fields[] = {
    {"duration_s", YAML_REAL, false, AT(duration_s), .min = 0.0, .max = 1e6},
    {"tolerance_rad", YAML_REAL, false, AT(tolerance_rad), .min = 1e-6, .max = 10.0},
};
#undef STRUCT
static const struct raw_hold hold_defaults = {.duration_s = 10.0, .tolerance_rad = 0.05};
static const struct yaml_schema hold_schema = {
    .what = "the hold task",
    .size = sizeof(struct raw_hold),
    .fields = hold_fields,
    .field_count = ARRAY_COUNT(hold_fields),
    .defaults = &hold_defaults,
};

#define STRUCT raw_tasks
static const struct yaml_field tasks_fields[] = {
    {"servo", YAML_MAP, false, AT(servo), .schema = &servo_schema},
    {"squat", YAML_MAP, false, AT(squat), .schema = &squat_schema},
    {"grasp", YAML_MAP, false, AT(grasp), .schema = &grasp_schema},
    {"hold", YAML_MAP, false, AT(hold), .schema = &hold_schema},
    {"walk", YAML_MAP, false, AT(walk), .schema = &task_walk_schema,
     .given_offset = AT(walk_given)},
};
#undef STRUCT
static const struct yaml_schema tasks_schema = {
    .what = "the tasks",
    .size = sizeof(struct raw_tasks),
    .fields = tasks_fields,
    .field_count = ARRAY_COUNT(tasks_fields),
};

#define STRUCT raw_chopper
static const struct yaml_field chopper_fields[] = {
    {"on_v", YAML_REAL, true, AT(on_v), .min = DBL_MIN, .max = 1e4},
    {"off_v", YAML_REAL, true, AT(off_v), .min = DBL_MIN, .max = 1e4},
    {"ohm", YAML_REAL, true, AT(ohm), .min = 1e-3, .max = 1e6},
};
#undef STRUCT
static const struct yaml_schema chopper_schema = {
    .what = "a brake chopper",
    .size = sizeof(struct raw_chopper),
    .fields = chopper_fields,
    .field_count = ARRAY_COUNT(chopper_fields),
};

#define STRUCT raw_rig
static const struct yaml_field rig_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 63},
    {"description", YAML_STRING, false, AT(description), .min = 1, .max = 400},
    {"robot", YAML_MAP, true, AT(robot), .schema = &robot_schema},
    {"clock", YAML_ENUM, false, AT(clock), .names = loop_clock_words},
    {"tick_s", YAML_REAL, false, AT(tick_s), .min = 1e-5, .max = 0.1, .mark_offset = AT(tick_mark)},
    {"substep_s", YAML_REAL, false, AT(substep_s), .min = 1e-7, .max = 1.0,
     .mark_offset = AT(substep_mark)},
    {"integrator", YAML_ENUM, false, AT(integrator), .names = rig_integrator_words},
    {"tolerance", YAML_REAL, false, AT(tolerance), .min = 1e-13, .max = 0.1},
    {"dynamics", YAML_ENUM, false, AT(dynamics), .names = rig_dynamics_words},
    {"personality", YAML_ENUM, false, AT(personality), .names = protocol_words},
    {"protocol", YAML_STRING, false, AT(protocol), .min = 1, .max = 400,
     .mark_offset = AT(protocol_mark)},
    {"supply_v", YAML_REAL, true, AT(supply_v), .min = DBL_MIN, .max = 1e4},
    {"initial", YAML_MAP, true, AT(initial), .schema = &initial_schema},
    {"scene", YAML_MAP, false, AT(scene), .schema = &scene_schema},
    {"motors", YAML_MAP, true, AT(motors), .schema = &motors_schema},
    {"buses", YAML_LIST, true, AT(bus), AT(nbus), .schema = &bus_schema, .entry_key = "name"},
    {"undriven", YAML_NAME_LIST, false, .offset = AT(undriven), .count_offset = AT(nundriven)},
    {"wire", YAML_MAP, false, AT(wire), .schema = &wire_schema},
    {"lockstep", YAML_MAP, false, AT(lockstep), .schema = &lockstep_schema},
    {"realtime", YAML_MAP, false, AT(realtime), .schema = &realtime_schema},
    {"record", YAML_MAP, false, AT(record), .schema = &record_schema},
    {"page", YAML_MAP, false, AT(page), .schema = &page_schema},
    {"tasks", YAML_MAP, false, AT(tasks), .schema = &tasks_schema},
    {"sensors", YAML_MAP, false, AT(sensors), .schema = &rig_sensors_schema},
    {"faults", YAML_NAME_LIST, false, .offset = AT(fault), .count_offset = AT(nfault)},
    {"seed", YAML_INT, false, AT(seed), .min = 0, .max = 9e15},
    {"voltage_delay_s", YAML_REAL, false, AT(voltage_delay_s), .min = 0.0, .max = 0.1,
     .mark_offset = AT(voltage_delay_mark)},
    {"supply_ohm", YAML_REAL, false, AT(supply_ohm), .min = 0.0, .max = 1e3},
    {"supply_capacitance_f", YAML_REAL, false, AT(supply_capacitance_f), .min = 1e-4, .max = 1e3},
    {.key = "supply_returns", .type = YAML_BOOL, .offset = AT(supply_returns)},
    {"brake_chopper", YAML_MAP, false, AT(chopper), .schema = &chopper_schema,
     .given_offset = AT(chopper_given)},
};
#undef STRUCT
static const struct raw_rig rig_defaults = {
    .clock = LOOP_CLOCK_REAL, .tick_s = 0.001, .integrator = PLANT_IMPLICIT, .tolerance = 1e-9};
const struct yaml_schema rig_file_schema = {
    .what = "the rig",
    .size = sizeof(struct raw_rig),
    .fields = rig_fields,
    .field_count = ARRAY_COUNT(rig_fields),
    .hash_offset = offsetof(struct raw_rig, hash),
    .defaults = &rig_defaults,
    .format_version = 1,
    .extendable = true,
    .locate = rig_locate_from,
};
