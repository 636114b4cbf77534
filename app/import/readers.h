/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Readers of robot files, each to the model of model.h: URDF (wiki.ros.org/urdf/XML), SRDF, and
 * MJCF, MuJoCo's XML (mujoco.readthedocs.io, XML reference), with included files, several joints to
 * a body, default classes, inertias of bodies or of their geoms and meshes, actuators' strengths,
 * armature, keyframes as poses. What a robot here cannot have is noted as dropped, errors are
 * refused with file:line, closed loops by name. Not RT-safe.
 */
#ifndef APP_IMPORT_READERS_H
#define APP_IMPORT_READERS_H

#include "app/import/mesh.h"
#include "app/import/xml.h"

/* Fills the model from <robot>; joints know the indices of their links afterwards. */
enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Adds poses, and whether the base floats, from an SRDF of the same robot. */
enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Fills the model from <mujoco>; joints know their links afterwards. Files that it includes, and
 * meshes that bodies get their inertia from, are found by the rules of packages; NULL: a text that
 * may name none. The document is changed: includes are expanded in it. */
enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error);

#endif
