/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A closed triangle mesh made ready for contact, in its own frame: trees, the directions that say
 * inside from outside, and facets. A facet is a convex flat polygon: a set of coplanar triangles
 * that tile it, or one triangle. Integrals over a mesh are taken over its facets, so that they do
 * not depend on how finely a flat side happens to be cut.
 */
#ifndef CONTACT_SOLID_H
#define CONTACT_SOLID_H

#include "contact/mesh.h"
#include "contact/native_variant.h"
#include "contact/tree.h"

#define FACET_MAX_VERTICES 64
#define SOLID_LANES 8  /* what is read side by side is padded to a multiple of this */
#define FACET_POINTS 3 /* of quadrature in each triangle between the centroid and an edge */

/* Entries of an outline: of the edge from each entry to the next, SOLID_LANES can be read at once. */
#define FACET_OUTLINE(count) (((count) + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES + SOLID_LANES)

struct facet {
    int first, count; /* vertices: solid->ring[first] to [first + count - 1], counterclockwise */
    int tiles;        /* faces that make it up */
    double normal[3]; /* outward, unit */
    double offset;    /* normal . any of its points */
    double center[3]; /* centroid */
    double radius;    /* of the circle about the center that holds the facet */
    double within;    /* and of the one that it holds */
    double area;
    int point, npoint; /* its points of quadrature; none for a triangle */
    /* The faces that touch it lean off it by less than a right angle, at most with this cosine and
     * sine, and all others are three times room away. 0 where nothing is known. */
    double lean[2], room;
    double across[2][3]; /* directions in its plane, right-handed with the normal */
    int outline;         /* its corners along them, from the center; not of a triangle */
};

struct solid {
    const char *name;
    size_t nface, nfacet, npoint;
    struct box box;
    double radius; /* half of the box's diagonal */

    /* triangles */
    const double *centroid[3], *area;
    const double (*vertex)[3];
    const int (*face)[3];
    const double (*normal)[3];        /* of faces, unit */
    const double (*vertex_normal)[3]; /* sum of the faces' normals weighted by their angles */
    const int (*neighbor)[3];         /* face across the edge from corner i to i + 1 */
    struct tree faces;

    const struct facet *facet;
    const double (*ring)[3];
    const double *point[3], *weight; /* points of quadrature and their share of the area */
    /* Corners of facets in their planes, counterclockwise: from facet.outline on x and y of as many
     * as it has, then the first once more, up to FACET_OUTLINE. */
    const double *outline[2];
    struct tree facets;
    const struct box *facing; /* of the normals under each node of the tree of facets */
    bool convex;              /* then every point behind all facets is inside, */
    const double *plane[4];   /* their normals and offsets; padded, the last repeated */
    size_t nplane;
};

/* The nearest point of the surface. */
struct solid_nearest {
    int face;
    double point[3];
    double distance2;
    bool inside; /* of the point that was asked for, by the nearest face alone */
};

/* mesh is sound (mesh_check) and outlives the solid. Memory from arena. Not RT-safe. */
enum error_code solid_make(const struct mesh *mesh, struct arena *arena, struct solid *solid,
                           struct error *error);

/* The point of one face nearest to p. RT-safe. */
void solid_nearest_of_face(const struct solid *solid, int face, const double p[3], double out[3]);

/* The point of the surface nearest to p among those closer than the square root of limit2; of
 * several equally near the one whose face p is most straight above. False when there is none.
 * RT-safe; visits every face at worst. */
bool solid_find_nearest(const struct solid *solid, const double p[3], double limit2,
                        struct solid_nearest *nearest);

/* Finds out what is around the facets (lean and room of struct facet) when all else of the solid is
 * made; ring_vertex: the mesh's vertex at each corner in ring. Not RT-safe. */
void solid_look_around(const struct solid *solid, const int *ring_vertex, struct facet *facet);

/* How deep p is inside, negative outside, right for any closed surface: the sign is that of the
 * pseudonormal of the nearest face, edge or corner (Baerentzen, Aanaes 2005). What is farther than
 * limit from the surface may come back as limit; outside a convex solid the number is no more than
 * the distance to the farthest plane. RT-safe. */
double solid_depth(const struct solid *solid, const double p[3], double limit);

#endif
