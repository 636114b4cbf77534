/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the readers of URDF and SRDF. Not RT-safe. */
#ifndef APP_IMPORT_URDF_PRIVATE_H
#define APP_IMPORT_URDF_PRIVATE_H

#include "app/import/urdf.h"

/* A named color, which visuals refer to. */
struct urdf_material {
    const char *name; /* belongs to the document */
    double color[4];
    int order; /* in the file; the first of a name counts */
};

/* A URDF or SRDF document being read. */
struct urdf_reader {
    const struct xml_file *file;
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;
    struct urdf_material *material; /* sorted by name */
    size_t nmaterial;
};

enum error_code urdf_no_memory(const struct urdf_reader *r);

/* Copies an attribute that must be there into the arena. */
enum error_code urdf_need_text(const struct urdf_reader *r, const xmlNode *node, const char *name,
                               const char **text);

/* Finds the only child of that name, or NULL; refuses two of them. */
enum error_code urdf_only_child(const struct urdf_reader *r, const xmlNode *node, const char *name,
                                xmlNode **child);

/* Reads the place that a child <origin> gives; the identity without one. */
enum error_code urdf_read_origin(const struct urdf_reader *r, const xmlNode *node,
                                 struct import_place *place);

/* Reads all materials of the file that have a color; links are read after that. */
enum error_code urdf_read_materials(struct urdf_reader *r);

/* Reads the color of a <visual>, its own or that of the material that it names; notes a material
 * without a color. */
void urdf_read_color(const struct urdf_reader *r, const xmlNode *visual,
                     struct import_geometry *shape);

/* Reads a link with its inertia and geometry into model->link[at]. */
enum error_code urdf_read_link(const struct urdf_reader *r, const xmlNode *node, size_t at);

/* Reads a joint into *joint. */
enum error_code urdf_read_joint(const struct urdf_reader *r, const xmlNode *node,
                                struct import_joint *joint);

/* Reads a <sensor> of URDF or of Gazebo; reference: the link or joint that a <gazebo> names, or
 * NULL. Sensors that no robot here has are noted as dropped. */
enum error_code urdf_read_sensor(const struct urdf_reader *r, const xmlNode *node,
                                 const char *reference);

#endif
