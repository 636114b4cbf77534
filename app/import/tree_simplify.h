/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reduces a foreign robot to one of ours: one body for each joint that moves. Links on fixed joints
 * become part of the body that carries them, exactly, and stay as frames; joints that cannot or
 * shall not move are fixed where they rest. Everything that is done is noted; what cannot be done
 * is refused with file:line and a remedy. Memory from the arena. Not RT-safe.
 */
#ifndef APP_IMPORT_TREE_SIMPLIFY_H
#define APP_IMPORT_TREE_SIMPLIFY_H

#include "app/import/model.h"

enum import_base { IMPORT_BASE_GUESS, IMPORT_BASE_FIXED, IMPORT_BASE_FLOATING };

/* What becomes of joints that follow another one (URDF mimic, MJCF equality). */
enum import_mimic {
    IMPORT_MIMIC_REFUSE,
    IMPORT_MIMIC_LOCK,
    IMPORT_MIMIC_FREE,
    IMPORT_MIMIC_COUPLE,
};

struct import_options {
    int base, mimic;         /* values of the enums above */
    bool free_slides;        /* prismatic joints move without a drive; otherwise they are fixed */
    const char *const *lock; /* names of joints to be fixed */
    size_t nlock;
    bool repair_inertia;      /* raise impossible moments of inertia; otherwise refuse them */
    const char *const *drive; /* --drive options: NAME or JOINTS=NAME (drive.h) */
    size_t ndrive;
};

/* The robot made of a model, and where its parts come from. */
struct import_robot {
    const struct import_model *model;
    struct robot *robot; /* without drives, stops and capsules, couplings without their stiffness;
                          * not yet finished */
    const struct import_joint **source; /* by joint of the robot */
    double *rest; /* by joint of the robot: position at rest, 0 or the nearest that is allowed */
    /* By link of the model: its body; -1 = fixed in the world in which the base floats. */
    int *body;
    struct import_place *place; /* of the link in that body */
    bool *fixed;                /* by joint of the model: it does not move */
    /* By joint of the robot, from the catalogue; NULL = its drive is assumed */
    const struct robot_drive **drive;
    const char **drive_file; /* as a robot file names it */
    /* Path of a file that is the user's own, to be copied; NULL: it goes by name */
    const char **drive_copy;
};

/* Reduces the model to a robot; out keeps pointers into the model. */
enum error_code import_simplify_tree(const struct import_model *model,
                                     const struct import_options *options, struct arena *arena,
                                     struct import_notes *notes, struct import_robot *out,
                                     struct error *error);

/* Makes a name that robot files accept: other characters become '_', with a note. Refuses names
 * that are too long or reserved. */
enum error_code import_make_name(const char *file, const char *name, int line, const char *what,
                                 struct arena *arena, struct import_notes *notes, const char **made,
                                 struct error *error);

#endif
