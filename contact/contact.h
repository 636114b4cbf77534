/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compliant contact between surfaces on moving bodies and the ground: elastic foundation, paper
 * eqs (6), (7). Poses and velocities go in, the wrench on every body comes out. C only: no
 * exception and no C++ type crosses this header.
 *
 * Law at a surface element of area A at depth x with normal rate x' (Sherman, Seth, Delp 2011 and
 * Simbody's CompliantContactSubsystem): f_n = k A x (1 + c x') with k = k1 k2/(k1 + k2),
 * k_i = young_i / thickness_i, c the stiffness-weighted mean; friction after the transition velocity
 * with static, dynamic and viscous coefficients. Half of the sum over each mesh when both are
 * meshes.
 */
#ifndef CONTACT_CONTACT_H
#define CONTACT_CONTACT_H

#include "base/arena.h"
#include "base/error.h"
#include "contact/mesh.h"

#include <stddef.h>

enum contact_shape {
    CONTACT_HALF_SPACE, /* solid below the surface frame's z = 0 plane, outward normal +z */
    CONTACT_SPHERE,     /* centred at the surface frame's origin */
    CONTACT_BOX,        /* centred, faces along the frame's axes, a mesh of its own */
    CONTACT_MESH,       /* closed triangle mesh in the surface frame */
};

struct contact_material {
    double young_pa;           /* of the elastic layer */
    double thickness_m;        /* of the elastic layer */
    double dissipation_s_per_m;
    double static_friction, dynamic_friction; /* dimensionless */
    double viscous_friction;   /* s/m */
};

struct contact_surface {
    const char *name;
    int body; /* index into the motions given to evaluate; -1 = the fixed world */
    enum contact_shape shape;
    double position[3]; /* of the surface frame in the body (or world) frame, m */
    double rotation[9]; /* surface frame to body frame, row-major */
    double radius_m;              /* sphere */
    double half_extent_m[3];      /* box */
    int cells_per_edge;           /* box: 7 gives Simbody's 588 faces */
    const struct mesh *mesh;      /* mesh; must outlive the world */
    struct contact_material material;
};

/* Two surfaces that are tested against each other. */
struct contact_pair {
    int a, b; /* indices of surfaces */
};

struct contact_config {
    size_t nbody;
    size_t nsurface;
    const struct contact_surface *surface;
    size_t npair;
    const struct contact_pair *pair;
    double transition_velocity_m_s; /* of the friction law, > 0 */
};

/* Pose and velocity of a body, world frame; same layout as model's struct body_motion. */
struct contact_motion {
    double R[9]; /* body to world, row-major */
    double p[3]; /* origin, m */
    double w[3]; /* rad/s */
    double v[3]; /* of the origin, m/s */
};

/* World frame, about the body's origin. */
struct contact_wrench {
    double force[3];  /* N */
    double moment[3]; /* N m */
};

/* One pair in touch; world frame. Force on surface b's body; the opposite acts on a's. */
struct contact_patch {
    int pair;
    double centre[3];
    double force[3];
    double moment[3]; /* about the centre */
    double area_m2;        /* 0 where the engine does not say */
    double penetration_m;  /* deepest; 0 where the engine does not say */
    double potential_j;    /* stored in the elastic layers */
    double dissipation_w;  /* being dissipated */
};

struct contact_world;

struct contact_ops {
    const char *name;
    /* Wrenches on all nbody bodies (overwritten). Returns ERROR_NONE or the engine's failure. */
    enum error_code (*evaluate)(struct contact_world *world, const struct contact_motion *motion,
                                struct contact_wrench *wrench);
    /* Patches of the last evaluation; returns their number, writes at most max. */
    size_t (*patches)(struct contact_world *world, struct contact_patch *patch, size_t max);
    /* The engine's message after a failed evaluate. */
    const char *(*failure)(const struct contact_world *world);
    void (*destroy)(struct contact_world *world);
};

/* An engine's private struct begins with this. */
struct contact_world {
    const struct contact_ops *ops;
};

/* Engine "simbody": Simbody's CompliantContactSubsystem with one free shadow body per contact body
 * (paper Fig. 7), all set, then realized to Dynamics once an evaluation. Allocates while it
 * evaluates, so it is not RT-safe. Destroy with world->ops->destroy. */
enum error_code contact_simbody_create(const struct contact_config *config,
                                       struct contact_world **world, struct error *error);

#endif
