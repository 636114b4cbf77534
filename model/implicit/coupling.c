/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint couplings in a stage of the implicit integrator, by implicit Euler. Let h be the stage's
 * length, e and e' the error and its rate at the base, a the accelerations of the stage and w = +1
 * on the follower, -m on the leader. The force of a coupling is
 *   F = K (e + h e') + D e' + h (D + h K) w^T a,
 * for any stiffness. This is a rank-one term added to the tree's matrix P, outside the tree's
 * structure. So P is solved once more for each coupling (a column P^-1 w), and the forces follow
 * from a linear system with one row per coupling (model/coupling.h).
 */
#include "model/coupling.h"
#include "model/implicit/private.h"

void implicit_linearize_couplings(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const double *q = im->base + plant->at.v - robot->njoint;
    const double *qd = im->base + plant->at.drive - robot->njoint;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const double rate = coupling_rate(coupling, qd);
        const double ahead = coupling_error(coupling, q) + im->stage_h * rate;

        im->compliance[i] =
            1.0 / (im->stage_h * (coupling->damping + im->stage_h * coupling->stiffness));
        im->pull[i] = im->compliance[i] * coupling_force(coupling, ahead, rate);
    }
}

void implicit_find_columns(struct plant *plant, const double *a)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = im->point + plant->at.v;

    /* Change of the accelerations by a unit load on the joints */
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        double *follower = &im->torque[coupling->follower], *leader = &im->torque[coupling->leader];
        double *column = im->column + i * robot->nv;
        const double before[2] = {*follower, *leader};

        *follower += 1.0;
        *leader -= coupling->multiplier;
        dynamics->ops->implicit(dynamics, plant->q, v, im->torque, im->ext, im->extra, im->added,
                                column);
        *follower = before[0];
        *leader = before[1];
        add_scaled(-1.0, a, column, robot->nv);
    }

    /* Without a positive pivot the factor is NAN, and so is the resulting state */
    coupling_factorize(robot, im->column, im->compliance, im->factor);
}

void implicit_hold_couplings(struct plant *plant, double *a)
{
    struct implicit *im = plant->implicit;

    coupling_correct(plant->config.robot, im->column, im->factor, im->pull, im->force, a);
}
