/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A store of meshes, solids and fields, for programs that make the same robot many times. While the
 * store is open, files with the same text share one mesh. Engines of this process share one solid
 * and one field for all meshes with the same vertices and faces. A forked process inherits the
 * store of its parent. A solid depends only on vertices and faces, so results are the same with and
 * without the store.
 *
 * One thread opens the store, makes engines and closes it. Not RT-safe.
 */
#ifndef CONTACT_MESH_SOLID_STORE_H
#define CONTACT_MESH_SOLID_STORE_H

#include "contact/mesh/field.h"

/* Opens the store empty, or adds a user to an open store. Returns ERROR_SYSTEM if no memory can be
 * reserved. Call solid_store_close once for each call, also after an error. */
enum error_code solid_store_open(struct error *error);

/* Removes a user and frees the memory when the last user closes the store. Engines made while it
 * was open must not be used afterwards. Allowed on a closed store. */
void solid_store_close(void);

/* Returns the number of solids and fields made since the store was opened. */
size_t solid_store_made(void);

/* Reads an OBJ file (mesh_read_obj_text), or returns the stored mesh with the same path and text.
 * The store owns the mesh; if the store is closed or full, the arena owns it. */
enum error_code solid_store_read_obj(const char *path, struct arena *arena,
                                     const struct mesh **mesh, struct error *error);

/* Returns the stored solid of a sound mesh. If the store is closed or full, makes a solid in arena
 * that points into mesh. The only error is ERROR_MEMORY. */
enum error_code solid_store_find(const struct mesh *mesh, struct arena *arena,
                                 const struct solid **solid, struct error *error);

/* Returns the stored field of a solid. If the store is closed or full, makes a field in arena. The
 * only error is ERROR_MEMORY. */
enum error_code solid_store_find_field(const struct solid *solid, const char *name,
                                       struct arena *arena, const struct field **field,
                                       struct error *error);

#endif
