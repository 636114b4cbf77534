/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fits the collision shapes of a robot file. Spheres, capsules, cylinders and boxes are exact. A
 * mesh that is a wheel becomes a cylinder about its joint's axis. Another mesh becomes the
 * enclosing capsule along its longest side; on the base the enclosing box, if that is smaller. Each
 * inexact shape adds a note. Meshes are also written as OBJ, in the frame of their shape, for
 * scenes that use the true surface. Not RT-safe.
 */
#ifndef APP_IMPORT_SHAPES_H
#define APP_IMPORT_SHAPES_H

#include "app/import/mesh.h"
#include "app/import/tree_simplify.h"

/* Data for shapes and visuals. */
struct import_builder {
    struct import_robot *from;
    const struct import_packages *packages;
    const char *folder; /* folder for OBJ and STL files; NULL = read and write no meshes */
    struct arena *arena;
    struct import_notes *notes;
    size_t *written; /* number of OBJ files */
    struct error *error;
};

/* Refuses collision meshes whose names lead outside the allowed folders (import_find_mesh). */
enum error_code import_check_shapes(const struct import_robot *from,
                                    const struct import_packages *packages, struct error *error);

/* Makes the capsules of the robot from the collision shapes. Drops a mesh that cannot be read, with
 * a note. */
enum error_code import_add_shapes(const struct import_builder *b);

/* Computes the height of a capsule's lowest point, m, for given poses of the bodies. */
double import_capsule_bottom(const struct robot_capsule *capsule, const struct body_motion *bodies);

/* Computes the height of the robot's lowest capsule point above the base's origin, m, in a pose
 * with an upright base. Returns false if the robot has no capsules. bodies is a buffer for nbody
 * motions. */
bool import_find_lowest(const struct robot *robot, const double *joint, struct body_motion *bodies,
                        double *height);

/* ---- looks ---- */

/*
 * Makes the visuals of a robot from its visual shapes, and from MJCF shapes for both purposes.
 * Meshes are written as binary STL, one file per color, in the frame of their shape. A repeated
 * mesh uses the existing files. A mesh that cannot be read or is too large does not stop the
 * import; a note and the robot file mention it. The numbers of shapes and faces are limited.
 */

enum { IMPORT_VISUAL_FACES_MAX = 2 << 20 }; /* maximum for all visuals together */

/* Makes the visuals of the robot. Robot files refer to the folder of the STL files as ../meshes. */
enum error_code import_add_visuals(const struct import_builder *b);

/* Composes the frame of a capsule or a visual: the pose of a shape in its body, followed by a pose
 * in the shape. */
void import_place_shape(const struct import_builder *b, const struct import_geometry *shape,
                        const struct import_place *own, double position[3], double rotation[9]);

/* Adds a note on a shape, which starts with a description: "collision box of link "NAME"". */
void import_shape_note(const struct import_builder *b, const struct import_geometry *shape,
                       enum import_fate fate, const char *what, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

#endif
