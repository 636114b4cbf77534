/* SPDX-License-Identifier: Apache-2.0 */
/* Indexes default classes, meshes and materials. Reads places, actuators, couplings and
 * keyframes. */
#include "app/import/readers_private.h"

#include "base/array.h"
#include "base/vec3.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MJCF_DEFAULTS_MAX = 2048, MJCF_CLASSES_DEEP = 32, MJCF_FRAMES_DEEP = 16 };

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
            /* The default name is the file name up to the last "." */
            const char *name = xml_attribute(at, "name"), *file = xml_attribute(at, "file");
            const char *slash = file ? strrchr(file, '/') : NULL;

            if (!name && file) {
                const char *own = slash ? slash + 1 : file, *dot = strrchr(own, '.');

                name = reader_format(r, "%.*s", (int)(dot ? dot - own : (long)strlen(own)), own);
            }
            if (name && file) {
                xml_names_add(&r->meshes, name, NULL, at, r->arena, r->error);
            }
        } else if (xml_is(at, "material") && xml_attribute(at, "name")) {
            xml_names_add(&r->materials, xml_attribute(at, "name"), NULL, at, r->arena, r->error);
        }
    }
    xml_names_sort(&r->classes);
    xml_names_sort(&r->meshes);
    xml_names_sort(&r->materials);
}

/* Returns an attribute of a class for elements like node; NULL if the class does not have it. All
 * kinds of actuators share their defaults, and all equalities. Each kind of actuator implies a
 * bias. */
static const char *class_attribute(const xmlNode *class, const xmlNode *node, const char *name)
{
    static const char *const kinds[] = {"general",     "motor",  "position", "velocity",
                                        "intvelocity", "damper", "cylinder", "muscle",
                                        "adhesion",    NULL};
    const bool actuator = xml_is(node->parent, "actuator");
    const char *element = xml_is(node->parent, "equality") ? "equality" : (const char *)node->name;
    const char *text = NULL;

    for (const xmlNode *at = xml_child(class, NULL); at; at = xml_next(at, NULL)) {
        if (actuator ? reader_is_one_of(at, kinds) : xml_is(at, element)) {
            const char *found = xml_attribute(at, name);

            if (!found && actuator && !strcmp(name, "biastype") && !xml_is(at, "general")) {
                found = xml_is(at, "motor") ? "none" : "affine";
            }
            text = found && *found ? found : text;
        }
    }
    return text;
}

const char *mjcf_attribute(const struct import_reader *r, const xmlNode *node, const char *name)
{
    const struct xml_name *end = r->classes.entry + r->classes.count;
    const char *text = xml_attribute(node, name), *own = xml_attribute(node, "class");

    /* An attribute without a value counts as missing */
    text = text && *text ? text : NULL;
    for (const xmlNode *up = node->parent;
         !text && !own && (xml_is(up, "body") || xml_is(up, "frame")); up = up->parent) {
        own = xml_attribute(up, "childclass");
    }
    own = own ? own : "main";
    for (int depth = 0; !text && own && depth < MJCF_CLASSES_DEEP; depth++) {
        const struct xml_name *class = xml_names_find(&r->classes, own, NULL);

        /* Several elements may define a class; the last one that has the attribute counts */
        for (const struct xml_name *at = class; class && at < end && !strcmp(at->name, own); at++) {
            const char *found = class_attribute(at->node, node, name);

            text = found ? found : text;
        }
        own = class ? class->above : NULL;
    }
    return text;
}

bool mjcf_reals(const struct import_reader *r, const xmlNode *node, const char *name, size_t count,
                double *value)
{
    const char *text = mjcf_attribute(r, node, name);

    if (text) {
        xml_parse_reals(r->file, node, name, text, count, value);
    }
    return text != NULL;
}

void mjcf_some_reals(const struct import_reader *r, const xmlNode *node, const char *name,
                     size_t most, double *value)
{
    const char *text = mjcf_attribute(r, node, name);
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

bool mjcf_read_frame(const struct import_reader *r, const xmlNode *node, struct import_place *place)
{
    /* MuJoCo does not move <inertial> with a frame */
    const bool framed = xml_is(node->parent, "frame") && !xml_is(node, "inertial");
    int depth = 0;

    for (const xmlNode *up = node->parent; framed && xml_is(up, "frame"); up = up->parent) {
        depth++;
    }
    if (depth > MJCF_FRAMES_DEEP) {
        xml_refuse(r->file, node, "found frames more than %d deep, expected fewer",
                   MJCF_FRAMES_DEEP);
        import_place_identity(place);
    } else if (framed) {
        mjcf_read_place(r, node->parent, place);
    }
    return framed;
}

/* Reads an orientation other than quat. One of the element replaces the others of its class. */
static bool place_reals(const struct import_reader *r, const xmlNode *node, const char *name,
                        size_t count, double *value)
{
    static const char *const ways[] = {"axisangle", "euler", "xyaxes", "zaxis"};
    bool other = false;

    for (size_t i = 0; i < ARRAY_COUNT(ways); i++) {
        other = other || (strcmp(ways[i], name) != 0 && xml_attribute(node, ways[i]));
    }
    return (!other || xml_attribute(node, name)) && mjcf_reals(r, node, name, count, value);
}

void mjcf_read_place(const struct import_reader *r, const xmlNode *node, struct import_place *place)
{
    struct import_place frame, own;
    double value[6], along[3];
    bool sound = true;

    /* Any other way of turning replaces quat, which may be a class's, as in MuJoCo; refuse values
     * that are not rotations */
    import_place_identity(place);
    mjcf_reals(r, node, "pos", 3, place->xyz);
    if (mjcf_reals(r, node, "fromto", 6, value)) {
        /* The place is halfway between the ends, with z from one end to the other */
        vec3_sub(value, value + 3, along);
        for (int m = 0; m < 3; m++) {
            place->xyz[m] = 0.5 * (value[m] + value[3 + m]);
        }
        sound = import_turn_z(along, place->R);
    } else if (place_reals(r, node, "axisangle", 4, value)) {
        double length = vec3_norm(value);
        const double axis[3] = {value[0] / length, value[1] / length, value[2] / length};

        mat3_about_axis(axis, value[3] * r->angle, place->R);
        sound = length > 0;
    } else if (place_reals(r, node, "euler", 3, value)) {
        for (int i = 0; i < 3; i++) {
            euler_turn(r->eulerseq[i], value[i] * r->angle, place->R);
        }
    } else if (place_reals(r, node, "xyaxes", 6, value)) {
        sound = axes_to_rotation(value, place->R);
    } else if (place_reals(r, node, "zaxis", 3, value)) {
        sound = import_turn_z(value, place->R);
    } else if (mjcf_reals(r, node, "quat", 4, value)) {
        mat3_from_quaternion(value, place->R);
        sound = isfinite(place->R[0]);
    }
    if (!sound) {
        xml_refuse(r->file, node,
                   "found an orientation of <%.40s>, expected a quat, axisangle, euler, xyaxes, "
                   "zaxis or fromto that is a rotation, and no fromto of length 0",
                   (const char *)node->name);
    }
    if (mjcf_read_frame(r, node, &frame)) {
        own = *place;
        import_place_compose(&frame, &own, place);
    }
}

/* ---- actuators and poses ---- */

bool mjcf_clamp(const struct import_reader *r, const xmlNode *node, const char *what, double scale,
                double limit[2])
{
    char range[32], limited[32];
    double value[2] = {0, 0}, low, high;
    const char *word;
    bool given;

    snprintf(range, sizeof range, "%srange", what);
    snprintf(limited, sizeof limited, "%slimited", what);
    given = mjcf_reals(r, node, range, 2, value);
    word = mjcf_attribute(r, node, limited);
    if (word && strcmp(word, "auto") != 0 ? strcmp(word, "true") != 0
                                          : !given || !r->autolimits || !(value[0] < value[1])) {
        return false;
    }
    low = fmin(scale * value[0], scale * value[1]);
    high = fmax(scale * value[0], scale * value[1]);
    limit[0] = fmin(fmax(limit[0], low), high);
    limit[1] = fmin(fmax(limit[1], low), high);
    return true;
}

/* Finds the range of an actuator's force. If the force is a gain times the control or the
 * activation, the range of the control or activation limits the force. forcerange limits the force
 * of any actuator. */
static void actuator_find_range(const struct import_reader *r, const xmlNode *node, double range[2])
{
    const bool general = xml_is(node, "general");
    const char *bias = general ? mjcf_attribute(r, node, "biastype") : NULL;
    const char *gain = general ? mjcf_attribute(r, node, "gaintype") : NULL;
    const char *type = general ? mjcf_attribute(r, node, "dyntype") : NULL;
    double prm[10] = {1.0};

    range[0] = -(double)INFINITY;
    range[1] = (double)INFINITY;
    if (general) {
        mjcf_some_reals(r, node, "gainprm", 10, prm);
    }
    if ((general || xml_is(node, "motor")) && (!bias || !strcmp(bias, "none")) &&
        (!gain || !strcmp(gain, "fixed"))) {
        if (type && !strcmp(type, "integrator")) {
            mjcf_clamp(r, node, "act", prm[0], range);
        } else if (!type || !strcmp(type, "none") || !strncmp(type, "filter", 6)) {
            mjcf_clamp(r, node, "ctrl", prm[0], range);
        }
    }
    mjcf_clamp(r, node, "force", 1.0, range);
}

/* Adds an actuator to a joint. The gear converts the actuator's force to the joint's force. Forces
 * of several actuators add up; if one has no limit, the sum has none. Returns false if the joint
 * cannot have a drive. */
static bool actuator_add(const struct import_reader *r, const xmlNode *node, const char *name,
                         double coefficient, double (*sum)[2])
{
    const int at = import_find_joint(r->model, name);
    struct import_joint *joint = &r->model->joint[at < 0 ? 0 : at];
    double gear[6] = {1}, range[2], low, high;

    if (at < 0 || joint->type == IMPORT_FLOATING) {
        return false;
    }
    if (joint->driven) {
        reader_note(r, IMPORT_CHANGED, node,
                    "joint \"%.63s\" has several actuators: one drive has the sum of their limits",
                    name);
    }
    mjcf_some_reals(r, node, "gear", 6, gear);
    actuator_find_range(r, node, range);
    gear[0] *= coefficient;
    low = gear[0] != 0.0 ? gear[0] * range[0] : 0.0;
    high = gear[0] != 0.0 ? gear[0] * range[1] : 0.0;
    joint->driven = true;
    sum[at][0] += fmin(low, high);
    sum[at][1] += fmax(low, high);
    return true;
}

/* Gives each joint of a fixed tendon a drive of its own, with its share of the actuator's force.
 * Returns false if the tendon is not fixed or moves no joint. */
static bool actuator_pull(const struct import_reader *r, const xmlNode *node, const char *name,
                          double (*sum)[2])
{
    const xmlNode *tendon = mjcf_next(r, "tendon", "fixed", NULL);
    bool moves = false;

    while (tendon && strcmp(reader_text(tendon, "name"), name) != 0) {
        tendon = mjcf_next(r, "tendon", "fixed", tendon);
    }
    for (const xmlNode *part = tendon ? xml_child(tendon, "joint") : NULL; part;
         part = xml_next(part, "joint")) {
        double coefficient = 1.0;

        xml_reals(r->file, part, "coef", 1, &coefficient);
        moves |= actuator_add(r, node, reader_text(part, "joint"), coefficient, sum);
    }
    if (moves) {
        reader_note(r, IMPORT_CHANGED, node,
                    "tendon \"%.63s\": each of its joints has a drive of its own, with its share "
                    "of the actuator's force",
                    name);
    }
    return moves;
}

void mjcf_read_actuators(const struct import_reader *r)
{
    struct import_model *model = r->model;
    double(*sum)[2] = reader_alloc(r, model->njoint + 1, sizeof *sum);

    for (const xmlNode *node = mjcf_next(r, "actuator", NULL, NULL); node && sum;
         node = mjcf_next(r, "actuator", NULL, node)) {
        /* For joints of one coordinate, jointinparent means the same as joint */
        const char *name = xml_attribute(node, "joint"), *tendon = xml_attribute(node, "tendon");

        name = name ? name : xml_attribute(node, "jointinparent");
        if (name ? !actuator_add(r, node, name, 1.0, sum)
                 : !tendon || !actuator_pull(r, node, tendon, sum)) {
            model->drives_others = true;
            reader_note(r, IMPORT_DROPPED, node,
                        "actuator <%.40s>: it drives neither a joint nor a fixed tendon",
                        (const char *)node->name);
        }
    }
    for (size_t j = 0; j < model->njoint && sum; j++) {
        struct import_joint *joint = &model->joint[j];

        if (joint->driven) {
            const double *most = r->force[j];
            const double low = fmin(fmax(sum[j][0], most[0]), most[1]);
            const double high = fmin(fmax(sum[j][1], most[0]), most[1]);
            const double effort = fmax(fabs(low), fabs(high));

            joint->effort = isfinite(effort) ? effort : 0.0;
        }
        model->actuated = model->actuated || joint->driven;
    }
}

bool mjcf_is_active(const struct import_reader *r, const xmlNode *node)
{
    const char *active = mjcf_attribute(r, node, "active");

    return !active || strcmp(active, "false") != 0;
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
    follower->mimic_file = xml_name(r->file, node);
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

        if (!mjcf_is_active(r, node)) {
            reader_note(r, IMPORT_DROPPED, node, "equality <joint>: it is not active");
            continue;
        }
        first = mjcf_find_coupled(r, node, "joint1");
        second = mjcf_find_coupled(r, node, "joint2");
        mjcf_some_reals(r, node, "polycoef", 5, polynomial);
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

    if (!*name) {
        name = model->npose > 1 ? reader_format(r, "key-%zu", model->npose) : "key";
    }
    *pose = (struct import_pose){.name = reader_copy(r, name),
                                 .file = xml_name(r->file, node),
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
            pose->value[pose->nvalue++] =
                (struct import_value){.joint = joint->name, .value = qpos[r->qpos[j]] - r->ref[j]};
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

/* ---- the report ---- */

#define PLACE " pos quat axisangle euler xyaxes zaxis"
#define ACTUATOR "joint jointinparent tendon gear ctrlrange ctrllimited forcerange forcelimited"

const struct reader_row mjcf_read_attributes[] = {
    {"mujoco", "model"},
    {"compiler", "angle eulerseq autolimits inertiafromgeom inertiagrouprange meshdir assetdir "
                 "coordinate exactmeshinertia settotalmass"},
    {"default", ""},
    {"asset", ""},
    {"mesh", "file scale inertia refpos refquat"},
    {"material", "rgba"},
    {"worldbody", ""},
    {"body", "childclass" PLACE},
    {"frame", "childclass" PLACE},
    {"freejoint", ""},
    {"joint", "type pos axis range limited ref springref stiffness damping armature frictionloss "
              "actuatorfrcrange actuatorfrclimited joint1 joint2 polycoef active joint coef"},
    {"inertial", "mass diaginertia fullinertia" PLACE},
    {"geom", "type size fromto mass density shellinertia group contype conaffinity mesh material "
             "rgba" PLACE},
    {"site", "fromto" PLACE},
    {"equality", "active"},
    {"connect", NULL},
    {"weld", NULL},
    {"actuator", ""},
    {"motor", ACTUATOR},
    {"general", ACTUATOR " gaintype gainprm biastype dyntype actrange actlimited"},
    {"position", ACTUATOR},
    {"velocity", ACTUATOR},
    {"intvelocity", ACTUATOR},
    {"damper", ACTUATOR},
    {"cylinder", ACTUATOR},
    {"muscle", NULL},
    {"adhesion", NULL},
    {"tendon", ""},
    {"fixed", ""},
    {"keyframe", ""},
    {"key", "qpos"},
    {"sensor", ""},
    {"gyro", "site"},
    {"accelerometer", "site"},
    {0},
};
