/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Forward dynamics with added inertia against its definition: what it returns is put into inverse
 * dynamics, and the added matrices are applied to the accelerations that kinematics says the bodies
 * have.
 */

#include "model/spatial.h"
#include "tests/unit/model/random_robot.h"
#include "tests/test.h"

enum { BODIES = RANDOM_JOINTS + 1, COORDINATES = RANDOM_JOINTS + 6, CASES = 100, RESPONSES = 6 };

static double random_added(uint64_t *seed, struct added_inertia *added)
{
    double B[6][6], largest = 0.0;

    for (int i = 0; i < 36; i++) {
        B[i / 6][i % 6] = random_in(seed, -1.0, 1.0);
    }
    /* B B^T is positive definite */
    for (int row = 0, at = 0; row < 6; row++) {
        for (int column = row; column < 6; column++, at++) {
            added->A[at] = 0.0;
            for (int m = 0; m < 6; m++) {
                added->A[at] += B[row][m] * B[column][m];
            }
            largest = fmax(largest, fabs(added->A[at]));
        }
    }
    return largest;
}

/* y = A x */
static void apply(const struct added_inertia *added, const double x[6], double y[6])
{
    memset(y, 0, 6 * sizeof *y);
    for (int row = 0, at = 0; row < 6; row++) {
        for (int column = row; column < 6; column++, at++) {
            y[row] += added->A[at] * x[column];
            y[column] += column > row ? added->A[at] * x[row] : 0.0;
        }
    }
}

/* Largest difference between the two sides of the equation of motion, relative to the forces. */
static double residual(const struct dynamics *d, const struct random_state *x, const double *extra,
                       const struct added_inertia *added, const double *vdot)
{
    const struct robot *robot = d->robot;
    size_t first = robot->nv - robot->njoint;
    double f[COORDINATES], worst = 0.0, size = 1.0;
    struct body_motion motion[BODIES];
    struct wrench ext[BODIES];

    /* -sum Jb^T A_b Jb vdot as further wrenches; Jb vdot is what the velocities would be */
    d->ops->kinematics(d, x->q, vdot, motion);
    memcpy(ext, x->ext, robot->nbody * sizeof *ext);
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            double twist[6], force[6];

            mat3_apply_transposed(motion[b].R, motion[b].v, twist);
            mat3_apply_transposed(motion[b].R, motion[b].w, twist + 3);
            apply(added++, twist, force);
            for (int i = 0; i < 3; i++) {
                ext[b].force[i] -= force[i];
                ext[b].moment[i] -= force[3 + i];
            }
        }
    }
    d->ops->inverse(d, x->q, x->v, vdot, ext, f);
    for (size_t i = 0; i < robot->nv; i++) {
        double given = i < first ? 0.0 : x->tau[i - first] - extra[i - first] * vdot[i];

        worst = fmax(worst, fabs(f[i] - given));
        size = fmax(size, fabs(given) + fabs(vdot[i]));
    }
    return worst / size;
}

/* The difference between the response to torques on two joints, and what they change in vdot. */
static double response_error(const struct dynamics *d, struct random_state *x, const double *extra,
                             const struct added_inertia *added, const double *vdot)
{
    const struct robot *robot = d->robot;
    const size_t last = robot->njoint - 1;
    double torques[RESPONSES * RANDOM_JOINTS] = {0}, changes[RESPONSES * COORDINATES];
    double *tau = torques + (RESPONSES - 1) * robot->njoint, more[COORDINATES];
    const double *change = changes + (RESPONSES - 1) * robot->nv;
    double worst = 0.0, size = 1.0;

    /* The other responses are to unit torques */
    for (size_t r = 0; r + 1 < RESPONSES; r++) {
        torques[r * robot->njoint + r % robot->njoint] = 1.0;
    }
    tau[last] = 1.5;
    tau[last / 2] -= 0.7;
    d->ops->implicit(d, x->q, x->v, x->tau, x->ext, extra, added, more);
    d->ops->respond(d, RESPONSES, torques, changes);
    for (size_t j = 0; j < robot->njoint; j++) {
        x->tau[j] += tau[j];
    }
    d->ops->implicit(d, x->q, x->v, x->tau, x->ext, extra, added, more);
    for (size_t i = 0; i < robot->nv; i++) {
        worst = fmax(worst, fabs(more[i] - vdot[i] - change[i]));
        size = fmax(size, fabs(more[i]) + fabs(vdot[i]));
    }
    return worst / size;
}

TEST(the_equation_with_added_inertia_holds)
{
    uint64_t seed = 7;
    double worst = 0.0;

    for (int n = 0; n < CASES; n++) {
        static struct random_tree tree;
        struct added_inertia added[BODIES];
        double extra[RANDOM_JOINTS], vdot[COORDINATES];
        struct random_state x;
        struct dynamics d;
        struct arena arena;
        struct error error;

        assert_ok(random_tree_make(&seed, &tree, &error));
        for (size_t b = 0; b < tree.robot.nbody; b++) {
            tree.body[b].observed = random_in(&seed, 0.0, 1.0) < 0.5;
            random_added(&seed, &added[b]);
        }
        for (size_t j = 0; j < tree.robot.njoint; j++) {
            extra[j] = random_in(&seed, 0.0, 2.0);
        }
        random_state_make(&seed, &tree.robot, &x);
        assert_ok(arena_init(&arena, 1 << 20, &error));
        assert_ok(dynamics_generic(&tree.robot, &arena, &d, &error));
        d.ops->implicit(&d, x.q, x.v, x.tau, x.ext, extra, added, vdot);
        worst = fmax(worst, residual(&d, &x, extra, added, vdot));
        worst = fmax(worst, response_error(&d, &x, extra, added, vdot));
        arena_fini(&arena);
    }
    print_message("largest relative residual of %d trees: %.1e\n", CASES, worst);
    assert_true(worst < 1e-10);
}

TEST(without_added_inertia_it_is_forward_dynamics)
{
    uint64_t seed = 8;

    for (int n = 0; n < CASES; n++) {
        static struct random_tree tree;
        static const struct added_inertia none[BODIES];
        static const double nothing[RANDOM_JOINTS];
        double vdot[COORDINATES], forward[COORDINATES], size = 0.0;
        struct random_state x;
        struct dynamics d;
        struct arena arena;
        struct error error;

        assert_ok(random_tree_make(&seed, &tree, &error));
        random_state_make(&seed, &tree.robot, &x);
        assert_ok(arena_init(&arena, 1 << 20, &error));
        assert_ok(dynamics_generic(&tree.robot, &arena, &d, &error));
        d.ops->implicit(&d, x.q, x.v, x.tau, x.ext, nothing, none, vdot);
        d.ops->forward(&d, x.q, x.v, x.tau, x.ext, forward);
        for (size_t i = 0; i < tree.robot.nv; i++) {
            size = fmax(size, fabs(forward[i]));
        }
        for (size_t i = 0; i < tree.robot.nv; i++) {
            assert_true(fabs(vdot[i] - forward[i]) < 1e-9 * size);
        }
        arena_fini(&arena);
    }
}
