/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fits capsules, the only collision shapes of a robot file: a sphere and a capsule are exact, a
 * cylinder becomes one of the same radius and, where it is long enough, the same length with its
 * ends; boxes and meshes become the capsule along their longest side that holds them. Each that is
 * not exact is noted. Meshes are also written as OBJ, in the frame of their shape, for scenes that
 * want the surface itself. Not RT-safe.
 */
#ifndef APP_IMPORT_SHAPES_H
#define APP_IMPORT_SHAPES_H

#include "app/import/mesh.h"
#include "app/import/tree_simplify.h"

/* Refuses collision meshes whose names lead out of the allowed folders (import_check_mesh). */
enum error_code import_check_shapes(const struct import_robot *from,
                                    const struct import_packages *packages, struct error *error);

/* Fills the capsules of the robot from the collision shapes; OBJ files go to folder (NULL: none are
 * read or written), *written counts them. A mesh that cannot be read is dropped with a note. */
enum error_code import_add_shapes(struct import_robot *from, const struct import_packages *packages,
                                  const char *folder, struct arena *arena,
                                  struct import_notes *notes, size_t *written, struct error *error);

/* Computes the height of a capsule's lowest point, m, from the placed bodies. */
double import_capsule_bottom(const struct robot_capsule *capsule, const struct body_motion *bodies);

/* Computes the height of the lowest point of the robot's capsules above its base's origin, m, in a
 * pose of an upright base; false when it has none. bodies: room for nbody motions. */
bool import_find_lowest(const struct robot *robot, const double *joint, struct body_motion *bodies,
                        double *height);

/* ---- looks ---- */

/*
 * Makes the visuals of a robot: its visual shapes, and those of MJCF, which may also touch. Meshes
 * are written as binary STL, one file for each color, in the frame of their shape; a mesh that
 * occurs again gets the files that are there. A mesh that cannot be read or is too large is noted
 * and named in the robot file, and stops nothing. Bounded in shapes and faces.
 */

enum { IMPORT_VISUAL_FACES_MAX = 2 << 20 }; /* of all visuals together */

/* Fills the visuals of the robot; STL files go to folder, which robot files know as ../meshes. */
enum error_code import_add_visuals(struct import_robot *from,
                                   const struct import_packages *packages, const char *folder,
                                   struct arena *arena, struct import_notes *notes,
                                   struct error *error);

#endif
