/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The linear system of a stage of the implicit integrator, (P + C) a = right-hand side. P consists
 * of the robot's tree with its joint couplings, and of the free bodies. Systems with P are solved
 * directly. C has the blocks of contact pairs between two moving bodies. If C is not zero,
 * conjugate gradients (Golub, Van Loan, Matrix Computations, 11.5) with P as preconditioner solve
 * the system.
 *
 * Joint couplings are solved by implicit Euler. Let h be the stage's length, e and e' the error and
 * its rate at the base, a the accelerations of the stage and w = +1 on the follower, -m on the
 * leader. The force of a coupling is
 *   F = K (e + h e') + D e' + h (D + h K) w^T a,
 * for any stiffness. This is a rank-one term added to the tree's matrix, outside the tree's
 * structure. So the tree's response to each coupling is computed (a column), and the forces
 * follow from a linear system with one row per coupling (model/coupling.h).
 */
#include "model/coupling.h"
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Limits of the conjugate gradients: number of steps, and residual relative to the first residual
 * (squared, in the norm of P^-1). COUPLING_FLOOR is the residual of 1 kg at 1e-12 m/s2, in N m/s2.
 * It is above the rounding errors of a robot at rest. */
enum { COUPLING_STEPS = 16 };
#define COUPLING_LEFT 1e-8
#define COUPLING_FLOOR 1e-24

/* Iterations for the gyroscopic moments of free bodies. */
enum { GYROSCOPIC_PASSES = 3 };

/* Returns the sum of f . x over the touched contact bodies. */
static double inner_product(const struct implicit *im, const struct spatial *f,
                            const struct spatial *x)
{
    double sum = 0.0;

    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];

        sum += vec3_dot(f[c].l, x[c].l) + vec3_dot(f[c].a, x[c].a);
    }
    return sum;
}

/* Computes y = p x + q y over the touched contact bodies. */
static void combine_spatial(const struct implicit *im, double p, const struct spatial *x, double q,
                            struct spatial *y)
{
    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];

        for (int k = 0; k < 3; k++) {
            y[c].a[k] = p * x[c].a[k] + q * y[c].a[k];
            y[c].l[k] = p * x[c].l[k] + q * y[c].l[k];
        }
    }
}

/* Prepares the systems of the free bodies: Newton's and Euler's laws with the inertias added by
 * contact, in the bodies' frames about their centers of mass. */
static void prepare_free_bodies(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const struct robot *robot = plant->config.robot;
    static const double origin[3] = {0.0, 0.0, 0.0};

    /* Set the inertia, the weight and the loads */
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const struct robot_inertia *inertia = &plant->config.free[b].inertia;
        const struct wrench *ext = &plant->ext[robot->nbody + b];
        struct spatial *load = &im->free_load[b];
        double weight[3];

        spatial_inertia_rigid(inertia->mass, origin, inertia->I, &im->free_inertia[b]);
        mat3_apply_transposed(plant->motion[robot->nbody + b].R, robot->gravity, weight);
        for (int i = 0; i < 3; i++) {
            load->l[i] = ext->force[i] + inertia->mass * weight[i];
            load->a[i] = ext->moment[i];
        }
        vec3_add_cross(ext->force, inertia->com, load->a);
    }

    /* Add the inertia of contact, rotated and moved to the center of mass */
    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];

        if (implicit_is_free(plant, c)) {
            size_t b = (size_t)plant->config.contact_body[c] - robot->nbody;
            const double *com = plant->config.free[b].inertia.com;
            const double arm[3] = {-com[0], -com[1], -com[2]};
            struct spatial_inertia own = im->contact_inertia[c];
            double back[9];

            mat3_transpose(implicit_motion(plant, c)->R, back);
            spatial_inertia_rotate(back, &own);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->free_inertia[b]);
        }
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        /* Add the gyroscopic moment of a free body at the stage to its load, I w' = moment - w x I
         * w, with w at the stage, by fixed-point iteration. Each pass reduces the error by the
         * factor h |w|; h: length of the stage. */
        const size_t first = plant->config.robot->nv + FREE_ACCELERATIONS * b + FREE_ANGULAR;
        const double moment[3] = {im->free_load[b].a[0], im->free_load[b].a[1],
                                  im->free_load[b].a[2]};
        double w[3];

        memcpy(w, im->u_point + first, sizeof w);
        for (int pass = 0; pass < GYROSCOPIC_PASSES; pass++) {
            struct spatial *load = &im->free_load[b], x;
            double spin[3];

            sym3_apply(plant->config.free[b].inertia.I, w, spin);
            memcpy(load->a, moment, sizeof load->a);
            vec3_add_cross(spin, w, load->a);
            spatial_inertia_solve(&im->free_inertia[b], load, &x);
            for (int i = 0; i < 3; i++) {
                w[i] = im->u_base[first + (size_t)i] + im->stage_h * x.a[i];
            }
        }
    }
}

/* Computes a = P^-1 (right-hand side + w), with wrenches w on the contact bodies. NULL: no
 * wrenches. is_new: P has changed since the last call. */
static void solve_uncoupled(struct plant *plant, const struct spatial *w, bool is_new, double *a)
{
    struct implicit *im = plant->implicit;
    const struct dynamics *dynamics = im->tree;
    size_t nbody = plant->config.robot->nbody, nv = plant->config.robot->nv;
    const double *v = im->point + plant->at.v;

    /* Solve for the robot: one pass of the dynamics over the tree */
    memcpy(im->ext, plant->ext, nbody * sizeof *im->ext);
    for (size_t t = 0; w && t < im->ntouched; t++) {
        int c = im->touched[t];

        if (!implicit_is_free(plant, c)) {
            add_contact_wrench(plant, c, &w[c], &im->ext[plant->config.contact_body[c]]);
        }
    }
    if (plant->clamped) {
        memset(a, 0, nv * sizeof *a);
    } else {
        dynamics->ops->implicit(dynamics, plant->q, v, im->torque, im->ext, im->extra, im->added,
                                a);

        /* Correct the accelerations for the joint couplings */
        if (plant->config.robot->ncoupling > 0) {
            if (is_new) {
                const struct robot *robot = plant->config.robot;

                /* Compute the changes of the accelerations by unit loads of the couplings */
                dynamics->ops->respond(dynamics, robot->ncoupling, im->unit, im->column);

                /* Without a positive pivot the factor is NAN, and the resulting state is NAN too */
                coupling_factorize(robot, im->column, im->compliance, im->factor);
            }

            /* Correct the accelerations, under any loads, with the columns and the factor */
            coupling_correct(plant->config.robot, im->column, im->factor, im->pull, im->force, a);
        }
    }

    /* Solve for each free body: a 6x6 system in its frame about its center of mass */
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const double *com = plant->config.free[b].inertia.com;
        const double arm[3] = {-com[0], -com[1], -com[2]};
        double *own = a + nv + FREE_ACCELERATIONS * b;
        struct spatial f = im->free_load[b], x;

        for (size_t t = 0; w && t < im->ntouched; t++) {
            int c = im->touched[t];

            if ((size_t)plant->config.contact_body[c] == nbody + b) {
                struct spatial turned = spatial_turn_back(implicit_motion(plant, c)->R, &w[c]);

                spatial_add_wrench(1.0, &turned, arm, &f);
            }
        }
        spatial_inertia_solve(&im->free_inertia[b], &f, &x);
        memcpy(own + FREE_LINEAR, x.l, sizeof x.l);
        memcpy(own + FREE_ANGULAR, x.a, sizeof x.a);
    }
}

void implicit_contact_accelerations(struct plant *plant, const double *a, struct spatial *twist)
{
    struct implicit *im = plant->implicit;
    const struct dynamics *dynamics = plant->config.dynamics;
    size_t nbody = plant->config.robot->nbody, nv = plant->config.robot->nv;

    dynamics->ops->velocities(dynamics, plant->q, a, im->motion);
    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];
        size_t body = (size_t)plant->config.contact_body[c];

        if (body < nbody) {
            memcpy(twist[c].l, im->motion[body].v, sizeof twist[c].l);
            memcpy(twist[c].a, im->motion[body].w, sizeof twist[c].a);
        } else {
            const double *own = a + nv + FREE_ACCELERATIONS * (body - nbody);
            const double *com = plant->config.free[body - nbody].inertia.com;
            const double arm[3] = {-com[0], -com[1], -com[2]};
            struct spatial x, at;

            memcpy(x.l, own + FREE_LINEAR, sizeof x.l);
            memcpy(x.a, own + FREE_ANGULAR, sizeof x.a);
            at = spatial_motion_at(&x, arm);
            twist[c] = spatial_turn(implicit_motion(plant, c)->R, &at);
        }
    }
}

/* Computes w += scale C a, given a at the contact bodies (twist). */
static void add_coupling(struct plant *plant, double scale, const struct spatial *twist,
                         struct spatial *w)
{
    struct implicit *im = plant->implicit;

    for (size_t t = 0; t < im->nactive; t++) {
        const struct active_pair *pair = &im->active[t];

        if (!implicit_moves(plant, pair->body[PAIR_A]) ||
            !implicit_moves(plant, pair->body[PAIR_B])) {
            continue;
        }
        /* The wrench on each side is the pair's inertia A times the other side's acceleration at
         * the pair's center */
        for (int side = PAIR_A; side <= PAIR_B; side++) {
            int self = pair->body[side], other = pair->body[PAIR_B - side];
            struct spatial at, f;
            double arm[3];

            implicit_arm(plant, other, pair->center, arm);
            at = spatial_motion_at(&twist[other], arm);
            spatial_inertia_apply(&pair->A, &at, &f);
            implicit_arm(plant, self, pair->center, arm);
            spatial_add_wrench(-scale, &f, arm, &w[self]);
        }
    }
}

/* Computes z = P^-1 r, and the accelerations of the contact bodies for z. Returns the product of z
 * and r. Uses w. */
static double apply_preconditioner(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    /* Subtract the solution for the right-hand side and the held wrenches */
    memcpy(im->w, im->held, plant->config.ncontact * sizeof *im->w);
    combine_spatial(im, 1.0, im->r, 1.0, im->w);
    solve_uncoupled(plant, im->w, false, im->z);
    add_scaled(-1.0, im->uncoupled, im->z, im->na);
    implicit_contact_accelerations(plant, im->z, im->twist_z);
    return inner_product(im, im->r, im->twist_z);
}

void implicit_solve(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const bool again = im->first_residual > 0.0; /* the stage has a solution */

    prepare_free_bodies(plant);
    if (im->coupled) {
        memset(im->held, 0, plant->config.ncontact * sizeof *im->held);
    }
    if (again) {
        implicit_contact_accelerations(plant, im->a, im->twist_z);
        add_coupling(plant, -1.0, im->twist_z, im->held);
    }
    solve_uncoupled(plant, again ? im->held : NULL, true, im->a);
    if (im->coupled) {
        /* im->a is the solution with P and the held wrenches. Correct it to the solution with P +
         * C, by conjugate gradients. Residuals, s = P p and w = (P + C) p are wrenches on the
         * contact bodies, because C produces no other loads. Accuracy: relative to the stage's
         * first residual. */
        const size_t bytes = plant->config.ncontact * sizeof *im->r;

        /* Start with the solution of P, its residual -C a - held, and the first direction */
        memcpy(im->uncoupled, im->a, im->na * sizeof *im->a);
        implicit_contact_accelerations(plant, im->a, im->twist_z);
        memset(im->r, 0, bytes);
        add_coupling(plant, -1.0, im->twist_z, im->r);
        combine_spatial(im, -1.0, im->held, 1.0, im->r);

        double rz = apply_preconditioner(plant);

        im->first_residual = im->first_residual > 0.0 ? im->first_residual : rz;
        memcpy(im->p, im->z, im->na * sizeof *im->p);
        memcpy(im->twist_p, im->twist_z, bytes);
        memcpy(im->s, im->r, bytes);

        const double enough = fmax(COUPLING_LEFT * im->first_residual, COUPLING_FLOOR);

        for (int step = 0; step < COUPLING_STEPS && rz > enough; step++) {
            const double last = rz;

            /* Move along p until the residual is orthogonal to p. P + C is positive definite, so a
             * curvature of 0 or less is a rounding error */
            memcpy(im->w, im->s, bytes);
            add_coupling(plant, 1.0, im->twist_p, im->w);

            const double curvature = inner_product(im, im->w, im->twist_p);

            if (curvature <= 0.0) {
                break;
            }
            add_scaled(rz / curvature, im->p, im->a, im->na);
            combine_spatial(im, -(rz / curvature), im->w, 1.0, im->r);

            /* Compute the next direction, conjugate to all earlier directions */
            rz = apply_preconditioner(plant);
            for (size_t i = 0; i < im->na; i++) {
                im->p[i] = im->z[i] + rz / last * im->p[i];
            }
            combine_spatial(im, 1.0, im->twist_z, rz / last, im->twist_p);
            combine_spatial(im, 1.0, im->r, rz / last, im->s);
        }
    }
}
