/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed triangle meshes: read from Wavefront OBJ, a box, measures, and a check of soundness.
 * Coordinates are meters in the mesh's own frame; faces run counterclockwise seen from outside. A
 * mesh is immutable; the arena given at its creation owns its memory. On an error the caller's
 * pointer is not written. No call here is RT-safe.
 *
 * Accepted OBJ statements are `v x y z` (an optional fourth number must be 1) and `f` with corners
 * `v`, `v/vt`, `v//vn` or `v/vt/vn`. Indices count from 1; negative indices count back from the
 * newest vertex. A face may use only vertices above it in the file. Texture coordinates, normals,
 * groups, objects, smoothing, materials and comments are ignored. Every other keyword is an error,
 * so that no curve or line is dropped silently. A backslash at the end of a line continues the line
 * (not in comments).
 *
 * A polygon is split into a fan of triangles from its first corner. It must be flat (to 1e-3 of its
 * longest edge) and convex; otherwise it is an error. The surface must pass mesh_check. Vertices
 * are not merged, because merging could close an intended hole. Self-intersection is not detected.
 */
#ifndef CONTACT_MESH_MESH_H
#define CONTACT_MESH_MESH_H

#include "base/arena.h"
#include "base/error.h"

#define MESH_MAX_FILE_BYTES ((size_t)256 << 20)
#define MESH_MAX_VERTICES ((size_t)1 << 19)
#define MESH_MAX_FACES ((size_t)1 << 19) /* two meshes of this size fit into the memory of a run */
#define MESH_MAX_CORNERS ((size_t)256)   /* corners of one polygon */
#define MESH_MAX_COORDINATE_M 1e6        /* limit that keeps areas and volumes far from overflow */
#define MESH_MAX_BOX_CELLS 256

/* A triangle mesh: vertices, and three of their indices for each face. */
struct mesh {
    const char *name;
    size_t nvertex, nface;
    const double (*vertex)[3]; /* m */
    const int (*face)[3];
};

/* Faults of a surface, in the order in which mesh_check tests for them. */
enum mesh_fault {
    MESH_SOUND,
    MESH_EMPTY,
    MESH_BAD_INDEX,         /* a corner names a vertex that does not exist */
    MESH_BAD_COORDINATE,    /* not finite, or beyond MESH_MAX_COORDINATE_M */
    MESH_DEGENERATE_FACE,   /* area is nearly zero */
    MESH_DUPLICATE_FACE,    /* same three vertices as other_face */
    MESH_OPEN_EDGE,         /* an edge has one face */
    MESH_NON_MANIFOLD_EDGE, /* an edge has more than two faces */
    MESH_FLIPPED_FACE,      /* runs its edge in the same direction as other_face */
    MESH_PINCHED_VERTEX,    /* two fans of faces meet in one vertex only */
    MESH_UNUSED_VERTEX,     /* a vertex is in no face */
    MESH_INWARD,            /* encloses a negative volume: all faces run clockwise */
};

/* What mesh_check has found. */
struct mesh_finding {
    enum mesh_fault fault;
    size_t face, other_face; /* first faulty face and its counterpart */
    int corner;              /* corner of face where the fault begins */
    int vertex[2];           /* the faulty edge; a faulty vertex is vertex[0] */
};

/* Finds the first fault of a surface. A sound surface is closed and orientable. It has two faces
 * per edge, one fan of faces per vertex, no degenerate face, and normals that point outward.
 * Several separate closed pieces are sound. The only error is ERROR_MEMORY, for scratch memory on
 * the heap. */
enum error_code mesh_check(const struct mesh *mesh, struct mesh_finding *finding,
                           struct error *error);

/* The half-edge from corner `number % 3` of face `number / 3` to the next corner. */
struct half_edge {
    int low, high; /* its vertices, sorted */
    int number;
    bool forward; /* runs from low to high */
};

/* Sorts the 3 * nface half-edges of a mesh by low vertex, high vertex, number, so that the
 * half-edges of one edge are neighbors. All corners must be in range. The caller provides sorted
 * with room for all. Returns ERROR_MEMORY without scratch memory on the heap. */
enum error_code mesh_sort_half_edges(const struct mesh *mesh, struct half_edge *sorted,
                                     struct error *error);

/* Returns the fault in words. */
const char *mesh_fault_text(enum mesh_fault fault);

/* Reads OBJ text. Each fault (NaN, index out of range, missing faces, open or non-manifold surface,
 * degenerate triangle, inward orientation, size limits) is an ERROR_INPUT with file:line:column.
 * Polygons are split into fans of triangles. name is the file name in messages and the name of the
 * mesh. Memory from arena. solid_store_read_obj reads a file. */
enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error);

/* Allocates a mesh with a copy of the name in the arena. The caller fills vertex and face. Returns
 * NULL and sets ERROR_MEMORY without room. */
struct mesh *mesh_alloc(const char *name, size_t nvertex, size_t nface, struct arena *arena,
                        double (**vertex)[3], int (**face)[3], struct error *error);

/* Copies a mesh into the arena. Returns NULL and sets ERROR_MEMORY without room. */
const struct mesh *mesh_copy(const struct mesh *mesh, struct arena *arena, struct error *error);

/* Makes an axis-aligned box about the origin. Each side has cells x cells rectangles of two
 * triangles: 12 cells^2 faces in all, 588 for 7. Half extents are over 0 and at most
 * MESH_MAX_COORDINATE_M, cells 1 to MESH_MAX_BOX_CELLS. Memory from arena. */
enum error_code mesh_box(const double half_extent[3], int cells, struct arena *arena,
                         const struct mesh **mesh, struct error *error);

/* Makes a capsule about the origin with its axis along z; length does not include the ends. It has
 * 16 sides, 4 rings per end, 256 faces. Its cross-section has the area of the circle: edges are 1.3
 * % of the radius outside it, sides 0.7 % inside. The ends hold 2.5 % less volume than
 * half-spheres. flat: makes a cylinder of 64 sides instead. Its edges are 0.08 % of the radius
 * outside the circle, its sides 0.04 % inside. radius is over 0, length 0 or more. Memory from
 * arena. */
enum error_code mesh_capsule(double radius, double length, bool flat, struct arena *arena,
                             const struct mesh **mesh, struct error *error);

/* Computes the enclosed volume (m3, by the divergence theorem; negative if normals point
 * inward). */
double mesh_volume(const struct mesh *mesh);

#endif
