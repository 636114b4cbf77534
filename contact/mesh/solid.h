/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A closed triangle mesh made ready for contact: bounding-volume trees, the directions that tell
 * inside from outside, and facets. A facet is a convex flat polygon: a set of coplanar triangles
 * that tile it, or one triangle. Integrals over a mesh are taken over its facets, so that they do
 * not depend on how finely a flat side happens to be cut.
 *
 * Lengths are meters in the mesh's frame; normals point outward and have unit length. A solid never
 * changes once it is made; its memory is the arena's, and it points into its mesh. Making one is
 * not RT-safe; asking one for distances is.
 */
#ifndef CONTACT_MESH_SOLID_H
#define CONTACT_MESH_SOLID_H

#include "contact/mesh/mesh.h"
#include "contact/variant.h"
#include "contact/mesh/tree.h"

#define FACET_MAX_VERTICES 64
#define SOLID_LANES 8  /* arrays that lanes read are padded to a multiple of this */
#define FACET_POINTS 3 /* of quadrature in each part of a triangle between centroid and edge */

#define FACET_POWERS 6 /* of struct facet_moments */

/* Entries of an outline: SOLID_LANES can be read at once from each entry on, and from the next. */
#define FACET_OUTLINE(count) (((count) + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES + SOLID_LANES)

/* A convex flat polygon of the surface. */
struct facet {
    int first, count;  /* corners: solid->ring[first] to [first + count - 1], counterclockwise */
    int nface;         /* triangles that tile it */
    double normal[3];  /* outward, unit */
    double offset;     /* normal . any of its points */
    double center[3];  /* centroid */
    double radius;     /* of the circle about the center that holds the facet, */
    double inradius;   /* and of the one that the facet holds */
    double area;       /* m2 */
    int point, npoint; /* its points of quadrature; none for a triangle */
    /* Parts along an edge that the triangles between its centroid and its edges are cut into for
     * them: 2 of a large facet with few corners, else 1. What is linear all of them integrate
     * exactly, but not friction on a face that spins: 1 is 0.8 % off on a square, 2 are 0.06 %. */
    int parts;
    double axis[2][3]; /* of its plane, right-handed with the normal */
    int outline;       /* its corners along the axes, from the center; not of a triangle */
    int moments;       /* its row of solid->moments; -1 = none: its points are few */
};

/* Integrals over a facet of the products of two of 1, x, y, xx, xy and yy, with x and y along its
 * axes from its center. */
struct facet_moments {
    double of[FACET_POWERS][FACET_POWERS]; /* symmetric; m2 and up */
};

/* Rows of solid->plane: a normal and its offset. */
enum { PLANE_X, PLANE_Y, PLANE_Z, PLANE_OFFSET, PLANE_ROWS };

/* A mesh ready for contact. */
struct solid {
    size_t nvertex, nface, nfacet, npoint;
    struct box box;
    double radius; /* half of the box's diagonal */

    /* Triangles */
    const double (*vertex)[3];
    const int (*face)[3];
    const double (*normal)[3];        /* of faces, unit */
    const double (*vertex_normal)[3]; /* sum of the faces' normals weighted by their angles; of a
                                       * solid that is not convex */
    const int (*neighbor)[3];         /* face across the edge from corner i to i + 1 */
    struct tree faces;

    /* Facets */
    const struct facet *facet;
    const double (*ring)[3];
    const double *point[3], *weight; /* points of quadrature and their share of the area */
    /* Corners of facets along the axes of their planes, counterclockwise: from facet.outline on as
     * many as it has, then the first once more, up to FACET_OUTLINE. */
    const double *outline[2];
    const struct facet_moments *moments; /* of facets with many points of quadrature */
    struct tree facets;
    const struct box *normal_bounds; /* of the normals under each node of the tree of facets */

    /* Planes of the facets, of a convex solid: a point behind all of them is inside */
    bool convex;
    const double *plane[PLANE_ROWS]; /* padded, the last repeated */
    size_t nplane;
};

/* Computes the q-th of the three points of quadrature in one of the equal triangles that a triangle
 * is cut into, each edge in parts of the length part: number `at` of the 2/part - 2 row - 1 in a
 * row, every other one upside down. Where it is: s and t of the ways from the triangle's first
 * corner to the others. RT-safe. */
static inline void triangle_find_point(double part, int row, int at, int q, double *s, double *t)
{
    const int flip = at % 2;
    const double way = (flip ? -1 : 1) * (1.0 / 6);

    *s = (at / 2 + flip + way * (q == 1 ? 4 : 1)) * part;
    *t = (row + flip + way * (q == 2 ? 4 : 1)) * part;
}

/* The part of a triangle that is nearest to a point. */
enum triangle_feature {
    FEATURE_FACE = -1,
    FEATURE_EDGE_0, /* from corner 0 to 1, and so on */
    FEATURE_EDGE_1,
    FEATURE_EDGE_2,
    FEATURE_CORNER_0,
    FEATURE_CORNER_1,
    FEATURE_CORNER_2
};

/* The nearest point of the surface. */
struct solid_nearest {
    int face;
    enum triangle_feature feature; /* of that face */
    double point[3];
    double distance2; /* squared */
    bool inside;      /* of the point that was asked for, by the nearest face alone */
};

/* Makes a solid of a mesh that is sound (mesh_check) and outlives it. Memory from arena; the only
 * error is ERROR_MEMORY. Not RT-safe. */
enum error_code solid_make(const struct mesh *mesh, struct arena *arena, struct solid *solid,
                           struct error *error);

/* Finds the point of one face nearest to p. RT-safe. */
void solid_nearest_of_face(const struct solid *solid, int face, const double p[3], double out[3]);

/* Finds the point of the surface nearest to p among those closer than the square root of limit2; of
 * several equally near the one whose face p is most straight above. False when there is none.
 * RT-safe; visits every face at worst. */
bool solid_find_nearest(const struct solid *solid, const double p[3], double limit2,
                        struct solid_nearest *nearest);

/* Returns the penetration depth of p, m: its distance to the surface, negative outside, right for
 * any closed surface: the sign is that of the
 * pseudonormal of the nearest face, edge or corner (Baerentzen, Aanaes 2005). What is farther than
 * limit from the surface may come back as limit; outside a convex solid the number is no more than
 * the distance to the farthest plane. RT-safe. */
double solid_depth(const struct solid *solid, const double p[3], double limit);

#endif
