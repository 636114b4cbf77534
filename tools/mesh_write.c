/* SPDX-License-Identifier: Apache-2.0 */
/* Triangle meshes to Wavefront OBJ. */
#include "tools/mesh_write.h"

#include <errno.h>
#include <stdlib.h>

/* The shortest decimal that reads back as value. */
static void write_exact_number(FILE *file, double value)
{
    char text[32];

    for (int digits = 1; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    fprintf(file, " %s", text);
}

enum error_code mesh_write_obj(const struct mesh *mesh, FILE *file, struct error *error)
{
    for (size_t v = 0; v < mesh->nvertex; v++) {
        fputc('v', file);
        for (int i = 0; i < 3; i++) {
            write_exact_number(file, mesh->vertex[v][i]);
        }
        fputc('\n', file);
    }
    for (size_t f = 0; f < mesh->nface; f++) {
        fprintf(file, "f %d %d %d\n", mesh->face[f][0] + 1, mesh->face[f][1] + 1,
                mesh->face[f][2] + 1);
    }
    if (fflush(file) != 0 || ferror(file)) {
        return error_set_errno(error, errno, "%s: cannot be written", mesh->name);
    }
    return ERROR_NONE;
}
