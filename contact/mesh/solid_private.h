/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to the making of a solid (solid.c, solid_facets.c): its intermediate data and the steps
 * that have files of their own. The arena owns results; solid_make frees all other memory. Units
 * and frames as in solid.h. Not RT-safe.
 */
#ifndef CONTACT_MESH_SOLID_PRIVATE_H
#define CONTACT_MESH_SOLID_PRIVATE_H

#include "contact/mesh/solid.h"

#define CONVEX 1e-5 /* largest relative height of a dent that counts as convex */

struct solid_builder {
    const struct mesh *mesh;
    struct arena *arena;
    struct error *error;
    double size; /* diagonal of the mesh's box, m */

    /* In the arena; these become members of the solid */
    double (*normal)[3];
    int (*neighbor)[3];
    struct facet *facet;
    double (*ring)[3];
    size_t nfacet, nring;

    /* On the heap */
    int *group;       /* by face: seed face of its plane, or -1 */
    int *member;      /* faces of the plane that becomes a facet */
    int *next;        /* by vertex: the next vertex on the plane's rim, or -1 */
    int *ring_vertex; /* the mesh's vertex at each corner in ring */

    int loop[FACET_MAX_VERTICES]; /* corners of the plane's rim */
};

/* Allocates count elements in the arena; returns NULL and sets ERROR_MEMORY if there is no
 * room. */
void *solid_alloc(struct solid_builder *b, size_t count, size_t size);

/* Returns the i-th corner of a face, m. */
static inline const double *mesh_corner(const struct mesh *mesh, int face, int i)
{
    return mesh->vertex[mesh->face[face][i]];
}

/* Finds the facets. The faces must have normals and neighbors. */
enum error_code solid_make_facets(struct solid_builder *b, struct solid *s);

/* Computes the quadrature points of facets that have more than one triangle. Points of single
 * triangles are computed on demand; they would fill the memory for a large terrain. */
enum error_code solid_make_points(struct solid_builder *b, struct solid *s);

/* Computes, for facets with more than one triangle, the corners along the axes of their planes, and
 * the moments. */
enum error_code solid_make_outlines(struct solid_builder *b, struct solid *s);
enum error_code solid_make_moments(struct solid_builder *b, struct solid *s);

#endif
