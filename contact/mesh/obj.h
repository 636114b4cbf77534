/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads Wavefront OBJ text: vertices and polygons with their places in the file, for meshes
 * (mesh.h) and for the import of robots. mesh.h lists the accepted statements. Not RT-safe.
 */
#ifndef CONTACT_MESH_OBJ_H
#define CONTACT_MESH_OBJ_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

/* A place in the file: line and column, counted from 1. */
struct obj_place {
    size_t line, column;
};

/* Options of the reader. */
struct obj_rules {
    size_t max_vertices, max_faces;
    /* accept only flat convex polygons; refuse vertex colors and unknown statements */
    bool strict;

    /* Handles a statement other than v and f. Gets its keyword and next word, both cut off at 63
     * characters. Returns the tag of the faces that follow. NULL: faces have no tags. */
    int (*handle)(void *context, const char *keyword, const char *word, int tag);
    void *context;
};

/* Vertices and triangles with their places in the file. Memory from malloc; obj_free frees it. */
struct obj_surface {
    size_t nvertex, nface, nline;
    double (*vertex)[3]; /* finite; if strict, within MESH_MAX_COORDINATE_M */
    struct obj_place *vertex_place;
    int (*face)[3];
    struct obj_place (*corner_place)[3];
    int *tag; /* tag of each face; -1 before the first tag */
};

/* Reads OBJ text; name is the file name in messages. Each fault of a statement is an ERROR_INPUT
 * with file:line:column. The caller frees the surface even after an error. */
enum error_code obj_read(const char *name, const char *text, size_t size,
                         const struct obj_rules *rules, struct obj_surface *surface,
                         struct error *error);
void obj_free(struct obj_surface *surface);

#endif
