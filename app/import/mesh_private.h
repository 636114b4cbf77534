/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the readers of mesh files. Not RT-safe. */
#ifndef APP_IMPORT_MESH_PRIVATE_H
#define APP_IMPORT_MESH_PRIVATE_H

#include "app/import/mesh.h"

enum { MESH_WORD_MAX = 64 };

/* A material of an OBJ; tint is the index of its color in the mesh, -1 = none. */
struct mesh_material {
    char name[64];
    int tint;
};

/* A mesh file during reading. Vertices and faces are as in the file; equal vertices are joined
 * later. */
struct mesh_reader {
    const char *name, *at, *end;
    bool is_file; /* name is a path, so other files in its folder may be read */
    int tint;     /* color index of the following faces, -1 = none */
    struct mesh_material *material;
    size_t nmaterial, material_work, libraries;
    int line;
    const double *scale;
    struct arena *arena;
    struct import_mesh *mesh;
    size_t capacity;     /* number of allocated faces */
    struct error *error; /* keeps the first error */
};

/* ---- mesh_read.c ---- */

void mesh_no_memory(const struct mesh_reader *r);

/* Allocates memory for this many vertices and faces. Returns false with an error if a mesh may not
 * have so many. */
bool mesh_make_room(struct mesh_reader *r, size_t vertices, size_t faces);

/* mesh_add_vertex scales a vertex from the file's units and adds it. mesh_add_face adds a face of
 * three vertices. Both use the allocated memory. */
void mesh_add_vertex(struct mesh_reader *r, const double xyz[3]);
void mesh_add_face(struct mesh_reader *r, int a, int b, int c);

/* Reads the next word of the line, and truncates a long one. Returns false at the end of the line,
 * and stays there. */
bool mesh_next_word(struct mesh_reader *r, char word[MESH_WORD_MAX]);
void mesh_skip_line(struct mesh_reader *r);

/* Reads three numbers from the rest of a line. Returns false if there are others, and sets an error
 * if the reader has one. */
bool mesh_read_numbers(struct mesh_reader *r, double value[3]);

/* ---- mesh_materials.c ---- */

/* Returns the index of a color in the mesh's table. Adds a new color while there is room; else
 * returns the nearest color. */
int mesh_find_tint(struct import_mesh *mesh, const double color[4]);

/* Handles the lines `mtllib FILE` and `usemtl NAME` of an OBJ (struct obj_rules). The tag of a face
 * is its color index. A missing file or material adds a remark; its faces have no color. */
int mesh_read_material_line(void *reader, const char *keyword, const char *word, int tint);

/* ---- mesh_collada.c ---- */

/* Reads all geometries in a COLLADA document's scene. */
void mesh_read_collada(struct mesh_reader *r);

#endif
