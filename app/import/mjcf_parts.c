/* SPDX-License-Identifier: Apache-2.0 */
/* Indexes default classes, meshes and materials; reads places, actuators, couplings and
 * keyframes. */
#include "app/import/mjcf_private.h"

#include "base/vec3.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MJCF_DEFAULTS_MAX = 2048, MJCF_CLASSES_DEEP = 32 };

/* ---- default classes ---- */

/* Orders names for qsort; equal ones keep the order of the file. */
static int mjcf_compare_names(const void *a, const void *b)
{
    const struct mjcf_name *x = a, *y = b;
    int order = strcmp(x->name, y->name);

    return order ? order : (x->number > y->number) - (x->number < y->number);
}

const struct mjcf_name *mjcf_find(const struct mjcf_names *names, const char *name)
{
    size_t low = 0, high = names->count;

    /* Find the first entry of the name by halving the sorted list */
    while (low < high) {
        size_t middle = (low + high) / 2;

        if (strcmp(names->entry[middle].name, name) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < names->count && !strcmp(names->entry[low].name, name) ? &names->entry[low] : NULL;
}

/* Appends an entry; there is room for it. */
static void mjcf_add_name(struct mjcf_names *names, const char *name, const char *above,
                          const xmlNode *node)
{
    names->entry[names->count] =
        (struct mjcf_name){.name = name, .above = above, .node = node, .number = names->count};
    names->count++;
}

/* Adds a class and its inner classes; the outermost one may have no name, which means "main". */
static void mjcf_add_classes(struct mjcf_names *names, const xmlNode *node, const char *above)
{
    const char *own = xml_attribute(node, "class");

    own = own ? own : "main";
    mjcf_add_name(names, own, above, node);
    for (const xmlNode *child = xml_child(node, "default"); child;
         child = xml_next(child, "default")) {
        mjcf_add_classes(names, child, own);
    }
}

/* Lists all default classes by name; of one class there may be several elements. */
static enum error_code mjcf_index_classes(struct mjcf_reader *r)
{
    size_t count = 0;

    for (const xmlNode *top = xml_child(r->file->root, "default"); top;
         top = xml_next(top, "default")) {
        for (const xmlNode *at = top; at; at = xml_walk(at, top)) {
            count += at->type == XML_ELEMENT_NODE;
        }
        if (count > MJCF_DEFAULTS_MAX) {
            return mjcf_refuse(r, top, "found %zu elements of default classes, expected at most %d",
                               count, MJCF_DEFAULTS_MAX);
        }
    }

    /* Each element below <default> may be a class: room for all of them is enough */
    r->classes.entry = arena_alloc(r->arena, count + 1, sizeof *r->classes.entry);
    if (!r->classes.entry) {
        return mjcf_no_memory(r);
    }
    for (const xmlNode *top = xml_child(r->file->root, "default"); top;
         top = xml_next(top, "default")) {
        mjcf_add_classes(&r->classes, top, NULL);
    }
    qsort(r->classes.entry, r->classes.count, sizeof *r->classes.entry, mjcf_compare_names);
    return ERROR_NONE;
}

/* Lists the meshes of the assets by name; the default name is the file name without its
 * extension. */
static enum error_code mjcf_index_meshes(struct mjcf_reader *r)
{
    size_t count = 0;

    for (const xmlNode *mesh = mjcf_next(r, "asset", "mesh", NULL); mesh;
         mesh = mjcf_next(r, "asset", "mesh", mesh)) {
        count++;
    }
    r->meshes.entry = arena_alloc(r->arena, count + 1, sizeof *r->meshes.entry);
    if (!r->meshes.entry) {
        return mjcf_no_memory(r);
    }
    for (const xmlNode *mesh = mjcf_next(r, "asset", "mesh", NULL); mesh;
         mesh = mjcf_next(r, "asset", "mesh", mesh)) {
        const char *name = xml_attribute(mesh, "name"), *file = xml_attribute(mesh, "file");
        const char *slash = file ? strrchr(file, '/') : NULL;

        /* A name from the file's: its base name up to the last "." */
        if (!name && file) {
            char *base = arena_strdup(r->arena, slash ? slash + 1 : file);

            if (!base) {
                return mjcf_no_memory(r);
            }
            base[strrchr(base, '.') ? (size_t)(strrchr(base, '.') - base) : strlen(base)] = '\0';
            name = base;
        }
        if (name && file) {
            mjcf_add_name(&r->meshes, name, NULL, mesh);
        }
    }
    qsort(r->meshes.entry, r->meshes.count, sizeof *r->meshes.entry, mjcf_compare_names);
    return ERROR_NONE;
}

/* Lists the materials of the assets by name. */
static enum error_code mjcf_index_materials(struct mjcf_reader *r)
{
    size_t count = 0;

    for (const xmlNode *at = mjcf_next(r, "asset", "material", NULL); at;
         at = mjcf_next(r, "asset", "material", at)) {
        count++;
    }
    r->materials.entry = arena_alloc(r->arena, count + 1, sizeof *r->materials.entry);
    if (!r->materials.entry) {
        return mjcf_no_memory(r);
    }
    for (const xmlNode *at = mjcf_next(r, "asset", "material", NULL); at;
         at = mjcf_next(r, "asset", "material", at)) {
        if (xml_attribute(at, "name")) {
            mjcf_add_name(&r->materials, xml_attribute(at, "name"), NULL, at);
        }
    }
    qsort(r->materials.entry, r->materials.count, sizeof *r->materials.entry, mjcf_compare_names);
    return ERROR_NONE;
}

enum error_code mjcf_index(struct mjcf_reader *r)
{
    enum error_code code = mjcf_index_classes(r);

    code = code ? code : mjcf_index_meshes(r);
    return code ? code : mjcf_index_materials(r);
}

/* Returns the attribute that a class gives to elements with this name: the last occurrence; NULL
 * if there is none. */
static const char *class_find_attribute(const struct mjcf_reader *r, const struct mjcf_name *class,
                                        const char *element, const char *name)
{
    const struct mjcf_name *end = r->classes.entry + r->classes.count;
    const char *text = NULL;

    for (const struct mjcf_name *at = class; at < end && !strcmp(at->name, class->name); at++) {
        const xmlNode *node = xml_child(at->node, element);
        const char *own = node ? xml_attribute(node, name) : NULL;

        text = own ? own : text;
    }
    return text;
}

const char *mjcf_attribute(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name)
{
    const char *text = xml_attribute(node, name), *own = xml_attribute(node, "class");

    own = own ? own : childclass ? childclass : "main";
    for (int depth = 0; !text && own && depth < MJCF_CLASSES_DEEP; depth++) {
        const struct mjcf_name *class = mjcf_find(&r->classes, own);

        text = class ? class_find_attribute(r, class, (const char *)node->name, name) : NULL;
        own = class ? class->above : NULL;
    }
    return text;
}

enum error_code mjcf_reals(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name, size_t count, double *value, bool *given)
{
    const char *text = mjcf_attribute(r, node, childclass, name);

    if (given) {
        *given = text != NULL;
    }
    return text ? xml_parse_reals(r->file, node, name, text, count, value) : ERROR_NONE;
}

enum error_code mjcf_some_reals(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, const char *name, size_t most,
                                double *value, size_t *count)
{
    const char *text = mjcf_attribute(r, node, childclass, name);

    *count = 0;
    for (const char *at = text; at && *at;) {
        at += strspn(at, " \t\r\n");
        *count += *at != '\0';
        at += strcspn(at, " \t\r\n");
    }
    if (!text) {
        return ERROR_NONE;
    }
    *count = *count < 1 ? 1 : *count > most ? most : *count;
    return xml_parse_reals(r->file, node, name, text, *count, value);
}

/* ---- places ---- */

/* Turns R about an axis of the sequence: small letters turn about the moved axes, MuJoCo's capital
 * letters about the fixed ones. */
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

bool mjcf_axes_to_rotation(const double axes[6], double R[9])
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

enum error_code mjcf_read_place(const struct mjcf_reader *r, const xmlNode *node,
                                const char *childclass, struct import_place *place)
{
    double quaternion[4], turn[4], euler[3], axes[6];
    bool by_quaternion, by_axis, by_euler, by_axes, sound = true;
    enum error_code code;

    import_place_identity(place);
    if ((code = mjcf_reals(r, node, childclass, "pos", 3, place->xyz, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "quat", 4, quaternion, &by_quaternion)) ||
        (code = mjcf_reals(r, node, childclass, "axisangle", 4, turn, &by_axis)) ||
        (code = mjcf_reals(r, node, childclass, "euler", 3, euler, &by_euler)) ||
        (code = mjcf_reals(r, node, childclass, "xyaxes", 6, axes, &by_axes))) {
        return code;
    }

    /* MuJoCo uses the first of these that is given; refuses values that are not rotations */
    if (by_quaternion) {
        mat3_from_quaternion(quaternion, place->R);
        sound = isfinite(place->R[0]);
    } else if (by_axis) {
        double length = vec3_norm(turn);
        const double axis[3] = {turn[0] / length, turn[1] / length, turn[2] / length};

        mat3_about_axis(axis, turn[3] * r->angle, place->R);
        sound = length > 0;
    } else if (by_euler) {
        for (int i = 0; i < 3; i++) {
            euler_turn(r->eulerseq[i], euler[i] * r->angle, place->R);
        }
    } else if (by_axes) {
        sound = mjcf_axes_to_rotation(axes, place->R);
    }
    if (!sound || mjcf_attribute(r, node, childclass, "zaxis")) {
        return mjcf_refuse(r, node,
                           "found %s of <%.40s>, expected a quat, axisangle, euler or xyaxes that "
                           "is a rotation",
                           sound ? "a zaxis" : "an orientation", (const char *)node->name);
    }
    return ERROR_NONE;
}

/* ---- actuators and poses ---- */

enum error_code mjcf_read_actuators(const struct mjcf_reader *r)
{
    enum error_code code = ERROR_NONE;

    for (const xmlNode *node = mjcf_next(r, "actuator", NULL, NULL); node && !code;
         node = mjcf_next(r, "actuator", NULL, node)) {
        const char *name = xml_attribute(node, "joint");
        int joint = name ? import_find_joint(r->model, name) : -1;
        double force[2] = {0, 0}, control[2] = {0, 0}, gear[6] = {1}, most;
        size_t count;

        if (joint < 0) {
            import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                            "actuator <%.40s>: it drives no joint", (const char *)node->name);
            continue;
        }
        if ((code = mjcf_reals(r, node, NULL, "forcerange", 2, force, NULL)) ||
            (code = mjcf_reals(r, node, NULL, "ctrlrange", 2, control, NULL)) ||
            (code = mjcf_some_reals(r, node, NULL, "gear", 6, gear, &count))) {
            break;
        }

        /* The gear converts the actuator's force to the joint's; for a motor, control is force */
        most = fmax(fabs(force[0]), fabs(force[1]));
        if (most == 0.0 && xml_is(node, "motor")) {
            most = fmax(fabs(control[0]), fabs(control[1]));
        }
        most *= fabs(gear[0]);
        r->model->joint[joint].driven = true;
        r->model->joint[joint].effort = most > 0.0 ? most : r->model->joint[joint].effort;
    }
    return code;
}

/* Finds the joint that an attribute of an equality names; -1 when the attribute is missing. */
static enum error_code mjcf_find_coupled(const struct mjcf_reader *r, const xmlNode *node,
                                         const char *attribute, int *joint)
{
    const char *name = xml_attribute(node, attribute);

    *joint = name ? import_find_joint(r->model, name) : -1;
    return name && *joint < 0
               ? mjcf_refuse(r, node, "found %s \"%.63s\" of an equality, expected a joint",
                             attribute, name)
               : ERROR_NONE;
}

/* Couples two joints: the first follows the second, as in the file. If the first is driven or
 * already follows another joint, and the polynomial is a line, the roles are swapped. */
static enum error_code mjcf_lead(const struct mjcf_reader *r, const xmlNode *node, int first,
                                 int second, const double polynomial[5])
{
    const bool bends = polynomial[2] != 0.0 || polynomial[3] != 0.0 || polynomial[4] != 0.0;
    struct import_joint *follower = &r->model->joint[first], *leader = &r->model->joint[second];
    double multiplier = polynomial[1], offset = polynomial[0];

    /* Swap the two: y = a + b x becomes x = -a/b + y/b */
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
        return mjcf_refuse(r, node,
                           "found joint \"%.63s\" of an equality, which follows \"%.63s\" already "
                           "(line %d), expected one equality for each joint that follows",
                           follower->name, follower->mimic, follower->mimic_line);
    }
    follower->mimic = leader->name;
    follower->mimic_file = mjcf_file(r, node);
    follower->mimic_line = xml_line(node);
    follower->offset = offset;
    follower->multiplier = multiplier;
    follower->bends = bends;
    return ERROR_NONE;
}

/* Reads an equality between two joints, or of one joint and a constant, which then has an empty
 * range. */
static enum error_code mjcf_read_coupling(const struct mjcf_reader *r, const xmlNode *node)
{
    const char *active = xml_attribute(node, "active");
    double polynomial[5] = {0, 1, 0, 0, 0};
    struct import_joint *constant;
    size_t count;
    int first, second;
    enum error_code code;

    if (active && !strcmp(active, "false")) {
        import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                        "equality <joint>: it is not active");
        return ERROR_NONE;
    }
    if ((code = mjcf_find_coupled(r, node, "joint1", &first)) ||
        (code = mjcf_find_coupled(r, node, "joint2", &second)) ||
        (code = mjcf_some_reals(r, node, NULL, "polycoef", 5, polynomial, &count))) {
        return code;
    }
    if (first < 0) {
        return mjcf_refuse(r, node, "found an equality without joint1, expected it");
    }
    if (second >= 0) {
        return mjcf_lead(r, node, first, second, polynomial);
    }

    /* Without a second joint, the first is held at the constant */
    constant = &r->model->joint[first];
    constant->type = constant->type == IMPORT_CONTINUOUS ? IMPORT_REVOLUTE : constant->type;
    constant->has_limit = true;
    constant->lower = constant->upper = polynomial[0];
    return ERROR_NONE;
}

enum error_code mjcf_read_couplings(const struct mjcf_reader *r)
{
    enum error_code code = ERROR_NONE;

    for (const xmlNode *node = mjcf_next(r, "equality", "joint", NULL); node && !code;
         node = mjcf_next(r, "equality", "joint", node)) {
        code = mjcf_read_coupling(r, node);
    }
    return code;
}

/* Reads a keyframe: the positions of all joints out of MuJoCo's qpos, counted from their ref. */
static enum error_code mjcf_read_key(const struct mjcf_reader *r, const xmlNode *node,
                                     struct import_pose *pose)
{
    const struct import_model *model = r->model;
    const char *name = xml_attribute(node, "name"), *text = xml_attribute(node, "qpos");
    double *qpos = arena_alloc(r->arena, (size_t)r->qpos_count + 1, sizeof *qpos);
    enum error_code code;

    pose->file = mjcf_file(r, node);
    pose->line = xml_line(node);
    pose->name = arena_strdup(r->arena, name && *name ? name : "key");
    pose->value = arena_alloc(r->arena, model->njoint + 1, sizeof *pose->value);
    if (!qpos || !pose->name || !pose->value) {
        return mjcf_no_memory(r);
    }
    if (!text) {
        return ERROR_NONE;
    }

    /* Fixed joints have no coordinate; the free one's seven belong to the base */
    code = xml_parse_reals(r->file, node, "qpos", text, (size_t)r->qpos_count, qpos);
    for (size_t j = 0; j < model->njoint && !code; j++) {
        const struct import_joint *joint = &model->joint[j];

        if (joint->type != IMPORT_FIXED && joint->type != IMPORT_FLOATING) {
            pose->value[pose->nvalue++] = (struct import_value){
                .joint = joint->name, .line = pose->line, .value = qpos[r->qpos[j]] - r->ref[j]};
        }
    }
    return code;
}

enum error_code mjcf_read_keys(const struct mjcf_reader *r)
{
    size_t count = 0;
    enum error_code code = ERROR_NONE;

    for (const xmlNode *key = mjcf_next(r, "keyframe", "key", NULL); key;
         key = mjcf_next(r, "keyframe", "key", key)) {
        count++;
    }
    if (count > 64) {
        return mjcf_refuse(r, mjcf_next(r, "keyframe", "key", NULL),
                           "found %zu keyframes, expected at most 64", count);
    }
    r->model->pose = arena_alloc(r->arena, count + 1, sizeof *r->model->pose);
    if (!r->model->pose) {
        return mjcf_no_memory(r);
    }
    for (const xmlNode *key = mjcf_next(r, "keyframe", "key", NULL); key && !code;
         key = mjcf_next(r, "keyframe", "key", key)) {
        code = mjcf_read_key(r, key, &r->model->pose[r->model->npose]);
        r->model->npose++;
    }
    return code;
}
