/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the readers of robot files. A reader continues after an error, keeps the
 * first error in *error, and its model is then not used. Not RT-safe.
 */
#ifndef APP_IMPORT_READERS_PRIVATE_H
#define APP_IMPORT_READERS_PRIVATE_H

#include "app/import/readers.h"

enum { MJCF_DEPTH_MAX = 200 };

/* Source of a body's inertia. Auto: <inertial>, else its geoms. The others always use one of
 * them. */
enum mjcf_inertia { MJCF_INERTIA_AUTO, MJCF_INERTIA_OF_BODY, MJCF_INERTIA_OF_GEOMS };

enum { READER_UNREAD_MAX = 256 };

/* The kinds of elements, and of attributes of elements, that a reader does not use. */
struct reader_unread {
    struct {
        const char *element, *attribute; /* attribute NULL = the element */
        const xmlNode *first;
        size_t places;
    } kind[READER_UNREAD_MAX];
    size_t count;
};

/* A robot file during reading. */
struct import_reader {
    const struct xml_file *file;
    const struct import_packages *packages; /* NULL = no other file may be read */
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;
    struct reader_unread *unread;
    struct xml_names materials; /* materials with a color */

    /* Settings and lists of an MJCF */
    struct xml_names classes, meshes;
    double angle; /* rad per angle unit of the file */
    char eulerseq[4];
    bool autolimits, exact_meshes;
    enum mjcf_inertia from_geom;
    double groups[2];    /* range of geom groups that add to inertia */
    double total_mass;   /* settotalmass, kg; 0 = sum of the bodies */
    const char *meshdir; /* "" = the file's folder */
    const char *imu_site, *imu_name;
    double *ref;        /* by joint: MuJoCo's position in the pose of the file */
    double (*force)[2]; /* by joint: range of the sum of its actuators, N m or N */
    int *qpos;          /* by joint: index of its first coordinate in qpos */
    int qpos_count;     /* number of coordinates of the joints read so far */
};

/* Adds a note at a node. */
void reader_note(const struct import_reader *r, enum import_fate fate, const xmlNode *node,
                 const char *format, ...) __attribute__((format(printf, 4, 5)));

/* Returns memory from the arena, or a copy of a text. On an error returns NULL or "". */
void *reader_alloc(const struct import_reader *r, size_t count, size_t size);
const char *reader_copy(const struct import_reader *r, const char *text);

/* Returns a formatted name from the arena, at most 511 bytes. On an error returns "". */
const char *reader_format(const struct import_reader *r, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Returns the text of an attribute, "" if it is missing. Valid as long as the document. */
const char *reader_text(const xmlNode *node, const char *name);

/* Checks whether an element's name is in a list that ends with NULL. */
bool reader_is_one_of(const xmlNode *node, const char *const name[]);

/* Allocates links, joints, shapes and sensors of the model. */
void reader_make_room(const struct import_reader *r, size_t links, size_t joints, size_t shapes,
                      size_t sensors);

/* The attributes of an element that a reader uses. NULL: the element has notes of its own. */
struct reader_row {
    const char *element, *attributes;
};

/* Counts one more place of an element, or of its attribute, that the reader does not use. Kinds
 * beyond the limit count as the last one. */
void reader_skip(const struct import_reader *r, const xmlNode *node, const char *attribute);

/* Counts elements and attributes that have no row in a table, which ends with {0}. Then adds a note
 * for each kind that was counted. */
void reader_report(const struct import_reader *r, const struct reader_row *rows);
extern const struct reader_row mjcf_read_attributes[];

/* Refuses links or joints that share a name. `what` is the file's word for a link. */
void reader_check_names(const struct import_reader *r, const char *what);

/* Changes a joint without limits: a revolute joint becomes continuous, and a prismatic joint gets a
 * wide range, with a note. */
void reader_free_limits(const struct import_reader *r, const xmlNode *node,
                        struct import_joint *joint);

/* ---- MJCF ---- */

/* Iterates over the elements `element` (NULL: all) of all sections `section`, which count as one.
 * Pass NULL to start. Returns NULL at the end. */
const xmlNode *mjcf_next(const struct import_reader *r, const char *section, const char *element,
                         const xmlNode *after);

/* Replaces each <include> by the content of its file. */
void mjcf_expand_includes(const struct import_reader *r);

/* Lists default classes, meshes and materials by name. */
void mjcf_index(struct import_reader *r);

/* Computes the pose, in the body, of the <frame> elements around a node. Returns false if there are
 * none. */
bool mjcf_read_frame(const struct import_reader *r, const xmlNode *node,
                     struct import_place *place);

/* Checks whether an equality is active. */
bool mjcf_is_active(const struct import_reader *r, const xmlNode *node);

/* Clamps limit to scale times the range in attribute WHATrange, if WHATlimited or autolimits
 * enables the range. Returns whether the range is enabled. */
bool mjcf_clamp(const struct import_reader *r, const xmlNode *node, const char *what, double scale,
                double limit[2]);

/* Returns an attribute of the element, else of its class or an enclosing class; NULL if none has
 * it. An element without a class has the childclass of the nearest body or frame around it. */
const char *mjcf_attribute(const struct import_reader *r, const xmlNode *node, const char *name);

/* Reads an attribute, found as in mjcf_attribute, as numbers, as in xml_reals. */
bool mjcf_reals(const struct import_reader *r, const xmlNode *node, const char *name, size_t count,
                double *value);

/* Reads all numbers of an attribute, between 1 and most, if the element has it. */
void mjcf_some_reals(const struct import_reader *r, const xmlNode *node, const char *name,
                     size_t most, double *value);

/* Reads the pose in the body: by fromto, or by pos and one of quat, axisangle, euler, xyaxes,
 * zaxis. */
void mjcf_read_place(const struct import_reader *r, const xmlNode *node,
                     struct import_place *place);

/* Adds a geom to a link, and its mass to `inertia` (NULL: adds no mass). */
void mjcf_read_geom(const struct import_reader *r, const xmlNode *node, int link,
                    struct robot_inertia *inertia);

/* Read actuators, equalities between joints, and keyframes. Read all joints first. */
void mjcf_read_actuators(const struct import_reader *r);
void mjcf_read_couplings(const struct import_reader *r);
void mjcf_read_keys(const struct import_reader *r);

#endif
