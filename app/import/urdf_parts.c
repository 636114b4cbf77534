/* SPDX-License-Identifier: Apache-2.0 */
/* Reads URDF links, joints and sensors. */
#include "app/import/urdf_private.h"

#include "base/array.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Largest length and limit that are accepted: beyond them no robot is meant. */
#define LENGTH_MAX_M 1e3

/* Radius of a collision or visual sphere that the file gives radius 0. */
#define POINT_RADIUS_M 1e-3
#define ANGLE_MAX 1e6

/* Value that some tools write for a limit that a joint does not have. */
#define NO_LIMIT (-1.0)

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
    if ((code = xml_need_real(r->file, mass, "value", &inertia.mass, r->error))) {
        return code;
    }

    /* Elements of the tensor that are left out are 0 */
    for (size_t i = 0; i < ARRAY_COUNT(element); i++) {
        if ((code = xml_reals(r->file, tensor, element[i], 1, &inertia.I[i], NULL, r->error))) {
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
    code = code ? code : xml_reals(r->file, node, "scale", 3, shape->scale, NULL, r->error);
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
    enum error_code code = xml_need_real(r->file, node, name, value, r->error);

    if (!code && !(*value > 0 && *value <= LENGTH_MAX_M)) {
        return import_error(r->error, r->file->name, xml_line(node),
                            "found %s %g m, expected more than 0 and at most %g", name, *value,
                            LENGTH_MAX_M);
    }
    return code;
}

/* Reads a <box>, whose size is its whole sides. */
static enum error_code urdf_read_box(const struct urdf_reader *r, const xmlNode *node,
                                     struct import_geometry *shape)
{
    const char *text;
    enum error_code code = xml_need(r->file, node, "size", &text, r->error);

    code = code ? code : xml_parse_reals(r->file, node, "size", text, 3, shape->half, r->error);
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

/* Reads the shape in <geometry>; *known is false when it is none of URDF's. */
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

    /* A radius of 0 is accepted here: some files mark points with spheres */
    if (node && xml_is(node, "sphere")) {
        shape->shape = IMPORT_SPHERE;
        code = xml_need_real(r->file, node, "radius", &shape->radius, r->error);
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

/* Reads a <visual> or <collision> of a link; notes and drops one without a known shape. */
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

    /* A sphere of radius 0 is a point, which nothing could touch */
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

enum error_code urdf_read_link(const struct urdf_reader *r, const xmlNode *node, size_t at)
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
    enum error_code code = xml_need(r->file, node, "type", &type, r->error);

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

/* Reads the axis of a joint, by default x; one that moves needs a direction. */
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
    code = xml_reals(r->file, axis, "xyz", 3, joint->axis, NULL, r->error);
    if (!code && joint->type != IMPORT_FIXED && joint->type != IMPORT_FLOATING &&
        !(vec3_norm(joint->axis) > 1e-6 && vec3_norm(joint->axis) < 1e6)) {
        return import_error(r->error, r->file->name, xml_line(axis),
                            "found axis %g %g %g of joint \"%.63s\", expected a direction",
                            joint->axis[0], joint->axis[1], joint->axis[2], joint->name);
    }
    return code;
}

/* Drops limits that some tools write where there are none: -1 throughout, or a lower one above the
 * upper one. */
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

/* Reads <limit>: range, effort and velocity, none of which must be there. */
static enum error_code urdf_read_limit(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_joint *joint)
{
    bool lower, upper;
    xmlNode *limit;
    enum error_code code = urdf_only_child(r, node, "limit", &limit);

    if (code || !limit) {
        return code;
    }
    if ((code = xml_reals(r->file, limit, "lower", 1, &joint->lower, &lower, r->error)) ||
        (code = xml_reals(r->file, limit, "upper", 1, &joint->upper, &upper, r->error)) ||
        (code = xml_reals(r->file, limit, "effort", 1, &joint->effort, NULL, r->error)) ||
        (code = xml_reals(r->file, limit, "velocity", 1, &joint->velocity, NULL, r->error))) {
        return code;
    }

    /* URDF: of the two limits, one that is left out is 0 */
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
        (code = xml_reals(r->file, mimic, "multiplier", 1, &joint->multiplier, NULL, r->error))) {
        return code;
    }
    return xml_reals(r->file, mimic, "offset", 1, &joint->offset, NULL, r->error);
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

enum error_code urdf_read_joint(const struct urdf_reader *r, const xmlNode *node,
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
        ((code = xml_reals(r->file, dynamics, "damping", 1, &joint->damping, NULL, r->error)) ||
         (code = xml_reals(r->file, dynamics, "friction", 1, &joint->friction, NULL, r->error)))) {
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

/* Reads where a sensor is fixed: by <parent link=""> or <parent joint="">, or to what <gazebo>
 * refers to. */
static enum error_code urdf_read_sensor_place(const struct urdf_reader *r, const xmlNode *node,
                                              const char *reference, struct import_sensor *sensor)
{
    const xmlNode *parent = xml_child(node, "parent"), *pose = xml_child(node, "pose");
    const char *link = parent ? xml_attribute(parent, "link") : reference;
    const char *joint = parent ? xml_attribute(parent, "joint") : reference;
    double xyz_rpy[6];
    enum error_code code = urdf_read_origin(r, node, &sensor->place);

    /* Gazebo's <pose>, x y z roll pitch yaw, counts instead of <origin> */
    if (!code && pose) {
        code = xml_parse_reals(r->file, pose, "text", xml_content(pose), 6, xyz_rpy, r->error);
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

enum error_code urdf_read_sensor(const struct urdf_reader *r, const xmlNode *node,
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

    /* Force-torque sensors sit in joints, inertial ones on links; others have no board here */
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
