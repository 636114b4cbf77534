/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Wavefront OBJ text: vertices and polygons as they stand in it, with their places, for whatever is
 * made of them (mesh.h, the import of robots). What is accepted: mesh.h. Not RT-safe.
 */
#ifndef CONTACT_MESH_OBJ_H
#define CONTACT_MESH_OBJ_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>

/* A place in the file, counted from 1. */
struct obj_place {
    size_t line, column;
};

/* What a reader accepts. */
struct obj_rules {
    size_t max_vertices, max_faces;
    bool strict; /* flat convex polygons only, no color of a vertex, no unknown statement */

    /* Handles a statement other than v and f, by its keyword and next word (both cut off at 63
     * characters), and returns the tag of the faces that follow. NULL: no faces have tags. */
    int (*handle)(void *context, const char *keyword, const char *word, int tag);
    void *context;
};

/* Vertices, triangles, and where they stand. Memory from malloc; obj_free frees it. */
struct obj_surface {
    size_t nvertex, nface, nline;
    double (*vertex)[3]; /* finite; strict: within MESH_MAX_COORDINATE_M */
    struct obj_place *vertex_place;
    int (*face)[3];
    struct obj_place (*corner_place)[3];
    int *tag; /* by face; -1 before the first */
};

/* Reads OBJ text; name stands for the file in messages. Every fault of a statement is an
 * ERROR_INPUT with file:line:column. The surface is to be freed in any case. */
enum error_code obj_read(const char *name, const char *text, size_t size,
                         const struct obj_rules *rules, struct obj_surface *surface,
                         struct error *error);
void obj_free(struct obj_surface *surface);

#endif
