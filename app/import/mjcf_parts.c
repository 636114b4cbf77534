/* SPDX-License-Identifier: Apache-2.0 */
/* Indexes default classes, meshes and materials. Reads places, actuators, couplings and
 * keyframes. */
#include "app/import/readers_private.h"

#include "base/portable_math.h"
#include "base/vec3.h"

#include <ctype.h>
#include <math.h>
#include <string.h>

enum { MJCF_DEFAULTS_MAX = 2048, MJCF_CLASSES_DEEP = 32 };

/* ---- default classes ---- */

/* Adds a class and its inner classes. The outermost class may have no name, and is then called
 * "main". */
static void mjcf_add_classes(struct import_reader *r, const xmlNode *node, const char *above)
{
    const char *own = xml_attribute(node, "class");

    own = own ? own : "main";
    xml_names_add(&r->classes, own, above, node, r->arena, r->error);
    for (const xmlNode *child = xml_child(node, "default"); child;
         child = xml_next(child, "default")) {
        mjcf_add_classes(r, child, own);
    }
}

/* Lists a mesh by its name. The default name is the file name up to the last ".". */
static void mjcf_add_mesh(struct import_reader *r, const xmlNode *mesh)
{
    const char *name = xml_attribute(mesh, "name"), *file = xml_attribute(mesh, "file");
    const char *slash = file ? strrchr(file, '/') : NULL;

    if (!name && file) {
        const char *own = slash ? slash + 1 : file, *dot = strrchr(own, '.');
        const size_t length = dot ? (size_t)(dot - own) : strlen(own);
        char *base = reader_alloc(r, length + 1, 1);

        name = base ? memcpy(base, own, length) : NULL;
    }
    if (name && file) {
        xml_names_add(&r->meshes, name, NULL, mesh, r->arena, r->error);
    }
}

void mjcf_index(struct import_reader *r)
{
    size_t count = 0;

    for (const xmlNode *top = xml_child(r->file->root, "default"); top && !r->error->code;
         top = xml_next(top, "default")) {
        count += xml_count(top, NULL);
        if (count > MJCF_DEFAULTS_MAX) {
            xml_refuse(r->file, top, "found %zu elements of default classes, expected at most %d",
                       count, MJCF_DEFAULTS_MAX);
        } else {
            mjcf_add_classes(r, top, NULL);
        }
    }
    for (const xmlNode *at = mjcf_next(r, "asset", NULL, NULL); at;
         at = mjcf_next(r, "asset", NULL, at)) {
        if (xml_is(at, "mesh")) {
            mjcf_add_mesh(r, at);
        } else if (xml_is(at, "material") && xml_attribute(at, "name")) {
            xml_names_add(&r->materials, xml_attribute(at, "name"), NULL, at, r->arena, r->error);
        }
    }
    xml_names_sort(&r->classes);
    xml_names_sort(&r->meshes);
    xml_names_sort(&r->materials);
}

const char *mjcf_attribute(const struct import_reader *r, const xmlNode *node,
                           const char *childclass, const char *name)
{
    const struct xml_name *end = r->classes.entry + r->classes.count;
    const char *text = xml_attribute(node, name), *own = xml_attribute(node, "class");

    own = own ? own : childclass ? childclass : "main";
    for (int depth = 0; !text && own && depth < MJCF_CLASSES_DEEP; depth++) {
        const struct xml_name *class = xml_names_find(&r->classes, own, NULL);

        /* Several elements may define a class; the last one that has the attribute counts */
        for (const struct xml_name *at = class; class && at < end && !strcmp(at->name, own); at++) {
            const xmlNode *element = xml_child(at->node, (const char *)node->name);
            const char *found = element ? xml_attribute(element, name) : NULL;

            text = found ? found : text;
        }
        own = class ? class->above : NULL;
    }
    return text;
}

bool mjcf_reals(const struct import_reader *r, const xmlNode *node, const char *childclass,
                const char *name, size_t count, double *value)
{
    const char *text = mjcf_attribute(r, node, childclass, name);

    if (text) {
        xml_parse_reals(r->file, node, name, text, count, value);
    }
    return text != NULL;
}

void mjcf_some_reals(const struct import_reader *r, const xmlNode *node, const char *childclass,
                     const char *name, size_t most, double *value)
{
    const char *text = mjcf_attribute(r, node, childclass, name);
    size_t count = 0;

    for (const char *at = text; at && *at;) {
        at += strspn(at, " \t\r\n");
        count += *at != '\0';
        at += strcspn(at, " \t\r\n");
    }
    if (text) {
        count = count < 1 ? 1 : count > most ? most : count;
        xml_parse_reals(r->file, node, name, text, count, value);
    }
}

/* ---- places ---- */

/* Rotates R about one axis of the sequence. Small letters mean rotated axes, capital letters mean
 * fixed axes, as in MuJoCo. */
static void euler_turn(char letter, double angle, double R[9])
{
    const double axis[3] = {tolower(letter) == 'x', tolower(letter) == 'y', tolower(letter) == 'z'};
    double turn[9], product[9];

    mat3_about_axis(axis, angle, turn);
    if (isupper((unsigned char)letter)) {
        mat3_mul(turn, R, product);
    } else {
        mat3_mul(R, turn, product);
    }
    memcpy(R, product, sizeof product);
}

/* Computes a rotation whose first columns are two axes. The second axis is made orthogonal to the
 * first. Returns false if they are parallel. */
static bool axes_to_rotation(const double axes[6], double R[9])
{
    double x[3], y[3], z[3], length = vec3_norm(axes);

    for (int m = 0; m < 3; m++) {
        x[m] = axes[m] / length;
    }
    vec3_add_scaled(axes + 3, -vec3_dot(axes + 3, x), x, y);
    length = vec3_norm(y);
    for (int m = 0; m < 3; m++) {
        y[m] /= length;
    }
    vec3_cross(x, y, z);
    for (int m = 0; m < 3; m++) {
        R[3 * m] = x[m];
        R[3 * m + 1] = y[m];
        R[3 * m + 2] = z[m];
    }
    return isfinite(R[0] + R[4] + R[8]);
}

bool mjcf_z_to_rotation(const double z[3], double R[9])
{
    const double across = hypot(z[0], z[1]), least = 1e-10 * vec3_norm(z);
    const double axis[3] = {across > least ? -z[1] / across : 1.0,
                            across > least ? z[0] / across : 0.0, 0.0};

    mat3_about_axis(axis, portable_atan2(across, z[2]), R);
    return least > 0.0;
}

void mjcf_read_place(const struct import_reader *r, const xmlNode *node, const char *childclass,
                     struct import_place *place)
{
    double value[6];
    bool sound = true;

    /* Use the first attribute that is given, as MuJoCo does; refuse values that are not
     * rotations */
    import_place_identity(place);
    mjcf_reals(r, node, childclass, "pos", 3, place->xyz);
    if (mjcf_reals(r, node, childclass, "quat", 4, value)) {
        mat3_from_quaternion(value, place->R);
        sound = isfinite(place->R[0]);
    } else if (mjcf_reals(r, node, childclass, "axisangle", 4, value)) {
        double length = vec3_norm(value);
        const double axis[3] = {value[0] / length, value[1] / length, value[2] / length};

        mat3_about_axis(axis, value[3] * r->angle, place->R);
        sound = length > 0;
    } else if (mjcf_reals(r, node, childclass, "euler", 3, value)) {
        for (int i = 0; i < 3; i++) {
            euler_turn(r->eulerseq[i], value[i] * r->angle, place->R);
        }
    } else if (mjcf_reals(r, node, childclass, "xyaxes", 6, value)) {
        sound = axes_to_rotation(value, place->R);
    } else if (mjcf_reals(r, node, childclass, "zaxis", 3, value)) {
        sound = mjcf_z_to_rotation(value, place->R);
    }
    if (!sound) {
        xml_refuse(r->file, node,
                   "found an orientation of <%.40s>, expected a quat, axisangle, euler, xyaxes or "
                   "zaxis that is a rotation",
                   (const char *)node->name);
    }
}

/* ---- actuators and poses ---- */

/* Returns the larger magnitude of an actuator's range; 0 = no limit. */
static double actuator_limit(const struct import_reader *r, const xmlNode *node, const char *range,
                             const char *limited)
{
    const char *word = mjcf_attribute(r, node, NULL, limited);
    double value[2] = {0, 0};
    const bool given = mjcf_reals(r, node, NULL, range, 2, value);

    if (word && strcmp(word, "auto") != 0 ? strcmp(word, "true") != 0 : !given || !r->autolimits) {
        return 0.0;
    }
    return fmax(fabs(value[0]), fabs(value[1]));
}

void mjcf_read_actuators(const struct import_reader *r)
{
    struct import_model *model = r->model;
    double *sum = reader_alloc(r, model->njoint + 1, sizeof *sum);

    for (const xmlNode *node = mjcf_next(r, "actuator", NULL, NULL); node && sum;
         node = mjcf_next(r, "actuator", NULL, node)) {
        const char *name = xml_attribute(node, "joint");
        int joint = name ? import_find_joint(model, name) : -1;
        double gear[6] = {1}, most;

        if (joint < 0) {
            model->drives_others = true;
            reader_note(r, IMPORT_DROPPED, node, "actuator <%.40s>: it drives no joint",
                        (const char *)node->name);
            continue;
        }

        /* The gear converts the actuator's force to the joint's force; for a motor, control is
         * force */
        mjcf_some_reals(r, node, NULL, "gear", 6, gear);
        most = actuator_limit(r, node, "forcerange", "forcelimited");
        if (most == 0.0 && xml_is(node, "motor")) {
            most = actuator_limit(r, node, "ctrlrange", "ctrllimited");
        }
        if (model->joint[joint].driven) {
            reader_note(r, IMPORT_CHANGED, node,
                        "joint \"%.63s\" has several actuators: one drive has the sum of their "
                        "limits",
                        name);
        }

        /* Forces of several actuators add up; if one has no limit, the sum has none */
        model->joint[joint].driven = true;
        sum[joint] += most > 0.0 ? most * fabs(gear[0]) : (double)INFINITY;
    }
    for (size_t j = 0; j < model->njoint && sum; j++) {
        struct import_joint *joint = &model->joint[j];

        if (sum[j] > 0.0 && isfinite(sum[j])) {
            joint->effort = joint->effort > 0.0 ? fmin(joint->effort, sum[j]) : sum[j];
        }
        model->actuated = model->actuated || joint->driven;
    }
}

/* Returns the joint in an attribute of an equality; NULL if the attribute is missing. */
static struct import_joint *mjcf_find_coupled(const struct import_reader *r, const xmlNode *node,
                                              const char *attribute)
{
    const char *name = xml_attribute(node, attribute);
    const int joint = name ? import_find_joint(r->model, name) : -1;

    if (name && joint < 0) {
        xml_refuse(r->file, node, "found %s \"%.63s\" of an equality, expected a joint", attribute,
                   name);
    }
    return joint < 0 ? NULL : &r->model->joint[joint];
}

/* Makes a joint follow another one, as in the file. Swaps the roles if the first joint is driven or
 * already a follower, and the polynomial is linear. */
static void mjcf_couple(const struct import_reader *r, const xmlNode *node,
                        struct import_joint *follower, struct import_joint *leader,
                        const double polynomial[5])
{
    const bool bends = polynomial[2] != 0.0 || polynomial[3] != 0.0 || polynomial[4] != 0.0;
    double multiplier = polynomial[1], offset = polynomial[0];

    /* Swap the roles: y = a + b x becomes x = -a/b + y/b */
    if (!bends && multiplier != 0.0 && !leader->mimic && !leader->driven &&
        (follower->driven || follower->mimic)) {
        struct import_joint *other = follower;

        follower = leader;
        leader = other;
        offset = -offset / multiplier;
        multiplier = 1.0 / multiplier;
    }

    /* A joint may follow only one other joint */
    if (follower->mimic) {
        xml_refuse(r->file, node,
                   "found joint \"%.63s\" of an equality, which follows \"%.63s\" already (line "
                   "%d), expected one equality for each joint that follows",
                   follower->name, follower->mimic, follower->mimic_line);
    }
    follower->mimic = leader->name;
    follower->mimic_file = mjcf_file(r, node);
    follower->mimic_line = xml_line(node);
    follower->offset = offset;
    follower->multiplier = multiplier;
    follower->bends = bends;
}

void mjcf_read_couplings(const struct import_reader *r)
{
    for (const xmlNode *node = mjcf_next(r, "equality", "joint", NULL); node;
         node = mjcf_next(r, "equality", "joint", node)) {
        struct import_joint *first, *second;
        double polynomial[5] = {0, 1, 0, 0, 0};

        if (!strcmp(reader_text(node, "active"), "false")) {
            reader_note(r, IMPORT_DROPPED, node, "equality <joint>: it is not active");
            continue;
        }
        first = mjcf_find_coupled(r, node, "joint1");
        second = mjcf_find_coupled(r, node, "joint2");
        mjcf_some_reals(r, node, NULL, "polycoef", 5, polynomial);
        if (!first) {
            xml_refuse(r->file, node, "found an equality without joint1, expected it");
        } else if (second) {
            mjcf_couple(r, node, first, second, polynomial);
        } else {
            /* Without a second joint, the first joint is fixed at the constant: an empty range */
            first->type = first->type == IMPORT_CONTINUOUS ? IMPORT_REVOLUTE : first->type;
            first->has_limit = true;
            first->lower = first->upper = polynomial[0];
        }
    }
}

/* Reads a keyframe: the positions of all joints from MuJoCo's qpos, relative to ref. */
static void mjcf_read_key(const struct import_reader *r, const xmlNode *node)
{
    struct import_model *model = r->model;
    struct import_pose *pose = &model->pose[model->npose++];
    const char *name = reader_text(node, "name"), *text = xml_attribute(node, "qpos");
    double *qpos = reader_alloc(r, (size_t)r->qpos_count + 1, sizeof *qpos);

    *pose = (struct import_pose){.name = reader_copy(r, *name ? name : "key"),
                                 .file = mjcf_file(r, node),
                                 .line = xml_line(node),
                                 .value = reader_alloc(r, model->njoint + 1, sizeof *pose->value)};
    if (!text || !qpos || !pose->value) {
        return;
    }

    /* Fixed joints have no coordinate; the seven coordinates of the free joint belong to the
     * base */
    xml_parse_reals(r->file, node, "qpos", text, (size_t)r->qpos_count, qpos);
    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];

        if (joint->type != IMPORT_FIXED && joint->type != IMPORT_FLOATING) {
            pose->value[pose->nvalue++] = (struct import_value){
                .joint = joint->name, .line = pose->line, .value = qpos[r->qpos[j]] - r->ref[j]};
        }
    }
}

void mjcf_read_keys(const struct import_reader *r)
{
    const xmlNode *first = mjcf_next(r, "keyframe", "key", NULL);
    size_t count = 0;

    for (const xmlNode *key = first; key; key = mjcf_next(r, "keyframe", "key", key)) {
        count++;
    }
    if (count > 64) {
        xml_refuse(r->file, first, "found %zu keyframes, expected at most 64", count);
    }
    r->model->pose = reader_alloc(r, count + 1, sizeof *r->model->pose);
    for (const xmlNode *key = first; key && !r->error->code;
         key = mjcf_next(r, "keyframe", "key", key)) {
        mjcf_read_key(r, key);
    }
}
