/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Narrow phase of the native engine: one function per pair of shapes. It finds the overlap of two
 * surfaces and its depth, places springs there, and adds their forces to sum in the frame of the
 * first surface (contact/native/law.h). Without overlap, sum is unchanged. SI units. RT-safe; no
 * state is kept between calls; nothing fails.
 */
#ifndef CONTACT_NATIVE_NARROW_PHASE_H
#define CONTACT_NATIVE_NARROW_PHASE_H

#include "base/vec3.h"
#include "contact/native/law.h"
#include "contact/mesh/field.h"

/* Weight of a spring, by the distance of its middle to the nearest surface of either body, over
 * half of the spring's length. Below DEPTH_NONE the spring runs along the overlap instead of across
 * it, and has no weight. From DEPTH_FULL on it has full weight. */
#define DEPTH_NONE 0.25
#define DEPTH_FULL 0.5

/* Facets of the second surface transformed into the first's frame; arrays are padded for the
 * lanes. */
struct native_view {
    double *normal[3], *center[3], *radius;
    /* by facet: index of its first corner in `corner`; -1 = not transformed yet */
    int *ring;
    double (*corner)[3]; /* counterclockwise */
    int ncorner;
};

/* Working memory of an evaluation. Only its springs are used after the call, for tangents. */
struct native_scratch {
    struct native_batch batch;
    int *list[2];            /* lists of facets; each has room for the largest mesh */
    struct native_view view; /* has room for the largest mesh, three corners per facet */
    size_t visits;           /* pairs of facet and field cell examined in this evaluation */
};

/* A capsule, a sphere as a capsule of length 0, or a cylinder. */
struct native_capsule {
    double radius;
    double half; /* half length of its axis, which is the frame's z through its origin */
    bool flat;   /* a cylinder: no half-spheres */
};

/* Returns a smooth step: 0 for x up to a, 1 from b on, a cubic between them. */
static inline double native_ramp(double x, double a, double b)
{
    double t = (x - a) / (b - a);

    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}

/* Computes the pose of the first surface's frame in the frame of the second. */
static inline void native_invert_pose(const struct native_relative *relative, double R[9],
                                      double p[3])
{
    mat3_transpose(relative->R, R);
    mat3_apply(R, relative->p, p);
    for (int k = 0; k < 3; k++) {
        p[k] = -p[k];
    }
}

/* Kinds of pairs by their shapes. */
enum native_pair_kind {
    PAIR_HERTZ_SPHERES,
    PAIR_HERTZ_HALF_SPACE,
    PAIR_MESH_HALF_SPACE,
    PAIR_MESH_SPHERE,
    PAIR_MESHES,
    PAIR_FIELDS,
    PAIR_CAPSULE_HALF_SPACE,
    PAIR_CAPSULES, /* one of them may be a sphere */
};

/* Two surfaces that may overlap, and the output for their springs. A narrow phase reads only the
 * shapes of its kind. */
struct native_overlap {
    const struct solid *solid[2];
    /* field[1] is NULL if the second is nowhere deeper than the first */
    const struct field *field[2];
    struct native_capsule capsule[2]; /* also spheres; a half-space has an infinite radius */
    const struct native_law *law;
    double from; /* depth from which springs count, m */
    const struct native_relative *relative;
    struct native_scratch *scratch;
    struct native_sum *sum;
};

/* Adds the contact of two surfaces to sum: the springs of their layers and, where the penetration
 * is deeper, of their backing. law.c. */
void native_overlap(enum native_pair_kind kind, const struct native_overlap *o);

/* Makes room for n more springs. If the batch is full, adds its springs to the sum and empties
 * it. */
void native_make_room(const struct native_overlap *o, size_t n);

/* Mesh on half-space: clips the facets at the plane. The part below has springs along the plane's
 * normal, as long as the depth. A facet that faces away adds nothing. half_space.c. */
void native_overlap_half_space(const struct native_overlap *o);

/* Mesh and sphere: over each facet, springs along its normal from the facet to the far side of the
 * sphere. sphere.c. */
void native_overlap_sphere(const struct native_overlap *o);

/* Two meshes by a pressure field: the depth in the first presses on facets of the second. Where the
 * second's depth exceeds the first's largest depth, it presses on facets of the first.
 * pressure_field.c. */
void native_overlap_fields(const struct native_overlap *o);

/* Two meshes by an elastic foundation: between two facets that face each other, springs along the
 * mean of their normals where the facets overlap. Also adds the springs of the backing, facet by
 * facet. elastic_foundation.c. */
void native_overlap_meshes(const struct native_overlap *o);

/* Hertz's law, without layers: for two spheres, or for a sphere (first) on a half-space.
 * capsule.c. */
void native_overlap_hertz(const struct native_overlap *o);

/* Capsule or cylinder on half-space: slices across the axis, each a segment of a disc below the
 * plane, with springs along the plane's normal. capsule.c. */
void native_overlap_capsule_half_space(const struct native_overlap *o);

/* Two capsules, or capsule and sphere: springs from points of either axis along the shortest
 * distance to the other axis. capsule.c. */
void native_overlap_capsules(const struct native_overlap *o);

#endif
