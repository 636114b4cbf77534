/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The pressure field of a solid: a depth for every point inside, 0 on its surface, in cells in
 * each of which it is linear. Meters in the mesh's frame.
 *
 * Of a convex solid with few sides it is the depth under the side that the point is least behind:
 * one cell a side. Of any other it is a shell: from each vertex a spoke leads inward along the
 * direction in which all sides around it are left equally fast (in the sense of least squares where
 * no direction does that), as far as a ball on the spoke's end has room inside. Between the spokes
 * of a triangle are layers of prisms, cut into tetrahedra that share their faces with those beside
 * them; within the innermost layer, tetrahedra to one point. Under flat sides, and edges and
 * corners between them, the depth is exact. Wherever the spokes lead, the tetrahedra with their
 * orientation cover the inside once and the outside not at all, as they have no other boundary than
 * the surface.
 *
 * A field never changes once it is made; its memory is the arena's, and it points into its solid.
 * Making one is not RT-safe.
 */
#ifndef CONTACT_MESH_FIELD_H
#define CONTACT_MESH_FIELD_H

#include "contact/mesh/solid.h"

#define FIELD_MAX_PLANES 16 /* a convex solid with more facets has a shell */
#define FIELD_MAX_LAYERS 6  /* of prisms in a shell */
/* A tetrahedron is left out when the square of its volume is less than this times those of its
 * edges. */
#define FIELD_NO_VOLUME 1e-20

/* The pressure field (depth) of a solid. */
struct field {
    const struct solid *solid;
    double deepest; /* the largest depth, m */
    bool planar;    /* cells of a convex solid's planes; nothing below is used */

    /* Ends and joints of the spokes, with their depth: node[layer * nvertex + vertex] from the
     * surface (layer 0) to layer nlayer, then the innermost point. */
    const double (*node)[4];
    size_t nvertex;
    int nlayer;
    /* Over the prisms: cell[i] is layer * nface + face; in layer nlayer a tetrahedron. */
    struct tree tree;
    const int *cell;
};

/* A prism of a shell: the nodes on its outer side in the order of the vertices' numbers, so that
 * neighbors cut their common wall alike, and those on its inner side. In the innermost layer, a
 * tetrahedron: its inner side is one node. */
struct field_prism {
    int nnode; /* 6 or 4 */
    const double *node[6];
    int sign; /* 1 when the outer nodes run counterclockwise seen from outside, else -1 */
};

/* The tetrahedra of a prism: the first nnode - 3 of these. The sign of the volume of the second
 * is that of the prism, those of the others the opposite, where it lies right side out. */
static const int field_tetrahedron[3][4] = {{0, 1, 2, 3}, {0, 1, 4, 3}, {0, 5, 4, 3}};

/* Computes the field of a solid that outlives it. Memory from arena; the only error is
 * ERROR_MEMORY. Not RT-safe. */
enum error_code field_make(const struct solid *solid, const char *name, struct arena *arena,
                           struct field *field, struct error *error);

/* Puts two numbers in order; -1 when they were not. RT-safe. */
static inline int field_sort_two(int *a, int *b)
{
    int t = *a;

    if (*a < *b) {
        return 1;
    }
    *a = *b;
    *b = t;
    return -1;
}

/* Finds the nodes of the prism of a cell, ordered by the numbers of their vertices. RT-safe. */
static inline void field_find_prism(const struct field *field, int cell, struct field_prism *out)
{
    const int nface = (int)field->solid->nface, layer = cell / nface;
    const int *corner = field->solid->face[cell % nface];
    const double(*outer)[4] = field->node + (size_t)layer * field->nvertex;
    const double(*inner)[4] = outer + field->nvertex;
    int a = corner[0], b = corner[1], c = corner[2];

    /* Three exchanges sort the corners; each turns the orientation around */
    out->sign = field_sort_two(&a, &b) * field_sort_two(&b, &c);
    out->sign *= field_sort_two(&a, &b);
    out->node[0] = outer[a];
    out->node[1] = outer[b];
    out->node[2] = outer[c];

    /* In the innermost layer a tetrahedron to the innermost point */
    if (layer == field->nlayer) {
        out->nnode = 4;
        out->node[3] = inner[0];
        return;
    }
    out->nnode = 6;
    out->node[3] = inner[c];
    out->node[4] = inner[b];
    out->node[5] = inner[a];
}

#endif
