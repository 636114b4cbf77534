/* SPDX-License-Identifier: Apache-2.0 */
/* Writes surfaces as files: number of vertices and of triangles (u32), then x y z of each vertex
 * (f32, m), then the corners of each triangle (u32); little-endian. */
#include "viewer/bytes.h"
#include "viewer/private.h"

#include <stdlib.h>

const struct viewer_file *viewer_mesh_file(struct viewer *viewer, size_t surface)
{
    const struct contact_surface *of = &viewer->rig->contact.surface[surface];
    struct viewer_file *file = surface < VIEWER_MESHES ? &viewer->mesh[surface] : NULL;
    uint8_t *data, *to;
    size_t size;

    if (!file || of->shape != CONTACT_MESH || file->data) {
        return file && file->data ? file : NULL;
    }
    size = 8 + 12 * of->mesh->nvertex + 12 * of->mesh->nface;
    data = to = malloc(size);
    if (!data) {
        return NULL;
    }
    to = put_u32(to, (uint32_t)of->mesh->nvertex);
    to = put_u32(to, (uint32_t)of->mesh->nface);
    for (size_t i = 0; i < 3 * of->mesh->nvertex; i++) {
        to = put_f32(to, of->mesh->vertex[i / 3][i % 3]);
    }
    for (size_t i = 0; i < 3 * of->mesh->nface; i++) {
        to = put_u32(to, (uint32_t)of->mesh->face[i / 3][i % 3]);
    }
    *file = (struct viewer_file){"application/octet-stream", data, size, false};
    return file;
}
