/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Readers of robot files, which fill the model of model.h: URDF (wiki.ros.org/urdf/XML), SRDF, and
 * MJCF, the XML of MuJoCo (mujoco.readthedocs.io, XML reference). MJCF support covers included
 * files, several joints per body, default classes, inertias of bodies or of their geoms and meshes,
 * actuator strengths, armature, and keyframes as poses. A note lists each dropped part. Closed
 * loops are refused. Errors have file:line. Not RT-safe.
 */
#ifndef APP_IMPORT_READERS_H
#define APP_IMPORT_READERS_H

#include "app/import/mesh.h"
#include "app/import/xml.h"

/* Fills the model from <robot>, including the link indices of joints. */
enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Adds poses from an SRDF of the same robot, and whether the base floats. */
enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Fills the model from <mujoco>, including the link indices of joints. packages gives the folders
 * of included files and of meshes for inertias; NULL = refuse other files. Replaces the includes in
 * the document by their content. */
enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error);

#endif
