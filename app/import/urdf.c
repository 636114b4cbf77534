/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads URDF: links with inertia, geometry and colors, joints and sensors, and resolves references
 * by name. Reads SRDF: named poses, and whether the base is fixed in the world.
 */
#include "app/import/readers_private.h"

#include "base/array.h"
#include "base/text.h"
#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Largest accepted length and limit; a larger value is a mistake. */
#define LENGTH_MAX_M 1e3
#define ANGLE_MAX 1e6

/* Radius of a collision or visual sphere whose radius in the file is 0. */
#define POINT_RADIUS_M 1e-3

/* Value that some tools write for a missing limit. Limits beyond ANGLE_NONE (50 turns) also mean
 * none. */
#define NO_LIMIT (-1.0)
#define ANGLE_NONE (100.0 * M_PI)

/* Copies an attribute that must exist into the arena. */
static const char *urdf_need_text(const struct import_reader *r, const xmlNode *node,
                                  const char *name)
{
    return reader_copy(r, xml_need(r->file, node, name));
}

/* Returns the only child with a name, or NULL; refuses two. */
static xmlNode *urdf_only_child(const struct import_reader *r, const xmlNode *node,
                                const char *name)
{
    xmlNode *child = xml_child(node, name), *second = child ? xml_next(child, name) : NULL;

    if (second) {
        xml_refuse(r->file, second, "found a second <%s> in <%.40s>, expected one (line %d)", name,
                   (const char *)node->name, xml_line(child));
    }
    return child;
}

/* Reads the pose in a child <origin>; the identity if there is none. */
static void urdf_read_origin(const struct import_reader *r, const xmlNode *node,
                             struct import_place *place)
{
    const xmlNode *origin = urdf_only_child(r, node, "origin");
    double rpy[3] = {0, 0, 0};

    import_place_identity(place);
    if (!origin) {
        return;
    }
    xml_reals(r->file, origin, "xyz", 3, place->xyz);
    xml_reals(r->file, origin, "rpy", 3, rpy);
    if (xml_attribute(origin, "quat_xyzw")) {
        xml_refuse(r->file, origin, "found quat_xyzw, expected rpy: URDF 1.0 knows no quaternions");
    }
    mat3_from_rpy(rpy, place->R);
}

/* ---- colors ---- */

/* Reads the color of a <material>, limited to 0 to 1. Returns false if there is no color or it is
 * invalid. */
static bool material_read_color(const xmlNode *material, double color[4])
{
    const xmlNode *node = xml_child(material, "color");

    if (!node || !xml_try_reals(reader_text(node, "rgba"), 4, color)) {
        return false;
    }
    for (int m = 0; m < 4; m++) {
        color[m] = fmin(fmax(color[m], 0.0), 1.0);
    }
    return true;
}

/* Lists a material that has a name and a color. */
static void material_add(struct import_reader *r, const xmlNode *material)
{
    const char *name = reader_text(material, "name");
    double color[4];

    if (*name && material_read_color(material, color)) {
        xml_names_add(&r->materials, name, NULL, material, r->arena, r->error);
    }
}

/* Lists the materials of the robot, then those of its visuals. The first one with a name counts. */
static void urdf_list_materials(struct import_reader *r)
{
    const xmlNode *root = r->file->root;

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
    xml_names_sort(&r->materials);
}

/* ---- links ---- */

/* Reads <inertial> into the link's frame: mass, and inertia at its origin. */
static void urdf_read_inertial(const struct import_reader *r, const xmlNode *node,
                               struct import_link *link)
{
    static const char *const element[] = {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"};
    const xmlNode *mass = urdf_only_child(r, node, "mass");
    const xmlNode *tensor = urdf_only_child(r, node, "inertia");
    struct robot_inertia inertia = {0};
    struct import_place place;

    urdf_read_origin(r, node, &place);
    link->inertia_line = xml_line(node);
    if (!mass || !tensor) {
        xml_refuse(r->file, node,
                   "found <inertial> of link \"%.63s\" without <%s>, expected both <mass> and "
                   "<inertia>",
                   link->name, mass ? "inertia" : "mass");
        return;
    }
    inertia.mass = xml_need_real(r->file, mass, "value");

    /* Missing elements of the tensor are 0 */
    for (size_t i = 0; i < ARRAY_COUNT(element); i++) {
        xml_reals(r->file, tensor, element[i], 1, &inertia.I[i]);
    }
    if (inertia.mass < 0 || inertia.mass > 1e6) {
        xml_refuse(r->file, mass, "found mass %g kg of link \"%.63s\", expected 0 to 1e6",
                   inertia.mass, link->name);
    }
    link->has_inertia = inertia.mass > 0;
    if (link->has_inertia) {
        import_add_inertia(&link->inertia, &inertia, &place);
    } else if (inertia.I[0] != 0 || inertia.I[3] != 0 || inertia.I[5] != 0) {
        reader_note(r, IMPORT_DROPPED, node, "inertia of link \"%.63s\", which has no mass",
                    link->name);
    }
}

/* Reads a length, m. 0 is accepted, for shapes that stand for nothing. */
static double urdf_read_length(const struct import_reader *r, const xmlNode *node, const char *name)
{
    const double value = xml_need_real(r->file, node, name);

    if (!(value >= 0 && value <= LENGTH_MAX_M)) {
        xml_refuse(r->file, node, "found %s %g m, expected 0 to %g", name, value, LENGTH_MAX_M);
    }
    return value;
}

/* Reads the shape in <geometry>; returns false if it is not a URDF shape. */
static bool urdf_read_shape(const struct import_reader *r, const xmlNode *node,
                            struct import_geometry *shape)
{
    if (!node) {
        return false;
    }
    if (xml_is(node, "mesh")) {
        shape->shape = IMPORT_MESH;
        shape->mesh = urdf_need_text(r, node, "filename");
        shape->scale[0] = shape->scale[1] = shape->scale[2] = 1;
        xml_reals(r->file, node, "scale", 3, shape->scale);
        if (!(shape->scale[0] * shape->scale[1] * shape->scale[2] != 0)) {
            xml_refuse(r->file, node, "found scale %g %g %g, expected no zero", shape->scale[0],
                       shape->scale[1], shape->scale[2]);
        }
    } else if (xml_is(node, "box")) {
        const char *text = xml_need(r->file, node, "size");

        /* The file gives full edge lengths */
        shape->shape = IMPORT_BOX;
        xml_parse_reals(r->file, node, "size", text, 3, shape->half);
        for (int m = 0; m < 3; m++) {
            if (!(shape->half[m] >= 0 && shape->half[m] <= LENGTH_MAX_M)) {
                xml_refuse(r->file, node, "found box size \"%.60s\", expected three lengths", text);
            }
            shape->half[m] *= 0.5;
        }
    } else if (xml_is(node, "sphere")) {
        /* Some files mark points with spheres of radius 0 */
        shape->shape = IMPORT_SPHERE;
        shape->radius = urdf_read_length(r, node, "radius");
    } else if (xml_is(node, "cylinder") || xml_is(node, "capsule")) {
        shape->shape = xml_is(node, "cylinder") ? IMPORT_CYLINDER : IMPORT_CAPSULE;
        shape->radius = urdf_read_length(r, node, "radius");
        shape->length = urdf_read_length(r, node, "length");
    } else {
        return false;
    }
    return true;
}

/* Reads a <visual> or <collision> of a link; drops one without a known shape, with a note. */
static void urdf_read_geometry(const struct import_reader *r, const xmlNode *node, size_t link)
{
    struct import_model *model = r->model;
    const bool collision = xml_is(node, "collision");
    struct import_geometry shape = {.file = model->file,
                                    .line = xml_line(node),
                                    .link = (int)link,
                                    .collision = collision,
                                    .visual = !collision};
    const xmlNode *geometry = urdf_only_child(r, node, "geometry");

    urdf_read_origin(r, node, &shape.place);
    if (!geometry || !urdf_read_shape(r, xml_child(geometry, NULL), &shape)) {
        reader_note(r, IMPORT_DROPPED, node, "%s of link \"%.63s\": no shape that URDF knows",
                    (const char *)node->name, model->link[link].name);
        return;
    }

    /* Some files write boxes and cylinders of size 0 to mean no shape */
    if ((shape.shape == IMPORT_BOX && shape.half[0] * shape.half[1] * shape.half[2] == 0) ||
        ((shape.shape == IMPORT_CYLINDER || shape.shape == IMPORT_CAPSULE) &&
         shape.radius * shape.length == 0)) {
        reader_note(r, IMPORT_DROPPED, node, "%s of link \"%.63s\": a shape of size 0",
                    (const char *)node->name, model->link[link].name);
        return;
    }

    /* A sphere of radius 0 is a point, which cannot have contact */
    if (shape.shape == IMPORT_SPHERE && shape.radius == 0) {
        shape.radius = POINT_RADIUS_M;
        if (collision) {
            reader_note(r, IMPORT_CHANGED, node,
                        "collision sphere of link \"%.63s\", a point, has a radius of %g m",
                        model->link[link].name, POINT_RADIUS_M);
        }
    }
    if (shape.visual) {
        /* Read the color of a <visual> from its own <material>, else from the named material. Add a
         * note on a material without a color. */
        const xmlNode *material = xml_child(node, "material");
        const char *name = material ? reader_text(material, "name") : "";
        const struct xml_name *named = xml_names_find(&r->materials, name, NULL);

        shape.colored = material && (material_read_color(material, shape.color) ||
                                     (named && material_read_color(named->node, shape.color)));
        if (material && !shape.colored) {
            reader_note(r, IMPORT_DROPPED, material,
                        "material \"%.63s\" of link \"%.63s\": no color of four numbers%s", name,
                        r->model->link[shape.link].name,
                        xml_child(material, "texture") ? "; textures are not read" : "");
        }
    }
    model->geometry[model->ngeometry++] = shape;
}

/* ---- joints ---- */

/* Reads <limit>: range, effort and velocity, all optional. */
static void urdf_read_limit(const struct import_reader *r, const xmlNode *node,
                            struct import_joint *joint)
{
    const xmlNode *limit = urdf_only_child(r, node, "limit");
    bool lower, upper;

    lower = limit && xml_reals(r->file, limit, "lower", 1, &joint->lower);
    upper = limit && xml_reals(r->file, limit, "upper", 1, &joint->upper);
    if (limit) {
        xml_reals(r->file, limit, "effort", 1, &joint->effort);
        xml_reals(r->file, limit, "velocity", 1, &joint->velocity);
    }

    /* In URDF, a single missing limit is 0, and only joints that turn or slide have limits. For a
     * joint without limits, some tools write -1, a lower limit above the upper one, or huge
     * limits */
    joint->has_limit =
        (lower || upper) && (joint->type == IMPORT_REVOLUTE || joint->type == IMPORT_PRISMATIC);
    if (!joint->has_limit && (joint->lower != 0.0 || joint->upper != 0.0)) {
        reader_note(r, IMPORT_DROPPED, limit,
                    "limits %g to %g of joint \"%.63s\", whose type has none", joint->lower,
                    joint->upper, joint->name);
        joint->lower = joint->upper = 0.0;
    }
    joint->effort = joint->effort == NO_LIMIT ? 0.0 : joint->effort;
    joint->velocity = joint->velocity == NO_LIMIT ? 0.0 : joint->velocity;
    if (joint->type == IMPORT_REVOLUTE && joint->has_limit &&
        (joint->lower > joint->upper || (joint->lower == NO_LIMIT && joint->upper == NO_LIMIT) ||
         (joint->lower < -ANGLE_NONE && joint->upper > ANGLE_NONE))) {
        reader_note(r, IMPORT_CHANGED, limit, "limits %g to %g of joint \"%.63s\" mean none",
                    joint->lower, joint->upper, joint->name);
        joint->lower = joint->upper = 0.0;
        joint->has_limit = false;
    } else if (joint->type == IMPORT_REVOLUTE && !joint->has_limit) {
        reader_note(r, IMPORT_CHANGED, node,
                    "joint \"%.63s\" has no limits lower and upper: it turns without limits, as in "
                    "MuJoCo",
                    joint->name);
    }
    reader_free_limits(r, node, joint);
    if (joint->effort < 0 || joint->velocity < 0 || fabs(joint->lower) > ANGLE_MAX ||
        fabs(joint->upper) > ANGLE_MAX) {
        xml_refuse(r->file, limit,
                   "found limits %g to %g, effort %g, velocity %g of joint \"%.63s\", expected an "
                   "effort and a velocity of 0 or more, and no limit beyond %g",
                   joint->lower, joint->upper, joint->effort, joint->velocity, joint->name,
                   ANGLE_MAX);
    }
}

/* Reads the name of the link in <parent> or <child>. */
static const char *urdf_read_end(const struct import_reader *r, const xmlNode *node,
                                 const char *which)
{
    const xmlNode *end = urdf_only_child(r, node, which);

    if (!end) {
        xml_refuse(r->file, node, "found a joint without <%s>, expected one", which);
        return "";
    }
    return urdf_need_text(r, end, "link");
}

/* Reads a joint. */
static void urdf_read_joint(const struct import_reader *r, const xmlNode *node)
{
    struct import_joint *joint = &r->model->joint[r->model->njoint++];
    const xmlNode *mimic, *dynamics;

    *joint = (struct import_joint){
        .name = urdf_need_text(r, node, "name"), .file = r->model->file, .line = xml_line(node)};

    /* Read the type; refuse unknown words */
    static const char *const words[] = {
        [IMPORT_FIXED] = "fixed",           [IMPORT_REVOLUTE] = "revolute",
        [IMPORT_CONTINUOUS] = "continuous", [IMPORT_PRISMATIC] = "prismatic",
        [IMPORT_FLOATING] = "floating",     [IMPORT_PLANAR] = "planar",
    };
    const char *type = xml_need(r->file, node, "type");
    const int i = TEXT_INDEX(words, ARRAY_COUNT(words), type);

    if (i < 0) {
        xml_refuse(r->file, node,
                   "found type \"%.40s\" of joint \"%.63s\", expected fixed, revolute, continuous, "
                   "prismatic, floating or planar",
                   type, joint->name);
    }
    joint->type = (enum import_joint_type)i;
    joint->parent = urdf_read_end(r, node, "parent");
    joint->child = urdf_read_end(r, node, "child");
    urdf_read_origin(r, node, &joint->place);

    /* Read the axis, by default x; a moving joint needs a nonzero axis */
    const xmlNode *axis = urdf_only_child(r, node, "axis");

    joint->axis[0] = 1;
    joint->axis[1] = joint->axis[2] = 0;
    if (axis && xml_reals(r->file, axis, "xyz", 3, joint->axis) && joint->type != IMPORT_FIXED &&
        joint->type != IMPORT_FLOATING &&
        !(vec3_norm(joint->axis) > 1e-6 && vec3_norm(joint->axis) < 1e6)) {
        xml_refuse(r->file, axis, "found axis %g %g %g of joint \"%.63s\", expected a direction",
                   joint->axis[0], joint->axis[1], joint->axis[2], joint->name);
    }

    urdf_read_limit(r, node, joint);

    /* <mimic>: the joint that this one follows, with multiplier and offset */
    mimic = urdf_only_child(r, node, "mimic");
    if (mimic) {
        joint->multiplier = 1;
        joint->mimic_file = joint->file;
        joint->mimic_line = xml_line(mimic);
        joint->mimic = urdf_need_text(r, mimic, "joint");
        xml_reals(r->file, mimic, "multiplier", 1, &joint->multiplier);
        xml_reals(r->file, mimic, "offset", 1, &joint->offset);
    }

    /* <dynamics> may say damping and friction; neither can be negative */
    dynamics = urdf_only_child(r, node, "dynamics");
    if (dynamics) {
        xml_reals(r->file, dynamics, "damping", 1, &joint->damping);
        xml_reals(r->file, dynamics, "friction", 1, &joint->friction);
    }
    if (joint->damping < 0 || joint->friction < 0) {
        xml_refuse(r->file, dynamics,
                   "found damping %g, friction %g of joint \"%.63s\", expected 0 or more",
                   joint->damping, joint->friction, joint->name);
    }
}

/* ---- sensors ---- */

/* Returns the content of an element of a <force_torque>, "" without it. */
static const char *sensor_word(const xmlNode *force_torque, const char *name)
{
    const xmlNode *node = xml_child(force_torque, name);
    const char *text = node ? xml_content(node) : "";

    return text + strspn(text, " \t\r\n");
}

/* Rotates a force-torque sensor into the frame of Gazebo's <force_torque>: of the child (the
 * default), of the parent, or of the sensor. The robot's sensors measure the force from child to
 * parent. */
static void sensor_turn(const struct import_reader *r, const xmlNode *force_torque,
                        const struct import_joint *joint, struct import_sensor *sensor)
{
    const char *frame = sensor_word(force_torque, "frame");

    if (!strncmp(frame, "parent", 6)) {
        mat3_transpose(joint->place.R, sensor->place.R);
        if (joint->type != IMPORT_FIXED) {
            reader_note(r, IMPORT_CHANGED, force_torque,
                        "force-torque sensor \"%.63s\" in a joint that moves has the parent's axes "
                        "at 0, and turns with the child",
                        sensor->name);
        }
    } else if (strncmp(frame, "sensor", 6) != 0) {
        mat3_identity(sensor->place.R);
    }
    if (!strncmp(sensor_word(force_torque, "measure_direction"), "parent_to_child", 15)) {
        reader_note(r, IMPORT_CHANGED, force_torque,
                    "force-torque sensor \"%.63s\" measures what the child exerts on the parent: "
                    "its signs are opposite to the file's",
                    sensor->name);
    }
}

/* Reads a <sensor> of URDF or Gazebo. reference is the link or joint named by <gazebo>, or NULL.
 * Drops sensors that robot files do not have, with a note. */
static void urdf_read_sensor(const struct import_reader *r, const xmlNode *node,
                             const char *reference)
{
    const char *type = reader_text(node, "type"), *name = reader_text(node, "name");
    const xmlNode *parent = xml_child(node, "parent"), *pose = xml_child(node, "pose");
    const char *link = parent ? xml_attribute(parent, "link") : reference;
    const char *joint = parent ? xml_attribute(parent, "joint") : reference;
    const bool ft = !strcmp(type, "force_torque");
    struct import_sensor sensor = {
        .kind = ft ? IMPORT_FT : IMPORT_IMU, .file = r->model->file, .line = xml_line(node)};
    double xyz_rpy[6];

    /* Gazebo's <pose>, x y z roll pitch yaw, replaces <origin> */
    urdf_read_origin(r, node, &sensor.place);
    if (pose) {
        xml_parse_reals(r->file, pose, "text", xml_content(pose), 6, xyz_rpy);
        memcpy(sensor.place.xyz, xyz_rpy, sizeof sensor.place.xyz);
        mat3_from_rpy(xyz_rpy + 3, sensor.place.R);
    }

    /* Force-torque sensors are in joints, inertial sensors on links; other sensors have no board */
    if ((ft && joint && import_find_joint(r->model, joint) >= 0) ||
        (!strcmp(type, "imu") && link && import_find_link(r->model, link) >= 0)) {
        sensor.name = reader_copy(r, *name ? name : type);
        sensor.link = link ? reader_copy(r, link) : NULL;
        sensor.joint = joint ? reader_copy(r, joint) : NULL;
        if (ft && xml_child(node, "force_torque")) {
            sensor_turn(r, xml_child(node, "force_torque"),
                        &r->model->joint[import_find_joint(r->model, joint)], &sensor);
        }
        r->model->sensor[r->model->nsensor++] = sensor;
    } else {
        reader_note(r, IMPORT_DROPPED, node, "sensor \"%.63s\" of type \"%.40s\" at \"%.63s\"",
                    name, type,
                    joint  ? joint
                    : link ? link
                           : "");
    }
}

/* ---- elements of the robot ---- */

/* Checks that the root is <robot> and that the file has no unexpanded xacro elements. */
static void urdf_check_root(const struct import_reader *r)
{
    static const char *const xacro[] = {"macro", "include", "property", "arg", "if", "unless"};
    const xmlNode *root = r->file->root;

    if (!xml_is(root, "robot")) {
        xml_refuse(r->file, root,
                   "found <%.40s>, expected <robot> of a URDF or <mujoco> of an MJCF",
                   (const char *)root->name);
    }
    for (const xmlNode *node = xml_child(root, NULL); node; node = xml_next(node, NULL)) {
        const char *prefix = node->ns && node->ns->prefix ? (const char *)node->ns->prefix : "";

        for (size_t i = 0; i < ARRAY_COUNT(xacro) && !strcmp(prefix, "xacro"); i++) {
            if (!strcmp((const char *)node->name, xacro[i])) {
                xml_refuse(r->file, node,
                           "found <xacro:%s>, expected plain URDF: run `xacro FILE >robot.urdf` "
                           "(Debian package xacro) and import that",
                           xacro[i]);
            }
        }
    }
}

/* Counts the children of that name. */
static size_t xml_count_children(const xmlNode *node, const char *name)
{
    size_t count = 0;

    for (const xmlNode *child = xml_child(node, name); child; child = xml_next(child, name)) {
        count++;
    }
    return count;
}

/* Reads the gear ratio of a <transmission>, whose joint is driven. Drops a transmission without a
 * gear or with several joints, with a note. */
static void urdf_read_transmission(const struct import_reader *r, const xmlNode *node)
{
    const xmlNode *joint = xml_child(node, "joint"), *actuator = xml_child(node, "actuator");
    const xmlNode *gear = actuator ? xml_child(actuator, "mechanicalReduction") : NULL;
    const char *name = joint ? xml_attribute(joint, "name") : NULL;
    int at = name ? import_find_joint(r->model, name) : -1;
    double ratio;

    if (at >= 0) {
        r->model->joint[at].driven = true;
    }
    gear = gear ? gear : xml_child(node, "mechanicalReduction");
    if (!gear || at < 0 || xml_next(joint, "joint")) {
        reader_note(r, IMPORT_DROPPED, node, "transmission \"%.63s\": no gear of one joint",
                    reader_text(node, "name"));
        return;
    }
    xml_parse_reals(r->file, gear, "text", xml_content(gear), 1, &ratio);
    r->model->joint[at].gear = ratio > 0 ? ratio : r->model->joint[at].gear;
}

/* Reads links and joints first, then the elements that refer to them. */
static void urdf_read_elements(const struct import_reader *r)
{
    const xmlNode *root = r->file->root;

    for (const xmlNode *node = xml_child(root, NULL); node; node = xml_next(node, NULL)) {
        if (xml_is(node, "link")) {
            /* Read the link with its inertia and geometry */
            const size_t at = r->model->nlink++;
            struct import_link *link = &r->model->link[at];
            const xmlNode *inertial = urdf_only_child(r, node, "inertial");

            *link = (struct import_link){.name = urdf_need_text(r, node, "name"),
                                         .file = r->model->file,
                                         .line = xml_line(node)};
            if (inertial) {
                urdf_read_inertial(r, inertial, link);
            }
            for (const xmlNode *child = xml_child(node, NULL); child;
                 child = xml_next(child, NULL)) {
                if (xml_is(child, "visual") || xml_is(child, "collision")) {
                    urdf_read_geometry(r, child, at);
                }
            }
        } else if (xml_is(node, "joint")) {
            urdf_read_joint(r, node);
        }
    }
    for (const xmlNode *node = xml_child(root, NULL); node; node = xml_next(node, NULL)) {
        if (xml_is(node, "transmission")) {
            urdf_read_transmission(r, node);
        } else if (xml_is(node, "gazebo")) {
            for (const xmlNode *sensor = xml_child(node, "sensor"); sensor;
                 sensor = xml_next(sensor, "sensor")) {
                urdf_read_sensor(r, sensor, xml_attribute(node, "reference"));
            }
        } else if (xml_is(node, "sensor")) {
            urdf_read_sensor(r, node, NULL);
        }
    }
}

/* What the functions above read. Elements with NULL have notes of their own, or no effect. */
static const struct reader_row urdf_attributes[] = {
    {"robot", "version"},
    {"link", ""},
    {"inertial", ""},
    {"origin", "xyz rpy"},
    {"mass", "value"},
    {"inertia", "ixx ixy ixz iyy iyz izz"},
    {"visual", ""},
    {"collision", ""},
    {"geometry", ""},
    {"box", "size"},
    {"sphere", "radius"},
    {"cylinder", "radius length"},
    {"capsule", "radius length"},
    {"mesh", "filename scale"},
    {"material", ""},
    {"color", "rgba"},
    {"joint", "type"},
    {"parent", "link joint"},
    {"child", "link"},
    {"axis", "xyz"},
    {"limit", "lower upper effort velocity"},
    {"dynamics", "damping friction"},
    {"mimic", "joint multiplier offset"},
    {"transmission", ""},
    {"actuator", ""},
    {"mechanicalReduction", ""},
    {"gazebo", "reference"},
    {"sensor", "type"},
    {"pose", ""},
    {"force_torque", ""},
    {"frame", ""},
    {"measure_direction", ""},
    {"group", NULL},
    {"version", NULL},
    {0},
};

/* ---- names ---- */

#define WORLD "world"

/* Returns the index of the link that a joint names. Suggests no similar name, because programs
 * write such files. */
static int urdf_resolve_link(const struct import_reader *r, const struct import_joint *joint,
                             const char *name)
{
    const int link = import_find_link(r->model, name);

    if (link < 0) {
        import_error(r->error, r->file->name, joint->line,
                     "found link \"%.63s\" of joint \"%.63s\", expected one of this file", name,
                     joint->name);
    }
    return link;
}

/* Resolves the names of parents, children and mimicked joints. Refuses duplicate names. If joints
 * are attached to a missing link "world", as some tools write, adds this link. */
static void urdf_resolve_names(const struct import_reader *r)
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
    reader_check_names(r, "link");
    for (size_t i = 0; i < model->njoint; i++) {
        struct import_joint *joint = &model->joint[i];

        joint->parent_link = urdf_resolve_link(r, joint, joint->parent);
        joint->child_link = urdf_resolve_link(r, joint, joint->child);
        if (joint->mimic && import_find_joint(model, joint->mimic) < 0) {
            import_error(r->error, r->file->name, joint->mimic_line,
                         "found joint \"%.63s\" to be followed, expected one of this file",
                         joint->mimic);
        }
    }
}

enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    struct import_reader r = {
        .file = file, .arena = arena, .model = model, .notes = notes, .error = error};

    *model = (struct import_model){.file = reader_copy(&r, file->name)};
    r.unread = reader_alloc(&r, 1, sizeof *r.unread);
    xml_check_elements(file);
    urdf_check_root(&r);
    model->name = urdf_need_text(&r, file->root, "name");

    /* Allocate the model for all parts of the file, within limits */
    const xmlNode *root = r.file->root;
    const size_t links = xml_count_children(root, "link"), shapes = xml_count(root, "geometry");
    const size_t joints = xml_count_children(root, "joint"), sensors = xml_count(root, "sensor");

    if (links == 0 || links > IMPORT_LINKS_MAX || joints > IMPORT_LINKS_MAX ||
        shapes > IMPORT_GEOMETRY_MAX || sensors > IMPORT_LINKS_MAX) {
        xml_refuse(r.file, root,
                   "found %zu links, %zu joints, %zu shapes, %zu sensors, expected 1 to %d links "
                   "and as many joints and sensors, and at most %d shapes",
                   links, joints, shapes, sensors, IMPORT_LINKS_MAX, IMPORT_GEOMETRY_MAX);
    }
    reader_make_room(&r, links + 1, joints, shapes, sensors); /* one more link: the world */

    urdf_list_materials(&r);
    if (!error->code) {
        urdf_read_elements(&r);
        urdf_resolve_names(&r);
        reader_report(&r, urdf_attributes);
    }
    return error->code;
}

/* ---- SRDF ---- */

/* Reads the position of one joint into the pose. Drops positions of unknown joints and of joints
 * with several coordinates. */
static void srdf_read_value(const struct import_reader *r, const xmlNode *node,
                            struct import_pose *pose)
{
    const char *name = xml_need(r->file, node, "name"), *text = xml_need(r->file, node, "value");
    const int joint = import_find_joint(r->model, name);
    struct import_value *value = &pose->value[pose->nvalue];

    if (joint < 0 || strpbrk(text + strspn(text, " \t\r\n"), " \t\r\n")) {
        reader_note(r, IMPORT_DROPPED, node, "position of \"%.63s\" in pose \"%.63s\": %s", name,
                    pose->name,
                    joint < 0 ? "the robot has no such joint" : "it has more coordinates than one");
        return;
    }

    /* Only the first value of a joint counts */
    if (TEXT_FIND(pose->value, pose->nvalue, joint, name) >= 0) {
        reader_note(r, IMPORT_DROPPED, node, "second position of \"%.63s\" in pose \"%.63s\"", name,
                    pose->name);
        return;
    }
    value->joint = r->model->joint[joint].name;
    xml_parse_reals(r->file, node, "value", text, 1, &value->value);
    pose->nvalue++;
}

/* Reads a state. A second state with the same name is for another group of joints, and adds to the
 * pose. */
static void srdf_read_state(const struct import_reader *r, const xmlNode *node)
{
    struct import_model *model = r->model;
    const char *name = xml_need(r->file, node, "name");
    struct import_pose *pose = model->pose;

    while (pose < model->pose + model->npose && strcmp(pose->name, name) != 0) {
        pose++;
    }
    if (pose == model->pose + model->npose) {
        *pose = (struct import_pose){
            .name = reader_copy(r, name), .file = r->file->name, .line = xml_line(node)};
        pose->value = reader_alloc(r, model->njoint + 1, sizeof *pose->value);
        model->npose++;
    }
    for (const xmlNode *joint = xml_child(node, "joint"); joint && pose->value;
         joint = xml_next(joint, "joint")) {
        srdf_read_value(r, joint, pose);
    }
}

enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    const struct import_reader r = {
        .file = file, .arena = arena, .model = model, .notes = notes, .error = error};
    const size_t states = xml_count_children(file->root, "group_state");
    const size_t values = xml_count(file->root, "joint");

    xml_check_elements(file);
    if (!xml_is(file->root, "robot")) {
        xml_refuse(file, file->root, "found <%.40s>, expected <robot> of an SRDF",
                   (const char *)file->root->name);
    }
    if (states > 256 || values > 65536) {
        xml_refuse(file, file->root,
                   "found %zu states with %zu positions, expected at most 256 and 65536", states,
                   values);
    }
    model->pose = reader_alloc(&r, states + 1, sizeof *model->pose);

    /* The virtual joint decides whether the base floats; other elements are ignored */
    for (const xmlNode *node = xml_child(file->root, NULL); node && !error->code;
         node = xml_next(node, NULL)) {
        if (xml_is(node, "group_state")) {
            srdf_read_state(&r, node);
        } else if (xml_is(node, "virtual_joint")) {
            model->floating_base |= !strcmp(reader_text(node, "type"), "floating");
            model->fixed_base |= !strcmp(reader_text(node, "type"), "fixed");
        }
    }
    return error->code;
}
