/* SPDX-License-Identifier: Apache-2.0 */
/*
 * MJCF, MuJoCo's XML (mujoco.readthedocs.io, XML reference), as a foreign robot: bodies, joints
 * with several to a body, default classes, inertias of bodies or of their geoms, actuators'
 * strengths, armature, keyframes as poses. Closed loops are refused by name. Not RT-safe.
 */
#ifndef APP_IMPORT_MJCF_H
#define APP_IMPORT_MJCF_H

#include "app/import/model.h"
#include "app/import/xml.h"

/* Fills the model from <mujoco>; joints know their links afterwards. */
enum error_code mjcf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

#endif
