/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the bodies and joints of a robot file: the tree, with parallel springs, in the order of
 * joints. */
#include "base/vec3.h"
#include "model/description/yaml.h"

#include <math.h>
#include <string.h>

/* Tolerance of an axis's length: one that is written with six digits counts as a unit vector and
 * is normalized. */
#define AXIS_TOLERANCE 1e-6

enum error_code robot_build_inertia(struct robot_builder *b, const struct yaml_mark *mark,
                                    double mass, const double com[3], const double I[6],
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

/* Builds a body of the tree from the entry at in the file. */
static enum error_code build_tree_body(struct robot_builder *b, int at, int parent,
                                       struct robot_body *body)
{
    const struct body_yaml *given = &b->file.body[at];

    body->name = given->name;
    body->parent = parent;
    return robot_build_inertia(b, &given->inertia_mark, given->mass, given->com, given->I,
                               &body->inertia);
}

/* Returns the joint that moves the body of this name, or -1. */
static int joint_that_moves(const struct robot_yaml *file, const char *body)
{
    for (size_t j = 0; j < file->njoint; j++) {
        if (strcmp(file->joint[j].child, body) == 0) {
            return (int)j;
        }
    }
    return -1;
}

/* Refuses joint j, whose parent no joint before it moves, and says why. */
static enum error_code refuse_parent(struct robot_builder *b, size_t j)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int up = joint_that_moves(file, joint->parent);

    /* No such body, or one that hangs in the air */
    if (find_named_entry(file->body, file->nbody, sizeof *file->body, joint->parent) < 0) {
        return robot_unknown_name(b, &joint->parent_mark, "body", joint->parent, file->body,
                                  file->nbody, sizeof *file->body);
    }
    if (up < 0) {
        return yaml_error(
            b->error, &joint->parent_mark,
            "found parent \"%s\", which no joint moves and which is not the base \"%s\"",
            joint->parent, file->base.body);
    }

    /* Up from joint to joint: either back here, or the order is wrong */
    for (size_t step = 0; up >= 0 && step < file->njoint; step++) {
        if ((size_t)up == j) {
            return yaml_error(b->error, &joint->parent_mark,
                              "found a cycle: body \"%s\" hangs on \"%s\", which hangs on it, "
                              "expected a tree",
                              joint->child, joint->parent);
        }
        up = joint_that_moves(file, file->joint[up].parent);
    }
    return yaml_error(b->error, &joint->parent_mark,
                      "found parent \"%s\" before joint \"%s\" that moves it (line %d), expected "
                      "parents first",
                      joint->parent, file->joint[joint_that_moves(file, joint->parent)].name,
                      file->joint[joint_that_moves(file, joint->parent)].mark.line);
}

/* Finds the body that joint j moves; checks that it is no other joint's, and not the base. */
static enum error_code check_joint_child(struct robot_builder *b, size_t j, int *at)
{
    const struct robot_yaml *file = &b->file;
    const struct joint_yaml *joint = &file->joint[j];
    int first = joint_that_moves(file, joint->child);

    *at = find_named_entry(file->body, file->nbody, sizeof *file->body, joint->child);
    if (*at < 0) {
        return robot_unknown_name(b, &joint->child_mark, "body", joint->child, file->body,
                                  file->nbody, sizeof *file->body);
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

/* Takes the axis of a joint, normalized. */
static enum error_code build_joint_axis(struct robot_builder *b, const struct joint_yaml *given,
                                        struct robot_joint *joint)
{
    double length = vec3_norm(given->axis);

    if (!(fabs(length - 1.0) <= AXIS_TOLERANCE)) {
        return yaml_error(b->error, &given->axis_mark,
                          "found an axis of length %.9g, expected a unit vector", length);
    }
    for (int m = 0; m < 3; m++) {
        joint->axis[m] = given->axis[m] / length;
    }
    return ERROR_NONE;
}

/* Takes the limits of a joint in its units, which the keys name. */
static enum error_code build_limits(struct robot_builder *b, const struct joint_yaml *given,
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

/* Compression of a stop (rad or m) under the joint's torque or force limit, where the file does
 * not give its stiffness. */
#define STOP_GIVES 5e-4

/* Builds the stops at the ends of the range: what the joint does not say, the robot's own stops
 * do. */
static enum error_code build_stops(struct robot_builder *b, const struct joint_yaml *given,
                                   struct robot_joint *joint)
{
    const struct stops_yaml *own = &given->stops, *all = &b->file.stops;
    double value[STOP_PARAMETERS];
    bool said[STOP_PARAMETERS];

    /* Keys of the other type of joint mean nothing here */
    for (int i = 0; i < STOP_PARAMETERS; i++) {
        if (own->given[1 - given->type][i]) {
            return yaml_error(b->error, &own->mark,
                              "found stops of %s joint \"%s\", expected the keys %s",
                              given->type == JOINT_REVOLUTE ? "revolute" : "prismatic", given->name,
                              given->type == JOINT_REVOLUTE ? "stiffness_nm_rad, damping_nm_s_rad"
                                                            : "stiffness_n_m, damping_n_s_m");
        }
        said[i] = own->given[given->type][i] || all->given[given->type][i];
        value[i] =
            own->given[given->type][i] ? own->value[given->type][i] : all->value[given->type][i];
    }
    if (own->has_enabled ? !own->enabled : all->has_enabled && !all->enabled) {
        return ERROR_NONE;
    }

    joint->stop.stiffness = said[STOP_STIFFNESS]        ? value[STOP_STIFFNESS]
                            : joint->torque_limit > 0.0 ? joint->torque_limit / STOP_GIVES
                                                        : 1.0 / STOP_GIVES;
    joint->stop.damping =
        said[STOP_DAMPING] ? value[STOP_DAMPING] : STOP_RETURNS * joint->stop.stiffness;
    return ERROR_NONE;
}

/* Builds the parallel spring of a joint, if it has one. */
static enum error_code build_spring(struct robot_builder *b, const struct joint_yaml *given,
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

/* Builds the passive spring of a joint: its own, or of a driven one the robot's, if it turns. */
static enum error_code build_passive(struct robot_builder *b, const struct joint_yaml *given,
                                     struct robot_joint *joint)
{
    const bool turns = given->type == JOINT_REVOLUTE;
    const struct passive_yaml *from = given->has_passive || !turns || !robot_joint_is_driven(joint)
                                          ? &given->passive
                                          : &b->file.passive;
    const double *value = from->value[given->type];

    /* Keys of the other type of joint mean nothing here */
    for (int i = 0; i < PASSIVE_PARAMETERS; i++) {
        if (from->given[1 - given->type][i]) {
            return yaml_error(b->error, &from->mark,
                              "found a passive spring of %s joint \"%s\", expected the keys %s",
                              turns ? "revolute" : "prismatic", given->name,
                              turns ? "stiffness_nm_rad, damping_nm_s_rad, rest_rad"
                                    : "stiffness_n_m, damping_n_s_m, rest_m");
        }
    }
    joint->passive = (struct robot_passive){.stiffness = value[PASSIVE_STIFFNESS],
                                            .damping = value[PASSIVE_DAMPING],
                                            .rest = value[PASSIVE_REST]};
    return ERROR_NONE;
}

/* Builds joint j and the body that it moves. */
static enum error_code build_joint(struct robot_builder *b, size_t j)
{
    struct joint_yaml *given = &b->file.joint[j];
    struct robot *robot = b->robot;
    struct robot_joint *joint = &robot->joint[j];
    enum error_code code;
    int at, parent;

    /* Bodies of earlier joints are named already: the parent is one of them or the base */
    robot->nbody = j + 1;
    if ((code = check_joint_child(b, j, &at))) {
        return code;
    }
    parent = robot_find_body(robot, given->parent);
    if (parent < 0) {
        return refuse_parent(b, j);
    }

    /* The joint, then the body that it moves */
    joint->name = given->name;
    joint->type = given->type;
    joint->paper_index = (int)given->paper_index;
    memcpy(joint->origin, given->origin.xyz, sizeof joint->origin);
    mat3_from_rpy(given->origin.rpy, joint->rotation);
    if ((code = build_joint_axis(b, given, joint)) || (code = build_limits(b, given, joint)) ||
        (code = build_stops(b, given, joint)) || (code = robot_build_drive(b, given, joint)) ||
        (code = build_spring(b, given, &joint->spring)) ||
        (code = build_passive(b, given, joint))) {
        return code;
    }
    return build_tree_body(b, at, parent, &robot->body[j + 1]);
}

/* Bodies in the order of the joints that move them. */
enum error_code robot_build_tree(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code;
    int base = find_named_entry(file->body, file->nbody, sizeof *file->body, file->base.body);

    robot->body = arena_alloc(b->arena, file->njoint + 1, sizeof *robot->body);
    robot->joint = arena_alloc(b->arena, file->njoint, sizeof *robot->joint);
    if (!robot->body || !robot->joint) {
        return robot_no_memory(b);
    }
    if (base < 0) {
        return robot_unknown_name(b, &file->base.body_mark, "body", file->base.body, file->body,
                                  file->nbody, sizeof *file->body);
    }

    /* The base, then what each joint moves */
    if ((code = build_tree_body(b, base, -1, &robot->body[0]))) {
        return code;
    }
    for (size_t j = 0; j < file->njoint; j++) {
        if ((code = build_joint(b, j))) {
            return code;
        }
    }

    /* No body is left over */
    for (size_t i = 0; i < file->nbody; i++) {
        if ((int)i != base && joint_that_moves(file, file->body[i].name) < 0) {
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
