/* SPDX-License-Identifier: Apache-2.0 */
/* Random trees of bodies and random states for the tests of the dynamics; the same from run to
 * run: everything follows from *seed, which moves on. */
#ifndef TESTS_UNIT_MODEL_RANDOM_ROBOT_H
#define TESTS_UNIT_MODEL_RANDOM_ROBOT_H

#include "model/dynamics.h"
#include "model/robot.h"

enum { RANDOM_JOINTS = 30 };

/* A robot and the memory of its parts. */
struct random_tree {
    struct robot robot;
    struct robot_body body[RANDOM_JOINTS + 1];
    struct robot_joint joint[RANDOM_JOINTS];
};

/* A state, joint forces and wrenches of any size that a robot may meet. */
struct random_state {
    double q[RANDOM_JOINTS + 7], v[RANDOM_JOINTS + 6], tau[RANDOM_JOINTS];
    struct wrench ext[RANDOM_JOINTS + 1];
};

double random_in(uint64_t *seed, double lower, double upper);
void random_vector(uint64_t *seed, double size, double x[3]);
void random_unit(uint64_t *seed, double *x, int count);

/* The inertia of a cloud of mass: second moments along random axes, all positive. */
void random_inertia(uint64_t *seed, struct robot_inertia *inertia);

/* A tree of 1 to RANDOM_JOINTS joints, half of them on a floating base. Returns robot_finish. */
enum error_code random_tree_make(uint64_t *seed, struct random_tree *tree, struct error *error);

void random_state_make(uint64_t *seed, const struct robot *robot, struct random_state *state);

#endif
