/* SPDX-License-Identifier: Apache-2.0 */
/* An interpreter of the expression graph, and robots with like limbs. */
#include "tests/unit/model/symbolic/evaluate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Lane l of an operand, with its sign. */
static double operand(const struct graph *graph, double (*value)[GRAPH_LANES], expr e, int l)
{
    double x = value[expr_node(e)][graph_width(graph, e) == 1 ? 0 : l];

    return expr_negative(e) ? -x : x;
}

static double lane_value(const struct graph *graph, double (*value)[GRAPH_LANES],
                         const struct graph_node *node, const double *const argument[], int l)
{
    double a = 0.0, b = 0.0;

    if (node->op != GRAPH_CONST && node->op != GRAPH_INPUT && node->op != GRAPH_LANE) {
        a = operand(graph, value, node->operand[node->op == GRAPH_PACK ? l : 0], l);
        b = operand(graph, value, node->operand[1], l);
    }
    switch (node->op) {
    case GRAPH_CONST:
        return node->value[l];
    case GRAPH_INPUT:
        return argument[node->array][node->index[l]];
    case GRAPH_ADD:
        return a + b;
    case GRAPH_SUB:
        return a - b;
    case GRAPH_MUL:
        return a * b;
    case GRAPH_INVERT:
        return 1.0 / a;
    case GRAPH_SIN:
        return sin(a);
    case GRAPH_COS:
        return cos(a);
    case GRAPH_LANE:
        return operand(graph, value, node->operand[0], node->index[0]);
    case GRAPH_PACK:
        return a;
    }
    return NAN;
}

bool evaluate(const struct graph *graph, const struct derivation *derivation,
              const double *const argument[DERIVE_ARRAYS], double *pose, double *out)
{
    double(*value)[GRAPH_LANES] = calloc(graph->count, sizeof *value);

    if (!value) {
        return false;
    }
    for (size_t n = 0; n < graph->count; n++) {
        const struct graph_node *node = &graph->node[n];

        for (int l = 0; l < node->width; l++) {
            value[n][l] = lane_value(graph, value, node, argument, l);
        }
    }
    for (size_t o = 0; o < derivation->count; o++) {
        const struct derive_output *output = &derivation->output[o];

        for (int l = 0; l < (output->pose ? graph_width(graph, output->value) : 1); l++) {
            (output->pose ? pose : out)[output->index + l] =
                operand(graph, value, output->value, l);
        }
    }
    free(value);
    return true;
}

/* Hangs a joint and its body on parent. Like numbers in like limbs come from like: which axis, and
 * which parts of the origin are there. */
static void add_joint(uint64_t *seed, struct random_tree *tree, int parent, unsigned like)
{
    struct robot *robot = &tree->robot;
    struct robot_joint *joint = &tree->joint[robot->njoint++];
    struct robot_body *body = &tree->body[robot->nbody];

    *joint = (struct robot_joint){.name = "joint", .lower = -10.0, .upper = 10.0};
    joint->type = like % 11 == 0 ? JOINT_PRISMATIC : JOINT_REVOLUTE;
    if (like % 7 == 0) {
        joint->axis[like % 3] = 0.6;
        joint->axis[(like + 1) % 3] = 0.8;
    } else {
        joint->axis[like % 3] = random_in(seed, -1.0, 3.0) > 0.0 ? 1.0 : -1.0;
    }
    joint->origin[like / 3 % 3] = random_in(seed, -0.3, 0.3);
    joint->origin[like / 9 % 3] = random_in(seed, -0.3, 0.3);
    joint->rotation[0] = joint->rotation[4] = joint->rotation[8] = 1.0;
    *body = (struct robot_body){.name = "body", .parent = parent};
    body->observed = robot->nbody % 2 == 0;
    random_inertia(seed, &body->inertia);
    robot->nbody++;
}

/* A limb of length joints on parent; its last body. */
static int add_limb(uint64_t *seed, struct random_tree *tree, int parent, int length, unsigned like)
{
    for (int n = 0; n < length && tree->robot.njoint < RANDOM_JOINTS; n++) {
        add_joint(seed, tree, parent, like + 5U * (unsigned)n);
        parent = (int)tree->robot.nbody - 1;
    }
    return parent;
}

enum error_code limbed_tree_make(uint64_t *seed, struct random_tree *tree, struct error *error)
{
    struct robot *robot = &tree->robot;
    int trunk = 0;

    *robot = (struct robot){.name = "limbed",
                            .body = tree->body,
                            .joint = tree->joint,
                            .nbody = 1,
                            .imu_frame = -1,
                            .gravity = {0.5, -1.0, -9.5}};
    robot->floating = random_in(seed, 0.0, 1.0) < 0.7;
    tree->body[0] = (struct robot_body){.name = "base", .parent = -1, .observed = true};
    random_inertia(seed, &tree->body[0].inertia);
    for (int level = 0; level < 3 && robot->njoint < RANDOM_JOINTS - 4; level++) {
        unsigned like = (unsigned)random_in(seed, 0.0, 1000.0);
        int twins = 2 + (int)random_in(seed, 0.0, 4.0);

        for (int n = 0; n < twins; n++) {
            add_limb(seed, tree, trunk, 1 + (int)random_in(seed, 1.0, 4.0), like);
        }
        trunk = add_limb(seed, tree, trunk, 1 + level, like + 1);
    }
    return robot_finish(robot, error);
}

enum error_code pendulum_make(struct random_tree *tree, struct error *error)
{
    memset(tree, 0, sizeof *tree);
    tree->robot = (struct robot){.name = "3 pendulum \"x\" \\",
                                 .body = tree->body,
                                 .joint = tree->joint,
                                 .nbody = 2,
                                 .njoint = 1,
                                 .imu_frame = -1,
                                 .gravity = {0.0, 0.0, -9.81}};
    tree->body[0] = (struct robot_body){.name = "base", .parent = -1};
    tree->body[1] = (struct robot_body){.name = "bob", .inertia = {1.0, {0.0, 0.0, -1.0}, {0}}};
    tree->joint[0] = (struct robot_joint){.name = "hinge",
                                          .axis = {0.0, 1.0, 0.0},
                                          .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                          .lower = -9.0,
                                          .upper = 9.0};
    return robot_finish(&tree->robot, error);
}

double relative_difference(const double *a, const double *b, size_t n)
{
    double difference = 0.0, size = 0.0;

    for (size_t i = 0; i < n; i++) {
        difference += (a[i] - b[i]) * (a[i] - b[i]);
        size += b[i] * b[i];
    }
    return size > 0.0 ? sqrt(difference / size) : sqrt(difference);
}
