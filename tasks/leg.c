/* SPDX-License-Identifier: Apache-2.0 */
/* Leg kinematics in closed form; the derivation is in the header. */
#include "tasks/leg.h"

#include "base/portable_math.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

static const char *const leg_joint_name[BODY_SIDES][LEG_JOINTS] = {
    {"RHipSag", "RHipLat", "RHipYaw", "RKneeSag", "RAnkLat", "RAnkSag"},
    {"LHipSag", "LHipLat", "LHipYaw", "LKneeSag", "LAnkLat", "LAnkSag"},
};

/* The axis of each joint: 0 = x, 1 = y, 2 = z. */
static const int leg_axis[LEG_JOINTS] = {1, 0, 2, 1, 0, 1};

/* Along which axes a joint may be away from the one before it: along what keeps the hip's axes, and
 * the ankle's, in one point, and the knee in line. */
static const bool leg_may_shift[LEG_JOINTS][3] = {
    {true, true, true},   {false, true, false}, {false, false, true},
    {false, false, true}, {false, false, true}, {false, false, false},
};

static bool leg_link_fits(const struct body_link *link, int joint)
{
    for (int k = 0; k < 3; k++) {
        double along = k == leg_axis[joint] ? 1 : 0;

        if (fabs(link->direction[k] - along) > 1e-9 ||
            (!leg_may_shift[joint][k] && fabs(link->origin[k]) > 1e-6)) {
            return false;
        }
    }
    return mat3_is_identity(link->rotation);
}

enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error)
{
    const struct body_link *at[LEG_JOINTS];

    for (int j = 0; j < LEG_JOINTS; j++) {
        const char *name = leg_joint_name[side][j];

        link[j] = body_find_link(model, name);
        if (link[j] < 0 || model->link[link[j]].axis < 0) {
            return error_set(error, ERROR_INPUT, "found no driven joint %s, expected a leg with it",
                             name);
        }
        at[j] = &model->link[link[j]];
        if (at[j]->parent != (j ? link[j - 1] : 0) || !leg_link_fits(at[j], j)) {
            return error_set(error, ERROR_INPUT,
                             "found another place or axis of joint %s, expected a leg with hip "
                             "pitch, roll, yaw, knee, ankle roll, pitch, with axes that meet in "
                             "the hip and in the ankle",
                             name);
        }
    }
    memcpy(leg->hip, at[LEG_HIP_PITCH]->origin, sizeof leg->hip);
    leg->hip[1] += at[LEG_HIP_ROLL]->origin[1];
    leg->thigh_m = -(at[LEG_HIP_YAW]->origin[2] + at[LEG_KNEE]->origin[2]);
    leg->shank_m = -at[LEG_ANKLE_ROLL]->origin[2];
    if (!(leg->thigh_m > 0 && leg->shank_m > 0)) {
        return error_set(error, ERROR_INPUT, "found a leg that points up, expected one below");
    }
    return ERROR_NONE;
}

/* R <- R * rotation about x, y or z by an angle */
static void leg_turn(double R[9], int axis, double angle)
{
    const double unit[3] = {axis == 0, axis == 1, axis == 2};
    double turn[9], old[9];

    mat3_about_axis(unit, angle, turn);
    memcpy(old, R, sizeof old);
    mat3_mul(old, turn, R);
}

void leg_forward(const struct leg_geometry *leg, const double angle[LEG_JOINTS],
                 struct body_pose *foot)
{
    const double thigh[3] = {0, 0, -leg->thigh_m}, shank[3] = {0, 0, -leg->shank_m};
    double offset[3];

    mat3_identity(foot->R);
    memcpy(foot->p, leg->hip, sizeof foot->p);
    for (int j = 0; j < LEG_JOINTS; j++) {
        if (j == LEG_KNEE || j == LEG_ANKLE_ROLL) {
            mat3_apply(foot->R, j == LEG_KNEE ? thigh : shank, offset);
            vec3_add_scaled(foot->p, 1, offset, foot->p);
        }
        leg_turn(foot->R, leg_axis[j], angle[j]);
    }
}

bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS])
{
    double T = leg->thigh_m, S = leg->shank_m;
    double away[3], hip[3], R[9], length, cosine, along, up;
    bool reached = true;

    /* The hip as the foot sees it; the knee from its distance */
    vec3_sub(leg->hip, foot->p, away);
    mat3_apply_transposed(foot->R, away, hip);
    length = vec3_norm(hip);
    cosine = (length * length - T * T - S * S) / (2 * T * S);
    angle[LEG_KNEE] = portable_acos(fmin(fmax(cosine, -1), 1));
    if (!(angle[LEG_KNEE] >= least_knee && angle[LEG_KNEE] <= greatest_knee)) {
        double reach;

        angle[LEG_KNEE] = fmin(fmax(angle[LEG_KNEE], least_knee), greatest_knee);
        reach = sqrt(T * T + S * S + 2 * T * S * portable_cos(angle[LEG_KNEE]));
        for (int k = 0; k < 3 && length > 0; k++) {
            hip[k] *= reach / length;
        }
        reached = false;
    }

    /* The ankle points the shank there */
    along = -T * portable_sin(angle[LEG_KNEE]);
    up = S + T * portable_cos(angle[LEG_KNEE]);
    angle[LEG_ANKLE_ROLL] = portable_asin(fmin(fmax(hip[1] / up, -1), 1));
    up *= portable_cos(angle[LEG_ANKLE_ROLL]);
    angle[LEG_ANKLE_PITCH] =
        portable_atan2(up * -hip[0] + along * hip[2], along * hip[0] + up * hip[2]);

    /* The hip turns what is left */
    memcpy(R, foot->R, sizeof R);
    leg_turn(R, 1, -angle[LEG_ANKLE_PITCH]);
    leg_turn(R, 0, -angle[LEG_ANKLE_ROLL]);
    leg_turn(R, 1, -angle[LEG_KNEE]);
    angle[LEG_HIP_ROLL] = portable_asin(fmin(fmax(-R[5], -1), 1));
    angle[LEG_HIP_PITCH] = portable_atan2(R[2], R[8]);
    angle[LEG_HIP_YAW] = portable_atan2(R[3], R[4]);
    return reached;
}
