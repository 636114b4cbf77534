/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the readers of MJCF. Not RT-safe. */
#ifndef APP_IMPORT_MJCF_PRIVATE_H
#define APP_IMPORT_MJCF_PRIVATE_H

#include "app/import/readers.h"

enum { MJCF_DEPTH_MAX = 200 };

/* Source of a body's inertia: <inertial>, else its geoms (auto); or always one of the two. */
enum mjcf_inertia { MJCF_INERTIA_AUTO, MJCF_INERTIA_OF_BODY, MJCF_INERTIA_OF_GEOMS };

/* A name and its element. */
struct mjcf_name {
    const char *name, *above; /* for a class: above is the enclosing class, NULL = none */
    const xmlNode *node;
    size_t number;
};

/* Entries sorted by name; equal names in file order. */
struct mjcf_names {
    struct mjcf_name *entry;
    size_t count;
};

/* An MJCF document during reading, with its global settings. */
struct mjcf_reader {
    const struct xml_file *file;
    const struct import_packages *packages; /* NULL: no other file may be read */
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;

    struct mjcf_names classes, meshes, materials;
    double angle; /* rad per unit of angle in the file */
    char eulerseq[4];
    bool autolimits, exact_meshes;
    enum mjcf_inertia from_geom;
    double groups[2];    /* range of geom groups that count for inertia */
    const char *meshdir; /* "" = the file's folder */
    const char *imu_site, *imu_name;
    double *ref;    /* by joint: MuJoCo's position in the file's pose */
    int *qpos;      /* by joint: index of its first coordinate in qpos */
    int qpos_count; /* number of coordinates of the joints read so far */
};

enum error_code mjcf_no_memory(const struct mjcf_reader *r);

/* Reports an error "file:line: ..." at a node; returns ERROR_INPUT. */
enum error_code mjcf_refuse(const struct mjcf_reader *r, const xmlNode *node, const char *format,
                            ...) __attribute__((format(printf, 3, 4)));

/* Iterates over the elements `element` (NULL: all) of all sections `section`, which count as one.
 * Pass NULL to start. Returns NULL at the end. */
const xmlNode *mjcf_next(const struct mjcf_reader *r, const char *section, const char *element,
                         const xmlNode *after);

/* Returns the name of a node's file; valid as long as the model. */
const char *mjcf_file(const struct mjcf_reader *r, const xmlNode *node);

/* Replaces each <include> by the content of its file. */
enum error_code mjcf_expand_includes(const struct mjcf_reader *r);

/* Lists default classes, meshes and materials by name. */
enum error_code mjcf_index(struct mjcf_reader *r);

/* Returns the first entry with a name; the following entries of the list may have the same name.
 * NULL = none. */
const struct mjcf_name *mjcf_find(const struct mjcf_names *names, const char *name);

/* Returns an attribute of the element, else of its class or an enclosing class; NULL if none has
 * it. */
const char *mjcf_attribute(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name);

/* Reads an attribute, found like mjcf_attribute, as numbers, like xml_reals. */
enum error_code mjcf_reals(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name, size_t count, double *value, bool *given);

/* Reads all numbers of an attribute, 1 to most; *count is 0 without the attribute. */
enum error_code mjcf_some_reals(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, const char *name, size_t most,
                                double *value, size_t *count);

/* Reads the pose given by pos and one of quat, axisangle, euler, xyaxes. */
enum error_code mjcf_read_place(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, struct import_place *place);

/* Computes the rotation with two axes as first columns; the second is made orthogonal to the
 * first. Returns false if they are parallel. */
bool mjcf_axes_to_rotation(const double axes[6], double R[9]);

/* Adds a geom to a link, and its mass to a body without its own inertia (NULL: to none). */
enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia);

/* Read actuators, equalities between joints, and keyframes; call them when all joints are
 * known. */
enum error_code mjcf_read_actuators(const struct mjcf_reader *r);
enum error_code mjcf_read_couplings(const struct mjcf_reader *r);
enum error_code mjcf_read_keys(const struct mjcf_reader *r);

#endif
