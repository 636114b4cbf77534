/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Free bodies: rigid bodies by Newton's and Euler's laws about their centers of mass, with the
 * state of enum plant_free_part. The center of mass falls on a parabola, which Runge-Kutta
 * integrates exactly. The inertia tensor about it is constant.
 */
#include "model/plant.h"

#include "model/plant_private.h"
#include "model/spatial.h"

#include <string.h>

/* Smallest pivot of an invertible tensor, relative to its trace. */
#define SINGULAR_RATIO 1e-12

/* Computes the inverse of a symmetric matrix by its cofactors; returns false if it is not safely
 * positive definite. */
static bool invert_inertia(const double S[6], double inverse[6])
{
    const double least = SINGULAR_RATIO * (S[0] + S[3] + S[5]);
    const double C[6] = {S[3] * S[5] - S[4] * S[4], S[2] * S[4] - S[1] * S[5],
                         S[1] * S[4] - S[2] * S[3], S[0] * S[5] - S[2] * S[2],
                         S[1] * S[2] - S[0] * S[4], S[0] * S[3] - S[1] * S[1]};
    const double determinant = S[0] * C[0] + S[1] * C[1] + S[2] * C[2];

    /* Check the pivots of an elimination from the last row up: S[5], C[0] / S[5], determinant /
     * C[0] */
    if (!(S[5] > least && C[0] > least * S[5] && determinant > least * C[0])) {
        return false;
    }
    for (int i = 0; i < 6; i++) {
        inverse[i] = C[i] / determinant;
    }
    return true;
}

enum error_code plant_check_free_body(const struct plant_free_body *body, struct error *error)
{
    double inverse[6];

    if (robot_check_inertia(&body->inertia, error)) {
        return error_prefix(error, "free body %s", body->name);
    }
    if (!(body->inertia.mass > 0.0) || !invert_inertia(body->inertia.I, inverse)) {
        return error_set(error, ERROR_INPUT,
                         "free body %s: expected a mass and three principal moments of inertia "
                         "above zero",
                         body->name);
    }

    /* Checks that pose and velocities of a free body's start are finite */
    double square = 0.0;
    bool finite = true;

    for (int i = 0; i < 3; i++) {
        finite =
            finite && isfinite(body->position[i]) && isfinite(body->v[i]) && isfinite(body->w[i]);
    }
    for (int i = 0; i < 4; i++) {
        square += body->quaternion[i] * body->quaternion[i];
    }
    if (!finite || !isfinite(square) || !(square > 0.0)) {
        return error_set(error, ERROR_INPUT,
                         "free body %s: invalid start: expected finite numbers and a quaternion "
                         "that is not zero",
                         body->name);
    }
    return ERROR_NONE;
}

void plant_free_reset(struct plant *plant)
{
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const struct plant_free_body *body = &plant->config.free[b];
        double *y = plant->state + plant_free_offset(plant, b, PLANT_FREE_POSITION);
        double R[9], arm[3];

        invert_inertia(body->inertia.I, plant->free_inverse[b].I);
        mat3_from_quaternion(body->quaternion, R);
        mat3_apply(R, body->inertia.com, arm);
        memcpy(y + PLANT_FREE_VELOCITY, body->v, sizeof body->v);
        vec3_add_cross(body->w, arm, y + PLANT_FREE_VELOCITY);
        for (int i = 0; i < 3; i++) {
            y[PLANT_FREE_POSITION + i] = body->position[i] + arm[i];
        }
        memcpy(y + PLANT_FREE_QUATERNION, body->quaternion, sizeof body->quaternion);
        mat3_apply_transposed(R, body->w, y + PLANT_FREE_SPIN);
    }
    plant_free_normalize(plant);
}

void plant_free_normalize(struct plant *plant)
{
    for (size_t b = 0; b < plant->config.nfree; b++) {
        plant_normalize_quaternion(plant->state +
                                   plant_free_offset(plant, b, PLANT_FREE_QUATERNION));
    }
}

void plant_free_place(struct plant *plant, const double *state)
{
    struct body_motion *motion = plant->motion + plant->config.robot->nbody;

    for (size_t b = 0; b < plant->config.nfree; b++, motion++) {
        const double *y = state + plant_free_offset(plant, b, PLANT_FREE_POSITION);
        double arm[3];

        /* Compute the origin of the body's frame, which differs from the center of mass */
        mat3_from_quaternion(y + PLANT_FREE_QUATERNION, motion->R);
        mat3_apply(motion->R, plant->config.free[b].inertia.com, arm);
        mat3_apply(motion->R, y + PLANT_FREE_SPIN, motion->w);
        memcpy(motion->v, y + PLANT_FREE_VELOCITY, sizeof motion->v);
        vec3_add_cross(arm, motion->w, motion->v);
        vec3_sub(y + PLANT_FREE_POSITION, arm, motion->p);
    }
}

void plant_free_derive(const struct plant *plant, const double *state, double *derivative)
{
    const struct robot *robot = plant->config.robot;

    for (size_t b = 0; b < plant->config.nfree; b++) {
        const double *y = state + plant_free_offset(plant, b, PLANT_FREE_POSITION);
        const struct wrench *ext = &plant->ext[robot->nbody + b];
        double *out = derivative + plant_free_offset(plant, b, PLANT_FREE_POSITION);
        const double *quaternion = y + PLANT_FREE_QUATERNION, *w = y + PLANT_FREE_SPIN;
        double *rate = out + PLANT_FREE_QUATERNION, force[3];

        /* The quaternion's rate is half its product with the angular velocity in the body frame */
        memcpy(out + PLANT_FREE_POSITION, y + PLANT_FREE_VELOCITY, 3 * sizeof *out);
        rate[0] = -0.5 * vec3_dot(quaternion + 1, w);
        vec3_cross(quaternion + 1, w, rate + 1);
        for (int i = 0; i < 3; i++) {
            rate[1 + i] = 0.5 * (rate[1 + i] + quaternion[0] * w[i]);
        }
        mat3_apply(plant->motion[robot->nbody + b].R, ext->force, force);
        for (int i = 0; i < 3; i++) {
            out[PLANT_FREE_VELOCITY + i] =
                robot->gravity[i] + force[i] / plant->config.free[b].inertia.mass;
        }

        /* Compute the angular acceleration by Euler's equation about the center of mass, in the
         * body frame: I w' = moment - w x I w */
        const struct robot_inertia *inertia = &plant->config.free[b].inertia;
        double momentum[3], moment[3];

        memcpy(moment, ext->moment, sizeof moment);
        vec3_add_cross(ext->force, inertia->com, moment);
        sym3_apply(inertia->I, w, momentum);
        vec3_add_cross(momentum, w, moment);
        sym3_apply(plant->free_inverse[b].I, moment, out + PLANT_FREE_SPIN);
    }
}

double plant_free_energy(const struct plant *plant, const double *state)
{
    const double *gravity = plant->config.robot->gravity;
    double energy = 0.0;

    for (size_t b = 0; b < plant->config.nfree; b++) {
        const struct robot_inertia *inertia = &plant->config.free[b].inertia;
        const double *y = state + plant_free_offset(plant, b, PLANT_FREE_POSITION);
        double momentum[3];

        sym3_apply(inertia->I, y + PLANT_FREE_SPIN, momentum);
        energy += 0.5 * vec3_dot(momentum, y + PLANT_FREE_SPIN);
        energy += 0.5 * inertia->mass * vec3_dot(y + PLANT_FREE_VELOCITY, y + PLANT_FREE_VELOCITY);
        energy -= inertia->mass * vec3_dot(gravity, y + PLANT_FREE_POSITION);
    }
    return energy;
}

void plant_free_pose(const struct plant *plant, size_t i, double pose[7])
{
    const double *y = plant->state + plant_free_offset(plant, i, PLANT_FREE_POSITION);
    double R[9], arm[3];

    mat3_from_quaternion(y + PLANT_FREE_QUATERNION, R);
    mat3_apply(R, plant->config.free[i].inertia.com, arm);
    vec3_sub(y + PLANT_FREE_POSITION, arm, pose);
    memcpy(pose + 3, y + PLANT_FREE_QUATERNION, 4 * sizeof *pose);
}
