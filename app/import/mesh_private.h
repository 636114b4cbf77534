/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the readers of mesh files. */
#ifndef APP_IMPORT_MESH_PRIVATE_H
#define APP_IMPORT_MESH_PRIVATE_H

#include "app/import/mesh.h"

#include <stdbool.h>

enum { MESH_WORD_MAX = 64 };

/* A material of an OBJ; tint is the index of its color in the mesh, -1 = none. */
struct mesh_material {
    char name[64];
    int tint;
};

/* A mesh file being read: vertices and faces as they stand in it; equal vertices are joined
 * afterwards. */
struct mesh_reader {
    const char *name, *at, *end;
    bool is_file; /* name is a path, beside which further files may be read */
    int tint;     /* color index of the faces that follow, -1 = none */
    struct mesh_material *material;
    size_t nmaterial, material_work, libraries;
    int line;
    const double *scale;
    struct arena *arena;
    struct import_mesh *mesh;
    size_t capacity; /* faces that there is room for */
    struct error *error;
};

/* ---- mesh_read.c ---- */

enum error_code mesh_no_memory(const struct mesh_reader *r);

/* Makes room for so many vertices and faces; refuses more than a mesh may have. */
enum error_code mesh_make_room(struct mesh_reader *r, size_t vertices, size_t faces);

/* Adds a vertex in the file's units, which is scaled, or a face of three vertices, within the
 * room that was made. */
enum error_code mesh_add_vertex(struct mesh_reader *r, const double xyz[3]);
void mesh_add_face(struct mesh_reader *r, int a, int b, int c);

/* Parses a mesh as import_parse_mesh does; with is_file, name is a path beside which materials
 * are looked for. */
enum error_code mesh_parse(const char *name, bool is_file, const char *text, size_t size,
                           const double scale[3], struct arena *arena, struct import_mesh *mesh,
                           struct error *error);

/* Reads the next word of the line, cut off where it is too long; false at the line's end, where
 * the reader stays. */
bool mesh_next_word(struct mesh_reader *r, char word[MESH_WORD_MAX]);
void mesh_skip_line(struct mesh_reader *r);

/* ---- mesh_materials.c ---- */

/* Returns the index of a color in the mesh's table, which it is added to while there is room;
 * else of the nearest one. */
int mesh_find_tint(struct import_mesh *mesh, const double color[4]);

/* Handles the lines `mtllib FILE` and `usemtl NAME` of an OBJ (struct obj_rules); a tag is a color
 * index. A file or material that is missing is remarked and leaves faces without a color. */
int mesh_read_material_line(void *reader, const char *keyword, const char *word, int tint);

/* ---- mesh_collada.c ---- */

/* Reads all geometries in a COLLADA document's scene. */
enum error_code mesh_read_collada(struct mesh_reader *r);

#endif
