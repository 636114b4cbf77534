/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Newton's method on the remaining forces of the base and of the free bodies. Each has three
 * unknowns: the displacement up and two tilts. With sticking friction, place and heading are
 * unknown too. Then each step is a motion over AHEAD_S: so slow that damping has no effect, and the
 * contact's bristles follow it up to their limit, as in a step of the implicit integrator (struct
 * contact_bristles).
 *
 * The tangent is computed by differences, which works for any contact engine. Its symmetric part is
 * damped until it is positive definite. So a step always decreases the potential energy, and the
 * search moves away from an unstable equilibrium. Far from the equilibrium the damping
 * (pseudo-transient continuation) is one weight per DAMPING_LENGTH: a body without contact sinks by
 * that length. The damping vanishes with the residual, so that the last steps are Newton steps.
 */
#include "base/portable_math.h"
#include "model/settle_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

enum { HALVINGS = 40 }; /* largest number of halvings of a step */

#define DAMPING_LENGTH 2e-3
#define LONGEST_STEP 5e-3 /* largest Newton step, m; tilts times the radius of gyration */
#define DIFFERENCE 1e-7   /* step of the differences for the tangent, m */
#define AHEAD_S 1e6
#define DRAGGED 5e-3 /* distance, m: more than bristles can bend */

/* ---- geometry ---- */

/* Rotates a quaternion by the rotation vector `angle` in the world frame. */
static void turn_quaternion_in_world(const double angle[3], double quaternion[4])
{
    double size = sqrt(vec3_dot(angle, angle));
    double half = size > 0.0 ? portable_sin(0.5 * size) / size : 0.5, w = portable_cos(0.5 * size);
    double x[3] = {half * angle[0], half * angle[1], half * angle[2]};
    double scalar = quaternion[0], vector[3] = {quaternion[1], quaternion[2], quaternion[3]};

    quaternion[0] = w * scalar - vec3_dot(x, vector);
    vec3_cross(x, vector, quaternion + 1);
    for (int i = 0; i < 3; i++) {
        quaternion[1 + i] += w * vector[i] + scalar * x[i];
    }
    plant_normalize_quaternion(quaternion);
}

/* Writes velocities given in the world frame to the state y of the robot or of a free body. */
static void set_velocity(const struct plant *plant, const struct rest *rest, const double v[3],
                         const double w[3], double *y)
{
    double R[9];

    if (rest->robot) {
        double *rates = plant->state + plant->at.v;

        mat3_from_quaternion(y + BASE_Q_QUATERNION, R);
        mat3_apply_transposed(R, v, rates + BASE_V_LINEAR);
        mat3_apply_transposed(R, w, rates + BASE_V_ANGULAR);
    } else {
        mat3_from_quaternion(y + PLANT_FREE_QUATERNION, R);
        memcpy(y + PLANT_FREE_VELOCITY, v, 3 * sizeof *v);
        mat3_apply_transposed(R, w, y + PLANT_FREE_SPIN);
    }
}

/* Moves each body by scale times x. With sticking friction, also sets the velocities of this motion
 * over the time AHEAD_S. */
static void move_bodies(struct settle *s, double scale, const double *x)
{
    for (size_t b = 0; b < s->nrest; b++, x += s->unknowns) {
        struct rest *rest = &s->rest[b];
        double *y = s->plant->state;
        double part[UNKNOWNS] = {0.0}, angle[3], way[3], v[3], w[3];

        y += rest->robot ? 0 : s->plant->at.free + PLANT_FREE_STATE * rest->free;
        for (size_t k = 0; k < s->unknowns; k++) {
            part[k] = scale * x[k];
        }
        /* Sum the displacement of each body */
        rest->risen += part[UNKNOWN_UP];
        rest->moved[0] += part[UNKNOWN_FIRST_ACROSS];
        rest->moved[1] += part[UNKNOWN_SECOND_ACROSS];
        /* Convert the unknowns to a translation and a rotation in the world frame */
        for (int i = 0; i < 3; i++) {
            way[i] = part[UNKNOWN_UP] * s->up[i] + part[UNKNOWN_FIRST_ACROSS] * s->across[0][i] +
                     part[UNKNOWN_SECOND_ACROSS] * s->across[1][i];
            angle[i] =
                (part[UNKNOWN_FIRST_TILT] * s->across[0][i] +
                 part[UNKNOWN_SECOND_TILT] * s->across[1][i] + part[UNKNOWN_HEADING] * s->up[i]) /
                rest->radius;
            y[i] += way[i];
            rest->tilt[i] += angle[i];
            v[i] = way[i] / AHEAD_S;
            w[i] = angle[i] / AHEAD_S;
        }
        turn_quaternion_in_world(
            angle, y + (rest->robot ? (int)BASE_Q_QUATERNION : (int)PLANT_FREE_QUATERNION));
        if (s->holds) {
            set_velocity(s->plant, rest, v, w, y);
        }
    }
}

/* Ends the last evaluated motion: stores the bristles as bent by this motion, and stops the
 * bodies. */
static void stop_bodies(struct settle *s)
{
    static const double none[3];
    struct plant *plant = s->plant;

    for (size_t i = 0; i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        for (size_t k = from; k < from + CONTACT_BRISTLE; k++) {
            plant->state[plant->at.bristle + k] += AHEAD_S * plant->bristle_rate[k];
        }
    }
    for (size_t b = 0; b < s->nrest; b++) {
        const struct rest *rest = &s->rest[b];

        set_velocity(plant, rest, none, none,
                     plant->state +
                         (rest->robot ? 0 : plant->at.free + PLANT_FREE_STATE * rest->free));
    }
}

void settle_begin(struct settle *s, bool holds)
{
    s->holds = holds;
    s->unknowns = holds ? UNKNOWNS : UNKNOWNS_WITHOUT_FRICTION;
    s->n = s->unknowns * s->nrest;
    for (size_t b = 0; b < s->nrest; b++) {
        struct rest *rest = &s->rest[b];

        rest->risen = rest->moved[0] = rest->moved[1] = 0.0;
        memset(rest->tilt, 0, sizeof rest->tilt);
    }
}

/* ---- forces ---- */

void settle_weigh_robot(struct settle *s, struct rest *rest)
{
    struct plant *plant = s->plant;
    double R[9];

    plant->whole.ops->inverse(&plant->whole, plant->q, s->zero, s->zero, plant->ext, s->f);
    if (rest) {
        mat3_from_quaternion(plant->q + BASE_Q_QUATERNION, R);
        mat3_apply(R, s->f + BASE_V_LINEAR, rest->force);
        mat3_apply(R, s->f + BASE_V_ANGULAR, rest->moment);
        for (int i = 0; i < 3; i++) {
            rest->force[i] = -rest->force[i];
            rest->moment[i] = -rest->moment[i];
        }
    }
}

enum error_code settle_weigh(struct settle *s, double *g)
{
    struct plant_load load;
    enum error_code code =
        plant_load_bodies(s->plant, s->plant->state, s->plant->state + s->plant->at.bristle,
                          s->holds ? AHEAD_S : 0.0, &load);

    if (code != ERROR_NONE) {
        return code;
    }
    for (size_t b = 0; b < s->nrest; b++, g += s->unknowns) {
        struct rest *rest = &s->rest[b];

        if (rest->robot) {
            settle_weigh_robot(s, rest);
        } else {
            /* Compute the remaining force and moment on the free body about its center of mass,
             * world frame */
            const struct plant *plant = s->plant;
            const struct robot_inertia *inertia = &plant->config.free[rest->free].inertia;
            size_t body = plant->config.robot->nbody + rest->free;
            const struct wrench *ext = &plant->ext[body];
            double moment[3];

            memcpy(moment, ext->moment, sizeof moment);
            vec3_add_cross(ext->force, inertia->com, moment);
            mat3_apply(plant->motion[body].R, ext->force, rest->force);
            mat3_apply(plant->motion[body].R, moment, rest->moment);
            vec3_add_scaled(rest->force, inertia->mass, plant->config.robot->gravity, rest->force);
        }
        g[UNKNOWN_UP] = vec3_dot(rest->force, s->up);
        g[UNKNOWN_FIRST_TILT] = vec3_dot(rest->moment, s->across[0]) / rest->radius;
        g[UNKNOWN_SECOND_TILT] = vec3_dot(rest->moment, s->across[1]) / rest->radius;
        if (s->holds) {
            g[UNKNOWN_FIRST_ACROSS] = vec3_dot(rest->force, s->across[0]);
            g[UNKNOWN_SECOND_ACROSS] = vec3_dot(rest->force, s->across[1]);
            g[UNKNOWN_HEADING] = vec3_dot(rest->moment, s->up) / rest->radius;
        }
    }
    return ERROR_NONE;
}

double settle_residual(const struct settle *s, const double *g, size_t *worst)
{
    double most = 0.0;

    for (size_t i = 0; i < s->n; i++) {
        double part = fabs(g[i]) / s->rest[i / s->unknowns].weight;

        if (!(part <= most)) {
            most = part;
            *worst = i / s->unknowns;
        }
    }
    return most;
}

enum error_code settle_differentiate(struct settle *s)
{
    size_t n = s->n, bytes = s->plant->at.count * sizeof *s->before;

    memcpy(s->before, s->plant->state, bytes);
    memset(s->K, 0, n * n * sizeof *s->K);
    for (size_t column = 0; column < n; column++) {
        memset(s->step, 0, n * sizeof *s->step);
        s->step[column] = DIFFERENCE;
        for (int side = -1; side <= 1; side += 2) {
            enum error_code code;

            /* Evaluate the forces on this side of the unknown, then restore the state exactly */
            move_bodies(s, side, s->step);
            code = settle_weigh(s, s->ahead);
            move_bodies(s, -side, s->step);
            memcpy(s->plant->state, s->before, bytes);
            if (code) {
                return code;
            }

            /* Add half of the difference to the column and half to the row, to get the symmetric
             * part */
            for (size_t row = 0; row < n; row++) {
                double half = -0.25 * side * s->ahead[row] / DIFFERENCE;

                s->K[row * n + column] += half;
                s->K[column * n + row] += half;
            }
        }
    }
    return ERROR_NONE;
}

bool settle_factorize(struct settle *s, double damping)
{
    size_t n = s->n;
    double *L = s->factor;

    memcpy(L, s->K, n * n * sizeof *L);
    /* Add the damping to the diagonal: one weight per length */
    for (size_t i = 0; i < n; i++) {
        L[i * n + i] += damping * s->rest[i / s->unknowns].weight / DAMPING_LENGTH;
    }
    /* Cholesky factorization; a pivot that is not positive identifies the body that would
     * topple */
    for (size_t column = 0; column < n; column++) {
        for (size_t row = column; row < n; row++) {
            double sum = L[row * n + column];

            for (size_t k = 0; k < column; k++) {
                sum -= L[row * n + k] * L[column * n + k];
            }
            if (row == column && !(sum > 0.0)) {
                s->weak = column / s->unknowns;
                return false;
            }
            L[row * n + column] = row == column ? sqrt(sum) : sum / L[column * n + column];
        }
    }
    return true;
}

void settle_solve(struct settle *s)
{
    size_t n = s->n;
    const double *L = s->factor;
    double *x = s->step, longest = 0.0;

    /* Forward, then backward substitution */
    memcpy(x, s->g, n * sizeof *x);
    for (size_t row = 0; row < n; row++) {
        for (size_t k = 0; k < row; k++) {
            x[row] -= L[row * n + k] * x[k];
        }
        x[row] /= L[row * n + row];
    }
    for (size_t row = n; row-- > 0;) {
        for (size_t k = row + 1; k < n; k++) {
            x[row] -= L[k * n + row] * x[k];
        }
        x[row] /= L[row * n + row];
        longest = fmax(longest, fabs(x[row]));
    }

    /* Limit the step to the range of the linear model */
    for (size_t i = 0; longest > LONGEST_STEP && i < n; i++) {
        x[i] *= LONGEST_STEP / longest;
    }
}

/* ---- the step ---- */

/* Computes *stored, the potential energy of the present state, J. */
static enum error_code stored_potential(struct settle *s, double *stored)
{
    struct plant_energy energy;
    enum error_code code = plant_energy(s->plant, &energy);

    *stored = energy.stored;
    return code;
}

enum error_code settle_advance(struct settle *s, bool *moved)
{
    size_t worst = 0, bytes = s->plant->at.count * sizeof *s->before;
    double norm = settle_residual(s, s->g, &worst), start, stored = 0.0;
    double scale = 1.0;
    enum error_code code = stored_potential(s, &start);

    *moved = false;
    if (code) {
        return code;
    }
    for (int k = 0; k < HALVINGS; k++, scale *= 0.5) {
        move_bodies(s, scale, s->step);
        code = settle_weigh(s, s->ahead);
        if (!code && s->holds) {
            stop_bodies(s);
        }
        if (!code) {
            code = stored_potential(s, &stored);
        }
        /* The step is better if it has a smaller residual or a lower potential */
        if (!code && (settle_residual(s, s->ahead, &worst) < norm || stored < start)) {
            memcpy(s->g, s->ahead, s->n * sizeof *s->g);
            *moved = true;
            return ERROR_NONE;
        }

        /* Not better: restore the state exactly and halve the step */
        move_bodies(s, -scale, s->step);
        memcpy(s->plant->state, s->before, bytes);
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- friction ---- */

enum error_code settle_friction_angle(struct settle *s, size_t body, double *angle)
{
    const size_t first = body * UNKNOWNS, bytes = s->plant->at.count * sizeof *s->before;
    const struct rest *rest = &s->rest[body];
    double push[2], side, slope, support[3], load[3], along[3];
    enum error_code code = settle_weigh(s, s->ahead);

    if (code) {
        return code;
    }

    /* Without friction the support pushes perpendicular to the slope. So the forces give the
     * slope */
    push[0] = vec3_dot(rest->force, s->across[0]);
    push[1] = vec3_dot(rest->force, s->across[1]);
    side = sqrt(push[0] * push[0] + push[1] * push[1]);
    slope = portable_atan2(side, rest->weight);
    for (int i = 0; i < 3; i++) {
        support[i] = rest->force[i] + rest->weight * s->up[i];
        along[i] =
            portable_cos(slope) * (push[0] * s->across[0][i] + push[1] * s->across[1][i]) / side -
            portable_sin(slope) * s->up[i];
    }

    /* Move down the slope until all bristles slip */
    memcpy(s->before, s->plant->state, bytes);
    s->holds = true;
    s->unknowns = UNKNOWNS;
    s->n = s->unknowns * s->nrest;
    memset(s->step, 0, s->n * sizeof *s->step);
    s->step[first + UNKNOWN_UP] = -DRAGGED * portable_sin(slope);
    s->step[first + UNKNOWN_FIRST_ACROSS] = DRAGGED * portable_cos(slope) * push[0] / side;
    s->step[first + UNKNOWN_SECOND_ACROSS] = DRAGGED * portable_cos(slope) * push[1] / side;
    move_bodies(s, 1.0, s->step);
    code = settle_weigh(s, s->ahead);
    memcpy(s->plant->state, s->before, bytes);
    if (code) {
        return code;
    }

    /* The angle follows from the resisting force over the pressing force */
    vec3_add_scaled(rest->force, rest->weight, s->up, load);
    *angle = portable_atan2(-vec3_dot(load, along), vec3_dot(load, support) / vec3_norm(support));
    return ERROR_NONE;
}
