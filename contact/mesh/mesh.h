/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed triangle meshes: read from Wavefront OBJ, a box, measures, and a check of soundness.
 * Coordinates are meters in a frame of the mesh's own; faces run counterclockwise seen from
 * outside. A mesh never changes once it is made; its memory is the arena's that it was made in, and
 * errors leave the caller's pointer alone. No call here is RT-safe.
 *
 * Accepted OBJ: `v x y z` (an optional fourth number has to be 1), `f` with corners `v`, `v/vt`,
 * `v//vn`, `v/vt/vn`, indices from 1 or, negative, back from the newest vertex; a face may only
 * name vertices above it. Texture coordinates, normals, groups, objects, smoothing, materials and
 * comments are ignored; every other keyword is an error, so that a curve or a line does not
 * silently vanish from a surface. A backslash at the end of a line continues it (not in comments).
 *
 * A polygon is split as a fan from its first corner, which is right only when it is flat and
 * convex: others are refused (flat to 1e-3 of its longest edge). The surface has to be sound as
 * mesh_check says. Vertices are not merged, because a guess at what belongs together can close a
 * hole that was meant. Self-intersection is not detected.
 */
#ifndef CONTACT_MESH_MESH_H
#define CONTACT_MESH_MESH_H

#include "base/arena.h"
#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

#define MESH_MAX_FILE_BYTES ((size_t)256 << 20)
#define MESH_MAX_VERTICES ((size_t)1 << 19)
#define MESH_MAX_FACES ((size_t)1 << 19) /* two such fit into the memory of a run */
#define MESH_MAX_CORNERS ((size_t)256)   /* of one polygon */
#define MESH_MAX_COORDINATE_M 1e6        /* keeps areas and volumes far from overflow */
#define MESH_MAX_BOX_CELLS 256

/* A triangle mesh: vertices, and three of their indices for each face. */
struct mesh {
    const char *name;
    size_t nvertex, nface;
    const double (*vertex)[3]; /* m */
    const int (*face)[3];
    bool sound; /* known to be so, as mesh_check finds it; false: it may be */
};

/* What can be wrong with a surface, in the order in which mesh_check looks for it. */
enum mesh_fault {
    MESH_SOUND,
    MESH_EMPTY,
    MESH_BAD_INDEX,         /* a corner names a vertex that is not there */
    MESH_BAD_COORDINATE,    /* not finite, or beyond MESH_MAX_COORDINATE_M */
    MESH_DEGENERATE_FACE,   /* without area to speak of */
    MESH_DUPLICATE_FACE,    /* same three vertices as other_face */
    MESH_OPEN_EDGE,         /* has one face */
    MESH_NON_MANIFOLD_EDGE, /* has more than two faces */
    MESH_FLIPPED_FACE,      /* runs its edge in the same direction as other_face */
    MESH_PINCHED_VERTEX,    /* two fans of faces meet in one vertex only */
    MESH_UNUSED_VERTEX,     /* in no face */
    MESH_INWARD,            /* encloses a negative volume: all faces run clockwise */
};

/* What mesh_check has found. */
struct mesh_finding {
    enum mesh_fault fault;
    size_t face, other_face; /* the first face at fault and its counterpart */
    int corner;              /* of face, where the fault begins */
    int vertex[2];           /* the edge, or the vertex in vertex[0] */
};

/* Finds the first fault of a surface: sound means closed, orientable, two faces to an edge, one fan
 * of faces to a vertex, every face with area, outside out. Several separate closed pieces are
 * sound. The only error is ERROR_MEMORY, for scratch memory on the heap. */
enum error_code mesh_check(const struct mesh *mesh, struct mesh_finding *finding,
                           struct error *error);

/* The half-edge from corner `number % 3` of face `number / 3` to the next corner. */
struct half_edge {
    int low, high; /* its vertices, sorted */
    int number;
    bool forward; /* runs from low to high */
};

/* Sorts the 3 * nface half-edges of a mesh whose corners are all in range by low vertex, high
 * vertex, number, so that those of one edge are neighbors. sorted: the caller's, room for all.
 * ERROR_MEMORY for scratch on the heap. */
enum error_code mesh_sort_half_edges(const struct mesh *mesh, struct half_edge *sorted,
                                     struct error *error);

/* Returns the fault in words. */
const char *mesh_fault_text(enum mesh_fault fault);

/* Reads an OBJ file. Every fault (NaN, index out of range, missing faces, open or non-manifold
 * surface, degenerate triangle, inward orientation, size limits) is an ERROR_INPUT with
 * file:line:column; polygons are split into triangles as a fan. Memory from arena. */
enum error_code mesh_read_obj(const char *path, struct arena *arena, const struct mesh **mesh,
                              struct error *error);

/* Reads OBJ text from memory likewise; name stands for the file in messages and names the mesh. */
enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error);

/* Makes an axis-aligned box about the origin, cells x cells rectangles of two triangles on each
 * side: 12 cells^2 faces, 588 for 7. Memory from arena. */
enum error_code mesh_box(const double half_extent[3], int cells, struct arena *arena,
                         const struct mesh **mesh, struct error *error);

/* Makes a capsule about the origin, its axis along z, its length without the ends: 16 sides, 4
 * rings to an end, 256 faces. As wide as it has to be for its cross-section to have the area of the
 * circle: edges stand out by 1.3 % of the radius, sides stand in by 0.7 %; the ends hold 2.5 % less
 * than half-spheres do. Memory from arena. */
enum error_code mesh_capsule(double radius, double length, struct arena *arena,
                             const struct mesh **mesh, struct error *error);

/* Computes the enclosed volume (m3, by the divergence theorem; negative inside out). */
double mesh_volume(const struct mesh *mesh);

/* Computes the surface area (m2). */
double mesh_area(const struct mesh *mesh);

#endif
