/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the steps of the reduction. Not RT-safe. */
#ifndef APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H
#define APP_IMPORT_TREE_SIMPLIFY_PRIVATE_H

#include "app/import/tree_simplify.h"

/* Range of a joint without limits, turns in each direction: far more than any run needs. */
#define SIMPLIFY_TURNS_MAX 50.0

/* A name that the reduction has changed, and the kind of the named part. */
struct simplify_made {
    const char *what, *name;
};

/* A running reduction. */
struct simplifier {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error; /* keeps the first error */
    struct simplify_made *made;
    size_t nmade, made_capacity;

    int *above;    /* by link: its parent joint, -1 = none */
    int *order;    /* links, parents first, children in the order of their joints */
    size_t norder; /* number of links without the world, if the base floats in it */
    bool floats;   /* a floating joint in the file makes the base float */
    int root;      /* the link that is the base, or part of it */
    double *at;    /* by joint of the model: position at which it is fixed, rad or m */
    int *mimic;    /* by joint of the model: its leader, -1 = none */
    /* By joint of the model: the range that the joint and all joints coupled to it allow */
    double *lower, *upper;
};

/* Returns memory from the arena. On an error returns NULL. */
void *simplify_alloc(const struct simplifier *r, size_t count, size_t size);

/*
 * ---- steps, in their order: the reduction ends after the first one that leaves an error ----
 *
 * The tree: finds the joint that each link is the child of, and the only link that is no joint's
 * child; refuses loops, separate trees, and joints that form a cycle without a root. The root is
 * the world if it has no mass and floating joints are attached to it. If one of these carries as
 * many joints as all parts that do not float, the base is its child; all other parts of that world
 * must be fixed or objects, and are left out. Otherwise the floating parts are objects. Orders
 * links by a walk down the tree: parents before children, children in the order of their joints in
 * the file.
 */
void simplify_find_parents(struct simplifier *r);
void simplify_find_root(struct simplifier *r);
void simplify_check_cycles(struct simplifier *r);
void simplify_enter_world(struct simplifier *r);
void simplify_order_links(struct simplifier *r);

/* Finds the joints that follow others (mimic, lower and upper), in tree_simplify_mimic.c. Refuses
 * cycles. */
void simplify_find_followers(struct simplifier *r);

/* Finds the fixed joints and their positions. Refuses joints that a robot cannot have. Fixes joints
 * that cannot move, and joints of --lock. Narrows lower and upper of leaders to the ranges in which
 * their coupled followers can follow. Refuses impossible couplings. Fixes joints without mass
 * behind them, because their motion has no equation. Decides the treatment of each follower.
 * Refuses more moving joints than a rig supports. */
void simplify_check_joints(struct simplifier *r);
void simplify_fix_named(struct simplifier *r);
void simplify_narrow_leaders(struct simplifier *r);
void simplify_fix_massless(struct simplifier *r);
void simplify_settle_followers(struct simplifier *r);
void simplify_check_count(struct simplifier *r);

/* Add couplings, frames and poses to the robot, whose joints must exist. Frames are for links that
 * are part of a body, and for sensors. */
void simplify_add_couplings(struct simplifier *r);
void simplify_add_frames(struct simplifier *r);
void simplify_add_poses(struct simplifier *r);

/* ---- */

/* Fixes a joint at a position, rad or m, and adds a note with the reason. */
void simplify_fix_joint(struct simplifier *r, size_t j, double at, const char *why);

/* Makes a name that robot files accept. Replaces invalid characters by '_' and, if another part has
 * the resulting name, adds a number and a note. Refuses names that are too long or reserved. On an
 * error returns "". */
const char *simplify_name(struct simplifier *r, const char *file, int line, const char *what,
                          const char *name);

/* Checks whether a joint is fixed, by its type or by the reduction. */
bool simplify_is_rigid(const struct simplifier *r, size_t j);

/* Checks whether a joint is coupled to its leader. Valid after simplify_settle_followers. */
bool simplify_is_coupled(const struct simplifier *r, size_t j);

/* Moves the coupled followers of a pose to the positions that follow from their leaders. Adds a
 * note for each follower whose position changes. */
void simplify_align_pose(const struct simplifier *r, const struct import_pose *pose,
                         double *position);

/* Return the rest position of a joint, rad or m. It is 0, or slightly inside the nearer limit if
 * the limits exclude 0. For a follower, it is the position that follows from its leader's rest,
 * within the follower's limits. */
double simplify_rest(const struct simplifier *r, size_t j);
double simplify_follow(const struct simplifier *r, size_t j);

/* Computes the pose of a joint's child in its parent with the joint at q, rad or m. */
void simplify_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
