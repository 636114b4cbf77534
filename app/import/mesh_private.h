/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of mesh files share. */
#ifndef APP_IMPORT_MESH_PRIVATE_H
#define APP_IMPORT_MESH_PRIVATE_H

#include "app/import/mesh.h"

#include <stdbool.h>

enum { MESH_WORD_MAX = 64 };

/* A material of an OBJ. */
struct mesh_material {
    char name[64];
    int tint;
};

/* A mesh file being read: corners first, three a face, before equal ones are joined. */
struct mesh_reader {
    const char *name, *at, *end;
    bool is_file; /* name is a path, and files beside it may be read */
    int tint;     /* of the faces that come, -1 = none */
    struct mesh_material *material;
    size_t nmaterial, material_work, libraries;
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

/* import_parse_mesh; with is_file, name is a path beside which materials are looked for. */
enum error_code mesh_parse(const char *name, bool is_file, const char *text, size_t size,
                           const double scale[3], struct arena *arena, struct import_mesh *mesh,
                           struct error *error);

/* The next word of the line, cut off where it is too long; false at the line's end, where the
 * reader stays. */
bool mesh_next_word(struct mesh_reader *r, char word[MESH_WORD_MAX]);
void mesh_skip_line(struct mesh_reader *r);

/* ---- mesh.c ---- */

/* A whole regular file, in memory of the heap. */
enum error_code mesh_read_file(const char *path, size_t most, char **text, size_t *size,
                               struct error *error);

/* ---- mesh_materials.c ---- */

/* The tint of a color of the mesh, which is added when there is room. */
int mesh_find_tint(struct import_mesh *mesh, const double color[4]);

/* Lines `mtllib FILE` and `usemtl NAME` of an OBJ, after the first word. What cannot be had is
 * remarked and leaves faces without a color. */
void mesh_read_library(struct mesh_reader *r);
void mesh_use_material(struct mesh_reader *r);

/* ---- mesh_collada.c ---- */

/* All of a COLLADA document's scene. */
enum error_code mesh_read_collada(struct mesh_reader *r);

#endif
