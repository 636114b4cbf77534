/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Triangle meshes written as Wavefront OBJ, for the makers of meshes and for tests. Coordinates are
 * meters, in the mesh's own frame. Not RT-safe.
 */
#ifndef TOOLS_MESH_WRITE_H
#define TOOLS_MESH_WRITE_H

#include "base/error.h"
#include "contact/mesh/mesh.h"

#include <math.h>
#include <stdio.h>

/* A coordinate to the micrometer, never -0: the same file on every machine, and a readable one. */
static inline double mesh_write_round(double x)
{
    return round(x * 1e6) / 1e6 + 0.0;
}

/* Writes the mesh as OBJ text, each coordinate with as few digits as read back to the same bits.
 * The file stays the caller's. ERROR_SYSTEM when it cannot be written. */
enum error_code mesh_write_obj(const struct mesh *mesh, FILE *file, struct error *error);

#endif
