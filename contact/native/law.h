/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The law of contact.h (normal force, dissipation, friction) at many springs at once, for the
 * native engine. The penetration volume of a pair of surfaces is integrated in the frame of its
 * first surface; forces are those on the first one. SI units. All memory is the caller's; nothing
 * fails; all is RT-safe.
 */
#ifndef CONTACT_NATIVE_LAW_H
#define CONTACT_NATIVE_LAW_H

#include "contact/contact.h"
#include "contact/variant.h"

#include <stdbool.h>
#include <stddef.h>

/* Springs in a batch: a multiple of any number of lanes, but of no large power of two, for which
 * all arrays would share the same lines of the cache. */
#define BATCH_MAX 1032
#define BATCH_ALIGN 8 /* each pair starts at a multiple: as many lanes as there are anywhere */

/* Constants of a pair. */
struct native_law {
    double stiffness;          /* k, Pa/m */
    double dissipation;        /* c, s/m; 1.5 c with Hertz's shares */
    double share[2];           /* s1, s2: of the penetration depth that each surface gives */
    double us, ud, uv;         /* static, dynamic, viscous friction; uv in s/m */
    double transition_inverse; /* 1/v_t of the friction law, s/m */
    double hertz, hertz_share; /* E (two spheres, sphere and half-space), share of the first */
    double layers, backing;    /* depth at which the layers end, m; stiffness added from there on,
                                * Pa/m, 0 = none */
    double shear_root;         /* root of the bristles' stiffness s, (N/m)^0.5 */
};

/* Relative pose and velocity of a pair, in the frame of the first surface. */
struct native_relative {
    double R[9], p[3]; /* rotation and origin of the second surface's frame in it */
    double w[3], v[3]; /* velocity of the first body against the second; v at the first's origin */
};

/* Springs of one pair after another. They stay until there is no more room, so that tangents need
 * not find them again. Points and directions are in the frame of the pair's first surface. */
struct native_batch {
    size_t n;
    size_t start;                         /* the first of the pair at work */
    bool full;                            /* there was no room for all, earlier ones are gone */
    _Alignas(64) double p[3][BATCH_MAX];  /* where they act */
    _Alignas(64) double d[3][BATCH_MAX];  /* unit normal: the way the first body is pushed */
    _Alignas(64) double force[BATCH_MAX]; /* elastic, without dissipation, N */
    _Alignas(64) double depth[BATCH_MAX]; /* penetration, m */
    _Alignas(64) double rate[BATCH_MAX];  /* of the force with the depth, N/m */
    _Alignas(64) double held[BATCH_MAX];  /* stiffness of bristles where friction sticks: their last
                                           * force over the bend (struct friction_bend) */
};

/* Sums over the springs of a pair: the wrench on the first body about the origin of its surface's
 * frame, and energies. */
struct native_sum {
    double force[3], moment[3];
    double normal;           /* sum of the springs' normal forces, N */
    double lever[3];         /* of their normal forces times where they act; over normal it is the
                              * center of pressure */
    double potential, power; /* stored (J), dissipated (W) */
    double area, depth; /* in touch (m2), deepest penetration (m): kept by who makes the springs */
    /* Wanted instead of all of the above when it is not NULL: in the world's directions, to which
     * turn is the rotation of the first's frame, but about a center in the first's frame. */
    struct contact_tangent *tangent;
    const double *turn;
    /* Set where springs were only gathered, in closed form, and are not in the batch */
    bool closed;
    bool one_way; /* all springs push in the same direction; with gather and tangent */
    /* With sticking friction, first this without friction, then that for the friction; with the
     * tangent the latter too. NULL otherwise. contact/native/stick.h. */
    struct native_gather *gather;
    struct native_grip *grip;
};

/* Appends a spring at p that pushes the first body along d; there must be room. rate: stiffness of
 * the force with the depth, N/m; depth: penetration, m. */
static inline void batch_add_spring(struct native_batch *b, const double p[3], const double d[3],
                                    double rate, double depth)
{
    for (int k = 0; k < 3; k++) {
        b->p[k][b->n] = p[k];
        b->d[k][b->n] = d[k];
    }
    b->force[b->n] = rate * depth;
    b->depth[b->n] = depth;
    b->rate[b->n] = rate;
    b->n++;
}

/* Adds up the springs from start on, or adds them to the tangent when there is one, and moves start
 * behind them. Always in the same order, so the same springs give the same bits; the order depends
 * on the number of lanes, which is the same for all instruction sets (contact/lanes.h). */
void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum);

#endif
