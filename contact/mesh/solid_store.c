/* SPDX-License-Identifier: Apache-2.0 */
/* The store of meshes and solids: short linked lists, since a robot has a few dozen meshes. */
#include "contact/mesh/solid_store.h"

#include "base/input_file.h"

#include <stdlib.h>
#include <string.h>

#define STORE_MEMORY ((size_t)1 << 30) /* bytes of reserved address space: 1 GiB */

struct stored_solid {
    struct stored_solid *next;
    const struct mesh *mesh;
    struct solid solid;
    bool has_field;
    struct field field;
};

/* A mesh and the text of the file that it was read from. */
struct stored_mesh {
    struct stored_mesh *next;
    const char *path, *text;
    size_t size;
    const struct mesh *mesh;
};

static struct {
    int users; /* number of users; the store is open while it is above 0 */
    bool open; /* memory is reserved */
    struct arena arena;
    struct stored_solid *first;
    struct stored_mesh *mesh;
    size_t made;
} solid_store;

enum error_code solid_store_open(struct error *error)
{
    enum error_code code;

    if (solid_store.users++ > 0) {
        return ERROR_NONE;
    }
    code = arena_init(&solid_store.arena, STORE_MEMORY, error);
    solid_store.open = !code;
    solid_store.first = NULL;
    solid_store.mesh = NULL;
    solid_store.made = 0;
    return code;
}

void solid_store_close(void)
{
    if (solid_store.users == 0 || --solid_store.users > 0) {
        return;
    }
    arena_fini(&solid_store.arena);
    solid_store.open = false;
    solid_store.first = NULL;
    solid_store.mesh = NULL;
}

size_t solid_store_made(void)
{
    return solid_store.made;
}

/* ---- finding stored solids ---- */

/* ---- meshes ---- */

/* Reads a mesh into the store; NULL if the store is full or the file is faulty. */
static const struct mesh *stored_mesh_read(const char *path, const char *text, size_t size)
{
    struct stored_mesh *made = arena_alloc(&solid_store.arena, 1, sizeof *made);
    struct error unused;
    char *copy;

    if (!made || mesh_read_obj_text(path, text, size, &solid_store.arena, &made->mesh, &unused)) {
        return NULL;
    }
    copy = arena_alloc(&solid_store.arena, size, 1);
    made->path = arena_strdup(&solid_store.arena, path);
    if (!made->path || !copy) {
        return NULL;
    }
    made->text = memcpy(copy, text, size);
    made->size = size;
    made->next = solid_store.mesh;
    solid_store.mesh = made;
    return made->mesh;
}

enum error_code solid_store_read_obj(const char *path, struct arena *arena,
                                     const struct mesh **mesh, struct error *error)
{
    const struct mesh *stored = NULL;
    char *text;
    size_t size;
    enum error_code code = input_file_load(path, MESH_MAX_FILE_BYTES, &text, &size, error);

    if (!code && solid_store.open) {
        const struct stored_mesh *at = solid_store.mesh;

        /* Find the stored mesh of this path and text; NULL if there is none */
        while (at && (at->size != size || strcmp(at->path, path) || memcmp(at->text, text, size))) {
            at = at->next;
        }
        stored = at ? at->mesh : NULL;
        stored = stored ? stored : stored_mesh_read(path, text, size);
    }
    if (stored) {
        *mesh = stored;
    } else if (!code) {
        code = mesh_read_obj_text(path, text, size, arena, mesh, error);
    }
    free(text);
    return code;
}

/* ---- making solids ---- */

/* Makes a solid in the store, with a copy of the mesh, because the caller's mesh may be freed
 * before the store. NULL if the store is full. */
static struct stored_solid *stored_solid_make(const struct mesh *mesh)
{
    struct stored_solid *made = arena_alloc(&solid_store.arena, 1, sizeof *made);
    struct error full;

    if (made) {
        made->mesh = mesh_copy(mesh, &solid_store.arena, &full);
    }
    if (!made || !made->mesh || solid_make(made->mesh, &solid_store.arena, &made->solid, &full)) {
        return NULL;
    }
    made->next = solid_store.first;
    solid_store.first = made;
    solid_store.made++;
    return made;
}

enum error_code solid_store_find(const struct mesh *mesh, struct arena *arena,
                                 const struct solid **solid, struct error *error)
{
    const struct stored_solid *stored = solid_store.open ? solid_store.first : NULL;
    struct solid *own;
    enum error_code code;

    /* Find the solid with bitwise equal vertices and faces */
    while (stored &&
           (stored->mesh->nvertex != mesh->nvertex || stored->mesh->nface != mesh->nface ||
            memcmp(stored->mesh->vertex, mesh->vertex, mesh->nvertex * sizeof *mesh->vertex) ||
            memcmp(stored->mesh->face, mesh->face, mesh->nface * sizeof *mesh->face))) {
        stored = stored->next;
    }
    if (!stored && solid_store.open) {
        stored = stored_solid_make(mesh);
    }
    if (stored) {
        *solid = &stored->solid;
        return ERROR_NONE;
    }

    /* Closed or full store: makes it in the caller's arena */
    own = arena_alloc(arena, 1, sizeof *own);
    if (!own) {
        return error_set(error, ERROR_MEMORY, "contact: no memory for '%s'", mesh->name);
    }
    code = solid_make(mesh, arena, own, error);
    *solid = own;
    return code;
}

enum error_code solid_store_find_field(const struct solid *solid, const char *name,
                                       struct arena *arena, const struct field **field,
                                       struct error *error)
{
    struct stored_solid *stored = solid_store.first;
    struct field *own;
    struct error full;
    enum error_code code;

    while (stored && &stored->solid != solid) {
        stored = stored->next;
    }
    /* Makes fields on first use, as few solids need one */
    if (stored && !stored->has_field) {
        stored->has_field = !field_make(solid, name, &solid_store.arena, &stored->field, &full);
        solid_store.made += stored->has_field;
    }
    if (stored && stored->has_field) {
        *field = &stored->field;
        return ERROR_NONE;
    }

    /* Closed or full store: makes it in the caller's arena */
    own = arena_alloc(arena, 1, sizeof *own);
    if (!own) {
        return error_set(error, ERROR_MEMORY, "contact: no memory for the field of '%s'", name);
    }
    code = field_make(solid, name, arena, own, error);
    *field = own;
    return code;
}
