/* SPDX-License-Identifier: Apache-2.0 */
/* Random trees of bodies and random states. */
#include "tests/unit/model/random_robot.h"

#include "model/spatial.h"

/* splitmix64 */
static uint64_t random_bits(uint64_t *seed)
{
    uint64_t z = *seed += UINT64_C(0x9e3779b97f4a7c15);

    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

double random_in(uint64_t *seed, double lower, double upper)
{
    return lower + (upper - lower) * (double)(random_bits(seed) >> 11) * 0x1p-53;
}

static size_t random_below(uint64_t *seed, size_t limit)
{
    return (size_t)(random_bits(seed) % limit);
}

void random_vector(uint64_t *seed, double size, double x[3])
{
    for (int m = 0; m < 3; m++) {
        x[m] = random_in(seed, -size, size);
    }
}

void random_unit(uint64_t *seed, double *x, int count)
{
    double square;

    do {
        square = 0.0;
        for (int m = 0; m < count; m++) {
            x[m] = random_in(seed, -1.0, 1.0);
            square += x[m] * x[m];
        }
    } while (square < 0.1 || square > 1.0);
    for (int m = 0; m < count; m++) {
        x[m] /= sqrt(square);
    }
}

static void random_rotation(uint64_t *seed, double R[9])
{
    double quaternion[4];

    random_unit(seed, quaternion, 4);
    mat3_from_quaternion(quaternion, R);
}

void random_inertia(uint64_t *seed, struct robot_inertia *inertia)
{
    double R[9], second[6] = {0}, trace;

    inertia->mass = random_in(seed, 0.2, 5.0);
    random_vector(seed, 0.2, inertia->com);
    for (int m = 0; m < 3; m++) {
        double radius = random_in(seed, 0.02, 0.2);

        second[sym3_index[m][m]] = inertia->mass * radius * radius;
    }
    random_rotation(seed, R);
    sym3_rotate(R, second);
    trace = second[0] + second[3] + second[5];
    for (int m = 0; m < 6; m++) {
        inertia->I[m] = (m == 0 || m == 3 || m == 5 ? trace : 0.0) - second[m];
    }
}

static void random_joint(uint64_t *seed, struct robot_joint *joint)
{
    double rpy[3] = {0.0, 0.0, 0.0};

    *joint = (struct robot_joint){0};
    joint->name = "joint";
    joint->type = random_below(seed, 4) == 0 ? JOINT_PRISMATIC : JOINT_REVOLUTE;
    if (random_below(seed, 2)) {
        joint->axis[random_below(seed, 3)] = random_below(seed, 4) == 0 ? -1.0 : 1.0;
    } else {
        random_unit(seed, joint->axis, 3);
    }
    if (random_below(seed, 4)) {
        random_vector(seed, 0.4, joint->origin);
    }
    if (random_below(seed, 2)) {
        random_vector(seed, 3.0, rpy);
    }
    mat3_from_rpy(rpy, joint->rotation);
    joint->lower = -10.0;
    joint->upper = 10.0;
}

enum error_code random_tree_make(uint64_t *seed, struct random_tree *tree, struct error *error)
{
    struct robot *robot = &tree->robot;

    *robot = (struct robot){0};
    robot->name = "random";
    robot->floating = random_below(seed, 2) == 0;
    robot->njoint = 1 + random_below(seed, RANDOM_JOINTS);
    robot->nbody = robot->njoint + 1;
    robot->body = tree->body;
    robot->joint = tree->joint;
    robot->imu_frame = -1;
    random_vector(seed, 10.0, robot->gravity);
    for (size_t b = 0; b < robot->nbody; b++) {
        struct robot_body *body = &tree->body[b];

        *body = (struct robot_body){0};
        body->name = "body";
        body->observed = true;
        body->parent = -1;
        if (b > 0) {
            /* Mostly chains, with branches */
            body->parent = random_below(seed, 3) ? (int)b - 1 : (int)random_below(seed, b);
            random_joint(seed, &tree->joint[b - 1]);
        }
        random_inertia(seed, &body->inertia);
    }
    return robot_finish(robot, error);
}

void random_state_make(uint64_t *seed, const struct robot *robot, struct random_state *state)
{
    size_t base_q = robot->nq - robot->njoint, base_v = robot->nv - robot->njoint;

    if (robot->floating) {
        random_vector(seed, 2.0, state->q);
        random_unit(seed, state->q + 3, 4);
        random_vector(seed, 2.0, state->v);
        random_vector(seed, 2.0, state->v + 3);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        double size = robot->joint[j].type == JOINT_REVOLUTE ? 3.0 : 0.5;

        state->q[base_q + j] = random_in(seed, -size, size);
        state->v[base_v + j] = random_in(seed, -size, size);
        state->tau[j] = random_in(seed, -50.0, 50.0);
    }
    for (size_t b = 0; b < robot->nbody; b++) {
        random_vector(seed, 30.0, state->ext[b].force);
        random_vector(seed, 5.0, state->ext[b].moment);
    }
}
