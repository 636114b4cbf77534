/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The generator's view of a robot. It makes three exact transformations:
 *
 * Frames. Each body gets a working frame in which its joint's axis is a coordinate axis. As many of
 * its children's axes and origins as possible also lie along coordinate axes, because each zero
 * saves an operation. Two choices are free: the zero of the angle (angle = sign * q + offset) and
 * the position of the origin on the joint's axis.
 *
 * Lumping. Mass properties are stored as the pseudo-inertia about the frame's origin: mass m, first
 * moment h, second moment K = integral of r r^T dm. A mass distribution along a revolute joint's
 * axis moves with the parent as well as with the child. So m, h_k and K_kk of the child are moved
 * to the parent. All of K moves to the parent if the joint is prismatic. These are the minimal
 * parameters of Gautier and Khalil (Direct calculation of minimum set of inertial parameters of
 * serial robots, 1990). Equations of motion, energies and generalized forces do not change. A
 * lumped body alone need not be physically possible. Frames and lanes depend only on the geometry.
 * So robots that differ only in mass properties have trees that differ only in m, h and K.
 *
 * Lanes. Limbs whose joints turn about the same axes in the same order are evaluated side by side.
 *
 * Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_TREE_H
#define MODEL_SYMBOLIC_TREE_H

#include "model/robot.h"

#include <stdint.h>

enum { TREE_LANES = 4, TREE_TURNS = 2 };

/* Numbers of a body's mass properties, 0 to 9: m, h, K. */
enum tree_inertia { TREE_MASS = 0, TREE_H = 1, TREE_K = 4, TREE_INERTIA = 10 };

/* A fixed turn about a coordinate axis, by its cosine and sine. */
struct tree_turn {
    int axis;
    double c, s;
};

/* A body and the joint that moves it. The transform from the parent's working frame to this body's
 * working frame is Trans(r), the fixed turns in their order, then Rot(axis, sign q + offset) or
 * Trans(axis (sign q)). */
struct tree_body {
    int parent; /* -1 for the base */
    bool prismatic;
    int axis;
    double sign, offset;
    double r[3];
    int nturn;
    struct tree_turn turn[TREE_TURNS];
    double mass, h[3];
    double K[6];     /* xx xy xz yy yz zz */
    double align[9]; /* working frame to body frame, row-major */
    bool aligned;    /* align is the identity */
    double at[3];    /* the body's origin in the working frame */
    bool observed;
};

/* Bodies that are evaluated side by side, one per lane. Lanes `count` to `width` - 1 repeat lane
 * 0. */
struct tree_group {
    int width, count;
    int body[TREE_LANES];
    int parent_group[TREE_LANES]; /* -1 for the base's own group */
    int parent_lane[TREE_LANES];
    /* Index of each mass property in the array of all mass properties, for the first lane. The
     * other lanes follow, aligned to the width. -1 = zero, moved to the parents */
    int place[TREE_INERTIA];
};

struct tree {
    const struct robot *robot;
    size_t nbody;
    struct tree_body *body;
    size_t ngroup;
    struct tree_group *group; /* parents before children; group 0 is the base */
    int *group_of, *lane_of;  /* by body */
    size_t ninertia;          /* size of the array of mass properties */
};

/* Builds the tree of a robot. lanes: largest number of lanes per group, 1, 2 or 4. Not RT-safe. */
enum error_code tree_create(const struct robot *robot, int lanes, struct tree *tree,
                            struct error *error);
void tree_destroy(struct tree *tree);

/* Returns a mass property of a body. */
double tree_inertia(const struct tree_body *body, int property);

/* Groups the bodies into at most `lanes` lanes (limb_lanes.c). tree->body must be complete. */
enum error_code tree_assign_lanes(struct tree *tree, int lanes, struct error *error);

#endif
