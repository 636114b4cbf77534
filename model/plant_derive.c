/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's right-hand side: from a state to the forces on bodies and joints, the accelerations,
 * and the rates of all integrated quantities. The coupled system of the paper: rigid-body dynamics
 * (eq. 1), drives (eqs 2 to 4), parallel springs (eq. 5) and contact, all at the same state.
 */
#include "model/coupling.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

void plant_normalize_quaternion(double quaternion[4])
{
    double norm = sqrt(quaternion[0] * quaternion[0] + quaternion[1] * quaternion[1] +
                       quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3]);

    for (int i = 0; i < 4; i++) {
        quaternion[i] /= norm;
    }
}

void plant_place(struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;

    memcpy(plant->q, state, robot->nq * sizeof *state);
    if (robot->floating) {
        plant_normalize_quaternion(plant->q + BASE_Q_QUATERNION);
    }
    plant_free_place(plant, state);
}

/* Adds a wrench in the world frame to those on a body; returns its power, W. */
static double apply_body_wrench(const struct body_motion *motion, const double force[3],
                                const double moment[3], struct wrench *ext)
{
    double f[3], n[3];

    mat3_apply_transposed(motion->R, force, f);
    mat3_apply_transposed(motion->R, moment, n);
    vec3_add_scaled(ext->force, 1.0, f, ext->force);
    vec3_add_scaled(ext->moment, 1.0, n, ext->moment);
    return vec3_dot(force, motion->v) + vec3_dot(moment, motion->w);
}

void plant_apply_loads(struct plant *plant, const double *v, struct plant_load *load)
{
    const struct plant_config *config = &plant->config;
    static const struct contact_wrench none;
    size_t nbody = config->robot->nbody, count = nbody + config->nfree;

    /* Add the contact wrenches on the contact bodies */
    memset(plant->ext, 0, count * sizeof *plant->ext);
    for (size_t c = 0; c < config->ncontact; c++) {
        const struct contact_wrench *wrench = &plant->contact_wrench[c];
        int body = config->contact_body[c];

        /* Usual case: most bodies touch nothing */
        if (memcmp(wrench, &none, sizeof none) != 0) {
            load->contact += apply_body_wrench(&plant->motion[body], wrench->force, wrench->moment,
                                               &plant->ext[body]);
        }
    }

    /* Add the pushes on all bodies */
    if (plant->pushing) {
        plant->whole.ops->kinematics(&plant->whole, plant->q, v, plant->whole_motion);
        for (size_t b = 0; b < count; b++) {
            load->push +=
                apply_body_wrench(b < nbody ? &plant->whole_motion[b] : &plant->motion[b],
                                  plant->push[b].force, plant->push[b].moment, &plant->ext[b]);
        }
    }
}

/* Computes the torques on the joints: drives, eq. (3), parallel springs, eq. (5), passive springs,
 * end stops and couplings. */
static void apply_joint_torques(struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;

    memset(plant->tau, 0, robot->njoint * sizeof *plant->tau);
    /* Add the electric and hydraulic drives */
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->tau[plant->drive_joint[d]] += plant_drive_torque(plant, state, d);
    }
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        plant->tau[plant->hydraulic_joint[c]] += plant_hydraulic_torque(plant, state, c);
    }
    /* Add the parallel springs */
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];

        plant->tau[j] += parallel_spring_torque(
            &robot->joint[j].spring, state[plant->at.pretension + s], plant->pretension_rate[s],
            plant_joint_position(plant, state, j), plant_joint_rate(plant, state, j));
    }
    for (size_t i = 0; i < plant->npassive; i++) {
        size_t j = plant->passive_joint[i];

        plant->tau[j] +=
            passive_torque(&robot->joint[j].passive, plant_joint_position(plant, state, j),
                           plant_joint_rate(plant, state, j));
    }
    /* Add the forces of the end stops that joints press, then the forces of the couplings */
    for (size_t j = 0; j < robot->njoint; j++) {
        double depth = plant_joint_depth(plant, state, j);

        if (depth != 0.0) {
            plant->tau[j] +=
                stop_torque(&robot->joint[j].stop, depth, plant_joint_rate(plant, state, j));
        }
    }

    /* Add the torques of joint couplings */
    const double *q = state + plant->at.v - robot->njoint;
    const double *qd = state + plant->at.drive - robot->njoint;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        coupling_press(
            coupling,
            coupling_force(coupling, coupling_error(coupling, q), coupling_rate(coupling, qd)),
            plant->tau);
    }
}

enum error_code plant_load_bodies(struct plant *plant, const double *state, const double *bristle,
                                  double ahead_s, struct plant_load *load)
{
    enum error_code code = ERROR_NONE;

    plant_place(plant, state);
    *load = (struct plant_load){0.0, 0.0};
    plant->bristles_follow = false;
    if (plant->clamped && !plant->balanced && plant->config.nfree == 0) {
        return ERROR_NONE;
    }
    if (plant->config.contact) {
        code = plant_contact_evaluate(plant, state + plant->at.v, bristle, ahead_s);
    }
    if (code == ERROR_NONE) {
        plant_apply_loads(plant, state + plant->at.v, load);
    }
    return code;
}

enum error_code plant_evaluate(struct plant *plant, const double *state, struct plant_load *load)
{
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = state + plant->at.v;
    bool loaded = plant->config.contact || plant->pushing;
    enum error_code code = plant_load_bodies(plant, state, state + plant->at.bristle, 0.0, load);

    if (code != ERROR_NONE) {
        return code;
    }
    if (plant->clamped) {
        /* Remove accelerations and wrenches of a clamped robot, because the clamp carries the
         * loads. A balanced clamp carries no load, so the wrenches stay. Wrenches on free bodies
         * stay. */
        const struct robot *robot = plant->config.robot;

        memset(plant->vdot, 0, robot->nv * sizeof *plant->vdot);
        if (!plant->balanced) {
            memset(plant->ext, 0, robot->nbody * sizeof *plant->ext);
            for (size_t c = 0; c < plant->config.ncontact; c++) {
                if ((size_t)plant->config.contact_body[c] < robot->nbody) {
                    plant->contact_wrench[c] = (struct contact_wrench){0};
                }
            }
        }

        return ERROR_NONE;
    }
    apply_joint_torques(plant, state);
    dynamics->ops->forward(dynamics, plant->q, v, plant->tau, loaded ? plant->ext : NULL,
                           plant->vdot);
    return ERROR_NONE;
}

double plant_stop_loss(const struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;
    double loss = 0.0;

    for (size_t j = 0; j < robot->njoint; j++) {
        loss += stop_loss(&robot->joint[j].stop, plant_joint_depth(plant, state, j),
                          plant_joint_rate(plant, state, j));
    }
    return loss;
}

double plant_spring_loss(const struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;
    double loss = 0.0;

    for (size_t i = 0; i < plant->npassive; i++) {
        size_t j = plant->passive_joint[i];

        loss += passive_loss(&robot->joint[j].passive, plant_joint_rate(plant, state, j));
    }
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        loss += coupling_loss(coupling,
                              coupling_rate(coupling, state + plant->at.drive - robot->njoint));
    }
    return loss;
}

void plant_derivative(void *context, double t, const double *state, double *derivative)
{
    struct plant *plant = context;
    const struct robot *robot = plant->config.robot;
    double *work = plant->config.account_energy ? derivative + plant->at.work : NULL;
    struct plant_load load;

    plant->within_s = t;
    memset(derivative, 0, plant->at.count * sizeof *derivative);

    /* Compute the accelerations. After a failure they are zero, also in the remaining stages of the
     * step */
    if (plant->step_code != ERROR_NONE) {
        return;
    }
    plant->step_code = plant_evaluate(plant, state, &load);
    if (plant->step_code != ERROR_NONE) {
        return;
    }
    plant->account.load = load;

    /* Compute the rates of all parts of the state, in the order of the state */
    dynamics_qdot(robot, plant->q, state + plant->at.v, derivative);
    memcpy(derivative + plant->at.v, plant->vdot, robot->nv * sizeof *derivative);

    /* Compute the rates of the drives' states, eqs (2) and (4), and add their powers; work may be
     * NULL */
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        const struct robot_sea *sea = &plant->sea[d];
        double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
        double *out = derivative + plant_drive_offset(plant, d);
        struct sea_state drive = plant_drive_state(plant, state, d), rate;

        if (sea->effects) {
            plant_effects_derive(plant, state, d, derivative, work);
            continue;
        }
        const double voltage = plant_drive_voltage(plant, state, d);

        sea_derivative(sea, &drive, q, qd, voltage, plant->bridge_on[d], &rate);
        out[DRIVE_MOTOR_POSITION] = rate.qm;
        out[DRIVE_MOTOR_SPEED] = rate.qmd;
        out[DRIVE_CURRENT] = rate.I;
        if (work) {
            struct sea_power power;

            sea_power(sea, &drive, q, qd, voltage, &power);
            work[WORK_ELECTRICAL] += power.electrical;
            work[WORK_JOULE] += power.joule;
            work[WORK_FRICTION] += power.friction;
            work[WORK_SPRING_DAMPING] += power.spring_damping;
        }
    }

    /* Parallel springs, eq. (5): the pretension moves at a constant rate */
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        const struct robot_parallel_spring *spring = &plant->config.robot->joint[j].spring;
        double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
        double p = state[plant->at.pretension + s], pd = plant->pretension_rate[s];

        derivative[plant->at.pretension + s] = pd;
        if (work) {
            work[WORK_PRETENSION] += pd * parallel_spring_force(spring, p, pd, q, qd);
            work[WORK_PARALLEL_DAMPING] += parallel_spring_damping(spring, p, pd, q, qd);
        }
    }
    plant_free_derive(plant, state, derivative);
    if (plant->config.bus.capacitance_f > 0.0) {
        plant_supply_derive(plant, state, derivative, work);
    }
    if (plant->nhydraulic > 0) {
        plant_hydraulic_derive(plant, state, derivative, work);
    }
    for (size_t i = 0; plant->bristles_follow && i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        memcpy(derivative + plant->at.bristle + from, plant->bristle_rate + from,
               CONTACT_BRISTLE * sizeof *derivative);
    }
    if (work) {
        work[WORK_CONTACT] = load.contact;
        work[WORK_PUSH] = load.push;
        work[WORK_STOPS] = plant->clamped ? 0.0 : plant_stop_loss(plant, state);
        work[WORK_SPRING_DAMPING] += plant->clamped ? 0.0 : plant_spring_loss(plant, state);
    }
}
