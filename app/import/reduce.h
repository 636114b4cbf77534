/* SPDX-License-Identifier: Apache-2.0 */
/*
 * From a foreign robot to one of ours: one body for each joint that moves. Links on fixed joints
 * become part of the body that carries them, exactly, and stay as frames; joints that cannot or
 * shall not move are fixed where they rest. Everything that is done is noted; what cannot be done
 * is refused with file:line and a remedy. Memory from the arena. Not RT-safe.
 */
#ifndef APP_IMPORT_REDUCE_H
#define APP_IMPORT_REDUCE_H

#include "app/import/model.h"

enum import_base { IMPORT_BASE_GUESS, IMPORT_BASE_FIXED, IMPORT_BASE_FLOATING };

/* What becomes of joints that follow another one. */
enum import_mimic {
    IMPORT_MIMIC_REFUSE,
    IMPORT_MIMIC_LOCK,
    IMPORT_MIMIC_FREE,
    IMPORT_MIMIC_COUPLE,
};

struct import_options {
    int base, mimic;         /* of the enums above */
    bool free_slides;        /* prismatic joints move without a drive, else they are fixed */
    const char *const *lock; /* names of joints to be fixed */
    size_t nlock;
    bool repair_inertia;      /* impossible tensors are made possible, else refused */
    const char *const *drive; /* of the catalogue: NAME or JOINTS=NAME (catalogue.h) */
    size_t ndrive;
};

/* A robot of ours and where its parts come from. */
struct import_robot {
    const struct import_model *model;
    struct robot *robot; /* without drives, stops and capsules, couplings without their stiffness;
                          * not yet finished */
    const struct import_joint **source; /* by joint of the robot */
    double *rest;               /* by joint of the robot: 0 or the nearest that is allowed */
    int *body;                  /* by link of the model; -1: the world that a base floats in */
    struct import_place *place; /* of the link in that body */
    bool *fixed;                /* by joint of the model: it does not move */
    /* By joint of the robot, from the catalogue; NULL = its drive is assumed */
    const struct robot_drive **drive;
    const char **drive_file; /* as a robot file names it */
    /* Path of a file that is the user's own, to be copied; NULL: it goes by name */
    const char **drive_copy;
};

enum error_code import_reduce(const struct import_model *model,
                              const struct import_options *options, struct arena *arena,
                              struct import_notes *notes, struct import_robot *out,
                              struct error *error);

/* A name that robot files accept: what they do not becomes '_'. Refused when it is too long or
 * when another one of the names[count] has become the same. */
enum error_code import_make_name(const char *file, const char *name, int line, const char *what,
                                 struct arena *arena, struct import_notes *notes, const char **made,
                                 struct error *error);

#endif
