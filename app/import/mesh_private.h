/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of mesh files share. */
#ifndef APP_IMPORT_MESH_PRIVATE_H
#define APP_IMPORT_MESH_PRIVATE_H

#include "app/import/mesh.h"

/* A mesh file being read: corners first, three a face, before equal ones are joined. */
struct mesh_reader {
    const char *name, *at, *end;
    int line;
    const double *scale;
    struct arena *arena;
    struct import_mesh *mesh;
    size_t capacity; /* of faces */
    struct error *error;
};

/* ---- mesh_read.c ---- */

enum error_code mesh_no_memory(const struct mesh_reader *r);

/* Room for so many vertices and faces. */
enum error_code mesh_make_room(struct mesh_reader *r, size_t vertices, size_t faces);

/* Within the room that was made; of a vertex in the file's units, before the scale. */
enum error_code mesh_add_vertex(struct mesh_reader *r, const double xyz[3]);
void mesh_add_face(struct mesh_reader *r, int a, int b, int c);

/* ---- mesh_collada.c ---- */

/* All of a COLLADA document's scene. */
enum error_code mesh_read_collada(struct mesh_reader *r);

#endif
