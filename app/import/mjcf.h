/* SPDX-License-Identifier: Apache-2.0 */
/*
 * MJCF, MuJoCo's XML (mujoco.readthedocs.io, XML reference), as a foreign robot: included files,
 * bodies, joints with several to a body, default classes, inertias of bodies or of their geoms and
 * meshes, actuators' strengths, armature, keyframes as poses. Closed loops are refused by name. Not
 * RT-safe.
 */
#ifndef APP_IMPORT_MJCF_H
#define APP_IMPORT_MJCF_H

#include "app/import/mesh.h"
#include "app/import/model.h"
#include "app/import/xml.h"

/* Fills the model from <mujoco>; joints know their links afterwards. Files that it includes, and
 * meshes that bodies get their inertia from, are found by the rules of packages; NULL: a text that
 * may name none. The document is changed: includes are expanded in it. */
enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error);

#endif
