/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to the engine "native" (native.c, create.c): the world that it makes of a
 * configuration, and works in. All memory is the arena's that it was created in. SI units; frames
 * as said. The calls below are RT-safe.
 */
#ifndef CONTACT_NATIVE_PRIVATE_H
#define CONTACT_NATIVE_PRIVATE_H

#include "contact/broad_phase.h"
#include "contact/contact.h"
#include "contact/native/kernels.h"
#include "contact/native/stick.h"

struct native_surface {
    int body;
    enum contact_shape shape;
    double position[3], rotation[9]; /* in the body */
    struct native_capsule capsule;   /* or sphere */
    double center[3], reach;         /* a ball about all of it, in the body */
    struct broad_capsule about;      /* a capsule, with the same center and also in the body */
    const struct solid *solid;       /* box and mesh; capsule, if it may touch one of them */
    const struct field *field;       /* of one that has a pair with its like, or NULL */
};

/* A surface's pose and velocity in the world. */
struct native_pose {
    double R[9], p[3], w[3], v[3];
};

enum native_pair_kind {
    PAIR_HERTZ_SPHERES,
    PAIR_HERTZ_HALF_SPACE,
    PAIR_MESH_HALF_SPACE,
    PAIR_MESH_SPHERE,
    PAIR_MESHES,
    PAIR_FIELDS,
    PAIR_CAPSULE_HALF_SPACE,
    PAIR_CAPSULES, /* of which one may be a sphere */
};

struct native_pair {
    enum native_pair_kind kind;
    int surface[2]; /* in the order in which contact/native/pairs.h takes them */
    const struct native_kernels *kernels;
    double sign;  /* of the force on the configured pair's b, from that on the first */
    double onto;  /* of the depth, along the push: from where springs act to the surface that rocks
                  * on the one whose normals they have; 0 where both have some */
    int anchored; /* in which of the two surfaces the bristles' anchor is fixed: not that whose
                   * normals the springs have */
    struct native_law law;
};

/* Which springs of the batch are those of a patch. */
struct native_springs {
    size_t from, to;
};

struct native_engine {
    struct contact_world world; /* first */
    size_t nbody, nsurface, npair, npatch;
    struct native_surface *surface;
    struct native_pose *pose; /* of each surface that is placed */
    bool *placed;             /* by surface: in this evaluation; those fixed in the world always */
    struct broad_phase broad;
    void (*find_near)(struct broad_phase *broad, uint64_t *near);
    uint64_t *near; /* what it found */
    struct native_pair *pair;
    struct contact_patch *patch;    /* of the last evaluation */
    struct native_springs *springs; /* of each patch */
    struct native_grip *grip;       /* the same, with sticking friction; otherwise NULL */
    struct native_scratch *scratch;
    char failure[128];
};

extern const struct contact_ops native_ops;

/* The poses and balls of the surfaces that are fixed in the world. */
void native_place_fixed_surfaces(struct native_engine *e);

/* Finds the springs of a pair and adds what sum wants of them. */
void native_pair_find_force(const struct native_engine *e, const struct native_pair *pair,
                            const struct native_relative *relative, struct native_sum *sum);

/* Whether all springs of a pair push in one direction: on a half-space. */
static inline bool native_pair_is_one_way(const struct native_pair *pair)
{
    return pair->kind == PAIR_MESH_HALF_SPACE || pair->kind == PAIR_CAPSULE_HALF_SPACE;
}

/* Adds the damping of a grip that holds as a whole, or of the share of it that does, to a tangent
 * about a center, in the first surface's frame turned by turn. */
void native_bristle_resist(const struct native_grip *grip, const double center[3],
                           const double turn[9], struct contact_tangent *tangent);

/* The same of what its springs resist by along the normal; springs that all push one way. */
void native_bristle_press(const struct native_grip *grip, const double center[3],
                          const double turn[9], struct contact_tangent *tangent);

/* Sticking friction: adds that of a pair in touch to sum, which has gathered the rest, and fills
 * the next patch's grip and the bristles' rates. The pair's springs are in the batch, or lost,
 * because there was no room. bristles: may be NULL (all relaxed). */
void native_bristle_hold(struct native_engine *e, size_t index,
                         const struct native_relative *relative, struct native_springs at,
                         bool lost, struct contact_bristles *bristles, struct native_sum *sum);

/* The rates of the listed bristles as if they did not touch anything; they are wanted. */
void native_bristle_relax(const struct contact_bristles *bristles);

#endif
