/* SPDX-License-Identifier: Apache-2.0 */
/*
 * OBJ meshes: a file is refused in words with its place, or gives a mesh that mesh_check calls
 * sound, with finite measures, and whose text reads back as the same mesh.
 */
#include "tests/fuzz/fuzz.h"
#include "tests/mesh_write.h"

#include <string.h>

static void check_mesh(const struct mesh *mesh)
{
    struct arena again_arena = {0};
    const struct mesh *again;
    struct mesh_finding finding;
    struct fuzz_text text;
    struct error error;

    fuzz_require(mesh_check(mesh, &finding, &error) == ERROR_NONE, "%s", error.text);
    fuzz_require(finding.fault == MESH_SOUND, "%s", mesh_fault_text(finding.fault));
    fuzz_require(mesh_volume(mesh) > 0, "volume %g", mesh_volume(mesh));

    fuzz_text_open(&text);
    mesh_write_obj(mesh, text.file);
    fuzz_text_finish(&text);
    fuzz_require(arena_init(&again_arena, (size_t)16 << 20, NULL) == ERROR_NONE, "no memory");
    fuzz_require(mesh_read_obj_text("x.obj", text.text, text.size, &again_arena, &again, &error) ==
                     ERROR_NONE,
                 "%s\n%s", error.text, text.text);
    fuzz_require(again->nvertex == mesh->nvertex && again->nface == mesh->nface &&
                     memcmp(again->vertex, mesh->vertex, mesh->nvertex * sizeof *mesh->vertex) ==
                         0 &&
                     memcmp(again->face, mesh->face, mesh->nface * sizeof *mesh->face) == 0,
                 "%s", text.text);
    arena_fini(&again_arena);
    fuzz_text_free(&text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)16 << 20);
    const struct mesh *mesh = NULL;
    struct error error = {0};

    if (mesh_read_obj_text("x.obj", (const char *)data, size, arena, &mesh, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_has_place(error.text, "x.obj", size) &&
                         strstr(error.text, "expected"),
                     "%d: %s", (int)error.code, error.text);
        fuzz_tally.refused++;
    } else {
        check_mesh(mesh);
        fuzz_tally.taken++;
    }
    return 0;
}
