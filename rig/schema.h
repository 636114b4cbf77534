/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig file while it is read: the structs of the rig, filled by the rows of schema.c, and beside
 * them what the file says in other terms than they do: names that are not yet looked up, angles
 * that become rotations. rig/rig.c completes a struct rig with it. Not RT-safe.
 */
#ifndef RIG_SCHEMA_H
#define RIG_SCHEMA_H

#include "rig/rig.h"

/* A joint's series spring instead of the robot's. */
struct raw_spring {
    struct yaml_mark mark;
    const char *joint;
    double Ks_nm_rad, Ds_nm_s_rad;
};

struct raw_robot {
    struct yaml_mark mark;
    const char *file, *variant;
    bool fixed_base;
    struct raw_spring *spring;
    size_t nspring;
    struct yaml_real_entry *mass; /* added to bodies */
    size_t nmass;
};

struct raw_initial {
    struct yaml_mark mark;
    const char *pose;
    double base_xyz_m[3], base_height_m, base_rpy_rad[3];
    struct yaml_real_entry *joint; /* instead of the pose's */
    size_t njoint;
    int hold;
    bool settle;
};

struct raw_material {
    struct yaml_mark mark;
    const char *name;
    struct contact_material material;
};

struct raw_surface {
    struct yaml_mark mark;
    const char *body, *frame, *mesh, *material;
    double xyz_m[3], rpy_rad[3];
    struct contact_surface surface;
};

/* A body of the scene. */
struct raw_body {
    struct yaml_mark mark;
    bool is_static;
    double box_m[3], rpy_rad[3];
    struct plant_free_body body;
};

struct raw_pair {
    struct yaml_mark mark;
    struct yaml_name *between;
    size_t nbetween;
    const char *reason; /* of one that is left out, or NULL */
};

/* Surfaces from the robot's capsules. */
struct raw_robot_surfaces {
    struct yaml_mark mark;
    const char *material;
    bool self_collision;
    struct raw_pair *exclude;
    size_t nexclude;
};

struct raw_scene {
    struct yaml_mark mark;
    enum rig_contact_engine engine;
    struct contact_config contact; /* its laws */
    struct raw_material *material;
    size_t nmaterial;
    struct raw_body *body;
    size_t nbody;
    struct raw_surface *surface;
    size_t nsurface;
    struct raw_pair *pair;
    size_t npair;
    struct raw_robot_surfaces robot_surfaces;
};

struct raw_board {
    struct yaml_mark mark;
    struct board_config board;
    int64_t address;
    struct yaml_name *axis; /* BOARD_MOTOR */
    size_t naxis;
    double current_limit_a;
    struct yaml_name *joint; /* BOARD_TORQUE */
    size_t njoint;
    const char *sensor;  /* BOARD_FT */
    int external_torque; /* its joints follow the torque that it tells, not the angle */
};

struct raw_bus {
    struct yaml_mark mark;
    struct rig_bus bus;
    int personality;      /* the rig's unless given */
    const char *protocol; /* of BOARD_DESCRIBED; the rig's unless given */
    bool padded;
    struct raw_board *board;
};

/* Switches of a joint. */
struct raw_switches {
    struct yaml_mark mark;
    const char *joint;
    struct board_switches switches;
    bool index_pulse;
};

/* Values that all motor boards share. */
struct raw_motors {
    struct yaml_mark mark;
    double joint_ticks_per_rev, motor_ticks_per_link_rev;
    struct board_axis_config axis;
    struct board_config board;
    int rotor_poles;
    struct raw_switches *switches;
    size_t nswitches;
};

struct raw_wire {
    struct yaml_mark mark;
    int mode, pace, order;
};

struct raw_lockstep {
    struct yaml_mark mark;
    const char *bus; /* NULL = the first */
    struct loop_lockstep lockstep;
};

/* Gains of the servo's loops, or of some joints that differ. */
struct raw_gains {
    struct yaml_mark mark;
    struct yaml_name *joint; /* that differ */
    size_t njoint;
    struct servo_gains gains;
};

struct raw_servo {
    struct yaml_mark mark;
    struct servo_gains gains;
    struct raw_gains *other;
    size_t nother;
    double command_period_s;
};

struct raw_walk {
    struct yaml_mark mark;
    struct walk_config config;
    struct servo_gains servo; /* common ones */
    struct raw_gains *other;
    size_t nother;
};

/* ---- sensors ---- */

/* Of all joints, or of one that differs: a channel that it gives replaces the whole channel. */
struct raw_joint_sensors {
    struct yaml_mark mark;
    struct sensor_joint sensor;
};

struct raw_ft_sensors {
    struct yaml_mark mark;
    struct sensor_ft sensor;
    struct robot_inertia tool; /* what hangs beyond the sensor, in its frame */
};

struct raw_imu_sensors {
    struct yaml_mark mark;
    struct sensor_imu sensor;
};

struct raw_sensors {
    struct yaml_mark mark;
    struct raw_joint_sensors every_joint, *joint;
    size_t njoint;
    struct raw_ft_sensors every_ft, *ft;
    size_t nft;
    struct raw_imu_sensors imu;
    struct sensor_clocks clocks;
};

struct raw_rig {
    struct yaml_mark mark;
    struct rig rig; /* as far as the file says it in the same terms */
    const char *description;
    struct raw_robot robot;
    double tick_s, substep_s, voltage_delay_s;
    int personality;
    const char *protocol;
    struct raw_initial initial;
    struct raw_scene scene;
    struct raw_motors motors;
    struct raw_bus *bus;
    struct yaml_name *undriven;
    size_t nundriven;
    struct raw_wire wire;
    struct raw_lockstep lockstep;
    struct raw_servo servo;
    struct raw_walk walk;
    struct raw_sensors sensors;
};

/* Schema of a whole file: fills a struct raw_rig. */
extern const struct yaml_schema rig_file_schema;
extern const struct yaml_schema gains_schema, rig_sensors_schema;

#endif
