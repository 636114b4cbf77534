/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the parts of the rig reader, which build a struct rig from a struct
 * raw_rig. SI units. Not RT-safe.
 */
#ifndef RIG_BUILDER_PRIVATE_H
#define RIG_BUILDER_PRIVATE_H

#include "rig/rig.h"
#include "rig/schema.h"

/* The torque board that sends a joint's torque. */
struct rig_torque {
    const struct raw_board *board; /* NULL = none */
    int bus, channel;
};

/* A place that surfaces may be fixed to: a body or the world. */
struct rig_place {
    const char *name;
    int body; /* as in struct plant_config; -1 = the world */
    /* in that body or the world; zero except for static bodies of the scene and a fixed base */
    double position[3];
    double rotation[9]; /* rotation, row-major */
};

struct rig_builder {
    struct rig *rig;
    const struct raw_rig *raw;
    const struct robot *robot;
    /* pose of the robot's base frame in the frame of body 0: where the rig fixes it in the
     * world */
    double base_position[3], base_rotation[9];
    struct arena *arena;
    struct error *error;
    struct rig_torque *torque;       /* by joint of the robot */
    const struct raw_board **driver; /* by joint: the board that drives it; NULL = none */
    const struct raw_board **ft;     /* by F/T sensor: its board */
    const struct raw_board *imu;     /* board of the inertial sensor; NULL = none */
    struct rig_bus *bus;             /* buses of the rig, under construction */
    struct rig_place *place;         /* places that the key "body" of a surface may name */
    size_t nplace;
    struct rig_left_pair *left; /* of the rig, under construction */
};

/* Build the parts, in order of their dependencies. */
enum error_code rig_build_robot(struct rig_builder *b);
enum error_code rig_build_pose(struct rig_builder *b);
enum error_code rig_build_bodies(struct rig_builder *b);
enum error_code rig_build_scene(struct rig_builder *b);
enum error_code rig_build_boards(struct rig_builder *b);

/* Refuses boards of a described bus that share an identifier if their frames cannot be
 * distinguished (described_ids.c). Call it after the boards of all buses are built. */
enum error_code rig_check_described_ids(struct rig_builder *b, size_t bus);
enum error_code rig_build_faults(struct rig_builder *b);
enum error_code rig_build_sensors(struct rig_builder *b);

/* Overrides gains, one per axis, for the joints of each of the `nother` exceptions. */
enum error_code rig_override_gains(struct rig_builder *b, const struct raw_gains *other,
                                   size_t nother, struct servo_gains *gains);

/* Builds the robot's body model for tasks; the axes must be known (part of rig_build_host). */
enum error_code rig_build_task_body(struct rig_builder *b);

/* Builds a pair of surfaces by their names. */
enum error_code rig_build_pair(struct rig_builder *b, const struct raw_pair *raw,
                               struct contact_pair *pair);

/* Appends the robot's pairs to the npair pairs of the file, and raises npair. The array must have
 * room for all. */
enum error_code rig_add_robot_pairs(struct rig_builder *b, struct contact_pair *pair,
                                    size_t *npair);

/* Checks that every drive belongs to an axis or is listed in "undriven". */
enum error_code rig_check_drives(struct rig_builder *b);

enum error_code rig_no_memory(struct rig_builder *b);

#define RIG_NAMES(array, count) YAML_NAMES(array, count, name)

/* Finds a name (yaml_find_name). */
enum error_code rig_find(struct rig_builder *b, const struct yaml_mark *mark, const char *what,
                         const char *name, struct yaml_names names, int *index);

/* Checks the characters of a name, which appears in messages, on command lines and in file
 * names. */
enum error_code rig_check_name(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, const char *name);

/* Adds the place that names a file to the error of reading it, if the file cannot be read. Other
 * errors have a place in the file. Returns code. */
enum error_code rig_place_file(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *path, enum error_code code);

/* A key that only some kinds allow or require; masks have bit 1 << kind. */
struct rig_key {
    const char *key;
    unsigned allowed, required;
};

enum error_code rig_check_keys(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, int kind, const struct rig_key *keys,
                               size_t count);

/* Returns whether seconds are a whole number of nanoseconds, written to *ns. */
bool rig_whole_ns(double seconds, int64_t *ns);

#endif
