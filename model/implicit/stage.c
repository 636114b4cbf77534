/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Solves one stage of the implicit integrator. From a base state and a point near the stage it
 * computes the rates at the stage, with one evaluation of forces and one linear system. Also moves
 * positions.
 */
#include "base/portable_math.h"
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Largest number of passes that keep friction within its limit. */
enum { FRICTION_PASSES = 8 };

/* ---- rates ---- */

/* Returns the index of a free body's rates among all rates. */
static size_t free_rate(const struct plant *plant, size_t b, enum free_acceleration_part part)
{
    return plant->config.robot->nv + FREE_ACCELERATIONS * b + (size_t)part;
}

void implicit_get_rates(const struct plant *plant, const double *state, double *u)
{
    const double *v = state + plant->at.v;

    memcpy(u, v, plant->config.robot->nv * sizeof *u);
    if (plant->config.robot->floating) {
        double R[9];

        mat3_from_quaternion(state + BASE_Q_QUATERNION, R);
        mat3_apply(R, v + BASE_V_LINEAR, u + BASE_V_LINEAR);
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        memcpy(u + free_rate(plant, b, FREE_LINEAR),
               state + plant_free_offset(plant, b, PLANT_FREE_VELOCITY),
               FREE_ACCELERATIONS * sizeof *u);
    }
}

void implicit_set_rates(const struct plant *plant, const double *u, double *state)
{
    double *v = state + plant->at.v;

    memcpy(v, u, plant->config.robot->nv * sizeof *u);
    if (plant->config.robot->floating) {
        double R[9];

        mat3_from_quaternion(state + BASE_Q_QUATERNION, R);
        mat3_apply_transposed(R, u + BASE_V_LINEAR, v + BASE_V_LINEAR);
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        memcpy(state + plant_free_offset(plant, b, PLANT_FREE_VELOCITY),
               u + free_rate(plant, b, FREE_LINEAR), FREE_ACCELERATIONS * sizeof *u);
    }
}

/* ---- positions ---- */

/* Rotates a quaternion by h seconds of angular velocity: quaternion <- quaternion exp(h w / 2),
 * w in the body frame. */
static void turn_quaternion_in_body(const double w[3], double h, double quaternion[4])
{
    double angle = h * sqrt(vec3_dot(w, w));
    double sinc = angle > 1e-4 ? portable_sin(0.5 * angle) / angle : 0.5 - angle * angle / 48.0;
    double c = portable_cos(0.5 * angle);
    double x[3] = {h * sinc * w[0], h * sinc * w[1], h * sinc * w[2]};
    double scalar = quaternion[0], vector[3] = {quaternion[1], quaternion[2], quaternion[3]};

    quaternion[0] = scalar * c - vec3_dot(vector, x);
    vec3_cross(vector, x, quaternion + 1);
    for (int i = 0; i < 3; i++) {
        quaternion[1 + i] += scalar * x[i] + c * vector[i];
    }
}

void implicit_move(const struct plant *plant, const double *u, double h, double *state)
{
    const struct robot *robot = plant->config.robot;

    if (robot->floating) {
        turn_quaternion_in_body(u + BASE_V_ANGULAR, h, state + BASE_Q_QUATERNION);
        add_scaled(h, u + BASE_V_LINEAR, state + BASE_Q_POSITION, 3);
    }
    add_scaled(h, u + robot->nv - robot->njoint, state + robot->nq - robot->njoint, robot->njoint);
    for (size_t b = 0; b < plant->config.nfree; b++) {
        add_scaled(h, u + free_rate(plant, b, FREE_LINEAR),
                   state + plant_free_offset(plant, b, PLANT_FREE_POSITION), 3);
        turn_quaternion_in_body(u + free_rate(plant, b, FREE_ANGULAR), h,
                                state + plant_free_offset(plant, b, PLANT_FREE_QUATERNION));
    }
}

/* ---- the stage ---- */

/* Computes w x v at the point, in the base frame: the rate of the base's velocity components due to
 * the rotation of its frame. */
static void find_base_transport(const struct plant *plant, double transport[3])
{
    const double *v = plant->implicit->point + plant->at.v;

    vec3_cross(v + BASE_V_ANGULAR, v + BASE_V_LINEAR, transport);
}

/* Computes the slope of the rates from a. Linear parts are in the world frame. */
static void find_slope(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const size_t nbody = plant->config.robot->nbody;

    memcpy(im->slope, im->a, im->na * sizeof *im->slope);
    if (plant->config.robot->floating && !plant->clamped) {
        double R[9], linear[3], transport[3];

        mat3_from_quaternion(im->point + BASE_Q_QUATERNION, R);
        find_base_transport(plant, transport);
        vec3_add_scaled(im->a + BASE_V_LINEAR, 1.0, transport, linear);
        mat3_apply(R, linear, im->slope + BASE_V_LINEAR);
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        const size_t at = free_rate(plant, b, FREE_LINEAR);

        mat3_apply(plant->motion[nbody + b].R, im->a + at, im->slope + at);
    }
}

/* Returns whether bodies touch, or a joint or a drive's spring presses its stop: the causes of
 * impacts. Without them the motion is smooth, and steps keep their full length. */
static bool something_strikes(const struct plant *plant)
{
    const struct implicit *im = plant->implicit;
    bool strikes = im->nactive > 0 || !im->stops_rest;

    for (size_t d = 0; d < plant->ndrive && !strikes; d++) {
        strikes = im->law[d] != SPRING_FREE;
    }
    return strikes;
}

enum error_code implicit_solve_stage(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    enum error_code code;

    /* Find the point, and the acceleration that leads from the base state to it, in the coordinates
     * of a. Linear parts are in the bodies' frames at the point. For the robot's base it is the
     * derivative in the moving frame. */
    double R[9];

    memcpy(im->point, im->base, plant->at.bristle * sizeof *im->point);
    implicit_move(plant, im->u_point, im->stage_h, im->point);
    implicit_set_rates(plant, im->u_point, im->point);
    for (size_t i = 0; i < im->na; i++) {
        im->a_point[i] = (im->u_point[i] - im->u_base[i]) / im->stage_h;
    }
    if (plant->config.robot->floating) {
        double linear[3], transport[3];

        mat3_from_quaternion(im->point + BASE_Q_QUATERNION, R);
        mat3_apply_transposed(R, im->a_point + BASE_V_LINEAR, linear);
        find_base_transport(plant, transport);
        vec3_sub(linear, transport, im->a_point + BASE_V_LINEAR);
    }
    for (size_t b = 0; b < plant->config.nfree; b++) {
        double *linear = im->a_point + free_rate(plant, b, FREE_LINEAR);
        const double world[3] = {linear[0], linear[1], linear[2]};

        mat3_from_quaternion(im->point + plant_free_offset(plant, b, PLANT_FREE_QUATERNION), R);
        mat3_apply_transposed(R, world, linear);
    }

    /* Evaluate forces and tangents at the point */
    if ((code = plant_load_bodies(plant, im->point, plant->state + plant->at.bristle, im->stage_h,
                                  &im->load))) {
        return code;
    }
    if ((code = implicit_linearize_contact(plant))) {
        return code;
    }
    implicit_linearize_actuators(plant);
    implicit_add_contact_inertia(plant);

    /* Solve for the accelerations, then compute contact and rates at the stage */
    im->first_residual = 0.0;
    implicit_solve(plant);
    while (!plant->clamped && (implicit_revise_stops(plant) || implicit_revise_effects(plant))) {
        implicit_solve(plant); /* terminates: each joint's stop changes at most twice */
    }
    implicit_find_contact(plant);
    for (int i = 0; i < FRICTION_PASSES && implicit_revise_friction(plant); i++) {
        implicit_solve(plant);
        implicit_find_contact(plant);
    }
    implicit_end_contact(plant);

    /* Raise jump by the difference between the joints' rates at the stage and at the point,
     * converted to the speed of a body on a lever */
    const struct robot *robot = plant->config.robot;
    const size_t first = robot->nv - robot->njoint;

    if (!plant->clamped && something_strikes(plant)) {
        for (size_t j = 0; j < robot->njoint; j++) {
            const double lever = robot->joint[j].type == JOINT_REVOLUTE ? STRIKE_LEVER : 1.0;
            const double jump =
                lever * im->stage_h * fabs(im->a[first + j] - im->a_point[first + j]);

            im->jump = jump > im->jump ? jump : im->jump;
        }
    }

    find_slope(plant);
    for (size_t i = 0; i < im->na; i++) {
        im->u[i] = im->u_base[i] + im->stage_h * im->slope[i];
    }
    return ERROR_NONE;
}
