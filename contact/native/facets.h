/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact of two facets of two meshes, for the native engine. Between facets that face
 * each other stands a bed of springs along the mean of their normals, where both lie on top of one
 * another: so the undamped force is the stiffness times the volume between them, however they are
 * cut into triangles, and it changes continuously with the pose. Facets that stand across each
 * other add nothing, and those a little off it their share. SI units. Nothing fails; RT-safe.
 */
#ifndef CONTACT_NATIVE_FACETS_H
#define CONTACT_NATIVE_FACETS_H

#include "contact/native/pairs.h"

/* Facets whose normals are this close to being perpendicular to one another do not face each other;
 * from FACING_FULL on their springs count in full (cosines of the angle between one normal and the
 * other's opposite). */
#define FACING_NONE 0.1
#define FACING_FULL 0.5

/* Two meshes at work, and the numbers that are the same for all their facets. */
struct facets_between {
    const struct solid *first, *second;
    const struct native_law *law;
    const struct native_relative *relative;
    struct native_scratch *scratch;
    struct native_sum *sum;
    double reach; /* longest spring, m */
    double fine;  /* m; facets up to this radius have three springs with one of the other mesh */
};

/* Two facets that face each other: a of the first mesh, b of the second; first's frame. */
struct facets_couple {
    const struct facet *a, *b;
    const double (*ring)[3]; /* the corners of the one that has fewer of them; b's if equal */
    double normal_b[3], center_b[3];
    double facing; /* -normal_a . normal_b, over FACING_NONE */
};

/* Adds the springs between two facets. */
void facets_add_springs(const struct facets_between *m, const struct facets_couple *c);

#endif
