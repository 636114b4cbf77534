/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The law of contact.h (normal force, dissipation, friction) for many springs at once, in the
 * native engine. The penetration volume of a pair is integrated in the frame of its first surface;
 * forces act on the first surface. SI units. The caller owns all memory; nothing fails; all is
 * RT-safe.
 */
#ifndef CONTACT_NATIVE_LAW_H
#define CONTACT_NATIVE_LAW_H

#include "contact/contact.h"
#include "contact/variant.h"

/* Springs in a batch: a multiple of each number of lanes, but not of a large power of two, since
 * then all arrays would share the same cache lines. */
#define BATCH_MAX 1032
#define BATCH_ALIGN 8 /* each pair starts at a multiple of this, the largest number of lanes */

/* Constants of a pair. */
struct native_law {
    double stiffness;   /* k, Pa/m */
    double dissipation; /* c, s/m; 1.5 c with Hertz's shares */
    /* s1, s2: share of the penetration depth by which each surface is compressed */
    double share[2];
    double us, ud, uv;         /* static, dynamic, viscous friction; uv in s/m */
    double transition_inverse; /* 1/v_t of the friction law, s/m */
    double hertz, hertz_share; /* E of Hertz's law, and share of the first surface */
    /* depth at which the layers end, m; stiffness added beyond it, Pa/m (0 = none) */
    double layers, backing;
    double shear_root; /* root of the bristles' stiffness s, (N/m)^0.5 */
};

/* Relative pose and velocity of a pair, in the frame of the first surface. */
struct native_relative {
    double R[9], p[3]; /* pose of the second surface's frame in the first's */
    double w[3], v[3]; /* velocity of the first body against the second; v at the first's origin */
};

/* Springs of several pairs, one pair after another. They are kept while there is room, so that
 * tangents need not find them again. Points and directions are in the frame of each pair's first
 * surface. */
struct native_batch {
    size_t n;
    size_t start; /* first spring of the current pair */
    /* true: there was no room for all springs, and earlier ones are lost */
    bool full;
    _Alignas(64) double p[3][BATCH_MAX]; /* points of action */
    /* unit normal: direction in which the first body is pushed */
    _Alignas(64) double d[3][BATCH_MAX];
    _Alignas(64) double force[BATCH_MAX]; /* elastic, without dissipation, N */
    _Alignas(64) double depth[BATCH_MAX]; /* penetration, m */
    _Alignas(64) double rate[BATCH_MAX];  /* change of the force with the depth, N/m */
};

/* Sums over the springs of a pair: the wrench on the first body about the origin of its surface's
 * frame, and energies. */
struct native_sum {
    double force[3], moment[3];
    double normal; /* sum of the springs' normal forces, N */
    /* sum of normal force times point of action; divided by normal it is the center of pressure */
    double lever[3];
    double potential, power; /* stored (J), dissipated (W) */
    /* area in touch (m2), deepest penetration (m); updated by the narrow phase */
    double area, depth;
    /* If not NULL, computes only this tangent, not the sums above. Its directions are in the world
     * frame; its center is in the first frame. turn: rotation from the first frame to the world. */
    struct contact_tangent *tangent;
    const double *turn;
    /* true: springs were gathered in closed form and are not in the batch */
    bool closed;
    bool one_way; /* all springs push in the same direction; needed with gather and tangent */
    /* NULL without sticking friction (contact/native/friction_sums.h). gather is set in the first
     * pass, which has no friction. sticking is set in the friction pass and for the tangent. */
    struct native_gather *gather;
    struct sticking_patch *sticking;
};

/* Appends a spring at p that pushes the first body along d; there must be room. rate: change of
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

/* Adds the springs from start on to the sum, or to the tangent if it is set. Then sets start to the
 * end of the batch. The order is fixed, so the same springs give the same bits. It depends on the
 * number of lanes, which is the same for all instruction sets (contact/lanes.h). */
void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum);

#endif
