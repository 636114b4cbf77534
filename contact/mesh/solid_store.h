/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Meshes that were read before, and solids and fields that were made ready. While the store is
 * open, files of the same text share one mesh, and engines of this process one solid, and one
 * field, for all meshes with the same vertices and faces: for programs that make the same robot
 * many times. A process that is forked finds what its parent had made. What a mesh gives depends
 * on its vertices and faces alone, so that results are the same with the store and without it.
 *
 * One thread opens the store, makes engines and closes it. Not RT-safe.
 */
#ifndef CONTACT_MESH_SOLID_STORE_H
#define CONTACT_MESH_SOLID_STORE_H

#include "contact/mesh/field.h"

/* Opens it, empty, or counts one more user of an open one. ERROR_SYSTEM when no memory can be
 * reserved. To be closed once, also after an error. */
enum error_code solid_store_open(struct error *error);

/* Gives its memory back when the last user closes it; no engine that was made meanwhile may be used
 * any more. Allowed on a closed one. */
void solid_store_close(void);

/* Returns how many solids and fields were made since it was opened. */
size_t solid_store_made(void);

/* Reads an OBJ file (mesh_read_obj), or takes the mesh that was read from the same text under the
 * same path; it is the store's or, when that is closed or full, the arena's. */
enum error_code solid_store_read_obj(const char *path, struct arena *arena,
                                     const struct mesh **mesh, struct error *error);

/* Finds the solid of a sound mesh: that of the store or, when it is closed or full, one made in
 * arena, which points into mesh. The only error is ERROR_MEMORY. */
enum error_code solid_store_find(const struct mesh *mesh, struct arena *arena,
                                 const struct solid **solid, struct error *error);

/* Finds the field of a solid, likewise. */
enum error_code solid_store_find_field(const struct solid *solid, const char *name,
                                       struct arena *arena, const struct field **field,
                                       struct error *error);

#endif
