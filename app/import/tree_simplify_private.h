/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the steps of the reduction. Not RT-safe. */
#ifndef APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H
#define APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H

#include "app/import/tree_simplify.h"

/* Range of a joint without limits, turns in each direction: far more than in any run. */
#define SIMPLIFY_TURNS_MAX 50.0

/* A name that differs from the file's, of a kind of part. */
struct simplify_made {
    const char *what, *name;
};

/* A reduction under way. */
struct simplifier {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error; /* the first error stays */
    struct simplify_made *made;
    size_t nmade, made_capacity;

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

/* Returns memory of the arena; NULL with an error. */
void *simplify_alloc(const struct simplifier *r, size_t count, size_t size);

/*
 * ---- steps, in their order: the reduction ends after the first one that leaves an error ----
 *
 * The tree: finds the joint that each link is the child of, and the only link that is no joint's
 * child; refuses loops, separate trees, and joints that form a cycle without a root. The root is
 * the world if it has no mass and a floating joint is attached to it: then the base is that joint's
 * child, and all other parts of that world must be fixed, and are left out. Orders links by a walk
 * down the tree: parents before children, children in the order of their joints in the file.
 */
void simplify_find_parents(struct simplifier *r);
void simplify_find_root(struct simplifier *r);
void simplify_check_cycles(struct simplifier *r);
void simplify_enter_world(struct simplifier *r);
void simplify_order_links(struct simplifier *r);

/* Joints that follow others, in tree_simplify_mimic.c: finds mimic, lower and upper; refuses
 * cycles. */
void simplify_find_followers(struct simplifier *r);

/* Which joints are fixed, and at which positions: refuses joints that a robot cannot have, fixes
 * those that cannot move and those that --lock names. Narrows lower and upper of leaders to the
 * ranges in which their coupled followers can follow; refuses impossible couplings. Fixes joints
 * without mass behind them, because their motion has no equation. Decides the treatment of each
 * follower. Refuses more moving joints than a rig supports. */
void simplify_check_joints(struct simplifier *r);
void simplify_fix_named(struct simplifier *r);
void simplify_narrow_leaders(struct simplifier *r);
void simplify_fix_massless(struct simplifier *r);
void simplify_settle_followers(struct simplifier *r);
void simplify_check_count(struct simplifier *r);

/* Adds the couplings to the robot, whose joints must exist; frames for links that are part of a
 * body, and sensors; poses. */
void simplify_add_couplings(struct simplifier *r);
void simplify_add_frames(struct simplifier *r);
void simplify_add_poses(struct simplifier *r);

/* ---- */

/* Fixes a joint at a position, rad or m, and adds a note with the reason. */
void simplify_fix_joint(struct simplifier *r, size_t j, double at, const char *why);

/* Makes a name that robot files accept: replaces other characters by '_', and adds a number if
 * another part has the name then, with a note. Refuses names that are too long or reserved. "" with
 * an error. */
const char *simplify_name(struct simplifier *r, const char *file, int line, const char *what,
                          const char *name);

/* Checks whether a joint is fixed, by its type or by the reduction. */
bool simplify_is_rigid(const struct simplifier *r, size_t j);

/* Checks whether a joint is coupled to its leader; valid after that decision. */
bool simplify_is_coupled(const struct simplifier *r, size_t j);

/* Moves the coupled followers of a pose to the positions that their leaders give; adds a note for
 * each that the pose had elsewhere. */
void simplify_align_pose(const struct simplifier *r, const struct import_pose *pose,
                         double *position);

/* Return the rest position of a joint, rad or m: 0, or slightly inside the nearer limit if the
 * limits exclude 0; for a follower, the position given by its leader's rest, within its limits. */
double simplify_rest(const struct simplifier *r, size_t j);
double simplify_follow(const struct simplifier *r, size_t j);

/* Computes the pose of a joint's child in its parent with the joint at q, rad or m. */
void simplify_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
