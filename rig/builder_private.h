/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations for the parts of the rig reader. The reader builds a struct rig from a struct
 * raw_rig. SI units. Not RT-safe.
 */
#ifndef RIG_BUILDER_PRIVATE_H
#define RIG_BUILDER_PRIVATE_H

#include "rig/schema.h"

#include <math.h>
#include <string.h>

/* The torque board that sends a joint's torque. */
struct rig_torque {
    const struct raw_board *board; /* NULL = no torque board */
    int bus, channel;
};

/* A place for surfaces: a body or the world. */
struct rig_place {
    const char *name;
    int body; /* index as in struct plant_config; -1 = the world */
    /* Position in the frame of the body or the world, m. Zero, except for static bodies of the
     * scene and for a fixed base. */
    double position[3];
    double rotation[9]; /* rotation to this frame, row-major */
};

struct rig_builder {
    struct rig *rig;
    const struct raw_rig *raw;
    const struct robot *robot;
    /* Pose of the robot's base frame in the frame of body 0: where the rig fixes the base in the
     * world */
    double base_position[3], base_rotation[9];
    struct arena *arena;
    struct error *error;
    struct rig_torque *torque;       /* one entry per joint of the robot */
    const struct raw_board **driver; /* per joint: the board that drives it; NULL = none */
    const struct raw_board **ft;     /* per force-torque sensor: its board */
    const struct raw_board *imu;     /* board of the inertial sensor; NULL = no board */
    struct rig_bus *bus;             /* writable rig->bus */
    struct rig_place *place;         /* places that a surface's key "body" may name */
    size_t nplace;
    struct rig_left_pair *left; /* writable rig->left */
};

/* Build the parts of the rig. The order of calls follows their dependencies. */
enum error_code rig_build_robot(struct rig_builder *b);
enum error_code rig_build_pose(struct rig_builder *b);
enum error_code rig_build_bodies(struct rig_builder *b);
enum error_code rig_build_scene(struct rig_builder *b);
enum error_code rig_build_boards(struct rig_builder *b);

/* Checks the boards of a bus with a described protocol. Refuses boards that share an identifier if
 * their frames cannot be distinguished. Call it after the boards of all buses are built. */
enum error_code rig_check_described_ids(struct rig_builder *b, size_t bus);
enum error_code rig_build_faults(struct rig_builder *b);
enum error_code rig_build_sensors(struct rig_builder *b);

/* Overrides gains for single joints. `gains` has one entry per axis, and `other` has `nother`
 * exceptions. */
enum error_code rig_override_gains(struct rig_builder *b, const struct raw_gains *other,
                                   size_t nother, struct servo_gains *gains);

/* Builds the robot's body model for tasks, as a part of rig_build_host. Call it after the axes are
 * built. */
enum error_code rig_build_task_body(struct rig_builder *b);

/* Builds a pair of surfaces from their names. */
enum error_code rig_build_pair(struct rig_builder *b, const struct raw_pair *raw,
                               struct contact_pair *pair);

/* Appends the pairs of the robot to the *npair pairs of the file, and increases *npair. The array
 * must have room for all pairs. */
enum error_code rig_add_robot_pairs(struct rig_builder *b, struct contact_pair *pair,
                                    size_t *npair);

/* Checks that every drive belongs to an axis or is listed in "undriven". */
enum error_code rig_check_drives(struct rig_builder *b);

enum error_code rig_no_memory(struct rig_builder *b);

#define RIG_NAMES(array, count) YAML_NAMES(array, count, name)

/* Finds a name in an array of structs (yaml_find_name). */
enum error_code rig_find(struct rig_builder *b, const struct yaml_mark *mark, const char *what,
                         const char *name, struct yaml_names names, int *index);

/* Checks the characters of a name, because messages, command lines and file names use it. */
enum error_code rig_check_name(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, const char *name);

/* If a file cannot be read, adds the place of its reference in the rig to the error. An error
 * inside the file already has a place. Returns `code`. */
enum error_code rig_place_file(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *path, enum error_code code);

/* A key that only some kinds of a section allow or require. A mask has bit 1 << kind for each
 * kind. */
struct rig_key {
    const char *key;
    unsigned allowed, required;
};

enum error_code rig_check_keys(struct rig_builder *b, const struct yaml_mark *mark,
                               const char *what, int kind, const struct rig_key *keys,
                               size_t count);

/* Returns whether `seconds` is a whole number of nanoseconds. Writes this number to *ns. */
bool rig_whole_ns(double seconds, int64_t *ns);

#endif
