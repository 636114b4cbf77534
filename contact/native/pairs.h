/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What two surfaces of the native engine do to each other, each pair of shapes in its own way. Each
 * function adds to sum in the frame of the first surface (contact/native/law.h) and leaves it alone
 * when nothing overlaps. SI units. RT-safe; nothing is kept from earlier calls; nothing fails.
 */
#ifndef CONTACT_NATIVE_PAIRS_H
#define CONTACT_NATIVE_PAIRS_H

#include "contact/native/law.h"
#include "contact/mesh/field.h"

/* How deep the middle of a spring lies in both bodies, over half its length: below DEPTH_NONE
 * the spring runs along the overlap instead of across it, and does not count; from DEPTH_FULL on
 * it counts in full. */
#define DEPTH_NONE 0.25
#define DEPTH_FULL 0.5

/* Facets of the second surface in the first's frame; padded for the lanes. */
struct native_view {
    double *normal[3], *center[3], *radius;
    int *ring;           /* first corner of each in corner, -1 before it is needed */
    double (*corner)[3]; /* counterclockwise */
    int ncorner;
};

/* Memory that an evaluation works in. Of what is in it only the springs outlive the call. */
struct native_scratch {
    struct native_batch batch;
    int *list[2];            /* of facets; as many as the largest mesh has faces, each */
    struct native_view view; /* the same, and three corners each */
    size_t visits; /* pairs of a facet and a cell of a field that an evaluation has looked at */
};

/* A capsule, or a sphere: then without length. */
struct native_capsule {
    double radius;
    double half; /* of the length of its axis, which is the frame's z, through its origin */
};

/* 0 up to a, 1 from b on, smooth between them. */
static inline double native_ramp(double x, double a, double b)
{
    double t = (x - a) / (b - a);

    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}

/* A mesh on a half-space: its facets below the plane, exactly clipped, on springs along the plane's
 * normal that stand side by side on the plane. A facet that is turned away does nothing.
 * half_space.c. */
void native_overlap_half_space(const struct solid *solid, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum);

/* A mesh and a sphere: over each facet the springs stand along its normal, from the facet to the
 * sphere's far side. sphere.c. */
void native_overlap_sphere(const struct solid *solid, double radius, const struct native_law *law,
                           const struct native_relative *relative, struct native_scratch *scratch,
                           struct native_sum *sum);

/* Two meshes by the pressure field of the first: what the second's facets feel in it, and what the
 * first's feel in that of the second where it is deeper than the first's is anywhere, which
 * without that field (NULL) is nowhere. fields.c. */
void native_overlap_fields(const struct field *first, const struct solid *second,
                           const struct field *second_field, const struct native_law *law,
                           const struct native_relative *relative, struct native_scratch *scratch,
                           struct native_sum *sum);

/* Two meshes by the elastic foundation on both: between each two facets that face each other the
 * springs stand along the mean of their normals, where both facets lie on top of one another.
 * meshes.c. */
void native_overlap_meshes(const struct solid *first, const struct solid *second,
                           const struct native_law *law, const struct native_relative *relative,
                           struct native_scratch *scratch, struct native_sum *sum);

/* Hertz's law for two spheres, or a sphere (first) on a half-space (second; its radius infinite).
 * hertz.c. */
void native_hertz(const double radius[2], const struct native_law *law,
                  const struct native_relative *relative, struct native_scratch *scratch,
                  struct native_sum *sum);

/* A capsule on a half-space: slices across the axis, each a segment of a disc below the plane, on
 * springs along the plane's normal. capsule.c. */
void native_capsule_half_space(const struct native_capsule *capsule, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum);

/* Two capsules, or a capsule and a sphere: springs along the shortest way from points of either
 * axis to the other. capsule.c. */
void native_capsules(const struct native_capsule *first, const struct native_capsule *second,
                     const struct native_law *law, const struct native_relative *relative,
                     struct native_scratch *scratch, struct native_sum *sum);

#endif
