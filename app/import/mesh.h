/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Meshes of foreign robots: STL (binary and ASCII), Wavefront OBJ and COLLADA. After scaling they
 * are in meters, in the frame of the link. A mirroring scale reverses the faces, so that normals
 * still point outward. Corners at the same place become one vertex.
 *
 * Files are only searched where the robot file says: package:// in the given folders and in the
 * folders above the file, file:// and plain paths by the rules of path.h. Sizes are limited. Names
 * are never passed to a shell.
 *
 * Colors are diffuse colors of materials, for an OBJ from MTL files in its folder. Textures are not
 * read. Not RT-safe.
 */
#ifndef APP_IMPORT_MESH_H
#define APP_IMPORT_MESH_H

#include "app/import/model.h"
#include "app/import/path.h"

enum {
    IMPORT_MESH_BYTES_MAX = 256 << 20,
    IMPORT_MESH_FACES_MAX = 1 << 20,
    /* largest number of colors of a mesh; further colors are replaced by the nearest */
    IMPORT_COLORS_MAX = 32,
};

/* Reserved address space for one mesh. */
#define IMPORT_MESH_ARENA ((size_t)1 << 30)

/* Search folders for packages. Each contains subfolders with the names of packages. */
struct import_packages {
    const char *const *folder;
    size_t count;
    bool trust; /* allow paths outside the robot file's folder, too */
};

/* A triangle mesh with a color per face. The arena that it was read into owns the memory. */
struct import_mesh {
    size_t nvertex, nface;
    double (*vertex)[3];                /* m, in the link's frame, without the pose of the shape */
    int (*face)[3];                     /* counterclockwise from outside */
    signed char *tint;                  /* by face: index in color, -1 = no color */
    double color[IMPORT_COLORS_MAX][4]; /* sRGB and opacity, 0 to 1 */
    size_t ncolor;
    const char *remark; /* parts of its appearance that are missing; NULL = none */
};

/* Finds the path of a mesh. Reports a name that leads outside the allowed folders, whether or not
 * the file exists, and a missing file, with the reason. */
enum import_path import_find_mesh(const struct import_model *model,
                                  const struct import_geometry *shape,
                                  const struct import_packages *packages, char path[PATH_MAX],
                                  struct error *error);

/* Reads a mesh file and scales it. Memory from the arena. */
enum error_code import_read_mesh(const char *path, const double scale[3], struct arena *arena,
                                 struct import_mesh *mesh, struct error *error);

/* Reads a mesh from memory. The extension of name gives the format. is_file: name is a path, and
 * materials are searched in its folder. */
enum error_code import_parse_mesh(const char *name, bool is_file, const char *text, size_t size,
                                  const double scale[3], struct arena *arena,
                                  struct import_mesh *mesh, struct error *error);

/* Measures mass and inertia of density 1 of what a mesh encloses.
 *
 * Exact: signed volumes of pyramids, which is correct for a closed surface. Pyramids: the sum of
 * their magnitudes, from the center of the surface to the faces, which is exact if all faces are
 * visible from there. Shell: the faces themselves, of thickness 1. Computes center of mass, m, and
 * inertia about it (xx, xy, xz, yy, yz, zz), m5 (shell: m4). Returns the volume, m3 (shell: the
 * area, m2), 0 if it encloses none. Not RT-safe: it visits all faces. */
double import_measure_mesh(const struct import_mesh *mesh, enum import_solid solid,
                           double center[3], double I[6]);

/* Makes the convex hull of a mesh's vertices. The hull shares the mesh's array of vertices. Returns
 * ERROR_INPUT for a flat mesh, and for a hull with too many faces. */
enum error_code import_make_hull(const struct import_mesh *mesh, struct arena *arena,
                                 struct import_mesh *out, struct error *error);

/* Writes the mesh as an OBJ file, without colors. */
enum error_code import_write_mesh(const struct import_mesh *mesh, const char *path,
                                  struct error *error);

/* import_write_tint writes the faces with one color index as a binary STL file; import_count_tint
 * returns their number. */
enum error_code import_write_tint(const struct import_mesh *mesh, int tint, const char *path,
                                  struct error *error);
size_t import_count_tint(const struct import_mesh *mesh, int tint);

#endif
