/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig file as it is written: every key has a member here and its declaration in schema.c. Names
 * are not yet looked up, times are in seconds, marks (file, line, column) are kept for messages.
 * rig/rig.c makes a struct rig of it. Not RT-safe.
 */
#ifndef RIG_SCHEMA_H
#define RIG_SCHEMA_H

#include "base/yaml.h"
#include "rig/sensors.h"
#include "tasks/task.h"

#include <stdint.h>

/* A joint's series spring instead of the robot's. */
struct raw_spring {
    struct yaml_mark mark;
    const char *joint;
    double Ks_nm_rad, Ds_nm_s_rad;
};

struct raw_robot {
    struct yaml_mark mark, file_mark;
    const char *file, *variant;
    bool fixed_base;
    struct raw_spring *spring;
    size_t nspring;
    struct yaml_real_entry *mass; /* added to bodies */
    size_t nmass;
};

struct raw_initial {
    struct yaml_mark mark, pose_mark;
    const char *pose;
    double base_xyz_m[3], base_height_m, base_rpy_rad[3];
    bool position_given, height_given, rpy_given;
    struct yaml_real_entry *joint; /* instead of the pose's */
    size_t njoint;
    int hold;
    bool settle;
};

struct raw_material {
    struct yaml_mark mark;
    const char *name;
    double young_pa, thickness_m, backing_pa_per_m, dissipation_s_per_m;
    double static_friction, dynamic_friction, viscous_s_per_m;
};

struct raw_surface {
    struct yaml_mark mark;
    const char *name;
    struct yaml_mark name_mark;
    const char *body, *frame;
    struct yaml_mark body_mark, frame_mark;
    bool body_given, frame_given;
    int shape;
    double xyz_m[3], rpy_rad[3];
    double radius_m, length_m, half_extents_m[3];
    int64_t cells;
    const char *mesh;
    struct yaml_mark mesh_mark;
    bool radius_given, length_given, half_extents_given, cells_given, mesh_given;
    const char *material;
    struct yaml_mark material_mark;
};

/* A body of the scene. */
struct raw_body {
    struct yaml_mark mark;
    const char *name;
    struct yaml_mark name_mark;
    bool is_static;
    double mass_kg, com_m[3], inertia_kg_m2[6], box_m[3], sphere_radius_m;
    struct yaml_mark mass_mark, inertia_mark;
    bool mass_given, com_given, inertia_given, box_given, sphere_given;
    double xyz_m[3], rpy_rad[3], velocity_m_s[3], rate_rad_s[3];
    bool velocity_given, rate_given;
};

struct raw_pair {
    struct yaml_mark mark;
    struct yaml_name *between;
    size_t nbetween;
    struct yaml_mark between_mark;
    const char *reason; /* of one that is left out, or NULL */
};

/* Surfaces from the robot's capsules. */
struct raw_robot_surfaces {
    struct yaml_mark mark;
    const char *material;
    struct yaml_mark material_mark;
    bool self_collision;
    struct raw_pair *exclude;
    size_t nexclude;
};

struct raw_scene {
    struct yaml_mark mark;
    int engine, friction;
    struct yaml_mark friction_mark;
    bool friction_given; /* else sticking where the engine has it */
    double transition_velocity_m_s;
    int mesh_law; /* enum contact_mesh_law */
    struct raw_material *material;
    size_t nmaterial;
    struct raw_body *body;
    size_t nbody;
    struct raw_surface *surface;
    size_t nsurface;
    struct raw_pair *pair;
    size_t npair;
    struct raw_robot_surfaces robot_surfaces;
    bool robot_surfaces_given;
};

struct raw_board {
    struct yaml_mark mark;
    const char *name;
    int kind;
    int64_t address;
    struct yaml_mark address_mark;
    struct yaml_name *axis; /* BOARD_MOTOR */
    size_t naxis;
    struct yaml_mark axis_mark;
    double current_limit_a;
    struct yaml_name *joint; /* BOARD_TORQUE */
    size_t njoint;
    struct yaml_mark joint_mark;
    const char *sensor; /* BOARD_FT */
    struct yaml_mark sensor_mark;
    double full_scale_n[3], full_scale_nm[3];
    struct yaml_mark full_scale_n_mark, full_scale_nm_mark;
    double period_s; /* BOARD_FT, BOARD_TORQUE, BOARD_INERTIAL */
    struct yaml_mark period_mark;
    bool transmit_at_start;
    bool external; /* a real one */
    struct yaml_mark external_mark;
    int external_torque; /* its joints follow the torque that it tells, not the angle */
    struct yaml_mark external_follows_mark;
    bool external_follows_given;
    double external_timeout_s;
    struct yaml_mark external_timeout_mark;
    bool external_timeout_given;
    bool axis_given, current_given, joint_given, sensor_given, full_scale_n_given,
        full_scale_nm_given, period_given;
};

struct raw_bus {
    struct yaml_mark mark;
    const char *name, *interface;
    struct yaml_mark name_mark, interface_mark;
    int64_t bitrate, data_bitrate;
    bool fd;
    struct yaml_mark fd_mark, data_bitrate_mark;
    int personality; /* the rig's unless given */
    bool data_bitrate_given, personality_given;
    const char *protocol; /* of BOARD_DESCRIBED; the rig's unless given */
    struct yaml_mark protocol_mark;
    bool padded;
    struct yaml_mark padded_mark;
    bool configure; /* of a real interface, with the two below */
    double sample_point;
    int64_t restart_ms;
    struct yaml_mark sample_point_mark, restart_mark;
    bool sample_point_given, restart_given;
    struct raw_board *board;
    size_t nboard;
};

/* Switches of a joint. */
struct raw_switches {
    struct yaml_mark mark, home_mark, negative_mark;
    const char *joint;
    double negative_rad, positive_rad, home_rad[2];
    bool negative_given, positive_given, home_given, index_pulse;
};

/* Values that all motor boards share. */
struct raw_motors {
    struct yaml_mark mark;
    double joint_ticks_per_rev, motor_ticks_per_link_rev;
    double torque_full_scale_nm;
    struct yaml_mark torque_full_scale_mark;
    int64_t rotor_poles;
    double current_limit_a, temperature_limit_c, command_timeout_s;
    double status_period_s, boot_s;
    bool strict, require_calibration, keep_firmware, discovery_stops_motors;
    struct yaml_mark require_calibration_mark;
    struct raw_switches *switches;
    size_t nswitches;
};

struct raw_wire {
    struct yaml_mark mark;
    int mode, pace, order, budget;
    int64_t queue;
    double restart_s;
};

struct raw_lockstep {
    struct yaml_mark mark;
    const char *bus; /* NULL = the first */
    struct yaml_mark bus_mark, step_mark, done_mark;
    int64_t step_id, done_id;
    double partner_timeout_s;
};

struct raw_realtime {
    struct yaml_mark mark;
    int64_t priority, cpu, stop_after;
    bool lock_memory;
    int overrun;
};

struct raw_record {
    struct yaml_mark mark, directory_mark;
    const char *directory;
    int format;
};

struct raw_page {
    struct yaml_mark mark, listen_mark;
    const char *listen;
};

/* Gains of the servo's loops, or of some joints that differ. */
struct raw_gains {
    struct yaml_mark mark;
    struct yaml_name *joint; /* that differ */
    size_t njoint;
    double kp_v_per_rad, ki_v_per_rad_s, kd_v_s_per_rad, kw_v_s_per_rad, trim_per_s,
        sway_damping_per_s, limit_v, load_v_per_nm;
    bool kp_given, ki_given, kd_given, kw_given, trim_given, damping_given, limit_given, load_given;
};

struct raw_servo {
    struct yaml_mark mark;
    struct raw_gains gains;
    struct raw_gains *other;
    size_t nother;
    double command_period_s;
    struct yaml_mark command_period_mark;
};

struct raw_squat {
    struct yaml_mark mark;
    double thigh_m, shank_m, depth_m, period_s;
    int64_t cycles;
};

struct raw_phase {
    struct yaml_mark mark;
    const char *name;
    double until_s, arm_rad[GRASP_JOINTS];
    bool closed;
};

struct raw_grasp {
    struct yaml_mark mark;
    double settle_s, hold_s, least_press_n, least_carry_n;
    struct raw_phase *path;
    size_t npath;
};

struct raw_hold {
    struct yaml_mark mark;
    double duration_s, tolerance_rad;
};

/* Numbers of a walk, which go directly into the task's configuration (rig/schema_task_walk.c). */
struct raw_walk {
    struct yaml_mark mark;
    struct walk_config config;
    struct servo_gains servo; /* common ones */
    struct raw_gains *other;
    size_t nother;
};

extern const struct yaml_schema task_walk_schema, gains_schema;

struct raw_tasks {
    struct yaml_mark mark;
    struct raw_servo servo;
    struct raw_squat squat;
    struct raw_grasp grasp;
    struct raw_hold hold;
    struct raw_walk walk;
    bool walk_given;
};

struct raw_chopper {
    struct yaml_mark mark;
    double on_v, off_v, ohm;
};

struct raw_rig {
    struct yaml_mark mark;
    uint64_t hash; /* of the file's bytes */
    const char *name, *description;
    struct raw_robot robot;
    int clock;
    double tick_s, substep_s, voltage_delay_s;
    struct yaml_mark voltage_delay_mark;
    struct yaml_mark tick_mark, substep_mark;
    int integrator, dynamics, personality;
    const char *protocol;
    struct yaml_mark protocol_mark;
    double tolerance, supply_v;
    struct raw_initial initial;
    struct raw_scene scene;
    struct raw_motors motors;
    struct raw_bus *bus;
    size_t nbus;
    struct yaml_name *undriven;
    size_t nundriven;
    struct raw_wire wire;
    struct raw_lockstep lockstep;
    struct raw_realtime realtime;
    struct raw_record record;
    struct raw_page page;
    struct raw_tasks tasks;
    struct raw_sensors sensors;
    struct yaml_name *fault; /* a line each (faults/faults.h) */
    size_t nfault;
    int64_t seed;
    double supply_ohm, supply_capacitance_f;
    bool supply_returns;
    struct raw_chopper chopper;
    bool chopper_given;
};

/* Schema of a whole file: fills a struct raw_rig. */
extern const struct yaml_schema rig_file_schema;

#endif
