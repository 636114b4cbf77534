/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Penetration (overlap) of two surfaces in the native engine, for each pair of shapes: each
 * function is the narrow phase of its pair. It finds where the surfaces overlap and how deep, puts
 * springs there, adds up their forces to sum in the frame of the first surface
 * (contact/native/law.h), and leaves sum alone when nothing overlaps. SI units. RT-safe; nothing is
 * kept from earlier calls; nothing fails.
 */
#ifndef CONTACT_NATIVE_NARROW_PHASE_H
#define CONTACT_NATIVE_NARROW_PHASE_H

#include "contact/native/law.h"
#include "contact/mesh/field.h"

/* Limits for a spring's weight: the distance of its middle to the nearest point of either body's
 * surface, over half its length. Below DEPTH_NONE the spring runs along the overlap instead of
 * across it, and does not count; from DEPTH_FULL on it counts in full. */
#define DEPTH_NONE 0.25
#define DEPTH_FULL 0.5

/* Facets of the second surface transformed into the first's frame; arrays are padded for the
 * lanes. */
struct native_view {
    double *normal[3], *center[3], *radius;
    int *ring;           /* first corner of each in corner, -1 before it is needed */
    double (*corner)[3]; /* counterclockwise */
    int ncorner;
};

/* Working memory of an evaluation. Only the springs in it outlive the call, for tangents. */
struct native_scratch {
    struct native_batch batch;
    int *list[2];            /* of facets; as many as the largest mesh has faces, each */
    struct native_view view; /* the same, and three corners each */
    size_t visits; /* pairs of a facet and a cell of a field that an evaluation has looked at */
};

/* A capsule, or a sphere: a capsule without length. */
struct native_capsule {
    double radius;
    double half; /* of the length of its axis, which is the frame's z, through its origin */
};

/* Returns a smooth step: 0 for x up to a, 1 from b on, a cubic between them. */
static inline double native_ramp(double x, double a, double b)
{
    double t = (x - a) / (b - a);

    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
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
    PAIR_CAPSULES, /* of which one may be a sphere */
};

/* Two surfaces that may overlap, and where the springs between them go. Of the shapes a narrow
 * phase reads those of its kind. */
struct native_overlap {
    const struct solid *solid[2];
    const struct field *field[2];     /* the second's is NULL when it is nowhere so deep */
    struct native_capsule capsule[2]; /* or sphere; of a half-space the radius is infinite */
    const struct native_law *law;
    double from; /* depth from which on the springs count, m */
    const struct native_relative *relative;
    struct native_scratch *scratch;
    struct native_sum *sum;
};

/* Adds what two surfaces of a kind do to each other to sum: the springs of their layers, and of
 * what backs them where the penetration is deeper. law.c. */
void native_overlap(enum native_pair_kind kind, const struct native_overlap *o);

/* Makes room for n springs more: where there is none, adds up those that there are first. */
void native_make_room(const struct native_overlap *o, size_t n);

/* A mesh on a half-space: its facets are clipped at the plane, and what is below stands on springs
 * along the plane's normal that stand side by side on the plane, as long as the penetration is deep
 * there. A facet that is turned away does nothing. half_space.c. */
void native_overlap_half_space(const struct native_overlap *o);

/* A mesh and a sphere: over each facet the springs stand along its normal, from the facet to the
 * far side of the sphere. sphere.c. */
void native_overlap_sphere(const struct native_overlap *o);

/* Two meshes by the pressure field of the first: the pressure of its depth on the second's facets
 * inside it, and that of the second's field on the first's facets where it is deeper than the
 * first's is anywhere. pressure_field.c. */
void native_overlap_fields(const struct native_overlap *o);

/* Two meshes by the elastic foundation on both: between each two facets that face each other the
 * springs stand along the mean of their normals, where both facets lie on top of one another. Adds
 * the springs of what backs the layers too, facet by facet. elastic_foundation.c. */
void native_overlap_meshes(const struct native_overlap *o);

/* Hertz's law for two spheres, or a sphere (first) on a half-space, which has no layers.
 * capsule.c. */
void native_overlap_hertz(const struct native_overlap *o);

/* A capsule on a half-space: slices across the axis, each a segment of a disc below the plane, on
 * springs along the plane's normal. capsule.c. */
void native_overlap_capsule_half_space(const struct native_overlap *o);

/* Two capsules, or a capsule and a sphere: springs along the shortest distance from points of
 * either axis to the nearest point of the other. capsule.c. */
void native_overlap_capsules(const struct native_overlap *o);

#endif
