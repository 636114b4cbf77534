/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads URDF: links with inertia, geometry and colors, joints, sensors, and their references by
 * name. Reads SRDF: named poses, and whether the base is fixed in the world.
 */
#include "app/import/readers.h"

#include "base/array.h"
#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A named color, which visuals refer to. */
struct urdf_material {
    const char *name; /* belongs to the document */
    double color[4];
    int order; /* order in the file; the first one with a name is used */
};

/* A URDF or SRDF document during reading. */
struct urdf_reader {
    const struct xml_file *file;
    struct arena *arena;
    struct import_model *model;
    struct import_notes *notes;
    struct error *error;
    struct urdf_material *material; /* sorted by name */
    size_t nmaterial;
};

static enum error_code urdf_no_memory(const struct urdf_reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this robot",
                     r->file->name);
}

/* Copies an attribute that must exist into the arena. */
static enum error_code urdf_need_text(const struct urdf_reader *r, const xmlNode *node,
                                      const char *name, const char **text)
{
    const char *found;
    enum error_code code = xml_need(r->file, node, name, &found);

    if (code) {
        return code;
    }
    *text = arena_strdup(r->arena, found);
    return *text ? ERROR_NONE : urdf_no_memory(r);
}

/* Finds the only child with a name, or NULL; refuses two. */
static enum error_code urdf_only_child(const struct urdf_reader *r, const xmlNode *node,
                                       const char *name, xmlNode **child)
{
    xmlNode *second;

    *child = xml_child(node, name);
    second = *child ? xml_next(*child, name) : NULL;
    if (second) {
        return import_error(r->error, r->file->name, xml_line(second),
                            "found a second <%s> in <%.40s>, expected one (line %d)", name,
                            (const char *)node->name, xml_line(*child));
    }
    return ERROR_NONE;
}

/* Reads the pose of a child <origin>; the identity without one. */
static enum error_code urdf_read_origin(const struct urdf_reader *r, const xmlNode *node,
                                        struct import_place *place)
{
    double rpy[3] = {0, 0, 0}, quaternion[4];
    bool by_quaternion;
    xmlNode *origin;
    enum error_code code = urdf_only_child(r, node, "origin", &origin);

    import_place_identity(place);
    if (code || !origin) {
        return code;
    }
    if ((code = xml_reals(r->file, origin, "xyz", 3, place->xyz, NULL)) ||
        (code = xml_reals(r->file, origin, "rpy", 3, rpy, NULL)) ||
        (code = xml_reals(r->file, origin, "quat_xyzw", 4, quaternion, &by_quaternion))) {
        return code;
    }
    if (by_quaternion) {
        return import_error(r->error, r->file->name, xml_line(origin),
                            "found quat_xyzw, expected rpy: URDF 1.0 knows no quaternions");
    }
    mat3_from_rpy(rpy, place->R);
    return ERROR_NONE;
}

/* Largest accepted length and limit; larger values are mistakes. */
#define LENGTH_MAX_M 1e3

/* Radius of a collision or visual sphere that the file gives radius 0. */
#define POINT_RADIUS_M 1e-3
#define ANGLE_MAX 1e6

/* Value that some tools write if a joint has no limit. */
#define NO_LIMIT (-1.0)

/* ---- colors ---- */

/* Reads the color of a <material>, clamped to 0 to 1; returns false if it has none or it is
 * invalid. */
static bool material_read_color(const struct urdf_reader *r, const xmlNode *material,
                                double color[4])
{
    const xmlNode *node = xml_child(material, "color");
    const char *text = node ? xml_attribute(node, "rgba") : NULL;

    if (!text || xml_parse_reals(r->file, node, "rgba", text, 4, color)) {
        return false;
    }
    for (int m = 0; m < 4; m++) {
        color[m] = fmin(fmax(color[m], 0.0), 1.0);
    }
    return true;
}

/* Adds a material with a name and a color; only counts it while no memory is allocated. */
static void material_add(struct urdf_reader *r, const xmlNode *material)
{
    struct urdf_material added = {.name = xml_attribute(material, "name"),
                                  .order = (int)r->nmaterial};

    if (added.name && *added.name && material_read_color(r, material, added.color)) {
        if (r->material) {
            r->material[r->nmaterial] = added;
        }
        r->nmaterial++;
    }
}

/* Adds the materials of the robot, then those of its visuals. */
static void material_add_all(struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;

    r->nmaterial = 0;
    for (const xmlNode *node = xml_child(root, "material"); node;
         node = xml_next(node, "material")) {
        material_add(r, node);
    }
    for (const xmlNode *link = xml_child(root, "link"); link; link = xml_next(link, "link")) {
        for (const xmlNode *visual = xml_child(link, "visual"); visual;
             visual = xml_next(visual, "visual")) {
            const xmlNode *material = xml_child(visual, "material");

            if (material) {
                material_add(r, material);
            }
        }
    }
}

/* Orders materials for qsort by name, then as in the file. */
static int material_compare(const void *a, const void *b)
{
    const struct urdf_material *x = a, *y = b;
    int order = strcmp(x->name, y->name);

    return order ? order : (x->order > y->order) - (x->order < y->order);
}

/* Reads all materials of the file that have a color; links are read after that. */
static enum error_code urdf_read_materials(struct urdf_reader *r)
{
    /* Count, allocate, then fill */
    material_add_all(r);
    r->material = arena_alloc(r->arena, r->nmaterial + 1, sizeof *r->material);
    if (!r->material) {
        return urdf_no_memory(r);
    }
    material_add_all(r);
    qsort(r->material, r->nmaterial, sizeof *r->material, material_compare);
    return ERROR_NONE;
}

/* Finds the first material of a name by bisection; NULL when there is none. */
static const struct urdf_material *urdf_find_material(const struct urdf_reader *r, const char *name)
{
    size_t low = 0, high = r->nmaterial;

    while (low < high) {
        size_t middle = (low + high) / 2;

        if (strcmp(r->material[middle].name, name) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < r->nmaterial && !strcmp(r->material[low].name, name) ? &r->material[low] : NULL;
}

/* Reads the color of a <visual> from its own <material>, else from the named material. Adds a note
 * on a material without a color. */
static void urdf_read_color(const struct urdf_reader *r, const xmlNode *visual,
                            struct import_geometry *shape)
{
    const xmlNode *material = xml_child(visual, "material");
    const char *name = material ? xml_attribute(material, "name") : NULL;
    const struct urdf_material *named = NULL;

    if (!material) {
        return;
    }
    shape->colored = material_read_color(r, material, shape->color);
    if (!shape->colored && name) {
        named = urdf_find_material(r, name);
    }
    if (named) {
        memcpy(shape->color, named->color, sizeof shape->color);
        shape->colored = true;
    }
    if (!shape->colored) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(material),
                        "material \"%.63s\" of link \"%.63s\": no color of four numbers%s",
                        name ? name : "", r->model->link[shape->link].name,
                        xml_child(material, "texture") ? "; textures are not read" : "");
    }
}

/* ---- links ---- */

/* Reads <inertial>: mass and inertia at its origin, into the link's frame. */
static enum error_code urdf_read_inertial(const struct urdf_reader *r, const xmlNode *node,
                                          struct import_link *link)
{
    static const char *const element[] = {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"};
    struct import_place place;
    struct robot_inertia inertia = {0};
    xmlNode *mass, *tensor;
    enum error_code code;

    if ((code = urdf_read_origin(r, node, &place)) ||
        (code = urdf_only_child(r, node, "mass", &mass)) ||
        (code = urdf_only_child(r, node, "inertia", &tensor))) {
        return code;
    }
    link->inertia_line = xml_line(node);
    if (!mass || !tensor) {
        return import_error(r->error, r->file->name, link->inertia_line,
                            "found <inertial> of link \"%.63s\" without <%s>, expected both <mass> "
                            "and <inertia>",
                            link->name, mass ? "inertia" : "mass");
    }
    if ((code = xml_need_real(r->file, mass, "value", &inertia.mass))) {
        return code;
    }

    /* Missing elements of the tensor are 0 */
    for (size_t i = 0; i < ARRAY_COUNT(element); i++) {
        if ((code = xml_reals(r->file, tensor, element[i], 1, &inertia.I[i], NULL))) {
            return code;
        }
    }
    if (inertia.mass < 0 || inertia.mass > 1e6) {
        return import_error(r->error, r->file->name, xml_line(mass),
                            "found mass %g kg of link \"%.63s\", expected 0 to 1e6", inertia.mass,
                            link->name);
    }
    link->has_inertia = inertia.mass > 0;
    if (!link->has_inertia && (inertia.I[0] != 0 || inertia.I[3] != 0 || inertia.I[5] != 0)) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, link->inertia_line,
                        "inertia of link \"%.63s\", which has no mass", link->name);
    }
    if (link->has_inertia) {
        import_add_inertia(&link->inertia, &inertia, &place);
    }
    return ERROR_NONE;
}

/* Reads the file name and scale of a <mesh>. */
static enum error_code urdf_read_mesh(const struct urdf_reader *r, const xmlNode *node,
                                      struct import_geometry *shape)
{
    enum error_code code = urdf_need_text(r, node, "filename", &shape->mesh);

    shape->shape = IMPORT_MESH;
    shape->scale[0] = shape->scale[1] = shape->scale[2] = 1;
    code = code ? code : xml_reals(r->file, node, "scale", 3, shape->scale, NULL);
    if (!code && !(shape->scale[0] * shape->scale[1] * shape->scale[2] != 0)) {
        return import_error(r->error, r->file->name, xml_line(node),
                            "found scale %g %g %g, expected no zero", shape->scale[0],
                            shape->scale[1], shape->scale[2]);
    }
    return code;
}

/* Reads a length that must be above 0, m. */
static enum error_code urdf_need_length(const struct urdf_reader *r, const xmlNode *node,
                                        const char *name, double *value)
{
    enum error_code code = xml_need_real(r->file, node, name, value);

    if (!code && !(*value > 0 && *value <= LENGTH_MAX_M)) {
        return import_error(r->error, r->file->name, xml_line(node),
                            "found %s %g m, expected more than 0 and at most %g", name, *value,
                            LENGTH_MAX_M);
    }
    return code;
}

/* Reads a <box>; its size is in full edge lengths. */
static enum error_code urdf_read_box(const struct urdf_reader *r, const xmlNode *node,
                                     struct import_geometry *shape)
{
    const char *text;
    enum error_code code = xml_need(r->file, node, "size", &text);

    code = code ? code : xml_parse_reals(r->file, node, "size", text, 3, shape->half);
    shape->shape = IMPORT_BOX;
    for (int m = 0; m < 3 && !code; m++) {
        if (!(shape->half[m] > 0 && shape->half[m] <= LENGTH_MAX_M)) {
            return import_error(r->error, r->file->name, xml_line(node),
                                "found box size \"%.60s\", expected three lengths above 0", text);
        }
        shape->half[m] *= 0.5;
    }
    return code;
}

/* Reads the shape in <geometry>; *known is false if it is not a URDF shape. */
static enum error_code urdf_read_shape(const struct urdf_reader *r, const xmlNode *geometry,
                                       struct import_geometry *shape, bool *known)
{
    const xmlNode *node = xml_child(geometry, NULL);
    enum error_code code;

    *known = true;
    if (node && xml_is(node, "mesh")) {
        return urdf_read_mesh(r, node, shape);
    }
    if (node && xml_is(node, "box")) {
        return urdf_read_box(r, node, shape);
    }

    /* Accepts a radius of 0, because some files mark points with spheres */
    if (node && xml_is(node, "sphere")) {
        shape->shape = IMPORT_SPHERE;
        code = xml_need_real(r->file, node, "radius", &shape->radius);
        return code || shape->radius == 0 ? code
                                          : urdf_need_length(r, node, "radius", &shape->radius);
    }
    if (node && (xml_is(node, "cylinder") || xml_is(node, "capsule"))) {
        shape->shape = xml_is(node, "cylinder") ? IMPORT_CYLINDER : IMPORT_CAPSULE;
        code = urdf_need_length(r, node, "radius", &shape->radius);
        return code ? code : urdf_need_length(r, node, "length", &shape->length);
    }
    *known = false;
    return ERROR_NONE;
}

/* Reads a <visual> or <collision> of a link; drops one without a known shape, with a note. */
static enum error_code urdf_read_geometry(const struct urdf_reader *r, const xmlNode *node,
                                          size_t link)
{
    struct import_model *model = r->model;
    struct import_geometry shape = {.file = model->file, .line = xml_line(node), .link = (int)link};
    bool known = false;
    xmlNode *geometry;
    enum error_code code;

    shape.collision = xml_is(node, "collision");
    shape.visual = !shape.collision;
    if ((code = urdf_read_origin(r, node, &shape.place)) ||
        (code = urdf_only_child(r, node, "geometry", &geometry))) {
        return code;
    }
    if (geometry && (code = urdf_read_shape(r, geometry, &shape, &known))) {
        return code;
    }
    if (!known) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, shape.line,
                        "%s of link \"%.63s\": no shape that URDF knows", (const char *)node->name,
                        model->link[link].name);
        return ERROR_NONE;
    }

    /* A sphere of radius 0 is a point, which cannot have contact */
    if (shape.shape == IMPORT_SPHERE && shape.radius == 0) {
        shape.radius = POINT_RADIUS_M;
        if (shape.collision) {
            import_note_add(r->notes, IMPORT_CHANGED, r->file->name, shape.line,
                            "collision sphere of link \"%.63s\", a point, has a radius of %g m",
                            model->link[link].name, POINT_RADIUS_M);
        }
    }
    if (shape.visual) {
        urdf_read_color(r, node, &shape);
    }
    model->geometry[model->ngeometry++] = shape;
    return ERROR_NONE;
}

/* Reads a link with its inertia and geometry into model->link[at]. */
static enum error_code urdf_read_link(const struct urdf_reader *r, const xmlNode *node, size_t at)
{
    struct import_link *link = &r->model->link[at];
    xmlNode *inertial;
    enum error_code code;

    link->file = r->model->file;
    link->line = xml_line(node);
    if ((code = urdf_need_text(r, node, "name", &link->name)) ||
        (code = urdf_only_child(r, node, "inertial", &inertial))) {
        return code;
    }
    if (inertial && (code = urdf_read_inertial(r, inertial, link))) {
        return code;
    }
    for (const xmlNode *child = xml_child(node, NULL); child && !code;
         child = xml_next(child, NULL)) {
        if (xml_is(child, "visual") || xml_is(child, "collision")) {
            code = urdf_read_geometry(r, child, at);
        }
    }
    return code;
}

/* ---- joints ---- */

static const struct {
    const char *word;
    enum import_joint_type type;
} joint_words[] = {
    {"fixed", IMPORT_FIXED},           {"revolute", IMPORT_REVOLUTE},
    {"continuous", IMPORT_CONTINUOUS}, {"prismatic", IMPORT_PRISMATIC},
    {"floating", IMPORT_FLOATING},     {"planar", IMPORT_PLANAR},
};

/* Reads the type of a joint; refuses unknown words. */
static enum error_code urdf_read_joint_type(const struct urdf_reader *r, const xmlNode *node,
                                            struct import_joint *joint)
{
    const char *type;
    enum error_code code = xml_need(r->file, node, "type", &type);

    for (size_t i = 0; i < ARRAY_COUNT(joint_words) && !code; i++) {
        if (!strcmp(type, joint_words[i].word)) {
            joint->type = joint_words[i].type;
            return ERROR_NONE;
        }
    }
    return code ? code
                : import_error(r->error, r->file->name, joint->line,
                               "found type \"%.40s\" of joint \"%.63s\", expected fixed, revolute, "
                               "continuous, prismatic, floating or planar",
                               type, joint->name);
}

/* Reads the axis of a joint, by default x; a moving joint needs a nonzero axis. */
static enum error_code urdf_read_axis(const struct urdf_reader *r, const xmlNode *node,
                                      struct import_joint *joint)
{
    xmlNode *axis;
    enum error_code code = urdf_only_child(r, node, "axis", &axis);

    joint->axis[0] = 1;
    joint->axis[1] = joint->axis[2] = 0;
    if (code || !axis) {
        return code;
    }
    code = xml_reals(r->file, axis, "xyz", 3, joint->axis, NULL);
    if (!code && joint->type != IMPORT_FIXED && joint->type != IMPORT_FLOATING &&
        !(vec3_norm(joint->axis) > 1e-6 && vec3_norm(joint->axis) < 1e6)) {
        return import_error(r->error, r->file->name, xml_line(axis),
                            "found axis %g %g %g of joint \"%.63s\", expected a direction",
                            joint->axis[0], joint->axis[1], joint->axis[2], joint->name);
    }
    return code;
}

/* Drops limits that some tools write for no limits: all -1, or a lower limit above the upper
 * one. */
static void urdf_drop_limits(const struct urdf_reader *r, int line, struct import_joint *joint)
{
    joint->effort = joint->effort == NO_LIMIT ? 0.0 : joint->effort;
    joint->velocity = joint->velocity == NO_LIMIT ? 0.0 : joint->velocity;
    if (joint->type == IMPORT_REVOLUTE && joint->has_limit &&
        (joint->lower > joint->upper || (joint->lower == NO_LIMIT && joint->upper == NO_LIMIT))) {
        import_note_add(r->notes, IMPORT_CHANGED, joint->file, line,
                        "limits %g to %g of joint \"%.63s\" mean none", joint->lower, joint->upper,
                        joint->name);
        joint->type = IMPORT_CONTINUOUS;
        joint->has_limit = false;
    }
}

/* Reads <limit>: range, effort and velocity, all optional. */
static enum error_code urdf_read_limit(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_joint *joint)
{
    bool lower, upper;
    xmlNode *limit;
    enum error_code code = urdf_only_child(r, node, "limit", &limit);

    if (code || !limit) {
        return code;
    }
    if ((code = xml_reals(r->file, limit, "lower", 1, &joint->lower, &lower)) ||
        (code = xml_reals(r->file, limit, "upper", 1, &joint->upper, &upper)) ||
        (code = xml_reals(r->file, limit, "effort", 1, &joint->effort, NULL)) ||
        (code = xml_reals(r->file, limit, "velocity", 1, &joint->velocity, NULL))) {
        return code;
    }

    /* URDF: a single missing limit is 0 */
    joint->has_limit = lower || upper;
    urdf_drop_limits(r, xml_line(limit), joint);
    if (joint->effort < 0 || joint->velocity < 0 || fabs(joint->lower) > ANGLE_MAX ||
        fabs(joint->upper) > ANGLE_MAX) {
        return import_error(r->error, r->file->name, xml_line(limit),
                            "found limits %g to %g, effort %g, velocity %g of joint \"%.63s\", "
                            "expected an effort and a velocity of 0 or more, and no limit beyond "
                            "%g",
                            joint->lower, joint->upper, joint->effort, joint->velocity, joint->name,
                            ANGLE_MAX);
    }
    return ERROR_NONE;
}

/* Reads <mimic>: the joint that this one follows, with multiplier and offset. */
static enum error_code urdf_read_mimic(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_joint *joint)
{
    xmlNode *mimic;
    enum error_code code = urdf_only_child(r, node, "mimic", &mimic);

    if (code || !mimic) {
        return code;
    }
    joint->multiplier = 1;
    joint->mimic_file = joint->file;
    joint->mimic_line = xml_line(mimic);
    if ((code = urdf_need_text(r, mimic, "joint", &joint->mimic)) ||
        (code = xml_reals(r->file, mimic, "multiplier", 1, &joint->multiplier, NULL))) {
        return code;
    }
    return xml_reals(r->file, mimic, "offset", 1, &joint->offset, NULL);
}

/* Reads the link that <parent> or <child> names. */
static enum error_code urdf_read_end(const struct urdf_reader *r, const xmlNode *node,
                                     const char *which, const char **link)
{
    xmlNode *end;
    enum error_code code = urdf_only_child(r, node, which, &end);

    if (!code && !end) {
        return import_error(r->error, r->file->name, xml_line(node),
                            "found a joint without <%s>, expected one", which);
    }
    return code ? code : urdf_need_text(r, end, "link", link);
}

/* Reads a joint into *joint. */
static enum error_code urdf_read_joint(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_joint *joint)
{
    xmlNode *dynamics;
    enum error_code code;

    joint->file = r->model->file;
    joint->line = xml_line(node);
    if ((code = urdf_need_text(r, node, "name", &joint->name)) ||
        (code = urdf_read_joint_type(r, node, joint)) ||
        (code = urdf_read_end(r, node, "parent", &joint->parent)) ||
        (code = urdf_read_end(r, node, "child", &joint->child)) ||
        (code = urdf_read_origin(r, node, &joint->place)) ||
        (code = urdf_read_axis(r, node, joint)) || (code = urdf_read_limit(r, node, joint)) ||
        (code = urdf_read_mimic(r, node, joint)) ||
        (code = urdf_only_child(r, node, "dynamics", &dynamics))) {
        return code;
    }

    /* <dynamics> may say damping and friction; neither can be negative */
    if (dynamics &&
        ((code = xml_reals(r->file, dynamics, "damping", 1, &joint->damping, NULL)) ||
         (code = xml_reals(r->file, dynamics, "friction", 1, &joint->friction, NULL)))) {
        return code;
    }
    if (joint->damping < 0 || joint->friction < 0) {
        return import_error(r->error, r->file->name, xml_line(dynamics),
                            "found damping %g, friction %g of joint \"%.63s\", expected 0 or more",
                            joint->damping, joint->friction, joint->name);
    }
    if (xml_child(node, "safety_controller") && joint->type != IMPORT_FIXED) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, joint->line,
                        "soft limits of the safety controller of joint \"%.63s\"", joint->name);
    }
    return ERROR_NONE;
}

/* ---- sensors ---- */

/* Reads the link or joint of a sensor: <parent link="">, <parent joint="">, or the reference of
 * <gazebo>. */
static enum error_code urdf_read_sensor_place(const struct urdf_reader *r, const xmlNode *node,
                                              const char *reference, struct import_sensor *sensor)
{
    const xmlNode *parent = xml_child(node, "parent"), *pose = xml_child(node, "pose");
    const char *link = parent ? xml_attribute(parent, "link") : reference;
    const char *joint = parent ? xml_attribute(parent, "joint") : reference;
    double xyz_rpy[6];
    enum error_code code = urdf_read_origin(r, node, &sensor->place);

    /* Gazebo's <pose>, x y z roll pitch yaw, replaces <origin> */
    if (!code && pose) {
        code = xml_parse_reals(r->file, pose, "text", xml_content(pose), 6, xyz_rpy);
        if (!code) {
            memcpy(sensor->place.xyz, xyz_rpy, sizeof sensor->place.xyz);
            mat3_from_rpy(xyz_rpy + 3, sensor->place.R);
        }
    }
    if (code) {
        return code;
    }
    sensor->link = link ? arena_strdup(r->arena, link) : NULL;
    sensor->joint = joint ? arena_strdup(r->arena, joint) : NULL;
    return (link && !sensor->link) || (joint && !sensor->joint) ? urdf_no_memory(r) : ERROR_NONE;
}

/* Reads a <sensor> of URDF or of Gazebo. reference: link or joint named by <gazebo>, or NULL.
 * Drops sensors that our robots cannot have, with a note. */
static enum error_code urdf_read_sensor(const struct urdf_reader *r, const xmlNode *node,
                                        const char *reference)
{
    const char *type = xml_attribute(node, "type"), *name = xml_attribute(node, "name");
    struct import_sensor sensor = {.file = r->model->file, .line = xml_line(node)};
    enum error_code code;

    type = type ? type : "";
    sensor.kind = strcmp(type, "force_torque") ? IMPORT_IMU : IMPORT_FT;
    code = urdf_read_sensor_place(r, node, reference, &sensor);
    if (code) {
        return code;
    }

    /* Force-torque sensors are in joints, inertial ones on links; we have no boards for others */
    if ((sensor.kind == IMPORT_FT && sensor.joint &&
         import_find_joint(r->model, sensor.joint) >= 0) ||
        (strcmp(type, "imu") == 0 && sensor.link && import_find_link(r->model, sensor.link) >= 0)) {
        sensor.name = arena_strdup(r->arena, name && *name ? name : type);
        r->model->sensor[r->model->nsensor++] = sensor;
        return sensor.name ? ERROR_NONE : urdf_no_memory(r);
    }
    import_note_add(r->notes, IMPORT_DROPPED, r->file->name, sensor.line,
                    "sensor \"%.63s\" of type \"%.40s\" at \"%.63s\"", name ? name : "", type,
                    sensor.joint  ? sensor.joint
                    : sensor.link ? sensor.link
                                  : "");
    return ERROR_NONE;
}

/* ---- the file ---- */

/* Elements without meaning for the dynamics, skipped without a note. */
static const char *const ignored[] = {"material", "group", "version", NULL};

/* ---- elements of the robot ---- */

/* Checks that the root is <robot> and that the file has no unexpanded xacro elements. */
static enum error_code urdf_check_root(const struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;

    if (!xml_is(root, "robot")) {
        return import_error(r->error, r->file->name, xml_line(root),
                            "found <%.40s>, expected <robot> of a URDF or <mujoco> of an MJCF",
                            (const char *)root->name);
    }
    for (const xmlNode *node = xml_child(root, NULL); node; node = xml_next(node, NULL)) {
        const char *prefix = node->ns && node->ns->prefix ? (const char *)node->ns->prefix : "";
        const char *name = (const char *)node->name;

        if (strcmp(prefix, "xacro") == 0 &&
            (!strcmp(name, "macro") || !strcmp(name, "include") || !strcmp(name, "property") ||
             !strcmp(name, "arg") || !strcmp(name, "if") || !strcmp(name, "unless"))) {
            return import_error(r->error, r->file->name, xml_line(node),
                                "found <xacro:%s>, expected plain URDF: run `xacro FILE "
                                ">robot.urdf` (Debian package xacro) and import that",
                                name);
        }
    }
    return ERROR_NONE;
}

/* Counts the elements of that name at any depth. */
static size_t xml_count_deep(const xmlNode *node, const char *name)
{
    size_t count = 0;

    for (const xmlNode *child = xml_child(node, NULL); child; child = xml_next(child, NULL)) {
        count += xml_is(child, name) + xml_count_deep(child, name);
    }
    return count;
}

/* Counts the children of that name. */
static size_t xml_count(const xmlNode *node, const char *name)
{
    size_t count = 0;

    for (const xmlNode *child = xml_child(node, name); child; child = xml_next(child, name)) {
        count++;
    }
    return count;
}

/* Allocates the model for all parts of the file, within limits. */
static enum error_code urdf_make_room(const struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;
    struct import_model *model = r->model;
    size_t links = xml_count(root, "link"), joints = xml_count(root, "joint");
    size_t shapes = xml_count_deep(root, "geometry"), sensors = xml_count_deep(root, "sensor");

    if (links == 0 || links > IMPORT_LINKS_MAX || joints > IMPORT_LINKS_MAX ||
        shapes > IMPORT_GEOMETRY_MAX || sensors > IMPORT_LINKS_MAX) {
        return import_error(r->error, r->file->name, xml_line(root),
                            "found %zu links, %zu joints, %zu shapes, %zu sensors, expected 1 to "
                            "%d links and as many joints and sensors, and at most %d shapes",
                            links, joints, shapes, sensors, IMPORT_LINKS_MAX, IMPORT_GEOMETRY_MAX);
    }
    model->link = arena_alloc(r->arena, links + 1, sizeof *model->link); /* plus the world */
    model->joint = arena_alloc(r->arena, joints + 1, sizeof *model->joint);
    model->geometry = arena_alloc(r->arena, shapes + 1, sizeof *model->geometry);
    model->sensor = arena_alloc(r->arena, sensors + 1, sizeof *model->sensor);
    return model->link && model->joint && model->geometry && model->sensor ? ERROR_NONE
                                                                           : urdf_no_memory(r);
}

/* Reads the gear ratio of a <transmission>; drops one without a gear or with several joints, with
 * a note. */
static enum error_code urdf_read_transmission(const struct urdf_reader *r, const xmlNode *node)
{
    const xmlNode *joint = xml_child(node, "joint"), *actuator = xml_child(node, "actuator");
    const xmlNode *gear = actuator ? xml_child(actuator, "mechanicalReduction") : NULL;
    const char *name = joint ? xml_attribute(joint, "name") : NULL;
    int at = name ? import_find_joint(r->model, name) : -1;
    double ratio;
    enum error_code code;

    gear = gear ? gear : xml_child(node, "mechanicalReduction");
    if (!gear || at < 0 || xml_next(joint, "joint")) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                        "transmission \"%.63s\": no gear of one joint",
                        xml_attribute(node, "name") ? xml_attribute(node, "name") : "");
        return ERROR_NONE;
    }
    code = xml_parse_reals(r->file, gear, "text", xml_content(gear), 1, &ratio);
    if (!code && ratio > 0) {
        r->model->joint[at].gear = ratio;
    }
    return code;
}

/* Reads the sensors of a <gazebo> element; adds a note that the rest is dropped. */
static enum error_code urdf_read_gazebo(const struct urdf_reader *r, const xmlNode *node)
{
    const char *reference = xml_attribute(node, "reference");
    char dropped[200] = "";
    size_t used = 0;

    for (const xmlNode *child = xml_child(node, NULL); child; child = xml_next(child, NULL)) {
        if (xml_is(child, "sensor")) {
            enum error_code code = urdf_read_sensor(r, child, reference);

            if (code) {
                return code;
            }
        } else if (used < sizeof dropped) {
            used += (size_t)snprintf(dropped + used, sizeof dropped - used, "%s%.40s",
                                     used ? ", " : "", (const char *)child->name);
        }
    }
    if (used) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                        "gazebo tags of \"%.63s\": %s", reference ? reference : "the robot",
                        dropped);
    }
    return ERROR_NONE;
}

/* Checks whether an element is skipped without a note. */
static bool urdf_is_ignored(const xmlNode *node)
{
    for (size_t i = 0; ignored[i]; i++) {
        if (xml_is(node, ignored[i])) {
            return true;
        }
    }
    return false;
}

/* Reads links and joints first, then the elements that refer to them. */
static enum error_code urdf_read_elements(const struct urdf_reader *r)
{
    struct import_model *model = r->model;
    enum error_code code = ERROR_NONE;
    const xmlNode *node;

    for (node = xml_child(r->file->root, NULL); node && !code; node = xml_next(node, NULL)) {
        if (xml_is(node, "link")) {
            code = urdf_read_link(r, node, model->nlink);
            model->nlink++;
        } else if (xml_is(node, "joint")) {
            code = urdf_read_joint(r, node, &model->joint[model->njoint]);
            model->njoint++;
        }
    }
    for (node = xml_child(r->file->root, NULL); node && !code; node = xml_next(node, NULL)) {
        if (xml_is(node, "transmission")) {
            code = urdf_read_transmission(r, node);
        } else if (xml_is(node, "gazebo")) {
            code = urdf_read_gazebo(r, node);
        } else if (xml_is(node, "sensor")) {
            code = urdf_read_sensor(r, node, NULL);
        } else if (!xml_is(node, "link") && !xml_is(node, "joint") && !urdf_is_ignored(node)) {
            import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                            "element <%.63s>: nothing here knows it", (const char *)node->name);
        }
    }
    return code;
}

/* ---- names ---- */

#define WORLD "world"

/* Finds the index of a link that a joint names. Suggests no similar name, because programs write
 * such files. */
static enum error_code urdf_resolve_link(const struct urdf_reader *r,
                                         const struct import_joint *joint, const char *name,
                                         int *link)
{
    *link = import_find_link(r->model, name);
    if (*link < 0) {
        return import_error(r->error, r->file->name, joint->line,
                            "found link \"%.63s\" of joint \"%.63s\", expected one of this file",
                            name, joint->name);
    }
    return ERROR_NONE;
}

/* Adds a link "world" if joints are attached to a missing link with this name, as some tools
 * write. */
static void urdf_add_world(const struct urdf_reader *r)
{
    struct import_model *model = r->model;

    for (size_t i = 0; i < model->njoint && import_find_link(model, WORLD) < 0; i++) {
        if (!strcmp(model->joint[i].parent, WORLD)) {
            model->link[model->nlink++] = (struct import_link){
                .name = WORLD, .file = model->file, .line = model->joint[i].line};
            import_note_add(r->notes, IMPORT_ASSUMED, r->file->name, model->joint[i].line,
                            "link \"" WORLD "\" of joint \"%.63s\" is not in the file: it stands "
                            "still",
                            model->joint[i].name);
        }
    }
}

/* Resolves the names of parents, children and mimicked joints; refuses duplicate names. */
static enum error_code urdf_resolve_names(const struct urdf_reader *r)
{
    struct import_model *model = r->model;

    urdf_add_world(r);

    for (size_t i = 0; i < model->nlink; i++) {
        int first = import_find_link(model, model->link[i].name);

        /* The search finds the first one with a name, so another index is a duplicate */
        if ((size_t)first != i) {
            return import_error(r->error, r->file->name, model->link[i].line,
                                "found link \"%.63s\" again, expected it once (line %d)",
                                model->link[i].name, model->link[first].line);
        }
    }
    for (size_t i = 0; i < model->njoint; i++) {
        struct import_joint *joint = &model->joint[i];
        int first = import_find_joint(model, joint->name);
        enum error_code code;

        if ((size_t)first != i) {
            return import_error(r->error, r->file->name, joint->line,
                                "found joint \"%.63s\" again, expected it once (line %d)",
                                joint->name, model->joint[first].line);
        }
        if ((code = urdf_resolve_link(r, joint, joint->parent, &joint->parent_link)) ||
            (code = urdf_resolve_link(r, joint, joint->child, &joint->child_link))) {
            return code;
        }
        if (joint->mimic && import_find_joint(model, joint->mimic) < 0) {
            return import_error(r->error, r->file->name, joint->mimic_line,
                                "found joint \"%.63s\" to be followed, expected one of this file",
                                joint->mimic);
        }
    }
    return ERROR_NONE;
}

enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    struct urdf_reader r = {file, arena, model, notes, error, NULL, 0};
    enum error_code code;

    *model = (struct import_model){.file = arena_strdup(arena, file->name)};
    if (!model->file) {
        return urdf_no_memory(&r);
    }
    if ((code = xml_check_elements(file, error)) || (code = urdf_check_root(&r)) ||
        (code = urdf_need_text(&r, file->root, "name", &model->name)) ||
        (code = urdf_make_room(&r)) || (code = urdf_read_materials(&r)) ||
        (code = urdf_read_elements(&r))) {
        return code;
    }
    return urdf_resolve_names(&r);
}

/* ---- SRDF ---- */

/* Counts the states, and in *values the joint positions of all of them. */
static size_t srdf_count_states(const xmlNode *root, size_t *values)
{
    size_t states = 0;

    *values = 0;
    for (const xmlNode *node = xml_child(root, "group_state"); node;
         node = xml_next(node, "group_state")) {
        states++;
        for (const xmlNode *joint = xml_child(node, "joint"); joint;
             joint = xml_next(joint, "joint")) {
            ++*values;
        }
    }
    return states;
}

/* Returns the model's pose of that name, or NULL. */
static struct import_pose *srdf_find_pose(struct import_model *model, const char *name)
{
    for (size_t i = 0; i < model->npose; i++) {
        if (!strcmp(model->pose[i].name, name)) {
            return &model->pose[i];
        }
    }
    return NULL;
}

/* Reads the position of one joint into the pose; drops positions of unknown joints and of joints
 * with several coordinates. */
static enum error_code srdf_read_value(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_pose *pose)
{
    struct import_value value = {.line = xml_line(node)};
    const char *name, *text;
    enum error_code code;
    int joint;

    if ((code = xml_need(r->file, node, "name", &name)) ||
        (code = xml_need(r->file, node, "value", &text))) {
        return code;
    }

    /* Skips unknown joints, and joints with several coordinates */
    joint = import_find_joint(r->model, name);
    if (joint < 0 || strpbrk(text + strspn(text, " \t\r\n"), " \t\r\n")) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, value.line,
                        "position of \"%.63s\" in pose \"%.63s\": %s", name, pose->name,
                        joint < 0 ? "the robot has no such joint"
                                  : "it has more coordinates than one");
        return ERROR_NONE;
    }
    code = xml_parse_reals(r->file, node, "value", text, 1, &value.value);
    if (code) {
        return code;
    }
    value.joint = r->model->joint[joint].name;

    /* The first value of a joint is used */
    for (size_t i = 0; i < pose->nvalue; i++) {
        if (!strcmp(pose->value[i].joint, value.joint)) {
            import_note_add(r->notes, IMPORT_DROPPED, r->file->name, value.line,
                            "second position of \"%.63s\" in pose \"%.63s\"", name, pose->name);
            return ERROR_NONE;
        }
    }
    pose->value[pose->nvalue++] = value;
    return ERROR_NONE;
}

/* Reads a state; states of several groups with one name are one pose. */
static enum error_code srdf_read_state(const struct urdf_reader *r, const xmlNode *node)
{
    struct import_model *model = r->model;
    const char *name;
    struct import_pose *pose;
    enum error_code code = urdf_need_text(r, node, "name", &name);

    if (code) {
        return code;
    }

    /* A second state of the same name belongs to another group of joints: it adds to the pose */
    pose = srdf_find_pose(model, name);
    if (!pose) {
        pose = &model->pose[model->npose++];
        *pose = (struct import_pose){.name = name, .file = r->file->name, .line = xml_line(node)};
        pose->value = arena_alloc(r->arena, model->njoint + 1, sizeof *pose->value);
        if (!pose->value) {
            return urdf_no_memory(r);
        }
    }
    for (const xmlNode *joint = xml_child(node, "joint"); joint && !code;
         joint = xml_next(joint, "joint")) {
        code = srdf_read_value(r, joint, pose);
    }
    return code;
}

enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    struct urdf_reader r = {file, arena, model, notes, error, NULL, 0};
    size_t values, states = srdf_count_states(file->root, &values);
    enum error_code code = ERROR_NONE;

    code = xml_check_elements(file, error);
    if (code) {
        return code;
    }
    if (!xml_is(file->root, "robot")) {
        return import_error(error, file->name, xml_line(file->root),
                            "found <%.40s>, expected <robot> of an SRDF",
                            (const char *)file->root->name);
    }
    if (states > 256 || values > 65536) {
        return import_error(error, file->name, xml_line(file->root),
                            "found %zu states with %zu positions, expected at most 256 and 65536",
                            states, values);
    }
    model->pose = arena_alloc(arena, states + 1, sizeof *model->pose);
    if (!model->pose) {
        return urdf_no_memory(&r);
    }

    /* The virtual joint decides whether the base floats; other elements are ignored */
    for (const xmlNode *node = xml_child(file->root, NULL); node && !code;
         node = xml_next(node, NULL)) {
        if (xml_is(node, "group_state")) {
            code = srdf_read_state(&r, node);
        } else if (xml_is(node, "virtual_joint")) {
            const char *type = xml_attribute(node, "type");

            model->floating_base |= type && !strcmp(type, "floating");
            model->fixed_base |= type && !strcmp(type, "fixed");
        }
    }
    return code;
}
