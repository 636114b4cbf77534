/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reduces a foreign robot to one of ours, with one body for each moving joint. Links on fixed
 * joints become part of the body that carries them, exactly, and stay as frames. Joints that cannot
 * or should not move are fixed at their rest position. Each change adds a note. Errors have
 * file:line and a remedy. Memory from the arena. Not RT-safe.
 */
#ifndef APP_IMPORT_TREE_SIMPLIFY_H
#define APP_IMPORT_TREE_SIMPLIFY_H

#include "app/import/model.h"

enum import_base { IMPORT_BASE_GUESS, IMPORT_BASE_FIXED, IMPORT_BASE_FLOATING };

/* Treatment of joints that follow another one (URDF mimic, MJCF equality). */
enum import_mimic {
    IMPORT_MIMIC_REFUSE,
    IMPORT_MIMIC_LOCK,
    IMPORT_MIMIC_FREE,
    IMPORT_MIMIC_COUPLE,
};

struct import_options {
    int base, mimic;         /* values of the enums above */
    bool free_slides;        /* prismatic joints move without a drive; false: they are fixed */
    const char *const *lock; /* names of joints to be fixed */
    size_t nlock;
    bool repair_inertia;      /* increase impossible moments of inertia; false: refuse them */
    const char *const *drive; /* --drive options: NAME or JOINTS=NAME (drive.h) */
    size_t ndrive;
};

/* The robot made from a model, and the sources of its parts. */
struct import_robot {
    const struct import_model *model;
    /* without drives, stops and capsules; couplings without stiffness; not finished
     * (robot_finish) */
    struct robot *robot;
    const struct import_joint **source; /* by joint of the robot */
    double *rest; /* by joint of the robot: rest position, 0 or the nearest allowed one */
    /* By link of the model: its body; -1 = fixed in the world in which the base floats */
    int *body;
    struct import_place *place; /* pose of the link in that body */
    bool *fixed;                /* by joint of the model: it is fixed */
    /* By joint of the robot, from the catalogue; NULL = the drive is assumed */
    const struct robot_drive **drive;
    const char **drive_file; /* name in a robot file */
    /* Path of a user's own file, which is copied; NULL: found by its name */
    const char **drive_copy;
};

/* Reduces the model to a robot; out keeps pointers into the model. */
enum error_code import_simplify_tree(const struct import_model *model,
                                     const struct import_options *options, struct arena *arena,
                                     struct import_notes *notes, struct import_robot *out,
                                     struct error *error);

#endif
