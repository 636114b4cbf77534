/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Describes a robot as a foreign file has it, whatever its format: links, joints, geometry, sensors
 * and poses, each with the file and line it stands in, in the file's own order. Nothing is merged
 * or judged yet; app/import/tree_simplify.h makes a robot of it. SI units, angles in rad; places
 * are those of the child in the parent. Memory is the arena's that it was read into; names are the
 * file's. Not RT-safe.
 */
#ifndef APP_IMPORT_MODEL_H
#define APP_IMPORT_MODEL_H

#include "base/arena.h"
#include "base/error.h"
#include "model/robot.h"

#include <stdbool.h>
#include <stddef.h>

/* Bounds of what is read: far above any robot, and small enough for work that grows with their
 * square. */
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

/* A shape that a link touches with, is seen as, or both. */
struct import_geometry {
    const char *file;
    int line;
    int link;
    bool collision, visual; /* purposes of the shape: one of them or both */
    enum import_shape shape;
    double radius, length; /* m; the length of a capsule is that between its half-spheres */
    double half[3];        /* half sides of a box, half axes of an ellipsoid, m */
    const char *mesh;      /* file of the mesh, as the robot file names it */
    double scale[3];
    struct import_place place; /* in the link */
    bool colored;              /* the file gives it a color */
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
    int parent_link, child_link; /* indices, set once the whole file is read */
    struct import_place place;
    double axis[3]; /* of any length but 0, in the child's frame */
    bool has_limit; /* lower and upper are given */
    double lower, upper;
    double effort, velocity; /* 0 = not given */
    double damping, friction;
    double stiffness, rest; /* of a spring, and the position in which it is relaxed */
    double armature;        /* reflected inertia of the rotor, kg m2; 0 = not given */
    double gear;            /* rotor turns per link turn; 0 = not given */
    const char *mimic;      /* name of the joint that it follows, or NULL */
    const char *mimic_file;
    int mimic_line;
    double multiplier, offset; /* of the leader's position */
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

/* What became of a part of the file that the robot does not have as the file says. */
enum import_fate {
    IMPORT_DROPPED, /* read and left out */
    IMPORT_MERGED,  /* part of another body now, without loss */
    IMPORT_CHANGED, /* taken in another form than the file's */
    IMPORT_ASSUMED, /* chosen by a rule, as the file does not say it */
    IMPORT_MISSING, /* a mesh that is not there or cannot be read */
    IMPORT_SHAPED,  /* a collision shape replaced by a capsule */
    IMPORT_DOUBTED, /* taken as the file says, which is hardly meant */
    IMPORT_FATES,
};

/* One thing to report, with its place in the file. */
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
    bool overflow; /* memory or IMPORT_NOTES_MAX was exhausted */
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
    bool floating_base; /* an SRDF says that the base floats */
    bool fixed_base;    /* ... or that it is fixed */
};

/* Adds a note; file and the text's arguments need not outlive the call. */
void import_note_add(struct import_notes *notes, enum import_fate fate, const char *file, int line,
                     const char *format, ...) __attribute__((format(printf, 5, 6)));

/* Returns the text of an error for a note of that place: without "file:line: " at its beginning. */
const char *import_reason(const char *file, int line, const char *text);

/* Reports an error "file:line: ..."; returns ERROR_INPUT. */
enum error_code import_error(struct error *error, const char *file, int line, const char *format,
                             ...) __attribute__((format(printf, 4, 5)));

/* Composes places: where a child of b is in a's parent, out = a b. out may be neither of the
 * two. */
void import_place_compose(const struct import_place *a, const struct import_place *b,
                          struct import_place *out);
void import_place_identity(struct import_place *place);

/* Computes fixed-axis roll, pitch and yaw of a rotation, rad, accurate also near a right angle of
 * pitch. */
void import_rpy(const double R[9], double rpy[3]);

/* Return the index of a name, or -1. */
int import_find_link(const struct import_model *model, const char *name);
int import_find_joint(const struct import_model *model, const char *name);

/* Adds the mass, center and inertia of a part at a place to a body. */
void import_add_inertia(struct robot_inertia *body, const struct robot_inertia *part,
                        const struct import_place *place);

#endif
