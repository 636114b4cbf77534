/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The law of contact.h at many points at once, for the native engine. What a pair of surfaces has
 * in common is integrated in the frame of its first surface; forces are those on the first one.
 */
#ifndef CONTACT_NATIVE_LAW_H
#define CONTACT_NATIVE_LAW_H

#include "contact/contact.h"
#include "contact/native_variant.h"

#include <stdbool.h>
#include <stddef.h>

/* Points: a multiple of any number of lanes, but of no large power of two, for which all arrays would
 * share the same lines of the cache. */
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
};

/* Where and how the second surface is, seen from the first. */
struct native_relative {
    double R[9], p[3]; /* frame of the second in that of the first */
    double w[3], v[3]; /* the first body's velocity against the second's; v at the first's origin */
};

/* Springs: where they act, the direction that they push the first body in, their force without
 * dissipation, and the depth. Those of pairs that are done stay in it until there is no more room, so
 * that tangents need not find them again. */
struct native_batch {
    size_t n;
    size_t start; /* the first of the pair that is at work */
    bool full;    /* there was no room for all, earlier ones are gone */
    _Alignas(64) double p[3][BATCH_MAX];
    _Alignas(64) double d[3][BATCH_MAX];
    _Alignas(64) double force[BATCH_MAX];
    _Alignas(64) double depth[BATCH_MAX];
    _Alignas(64) double rate[BATCH_MAX]; /* of the force with the depth */
};

/* What the springs of a pair do to the first body, about the origin of its frame. */
struct native_sum {
    double force[3], moment[3];
    double normal;   /* sum of the springs' normal forces */
    double lever[3]; /* sum of their normal forces times where they act */
    double potential, power;
    double area, depth; /* kept by who makes the springs */
    /* Wanted instead of all of the above when it is not NULL: in the world's directions, to which
     * turn is the rotation of the first's frame, but about a center in the first's frame. */
    struct contact_tangent *tangent;
    const double *turn;
};

/* Adds up the springs from start on, or puts them into the tangent when there is one, and starts
 * behind them. Always in the
 * same order, so the same springs give the same bits on the same machine; with lanes of another number
 * the order is another. RT-safe. */
void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum);

/* Has room for n springs more, empty if need be: then adds up what there is first. RT-safe. */
void native_law_make_room(struct native_batch *batch, size_t n, const struct native_law *law,
                          const struct native_relative *relative, struct native_sum *sum);

#endif
