/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A robot as in a foreign file of any format: links, joints, geometry, sensors and poses in file
 * order, each with file and line. Nothing is merged or checked yet; app/import/tree_simplify.h
 * makes a robot of it. SI units, angles in rad; a place is the pose of the child in the parent. The
 * arena of the reading owns the memory; names are as in the file. Not RT-safe.
 */
#ifndef APP_IMPORT_MODEL_H
#define APP_IMPORT_MODEL_H

#include "base/arena.h"
#include "base/error.h"
#include "model/robot.h"

#include <stdbool.h>
#include <stddef.h>

/* Limits: far above any robot, and small enough for work that grows with their square. */
enum { IMPORT_LINKS_MAX = 4096, IMPORT_GEOMETRY_MAX = 16384, IMPORT_NOTES_MAX = 65536 };

/* Pose of a child in its parent. */
struct import_place {
    double xyz[3]; /* m */
    double R[9];   /* child to parent, row-major */
};

enum import_joint_type {
    IMPORT_FIXED,
    IMPORT_REVOLUTE,
    IMPORT_CONTINUOUS,
    IMPORT_PRISMATIC,
    IMPORT_FLOATING,
    IMPORT_PLANAR,
};

enum import_shape {
    IMPORT_SPHERE,
    IMPORT_BOX,
    IMPORT_CYLINDER,
    IMPORT_CAPSULE,
    IMPORT_ELLIPSOID,
    IMPORT_MESH
};

/* A shape for collision, for appearance, or for both. */
struct import_geometry {
    const char *file;
    int line;
    int link;
    bool collision, visual; /* purpose of the shape: at least one is true */
    enum import_shape shape;
    double radius, length; /* m; the length of a capsule is between its half-spheres */
    double half[3];        /* half edge lengths of a box, semi-axes of an ellipsoid, m */
    const char *mesh;      /* file name of the mesh, as in the robot file */
    double scale[3];
    bool exact;                /* the mesh weighs by signed volumes: import_measure_mesh */
    struct import_place place; /* in the link */
    bool colored;              /* the file gives a color */
    bool repaints;             /* ... which overrides the mesh's own colors */
    double color[4];           /* sRGB and opacity, 0 to 1 */
};

struct import_link {
    const char *name, *file;
    int line;
    bool has_inertia;
    int inertia_line;
    struct robot_inertia inertia; /* in the link's frame */
};

struct import_joint {
    const char *name, *file;
    int line;
    enum import_joint_type type;
    const char *parent, *child;
    int parent_link, child_link; /* indices, set after the whole file is read */
    struct import_place place;
    double axis[3]; /* any length but 0, in the child's frame */
    bool has_limit; /* lower and upper are given */
    double lower, upper;
    double effort, velocity; /* 0 = not given */
    double damping, friction;
    double stiffness, rest; /* of a spring, and its relaxed position */
    double armature;        /* reflected inertia of the rotor, kg m2; 0 = not given */
    double gear;            /* rotor turns per link turn; 0 = not given */
    const char *mimic;      /* name of the leader, or NULL */
    const char *mimic_file;
    int mimic_line;
    double multiplier, offset; /* position = multiplier times the leader's position + offset */
    bool bends;                /* it follows by a polynomial of higher order */
    bool driven;               /* the file has an actuator for it */
};

enum import_sensor_kind { IMPORT_FT, IMPORT_IMU };

struct import_sensor {
    enum import_sensor_kind kind;
    const char *name, *file;
    int line;
    const char *joint; /* of a force-torque sensor */
    const char *link;  /* of an inertial sensor */
    struct import_place place;
};

/* Position of one joint in a pose, rad or m. */
struct import_value {
    const char *joint;
    int line;
    double value;
};

struct import_pose {
    const char *name, *file;
    int line;
    struct import_value *value;
    size_t nvalue;
};

/* How the robot differs from a part of the file. */
enum import_fate {
    IMPORT_DROPPED, /* read and ignored */
    IMPORT_MERGED,  /* merged into another body, without loss */
    IMPORT_CHANGED, /* used in a different form */
    IMPORT_ASSUMED, /* not in the file: chosen by a rule */
    IMPORT_MISSING, /* a mesh that does not exist or cannot be read */
    IMPORT_SHAPED,  /* a collision shape replaced by a capsule */
    IMPORT_DOUBTED, /* used as in the file, but probably not intended */
    IMPORT_FATES,
};

/* One item of the report, with its place in the file. */
struct import_note {
    enum import_fate fate;
    const char *file;
    int line; /* 0 = no particular line */
    const char *text;
};

struct import_notes {
    struct arena *arena;
    struct import_note *note;
    size_t count, capacity;
    bool overflow; /* no memory, or IMPORT_NOTES_MAX reached */
};

struct import_model {
    const char *file, *name;
    struct import_link *link;
    size_t nlink;
    struct import_joint *joint;
    size_t njoint;
    struct import_geometry *geometry;
    size_t ngeometry;
    struct import_sensor *sensor;
    size_t nsensor;
    struct import_pose *pose;
    size_t npose;
    bool actuated, drives_others; /* actuators drive joints; they drive other things, as tendons */
    bool floating_base;           /* an SRDF says that the base floats */
    bool fixed_base;              /* ... or that it is fixed */
};

/* Adds a note; file and the text's arguments need not outlive the call. */
void import_note_add(struct import_notes *notes, enum import_fate fate, const char *file, int line,
                     const char *format, ...) __attribute__((format(printf, 5, 6)));

/* Returns the array with room for one more element: itself, or a copy of twice the capacity. NULL =
 * no memory; then array and capacity stay. */
void *import_grow(struct arena *arena, void *array, size_t count, size_t *capacity, size_t size);

/* Returns the text of an error for a note at that place: without a leading "file:line: ". */
const char *import_reason(const char *file, int line, const char *text);

/* Reports an error "file:line: ..." unless *error holds one already: the first error stays. Returns
 * the code of *error. */
enum error_code import_error(struct error *error, const char *file, int line, const char *format,
                             ...) __attribute__((format(printf, 4, 5)));

/* Composes poses: out = a b, the pose of b's child in a's parent. out must differ from a and b. */
void import_place_compose(const struct import_place *a, const struct import_place *b,
                          struct import_place *out);
void import_place_identity(struct import_place *place);

/* Computes fixed-axis roll, pitch and yaw of a rotation, rad; accurate also near a pitch of 90
 * degrees. */
void import_rpy(const double R[9], double rpy[3]);

/* Return the index of a name, or -1. */
int import_find_link(const struct import_model *model, const char *name);
int import_find_joint(const struct import_model *model, const char *name);

/* Adds the mass, center and inertia of a part with a pose to a body. */
void import_add_inertia(struct robot_inertia *body, const struct robot_inertia *part,
                        const struct import_place *place);

#endif
