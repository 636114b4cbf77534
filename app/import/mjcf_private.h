/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the readers of MJCF. Not RT-safe. */
#ifndef APP_IMPORT_MJCF_PRIVATE_H
#define APP_IMPORT_MJCF_PRIVATE_H

#include "app/import/readers.h"

enum { MJCF_DEPTH_MAX = 200 };

/* Where a body's inertia comes from: <inertial>, else its geoms (auto); or always one of the
 * two. */
enum mjcf_inertia { MJCF_INERTIA_AUTO, MJCF_INERTIA_OF_BODY, MJCF_INERTIA_OF_GEOMS };

/* A name and an element that goes by it. */
struct mjcf_name {
    const char *name, *above; /* of a class: the class around it, NULL = none */
    const xmlNode *node;
    size_t number;
};

/* Entries sorted by name, equal ones in the order of the file. */
struct mjcf_names {
    struct mjcf_name *entry;
    size_t count;
};

/* An MJCF document being read, with the settings that hold for all of it. */
struct mjcf_reader {
    const struct xml_file *file;
    const struct import_packages *packages; /* NULL: no other file is read */
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;

    struct mjcf_names classes, meshes, materials;
    double angle; /* rad of one unit of angle in the file */
    char eulerseq[4];
    bool autolimits, exact_meshes;
    enum mjcf_inertia from_geom;
    double groups[2];    /* geoms of these groups count for inertia, first to last */
    const char *meshdir; /* "" = the folder of the file */
    const char *imu_site, *imu_name;
    double *ref;    /* by joint: MuJoCo's position in the file's pose */
    int *qpos;      /* by joint: index of its first coordinate in qpos */
    int qpos_count; /* coordinates of the joints so far */
};

enum error_code mjcf_no_memory(const struct mjcf_reader *r);

/* Reports an error "file:line: ..." at a node; returns ERROR_INPUT. */
enum error_code mjcf_refuse(const struct mjcf_reader *r, const xmlNode *node, const char *format,
                            ...) __attribute__((format(printf, 3, 4)));

/* Returns the next element of that name (NULL: of any) after one (NULL: the first) in all sections
 * of a name, which count as one; NULL at the end. */
const xmlNode *mjcf_next(const struct mjcf_reader *r, const char *section, const char *element,
                         const xmlNode *after);

/* Returns the name of a node's file, which lives as long as the model. */
const char *mjcf_file(const struct mjcf_reader *r, const xmlNode *node);

/* Replaces each <include> by the content of its file. */
enum error_code mjcf_expand_includes(const struct mjcf_reader *r);

/* Lists default classes, meshes and materials by name. */
enum error_code mjcf_index(struct mjcf_reader *r);

/* Returns the first entry of a name; those after it, within the list, may have it too. NULL =
 * none. */
const struct mjcf_name *mjcf_find(const struct mjcf_names *names, const char *name);

/* Returns an attribute of the element, or of its class or the classes around it; NULL when none has
 * it. */
const char *mjcf_attribute(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name);

/* Reads such an attribute as numbers, as xml_reals does. */
enum error_code mjcf_reals(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name, size_t count, double *value, bool *given);

/* Reads as many numbers as such an attribute has, from 1 to most; *count is 0 without the
 * attribute. */
enum error_code mjcf_some_reals(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, const char *name, size_t most,
                                double *value, size_t *count);

/* Reads the place that pos and one of quat, axisangle, euler, xyaxes give. */
enum error_code mjcf_read_place(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, struct import_place *place);

/* Computes the rotation whose first columns are two axes, the second made orthogonal to the first;
 * false when they span no plane. */
bool mjcf_axes_to_rotation(const double axes[6], double R[9]);

/* Adds a geom to a link, and its mass to a body that has no inertia of its own (NULL: to none). */
enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia);

/* Read actuators, equalities between joints, and keyframes, once all joints are known. */
enum error_code mjcf_read_actuators(const struct mjcf_reader *r);
enum error_code mjcf_read_couplings(const struct mjcf_reader *r);
enum error_code mjcf_read_keys(const struct mjcf_reader *r);

#endif
