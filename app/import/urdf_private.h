/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of URDF and SRDF share. Not RT-safe. */
#ifndef APP_IMPORT_URDF_PRIVATE_H
#define APP_IMPORT_URDF_PRIVATE_H

#include "app/import/urdf.h"

struct urdf_reader {
    const struct xml_file *file;
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;
};

enum error_code urdf_no_memory(const struct urdf_reader *r);

/* A copy in the arena of an attribute that must be there. */
enum error_code urdf_need_text(const struct urdf_reader *r, const xmlNode *node, const char *name,
                               const char **text);

/* The only child of that name, or NULL; two of them are refused. */
enum error_code urdf_only_child(const struct urdf_reader *r, const xmlNode *node, const char *name,
                                xmlNode **child);

/* The place that a child <origin> gives, or none. */
enum error_code urdf_read_origin(const struct urdf_reader *r, const xmlNode *node,
                                 struct import_place *place);

/* A link with its inertia and geometry, into model->link[at]. */
enum error_code urdf_read_link(const struct urdf_reader *r, const xmlNode *node, size_t at);

/* A joint, into *joint. */
enum error_code urdf_read_joint(const struct urdf_reader *r, const xmlNode *node,
                                struct import_joint *joint);

/* <sensor> of URDF or of Gazebo; reference: the link or joint that a <gazebo> names, or NULL.
 * Sensors that no robot here has are noted as dropped. */
enum error_code urdf_read_sensor(const struct urdf_reader *r, const xmlNode *node,
                                 const char *reference);

#endif
