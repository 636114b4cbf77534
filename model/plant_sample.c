/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fills the plant's sensors with readings of the present state, without sensor errors.
 * Accelerations and contact wrenches follow from the state by the laws of motion and contact. After
 * an implicit step they come from that step (model/implicit/implicit.h).
 */
#include "model/plant.h"

#include "model/coupling.h"
#include "model/implicit/implicit.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

/* The Earth's magnetic field, tesla, in the world's axes: x points to magnetic north, z up.
 * Approximately the field in Genoa, where COMAN was built: 47 uT, 61 degrees down (assumed; iron
 * nearby is not modeled). */
static const double magnetic_field_t[3] = {22.8e-6, 0.0, -41.1e-6};

/* Motion of a sensor's frame, in its own axes. */
struct frame_motion {
    double R[9];           /* sensor frame to world */
    double w[3], alpha[3]; /* rad/s, rad/s2 */
    double specific[3];    /* acceleration of the origin minus gravity, m/s2 */
};

/* Computes the acceleration of a point at offset r from the acceleration of the origin and the
 * rotation of the body. */
static void accelerate_point(const double a[3], const double w[3], const double alpha[3],
                             const double r[3], double out[3])
{
    double wr[3];

    vec3_cross(w, r, wr);
    memcpy(out, a, 3 * sizeof *out);
    vec3_add_cross(alpha, r, out);
    vec3_add_cross(w, wr, out);
}

/* Computes the motion of a sensor's frame, in its own axes. */
static void observe_frame(const struct plant *plant, const struct robot_frame *frame,
                          struct frame_motion *out)
{
    const struct body_motion *motion = &plant->sampled_motion[frame->body];
    const struct body_acceleration *acceleration = &plant->acceleration[frame->body];
    double arm[3], a[3];

    mat3_mul(motion->R, frame->rotation, out->R);
    mat3_apply(motion->R, frame->position, arm);
    accelerate_point(acceleration->a, motion->w, acceleration->alpha, arm, a);
    vec3_sub(a, plant->config.robot->gravity, a);
    mat3_apply_transposed(out->R, motion->w, out->w);
    mat3_apply_transposed(out->R, acceleration->alpha, out->alpha);
    mat3_apply_transposed(out->R, a, out->specific);
}

void plant_forget_peaks(struct plant *plant)
{
    memset(plant->peak, 0, plant->config.ncontact * sizeof *plant->peak);
    memset(plant->peak_force, 0, plant->config.ncontact * sizeof *plant->peak_force);
    memset(plant->impulse, 0, plant->config.ncontact * sizeof *plant->impulse);
    plant->impulse_s = 0.0;
}

void plant_raise_peak(struct plant *plant, size_t c, const struct contact_wrench *wrench)
{
    const double square = vec3_dot(wrench->force, wrench->force);

    if (square > plant->peak_force[c] * plant->peak_force[c]) {
        plant->peak_force[c] = sqrt(square);
        plant->peak[c] = *wrench;
    }
}

/* Computes the peaks of a force-torque sensor: the reading with the contact peak of its body
 * instead of the sampled contact, per channel if that is larger. The distal part is rigid and keeps
 * the inertial wrench of the sample. */
static void sample_ft_peak(const struct plant *plant, const struct robot_ft_sensor *sensor,
                           struct ft_sense *ft)
{
    const struct robot_frame *frame = &plant->config.robot->frame[sensor->frame];

    memcpy(ft->peak_n, ft->force_n, sizeof ft->peak_n);
    memcpy(ft->peak_nm, ft->torque_nm, sizeof ft->peak_nm);
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        const struct contact_wrench *peak = &plant->peak[c], *now = &plant->sampled_wrench[c];
        double world[3], force[3], moment[3], f[3], m[3];

        if (plant->config.contact_body[c] != frame->body || plant->peak_force[c] == 0.0) {
            continue;
        }
        vec3_sub(peak->force, now->force, world);
        mat3_apply_transposed(plant->sampled_motion[frame->body].R, world, force);
        vec3_sub(peak->moment, now->moment, world);
        mat3_apply_transposed(plant->sampled_motion[frame->body].R, world, moment);
        vec3_add_cross(force, frame->position, moment);
        mat3_apply_transposed(frame->rotation, force, f);
        mat3_apply_transposed(frame->rotation, moment, m);
        for (int i = 0; i < 3; i++) {
            ft->peak_n[i] += fabs(ft->force_n[i] + f[i]) > fabs(ft->force_n[i]) ? f[i] : 0.0;
            ft->peak_nm[i] += fabs(ft->torque_nm[i] + m[i]) > fabs(ft->torque_nm[i]) ? m[i] : 0.0;
        }
    }
}

/* Fills the readings of the joints. The motor of a joint without a drive reads as if it followed
 * the link. */
static void sample_motors(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    struct motor_sense *motor = plant->sensors.motor;

    for (size_t j = 0; j < robot->njoint; j++) {
        motor[j].q = motor[j].qm = plant_joint_position(plant, plant->state, j);
        motor[j].qd = motor[j].qmd = plant_joint_rate(plant, plant->state, j);
        motor[j].torque_nm = 0.0;
        motor[j].winding_c = PLANT_AMBIENT_C;
    }
    for (size_t i = 0; i < plant->npassive; i++) {
        size_t j = plant->passive_joint[i];

        motor[j].torque_nm = passive_torque(&robot->joint[j].passive, motor[j].q, motor[j].qd);
    }

    /* Add the coupling's torque on each follower */
    const double *q = plant->state + plant->at.v - robot->njoint;
    const double *qd = plant->state + plant->at.drive - robot->njoint;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        motor[coupling->follower].torque_nm -=
            coupling_force(coupling, coupling_error(coupling, q), coupling_rate(coupling, qd));
    }
    if (plant->nhydraulic > 0) {
        plant_hydraulic_sample(plant);
    }
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        struct sea_state drive = plant_drive_state(plant, plant->state, d);
        const struct robot_effects *effects = robot->joint[j].sea.effects;

        motor[j].qm = drive.qm;
        motor[j].qmd = drive.qmd;
        motor[j].current_a = drive.I;
        motor[j].torque_nm = plant_drive_torque(plant, plant->state, d);
        motor[j].voltage_v = plant->voltage[d];
        if (plant->has_effects && effects && effects->thermal.winding_k_w > 0.0) {
            motor[j].winding_c = plant_effects_state(plant, plant->state, d).winding_c;
        }
    }
}

/* Computes vdot, ext and contact_wrench, from the last implicit step or from the laws of motion and
 * contact. */
static enum error_code find_sampled_forces(struct plant *plant)
{
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = plant->state + plant->at.v;
    struct plant_load load = {0.0, 0.0};

    /* Use the forces of the implicit step, if the present state is its result under the same pushes
     * and was not written afterwards */
    plant->sampled_step = plant->stepped && (!plant->handed_out ||
                                             memcmp(plant->state, plant->last_good,
                                                    plant->at.count * sizeof *plant->state) == 0);
    if (!plant->sampled_step) {
        plant_list_bristles(plant);
        return plant_evaluate(plant, plant->state, &load);
    }
    plant_place(plant, plant->state);
    implicit_last_forces(plant);
    dynamics->ops->kinematics(dynamics, plant->q, v, plant->motion);
    plant_apply_loads(plant, v, &load);
    return ERROR_NONE;
}

enum error_code plant_sample(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = plant->state + plant->at.v;
    enum error_code code = find_sampled_forces(plant);

    if (code != ERROR_NONE) {
        return code;
    }
    /* Sample motions, accelerations and wrenches of one state */
    if (!plant->sampled_step) {
        dynamics->ops->kinematics(dynamics, plant->q, v, plant->motion);
    }
    memcpy(plant->sampled_motion, plant->motion,
           (robot->nbody + plant->config.nfree) * sizeof *plant->sampled_motion);
    dynamics->ops->acceleration(dynamics, plant->q, v, plant->vdot, plant->acceleration);
    memcpy(plant->sampled_wrench, plant->contact_wrench,
           plant->config.ncontact * sizeof *plant->sampled_wrench);
    if (!plant->sampled_step) {
        plant_forget_peaks(plant);
    }
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        plant_raise_peak(plant, c, &plant->sampled_wrench[c]);
    }
    /* Fill the sensors from these samples */
    plant->sensors.time_ns = plant->time_ns;
    plant->sensors.supply_v = plant_supply(plant);
    sample_motors(plant);
    if (plant->config.bending) {
        plant_sample_bending(plant);
    }
    for (size_t f = 0; f < robot->nft; f++) {
        /* Compute the wrench at a force-torque sensor by Newton's and Euler's laws for the distal
         * part: external wrench minus the wrench of weight and inertia */
        struct ft_sense *ft = &plant->sensors.ft[f];
        const struct robot_frame *frame = &plant->config.robot->frame[robot->ft[f].frame];
        const struct wrench *ext = &plant->ext[frame->body];
        const struct robot_inertia *distal = &robot->ft[f].distal;
        struct frame_motion motion;
        double moment[3], a[3], force[3], spin[3], rate[3];

        /* Move the external wrench from the body's origin to the sensor's origin */
        memcpy(moment, ext->moment, sizeof moment);
        vec3_add_cross(ext->force, frame->position, moment);
        mat3_apply_transposed(frame->rotation, ext->force, ft->force_n);
        mat3_apply_transposed(frame->rotation, moment, ft->torque_nm);

        /* Compute the motion of the distal part */
        observe_frame(plant, frame, &motion);
        accelerate_point(motion.specific, motion.w, motion.alpha, distal->com, a);
        for (int i = 0; i < 3; i++) {
            force[i] = -distal->mass * a[i];
            ft->force_n[i] += force[i];
        }
        vec3_add_cross(distal->com, force, ft->torque_nm);
        sym3_apply(distal->I, motion.alpha, rate);
        sym3_apply(distal->I, motion.w, spin);
        vec3_add_cross(motion.w, spin, rate);
        vec3_sub(ft->torque_nm, rate, ft->torque_nm);

        sample_ft_peak(plant, &robot->ft[f], &plant->sensors.ft[f]);
    }
    if (robot->imu_frame >= 0) {
        struct frame_motion motion;

        /* Fill in the inertial sensor: rate, specific force, magnetic field, attitude */
        observe_frame(plant, &plant->config.robot->frame[plant->config.robot->imu_frame], &motion);
        memcpy(plant->sensors.imu.gyro_rad_s, motion.w, sizeof plant->sensors.imu.gyro_rad_s);
        memcpy(plant->sensors.imu.accel_m_s2, motion.specific,
               sizeof plant->sensors.imu.accel_m_s2);
        mat3_apply_transposed(motion.R, magnetic_field_t, plant->sensors.imu.magnetic_t);
        quaternion_from_mat3(motion.R, plant->sensors.imu.quaternion);
    }
    return ERROR_NONE;
}

const struct plant_sensors *plant_sensors(const struct plant *plant)
{
    return &plant->sensors;
}

const struct contact_wrench *plant_contact_wrenches(const struct plant *plant)
{
    return plant->sampled_wrench;
}

const double *plant_contact_peaks(const struct plant *plant)
{
    return plant->peak_force;
}

void plant_contact_mean(const struct plant *plant, size_t c, struct contact_wrench *mean)
{
    const double *p = plant->sampled_motion[plant->config.contact_body[c]].p;
    double shift[3];

    if (plant->impulse_s == 0.0) {
        *mean = plant->sampled_wrench[c];
        return;
    }
    for (int i = 0; i < 3; i++) {
        mean->force[i] = plant->impulse[c].force[i] / plant->impulse_s;
        mean->moment[i] = plant->impulse[c].moment[i] / plant->impulse_s;
    }
    vec3_cross(p, mean->force, shift);
    vec3_sub(mean->moment, shift, mean->moment);
}

size_t plant_patches(const struct plant *plant, struct contact_patch *patch, size_t max)
{
    struct contact_world *contact = plant->config.contact;
    size_t count = contact ? contact->ops->patches(contact, patch, max) : 0;

    if (plant->sampled_step) {
        implicit_patches(plant, patch, count < max ? count : max);
    }
    return count;
}

const struct body_motion *plant_motion(const struct plant *plant)
{
    return plant->sampled_motion;
}

const struct body_motion *plant_whole_motion(struct plant *plant)
{
    plant_place(plant, plant->state);
    plant->whole.ops->kinematics(&plant->whole, plant->q, plant->state + plant->at.v,
                                 plant->whole_motion);
    return plant->whole_motion;
}

void plant_center_of_mass(struct plant *plant, double position[3], double momentum[3])
{
    const struct robot *robot = plant->config.robot;
    const struct body_motion *whole = plant_whole_motion(plant);

    memset(position, 0, 3 * sizeof *position);
    memset(momentum, 0, 3 * sizeof *momentum);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        const struct body_motion *motion = &whole[b];
        double arm[3], velocity[3];

        mat3_apply(motion->R, inertia->com, arm);
        memcpy(velocity, motion->v, sizeof velocity);
        vec3_add_cross(motion->w, arm, velocity);
        for (int i = 0; i < 3; i++) {
            position[i] += inertia->mass * (motion->p[i] + arm[i]) / robot->total_mass;
            momentum[i] += inertia->mass * velocity[i];
        }
    }
}
