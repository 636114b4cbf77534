/* SPDX-License-Identifier: Apache-2.0 */
/* Estimates the state of a walking robot; tasks/estimate.h names the sensors of each estimate. */
#include "tasks/estimate.h"

#include "base/portable_math.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

static const char *const foot_force_name[BODY_SIDES] = {"r_leg_ft", "l_leg_ft"};

/* Share of the weight below which a foot has no fixed anchor, because it may still tilt about an
 * edge. */
#define ANCHOR_SHARE 0.3

/* Limit of the corrected tilt of the inertial board, rad: three times the usual error of a
 * board. */
#define LEAN_MAX_RAD 0.15

struct estimator {
    struct estimate_config config;
    const struct body_model *model;
    struct host *host;
    size_t force[BODY_SIDES]; /* index of the host's force-torque board */
    double *angle;            /* by axis of the host */
    struct body_pose *pose;   /* by link, in the pelvis's frame */
    bool located;             /* the observer of the center of mass is initialized */
    double lean[2]; /* estimated tilt of the board's attitude about the world's x and y, rad */
    struct estimate now;
};

/* Finds the force-torque boards of both feet, and checks for an inertial board and soles. Returns
 * ERROR_INPUT if one is missing. */
static enum error_code estimator_find_boards(struct estimator *estimator, struct error *error)
{
    const struct host_config *config = host_configuration(estimator->host);
    const struct body_model *model = estimator->model;

    if (!config->imu.present || model->imu.link < 0) {
        return error_set(error, ERROR_INPUT,
                         "the rig has no inertial board, expected one on the pelvis");
    }

    /* Watch all of these sensors, because balance needs them */
    host_watch_motion(estimator->host);
    for (int side = 0; side < BODY_SIDES; side++) {
        bool found = false;

        for (size_t i = 0; i < config->nft; i++) {
            if (strcmp(config->ft[i].name, foot_force_name[side]) == 0) {
                estimator->force[side] = i;
                host_watch_force(estimator->host, i);
                found = true;
            }
        }
        if (!found || model->foot_force[side].link < 0 || model->sole[side].link < 0) {
            return error_set(error, ERROR_INPUT,
                             "the rig has no force-torque board for %s, or its robot no sole",
                             foot_force_name[side]);
        }
    }
    return ERROR_NONE;
}

enum error_code estimator_create(const struct estimate_config *config,
                                 const struct body_model *model, struct host *host,
                                 struct arena *arena, struct estimator **out, struct error *error)
{
    struct estimator *estimator = arena_alloc(arena, 1, sizeof *estimator);
    double *angle = arena_alloc(arena, host_configuration(host)->naxis, sizeof *angle);
    struct body_pose *pose = arena_alloc(arena, model->nlink, sizeof *pose);

    if (!estimator || !angle || !pose) {
        return error_set(error, ERROR_MEMORY, "no memory for the state estimation");
    }
    estimator->config = *config;
    estimator->model = model;
    estimator->host = host;
    estimator->angle = angle;
    estimator->pose = pose;
    *out = estimator;
    return estimator_find_boards(estimator, error);
}

/* ---- attitude ---- */

/* Computes the rotation from pelvis to world from the inertial board's quaternion, corrected by the
 * estimated tilt of the board. */
static void estimate_board_attitude(const struct estimator *estimator, double R[9])
{
    const struct host_motion *motion = host_motion(estimator->host);
    const double lean[3] = {estimator->lean[0], estimator->lean[1], 0.0};
    double angle = vec3_norm(lean), sensor[9], back[9], axis[3], old[9];

    mat3_from_quaternion(motion->quaternion, sensor);
    mat3_transpose(estimator->model->imu.rotation, back);
    mat3_mul(sensor, back, R);
    if (!(angle > 0.0)) {
        return;
    }
    /* Rotate back by the estimated tilt, about the world's horizontal axes */
    for (int k = 0; k < 3; k++) {
        axis[k] = lean[k] / angle;
    }
    mat3_about_axis(axis, -angle, back);
    memcpy(old, R, sizeof old);
    mat3_mul(back, old, R);
}

/* Rotates R by a rotation vector in its own frame, rad: R <- R * exp(turn). */
static void estimate_rotate(double R[9], const double turn[3])
{
    double angle = vec3_norm(turn), axis[3], step[9], old[9], quaternion[4];

    if (!(angle > 0)) {
        return;
    }
    for (int k = 0; k < 3; k++) {
        axis[k] = turn[k] / angle;
    }
    mat3_about_axis(axis, angle, step);
    memcpy(old, R, sizeof old);
    mat3_mul(old, step, R);
    quaternion_from_mat3(R, quaternion); /* keeps R orthogonal */
    mat3_from_quaternion(quaternion, R);
}

/* Computes the small rotation from the estimated to the reported attitude, in the pelvis's frame.
 * The reported attitude is the quaternion or, without a quaternion, the direction of gravity.
 * Returns false if the board reports neither. */
static bool estimate_attitude_error(const struct estimator *estimator, double turn[3])
{
    const struct host_motion *motion = host_motion(estimator->host);
    const double *R = estimator->now.R;

    if (motion->quaternion_time_ns >= 0) {
        double board[9], apart[9];

        estimate_board_attitude(estimator, board);
        /* The error is R^T * board; a small rotation is the skew-symmetric part of its matrix */
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                apart[3 * i + j] =
                    R[i] * board[j] + R[3 + i] * board[3 + j] + R[6 + i] * board[6 + j];
            }
        }
        turn[0] = (apart[7] - apart[5]) / 2;
        turn[1] = (apart[2] - apart[6]) / 2;
        turn[2] = (apart[3] - apart[1]) / 2;
        return true;
    }
    if (motion->acceleration_time_ns >= 0 && vec3_norm(motion->acceleration_m_s2) > 1) {
        /* At rest the specific force points up. The cross product gives the rotation of the
         * specific force onto the world's z axis */
        double felt[3], norm = vec3_norm(motion->acceleration_m_s2);

        mat3_apply(estimator->model->imu.rotation, motion->acceleration_m_s2, felt);
        vec3_cross(felt, R + 6, turn); /* R + 6: world's z axis in the pelvis's frame */
        for (int k = 0; k < 3; k++) {
            turn[k] /= norm;
        }
        return true;
    }
    return false;
}

/* Updates the attitude with a complementary filter: integrates the angular rate, then corrects a
 * fraction of the error. */
static void estimate_attitude(struct estimator *estimator, double dt_s)
{
    const struct host_motion *motion = host_motion(estimator->host);
    struct estimate *now = &estimator->now;
    double turn[3], share = fmin(estimator->config.attitude_per_s * dt_s, 1);

    mat3_apply(estimator->model->imu.rotation, motion->rate_rad_s, now->rate_rad_s);
    for (int k = 0; k < 3; k++) {
        turn[k] = now->rate_rad_s[k] * dt_s;
    }
    estimate_rotate(now->R, turn);
    /* Correct the drift with the time constant 1 / attitude_per_s */
    if (estimate_attitude_error(estimator, turn)) {
        for (int k = 0; k < 3; k++) {
            turn[k] *= share;
        }
        estimate_rotate(now->R, turn);
    }
    /* Roll, pitch and yaw of R = Rz Ry Rx */
    now->pitch_rad = portable_asin(fmin(fmax(-now->R[6], -1), 1));
    now->roll_rad = portable_atan2(now->R[7], now->R[8]);
    now->yaw_rad = portable_atan2(now->R[3], now->R[0]);
}

/* ---- feet ---- */

/* Computes force, center of pressure and pose of a foot. The position is relative to the pelvis, in
 * the world's axes; odometry later adds the pelvis. */
static void estimate_foot(struct estimator *estimator, int side)
{
    const struct body_model *model = estimator->model;
    const struct host_force *force = host_force(estimator->host, estimator->force[side]);
    struct estimate_foot *foot = &estimator->now.foot[side];
    struct body_pose sole, sensor;
    double F[3], M[3], lever[3], in_sole[3], up;

    body_place_frame(&model->sole[side], &estimator->pose[model->sole[side].link], &sole);
    body_place_frame(&model->foot_force[side], &estimator->pose[model->foot_force[side].link],
                     &sensor);

    /* Transform force and moment into the sole's axes, about the sole's origin */
    mat3_apply(sensor.R, force->force_n, F);
    mat3_apply(sensor.R, force->torque_nm, M);
    vec3_sub(sensor.p, sole.p, lever);
    vec3_add_cross(lever, F, M);
    mat3_apply_transposed(sole.R, F, in_sole);
    mat3_apply_transposed(sole.R, M, lever);
    /* Center of pressure: where the moment about the sole's horizontal axes vanishes */
    up = in_sole[2];
    foot->loaded = up > estimator->config.loaded_n;
    foot->cop_m[0] = foot->loaded ? -lever[1] / up : 0;
    foot->cop_m[1] = foot->loaded ? lever[0] / up : 0;

    /* Rotate force and pose into the world's axes */
    mat3_apply(estimator->now.R, F, foot->force_n);
    mat3_mul(estimator->now.R, sole.R, foot->sole.R);
    mat3_apply(estimator->now.R, sole.p, foot->sole.p);
    foot->yaw_rad = portable_atan2(foot->sole.R[3], foot->sole.R[0]);
}

/* Updates the position of the pelvis by leg odometry: the mean over the anchored feet, weighted by
 * their loads. Feet without load get new anchors. */
static void estimate_odometry(struct estimator *estimator)
{
    struct estimate *now = &estimator->now;
    double load[BODY_SIDES], sum = 0, pelvis[3] = {0};

    /* Use the vertical forces as weights; equal weights if no foot carries load */
    for (int side = 0; side < BODY_SIDES; side++) {
        load[side] = fmax(now->foot[side].force_n[2], 0);
        sum += load[side];
    }
    /* Pelvis = anchor - sole relative to the pelvis */
    for (int side = 0; side < BODY_SIDES; side++) {
        double share = sum > 1 ? load[side] / sum : 0.5, from[3];

        vec3_sub(now->foot[side].anchor, now->foot[side].sole.p, from);
        vec3_add_scaled(pelvis, share, from, pelvis);
    }
    memcpy(now->pelvis_m, pelvis, sizeof pelvis);
    /* A foot with little load gets a new anchor at its present place */
    for (int side = 0; side < BODY_SIDES; side++) {
        struct estimate_foot *foot = &now->foot[side];

        vec3_add_scaled(foot->sole.p, 1, pelvis, foot->sole.p);
        if (sum > 1 && load[side] < ANCHOR_SHARE * sum) {
            memcpy(foot->anchor, foot->sole.p, sizeof foot->anchor);
        }
    }
}

/* ---- center of mass ---- */

/* ---- complete estimate ---- */

/* Computes the poses of all links from the encoders, then the state of both feet. */
static void estimate_place(struct estimator *estimator)
{
    size_t naxis = host_configuration(estimator->host)->naxis;

    for (size_t i = 0; i < naxis; i++) {
        estimator->angle[i] = host_joint(estimator->host, i)->joint_rad;
    }
    body_place(estimator->model, estimator->angle, estimator->pose);
    for (int side = 0; side < BODY_SIDES; side++) {
        estimate_foot(estimator, side);
    }
}

void estimator_start(struct estimator *estimator)
{
    struct estimate *now = &estimator->now;
    double middle[3] = {0};

    memset(now, 0, sizeof *now);
    memset(estimator->lean, 0, sizeof estimator->lean);
    mat3_identity(now->R);
    if (host_motion(estimator->host)->quaternion_time_ns >= 0) {
        estimate_board_attitude(estimator, now->R);
    }
    estimate_place(estimator);
    /* Put the world's origin midway between the soles */
    for (int side = 0; side < BODY_SIDES; side++) {
        vec3_add_scaled(middle, 0.5, now->foot[side].sole.p, middle);
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        vec3_sub(now->foot[side].sole.p, middle, now->foot[side].anchor);
    }
    estimator->located = false;
}

void estimator_update(struct estimator *estimator, bool walks, double speed_m_s, double dt_s)
{
    const struct estimate_config *config = &estimator->config;
    double share = 1.0, l = config->com_per_s;

    /* Choose the bandwidth of the observer of the center of mass, 1/s. Impacts of steps are noise
     * that grows with the speed. The bandwidth therefore changes from com_per_s at half of
     * com_walking_m_s to com_walking_per_s at com_walking_m_s */
    if (walks && config->com_walking_per_s > 0.0) {
        if (config->com_walking_m_s > 0.0) {
            share = fmin(fmax(2.0 * speed_m_s / config->com_walking_m_s - 1.0, 0.0), 1.0);
        }
        l = config->com_per_s + share * (config->com_walking_per_s - config->com_per_s);
    }
    estimate_attitude(estimator, dt_s);
    estimate_place(estimator);
    estimate_odometry(estimator);

    /* Update the observer of the center of mass from the forces' acceleration and the encoders'
     * position (Luenberger observer, critically damped). l: its double pole, 1/s. */
    const struct body_model *model = estimator->model;
    struct estimate *now = &estimator->now;
    const double rate = estimator->config.lean_per_s * l * l / model->gravity_m_s2;
    const double most = LEAN_MAX_RAD;
    double com[3], seen[3], apart[3], *lean = estimator->lean;

    body_center_of_mass(model, estimator->pose, com);
    mat3_apply(now->R, com, seen);
    vec3_add_scaled(seen, 1, now->pelvis_m, seen);
    if (!estimator->located) {
        memcpy(now->com_m, seen, sizeof seen);
        estimator->located = true;
    }
    for (int k = 0; k < 3; k++) {
        double force = now->foot[0].force_n[k] + now->foot[1].force_n[k];
        double acceleration = force / model->mass_kg - (k == 2 ? model->gravity_m_s2 : 0);

        apart[k] = seen[k] - now->com_m[k];
        now->com_m[k] += (now->com_m_s[k] + 2 * l * apart[k]) * dt_s;
        now->com_m_s[k] += (acceleration + l * l * apart[k]) * dt_s;
    }
    /* Estimate the tilt of the board. In a frame tilted by e about y, the forces seem to accelerate
     * the center of mass by g e along x, but the encoders measure no motion. The observer's error
     * settles at -g e / l^2. For a tilt about x, the sign is opposite. The correction of the
     * attitude also moves the center of mass above the standing foot, which closes a feedback loop.
     * COMAN's loop is stable up to a lean_per_s of about 1.3 */
    if (isfinite(apart[0] + apart[1])) {
        lean[0] = fmax(-most, fmin(most, lean[0] + rate * apart[1] * dt_s));
        lean[1] = fmax(-most, fmin(most, lean[1] - rate * apart[0] * dt_s));
    }

    /* Computes the zero-moment point of both feet: the mean of the centers of pressure, weighted
     * by the loads. Keeps the last point while no foot carries load. */
    double sum = 0, at[2] = {0};

    for (int side = 0; side < BODY_SIDES; side++) {
        const struct estimate_foot *foot = &estimator->now.foot[side];
        double load = foot->loaded ? foot->force_n[2] : 0;

        for (int k = 0; k < 2; k++) {
            const double *row = foot->sole.R + 3 * k;

            at[k] += load * (foot->sole.p[k] + row[0] * foot->cop_m[0] + row[1] * foot->cop_m[1]);
        }
        sum += load;
    }
    for (int k = 0; k < 2 && sum > 0; k++) {
        estimator->now.zmp_m[k] = at[k] / sum;
    }
}

const struct estimate *estimator_read(const struct estimator *estimator)
{
    return &estimator->now;
}
