/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the steps of the reduction. Not RT-safe. */
#ifndef APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H
#define APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H

#include "app/import/tree_simplify.h"

/* Range of a joint without limits, turns either way: far more than a run makes. */
#define SIMPLIFY_TURNS_MAX 50.0

/* A reduction under way. */
struct simplifier {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error;

    int *above;    /* by link: the joint whose child it is, -1 = none */
    int *order;    /* links, parents first, children in the order of their joints */
    size_t norder; /* the world is left out when the base floats in it */
    bool floats;   /* a floating joint makes the base float */
    int root;      /* the link that is the base, or part of it */
    double *at;    /* by joint of the model: position of a fixed joint, rad or m */
    int *mimic;    /* by joint of the model: the joint that it follows, -1 = none */
    /* By joint of the model: range in which it and all that is coupled to it can be. */
    double *lower, *upper;
};

enum error_code simplify_no_memory(const struct simplifier *r);

/* Finds above, order and the root; loops and forests are refused. */
enum error_code simplify_find_tree(struct simplifier *r);

/* Decides which joints are fixed, and where. */
enum error_code simplify_fix_joints(struct simplifier *r);

/* Fixes a joint at a position, rad or m, and notes the reason. */
void simplify_fix_joint(struct simplifier *r, size_t j, double at, const char *why);

/* ---- joints that follow others: tree_simplify_mimic.c ---- */

/* Checks whether a joint does not move: fixed by type or by the reduction. */
bool simplify_is_rigid(const struct simplifier *r, size_t j);

/* Finds mimic, lower and upper; refuses circles. */
enum error_code simplify_find_followers(struct simplifier *r);

/* Narrows lower and upper of leaders to where their coupled followers can follow; refuses
 * impossible couplings. */
enum error_code simplify_narrow_leaders(struct simplifier *r);

/* Decides what becomes of each joint that follows another. */
enum error_code simplify_settle_followers(struct simplifier *r);

/* Checks whether a joint is coupled to its leader; valid once that is decided. */
bool simplify_is_coupled(const struct simplifier *r, size_t j);

/* Adds the couplings to the robot, whose joints must be there. */
enum error_code simplify_add_couplings(struct simplifier *r);

/* Moves the coupled followers of a pose to where their leaders lead them; notes each that the pose
 * had elsewhere. */
void simplify_align_pose(const struct simplifier *r, const struct import_pose *pose,
                         double *position);

/* Return where a joint rests, rad or m: 0, or a little inside the nearer limit when the limits
 * exclude 0; and for one that follows, where its leader's rest leads it, within its limits. */
double simplify_rest(const struct simplifier *r, size_t j);
double simplify_follow(const struct simplifier *r, size_t j);

/* ---- */

/* Add frames for the links that are part of a body, sensors and poses. */
enum error_code simplify_add_frames(struct simplifier *r);
enum error_code simplify_add_poses(struct simplifier *r);

/* Computes the place of a joint's child in its parent when the joint is at q, rad or m. */
void simplify_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
