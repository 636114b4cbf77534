/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A robot as in a foreign file of any format: links, joints, geometry, sensors and poses in file
 * order, each with file and line. Nothing is merged or checked yet; app/import/tree_simplify.h
 * makes a robot from the model. SI units, angles in rad. A place is the pose of a child in its
 * parent. The arena of the reader owns the memory. Names are as in the file. Not RT-safe.
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

/* Method to compute mass and inertia from a mesh; see import_measure_mesh. IMPORT_SOLID_CONVEX
 * measures the hull of the mesh. */
enum import_solid {
    IMPORT_SOLID_PYRAMIDS,
    IMPORT_SOLID_EXACT,
    IMPORT_SOLID_SHELL,
    IMPORT_SOLID_CONVEX
};

/* A shape for collision, for visuals, or for both. */
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
    enum import_solid solid;
    struct import_place place; /* pose in the link */
    bool colored;              /* the file gives a color */
    bool repaints;             /* the file's color overrides the colors of the mesh */
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
    double axis[3]; /* in the child's frame; length not 0 */
    bool has_limit; /* lower and upper are given */
    double lower, upper;
    double effort, velocity; /* 0 = not given */
    double damping, friction;
    double stiffness, rest; /* stiffness of a spring, and its relaxed position */
    double armature;        /* reflected inertia of the rotor, kg m2; 0 = not given */
    double gear;            /* rotor turns per link turn; 0 = not given */
    const char *mimic;      /* name of the leader, or NULL */
    const char *mimic_file;
    int mimic_line;
    double multiplier, offset; /* position = multiplier times the leader's position + offset */
    bool bends;                /* follows by a polynomial of higher order */
    bool driven;               /* an actuator of the file drives the joint */
    bool racked;               /* follows its pinion, for every --mimic */
};

enum import_sensor_kind { IMPORT_FT, IMPORT_IMU };

struct import_sensor {
    enum import_sensor_kind kind;
    const char *name, *file;
    int line;
    const char *joint; /* joint of a force-torque sensor */
    const char *link;  /* link of an inertial sensor */
    struct import_place place;
};

/* Position of one joint in a pose, rad or m. */
struct import_value {
    const char *joint;
    double value;
};

struct import_pose {
    const char *name, *file;
    int line;
    struct import_value *value;
    size_t nvalue;
};

/* The kind of difference between the robot and the file. */
enum import_fate {
    IMPORT_DROPPED, /* read, but ignored */
    IMPORT_MERGED,  /* merged into another body, without loss */
    IMPORT_CHANGED, /* used in a different form */
    IMPORT_ASSUMED, /* not in the file: chosen by a rule */
    IMPORT_MISSING, /* mesh missing or unreadable */
    IMPORT_SHAPED,  /* collision shape replaced by a capsule */
    IMPORT_DOUBTED, /* used as in the file, but probably a mistake */
    IMPORT_FATES,
};

/* One item of the report, with its place in the file. */
struct import_note {
    enum import_fate fate;
    const char *file;
    int line; /* 0 = no line */
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
    bool actuated, drives_others; /* actuators drive joints; or other parts */
    bool floating_base;           /* the SRDF says that the base floats */
    bool fixed_base;              /* the SRDF says that the base is fixed */
};

/* Adds a note. The caller may free file and the text's arguments after the call. */
void import_note_add(struct import_notes *notes, enum import_fate fate, const char *file, int line,
                     const char *format, ...) __attribute__((format(printf, 5, 6)));

/* Returns an array with room for one more element: the same array, or a copy with twice the
 * capacity. Without memory returns NULL; array and capacity then stay unchanged. */
void *import_grow(struct arena *arena, void *array, size_t count, size_t *capacity, size_t size);

/* Checks whether a list of words has a word. mark: the character between words. */
bool import_has_word(const char *list, char mark, const char *word);

/* Returns the text of an error without a leading "file:line: ", for a note at that place. */
const char *import_reason(const char *file, int line, const char *text);

/* Sets an error "file:line: ..." unless *error already has one. Returns the code of *error. */
enum error_code import_error(struct error *error, const char *file, int line, const char *format,
                             ...) __attribute__((format(printf, 4, 5)));

/* Composes poses: out = a b, the pose of b's child in a's parent. out must differ from a and b. */
void import_place_compose(const struct import_place *a, const struct import_place *b,
                          struct import_place *out);
void import_place_identity(struct import_place *place);

/* Computes fixed-axis roll, pitch and yaw of a rotation, rad. It is accurate also near a pitch of
 * 90 degrees. */
void import_rpy(const double R[9], double rpy[3]);

/* Computes the smallest rotation that turns the axis z into a direction, as MuJoCo does. Returns
 * false for a direction of length 0. */
bool import_turn_z(const double z[3], double R[9]);

/* Return the index of the link or joint with this name, or -1. */
int import_find_link(const struct import_model *model, const char *name);
int import_find_joint(const struct import_model *model, const char *name);

/* Adds mass, center of mass and inertia of a part, which has this pose in the body, to the body. */
void import_add_inertia(struct robot_inertia *body, const struct robot_inertia *part,
                        const struct import_place *place);

#endif
