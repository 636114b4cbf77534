/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the references of the leg motors from the poses and loads of pelvis and feet. */
#include "base/portable_math.h"
#include "tasks/balance_private.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define RATE_S 0.004 /* time constant of the filter of the references' rates */
#define KNEE_MIN 0.15
#define KNEE_MAX 1.9

/* Computes the joint angles of a leg from the poses of pelvis and sole in the world. Returns
 * false when the sole is out of reach; the angles are then the nearest. */
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

/* Computes the vector from the pelvis to the center of mass in the pose of the references, in a
 * frame turned by R. */
void balance_com_offset(struct balance *balance, const double R[9], double offset[3])
{
    double com[3];

    body_place(balance->model, balance->angle, balance->pose);
    body_center_of_mass(balance->model, balance->pose, com);
    mat3_apply(R, com, offset);
}

/* Updates and returns the smoothed load of a foot as a fraction, 0 to 1; 1 means 30 % of the
 * weight and more. */
static double balance_carries(struct balance *balance, int side, double dt_s)
{
    struct balance_leg *leg = &balance->leg[side];
    const struct estimate_foot *foot = &estimator_read(balance->estimator)->foot[side];
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    double goal = fmin(fmax(foot->force_n[2] / (0.3 * weight), 0), 1);

    leg->carries += (goal - leg->carries) * dt_s / (balance->config.carry_s + dt_s);
    return leg->carries;
}

/* Computes the poses of pelvis and feet for this period, then the joint angles of the legs. */
void balance_pose_legs(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;
    double error[2] = {estimate->roll_rad, estimate->pitch_rad - config->lean_rad};
    double askew = estimate->yaw_rad - plan->yaw;
    double upright[9], offset[3], ground = 0;
    const double rpy[3] = {0, config->lean_rad, plan->yaw};

    /* The pelvis is where the planned center of mass wants it, upright but for the lean */
    mat3_from_rpy(rpy, upright);
    balance_com_offset(balance, upright, offset);
    for (int i = 0; i < BODY_SIDES; i++) {
        balance_target_foot(balance, i, dt_s);
        ground += 0.5 * plan->foot[i].p[2];
    }
    /* The error of the heading, in -pi to pi */
    askew -= 2 * M_PI * round(askew / (2 * M_PI));
    /* The pelvis's height follows the mean height of the planned footholds, smoothed */
    balance->pelvis_m[0] = plan->com[0] - offset[0];
    balance->pelvis_m[1] = plan->com[1] - offset[1];
    balance->ground_m += (ground - balance->ground_m) * dt_s / (config->height_s + dt_s);
    balance->pelvis_m[2] = balance->ground_m + config->pelvis_height_m;

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        double carries = balance_carries(balance, i, dt_s), R[9], sole_R[9], sole_p[3],
               angle[LEG_JOINTS];
        /* A loaded leg takes the pelvis as planned, so that errors of attitude are corrected
         * through the foot; a leg in the air takes it as measured, so that the foot goes where
         * the plan says */
        double led[3] = {(1 - carries) * error[0], config->lean_rad + (1 - carries) * error[1],
                         plan->yaw + (1 - carries) * askew};
        double sole[3] = {leg->foot.roll + leg->turn[0], leg->foot.pitch + leg->turn[1],
                          leg->foot.yaw};
        double pelvis[3];

        mat3_from_rpy(led, R);
        /* The sole with its compliance (tilt and leg length) added */
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

/* Computes the static torques of the legs when each foot carries its share of the weight at its
 * wanted center of pressure, the force pointing along the line to the center of mass. */
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

        /* Point of attack: the wanted center of pressure, in the pelvis's frame */
        body_place_frame(&balance->model->sole[i], &balance->pose[leg->chain[LEG_JOINTS - 1]],
                         &sole);
        mat3_apply(sole.R, cop, point);
        vec3_add_scaled(point, 1, sole.p, point);
        /* Force on the foot: its share of the weight, inclined like the pendulum, by 0.2 at most */
        for (int k = 0; k < 2; k++) {
            double lean = (estimate->com_m[k] - balance->zmp[k]) / balance->com_height_m;

            world[k] = leg->weight * weight * fmin(fmax(lean, -0.2), 0.2);
        }
        world[2] = leg->weight * weight;
        mat3_apply_transposed(R, world, force);
        /* Each joint carries what comes after it in the chain */
        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->torque_nm[leg->geometry.chain[j]] =
                body_static_torque(balance->model, balance->pose, leg->chain + j,
                                   (size_t)(LEG_JOINTS - j), force, point, down);
        }
    }
}

/* Adds the hip torque that accelerates the swinging leg, taken as a rod with its inertia about
 * the hip. The standing leg's hip gets the reaction, so that the trunk gets none. */
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

/* Sets the references of all motors: the link's angle plus the deflection of the spring under
 * its load. take: fraction of the load that is compensated; loose: fraction of the way from the
 * pose at the start, both 0 to 1. */
void balance_drive(struct balance *balance, double take, double loose, double dt_s)
{
    const struct host_config *host = host_configuration(balance->host);

    /* Joints outside the legs go to their angles without compensation */
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

            /* Ankles follow the measured angle in part, so that the sole can lie down on the
             * ground */
            if (balance->ready && (j == LEG_ANKLE_ROLL || j == LEG_ANKLE_PITCH)) {
                double follow = balance->config.ankle_follow * fmin(leg->weight / 0.3, 1);

                motor += follow * (host_joint(balance->host, axis)->joint_rad - link);
            }
            /* Feed-forward: the filtered rate of the reference */
            rate = dt_s > 0 ? (motor - leg->motor_rad[j]) / dt_s : 0;

            leg->rate_rad_s[j] += (rate - leg->rate_rad_s[j]) * dt_s / (RATE_S + dt_s);
            leg->motor_rad[j] = motor;
            servo_set(balance->servo, axis, motor, leg->rate_rad_s[j]);
            servo_set_load(balance->servo, axis, load);
        }
    }
}
