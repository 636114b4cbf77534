/* SPDX-License-Identifier: Apache-2.0 */
/* From poses and loads to the references of the leg motors. */
#include "base/portable_math.h"
#include "tasks/balance_private.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define RATE_S 0.004 /* of the references' rates */
#define KNEE_MIN 0.15
#define KNEE_MAX 1.9

/* Joint angles of a leg for a sole in the world under a pelvis in the world. */
bool balance_leg_angles(const struct balance_leg *leg, const double pelvis_R[9],
                        const double pelvis_p[3], const double sole_R[9], const double sole_p[3],
                        double angle[LEG_JOINTS])
{
    struct body_pose foot;
    double ankle[3], back[9], away[3];

    mat3_apply(sole_R, leg->sole_m, ankle);
    vec3_sub(sole_p, ankle, ankle);
    vec3_sub(ankle, pelvis_p, away);
    mat3_apply_transposed(pelvis_R, away, foot.p);
    mat3_transpose(pelvis_R, back);
    mat3_mul(back, sole_R, foot.R);
    return leg_inverse(&leg->geometry, &foot, KNEE_MIN, KNEE_MAX, angle);
}

/* Where the center of mass is from the pelvis, in a frame turned by R, in the pose of the
 * references. */
void balance_com_offset(struct balance *balance, const double R[9], double offset[3])
{
    double com[3];

    body_place(balance->model, balance->angle, balance->pose);
    body_center_of_mass(balance->model, balance->pose, com);
    mat3_apply(R, com, offset);
}

/* How far a foot stands, 0 to 1: by the load that it bears, smoothed. */
static double balance_carries(struct balance *balance, int side, double dt_s)
{
    struct balance_leg *leg = &balance->leg[side];
    const struct estimate_foot *foot = &estimator_read(balance->estimator)->foot[side];
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    double goal = fmin(fmax(foot->force_n[2] / (0.3 * weight), 0), 1);

    leg->carries += (goal - leg->carries) * dt_s / (balance->config.carry_s + dt_s);
    return leg->carries;
}

/* Pelvis and feet as they are to be, then the angles of the legs. */
void balance_pose_legs(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;
    double error[2] = {estimate->roll_rad, estimate->pitch_rad - config->lean_rad};
    double askew = estimate->yaw_rad - plan->yaw;
    double upright[9], offset[3], ground = 0;
    const double rpy[3] = {0, config->lean_rad, plan->yaw};

    mat3_from_rpy(rpy, upright);
    balance_com_offset(balance, upright, offset);
    for (int i = 0; i < BODY_SIDES; i++) {
        balance_target_foot(balance, i, dt_s);
        ground += 0.5 * plan->foot[i].p[2];
    }
    askew -= 2 * M_PI * round(askew / (2 * M_PI));
    balance->pelvis_m[0] = plan->com[0] - offset[0];
    balance->pelvis_m[1] = plan->com[1] - offset[1];
    balance->ground_m += (ground - balance->ground_m) * dt_s / (config->height_s + dt_s);
    balance->pelvis_m[2] = balance->ground_m + config->pelvis_height_m;

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        double carries = balance_carries(balance, i, dt_s), R[9], sole_R[9], sole_p[3],
               angle[LEG_JOINTS];
        double led[3] = {(1 - carries) * error[0], config->lean_rad + (1 - carries) * error[1],
                         plan->yaw + (1 - carries) * askew};
        double sole[3] = {leg->foot.roll + leg->turn[0], leg->foot.pitch + leg->turn[1],
                          leg->foot.yaw};
        double pelvis[3];

        mat3_from_rpy(led, R);
        mat3_from_rpy(sole, sole_R);
        memcpy(sole_p, leg->foot.p, sizeof sole_p);
        sole_p[2] -= leg->stretch_m;
        memcpy(pelvis, balance->pelvis_m, sizeof pelvis);
        pelvis[2] += (1 - carries) * config->swing_follow * (estimate->pelvis_m[2] - pelvis[2]);
        balance_leg_angles(leg, R, pelvis, sole_R, sole_p, angle);
        for (int j = 0; j < LEG_JOINTS; j++) {
            balance->angle[leg->axis[j]] = angle[j];
        }
    }
}

/* The torques of the legs when each foot bears its share of the weight at its wanted center of
 * pressure, along the line to the measured center of mass. */
void balance_load_legs(struct balance *balance)
{
    const struct estimate *estimate = estimator_read(balance->estimator);
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    double down[3], plumb[3] = {0, 0, -1}, R[9];
    const double rpy[3] = {0, balance->config.lean_rad, balance->gait.now.yaw};

    mat3_from_rpy(rpy, R);
    mat3_apply_transposed(R, plumb, down);
    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        struct body_pose sole;
        double point[3], force[3], world[3], cop[3] = {leg->cop_m[0], leg->cop_m[1], 0};

        body_place_frame(&balance->model->sole[i], &balance->pose[leg->chain[LEG_JOINTS - 1]],
                         &sole);
        mat3_apply(sole.R, cop, point);
        vec3_add_scaled(point, 1, sole.p, point);
        for (int k = 0; k < 2; k++) {
            double lean = (estimate->com_m[k] - balance->zmp[k]) / balance->com_height_m;

            world[k] = leg->weight * weight * fmin(fmax(lean, -0.2), 0.2);
        }
        world[2] = leg->weight * weight;
        mat3_apply_transposed(R, world, force);
        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->torque_nm[leg->geometry.chain[j]] =
                body_static_torque(balance->model, balance->pose, leg->chain + j,
                                   (size_t)(LEG_JOINTS - j), force, point, down);
        }
    }
}

/* The torque that swings a leg, as a rod with its inertia about the hip; the standing leg's hip
 * bears it, so that the trunk does not. */
void balance_load_swing(struct balance *balance)
{
    const struct gait_reference *plan = &balance->gait.now;
    struct balance_leg *stance = &balance->leg[plan->stance];
    struct balance_leg *swing = &balance->leg[BODY_SIDES - 1 - plan->stance];
    double ahead =
        portable_cos(plan->yaw) * plan->foot_m_s2[0] + portable_sin(plan->yaw) * plan->foot_m_s2[1];
    double torque = -balance->config.swing_torque * swing->inertia_kg_m2 * ahead /
                    (swing->geometry.thigh_m + swing->geometry.shank_m);

    swing->torque_nm[LEG_HIP_PITCH] += torque;
    stance->torque_nm[LEG_HIP_PITCH] -= torque;
}

/* References of all motors: the link's angle and what the spring gives way by. take: how much of
 * the load, loose: how far from the pose at the start, 0 to 1. */
void balance_drive(struct balance *balance, double take, double loose, double dt_s)
{
    const struct host_config *host = host_configuration(balance->host);

    for (size_t i = 0; i < host->naxis; i++) {
        servo_set(balance->servo, i,
                  balance->from[i] + loose * (balance->angle[i] - balance->from[i]), 0);
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        for (int j = 0; j < LEG_JOINTS; j++) {
            size_t axis = leg->axis[j];
            double load = take * leg->torque_nm[j];
            double link =
                balance->from[axis] + loose * (balance->angle[axis] - balance->from[axis]);
            double motor = link + load / host->axis[axis].drive.spring_nm_rad;
            double rate;

            if (balance->ready && (j == LEG_ANKLE_ROLL || j == LEG_ANKLE_PITCH)) {
                double follow = balance->config.ankle_follow * fmin(leg->weight / 0.3, 1);

                motor += follow * (host_joint(balance->host, axis)->joint_rad - link);
            }
            rate = dt_s > 0 ? (motor - leg->motor_rad[j]) / dt_s : 0;

            leg->rate_rad_s[j] += (rate - leg->rate_rad_s[j]) * dt_s / (RATE_S + dt_s);
            leg->motor_rad[j] = motor;
            servo_set(balance->servo, axis, motor, leg->rate_rad_s[j]);
            servo_set_load(balance->servo, axis, load);
        }
    }
}
