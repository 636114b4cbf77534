/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The pressure field of a solid: the penetration depth at each point inside, 0 on the surface. The
 * inside is divided into cells; the depth is linear in each cell. Meters in the mesh's frame.
 *
 * For a convex solid with few sides, the depth is the distance to the nearest side's plane: one
 * cell per side. Any other solid has a shell. From each vertex a spoke leads inward, in the
 * direction that leaves all adjacent sides equally fast (least squares if there is none). A spoke
 * ends where a ball about its end that touches these sides no longer fits inside. Between the
 * spokes of a triangle there are layers of prisms, cut into tetrahedra that share faces with their
 * neighbors. Inside the innermost layer, tetrahedra lead to one point. Under flat sides, and
 * their edges and corners, the depth is exact. Counted with their orientation, the tetrahedra cover
 * the inside once and the outside not at all. This holds for any direction of the spokes, because
 * the surface is the only boundary of the tetrahedra.
 *
 * A field is immutable. Memory from the arena; the field points into its solid. Making a field is
 * not RT-safe.
 */
#ifndef CONTACT_MESH_FIELD_H
#define CONTACT_MESH_FIELD_H

#include "contact/mesh/solid.h"

#define FIELD_MAX_PLANES 16 /* a convex solid with more facets has a shell */
#define FIELD_MAX_LAYERS 6  /* maximum number of layers of prisms in a shell */
/* A tetrahedron is left out if its squared volume is less than this factor times the product of
 * its squared edge lengths. */
#define FIELD_NO_VOLUME 1e-20

/* The pressure field (depth) of a solid. */
struct field {
    const struct solid *solid;
    double deepest; /* the largest depth, m */
    /* true: one cell per plane of a convex solid, and the members below are unused */
    bool planar;

    /* Nodes of the spokes, with their depth: node[layer * nvertex + vertex] from the surface
     * (layer 0) to layer nlayer, then the innermost point. */
    const double (*node)[4];
    size_t nvertex;
    int nlayer;
    /* Tree over the cells: cell[i] is layer * nface + face. In layer nlayer it is a
     * tetrahedron. */
    struct tree tree;
    const int *cell;
};

/* A prism of a shell. The nodes of its outer side come first, in ascending order of their vertices,
 * so that two neighbors cut their common wall in the same way. Then come the nodes of its inner
 * side. In the innermost layer the prism is a tetrahedron: its inner side is one node. */
struct field_prism {
    int nnode; /* number of nodes: 6 or 4 */
    const double *node[6];
    int sign; /* 1 when the outer nodes run counterclockwise seen from outside, else -1 */
};

/* The tetrahedra of a prism: the first nnode - 3 rows. In a correctly oriented prism, the volume
 * of the second has the sign of the prism, and the volumes of the others the opposite sign. */
static const int field_tetrahedron[3][4] = {{0, 1, 2, 3}, {0, 1, 4, 3}, {0, 5, 4, 3}};

/* Computes the field of a solid that outlives it. Memory from arena; the only error is
 * ERROR_MEMORY. Not RT-safe. */
enum error_code field_make(const struct solid *solid, const char *name, struct arena *arena,
                           struct field *field, struct error *error);

/* Sorts two numbers. Returns -1 if it exchanged them, else 1. RT-safe. */
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

/* Finds the nodes of the prism of a cell, sorted by their vertices. RT-safe. */
static inline void field_find_prism(const struct field *field, int cell, struct field_prism *out)
{
    const int nface = (int)field->solid->nface, layer = cell / nface;
    const int *corner = field->solid->face[cell % nface];
    const double(*outer)[4] = field->node + (size_t)layer * field->nvertex;
    const double(*inner)[4] = outer + field->nvertex;
    int a = corner[0], b = corner[1], c = corner[2];

    /* Three exchanges sort the corners; each one reverses the orientation */
    out->sign = field_sort_two(&a, &b) * field_sort_two(&b, &c);
    out->sign *= field_sort_two(&a, &b);
    out->node[0] = outer[a];
    out->node[1] = outer[b];
    out->node[2] = outer[c];

    /* The innermost layer has tetrahedra to the innermost point */
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
