/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reduces a foreign robot to a robot with one body per moving joint. Links on fixed joints become
 * part of the body that carries them, without loss, and stay as frames. Joints that cannot or
 * should not move are fixed at their rest position. Each change adds a note. Errors have file:line
 * and a remedy. Memory is from the arena. Not RT-safe.
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
    int base, mimic;         /* enum import_base, enum import_mimic */
    bool free_slides;        /* let prismatic joints move without a drive; false = fix them */
    bool drive_slides;       /* drive prismatic joints by pinions */
    const char *const *lock; /* names of joints to fix */
    size_t nlock;
    bool repair_inertia;      /* increase impossible moments of inertia; false = refuse them */
    const char *const *drive; /* --drive options: NAME or JOINTS=NAME (drive.h) */
    size_t ndrive;
};

/* The robot made from a model, with the source of each part. */
struct import_robot {
    const struct import_model *model;
    /* The robot lacks drives, stops, capsules and the stiffness of couplings, and is not finished
     * (robot_finish) */
    struct robot *robot;
    const struct import_joint **source; /* by joint of the robot: its joint in the model */
    double *rest; /* by joint of the robot: rest position, 0 or the nearest allowed one */
    /* By link of the model: its body; -1 = part of the fixed world, if the base floats */
    int *body;
    struct import_place *place; /* by link of the model: its pose in the body */
    bool *fixed;                /* by joint of the model: whether it is fixed */
    bool rolls;                 /* the base has at least two wheels, on continuous joints */
    /* By joint of the robot: its drive from the catalogue; NULL = assume a drive */
    const struct robot_drive **drive;
    const char **drive_file; /* by joint of the robot: name of the drive in a robot file */
    /* By joint of the robot: path of the user's own drive file to copy; NULL = none */
    const char **drive_copy;
};

/* Adds a joint that turns, a pinion, for each prismatic joint that a drive may move. The prismatic
 * joint follows it as a rack does. */
enum error_code import_add_pinions(struct import_model *model, struct arena *arena,
                                   struct import_notes *notes, struct error *error);

/* Reduces the model to a robot. out points into the model. */
enum error_code import_simplify_tree(const struct import_model *model,
                                     const struct import_options *options, struct arena *arena,
                                     struct import_notes *notes, struct import_robot *out,
                                     struct error *error);

#endif
