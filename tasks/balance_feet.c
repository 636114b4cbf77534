/* SPDX-License-Identifier: Apache-2.0 */
/* Distributes the load to the feet, makes them comply with the measured load, and moves their
 * targets. */
#include "base/portable_math.h"
#include "tasks/balance_private.h"

#include <math.h>

#define FOOT_S 0.15  /* time constant of a foot's target toward where it came down */
#define STOP_S 0.03  /* the same of its height, shorter: the ground is there */
#define SWING_S 0.01 /* time constant with which a foot in the air follows the plan */

/* Returns the foothold at which a foot's sole is estimated to be. Its yaw is unwrapped to the
 * turn of the plan's yaw, rad. */
static struct gait_foothold balance_foothold(const struct estimate_foot *foot, double plan_yaw)
{
    const double *R = foot->sole.R;
    double turns = round((plan_yaw - foot->yaw_rad) / (2 * M_PI));

    return (struct gait_foothold){
        .p = {foot->anchor[0], foot->anchor[1], foot->anchor[2]},
        .yaw = foot->yaw_rad + 2 * M_PI * turns,
        .roll = portable_atan2(R[7], R[8]),
        .pitch = portable_asin(fmin(fmax(-R[6], -1), 1)),
    };
}

/* Returns whether a sole lies flat on the ground: it is loaded and its center of pressure is
 * inside its edges. (A sole that stands on an edge has it on that edge.) */
static bool balance_foot_flat(const struct balance *balance, const struct estimate_foot *foot)
{
    const struct balance_config *config = &balance->config;

    return foot->force_n[2] > config->flat_n &&
           foot->cop_m[0] < config->gait.sole_front_m - config->gait.sole_margin_m &&
           foot->cop_m[0] > config->gait.sole_back_m + config->gait.sole_margin_m &&
           fabs(foot->cop_m[1]) < config->gait.sole_side_m - config->gait.sole_margin_m;
}

/* Fills what the gait measures: footholds, contact, vertical forces, center of mass and DCM. */
void balance_measure(struct balance *balance, struct gait_measured *measured, double dt_s)
{
    const struct estimate *estimate = estimator_read(balance->estimator);

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        const struct estimate_foot *foot = &estimate->foot[i];

        leg->touched_s = foot->force_n[2] > balance->config.touch_n ? leg->touched_s + dt_s : 0;
        measured->foot[i] = balance_foothold(foot, balance->gait.now.yaw);
        measured->touches[i] = leg->touched_s > balance->config.touch_s;
        measured->force_n[i] = foot->force_n[2];
        measured->flat[i] = balance_foot_flat(balance, foot);
    }
    for (int k = 0; k < 2; k++) {
        measured->com[k] = estimate->com_m[k];
        measured->dcm[k] = estimate->com_m[k] + estimate->com_m_s[k] / balance->omega;
    }
}

/* Computes the wanted zero-moment point: the plan's, plus proportional feedback on the error of
 * the divergent component of motion (DCM). */
void balance_want_zmp(struct balance *balance)
{
    const struct estimate *estimate = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;

    for (int k = 0; k < 2; k++) {
        double dcm = estimate->com_m[k] + estimate->com_m_s[k] / balance->omega;
        double error = dcm - plan->dcm[k];

        balance->zmp[k] = plan->zmp[k] + balance->config.dcm_gain * error;
    }
}

/* Distributes the wanted zero-moment point to the feet: along the line between them by their
 * shares of the weight, across that line by their centers of pressure. Limits each to its sole. */
void balance_share(struct balance *balance)
{
    const struct balance_config *config = &balance->config;
    const struct gait_reference *plan = &balance->gait.now;
    double at[BODY_SIDES][2], line[2], left = plan->share[BODY_LEFT], rest[2];
    double side_m = config->gait.sole_side_m - config->gait.sole_margin_m;

    /* The line from the right foot's zero-moment point to the left one's */
    for (int i = 0; i < BODY_SIDES; i++) {
        gait_foot_zmp(&balance->gait, i, &plan->foot[i], at[i]);
    }
    line[0] = at[BODY_LEFT][0] - at[BODY_RIGHT][0];
    line[1] = at[BODY_LEFT][1] - at[BODY_RIGHT][1];
    /* Both feet stand: project the wanted point onto the line */
    if (plan->phase != GAIT_SWING) {
        left = ((balance->zmp[0] - at[BODY_RIGHT][0]) * line[0] +
                (balance->zmp[1] - at[BODY_RIGHT][1]) * line[1]) /
               (line[0] * line[0] + line[1] * line[1]);
        left = fmin(fmax(left, 0), 1);
    }
    balance->leg[BODY_LEFT].weight = left;
    balance->leg[BODY_RIGHT].weight = 1 - left;
    /* What is left after the projection lies across the line: both feet move by it, in their
     * soles */
    for (int k = 0; k < 2; k++) {
        rest[k] = balance->zmp[k] - (at[BODY_RIGHT][k] + left * line[k]);
    }
    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        double point[2] = {at[i][0] + rest[0], at[i][1] + rest[1]};

        gait_into_foot(&plan->foot[i], point, leg->cop_m);
        /* Limit the center of pressure to the sole less its margin */
        leg->cop_m[0] =
            fmin(fmax(leg->cop_m[0], config->gait.sole_back_m + config->gait.sole_margin_m),
                 config->gait.sole_front_m - config->gait.sole_margin_m);
        leg->cop_m[1] = fmin(fmax(leg->cop_m[1], -side_m), side_m);
    }
}

/* Makes the feet comply: integrates the errors of their moments into tilts of the soles and the
 * error of the difference of their forces into leg lengths, both with a leak. */
void balance_yield(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    /* Error of the difference of the vertical forces, left minus right, N */
    double difference =
        weight * (balance->leg[BODY_LEFT].weight - balance->leg[BODY_RIGHT].weight) -
        (estimate->foot[BODY_LEFT].force_n[2] - estimate->foot[BODY_RIGHT].force_n[2]);

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        const struct estimate_foot *foot = &estimate->foot[i];
        double force = foot->loaded ? foot->force_n[2] : 0;
        double leak = 1 - config->cop_leak_per_s * dt_s;
        double sign = i == BODY_LEFT ? 1 : -1, light = 1 - leg->carries;
        double pitch =
            config->cop_pitch_rad_s_nm * leg->carries + config->land_turn_rad_s_nm * light;
        double roll = config->cop_roll_rad_s_nm * leg->carries + config->land_turn_rad_s_nm * light;

        /* A foot pressed more at its toes turns up, one pressed more at its left rolls up there */
        leg->turn[0] = leg->turn[0] * leak + roll * force * (foot->cop_m[1] - leg->cop_m[1]) * dt_s;
        leg->turn[1] =
            leg->turn[1] * leak - pitch * force * (foot->cop_m[0] - leg->cop_m[0]) * dt_s;
        /* Limits of 0.2 rad and 0.03 m keep the legs within reach */
        for (int k = 0; k < 2; k++) {
            leg->turn[k] = fmin(fmax(leg->turn[k], -0.2), 0.2);
        }
        leg->stretch_m = leg->stretch_m * (1 - config->force_leak_per_s * dt_s);
        if (balance->gait.now.phase != GAIT_SWING) {
            leg->stretch_m += sign * config->force_m_s_n * difference * dt_s;
        }
        leg->stretch_m = fmin(fmax(leg->stretch_m, -0.03), 0.03);
    }
}

/* Moves the target of a foot toward the plan. Where the foot came down apart from it, they are
 * brought together within FOOT_S, since a jump would press the legs against each other. */
void balance_target_foot(struct balance *balance, int side, double dt_s)
{
    const struct gait_reference *plan = &balance->gait.now;
    const struct gait_foothold *to = &plan->foot[side];
    struct gait_foothold *foot = &balance->leg[side].foot;
    bool swings = plan->phase == GAIT_SWING && plan->stance != side;
    bool lands = swings && balance->gait.landed;
    double share = swings && !lands ? dt_s / SWING_S : dt_s / FOOT_S;
    double up = swings ? plan->height_m : 0;

    for (int k = 0; k < 2; k++) {
        foot->p[k] += fmin(share, 1) * (to->p[k] - foot->p[k]);
    }
    foot->p[2] += (lands ? dt_s / STOP_S : fmin(share, 1)) * (to->p[2] + up - foot->p[2]);
    foot->yaw += fmin(share, 1) * (to->yaw - foot->yaw);
    foot->roll += fmin(share, 1) * (to->roll - foot->roll);
    foot->pitch += fmin(share, 1) * (to->pitch - foot->pitch);
}
