/* SPDX-License-Identifier: Apache-2.0 */
/* What the readers of MJCF share. Not RT-safe. */
#ifndef APP_IMPORT_MJCF_PRIVATE_H
#define APP_IMPORT_MJCF_PRIVATE_H

#include "app/import/mjcf.h"

enum { MJCF_DEPTH_MAX = 200 };

struct mjcf_reader {
    const struct xml_file *file;
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;

    const xmlNode *defaults, *assets; /* <default> and <asset> of the file, or NULL */
    double angle;                     /* rad of the file's unit */
    char eulerseq[4];
    bool autolimits;
    const char *meshdir; /* "" = the folder of the file */
    const char *imu_site, *imu_name;
    double *ref;    /* by joint: where MuJoCo counts from */
    int *qpos;      /* by joint: its first place in qpos */
    int qpos_count; /* so far */
};

enum error_code mjcf_no_memory(const struct mjcf_reader *r);

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

/* A geom of a link, with what it adds to a body that has no inertia of its own (NULL: nothing). */
enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia);

/* Actuators and keyframes, when all joints are known. */
enum error_code mjcf_read_actuators(const struct mjcf_reader *r);
enum error_code mjcf_read_keys(const struct mjcf_reader *r);

#endif
