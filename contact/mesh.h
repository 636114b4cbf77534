/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed triangle meshes: read from Wavefront OBJ, or made. Outward faces run counterclockwise.
 */
#ifndef CONTACT_MESH_H
#define CONTACT_MESH_H

#include "base/arena.h"
#include "base/error.h"

#include <stddef.h>
#include <stdio.h>

struct mesh {
    const char *name;
    size_t nvertex, nface;
    const double (*vertex)[3]; /* m */
    const int (*face)[3];
};

/* Reads an OBJ file; every fault (NaN, index out of range, missing faces, open or non-manifold
 * surface, degenerate triangle, inward orientation, size limits) is an error with
 * file:line:column; polygons are split into triangles as a fan. Memory from arena. Not RT-safe. */
enum error_code mesh_read_obj(const char *path, struct arena *arena, const struct mesh **mesh,
                              struct error *error);

/* The same from memory. */
enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error);

/* An axis-aligned box about the origin, cells x cells squares of two triangles on each side: 12
 * cells^2 faces, 588 for 7. Not RT-safe. */
enum error_code mesh_box(const double half_extent[3], int cells, struct arena *arena,
                         const struct mesh **mesh, struct error *error);

/* Writes the mesh as OBJ text. */
enum error_code mesh_write_obj(const struct mesh *mesh, FILE *file, struct error *error);

/* Enclosed volume (m3), surface area (m2). */
double mesh_volume(const struct mesh *mesh);
double mesh_area(const struct mesh *mesh);

#endif
