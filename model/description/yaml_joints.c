/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the bodies and joints of a robot file: the tree, with parallel springs, in the order of
 * joints. */
#include "base/text.h"
#include "base/vec3.h"
#include "model/description/yaml.h"

#include <math.h>
#include <string.h>

/* Tolerance of an axis's length: an axis with six digits counts as a unit vector and is
 * normalized. */
#define AXIS_TOLERANCE 1e-6

enum error_code robot_refuse_inertia(struct robot_builder *b, const struct yaml_mark *mark,
                                     const struct robot_inertia *inertia)
{
    struct error why;

    return robot_check_inertia(inertia, &why) ? yaml_error(b->error, mark, "%s", why.text)
                                              : ERROR_NONE;
}

/* Builds a body of the tree from entry `at` of the file. */
static enum error_code build_tree_body(struct robot_builder *b, int at, int parent,
                                       struct robot_body *body)
{
    const struct body_yaml *given = &b->file.body[at];

    *body = given->body;
    body->parent = parent;
    return robot_refuse_inertia(b, yaml_place(&given->mark, "inertia_kg_m2"), &body->inertia);
}

size_t robot_count_keys(const struct yaml_mark *mapping, const char *const *keys, size_t count)
{
    size_t given = 0;

    for (size_t i = 0; i < count; i++) {
        given += yaml_has(mapping, keys[i]);
    }
    return given;
}

/* Returns the joint that moves the body with this name, or -1. */
static int joint_that_moves(const struct robot_yaml *file, const char *body)
{
    return TEXT_FIND(file->joint, file->njoint, child, body);
}

/* Finds a body of the file by name. Errors point to the key in the mapping. */
static enum error_code find_file_body(struct robot_builder *b, const struct yaml_mark *mapping,
                                      const char *key, const char *name, int *at)
{
    return yaml_find_name(YAML_NAMES(b->file.body, b->file.nbody, body.name), "body", name,
                          yaml_place(mapping, key), at, b->error);
}

/* Refuses joint j because no earlier joint moves its parent. The error gives the reason. */
static enum error_code refuse_parent(struct robot_builder *b, size_t j)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int up = joint_that_moves(file, joint->parent), at;
    enum error_code code = find_file_body(b, &joint->mark, "parent", joint->parent, &at);

    /* The parent does not exist, or no joint moves it */
    if (code) {
        return code;
    }
    if (up < 0) {
        return yaml_error(
            b->error, yaml_place(&joint->mark, "parent"),
            "found parent \"%s\", which no joint moves and which is not the base \"%s\"",
            joint->parent, file->base);
    }

    /* Walk up the tree. If the walk returns to j, the joints form a cycle; otherwise their order is
     * wrong */
    for (size_t step = 0; up >= 0 && step < file->njoint; step++) {
        if ((size_t)up == j) {
            return yaml_error(
                b->error, yaml_place(&joint->mark, "parent"),
                "found a cycle: body \"%s\" hangs on \"%s\", which hangs on it, expected a tree",
                joint->child, joint->parent);
        }
        up = joint_that_moves(file, file->joint[up].parent);
    }
    return yaml_error(
        b->error, yaml_place(&joint->mark, "parent"),
        "found parent \"%s\" before joint \"%s\" that moves it (line %d), expected parents first",
        joint->parent, file->joint[joint_that_moves(file, joint->parent)].joint.name,
        file->joint[joint_that_moves(file, joint->parent)].mark.line);
}

/* Finds the body that joint j moves. Checks that no other joint moves it and that it is not the
 * base. */
static enum error_code check_joint_child(struct robot_builder *b, size_t j, int *at)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int first = joint_that_moves(file, joint->child);
    enum error_code code = find_file_body(b, &joint->mark, "child", joint->child, at);

    if (code) {
        return code;
    }
    if (strcmp(joint->child, file->base) == 0) {
        return yaml_error(
            b->error, yaml_place(&joint->mark, "child"),
            "found the base \"%s\" as a joint's child, expected a body that hangs on another",
            joint->child);
    }
    if ((size_t)first != j) {
        return yaml_error(
            b->error, yaml_place(&joint->mark, "child"),
            "found body \"%s\" moved by a second joint, expected one (\"%s\" in line %d moves it)",
            joint->child, file->joint[first].joint.name, file->joint[first].mark.line);
    }
    return ERROR_NONE;
}

static const char *const type_word[] = {
    [JOINT_REVOLUTE] = "revolute", [JOINT_PRISMATIC] = "prismatic"};

/* Checks the limits of a joint, given by the keys of its type. */
static enum error_code check_limits(struct robot_builder *b, const struct joint_yaml *given)
{
    static const char *const keys[][3] = {{"lower_rad", "upper_rad", "torque_nm"},
                                          {"lower_m", "upper_m", "force_n"}};
    const struct yaml_mark *mark = yaml_place(&given->mark, "limits");
    const struct robot_joint *joint = &given->joint;

    if (robot_count_keys(mark, keys[joint->type], 3) < 3 ||
        robot_count_keys(mark, keys[1 - joint->type], 3) > 0) {
        return yaml_error(b->error, mark,
                          "found limits of %s joint \"%s\", expected the keys %s, %s, %s",
                          type_word[joint->type], joint->name, keys[joint->type][0],
                          keys[joint->type][1], keys[joint->type][2]);
    }
    if (!(joint->lower < joint->upper)) {
        return yaml_error(b->error, mark,
                          "found lower limit %g not below upper limit %g of joint \"%s\"",
                          joint->lower, joint->upper, joint->name);
    }
    return ERROR_NONE;
}

/* Default compression of a stop (rad or m) under the joint's limit of torque or force. */
#define STOP_GIVES 5e-4

/* Builds the stops of a joint's range. Missing values come from the robot's own stops. */
static enum error_code build_stops(struct robot_builder *b, const struct joint_yaml *given,
                                   struct robot_joint *joint)
{
    static const char *const keys[][2] = {{"stiffness_nm_rad", "damping_nm_s_rad"},
                                          {"stiffness_n_m", "damping_n_s_m"}};
    const struct yaml_mark *own = &given->stops.mark, *all = &b->file.stops.mark;
    const char *const *key = keys[joint->type];
    struct stops_yaml stops = b->file.stops;

    /* Refuses keys for the other type of joint */
    if (robot_count_keys(own, keys[1 - joint->type], 2) > 0) {
        return yaml_error(b->error, own, "found stops of %s joint \"%s\", expected the keys %s, %s",
                          type_word[joint->type], joint->name, key[0], key[1]);
    }
    yaml_override(&robot_stops_schema, own, &given->stops, &stops);
    if ((yaml_has(own, "enabled") || yaml_has(all, "enabled")) && !stops.enabled) {
        return ERROR_NONE;
    }
    joint->stop = stops.stop[joint->type];
    if (!yaml_has(own, key[0]) && !yaml_has(all, key[0])) {
        joint->stop.stiffness =
            joint->torque_limit > 0.0 ? joint->torque_limit / STOP_GIVES : 1.0 / STOP_GIVES;
    }
    if (!yaml_has(own, key[1]) && !yaml_has(all, key[1])) {
        joint->stop.damping = STOP_RETURNS * joint->stop.stiffness;
    }
    return ERROR_NONE;
}

/* Builds the parallel spring of a joint, if it has one. */
static enum error_code build_spring(struct robot_builder *b, const struct joint_yaml *given,
                                    struct robot_parallel_spring *spring)
{
    const struct yaml_mark *mark = yaml_place(&given->mark, "parallel_spring");

    spring->present = yaml_has(&given->mark, "parallel_spring");
    spring->s = (double)given->spring_sense;
    if (spring->present && given->joint.type != JOINT_REVOLUTE) {
        return yaml_error(b->error, mark,
                          "found a parallel spring on prismatic joint \"%s\", expected none: its "
                          "rope runs over a pulley",
                          given->joint.name);
    }
    return spring->present && given->spring_sense == 0
               ? yaml_error(b->error, yaml_place(mark, "sense"), "found sense 0, expected 1 or -1")
               : ERROR_NONE;
}

/* Builds the passive spring of a joint: the joint's own spring, or the robot's default for a
 * revolute joint with a drive. */
static enum error_code build_passive(struct robot_builder *b, const struct joint_yaml *given,
                                     struct robot_joint *joint)
{
    static const char *const keys[][3] = {{"stiffness_nm_rad", "damping_nm_s_rad", "rest_rad"},
                                          {"stiffness_n_m", "damping_n_s_m", "rest_m"}};
    const bool own = yaml_has(&given->mark, "passive") || joint->type != JOINT_REVOLUTE ||
                     !robot_joint_is_driven(joint);
    const struct passive_yaml *from = own ? &given->passive : &b->file.passive;
    const char *const *key = keys[joint->type];

    joint->passive = from->passive;
    return robot_count_keys(&from->mark, keys[1 - joint->type], 3) > 0
               ? yaml_error(
                     b->error, &from->mark,
                     "found a passive spring of %s joint \"%s\", expected the keys %s, %s, %s",
                     type_word[joint->type], joint->name, key[0], key[1], key[2])
               : ERROR_NONE;
}

/* Builds joint j and the body that it moves. */
static enum error_code build_joint(struct robot_builder *b, size_t j)
{
    struct joint_yaml *given = &b->file.joint[j];
    struct robot *robot = b->robot;
    struct robot_joint *joint = &robot->joint[j];
    const double length = vec3_norm(given->joint.axis);
    enum error_code code;
    int at, parent;

    /* The parent is the base or the body of an earlier joint */
    robot->nbody = j + 1;
    if ((code = check_joint_child(b, j, &at))) {
        return code;
    }
    parent = robot_find_body(robot, given->parent);
    if (parent < 0) {
        return refuse_parent(b, j);
    }

    /* Build the joint, then the body that it moves */
    *joint = given->joint;
    mat3_from_rpy(given->rpy, joint->rotation);
    if (!(fabs(length - 1.0) <= AXIS_TOLERANCE)) {
        return yaml_error(b->error, yaml_place(&given->mark, "axis"),
                          "found an axis of length %.9g, expected a unit vector", length);
    }
    for (int m = 0; m < 3; m++) {
        joint->axis[m] /= length;
    }
    if ((code = check_limits(b, given)) || (code = build_stops(b, given, joint)) ||
        (code = robot_build_drive(b, given, joint)) ||
        (code = build_spring(b, given, &joint->spring)) ||
        (code = build_passive(b, given, joint))) {
        return code;
    }
    return build_tree_body(b, at, parent, &robot->body[j + 1]);
}

/* Builds the bodies in the order of the joints that move them. */
enum error_code robot_build_tree(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code;
    int base;

    robot->body = arena_alloc(b->arena, file->njoint + 1, sizeof *robot->body);
    robot->joint = arena_alloc(b->arena, file->njoint, sizeof *robot->joint);
    if (!robot->body || !robot->joint) {
        return robot_no_memory(b);
    }

    /* Build the base, then each joint with its body */
    if ((code = find_file_body(b, &file->mark, "base.body", file->base, &base)) ||
        (code = build_tree_body(b, base, -1, &robot->body[0]))) {
        return code;
    }
    for (size_t j = 0; j < file->njoint; j++) {
        if ((code = build_joint(b, j))) {
            return code;
        }
    }

    /* Refuse bodies that no joint moves */
    for (size_t i = 0; i < file->nbody; i++) {
        if ((int)i != base && joint_that_moves(file, file->body[i].body.name) < 0) {
            return yaml_error(b->error, &file->body[i].mark,
                              "found body \"%s\" that no joint moves, expected it to be a joint's "
                              "child or the base",
                              file->body[i].body.name);
        }
    }
    robot->njoint = file->njoint;
    robot->nbody = file->njoint + 1;
    return ERROR_NONE;
}
