/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a mesh as Wavefront OBJ, each coordinate so that it reads back to the same bits. */
#ifndef TESTS_MESH_WRITE_H
#define TESTS_MESH_WRITE_H

#include "contact/mesh/mesh.h"

#include <stdio.h>

static inline void mesh_write_obj(const struct mesh *mesh, FILE *file)
{
    for (size_t v = 0; v < mesh->nvertex; v++) {
        fprintf(file, "v %.17g %.17g %.17g\n", mesh->vertex[v][0], mesh->vertex[v][1],
                mesh->vertex[v][2]);
    }
    for (size_t f = 0; f < mesh->nface; f++) {
        fprintf(file, "f %d %d %d\n", mesh->face[f][0] + 1, mesh->face[f][1] + 1,
                mesh->face[f][2] + 1);
    }
}

#endif
