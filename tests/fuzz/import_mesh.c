/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes from strangers: refused in words, or finite, with faces that name their vertices. */
#include "app/import/mesh.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const double scale[2][3] = {{1, 1, 1}, {0.001, -0.001, 0.002}};
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    struct import_mesh mesh;
    struct error error = {0};
    unsigned how = size > 0 ? data[0] : 0;
    const char *name = how & 4 ? "x.dae" : how & 1 ? "x.obj" : "x.stl";

    data += size > 0;
    size -= size > 0;
    if (import_parse_mesh(name, false, (const char *)data, size, scale[how >> 1 & 1], arena, &mesh,
                          &error)) {
        fuzz_require(error.code != ERROR_NONE && fuzz_is_sentence(error.text) &&
                         !strncmp(error.text, name, 5),
                     "%d: %s", (int)error.code, error.text);
        fuzz_tally.refused++;
        return 0;
    }
    fuzz_require(mesh.nface > 0 && mesh.nvertex >= 3, "%zu faces", mesh.nface);
    for (size_t f = 0; f < mesh.nface; f++) {
        for (int c = 0; c < 3; c++) {
            int vertex = mesh.face[f][c];

            fuzz_require(vertex >= 0 && (size_t)vertex < mesh.nvertex, "face %zu", f);
            fuzz_require(
                isfinite(mesh.vertex[vertex][0] + mesh.vertex[vertex][1] + mesh.vertex[vertex][2]),
                "vertex %d", vertex);
        }
    }
    fuzz_tally.taken++;
    return 0;
}
