/* SPDX-License-Identifier: Apache-2.0 */
/* Creates the balance controller, ramps the robot into its posture and runs the control periods. */
#include "tasks/balance_private.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define RAMP_S 1.5   /* duration of the ramp from the initial pose to the posture */
#define SETTLE_S 0.5 /* wait after the ramp, until the springs are at rest */
#define LOAD_S 0.3   /* duration in which the motors take over the weight at the start */

/* ---- creation ---- */

/* Finds the geometry, axes and link chain of both legs. ERROR_INPUT when a leg is not of a known
 * kind. */
static enum error_code balance_find_legs(struct balance *balance, struct error *error)
{
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];
        enum error_code code = leg_find(balance->model, side, leg->link, &leg->geometry, error);

        if (code) {
            return code;
        }
        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->axis[j] = (size_t)balance->model->link[leg->link[j]].axis;
            leg->chain[j] = leg->link[leg->geometry.chain[j]];
        }
        memcpy(leg->sole_m, balance->model->sole[side].position, sizeof leg->sole_m);
    }
    return ERROR_NONE;
}

/* Computes the standing posture: center of mass over the middle of the soles. Returns false when
 * the legs do not reach that far. */
static bool balance_find_posture(struct balance *balance)
{
    const struct gait_config *gait = &balance->config.gait;
    const double rpy[3] = {0, balance->config.lean_rad, 0};
    double R[9], flat[9], offset[3], pelvis[3] = {0, 0, balance->config.pelvis_height_m};
    bool reached = true;

    mat3_from_rpy(rpy, R);
    mat3_identity(flat);
    /* The center of mass depends on the leg angles, and they on the pelvis: fixed-point
     * iteration */
    memcpy(balance->angle, balance->initial,
           host_configuration(balance->host)->naxis * sizeof *balance->angle);
    for (int round = 0; round < 30; round++) {
        balance_com_offset(balance, R, offset);
        pelvis[0] = gait->zmp_ahead_m - offset[0];
        pelvis[1] = -offset[1];
        /* Joint angles that put both soles flat on the ground, width_m apart */
        for (int side = 0; side < BODY_SIDES; side++) {
            struct balance_leg *leg = &balance->leg[side];
            double sole[3] = {0, (side == BODY_LEFT ? 0.5 : -0.5) * gait->width_m, 0};
            double angle[LEG_JOINTS];

            reached = balance_leg_angles(leg, R, pelvis, flat, sole, angle) && reached;
            for (int j = 0; j < LEG_JOINTS; j++) {
                balance->angle[leg->axis[j]] = angle[j];
            }
        }
    }
    /* Inertia of each leg about the pitch axis of its hip, its links taken as point masses */
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        leg->inertia_kg_m2 = 0;
        for (int j = 0; j < LEG_JOINTS; j++) {
            const struct body_link *link = &balance->model->link[leg->link[j]];
            double arm[3];

            mat3_apply(balance->pose[leg->link[j]].R, link->com_m, arm);
            vec3_add_scaled(arm, 1, balance->pose[leg->link[j]].p, arm);
            vec3_sub(arm, leg->geometry.hip, arm);
            leg->inertia_kg_m2 += link->mass_kg * (arm[0] * arm[0] + arm[2] * arm[2]);
        }
    }
    /* The posture fixes the pendulum: height of the center of mass, omega = sqrt(g / height) */
    balance->com_height_m = pelvis[2] + offset[2];
    balance->omega = sqrt(balance->model->gravity_m_s2 / balance->com_height_m);
    return reached;
}

enum error_code balance_create(const struct balance_config *config, const struct body_model *model,
                               const double *initial_rad, struct host *host, struct servo *servo,
                               struct arena *arena, struct balance **out, struct error *error)
{
    size_t naxis = host_configuration(host)->naxis;
    struct balance *balance = arena_alloc(arena, 1, sizeof *balance);
    double *angle = arena_alloc(arena, naxis, sizeof *angle);
    double *from = arena_alloc(arena, naxis, sizeof *from);
    struct body_pose *pose = arena_alloc(arena, model->nlink, sizeof *pose);
    struct servo_gains *gains = arena_alloc(arena, naxis, sizeof *gains);
    enum error_code code;

    if (!balance || !angle || !from || !pose || !gains) {
        return error_set(error, ERROR_MEMORY, "no memory for the balance");
    }
    /* The gains are a copy, since the ankle rolls have gains of their own */
    *balance = (struct balance){.config = *config,
                                .model = model,
                                .initial = initial_rad,
                                .host = host,
                                .servo = servo,
                                .angle = angle,
                                .from = from,
                                .pose = pose,
                                .gains = gains};
    for (size_t i = 0; i < naxis; i++) {
        gains[i] = config->gains[i];
    }
    /* Boards, legs and posture: what can be wrong with the rig shows here */
    code = estimator_create(&config->estimate, model, host, arena, &balance->estimator, error);
    code = code ? code : balance_find_legs(balance, error);
    if (code) {
        return code;
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        gains[balance->leg[side].axis[LEG_ANKLE_ROLL]].kp_v_per_rad =
            config->ankle_roll_kp_v_per_rad;
    }
    if (!balance_find_posture(balance)) {
        return error_set(error, ERROR_INPUT,
                         "a pelvis %g m over the soles is out of the legs' reach",
                         config->pelvis_height_m);
    }
    *out = balance;
    return ERROR_NONE;
}

void balance_start(struct balance *balance)
{
    size_t naxis = host_configuration(balance->host)->naxis;

    for (size_t i = 0; i < naxis; i++) {
        balance->from[i] = host_joint(balance->host, i)->joint_rad;
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->motor_rad[j] = host_joint(balance->host, leg->axis[j])->motor_rad;
        }
    }
    servo_use(balance->servo, balance->gains);
    estimator_start(balance->estimator);
    balance->t_s = 0;
    balance->ready = false;
}

/* ---- a period ---- */

/* Starts the gait at the measured footholds, once the posture is reached. */
static void balance_begin(struct balance *balance, struct gait_measured *measured)
{
    struct gait_foothold *foot = measured->foot;
    double com[2];

    /* The ground is taken as level until the soles have felt it */
    for (int i = 0; i < BODY_SIDES; i++) {
        foot[i].roll = foot[i].pitch = 0;
        balance->leg[i].foot = foot[i];
        balance->leg[i].carries = 1;
    }
    /* The plan starts at rest, with the center of mass over the middle of the feet */
    balance->ground_m = (foot[0].p[2] + foot[1].p[2]) / 2;
    com[0] = (foot[0].p[0] + foot[1].p[0]) / 2 + balance->config.gait.zmp_ahead_m;
    com[1] = (foot[0].p[1] + foot[1].p[1]) / 2;
    gait_start(&balance->gait, &balance->config.gait, balance->omega, foot, com);
    balance->ready = true;
}

void balance_update(struct balance *balance, const struct gait_command *command, double dt_s)
{
    const struct estimate *estimate;
    struct gait_measured measured;
    double ramp = fmin(balance->t_s / RAMP_S, 1);

    balance->t_s += dt_s;
    /* Estimate the state; the observer's bandwidth depends on the commanded speed */
    estimator_update(
        balance->estimator, command->step,
        sqrt(command->forward_m_s * command->forward_m_s + command->left_m_s * command->left_m_s),
        dt_s);
    /* Measure the feet, and let the gait begin when the ramp and the springs are over */
    estimate = estimator_read(balance->estimator);
    balance_measure(balance, &measured, dt_s);
    if (!balance->ready && balance->t_s > RAMP_S + SETTLE_S) {
        balance_begin(balance, &measured);
    }
    /* Before that: equal load on both feet, references ramped from the initial pose (smooth
     * step) */
    if (!balance->ready) {
        for (int i = 0; i < BODY_SIDES; i++) {
            balance->leg[i].weight = 0.5;
            balance->leg[i].cop_m[0] = balance->config.gait.zmp_ahead_m;
            balance->zmp[0] = estimate->com_m[0];
            balance->zmp[1] = estimate->com_m[1];
        }
        body_place(balance->model, balance->angle, balance->pose);
        balance_load_legs(balance);
        balance_drive(balance, fmin(balance->t_s / LOAD_S, 1), ramp * ramp * (3 - 2 * ramp), dt_s);
        return;
    }

    /* Plan, feedback on the DCM, distribution to the feet, compliance, poses: each uses the one
     * before */
    gait_update(&balance->gait, command, &measured, dt_s);
    balance_want_zmp(balance);
    balance_share(balance);
    balance_yield(balance, dt_s);
    balance_pose_legs(balance, dt_s);
    /* Torques are computed in the new pose; the servo compensates the springs with them */
    body_place(balance->model, balance->angle, balance->pose);
    balance_load_legs(balance);
    balance_load_swing(balance);
    balance_drive(balance, 1, 1, dt_s);
}

bool balance_ready(const struct balance *balance)
{
    return balance->ready;
}

const struct estimate *balance_estimate(const struct balance *balance)
{
    return estimator_read(balance->estimator);
}

const struct gait *balance_gait(const struct balance *balance)
{
    return &balance->gait;
}
