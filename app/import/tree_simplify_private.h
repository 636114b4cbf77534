/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the steps of the reduction. Not RT-safe. */
#ifndef APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H
#define APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H

#include "app/import/tree_simplify.h"

/* Range of a joint without limits, turns in each direction: far more than in any run. */
#define SIMPLIFY_TURNS_MAX 50.0

/* A reduction under way. */
struct simplifier {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error;

    int *above;    /* by link: its parent joint, -1 = none */
    int *order;    /* links, parents first, children in the order of their joints */
    size_t norder; /* excludes the world if the base floats in it */
    bool floats;   /* a floating joint makes the base float */
    int root;      /* the link that is the base, or part of it */
    double *at;    /* by joint of the model: position at which it is fixed, rad or m */
    int *mimic;    /* by joint of the model: its leader, -1 = none */
    /* By joint of the model: range that it and all joints coupled to it allow */
    double *lower, *upper;
};

enum error_code simplify_no_memory(const struct simplifier *r);

/* Finds above, order and the root; refuses loops and separate trees. */
enum error_code simplify_find_tree(struct simplifier *r);

/* Decides which joints are fixed, and at which positions. */
enum error_code simplify_fix_joints(struct simplifier *r);

/* Fixes a joint at a position, rad or m, and adds a note with the reason. */
void simplify_fix_joint(struct simplifier *r, size_t j, double at, const char *why);

/* ---- joints that follow others: tree_simplify_mimic.c ---- */

/* Checks whether a joint is fixed, by its type or by the reduction. */
bool simplify_is_rigid(const struct simplifier *r, size_t j);

/* Finds mimic, lower and upper; refuses cycles. */
enum error_code simplify_find_followers(struct simplifier *r);

/* Narrows lower and upper of leaders to the ranges in which their coupled followers can follow;
 * refuses impossible couplings. */
enum error_code simplify_narrow_leaders(struct simplifier *r);

/* Decides the treatment of each follower. */
enum error_code simplify_settle_followers(struct simplifier *r);

/* Checks whether a joint is coupled to its leader; valid after that decision. */
bool simplify_is_coupled(const struct simplifier *r, size_t j);

/* Adds the couplings to the robot, whose joints must exist. */
enum error_code simplify_add_couplings(struct simplifier *r);

/* Moves the coupled followers of a pose to the positions that their leaders give; adds a note for
 * each that the pose had elsewhere. */
void simplify_align_pose(const struct simplifier *r, const struct import_pose *pose,
                         double *position);

/* Return the rest position of a joint, rad or m: 0, or slightly inside the nearer limit if the
 * limits exclude 0; for a follower, the position given by its leader's rest, within its limits. */
double simplify_rest(const struct simplifier *r, size_t j);
double simplify_follow(const struct simplifier *r, size_t j);

/* ---- */

/* Add frames for links that are part of a body, sensors and poses. */
enum error_code simplify_add_frames(struct simplifier *r);
enum error_code simplify_add_poses(struct simplifier *r);

/* Computes the pose of a joint's child in its parent with the joint at q, rad or m. */
void simplify_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
