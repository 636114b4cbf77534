/* SPDX-License-Identifier: Apache-2.0 */
/* MJCF: default classes, places, geoms, actuators, keyframes. */
#include "app/import/mjcf_private.h"

#include "base/vec3.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define DENSITY 1000.0 /* of geoms, kg/m3, where the file says nothing */

/* ---- default classes ---- */

/* The <default> of a class, and the ones above it in *above, from the inside out; 0 = there is
 * none of that name. */
static size_t mjcf_find_class(const xmlNode *node, const char *name, const xmlNode **above,
                              size_t depth)
{
    const char *own = xml_attribute(node, "class");

    above[depth] = node;
    if (!strcmp(own ? own : "main", name)) {
        return depth + 1;
    }
    for (const xmlNode *child = xml_child(node, "default"); child && depth + 1 < 32;
         child = xml_next(child, "default")) {
        size_t found = mjcf_find_class(child, name, above, depth + 1);

        if (found) {
            return found;
        }
    }
    return 0;
}

const char *mjcf_attribute(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name)
{
    const char *text = xml_attribute(node, name), *own = xml_attribute(node, "class");
    const xmlNode *above[32];
    size_t depth;

    if (text || !r->defaults) {
        return text;
    }
    own = own ? own : childclass ? childclass : "main";
    depth = mjcf_find_class(r->defaults, own, above, 0);
    depth = depth || strcmp(own, "main") ? depth : mjcf_find_class(r->defaults, "main", above, 0);
    while (depth-- > 0) {
        const xmlNode *element = xml_child(above[depth], (const char *)node->name);

        text = element ? xml_attribute(element, name) : NULL;
        if (text) {
            return text;
        }
    }
    return NULL;
}

enum error_code mjcf_reals(const struct mjcf_reader *r, const xmlNode *node, const char *childclass,
                           const char *name, size_t count, double *value, bool *given)
{
    const char *text = mjcf_attribute(r, node, childclass, name);

    if (given) {
        *given = text != NULL;
    }
    return text ? xml_parse_reals(r->file, node, name, text, count, value, r->error) : ERROR_NONE;
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
    return xml_parse_reals(r->file, node, name, text, *count, value, r->error);
}

/* ---- places ---- */

/* R <- R after a turn about an axis; MuJoCo's capital letters turn about fixed axes. */
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

/* Columns from two axes, the second made orthogonal to the first. */
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
        sound = axes_to_rotation(axes, place->R);
    }
    if (!sound || mjcf_attribute(r, node, childclass, "zaxis")) {
        return import_error(r->error, r->file->name, xml_line(node),
                            "found %s of <%.40s>, expected a quat, axisangle, euler or xyaxes that "
                            "is a rotation",
                            sound ? "a zaxis" : "an orientation", (const char *)node->name);
    }
    return ERROR_NONE;
}

/* ---- geoms ---- */

/* Volume and inertia of a solid of density 1 about its center. */
static double geom_measure(const struct import_geometry *g, double I[6])
{
    double radius = g->radius, length = g->length, volume = 0.0, across, along, ball;
    const double *h = g->half;

    memset(I, 0, 6 * sizeof *I);
    switch (g->shape) {
    case IMPORT_SPHERE:
        volume = 4.0 / 3.0 * M_PI * radius * radius * radius;
        I[0] = I[3] = I[5] = 0.4 * volume * radius * radius;
        break;
    case IMPORT_BOX:
        volume = 8.0 * h[0] * h[1] * h[2];
        I[0] = volume / 3.0 * (h[1] * h[1] + h[2] * h[2]);
        I[3] = volume / 3.0 * (h[0] * h[0] + h[2] * h[2]);
        I[5] = volume / 3.0 * (h[0] * h[0] + h[1] * h[1]);
        break;
    case IMPORT_CYLINDER:
    case IMPORT_CAPSULE:
        volume = M_PI * radius * radius * length;
        along = 0.5 * volume * radius * radius;
        across = volume * (3.0 * radius * radius + length * length) / 12.0;
        if (g->shape == IMPORT_CAPSULE) {
            /* Half-spheres, whose centers of mass are 3/8 of the radius beyond the cylinder */
            ball = 4.0 / 3.0 * M_PI * radius * radius * radius;
            volume += ball;
            along += 0.4 * ball * radius * radius;
            across +=
                ball * (0.4 * radius * radius + 0.375 * radius * length + 0.25 * length * length);
        }
        I[0] = I[3] = across;
        I[5] = along;
        break;
    default:
        break;
    }
    return volume;
}

/* What a geom weighs, added to the body that has no inertia of its own. */
static enum error_code geom_add_inertia(const struct mjcf_reader *r, const xmlNode *node,
                                        const char *childclass, const struct import_geometry *g,
                                        struct robot_inertia *inertia)
{
    struct robot_inertia own = {0};
    double density = DENSITY, mass, volume;
    bool by_mass;
    enum error_code code;

    if ((code = mjcf_reals(r, node, childclass, "density", 1, &density, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "mass", 1, &mass, &by_mass))) {
        return code;
    }
    if (by_mass ? mass == 0.0 : density == 0.0) {
        return ERROR_NONE;
    }
    volume = geom_measure(g, own.I);
    own.mass = by_mass ? mass : density * volume;
    if (!(volume > 0.0) || !(own.mass > 0.0) || own.mass > 1e6) {
        return import_error(
            r->error, r->file->name, g->line,
            "found a body without <inertial> whose geom weighs %g kg and has %g m3, "
            "expected a solid sphere, capsule, cylinder or box: load the file in "
            "MuJoCo and save it (mj_saveLastXML), which writes inertias",
            own.mass, volume);
    }
    for (int i = 0; i < 6; i++) {
        own.I[i] *= own.mass / volume;
    }
    import_add_inertia(inertia, &own, &g->place);
    return ERROR_NONE;
}

/* The mesh of that name: its file, which also names it when it has no other name. */
static enum error_code geom_read_mesh(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g)
{
    const char *name = mjcf_attribute(r, node, childclass, "mesh");
    char path[512];

    g->scale[0] = g->scale[1] = g->scale[2] = 1;
    for (const xmlNode *mesh = r->assets ? xml_child(r->assets, "mesh") : NULL; mesh && name;
         mesh = xml_next(mesh, "mesh")) {
        const char *file = xml_attribute(mesh, "file"), *own = xml_attribute(mesh, "name");
        const char *base = file && strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
        size_t length = strlen(name);

        if (file &&
            (own ? !strcmp(own, name) : !strncmp(base, name, length) && base[length] == '.')) {
            snprintf(path, sizeof path, "%.200s%s%.300s", r->meshdir, *r->meshdir ? "/" : "", file);
            g->mesh = arena_strdup(r->arena, path);
            return g->mesh ? mjcf_reals(r, mesh, NULL, "scale", 3, g->scale, NULL)
                           : mjcf_no_memory(r);
        }
    }
    return import_error(r->error, r->file->name, g->line,
                        "found mesh \"%.63s\", expected one of <asset> with a file",
                        name ? name : "");
}

static enum error_code geom_read_type(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g,
                                      bool *known)
{
    static const struct {
        const char *word;
        enum import_shape shape;
    } shapes[] = {{"sphere", IMPORT_SPHERE},   {"box", IMPORT_BOX},   {"cylinder", IMPORT_CYLINDER},
                  {"capsule", IMPORT_CAPSULE}, {"mesh", IMPORT_MESH}, {NULL, IMPORT_SPHERE}};
    const char *type = mjcf_attribute(r, node, childclass, "type");

    type = type ? type : mjcf_attribute(r, node, childclass, "mesh") ? "mesh" : "sphere";
    *known = false;
    for (size_t i = 0; shapes[i].word && !*known; i++) {
        *known = !strcmp(type, shapes[i].word);
        g->shape = shapes[i].shape;
    }
    if (!*known) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, g->line,
                        "geom of type \"%.40s\": robots here have spheres, boxes, cylinders, "
                        "capsules and meshes",
                        type);
    }
    return ERROR_NONE;
}

/* Sizes by size and fromto. */
static enum error_code geom_read_size(const struct mjcf_reader *r, const xmlNode *node,
                                      const char *childclass, struct import_geometry *g)
{
    double size[3] = {0, 0, 0}, ends[6], along[6] = {0};
    bool by_ends, round = g->shape == IMPORT_CYLINDER || g->shape == IMPORT_CAPSULE;
    size_t count, need = g->shape == IMPORT_SPHERE ? 1 : g->shape == IMPORT_BOX ? 3 : 2;
    enum error_code code;

    if ((code = mjcf_some_reals(r, node, childclass, "size", 3, size, &count)) ||
        (code = mjcf_reals(r, node, childclass, "fromto", 6, ends, &by_ends))) {
        return code;
    }
    memcpy(g->half, size, sizeof g->half);
    g->radius = size[0];
    g->length = 2.0 * size[1];
    if (by_ends && round) {
        /* From one end to the other: the middle, and z along it */
        vec3_sub(ends + 3, ends, along);
        g->length = vec3_norm(along);
        for (int m = 0; m < 3; m++) {
            g->place.xyz[m] = 0.5 * (ends[m] + ends[3 + m]);
            along[3 + m] = fabs(along[m]) < 0.6 * g->length;
        }
        if (g->length > 0 && axes_to_rotation(along, g->place.R)) {
            const double x[3] = {g->place.R[0], g->place.R[3], g->place.R[6]};

            for (int m = 0; m < 3; m++) {
                g->place.R[3 * m] = g->place.R[3 * m + 1];
                g->place.R[3 * m + 1] = g->place.R[3 * m + 2];
                g->place.R[3 * m + 2] = x[m];
            }
        }
        need = 1;
    }
    for (size_t i = 0; i < need; i++) {
        if (!(size[i] > 0 && size[i] < 1e3)) {
            return import_error(r->error, r->file->name, g->line,
                                "found size %g of a geom, expected %zu above 0", size[i], need);
        }
    }
    return ERROR_NONE;
}

/* The color of a geom, by its rgba or its material, and whether MuJoCo's viewer shows it: groups 0
 * to 2 are. Colors in the file of a mesh do not count. */
static enum error_code geom_read_looks(const struct mjcf_reader *r, const xmlNode *node,
                                       const char *childclass, struct import_geometry *g)
{
    static const double gray[4] = {0.5, 0.5, 0.5, 1.0};
    const char *name = mjcf_attribute(r, node, childclass, "material");
    const xmlNode *material = name && r->assets ? xml_child(r->assets, "material") : NULL;
    double group = 0.0;
    bool own;
    enum error_code code;

    memcpy(g->color, gray, sizeof g->color);
    if ((code = mjcf_reals(r, node, childclass, "group", 1, &group, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "rgba", 4, g->color, &own))) {
        return code;
    }
    while (!own && material &&
           strcmp(xml_attribute(material, "name") ? xml_attribute(material, "name") : "", name)) {
        material = xml_next(material, "material");
    }
    if (!own && material) {
        const double white[4] = {1.0, 1.0, 1.0, 1.0};

        memcpy(g->color, white, sizeof g->color);
        code = mjcf_reals(r, material, NULL, "rgba", 4, g->color, NULL);
    }
    for (int m = 0; m < 4; m++) {
        g->color[m] = fmin(fmax(g->color[m], 0.0), 1.0);
    }
    g->visual = group < 3.0 && g->color[3] > 0.0;
    g->colored = g->repaints = true;
    return code;
}

enum error_code mjcf_read_geom(const struct mjcf_reader *r, const xmlNode *node,
                               const char *childclass, int link, struct robot_inertia *inertia)
{
    struct import_geometry g = {.line = xml_line(node), .link = link};
    double type = 1, affinity = 1;
    bool known;
    enum error_code code;

    if ((code = mjcf_read_place(r, node, childclass, &g.place)) ||
        (code = mjcf_reals(r, node, childclass, "contype", 1, &type, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "conaffinity", 1, &affinity, NULL)) ||
        (code = geom_read_type(r, node, childclass, &g, &known))) {
        return code;
    }
    if (!known && !inertia) {
        return ERROR_NONE;
    }
    if (known && (code = g.shape == IMPORT_MESH ? geom_read_mesh(r, node, childclass, &g)
                                                : geom_read_size(r, node, childclass, &g))) {
        return code;
    }
    g.shape = known ? g.shape : IMPORT_MESH; /* of no volume that is known here */
    if (inertia && (code = geom_add_inertia(r, node, childclass, &g, inertia))) {
        return code;
    }
    g.collision = type != 0 || affinity != 0;
    if ((code = geom_read_looks(r, node, childclass, &g))) {
        return code;
    }
    if (known) {
        r->model->geometry[r->model->ngeometry++] = g;
    }
    return ERROR_NONE;
}

/* ---- actuators and poses ---- */

enum error_code mjcf_read_actuators(const struct mjcf_reader *r)
{
    const xmlNode *actuators = xml_child(r->file->root, "actuator");
    const xmlNode *equality = xml_child(r->file->root, "equality");
    enum error_code code = ERROR_NONE;

    for (const xmlNode *node = actuators ? xml_child(actuators, NULL) : NULL; node && !code;
         node = xml_next(node, NULL)) {
        const char *name = xml_attribute(node, "joint");
        int joint = name ? import_find_joint(r->model, name) : -1;
        double force[2] = {0, 0}, control[2] = {0, 0}, gear[6] = {1}, most;
        size_t count;

        if (joint < 0) {
            import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                            "actuator <%.40s>: it drives no joint", (const char *)node->name);
            continue;
        }
        if ((code = mjcf_reals(r, node, NULL, "forcerange", 2, force, NULL)) ||
            (code = mjcf_reals(r, node, NULL, "ctrlrange", 2, control, NULL)) ||
            (code = mjcf_some_reals(r, node, NULL, "gear", 6, gear, &count))) {
            break;
        }

        /* The gear takes the actuator's force to the joint; of a motor control is force */
        most = fmax(fabs(force[0]), fabs(force[1]));
        if (most == 0.0 && xml_is(node, "motor")) {
            most = fmax(fabs(control[0]), fabs(control[1]));
        }
        most *= fabs(gear[0]);
        r->model->joint[joint].effort = most > 0.0 ? most : r->model->joint[joint].effort;
    }
    for (const xmlNode *node = equality ? xml_child(equality, "joint") : NULL; node && !code;
         node = xml_next(node, "joint")) {
        const char *one = xml_attribute(node, "joint1"), *two = xml_attribute(node, "joint2");
        int follower = one ? import_find_joint(r->model, one) : -1;
        int leader = two ? import_find_joint(r->model, two) : -1;
        double polynomial[5] = {0, 1, 0, 0, 0};

        if (follower >= 0 && leader >= 0) {
            code = xml_reals(r->file, node, "polycoef", 5, polynomial, NULL, r->error);
            r->model->joint[follower].mimic = r->model->joint[leader].name;
            r->model->joint[follower].mimic_line = xml_line(node);
            r->model->joint[follower].offset = polynomial[0];
            r->model->joint[follower].multiplier = polynomial[1];
        }
    }
    return code;
}

static enum error_code mjcf_read_key(const struct mjcf_reader *r, const xmlNode *node,
                                     struct import_pose *pose)
{
    const struct import_model *model = r->model;
    const char *name = xml_attribute(node, "name"), *text = xml_attribute(node, "qpos");
    double *qpos = arena_alloc(r->arena, (size_t)r->qpos_count + 1, sizeof *qpos);
    enum error_code code;

    pose->line = xml_line(node);
    pose->name = arena_strdup(r->arena, name && *name ? name : "key");
    pose->value = arena_alloc(r->arena, model->njoint + 1, sizeof *pose->value);
    if (!qpos || !pose->name || !pose->value) {
        return mjcf_no_memory(r);
    }
    if (!text) {
        return ERROR_NONE;
    }
    code = xml_parse_reals(r->file, node, "qpos", text, (size_t)r->qpos_count, qpos, r->error);
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
    const xmlNode *keys = xml_child(r->file->root, "keyframe");
    size_t count = 0;
    enum error_code code = ERROR_NONE;

    for (const xmlNode *key = keys ? xml_child(keys, "key") : NULL; key;
         key = xml_next(key, "key")) {
        count++;
    }
    if (count > 64) {
        return import_error(r->error, r->file->name, xml_line(keys),
                            "found %zu keyframes, expected at most 64", count);
    }
    r->model->pose = arena_alloc(r->arena, count + 1, sizeof *r->model->pose);
    if (!r->model->pose) {
        return mjcf_no_memory(r);
    }
    for (const xmlNode *key = keys ? xml_child(keys, "key") : NULL; key && !code;
         key = xml_next(key, "key")) {
        code = mjcf_read_key(r, key, &r->model->pose[r->model->npose]);
        r->model->npose++;
    }
    return code;
}
