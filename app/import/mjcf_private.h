/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of MJCF share. Not RT-safe. */
#ifndef APP_IMPORT_MJCF_PRIVATE_H
#define APP_IMPORT_MJCF_PRIVATE_H

#include "app/import/mjcf.h"

enum { MJCF_DEPTH_MAX = 200 };

/* What a body weighs: what <inertial> says, else what its geoms do (auto); or always one. */
enum mjcf_inertia { MJCF_INERTIA_AUTO, MJCF_INERTIA_OF_BODY, MJCF_INERTIA_OF_GEOMS };

/* A name and the elements that go by it, in the order of the file. */
struct mjcf_name {
    const char *name, *above; /* above: of a class, the class that it is in; NULL = none */
    const xmlNode *node;
    size_t number;
};

/* Sorted by name. */
struct mjcf_names {
    struct mjcf_name *entry;
    size_t count;
};

struct mjcf_reader {
    const struct xml_file *file;
    const struct import_packages *packages; /* NULL: no other file is read */
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;

    struct mjcf_names classes, meshes, materials;
    double angle; /* rad of the file's unit */
    char eulerseq[4];
    bool autolimits, exact_meshes;
    enum mjcf_inertia from_geom;
    double groups[2];    /* of geoms that weigh something */
    const char *meshdir; /* "" = the folder of the file */
    const char *imu_site, *imu_name;
    double *ref;    /* by joint: where MuJoCo counts from */
    int *qpos;      /* by joint: its first place in qpos */
    int qpos_count; /* so far */
};

enum error_code mjcf_no_memory(const struct mjcf_reader *r);

/* "file:line: ..." of something wrong with a node; returns ERROR_INPUT. */
enum error_code mjcf_refuse(const struct mjcf_reader *r, const xmlNode *node, const char *format,
                            ...) __attribute__((format(printf, 3, 4)));

/* The element after one (NULL: the first) of that name (NULL: of any) in all sections of a name. */
const xmlNode *mjcf_next(const struct mjcf_reader *r, const char *section, const char *element,
                         const xmlNode *after);

/* The file of a node, for as long as the model lives. */
const char *mjcf_file(const struct mjcf_reader *r, const xmlNode *node);

/* Puts what is in other files in the place of <include>. */
enum error_code mjcf_expand_includes(const struct mjcf_reader *r);

/* Lists default classes, meshes and materials by name. */
enum error_code mjcf_index(struct mjcf_reader *r);

/* The first entry of a name; those after it, within the list, may have it too. NULL = none. */
const struct mjcf_name *mjcf_find(const struct mjcf_names *names, const char *name);

/* An attribute of the element, of its class or of the classes above it; NULL when none has it. */
const char *mjcf_attribute(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name);

/* Its numbers; as xml_reals. */
enum error_code mjcf_reals(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name, size_t count, double *value, bool *given);

/* As many numbers as there are, from 1 to most. */
enum error_code mjcf_some_reals(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, const char *name, size_t most,
                                double *value, size_t *count);

/* The place that pos and one of quat, axisangle, euler, xyaxes give. */
enum error_code mjcf_read_place(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, struct import_place *place);

/* Columns from two axes, the second made orthogonal to the first; false when they give none. */
bool mjcf_axes_to_rotation(const double axes[6], double R[9]);

/* A geom of a link, with what it adds to a body that has no inertia of its own (NULL: nothing). */
enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia);

/* Actuators, equalities between joints, and keyframes, when all joints are known. */
enum error_code mjcf_read_actuators(const struct mjcf_reader *r);
enum error_code mjcf_read_couplings(const struct mjcf_reader *r);
enum error_code mjcf_read_keys(const struct mjcf_reader *r);

#endif
