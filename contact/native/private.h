/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to the engine "native" (native.c, create.c, friction_sticking.c): the world that it
 * builds from a configuration. The arena given at creation owns all memory. SI units; each member
 * names its frame. The calls below are RT-safe.
 */
#ifndef CONTACT_NATIVE_PRIVATE_H
#define CONTACT_NATIVE_PRIVATE_H

#include "contact/broad_phase.h"
#include "contact/native/narrow_phase.h"
#include "contact/native/friction_sums.h"

/* A surface ready for contact: shape, place on its body, bounding volumes, mesh and field. */
struct native_surface {
    int body;
    enum contact_shape shape;
    double position[3], rotation[9]; /* pose in the body's frame */
    struct native_capsule capsule;   /* capsule or sphere */
    double center[3], reach;         /* bounding ball, in the body's frame, m */
    struct broad_capsule about; /* bounding capsule about the same center, in the body's frame */
    const struct solid *solid;  /* for a box or mesh, or a capsule in a pair with one */
    const struct field *field;  /* pressure field of a mesh in a pair with a mesh, or NULL */
};

/* Pose and velocity of a surface's frame in the world frame. */
struct native_pose {
    double R[9], p[3], w[3], v[3];
};

/* A configured pair, ready to be evaluated. */
struct native_pair {
    enum native_pair_kind kind;
    int surface[2]; /* in the order that contact/native/narrow_phase.h requires */
    double slack;   /* overlap that does not count, m; only for capsules */
    /* sign of the force on the configured pair's b relative to the force on the first surface */
    double sign;
    /* distance along the push from the point of action to the surface that does not define the
     * normals, as a share of the depth; 0 if both surfaces define normals */
    double onto;
    /* index in `surface` of the surface that holds the bristles' anchor: it does not define the
     * normals */
    int anchored;
    struct native_law law;
};

/* Range of a patch's springs in the batch: [from, to). */
struct native_springs {
    size_t from, to;
};

/* The engine: a contact_world and its working memory. */
struct native_engine {
    struct contact_world world; /* first member */
    size_t nbody, nsurface, npair, npatch;
    struct native_surface *surface;
    struct native_pose *pose; /* by surface; valid if placed */
    /* by surface: placed in this evaluation; always true for surfaces fixed in the world */
    bool *placed;
    struct broad_phase broad;
    uint64_t *near; /* bits of the pairs that the broad phase found */
    struct native_pair *pair;
    struct contact_patch *patch;     /* patches of the last evaluation */
    struct native_springs *springs;  /* springs of each patch */
    struct sticking_patch *sticking; /* by patch; NULL without sticking friction */
    struct native_scratch *scratch;
    char failure[128];
};

/* The engine's operations, compiled for each instruction set; all give the same bits. The kernels
 * of one instruction set call only each other. */
extern const struct contact_ops native_ops;
#if defined(NATIVE_VARIANTS)
extern const struct contact_ops native_ops_avx2, native_ops_avx512;
#endif

/* Computes poses and bounding volumes of the surfaces that are fixed in the world. Computes the
 * radii of all bounding volumes, which are constant. */
void native_place_fixed_surfaces(struct native_engine *e);

/* Narrow phase: finds the penetration of a pair's surfaces, places springs there, and computes the
 * requested part of sum (force, tangent, or sums for sticking friction). */
void native_pair_find_force(const struct native_engine *e, const struct native_pair *pair,
                            const struct native_relative *relative, struct native_sum *sum);

/* Returns whether all springs of a pair push in one direction, as on a half-space. */
static inline bool native_pair_is_one_way(const struct native_pair *pair)
{
    return pair->kind == PAIR_MESH_HALF_SPACE || pair->kind == PAIR_CAPSULE_HALF_SPACE;
}

/* Adds to a tangent the friction damping for the share of friction that a patch bears as a whole.
 * center: the tangent's center in the first surface's frame; turn: rotation of that frame to the
 * world. */
void native_bristle_resist(const struct sticking_patch *patch, const double center[3],
                           const double turn[9], struct contact_tangent *tangent);

/* Adds to a tangent the stiffness and damping of the patch's springs along the normal, from the
 * gathered moments. All springs must push one way. */
void native_bristle_press(const struct sticking_patch *patch, const double center[3],
                          const double turn[9], struct contact_tangent *tangent);

/* Adds the sticking friction (stiction) of a pair in contact to sum, which already has the normal
 * force and the gathered sums. Fills the next sticking patch and the bristles' rates. The pair's
 * springs are in the batch, or lost because there was no room. bristles: may be NULL (all
 * relaxed). */
void friction_sticking_add(struct native_engine *e, size_t index,
                           const struct native_relative *relative, struct native_springs at,
                           bool lost, struct contact_bristles *bristles, struct native_sum *sum);

/* Computes the rates at which the listed bristles relax without contact; rate must not be NULL. */
void native_bristle_relax(const struct contact_bristles *bristles);

#endif
