/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Structs for reading a rig file. The tables of rig/schema.c fill members of struct rig directly
 * where the file has the same form. Elsewhere they fill the raw structs below, for example with
 * names instead of indices and angles instead of rotations. rig/rig.c builds a struct rig from
 * both. Not RT-safe.
 */
#ifndef RIG_SCHEMA_H
#define RIG_SCHEMA_H

#include "rig/rig.h"

/* A series spring of a joint that replaces the spring of the robot's file. */
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
    struct yaml_real_entry *mass; /* masses to add to bodies, kg */
    size_t nmass;
};

struct raw_initial {
    struct yaml_mark mark;
    const char *pose;
    double base_xyz_m[3], base_height_m, base_rpy_rad[3];
    struct yaml_real_entry *joint; /* joint positions that replace positions of the pose */
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
    const char *reason; /* reason why the file excludes the pair, or NULL */
};

/* Contact surfaces made from the robot's capsules. */
struct raw_robot_surfaces {
    struct yaml_mark mark;
    const char *material, *base_material; /* base_material: on the base; NULL = material */
    bool self_collision;
    struct raw_pair *exclude;
    size_t nexclude;
};

struct raw_scene {
    struct yaml_mark mark;
    enum rig_contact_engine engine;
    struct contact_config contact; /* contact laws */
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
    const char *model;      /* only of a described protocol */
    struct yaml_name *axis; /* only for BOARD_MOTOR */
    size_t naxis;
    double current_limit_a;
    double current_gain, torque_gain, torque_offset_nm; /* of a described drive */
    struct yaml_name *joint;                            /* only for BOARD_TORQUE */
    size_t njoint;
    const char *sensor;  /* only for BOARD_FT */
    int external_torque; /* 1 = its joints follow the reported torque, 0 = the reported angle */
};

struct raw_bus {
    struct yaml_mark mark;
    struct rig_bus bus;
    const char *protocol; /* protocol by name or file; NULL = the rig's protocol */
    bool padded;
    struct raw_board *board;
};

/* Switches of one joint. */
struct raw_switches {
    struct yaml_mark mark;
    const char *joint;
    struct board_switches switches;
    bool index_pulse;
};

/* Values common to all motor boards. */
struct raw_motors {
    struct yaml_mark mark;
    double joint_ticks_per_rev, motor_ticks_per_link_rev;
    double limit_margin_rad; /* distance of a board's limits outside its joint's */
    struct board_axis_config axis;
    struct board_config board;
    int rotor_poles;
    struct raw_switches *switches;
    size_t nswitches;
};

struct raw_lockstep {
    struct yaml_mark mark;
    const char *bus; /* name of the bus; NULL = the first bus */
    struct loop_lockstep lockstep;
};

/* Servo gains: the common gains, or an exception for some joints. */
struct raw_gains {
    struct yaml_mark mark;
    struct yaml_name *joint; /* joints of an exception */
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
    struct servo_gains servo; /* common gains */
    struct raw_gains *other;
    size_t nother;
};

/* ---- sensors ---- */

/* Sensors of all joints, or of one joint that differs. If a channel is given for one joint, it
 * replaces the whole common channel. */
struct raw_joint_sensors {
    struct yaml_mark mark;
    struct sensor_joint sensor;
};

struct raw_ft_sensors {
    struct yaml_mark mark;
    struct sensor_ft sensor;
    /* Mass properties of the tool beyond the sensor, in the sensor's frame. */
    struct robot_inertia tool;
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
    struct rig rig; /* members that the schema fills directly */
    const char *description;
    struct raw_robot robot;
    double tick_s, substep_s, voltage_delay_s;
    const char *protocol, *personality; /* see rig_bus_protocol for `personality` */
    struct raw_initial initial;
    struct raw_scene scene;
    struct raw_motors motors;
    struct raw_bus *bus;
    struct yaml_name *undriven;
    size_t nundriven;
    struct raw_lockstep lockstep;
    struct raw_servo servo;
    struct raw_walk walk;
    struct raw_sensors sensors;
};

/* The schema of a rig file. It fills a struct raw_rig. */
extern const struct yaml_schema rig_file_schema;
extern const struct yaml_schema rig_board_schema, gains_schema, rig_sensors_schema;

#endif
