/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Meshes of foreign robots: STL, binary and ASCII, Wavefront OBJ and COLLADA, in the units and the
 * frame of the link after scaling; a scale that mirrors turns the faces round, so that outside
 * stays outside. Corners at the same place become one vertex. Files are found by what the robot
 * file says and nowhere else: package:// below the folders that are given and above the file,
 * file:// and plain paths by the rules of path.h. Bounded; no name ever reaches a shell. Colors are
 * those of materials (diffuse), of an OBJ from the MTL files beside it; textures are not read. Not
 * RT-safe.
 */
#ifndef APP_IMPORT_MESH_H
#define APP_IMPORT_MESH_H

#include "app/import/model.h"

#include <stddef.h>

enum {
    IMPORT_MESH_BYTES_MAX = 256 << 20,
    IMPORT_MESH_FACES_MAX = 1 << 20,
    IMPORT_COLORS_MAX = 32, /* colors of one mesh; further ones become the nearest of these */
};

/* Scratch memory for one mesh, in address space. */
#define IMPORT_MESH_ARENA ((size_t)1 << 30)

/* Where packages are looked for: folders that hold a folder of the package's name. */
struct import_packages {
    const char *const *folder;
    size_t count;
    bool trust; /* other paths may lead out of the robot file's folder */
};

/* A triangle mesh with a color for each face; memory of the arena that it was read with. */
struct import_mesh {
    size_t nvertex, nface;
    double (*vertex)[3];                /* m, in the link's frame, before the shape's own place */
    int (*face)[3];                     /* counterclockwise from outside */
    signed char *tint;                  /* by face: index of its color below, -1 = no color */
    double color[IMPORT_COLORS_MAX][4]; /* sRGB and opacity, 0 to 1 */
    size_t ncolor;
    const char *remark; /* what its looks lack, NULL = nothing */
};

/* Refuses a mesh whose name leads out of the allowed folders, whether there is a file or not. */
enum error_code import_check_mesh(const struct import_model *model,
                                  const struct import_geometry *shape,
                                  const struct import_packages *packages, struct error *error);

/* Finds the path of a mesh, in the arena. ERROR_INPUT says where it was looked for. */
enum error_code import_find_mesh(const struct import_model *model,
                                 const struct import_geometry *shape,
                                 const struct import_packages *packages, struct arena *arena,
                                 const char **path, struct error *error);

/* Reads a mesh file and scales it. Memory from the arena. */
enum error_code import_read_mesh(const char *path, const double scale[3], struct arena *arena,
                                 struct import_mesh *mesh, struct error *error);

/* Reads a mesh from memory; name stands for the file in messages, and its ending tells the
 * format. */
enum error_code import_parse_mesh(const char *name, const char *text, size_t size,
                                  const double scale[3], struct arena *arena,
                                  struct import_mesh *mesh, struct error *error);

/* Computes the volume that a mesh encloses, m3, with the center of mass and the inertia about
 * it (xx, xy, xz, yy, yz, zz, m5) of a solid of density 1. With exact, signed volumes: right
 * for a closed surface. Otherwise the sum of the pyramids from the middle of the surface to its
 * faces, all counted as solid, which is exact where that middle sees all faces from inside, and
 * holds for surfaces that are turned inside out or have holes. Returns 0 when the volume is not
 * positive. Not RT-safe: it walks through all faces. */
double import_measure_mesh(const struct import_mesh *mesh, bool exact, double center[3],
                           double I[6]);

/* Writes the mesh as an OBJ file, without colors. */
enum error_code import_write_mesh(const struct import_mesh *mesh, const char *path,
                                  struct error *error);

/* Writes the faces of a tint as a binary STL file; import_count_tint returns how many there are. */
enum error_code import_write_tint(const struct import_mesh *mesh, int tint, const char *path,
                                  struct error *error);
size_t import_count_tint(const struct import_mesh *mesh, int tint);

#endif
