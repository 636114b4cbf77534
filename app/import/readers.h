/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Readers of robot files, each to the model of model.h: URDF (wiki.ros.org/urdf/XML), SRDF, and
 * MJCF, MuJoCo's XML (mujoco.readthedocs.io, XML reference), with included files, several joints to
 * a body, default classes, inertias of bodies or of their geoms and meshes, actuators' strengths,
 * armature, keyframes as poses. Parts that our robots cannot have are noted as dropped. Errors have
 * file:line; closed loops are refused by name. Not RT-safe.
 */
#ifndef APP_IMPORT_READERS_H
#define APP_IMPORT_READERS_H

#include "app/import/mesh.h"
#include "app/import/xml.h"

/* Fills the model from <robot>, including the link indices of joints. */
enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Adds poses, and whether the base floats, from an SRDF of the same robot. */
enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Fills the model from <mujoco>, including the links of joints. Included files, and meshes for
 * inertias of bodies, are found by the rules of packages; NULL: the text may not name files. The
 * document changes: includes are expanded in it. */
enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error);

#endif
