/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads URDF (wiki.ros.org/urdf/XML) and SRDF as foreign robots. What a robot here cannot have is
 * noted as dropped, errors are refused with file:line. Not RT-safe.
 */
#ifndef APP_IMPORT_URDF_H
#define APP_IMPORT_URDF_H

#include "app/import/model.h"
#include "app/import/xml.h"

/* Fills the model from <robot>; joints know the indices of their links afterwards. */
enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

/* Adds poses, and whether the base floats, from an SRDF of the same robot. */
enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error);

#endif
