/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Makes the visuals of a robot: its visual shapes, and those of MJCF, which may also touch. Meshes
 * are written as binary STL, one file for each color, in the frame of their shape; a mesh that
 * occurs again gets the files that are there. A mesh that cannot be read or is too large is noted
 * and named in the robot file, and stops nothing. Bounded in shapes and faces. Not RT-safe.
 */
#ifndef APP_IMPORT_VISUALS_H
#define APP_IMPORT_VISUALS_H

#include "app/import/mesh.h"
#include "app/import/tree_simplify.h"

enum { IMPORT_VISUAL_FACES_MAX = 2 << 20 }; /* of all visuals together */

/* Fills the visuals of the robot; STL files go to folder, which robot files know as ../meshes. */
enum error_code import_add_visuals(struct import_robot *from,
                                   const struct import_packages *packages, const char *folder,
                                   struct arena *arena, struct import_notes *notes,
                                   struct error *error);

#endif
