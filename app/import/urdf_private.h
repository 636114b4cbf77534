/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of URDF and SRDF share. Not RT-safe. */
#ifndef APP_IMPORT_URDF_PRIVATE_H
#define APP_IMPORT_URDF_PRIVATE_H

#include "app/import/urdf.h"

/* A color with a name, which visuals refer to. */
struct urdf_material {
    const char *name; /* the document's */
    double color[4];
    int order; /* in the file: the first of a name counts */
};

struct urdf_reader {
    const struct xml_file *file;
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;
    struct urdf_material *material; /* by name */
    size_t nmaterial;
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

/* All materials of the file that have a color, before its links are read. */
enum error_code urdf_read_materials(struct urdf_reader *r);

/* The color of a <visual>, its own or that of the material that it names; noted when it has none
 * but should. */
void urdf_read_color(const struct urdf_reader *r, const xmlNode *visual,
                     struct import_geometry *shape);

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
