/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The law of contact.h at many springs at once, for the native engine. What a pair of surfaces has
 * in common is integrated in the frame of its first surface; forces are those on the first one. SI
 * units. All memory is the caller's; nothing fails; all is RT-safe.
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
    double share[2];           /* of the depth that each surface gives */
    double us, ud, uv;         /* friction; uv in s/m */
    double transition_inverse; /* 1/v_t */
    double hertz, hertz_share; /* E (two spheres, sphere and half-space), share of the first */
    double layers, backing;    /* depth at which the layers end, m; what pushes too from there on,
                                * Pa/m, 0 = nothing */
    double shear_root;         /* root of the bristles' stiffness s, (N/m)^0.5 */
};

/* Pose and velocity of the second surface, seen from the first. */
struct native_relative {
    double R[9], p[3]; /* frame of the second in that of the first */
    double w[3], v[3]; /* the first body's velocity against the second's; v at the first's origin */
};

/* Springs of one pair after another. They stay until there is no more room, so that tangents
 * need not find them again. */
struct native_batch {
    size_t n;
    size_t start;                         /* the first of the pair at work */
    bool full;                            /* there was no room for all, earlier ones are gone */
    _Alignas(64) double p[3][BATCH_MAX];  /* where they act */
    _Alignas(64) double d[3][BATCH_MAX];  /* the direction that they push the first body in */
    _Alignas(64) double force[BATCH_MAX]; /* without dissipation, N */
    _Alignas(64) double depth[BATCH_MAX]; /* m */
    _Alignas(64) double rate[BATCH_MAX];  /* of the force with the depth, N/m */
    _Alignas(64) double held[BATCH_MAX];  /* what bristles hold by where friction sticks: the last
                                           * force over the bend (struct friction_bend) */
};

/* What the springs of a pair do to the first body, about the origin of its frame. */
struct native_sum {
    double force[3], moment[3];
    double normal;           /* sum of the springs' normal forces */
    double lever[3];         /* sum of their normal forces times where they act */
    double potential, power; /* stored (J), dissipated (W) */
    double area, depth;      /* in touch, deepest: kept by who makes the springs */
    /* Wanted instead of all of the above when it is not NULL: in the world's directions, to which
     * turn is the rotation of the first's frame, but about a center in the first's frame. */
    struct contact_tangent *tangent;
    const double *turn;
    bool one_way; /* all springs push in the same direction; with gather and tangent */
    /* With sticking friction, first this without friction, then that for the friction; with the
     * tangent the latter too. NULL otherwise. contact/native/stick.h. */
    struct native_gather *gather;
    struct native_grip *grip;
};

/* Whether springs that are found to be this deep reach through the layers. */
static inline bool native_law_is_backed(const struct native_law *law, double depth)
{
    return law->backing > 0 && depth > law->layers;
}

/* The law of the springs of what backs the layers, by how much deeper than these they are. */
static inline struct native_law native_law_of_backing(const struct native_law *law)
{
    struct native_law backing = *law;

    backing.stiffness = law->backing;
    backing.backing = 0;
    return backing;
}

/* Adds a spring; there must be room. rate: of the force with the depth. */
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
 * behind them. Always in the same order, so the same springs give the same bits on the same
 * machine; with another number of lanes the order is another. */
void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum);

/* Makes room for n springs more: where there is none, adds up those that there are first. */
void native_law_make_room(struct native_batch *batch, size_t n, const struct native_law *law,
                          const struct native_relative *relative, struct native_sum *sum);

#endif
