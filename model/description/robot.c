/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks the inertias of a robot and computes derived data. The dynamics of a robot that
 * robot_finish accepts are never singular at run time.
 */
#include "model/robot.h"

#include "base/hash.h"
#include "base/portable_math.h"
#include "base/text.h"
#include "model/spatial.h"

#include <stdlib.h>

/* Relative tolerance of inertias, which have six digits or more in files. */
#define INERTIA_TOLERANCE 1e-6
/* Smallest allowed ratio of a joint's inertia with free joints behind it to its inertia with locked
 * joints. */
#define SINGULAR_RATIO 1e-12

/* Returns whether all numbers are finite. */
static bool all_finite(const double *value, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(value[i])) {
            return false;
        }
    }
    return true;
}

/* Computes the principal moments of a symmetric tensor, in ascending order. */
static void principal_moments(const double I[6], double moment[3])
{
    double mean = (I[0] + I[3] + I[5]) / 3.0;
    double a = I[0] - mean, b = I[3] - mean, c = I[5] - mean;
    double spread = a * a + b * b + c * c + 2.0 * (I[1] * I[1] + I[2] * I[2] + I[4] * I[4]);
    double p = sqrt(spread / 6.0), determinant, angle;

    /* Closed form for a symmetric matrix: eigenvalues are mean + 2 p cos(angle + 2 pi n / 3) */
    moment[0] = moment[1] = moment[2] = mean;
    if (p > 0.0) {
        a /= p;
        b /= p;
        c /= p;
        double xy = I[1] / p, xz = I[2] / p, yz = I[4] / p;

        determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
        angle = portable_acos(fmax(-1.0, fmin(1.0, 0.5 * determinant))) / 3.0;
        moment[2] = mean + 2.0 * p * portable_cos(angle);
        moment[0] = mean + 2.0 * p * portable_cos(angle + 2.0 * M_PI / 3.0);
        moment[1] = 3.0 * mean - moment[0] - moment[2];
    }
}

enum error_code robot_check_inertia(const struct robot_inertia *inertia, struct error *error)
{
    double moment[3], trace = inertia->I[0] + inertia->I[3] + inertia->I[5];

    if (!all_finite(&inertia->mass, 1) || !all_finite(inertia->com, 3) ||
        !all_finite(inertia->I, 6)) {
        return error_set(error, ERROR_INPUT, "a mass property is not finite");
    }
    if (inertia->mass < 0.0) {
        return error_set(error, ERROR_INPUT, "mass %g kg is negative", inertia->mass);
    }
    principal_moments(inertia->I, moment);
    if (moment[0] < -INERTIA_TOLERANCE * trace || trace < 0.0) {
        return error_set(error, ERROR_INPUT,
                         "inertia is not positive: its principal moments are %g, %g, %g kg m2",
                         moment[0], moment[1], moment[2]);
    }
    if (moment[2] - moment[0] - moment[1] > INERTIA_TOLERANCE * trace) {
        return error_set(error, ERROR_INPUT,
                         "no body has the principal moments of inertia %g, %g, %g kg m2: the "
                         "largest exceeds the sum of the others",
                         moment[0], moment[1], moment[2]);
    }
    if (inertia->mass == 0.0 && trace > 0.0) {
        return error_set(error, ERROR_INPUT, "inertia without mass");
    }
    return ERROR_NONE;
}

/* Computes y = A s for the unit motion s of a joint. Returns s . y, the effective inertia of the
 * joint. */
static double joint_inertia(const struct robot_joint *joint, const struct spatial_inertia *A,
                            struct spatial *y)
{
    if (joint->type == JOINT_REVOLUTE) {
        sym3_apply(A->J, joint->axis, y->a);
        mat3_apply_transposed(A->H, joint->axis, y->l);
        return vec3_dot(joint->axis, y->a);
    }
    mat3_apply(A->H, joint->axis, y->a);
    sym3_apply(A->M, joint->axis, y->l);
    return vec3_dot(joint->axis, y->l);
}

/* Adds a body's inertia to its parent's, with the joint at position q. */
static void hand_to_parent(const struct robot_joint *joint, double q, struct spatial_inertia A,
                           struct spatial_inertia *parent)
{
    double R[9], r[3];

    robot_place_child(joint, q, R, r);
    spatial_inertia_rotate(R, &A);
    spatial_inertia_shift(r, &A);
    spatial_inertia_add(&A, parent);
}

/* Returns whether a free base has inertia in all directions. whole: inertia of all bodies with
 * locked joints, to compare with. */
static bool base_is_regular(const struct spatial_inertia *A, const struct spatial_inertia *whole)
{
    double m[6][6];

    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m[i][j] = A->J[sym3_index[i][j]];
            m[i][j + 3] = m[j + 3][i] = A->H[3 * i + j];
            m[i + 3][j + 3] = A->M[sym3_index[i][j]];
        }
    }
    /* Gaussian elimination. Compare each pivot with the inertia of the rigid robot */
    for (int k = 0; k < 6; k++) {
        double rigid = k < 3 ? whole->J[sym3_index[k][k]] : whole->M[sym3_index[k - 3][k - 3]];

        if (!(m[k][k] > SINGULAR_RATIO * rigid)) {
            return false;
        }
        for (int i = k + 1; i < 6; i++) {
            double factor = m[i][k] / m[k][k];

            for (int j = k; j < 6; j++) {
                m[i][j] -= factor * m[k][j];
            }
        }
    }
    return true;
}

/* Checks that no joint and no free base moves without inertia. Computes the articulated inertias in
 * an arbitrary pose and compares each with the inertia of the same bodies with locked joints. */
static enum error_code check_regular(const struct robot *robot, struct spatial_inertia *A,
                                     struct spatial_inertia *whole, struct error *error)
{
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;

        spatial_inertia_rigid(inertia->mass, inertia->com, inertia->I, &A[b]);
        whole[b] = A[b];
    }

    /* Go inward, joint by joint. A: inertia with free joints; whole: inertia with locked joints */
    for (size_t b = robot->nbody - 1; b > 0; b--) {
        const struct robot_joint *joint = &robot->joint[b - 1];
        int parent = robot->body[b].parent;
        double q = 0.3 + 0.1 * (double)(b % 7), d, rigid;
        struct spatial y;

        rigid = joint_inertia(joint, &whole[b], &y);
        d = joint_inertia(joint, &A[b], &y);
        if (!(d > SINGULAR_RATIO * rigid)) {
            return error_set(error, ERROR_INPUT,
                             "%s: joint %s moves nothing that has inertia about its axis",
                             robot->name, joint->name);
        }

        /* Remove the motion of a free joint from an articulated inertia: A -= y y^T / d */
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                A[b].H[3 * i + j] -= y.a[i] * y.l[j] / d;
            }
            for (int j = i; j < 3; j++) {
                A[b].J[sym3_index[i][j]] -= y.a[i] * y.a[j] / d;
                A[b].M[sym3_index[i][j]] -= y.l[i] * y.l[j] / d;
            }
        }
        hand_to_parent(joint, q, A[b], &A[parent]);
        hand_to_parent(joint, q, whole[b], &whole[parent]);
    }
    if (robot->floating && !base_is_regular(&A[0], &whole[0])) {
        return error_set(error, ERROR_INPUT, "%s: the floating base has no inertia of its own",
                         robot->name);
    }
    return ERROR_NONE;
}

/* Adds numbers to a hash. -0 counts as 0. */
static uint64_t hash_doubles(uint64_t hash, const double *value, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        double plain = value[i] + 0.0; /* -0 counts as 0 */

        hash = hash_bytes(hash, &plain, sizeof plain);
    }
    return hash;
}

/* Adds an integer to a hash. */
static uint64_t hash_integer(uint64_t hash, int64_t value)
{
    return hash_bytes(hash, &value, sizeof value);
}

/* Returns the hash of all data on which the dynamics depend, with or without mass properties. */
static uint64_t robot_hash(const struct robot *robot, bool masses)
{
    uint64_t hash = HASH_START;

    hash = hash_integer(hash, robot->floating);
    hash = hash_doubles(hash, robot->gravity, 3);
    hash = hash_integer(hash, (int64_t)robot->nbody);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_body *body = &robot->body[b];

        hash = hash_integer(hash, body->parent);
        hash = hash_integer(hash, body->observed);
        if (masses) {
            hash = hash_doubles(hash, &body->inertia.mass, 1);
            hash = hash_doubles(hash, body->inertia.com, 3);
            hash = hash_doubles(hash, body->inertia.I, 6);
        }
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        hash = hash_integer(hash, joint->type);
        hash = hash_doubles(hash, joint->axis, 3);
        hash = hash_doubles(hash, joint->origin, 3);
        hash = hash_doubles(hash, joint->rotation, 9);
    }
    return hash;
}

enum error_code robot_finish(struct robot *robot, struct error *error)
{
    struct spatial_inertia *scratch;
    enum error_code code;

    /* Check the mass properties of all bodies and of the parts below force-torque sensors */
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot_check_inertia(&robot->body[b].inertia, error)) {
            return error_prefix(error, "%s: body %s", robot->name, robot->body[b].name);
        }
    }
    for (size_t s = 0; s < robot->nft; s++) {
        if (robot_check_inertia(&robot->ft[s].distal, error)) {
            return error_prefix(error, "%s: what hangs below sensor %s", robot->name,
                                robot->ft[s].name);
        }
    }
    scratch = calloc(2 * robot->nbody, sizeof *scratch);
    if (!scratch) {
        return error_set(error, ERROR_MEMORY, "no memory to check %s", robot->name);
    }
    code = check_regular(robot, scratch, scratch + robot->nbody, error);
    free(scratch);
    if (code) {
        return code;
    }

    /* Compute derived data: sizes, mass, observed bodies, hashes */
    robot->nq = robot->njoint + (robot->floating ? BASE_Q_COUNT : 0);
    robot->nv = robot->njoint + (robot->floating ? BASE_V_COUNT : 0);
    robot->total_mass = 0.0;
    for (size_t b = 0; b < robot->nbody; b++) {
        robot->total_mass += robot->body[b].inertia.mass;
    }
    for (size_t f = 0; f < robot->nframe; f++) {
        robot->body[robot->frame[f].body].observed = true;
    }
    for (size_t c = 0; c < robot->ncapsule; c++) {
        robot->body[robot->capsule[c].body].observed = true;
    }
    robot->hash = robot_hash(robot, true);
    robot->massless_hash = robot_hash(robot, false);
    return ERROR_NONE;
}

const struct robot_coupling *robot_find_coupling(const struct robot *robot, size_t j)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        if (robot->coupling[i].follower == (int)j) {
            return &robot->coupling[i];
        }
    }
    return NULL;
}

int robot_find_body(const struct robot *robot, const char *name)
{
    return TEXT_FIND(robot->body, robot->nbody, name, name);
}

int robot_find_joint(const struct robot *robot, const char *name)
{
    return TEXT_FIND(robot->joint, robot->njoint, name, name);
}

int robot_find_frame(const struct robot *robot, const char *name)
{
    return TEXT_FIND(robot->frame, robot->nframe, name, name);
}

int robot_find_pose(const struct robot *robot, const char *name)
{
    return TEXT_FIND(robot->pose, robot->npose, name, name);
}
