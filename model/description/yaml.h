/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A robot file as it is read, before the robot is built, and functions that the parts of the reader
 * share: schema.c (keys and ranges), yaml.c (names, variants, order of the steps), yaml_joints.c
 * (bodies and joints), yaml_drive.c (drives and their catalogue), yaml_hydraulic.c (hydraulic
 * drives), yaml_couplings.c (joints that follow others), yaml_frames.c (frames, visuals, sensors,
 * poses).
 *
 * Units are part of the keys and of the names here. The arena owns all memory. Functions return
 * ERROR_INPUT with file:line:column, or ERROR_MEMORY. Not RT-safe.
 */
#ifndef MODEL_DESCRIPTION_YAML_H
#define MODEL_DESCRIPTION_YAML_H

#include "model/robot.h"

/* First members of each struct that has a name. find_named_entry reads them. */
struct named {
    struct yaml_mark mark;
    const char *name;
};

struct body_yaml {
    struct yaml_mark mark;
    struct robot_body body;
};

/* Default time constant with which a stop returns, s. */
#define STOP_RETURNS 1e-3

struct stops_yaml {
    struct yaml_mark mark;
    bool enabled;
    struct robot_stop stop[2]; /* indexed by enum joint_type */
};

struct passive_yaml {
    struct yaml_mark mark;
    struct robot_passive passive;
};

/* A sine of the cogging torque or of the gear's angle error. */
struct harmonic_yaml {
    struct yaml_mark mark;
    struct robot_harmonic sine;
};

/* Kinds of drives. All keys of a drive must belong to one kind. */
enum drive_kind { DRIVE_UNSAID, DRIVE_ELECTRIC, DRIVE_HYDRAULIC };

struct drive_yaml {
    struct yaml_mark mark;
    const char *file; /* file of the catalogue, by name or path; NULL = none */
    struct robot_sea sea;
    struct robot_effects effects;
    struct harmonic_yaml *error, *cogging;
    size_t nerror, ncogging;
    struct robot_hydraulic cylinder;
    double bore, rod, valve_hz, valve_flow, valve_drop;
};

/* A drive of the catalogue. */
struct drive_file_yaml {
    struct yaml_mark mark;
    struct robot_drive made; /* all members except sea and hydraulic */
    struct drive_yaml drive;
};

struct joint_yaml {
    struct yaml_mark mark;
    struct robot_joint joint;
    const char *parent, *child;
    double rpy[3];
    struct stops_yaml stops;
    struct drive_yaml drive, hydraulic; /* hydraulic: older key for a hydraulic drive */
    int64_t spring_sense;
    struct passive_yaml passive;
};

struct coupling_yaml {
    struct yaml_mark mark;
    const char *follower, *leader;
    struct robot_coupling coupling;
};

struct frame_yaml {
    struct yaml_mark mark;
    struct robot_frame frame;
    const char *body;
    double rpy[3];
};

struct capsule_yaml {
    struct yaml_mark mark;
    struct robot_capsule capsule;
    const char *body;
    double rpy[3];
};

struct visual_yaml {
    struct yaml_mark mark;
    struct robot_visual visual;
    const char *body, *file; /* file: NULL = not given */
    double rpy[3];
};

struct ft_yaml {
    struct yaml_mark mark;
    struct robot_ft_sensor sensor;
    const char *frame;
};

struct pose_yaml {
    struct yaml_mark mark;
    struct robot_pose pose;
    double base_rpy[3];
    struct yaml_real_entry *joint_rad, *joint_m;
    size_t njoint_rad, njoint_m;
};

struct variant_yaml {
    struct yaml_mark mark;
    const char *name;
    struct body_yaml *body;
    struct joint_yaml *joint;
    struct frame_yaml *frame;
    struct capsule_yaml *capsule;
    struct ft_yaml *ft;
    struct drive_yaml drive;
    struct passive_yaml passive;
    size_t nbody, njoint, nframe, ncapsule, nft;
};

struct robot_yaml {
    struct yaml_mark mark;
    uint64_t hash; /* hash of the file's bytes */
    const char *name, *description, *source;
    double gravity[3];
    int floating;
    const char *base, *imu_frame;
    struct drive_yaml drive, hydraulic;
    struct robot_hydraulic_supply hydraulic_supply;
    struct stops_yaml stops;
    struct passive_yaml passive; /* default of all revolute joints with a drive */
    struct body_yaml *body;
    struct joint_yaml *joint;
    struct coupling_yaml *coupling;
    struct frame_yaml *frame;
    struct capsule_yaml *capsule;
    struct visual_yaml *visual;
    struct ft_yaml *ft;
    struct pose_yaml *pose;
    struct variant_yaml *variant;
    size_t nbody, njoint, ncoupling, nframe, ncapsule, nvisual, nft, npose, nvariant;
};

/* The schema of a robot file: fills a struct robot_yaml. */
extern const struct yaml_schema robot_file_schema;

/* The schema of a drive file: fills a struct drive_file_yaml. */
extern const struct yaml_schema drive_file_schema;

extern const struct yaml_schema robot_drive_schema, robot_stops_schema;
extern const struct word robot_visual_shapes[];

/* Returns the schema rows of a kind of drive; *count is their number. */
const struct yaml_field *robot_drive_rows(enum drive_kind kind, size_t *count);

/* The robot under construction and the data that its steps need. */
struct robot_builder {
    struct robot_yaml file;
    struct robot *robot;
    struct arena *arena;
    struct error *error;
};

/* Returns the index of name in an array of named structs, each of stride bytes, or -1. */
int find_named_entry(const void *array, size_t count, size_t stride, const char *name);

enum error_code robot_no_memory(struct robot_builder *b);

/* Refuses mass properties that are physically impossible. The error points to mark. */
enum error_code robot_refuse_inertia(struct robot_builder *b, const struct yaml_mark *mark,
                                     const struct robot_inertia *inertia);

/* Returns the number of the given keys that a mapping has. */
size_t robot_count_keys(const struct yaml_mark *mapping, const char *const *keys, size_t count);

/* Returns the kind of a drive from its keys; DRIVE_UNSAID if it has none. */
enum drive_kind robot_drive_kind(const struct drive_yaml *drive);

/* Fills missing values of a drive from its catalogue file, if it names one. Refuses a drive with
 * keys of both kinds. */
enum error_code robot_take_drive(struct robot_builder *b, struct drive_yaml *drive);

/* Merges a variant's drive into the robot's own drive of the same kind; the variant's numbers
 * win. */
enum error_code robot_change_drive(struct robot_builder *b, struct drive_yaml *change);

/* Refuses two hydraulic drives for the whole robot, given by the keys drive and hydraulic. */
enum error_code robot_check_own_drives(struct robot_builder *b);

/* Merges change into drive. Values of change, and their places in the file, replace values of
 * drive. */
enum error_code robot_merge_drive(struct robot_builder *b, const struct drive_yaml *change,
                                  struct drive_yaml *drive);

/* Builds the drive of a joint, if it has one. Missing values come from the robot's own drive of
 * this kind. The joint's range must be known. */
enum error_code robot_build_drive(struct robot_builder *b, struct joint_yaml *given,
                                  struct robot_joint *joint);

/* Builds the hydraulic drive of a joint. Missing values come from the robot's own drive. */
enum error_code robot_build_hydraulic(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_joint *joint);

/* Builds a cylinder. Each parameter comes from the drive, else from the robot. joint: name of the
 * joint; NULL for a drive of the catalogue, which has no triangle. */
enum error_code robot_build_cylinder(struct robot_builder *b, const struct drive_yaml *drive,
                                     const char *joint, struct robot_hydraulic *cylinder);

/* Returns whether a key belongs to the triangle of a hydraulic joint. */
bool robot_key_is_of_triangle(const char *key);

/* Builds the supply of all hydraulic drives. */
enum error_code robot_build_hydraulic_supply(struct robot_builder *b);

/* Build the parts of the robot in this order: bodies and joints (in the order of the joints),
 * couplings, frames, capsules, visuals, sensors, poses. */
enum error_code robot_build_tree(struct robot_builder *b);
enum error_code robot_build_couplings(struct robot_builder *b);
enum error_code robot_build_frames(struct robot_builder *b);
enum error_code robot_build_capsules(struct robot_builder *b);
enum error_code robot_build_visuals(struct robot_builder *b);
enum error_code robot_build_sensors(struct robot_builder *b);
enum error_code robot_build_poses(struct robot_builder *b);

#endif
