/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A closed triangle mesh prepared for contact: bounding-volume trees, pseudonormals that tell
 * inside from outside, and facets. A facet is a convex flat polygon: a set of coplanar triangles
 * that tile it, or one triangle. Integrals over a mesh are taken over its facets, so they do not
 * depend on the triangulation of a flat side.
 *
 * Lengths are meters in the mesh's frame; normals point outward and have unit length. A solid is
 * immutable; the arena owns its memory, and it points into its mesh. Making a solid is not RT-safe;
 * distance queries are RT-safe.
 */
#ifndef CONTACT_MESH_SOLID_H
#define CONTACT_MESH_SOLID_H

#include "contact/mesh/mesh.h"
#include "contact/variant.h"
#include "contact/mesh/tree.h"

#define FACET_MAX_VERTICES 64
#define SOLID_LANES 8  /* arrays that lanes read are padded to a multiple of this */
#define FACET_POINTS 3 /* quadrature points in each part of a triangle between centroid and edge */

#define FACET_POWERS 6 /* rows and columns of struct facet_moments */

/* Number of entries of an outline with `count` corners. The padding allows loading SOLID_LANES
 * entries from each corner on, and from the entry after it. */
#define FACET_OUTLINE(count) (((count) + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES + SOLID_LANES)

/* A convex flat polygon of the surface. */
struct facet {
    int first, count;  /* corners: solid->ring[first] to [first + count - 1], counterclockwise */
    int nface;         /* number of triangles that tile it */
    double normal[3];  /* outward, unit */
    double offset;     /* dot product of normal and any point of the facet */
    double center[3];  /* centroid */
    double radius;     /* smallest circle about the center that contains the facet */
    double inradius;   /* largest circle about the center inside the facet */
    double area;       /* m2 */
    int point, npoint; /* first quadrature point and number; 0 for a triangle */
    /* Parts of an edge for quadrature: 2 for a large facet with few corners, else 1. Any number
     * integrates linear functions exactly. Friction on a spinning square face has an error of 0.8
     * % with 1 part and 0.06 % with 2. */
    int parts;
    double axis[2][3]; /* axes of its plane, right-handed with the normal */
    int outline;       /* first corner in solid->outline; not for a triangle */
    int moments;       /* row in solid->moments; -1 = none, because it has few points */
};

/* Integrals over a facet of all products of two of the functions 1, x, y, xx, xy and yy. x and y
 * are coordinates along its axes from its center. */
struct facet_moments {
    double of[FACET_POWERS][FACET_POWERS]; /* symmetric; m2 to m6 */
};

/* Rows of solid->plane: a normal and its offset. */
enum { PLANE_X, PLANE_Y, PLANE_Z, PLANE_OFFSET, PLANE_ROWS };

/* A mesh ready for contact. */
struct solid {
    size_t nvertex, nface, nfacet, npoint;
    struct box box;
    double radius; /* half of the diagonal of the mesh's box */

    /* Triangles */
    const double (*vertex)[3];
    const int (*face)[3];
    const double (*normal)[3]; /* unit normals of the faces */
    /* angle-weighted sum of adjacent face normals; only for a solid that is not convex */
    const double (*vertex_normal)[3];
    const int (*neighbor)[3]; /* face across the edge from corner i to i + 1 */
    struct tree faces;

    /* Facets */
    const struct facet *facet;
    const double (*ring)[3];
    const double *point[3], *weight; /* quadrature points and their shares of the area */
    /* Corners of the facets along the axes of their planes, counterclockwise: from facet.outline
     * on, all corners, then the first corner repeated up to FACET_OUTLINE. */
    const double *outline[2];
    const struct facet_moments *moments; /* for facets with many quadrature points */
    struct tree facets;
    /* bounds of the normals under each node of the tree of facets */
    const struct box *normal_bounds;

    /* Planes of the facets of a convex solid: a point behind all of them is inside */
    bool convex;
    const double *plane[PLANE_ROWS]; /* padded with the last plane */
    size_t nplane;
};

/* Computes the q-th of three quadrature points in a small triangle. Each edge of the original
 * triangle is divided into parts of relative length part, which gives equal small triangles in
 * rows. Row `row` has 2/part - 2 row - 1 of them; every other one is inverted. at: number of the
 * small triangle in its row. Output: s and t, the point's coordinates along the two edges from the
 * first corner. RT-safe. */
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
    enum triangle_feature feature; /* part of that face */
    double point[3];
    double distance2; /* squared */
    bool inside;      /* whether the query point is inside, judged by the nearest face only */
};

/* Makes a solid from a mesh that is sound (mesh_check) and outlives it. Memory from arena; the
 * only error is ERROR_MEMORY. Not RT-safe. */
enum error_code solid_make(const struct mesh *mesh, struct arena *arena, struct solid *solid,
                           struct error *error);

/* Finds the point of one face nearest to p. RT-safe. */
void solid_nearest_of_face(const struct solid *solid, int face, const double p[3], double out[3]);

/* Finds the surface point nearest to p with a squared distance less than limit2. Of equally near
 * points, it takes the point on the face above which p is highest. Returns false if there is none.
 * RT-safe; visits each face in the worst case. */
bool solid_find_nearest(const struct solid *solid, const double p[3], double limit2,
                        struct solid_nearest *nearest);

/* Returns the penetration depth of p, m: its distance to the surface, negative outside. The sign
 * is exact for any closed surface: it comes from the pseudonormal of the nearest face, edge or
 * corner (Baerentzen, Aanaes 2005). A distance above limit may be returned as limit. Outside a
 * convex solid the result is a lower bound: the distance to the farthest plane. RT-safe. */
double solid_depth(const struct solid *solid, const double p[3], double limit);

#endif
