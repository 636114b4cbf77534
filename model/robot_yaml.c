/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Robots from YAML: the schema of the file, the variant that is asked for, and the checks that need
 * the whole file (names that refer to each other, the order of the tree, possible inertias), each
 * with its place in the file. The format is described at the head of config/robots/coman.yaml.
 */
#include "model/robot.h"

#include "base/text.h"
#include "model/spatial.h"

#include <stddef.h>

#define COUNT(array) (sizeof(array) / sizeof *(array))
#define SCHEMA(text, type, table)                                                                  \
    {                                                                                              \
        .what = text, .size = sizeof(type), .fields = table, .field_count = COUNT(table)           \
    }

/* An axis written with this many digits is unit length; it is normalized. */
#define AXIS_TOLERANCE 1e-6

/* Every named struct below begins like this. */
struct named {
    struct yaml_mark mark;
    const char *name;
};

struct inertia_yaml {
    struct yaml_mark mark;
    double mass, com[3], I[6];
};

struct body_yaml {
    struct yaml_mark mark;
    const char *name;
    double mass, com[3], I[6];
    struct yaml_mark inertia_mark;
};

struct place_yaml {
    struct yaml_mark mark;
    double xyz[3], rpy[3];
};

struct limits_yaml {
    struct yaml_mark mark;
    double lower_rad, upper_rad, torque_nm;
    double lower_m, upper_m, force_n;
    bool angular[3], linear[3]; /* which of the above are given */
};

enum { DRIVE_VALUES = 9 };

struct drive_yaml {
    struct yaml_mark mark;
    double value[DRIVE_VALUES]; /* in the order of drive_fields */
    bool given[DRIVE_VALUES];
};

struct spring_yaml {
    struct yaml_mark mark;
    bool enabled;
    double k_p, d_p, r;
    int64_t s;
    struct yaml_mark s_mark;
};

struct joint_yaml {
    struct yaml_mark mark;
    const char *name;
    int64_t paper_index;
    int type;
    const char *parent, *child;
    struct yaml_mark parent_mark, child_mark, axis_mark;
    double axis[3];
    struct place_yaml origin;
    struct limits_yaml limits;
    struct drive_yaml drive;
    struct spring_yaml spring;
    bool has_drive, has_spring;
};

struct frame_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *body;
    struct yaml_mark body_mark;
    double xyz[3], rpy[3];
};

struct ft_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *frame;
    struct yaml_mark frame_mark;
    struct inertia_yaml distal;
};

struct imu_yaml {
    struct yaml_mark mark;
    const char *frame;
    struct yaml_mark frame_mark;
};

struct pose_yaml {
    struct yaml_mark mark;
    const char *name;
    double base_xyz[3], base_rpy[3];
    bool has_xyz, has_rpy;
    struct yaml_real_entry *joint_rad, *joint_m;
    size_t njoint_rad, njoint_m;
};

struct base_yaml {
    struct yaml_mark mark;
    int floating;
    const char *body;
    struct yaml_mark body_mark;
};

struct variant_yaml {
    struct yaml_mark mark;
    const char *name;
    struct body_yaml *body;
    struct frame_yaml *frame;
    struct ft_yaml *ft;
    size_t nbody, nframe, nft;
};

struct robot_yaml {
    struct yaml_mark mark;
    const char *name, *source;
    double gravity[3];
    struct base_yaml base;
    struct drive_yaml drive;
    struct body_yaml *body;
    struct joint_yaml *joint;
    struct frame_yaml *frame;
    struct ft_yaml *ft;
    struct imu_yaml imu;
    struct pose_yaml *pose;
    struct variant_yaml *variant;
    size_t nbody, njoint, nframe, nft, npose, nvariant;
    bool has_imu;
};

/* ---- the schema ---- */

#define NAME(owner)                                                                                \
    {                                                                                              \
        .key = "name", .type = YAML_STRING, .required = true, .offset = offsetof(owner, name),     \
        .min = 1, .max = 63                                                                        \
    }
#define REFERENCE(word, owner, member)                                                             \
    {                                                                                              \
        .key = word, .type = YAML_STRING, .required = true, .offset = offsetof(owner, member),     \
        .min = 1, .max = 63, .mark_offset = offsetof(owner, member##_mark)                         \
    }
#define VECTOR(word, owner, member, must)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REALS, .required = must, .offset = offsetof(owner, member),      \
        .count = 3, .min = -1e3, .max = 1e3                                                        \
    }
#define TENSOR(owner)                                                                              \
    .key = "inertia_kg_m2", .type = YAML_REALS, .required = true, .offset = offsetof(owner, I),    \
    .count = 6, .min = -1e6, .max = 1e6
#define LIST(word, kind, owner, member, counter, entry)                                            \
    {                                                                                              \
        .key = word, .type = kind, .offset = offsetof(owner, member),                              \
        .count_offset = offsetof(owner, counter), .schema = &entry                                 \
    }

static const struct yaml_field body_fields[] = {
    NAME(struct body_yaml),
    {.key = "mass_kg",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct body_yaml, mass),
     .min = 1e-9,
     .max = 1e6},
    VECTOR("com_m", struct body_yaml, com, true),
    {TENSOR(struct body_yaml), .mark_offset = offsetof(struct body_yaml, inertia_mark)},
};
static const struct yaml_schema body_schema = SCHEMA("a body", struct body_yaml, body_fields);

static const struct yaml_field inertia_fields[] = {
    {.key = "mass_kg",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct inertia_yaml, mass),
     .min = 0.0,
     .max = 1e6},
    VECTOR("com_m", struct inertia_yaml, com, true),
    {TENSOR(struct inertia_yaml)},
};
static const struct yaml_schema inertia_schema =
    SCHEMA("the inertia below a sensor", struct inertia_yaml, inertia_fields);

static const struct yaml_field place_fields[] = {
    VECTOR("xyz_m", struct place_yaml, xyz, true),
    VECTOR("rpy_rad", struct place_yaml, rpy, false),
};
static const struct yaml_schema place_schema = SCHEMA("an origin", struct place_yaml, place_fields);

#define LIMIT(word, member, flag, lowest)                                                          \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct limits_yaml, member),            \
        .min = lowest, .max = 1e6, .given_offset = offsetof(struct limits_yaml, flag)              \
    }
static const struct yaml_field limits_fields[] = {
    LIMIT("lower_rad", lower_rad, angular[0], -1e6),
    LIMIT("upper_rad", upper_rad, angular[1], -1e6),
    LIMIT("torque_nm", torque_nm, angular[2], 0.0),
    LIMIT("lower_m", lower_m, linear[0], -1e6),
    LIMIT("upper_m", upper_m, linear[1], -1e6),
    LIMIT("force_n", force_n, linear[2], 0.0),
};
static const struct yaml_schema limits_schema =
    SCHEMA("the limits of a joint", struct limits_yaml, limits_fields);

#define DRIVE(index, word, lowest)                                                                 \
    {                                                                                              \
        .key = word, .type = YAML_REAL, .offset = offsetof(struct drive_yaml, value[index]),       \
        .min = lowest, .max = 1e9, .given_offset = offsetof(struct drive_yaml, given[index])       \
    }
static const struct yaml_field drive_fields[DRIVE_VALUES] = {
    DRIVE(0, "J_kg_m2", 1e-12),   DRIVE(1, "Dm_nm_s_rad", 0.0), DRIVE(2, "Ks_nm_rad", 0.0),
    DRIVE(3, "Ds_nm_s_rad", 0.0), DRIVE(4, "N", 1e-6),          DRIVE(5, "NKt_nm_a", 1e-12),
    DRIVE(6, "NKw_v_s_rad", 0.0), DRIVE(7, "R_ohm", 0.0),       DRIVE(8, "L_h", 1e-12),
};
static const struct yaml_schema drive_schema = SCHEMA("a drive", struct drive_yaml, drive_fields);

static const struct yaml_field spring_fields[] = {
    {.key = "enabled",
     .type = YAML_BOOL,
     .required = true,
     .offset = offsetof(struct spring_yaml, enabled)},
    {.key = "k_p_n_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, k_p),
     .max = 1e9},
    {.key = "d_p_n_s_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, d_p),
     .max = 1e9},
    {.key = "r_m",
     .type = YAML_REAL,
     .required = true,
     .offset = offsetof(struct spring_yaml, r),
     .min = 1e-6,
     .max = 1e3},
    {.key = "sense",
     .type = YAML_INT,
     .required = true,
     .offset = offsetof(struct spring_yaml, s),
     .min = -1,
     .max = 1,
     .mark_offset = offsetof(struct spring_yaml, s_mark)},
};
static const struct yaml_schema spring_schema =
    SCHEMA("a parallel spring", struct spring_yaml, spring_fields);

static const struct yaml_enum joint_types[] = {
    {"revolute", JOINT_REVOLUTE}, {"prismatic", JOINT_PRISMATIC}, {NULL, 0}};

static const struct yaml_field joint_fields[] = {
    NAME(struct joint_yaml),
    {.key = "paper_index",
     .type = YAML_INT,
     .offset = offsetof(struct joint_yaml, paper_index),
     .max = 1000},
    {.key = "type",
     .type = YAML_ENUM,
     .required = true,
     .offset = offsetof(struct joint_yaml, type),
     .names = joint_types},
    REFERENCE("parent", struct joint_yaml, parent),
    REFERENCE("child", struct joint_yaml, child),
    {.key = "axis",
     .type = YAML_REALS,
     .required = true,
     .offset = offsetof(struct joint_yaml, axis),
     .count = 3,
     .min = -1.0,
     .max = 1.0,
     .mark_offset = offsetof(struct joint_yaml, axis_mark)},
    {.key = "origin",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct joint_yaml, origin),
     .schema = &place_schema},
    {.key = "limits",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct joint_yaml, limits),
     .schema = &limits_schema},
    {.key = "drive",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, drive),
     .schema = &drive_schema,
     .given_offset = offsetof(struct joint_yaml, has_drive)},
    {.key = "parallel_spring",
     .type = YAML_MAP,
     .offset = offsetof(struct joint_yaml, spring),
     .schema = &spring_schema,
     .given_offset = offsetof(struct joint_yaml, has_spring)},
};
static const struct yaml_schema joint_schema = SCHEMA("a joint", struct joint_yaml, joint_fields);

static const struct yaml_field frame_fields[] = {
    NAME(struct frame_yaml),
    REFERENCE("body", struct frame_yaml, body),
    VECTOR("xyz_m", struct frame_yaml, xyz, true),
    VECTOR("rpy_rad", struct frame_yaml, rpy, false),
};
static const struct yaml_schema frame_schema = SCHEMA("a frame", struct frame_yaml, frame_fields);

static const struct yaml_field ft_fields[] = {
    NAME(struct ft_yaml),
    REFERENCE("frame", struct ft_yaml, frame),
    {.key = "distal",
     .type = YAML_MAP,
     .offset = offsetof(struct ft_yaml, distal),
     .schema = &inertia_schema},
};
static const struct yaml_schema ft_schema =
    SCHEMA("a force-torque sensor", struct ft_yaml, ft_fields);

static const struct yaml_field imu_fields[] = {
    REFERENCE("frame", struct imu_yaml, frame),
};
static const struct yaml_schema imu_schema =
    SCHEMA("the inertial sensor", struct imu_yaml, imu_fields);

#define POSITIONS(word, member, counter)                                                           \
    {                                                                                              \
        .key = word, .type = YAML_REAL_DICT, .offset = offsetof(struct pose_yaml, member),         \
        .count_offset = offsetof(struct pose_yaml, counter), .min = -1e6, .max = 1e6               \
    }
static const struct yaml_field pose_fields[] = {
    {.key = "base_xyz_m",
     .type = YAML_REALS,
     .offset = offsetof(struct pose_yaml, base_xyz),
     .count = 3,
     .min = -1e6,
     .max = 1e6,
     .given_offset = offsetof(struct pose_yaml, has_xyz)},
    {.key = "base_rpy_rad",
     .type = YAML_REALS,
     .offset = offsetof(struct pose_yaml, base_rpy),
     .count = 3,
     .min = -1e3,
     .max = 1e3,
     .given_offset = offsetof(struct pose_yaml, has_rpy)},
    POSITIONS("joints_rad", joint_rad, njoint_rad),
    POSITIONS("joints_m", joint_m, njoint_m),
};
static const struct yaml_schema pose_schema = {.what = "a pose",
                                               .size = sizeof(struct pose_yaml),
                                               .fields = pose_fields,
                                               .field_count = COUNT(pose_fields),
                                               .name_offset = offsetof(struct pose_yaml, name)};

static const struct yaml_enum base_types[] = {{"floating", 1}, {"fixed", 0}, {NULL, 0}};

static const struct yaml_field base_fields[] = {
    {.key = "type",
     .type = YAML_ENUM,
     .required = true,
     .offset = offsetof(struct base_yaml, floating),
     .names = base_types},
    REFERENCE("body", struct base_yaml, body),
};
static const struct yaml_schema base_schema = SCHEMA("the base", struct base_yaml, base_fields);

static const struct yaml_field variant_fields[] = {
    LIST("bodies", YAML_LIST, struct variant_yaml, body, nbody, body_schema),
    LIST("frames", YAML_LIST, struct variant_yaml, frame, nframe, frame_schema),
    LIST("ft_sensors", YAML_LIST, struct variant_yaml, ft, nft, ft_schema),
};
static const struct yaml_schema variant_schema = {.what = "a variant",
                                                  .size = sizeof(struct variant_yaml),
                                                  .fields = variant_fields,
                                                  .field_count = COUNT(variant_fields),
                                                  .name_offset =
                                                      offsetof(struct variant_yaml, name)};

static const struct yaml_field robot_fields[] = {
    NAME(struct robot_yaml),
    {.key = "source", .type = YAML_STRING, .offset = offsetof(struct robot_yaml, source)},
    {.key = "gravity_m_s2",
     .type = YAML_REALS,
     .required = true,
     .offset = offsetof(struct robot_yaml, gravity),
     .count = 3,
     .min = -1e3,
     .max = 1e3},
    {.key = "base",
     .type = YAML_MAP,
     .required = true,
     .offset = offsetof(struct robot_yaml, base),
     .schema = &base_schema},
    {.key = "drive",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, drive),
     .schema = &drive_schema},
    {.key = "bodies",
     .type = YAML_LIST,
     .required = true,
     .offset = offsetof(struct robot_yaml, body),
     .count_offset = offsetof(struct robot_yaml, nbody),
     .schema = &body_schema},
    LIST("joints", YAML_LIST, struct robot_yaml, joint, njoint, joint_schema),
    LIST("frames", YAML_LIST, struct robot_yaml, frame, nframe, frame_schema),
    LIST("ft_sensors", YAML_LIST, struct robot_yaml, ft, nft, ft_schema),
    {.key = "imu",
     .type = YAML_MAP,
     .offset = offsetof(struct robot_yaml, imu),
     .schema = &imu_schema,
     .given_offset = offsetof(struct robot_yaml, has_imu)},
    LIST("poses", YAML_DICT, struct robot_yaml, pose, npose, pose_schema),
    LIST("variants", YAML_DICT, struct robot_yaml, variant, nvariant, variant_schema),
};
static const struct yaml_schema robot_schema = SCHEMA("a robot", struct robot_yaml, robot_fields);

/* ---- names ---- */

/* What is being built and what every step needs. */
struct builder {
    struct robot_yaml file;
    struct robot *robot;
    struct arena *arena;
    struct error *error;
};

static const struct named *nth(const void *array, size_t stride, size_t i)
{
    return (const struct named *)((const char *)array + i * stride);
}

/* Index of name in an array of named structs, or -1. */
static int find(const void *array, size_t count, size_t stride, const char *name)
{
    for (size_t i = 0; i < count; i++) {
        if (strcmp(nth(array, stride, i)->name, name) == 0) {
            return (int)i;
        }
    }
    return -1;
}

static enum error_code no_memory(struct builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "%.200s: no memory left for this robot",
                     b->file.mark.file);
}

static enum error_code unknown_name(struct builder *b, const struct yaml_mark *mark,
                                    const char *what, const char *name, const void *array,
                                    size_t count, size_t stride)
{
    const char **names = arena_alloc(b->arena, count + 1, sizeof *names), *nearest;

    if (!names) {
        return no_memory(b);
    }
    for (size_t i = 0; i < count; i++) {
        names[i] = nth(array, stride, i)->name;
    }
    nearest = text_nearest(name, names, count);
    if (nearest) {
        return yaml_error(b->error, mark, "found unknown %s \"%s\", expected \"%s\"", what, name,
                          nearest);
    }
    return yaml_error(b->error, mark,
                      "found unknown %s \"%s\", expected one of the %zu in this file", what, name,
                      count);
}

static enum error_code check_names(struct builder *b, const char *what, const void *array,
                                   size_t count, size_t stride)
{
    for (size_t i = 0; i < count; i++) {
        const struct named *entry = nth(array, stride, i);
        int first = find(array, i, stride, entry->name);

        /* names are words: they stand in messages, logs and on command lines */
        if (!text_is_name(entry->name)) {
            return yaml_error(b->error, &entry->mark,
                              "found %s name \"%.63s\", expected letters, digits and _ - . only",
                              what, entry->name);
        }
        if (first >= 0) {
            return yaml_error(b->error, &entry->mark,
                              "found %s \"%s\" again, expected it once (it stands in line %d)",
                              what, entry->name, nth(array, stride, (size_t)first)->mark.line);
        }
    }
    return ERROR_NONE;
}

#define CHECK_NAMES(b, what, list, count) check_names(b, what, list, count, sizeof *(list))

static enum error_code check_all_names(struct builder *b)
{
    const struct robot_yaml *file = &b->file;
    enum error_code code;

    if ((code = CHECK_NAMES(b, "body", file->body, file->nbody)) ||
        (code = CHECK_NAMES(b, "joint", file->joint, file->njoint)) ||
        (code = CHECK_NAMES(b, "frame", file->frame, file->nframe)) ||
        (code = CHECK_NAMES(b, "sensor", file->ft, file->nft)) ||
        (code = CHECK_NAMES(b, "pose", file->pose, file->npose)) ||
        (code = CHECK_NAMES(b, "variant", file->variant, file->nvariant))) {
        return code;
    }
    for (size_t i = 0; i < file->nvariant; i++) {
        const struct variant_yaml *variant = &file->variant[i];

        if ((code = CHECK_NAMES(b, "body", variant->body, variant->nbody)) ||
            (code = CHECK_NAMES(b, "frame", variant->frame, variant->nframe)) ||
            (code = CHECK_NAMES(b, "sensor", variant->ft, variant->nft))) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- variants ---- */

/* Entries of change take the place of those of the same name in *list, or follow them. */
static enum error_code merge(struct builder *b, void **list, size_t *count, const void *change,
                             size_t nchange, size_t stride)
{
    char *merged = arena_alloc(b->arena, *count + nchange, stride);

    if (!merged) {
        return no_memory(b);
    }
    memcpy(merged, *list ? *list : merged, *count * stride);
    for (size_t i = 0; i < nchange; i++) {
        const struct named *entry = nth(change, stride, i);
        int at = find(merged, *count, stride, entry->name);

        memcpy(merged + (at >= 0 ? (size_t)at : (*count)++) * stride, entry, stride);
    }
    *list = merged;
    return ERROR_NONE;
}

static enum error_code apply_variant(struct builder *b, const struct variant_yaml *variant)
{
    struct robot_yaml *file = &b->file;
    void *frame = file->frame, *ft = file->ft;
    enum error_code code;

    for (size_t i = 0; i < variant->nbody; i++) {
        const struct body_yaml *body = &variant->body[i];
        int at = find(file->body, file->nbody, sizeof *body, body->name);

        if (at < 0) {
            return unknown_name(b, &body->mark, "body", body->name, file->body, file->nbody,
                                sizeof *body);
        }
        file->body[at] = *body;
    }
    if ((code = merge(b, &frame, &file->nframe, variant->frame, variant->nframe,
                      sizeof *file->frame)) ||
        (code = merge(b, &ft, &file->nft, variant->ft, variant->nft, sizeof *file->ft))) {
        return code;
    }
    file->frame = frame;
    file->ft = ft;
    return ERROR_NONE;
}

static enum error_code choose_variant(struct builder *b, const char *name)
{
    const struct robot_yaml *file = &b->file;
    int at;

    if (!name || name[0] == '\0') {
        return ERROR_NONE;
    }
    if (file->nvariant == 0) {
        return error_set(b->error, ERROR_INPUT,
                         "%.200s: found no variants, expected one named \"%.63s\"", file->mark.file,
                         name);
    }
    at = find(file->variant, file->nvariant, sizeof *file->variant, name);
    if (at < 0) {
        const struct yaml_mark nowhere = {0};

        if (unknown_name(b, &nowhere, "variant", name, file->variant, file->nvariant,
                         sizeof *file->variant)) {
            return error_prefix(b->error, "%.200s", file->mark.file);
        }
    }
    return apply_variant(b, &file->variant[at]);
}

/* ---- bodies and joints ---- */

static enum error_code take_inertia(struct builder *b, const struct yaml_mark *mark, double mass,
                                    const double com[3], const double I[6],
                                    struct robot_inertia *inertia)
{
    struct error why;

    inertia->mass = mass;
    memcpy(inertia->com, com, sizeof inertia->com);
    memcpy(inertia->I, I, sizeof inertia->I);
    if (robot_check_inertia(inertia, &why)) {
        return yaml_error(b->error, mark, "%s", why.text);
    }
    return ERROR_NONE;
}

static enum error_code take_body(struct builder *b, int at, int parent, struct robot_body *body)
{
    const struct body_yaml *given = &b->file.body[at];

    body->name = given->name;
    body->parent = parent;
    return take_inertia(b, &given->inertia_mark, given->mass, given->com, given->I, &body->inertia);
}

/* The joint that moves the body of this name, or -1. */
static int mover(const struct robot_yaml *file, const char *body)
{
    for (size_t j = 0; j < file->njoint; j++) {
        if (strcmp(file->joint[j].child, body) == 0) {
            return (int)j;
        }
    }
    return -1;
}

/* The parent of joint j is a body that no joint before j moves: says why. */
static enum error_code bad_parent(struct builder *b, size_t j)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int up = mover(file, joint->parent);

    if (find(file->body, file->nbody, sizeof *file->body, joint->parent) < 0) {
        return unknown_name(b, &joint->parent_mark, "body", joint->parent, file->body, file->nbody,
                            sizeof *file->body);
    }
    if (up < 0) {
        return yaml_error(
            b->error, &joint->parent_mark,
            "found parent \"%s\", which no joint moves and which is not the base \"%s\"",
            joint->parent, file->base.body);
    }
    for (size_t step = 0; up >= 0 && step < file->njoint; step++) {
        if ((size_t)up == j) {
            return yaml_error(b->error, &joint->parent_mark,
                              "found a cycle: body \"%s\" hangs on \"%s\", which hangs on it, "
                              "expected a tree",
                              joint->child, joint->parent);
        }
        up = mover(file, file->joint[up].parent);
    }
    return yaml_error(b->error, &joint->parent_mark,
                      "found parent \"%s\" before joint \"%s\" that moves it (line %d), expected "
                      "parents first",
                      joint->parent, file->joint[mover(file, joint->parent)].name,
                      file->joint[mover(file, joint->parent)].mark.line);
}

static enum error_code check_child(struct builder *b, size_t j, int *at)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int first = mover(file, joint->child);

    *at = find(file->body, file->nbody, sizeof *file->body, joint->child);
    if (*at < 0) {
        return unknown_name(b, &joint->child_mark, "body", joint->child, file->body, file->nbody,
                            sizeof *file->body);
    }
    if (strcmp(joint->child, file->base.body) == 0) {
        return yaml_error(b->error, &joint->child_mark,
                          "found the base \"%s\" as a joint's child, expected a body that hangs on "
                          "another",
                          joint->child);
    }
    if ((size_t)first != j) {
        return yaml_error(b->error, &joint->child_mark,
                          "found body \"%s\" moved by a second joint, expected one (\"%s\" in line "
                          "%d moves it)",
                          joint->child, file->joint[first].name, file->joint[first].mark.line);
    }
    return ERROR_NONE;
}

static enum error_code take_axis(struct builder *b, const struct joint_yaml *given,
                                 struct robot_joint *joint)
{
    double length = sqrt(vec3_dot(given->axis, given->axis));

    if (!(fabs(length - 1.0) <= AXIS_TOLERANCE)) {
        return yaml_error(b->error, &given->axis_mark,
                          "found an axis of length %.9g, expected a unit vector", length);
    }
    for (int m = 0; m < 3; m++) {
        joint->axis[m] = given->axis[m] / length;
    }
    return ERROR_NONE;
}

static enum error_code take_limits(struct builder *b, const struct joint_yaml *given,
                                   struct robot_joint *joint)
{
    const struct limits_yaml *limits = &given->limits;
    bool revolute = given->type == JOINT_REVOLUTE;
    const bool *wanted = revolute ? limits->angular : limits->linear;
    const bool *other = revolute ? limits->linear : limits->angular;

    if (!wanted[0] || !wanted[1] || !wanted[2] || other[0] || other[1] || other[2]) {
        return yaml_error(
            b->error, &limits->mark, "found limits of %s joint \"%s\", expected the keys %s",
            revolute ? "revolute" : "prismatic", given->name,
            revolute ? "lower_rad, upper_rad, torque_nm" : "lower_m, upper_m, force_n");
    }
    joint->lower = revolute ? limits->lower_rad : limits->lower_m;
    joint->upper = revolute ? limits->upper_rad : limits->upper_m;
    joint->torque_limit = revolute ? limits->torque_nm : limits->force_n;
    if (!(joint->lower < joint->upper)) {
        return yaml_error(b->error, &limits->mark,
                          "found lower limit %g not below upper limit %g of joint \"%s\"",
                          joint->lower, joint->upper, given->name);
    }
    return ERROR_NONE;
}

static enum error_code take_drive(struct builder *b, const struct joint_yaml *given,
                                  struct robot_sea *sea)
{
    double value[DRIVE_VALUES];

    if (!given->has_drive) {
        return ERROR_NONE;
    }
    if (given->type != JOINT_REVOLUTE) {
        return yaml_error(b->error, &given->drive.mark,
                          "found a drive on prismatic joint \"%s\", expected none: series elastic "
                          "drives turn",
                          given->name);
    }
    for (size_t i = 0; i < DRIVE_VALUES; i++) {
        const struct drive_yaml *from = given->drive.given[i] ? &given->drive : &b->file.drive;

        if (!from->given[i]) {
            return yaml_error(
                b->error, &given->drive.mark,
                "found the drive of joint \"%s\" without key \"%s\", expected it here "
                "or in the robot's own drive",
                given->name, drive_fields[i].key);
        }
        value[i] = from->value[i];
    }
    *sea = (struct robot_sea){.present = true,
                              .J = value[0],
                              .Dm = value[1],
                              .Ks = value[2],
                              .Ds = value[3],
                              .N = value[4],
                              .Kt = value[5],
                              .Kw = value[6],
                              .R = value[7],
                              .L = value[8]};
    return ERROR_NONE;
}

static enum error_code take_spring(struct builder *b, const struct joint_yaml *given,
                                   struct robot_parallel_spring *spring)
{
    const struct spring_yaml *from = &given->spring;

    if (!given->has_spring) {
        return ERROR_NONE;
    }
    if (given->type != JOINT_REVOLUTE) {
        return yaml_error(b->error, &from->mark,
                          "found a parallel spring on prismatic joint \"%s\", expected none: its "
                          "rope runs over a pulley",
                          given->name);
    }
    if (from->s == 0) {
        return yaml_error(b->error, &from->s_mark, "found sense 0, expected 1 or -1");
    }
    *spring = (struct robot_parallel_spring){.present = true,
                                             .enabled = from->enabled,
                                             .k_p = from->k_p,
                                             .d_p = from->d_p,
                                             .r = from->r,
                                             .s = (double)from->s};
    return ERROR_NONE;
}

static enum error_code take_joint(struct builder *b, size_t j)
{
    const struct joint_yaml *given = &b->file.joint[j];
    struct robot *robot = b->robot;
    struct robot_joint *joint = &robot->joint[j];
    enum error_code code;
    int at, parent;

    /* bodies of earlier joints are named already: the parent is one of them or the base */
    robot->nbody = j + 1;
    if ((code = check_child(b, j, &at))) {
        return code;
    }
    parent = robot_find_body(robot, given->parent);
    if (parent < 0) {
        return bad_parent(b, j);
    }
    joint->name = given->name;
    joint->type = given->type;
    joint->paper_index = (int)given->paper_index;
    memcpy(joint->origin, given->origin.xyz, sizeof joint->origin);
    mat3_from_rpy(given->origin.rpy, joint->rotation);
    if ((code = take_axis(b, given, joint)) || (code = take_limits(b, given, joint)) ||
        (code = take_drive(b, given, &joint->sea)) ||
        (code = take_spring(b, given, &joint->spring))) {
        return code;
    }
    return take_body(b, at, parent, &robot->body[j + 1]);
}

/* Bodies in the order of the joints that move them. */
static enum error_code take_tree(struct builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code;
    int base = find(file->body, file->nbody, sizeof *file->body, file->base.body);

    robot->body = arena_alloc(b->arena, file->njoint + 1, sizeof *robot->body);
    robot->joint = arena_alloc(b->arena, file->njoint, sizeof *robot->joint);
    if (!robot->body || !robot->joint) {
        return no_memory(b);
    }
    if (base < 0) {
        return unknown_name(b, &file->base.body_mark, "body", file->base.body, file->body,
                            file->nbody, sizeof *file->body);
    }
    if ((code = take_body(b, base, -1, &robot->body[0]))) {
        return code;
    }
    for (size_t j = 0; j < file->njoint; j++) {
        if ((code = take_joint(b, j))) {
            return code;
        }
    }
    for (size_t i = 0; i < file->nbody; i++) {
        if ((int)i != base && mover(file, file->body[i].name) < 0) {
            return yaml_error(b->error, &file->body[i].mark,
                              "found body \"%s\" that no joint moves, expected it to be a joint's "
                              "child or the base",
                              file->body[i].name);
        }
    }
    robot->njoint = file->njoint;
    robot->nbody = file->njoint + 1;
    return ERROR_NONE;
}

/* ---- frames, sensors, poses ---- */

static enum error_code take_frames(struct builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;

    robot->frame = arena_alloc(b->arena, file->nframe, sizeof *robot->frame);
    if (!robot->frame) {
        return no_memory(b);
    }
    for (size_t i = 0; i < file->nframe; i++) {
        const struct frame_yaml *given = &file->frame[i];
        struct robot_frame *frame = &robot->frame[i];

        frame->name = given->name;
        frame->body = robot_find_body(robot, given->body);
        if (frame->body < 0) {
            return unknown_name(b, &given->body_mark, "body", given->body, file->body, file->nbody,
                                sizeof *file->body);
        }
        memcpy(frame->position, given->xyz, sizeof frame->position);
        mat3_from_rpy(given->rpy, frame->rotation);
    }
    robot->nframe = file->nframe;
    return ERROR_NONE;
}

static enum error_code take_frame_name(struct builder *b, const char *name,
                                       const struct yaml_mark *mark, int *frame)
{
    *frame = robot_find_frame(b->robot, name);
    if (*frame < 0) {
        return unknown_name(b, mark, "frame", name, b->file.frame, b->file.nframe,
                            sizeof *b->file.frame);
    }
    return ERROR_NONE;
}

static enum error_code take_sensors(struct builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code;

    robot->ft = arena_alloc(b->arena, file->nft, sizeof *robot->ft);
    if (!robot->ft) {
        return no_memory(b);
    }
    for (size_t i = 0; i < file->nft; i++) {
        const struct ft_yaml *given = &file->ft[i];
        const struct inertia_yaml *distal = &given->distal;

        robot->ft[i].name = given->name;
        if ((code = take_frame_name(b, given->frame, &given->frame_mark, &robot->ft[i].frame)) ||
            (code = take_inertia(b, &distal->mark, distal->mass, distal->com, distal->I,
                                 &robot->ft[i].distal))) {
            return code;
        }
    }
    robot->nft = file->nft;
    robot->imu_frame = -1;
    if (file->has_imu) {
        return take_frame_name(b, file->imu.frame, &file->imu.frame_mark, &robot->imu_frame);
    }
    return ERROR_NONE;
}

/* Positions of the joints of one type. */
static enum error_code take_positions(struct builder *b, enum joint_type type,
                                      const struct yaml_real_entry *entry, size_t count,
                                      double *position)
{
    for (size_t i = 0; i < count; i++) {
        int j = robot_find_joint(b->robot, entry[i].name);
        const struct robot_joint *joint;

        if (j < 0) {
            return unknown_name(b, &entry[i].mark, "joint", entry[i].name, b->file.joint,
                                b->file.njoint, sizeof *b->file.joint);
        }
        joint = &b->robot->joint[j];
        if (joint->type != type) {
            return yaml_error(b->error, &entry[i].mark, "found %s joint \"%s\", expected it in %s",
                              type == JOINT_REVOLUTE ? "prismatic" : "revolute", joint->name,
                              type == JOINT_REVOLUTE ? "joints_m" : "joints_rad");
        }
        if (entry[i].value < joint->lower || entry[i].value > joint->upper) {
            return yaml_error(b->error, &entry[i].mark,
                              "found joint \"%s\" at %g, expected %g to %g (its limits)",
                              joint->name, entry[i].value, joint->lower, joint->upper);
        }
        position[j] = entry[i].value;
    }
    return ERROR_NONE;
}

static bool is_given(const struct pose_yaml *pose, const char *joint)
{
    for (size_t i = 0; i < pose->njoint_rad; i++) {
        if (strcmp(pose->joint_rad[i].name, joint) == 0) {
            return true;
        }
    }
    for (size_t i = 0; i < pose->njoint_m; i++) {
        if (strcmp(pose->joint_m[i].name, joint) == 0) {
            return true;
        }
    }
    return false;
}

/* Joints that a pose does not name stand at zero, if they can. */
static enum error_code check_rest(struct builder *b, const struct pose_yaml *given)
{
    for (size_t j = 0; j < b->robot->njoint; j++) {
        const struct robot_joint *joint = &b->robot->joint[j];

        if ((joint->lower > 0.0 || joint->upper < 0.0) && !is_given(given, joint->name)) {
            return yaml_error(
                b->error, &given->mark,
                "found pose \"%s\" without joint \"%s\", expected it: its limits %g to "
                "%g exclude zero",
                given->name, joint->name, joint->lower, joint->upper);
        }
    }
    return ERROR_NONE;
}

/* Quaternion wxyz of Rz(yaw) Ry(pitch) Rx(roll). */
static void quaternion_from_rpy(const double rpy[3], double quaternion[4])
{
    double cr = cos(0.5 * rpy[0]), sr = sin(0.5 * rpy[0]);
    double cp = cos(0.5 * rpy[1]), sp = sin(0.5 * rpy[1]);
    double cy = cos(0.5 * rpy[2]), sy = sin(0.5 * rpy[2]);

    quaternion[0] = cr * cp * cy + sr * sp * sy;
    quaternion[1] = sr * cp * cy - cr * sp * sy;
    quaternion[2] = cr * sp * cy + sr * cp * sy;
    quaternion[3] = cr * cp * sy - sr * sp * cy;
}

static enum error_code take_pose(struct builder *b, const struct pose_yaml *given,
                                 struct robot_pose *pose)
{
    double *position = arena_alloc(b->arena, b->robot->njoint, sizeof *position);
    enum error_code code;

    if (!position) {
        return no_memory(b);
    }
    if (given->has_xyz != b->robot->floating || (given->has_rpy && !b->robot->floating)) {
        return yaml_error(b->error, &given->mark, "found pose \"%s\" %s, expected %s", given->name,
                          b->robot->floating ? "without key \"base_xyz_m\"" : "with a base",
                          b->robot->floating ? "it: the base floats" : "none: the base is fixed");
    }
    pose->name = given->name;
    memcpy(pose->base_position, given->base_xyz, sizeof pose->base_position);
    quaternion_from_rpy(given->base_rpy, pose->base_quaternion);
    pose->joint = position;
    if ((code = take_positions(b, JOINT_REVOLUTE, given->joint_rad, given->njoint_rad, position)) ||
        (code = take_positions(b, JOINT_PRISMATIC, given->joint_m, given->njoint_m, position))) {
        return code;
    }
    return check_rest(b, given);
}

static enum error_code take_poses(struct builder *b)
{
    struct robot *robot = b->robot;

    robot->pose = arena_alloc(b->arena, b->file.npose, sizeof *robot->pose);
    if (!robot->pose) {
        return no_memory(b);
    }
    for (size_t i = 0; i < b->file.npose; i++) {
        enum error_code code = take_pose(b, &b->file.pose[i], &robot->pose[i]);

        if (code) {
            return code;
        }
    }
    robot->npose = b->file.npose;
    return ERROR_NONE;
}

enum error_code robot_load(const char *path, const char *variant, struct arena *arena,
                           const struct robot **robot, struct error *error)
{
    struct builder b = {.arena = arena, .error = error};
    enum error_code code = yaml_read_file(path, &robot_schema, arena, &b.file, error);

    if (code) {
        return code;
    }
    b.robot = arena_alloc(arena, 1, sizeof *b.robot);
    if (!b.robot) {
        return no_memory(&b);
    }
    b.robot->name = b.file.name;
    b.robot->file = b.file.mark.file;
    b.robot->floating = b.file.base.floating;
    memcpy(b.robot->gravity, b.file.gravity, sizeof b.robot->gravity);
    if ((code = check_all_names(&b)) || (code = choose_variant(&b, variant)) ||
        (code = take_tree(&b)) || (code = take_frames(&b)) || (code = take_sensors(&b)) ||
        (code = take_poses(&b))) {
        return code;
    }
    if (robot_finish(b.robot, error)) {
        return error_prefix(error, "%.200s", b.file.mark.file);
    }
    *robot = b.robot;
    return ERROR_NONE;
}
