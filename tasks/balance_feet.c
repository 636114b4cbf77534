/* SPDX-License-Identifier: Apache-2.0 */
/* What the feet are to bear, how they yield to what they bear instead, and where they go. */
#include "base/portable_math.h"
#include "tasks/balance_private.h"

#include <math.h>

#define FOOT_S 0.15  /* a foot's target goes to where the foot came down */
#define STOP_S 0.03  /* but its height sooner */
#define SWING_S 0.01 /* that of a foot in the air follows the plan */

/* The foothold at which a foot's sole is, as estimated; its yaw in the turn of the plan's. */
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

/* A sole that lies on the ground bears its load within its edges; one that stands on an edge does
 * not. */
static bool balance_foot_flat(const struct balance *balance, const struct estimate_foot *foot)
{
    const struct balance_config *config = &balance->config;

    return foot->force_n[2] > config->flat_n &&
           foot->cop_m[0] < config->gait.sole_front_m - config->gait.sole_margin_m &&
           foot->cop_m[0] > config->gait.sole_back_m + config->gait.sole_margin_m &&
           fabs(foot->cop_m[1]) < config->gait.sole_side_m - config->gait.sole_margin_m;
}

/* What the gait is to know. */
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

/* The wanted zero-moment point: the plan's, and against the error of the DCM. */
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

/* Shares the wanted zero-moment point among the feet: between them by weight, beside the line
 * between them by their centers of pressure. Each stays within its sole. */
void balance_share(struct balance *balance)
{
    const struct balance_config *config = &balance->config;
    const struct gait_reference *plan = &balance->gait.now;
    double at[BODY_SIDES][2], line[2], left = plan->share[BODY_LEFT], rest[2];
    double side_m = config->gait.sole_side_m - config->gait.sole_margin_m;

    for (int i = 0; i < BODY_SIDES; i++) {
        gait_foot_zmp(&balance->gait, i, &plan->foot[i], at[i]);
    }
    line[0] = at[BODY_LEFT][0] - at[BODY_RIGHT][0];
    line[1] = at[BODY_LEFT][1] - at[BODY_RIGHT][1];
    if (plan->phase != GAIT_SWING) {
        left = ((balance->zmp[0] - at[BODY_RIGHT][0]) * line[0] +
                (balance->zmp[1] - at[BODY_RIGHT][1]) * line[1]) /
               (line[0] * line[0] + line[1] * line[1]);
        left = fmin(fmax(left, 0), 1);
    }
    balance->leg[BODY_LEFT].weight = left;
    balance->leg[BODY_RIGHT].weight = 1 - left;
    for (int k = 0; k < 2; k++) {
        rest[k] = balance->zmp[k] - (at[BODY_RIGHT][k] + left * line[k]);
    }
    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        double point[2] = {at[i][0] + rest[0], at[i][1] + rest[1]};

        gait_into_foot(&plan->foot[i], point, leg->cop_m);
        leg->cop_m[0] =
            fmin(fmax(leg->cop_m[0], config->gait.sole_back_m + config->gait.sole_margin_m),
                 config->gait.sole_front_m - config->gait.sole_margin_m);
        leg->cop_m[1] = fmin(fmax(leg->cop_m[1], -side_m), side_m);
    }
}

/* Turns the feet by what their moments are off, and stretches the legs by what the difference of
 * their forces is off. */
void balance_yield(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
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

/* The target of a foot: the plan's, but where it came down apart from that it comes to terms in
 * FOOT_S, since a jump would press the legs against each other. */
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
