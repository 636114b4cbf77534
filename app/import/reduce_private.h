/* SPDX-License-Identifier: Apache-2.0 */
/* What the steps of the reduction share. Not RT-safe. */
#ifndef APP_IMPORT_REDUCE_PRIVATE_H
#define APP_IMPORT_REDUCE_PRIVATE_H

#include "app/import/reduce.h"

/* Turns either way of a joint without limits: far more than a run of it makes. */
#define REDUCE_TURNS_MAX 50.0

struct reducer {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error;

    int *above;            /* by link: the joint that it hangs on, -1 = none */
    int *order;            /* links, parents first, children in the order of their joints */
    size_t norder;         /* without a root that is the world */
    bool floats;           /* a floating joint says so */
    int root;              /* the link that is the base, or part of it */
    double *at;            /* by joint of the model: where a joint that is fixed stays */
    int *mimic;            /* by joint of the model: the one that it follows, -1 = none */
    double *lower, *upper; /* by joint of the model: where it and what is coupled to it can be */
};

enum error_code reduce_no_memory(const struct reducer *r);

/* Finds above, order and the root; loops and forests are refused. */
enum error_code reduce_find_tree(struct reducer *r);

/* Decides which joints are fixed, and where. */
enum error_code reduce_fix_joints(struct reducer *r);

/* Fixes a joint there, with a note of the reason. */
void reduce_fix_joint(struct reducer *r, size_t j, double at, const char *why);

/* ---- joints that follow others: reduce_follow.c ---- */

/* Whether a joint does not move. */
bool reduce_is_rigid(const struct reducer *r, size_t j);

/* Finds mimic, lower and upper; circles are refused. */
enum error_code reduce_find_followers(struct reducer *r);

/* Narrows lower and upper of leaders to where their coupled followers can follow; couplings that
 * cannot be are refused. */
enum error_code reduce_narrow_leaders(struct reducer *r);

/* Decides what becomes of each one that follows a joint. */
enum error_code reduce_settle_followers(struct reducer *r);

/* Whether a joint is coupled to its leader, once that is decided. */
bool reduce_is_coupled(const struct reducer *r, size_t j);

/* The robot's couplings, when its joints are known. */
enum error_code reduce_add_couplings(struct reducer *r);

/* Puts the coupled followers of a pose where their leaders want them. */
void reduce_align_pose(const struct reducer *r, const struct import_pose *pose, double *position);

/* Where a joint rests: 0, or in from the nearest limit when they exclude 0; and one that follows,
 * where its leader's rest wants it, within its limits. */
double reduce_rest(const struct reducer *r, size_t j);
double reduce_follow(const struct reducer *r, size_t j);

/* ---- */

/* Makes impossible inertias possible or refuses them. */
enum error_code reduce_check_inertia(struct reducer *r, const struct import_link *link,
                                     struct robot_inertia *inertia);

/* Frames of the links that are part of a body, sensors and poses. */
enum error_code reduce_add_frames(struct reducer *r);
enum error_code reduce_add_poses(struct reducer *r);

/* Where the child of a joint is in its parent when the joint is at q. */
void reduce_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
