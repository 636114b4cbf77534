/* SPDX-License-Identifier: Apache-2.0 */
/* Leg kinematics in closed form; tasks/leg.h has the derivation. */
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

/* The kinds of legs: the joints from the pelvis to the foot, and the axes along which a joint may
 * be offset from its predecessor. The closed form is valid only for these offsets, because axes
 * must meet in one point, and the knee must be in line. */
static const struct leg_kind {
    enum leg_joint joint[LEG_JOINTS];
    bool may_shift[LEG_JOINTS][3];
} leg_kinds[] = {
    {{LEG_HIP_PITCH, LEG_HIP_ROLL, LEG_HIP_YAW, LEG_KNEE, LEG_ANKLE_ROLL, LEG_ANKLE_PITCH},
     {{true, true, true},
      {false, true, false},
      {false, false, true},
      {false, false, true},
      {false, false, true},
      {false, false, false}}},
    {{LEG_HIP_ROLL, LEG_HIP_YAW, LEG_HIP_PITCH, LEG_KNEE, LEG_ANKLE_PITCH, LEG_ANKLE_ROLL},
     {{true, true, true},
      {true, true, true},
      {false, false, true},
      {false, false, true},
      {false, false, true},
      {false, false, false}}},
};

/* Returns whether a joint turns about a coordinate axis (0 = x, 1 = y, 2 = z), and whether its
 * offset is zero along each axis that may_shift excludes. */
static bool leg_link_fits(const struct body_link *link, int axis, const bool may_shift[3])
{
    for (int k = 0; k < 3; k++) {
        double along = k == axis ? 1 : 0;

        if (fabs(link->direction[k] - along) > 1e-9 ||
            (!may_shift[k] && fabs(link->origin[k]) > 1e-6)) {
            return false;
        }
    }
    return mat3_is_identity(link->rotation);
}

/* Returns the link that carries a leg. Starts at `link`, and skips parent links without a motor and
 * without rotation (flexible mounts). Adds the offsets of the skipped links to hip. */
static int leg_find_root(const struct body_model *model, int link, double hip[3])
{
    const struct body_link *at = &model->link[link];

    while (link > 0 && at->axis < 0 && at->fixed_rad == 0.0 && mat3_is_identity(at->rotation)) {
        vec3_add_scaled(hip, 1, at->origin, hip);
        link = at->parent;
        at = &model->link[link];
    }
    return link;
}

enum error_code leg_find(const struct body_model *model, int side, int link[LEG_JOINTS],
                         struct leg_geometry *leg, struct error *error)
{
    const struct body_link *at[LEG_JOINTS];
    const struct leg_kind *kind;

    for (int j = 0; j < LEG_JOINTS; j++) {
        const char *name = leg_joint_name[side][j];

        link[j] = body_find_link(model, name);
        if (link[j] < 0 || model->link[link[j]].axis < 0) {
            return error_set(error, ERROR_INPUT, "found no driven joint %s, expected a leg with it",
                             name);
        }
    }
    /* Detect the second kind: its first joint is a roll joint */
    memset(leg->hip, 0, sizeof leg->hip);
    leg->roll_first =
        leg_find_root(model, model->link[link[LEG_HIP_ROLL]].parent, (double[3]){0}) == 0;
    kind = &leg_kinds[leg->roll_first];
    memcpy(leg->chain, kind->joint, sizeof leg->chain);
    /* Check axes and offsets, because the closed form is valid only for this chain */
    for (int i = 0; i < LEG_JOINTS; i++) {
        int joint = leg->chain[i];

        at[i] = &model->link[link[joint]];
        if ((i ? at[i]->parent != link[leg->chain[i - 1]]
               : leg_find_root(model, at[i]->parent, leg->hip) != 0) ||
            !leg_link_fits(at[i], leg_axis[joint], kind->may_shift[i])) {
            return error_set(error, ERROR_INPUT,
                             "found another place or axis of joint %s, expected a leg with hip "
                             "pitch, roll, yaw, knee, ankle roll, pitch, with axes that meet in "
                             "the hip and in the ankle, or one with hip roll, yaw, pitch, knee, "
                             "ankle pitch, roll",
                             leg_joint_name[side][joint]);
        }
    }
    /* Store the lengths */
    vec3_add_scaled(leg->hip, 1, at[0]->origin, leg->hip);
    memset(leg->offset, 0, sizeof leg->offset);
    if (leg->roll_first) {
        memcpy(leg->offset, at[1]->origin, sizeof leg->offset);
        leg->offset[2] += at[2]->origin[2];
        vec3_add_scaled(leg->hip, 1, leg->offset, leg->hip);
        leg->thigh_m = -at[3]->origin[2];
    } else {
        leg->hip[1] += at[1]->origin[1];
        leg->thigh_m = -(at[2]->origin[2] + at[3]->origin[2]);
    }
    leg->shank_m = -at[4]->origin[2];
    if (!(leg->thigh_m > 0 && leg->shank_m > 0)) {
        return error_set(error, ERROR_INPUT, "found a leg that points up, expected one below");
    }
    return ERROR_NONE;
}

/* Rotates R about its own x, y or z axis: R <- R * Rot(axis, angle), rad. */
static void leg_turn(double R[9], int axis, double angle)
{
    const double unit[3] = {axis == 0, axis == 1, axis == 2};
    double turn[9], old[9];

    mat3_about_axis(unit, angle, turn);
    memcpy(old, R, sizeof old);
    mat3_mul(old, turn, R);
}

/* Computes the knee's angle from the distance between hip and ankle (law of cosines). Returns false
 * if the angle is limited. *scale is then the factor from the distance to the limited distance. */
static bool leg_bend_knee(const struct leg_geometry *leg, double length, double least_knee,
                          double greatest_knee, double *knee, double *scale)
{
    double T = leg->thigh_m, S = leg->shank_m;
    double cosine = (length * length - T * T - S * S) / (2 * T * S);

    *scale = 1;
    *knee = portable_acos(fmin(fmax(cosine, -1), 1));
    if (*knee >= least_knee && *knee <= greatest_knee) {
        return true;
    }
    *knee = fmin(fmax(*knee, least_knee), greatest_knee);
    if (length > 0) {
        *scale = sqrt(T * T + S * S + 2 * T * S * portable_cos(*knee)) / length;
    }
    return false;
}

/* Computes the joint angles of a leg of the first kind (see leg.h). Returns false if the foot is
 * out of reach. */
static bool leg_inverse_pitch_first(const struct leg_geometry *leg, const struct body_pose *foot,
                                    double least_knee, double greatest_knee,
                                    double angle[LEG_JOINTS])
{
    double T = leg->thigh_m, S = leg->shank_m;
    double away[3], hip[3], R[9], along, up, scale;
    bool reached;

    /* Compute the hip's position in the foot's frame, and the knee from its distance */
    vec3_sub(leg->hip, foot->p, away);
    mat3_apply_transposed(foot->R, away, hip);
    reached =
        leg_bend_knee(leg, vec3_norm(hip), least_knee, greatest_knee, &angle[LEG_KNEE], &scale);
    for (int k = 0; k < 3; k++) {
        hip[k] *= scale;
    }

    /* Choose the ankle's angles so that shank and thigh reach the hip */
    along = -T * portable_sin(angle[LEG_KNEE]);
    up = S + T * portable_cos(angle[LEG_KNEE]);
    angle[LEG_ANKLE_ROLL] = portable_asin(fmin(fmax(hip[1] / up, -1), 1));
    up *= portable_cos(angle[LEG_ANKLE_ROLL]);
    angle[LEG_ANKLE_PITCH] =
        portable_atan2(up * -hip[0] + along * hip[2], along * hip[0] + up * hip[2]);

    /* Choose the hip's angles for the remaining rotation, Ry Rx Rz */
    memcpy(R, foot->R, sizeof R);
    leg_turn(R, 1, -angle[LEG_ANKLE_PITCH]);
    leg_turn(R, 0, -angle[LEG_ANKLE_ROLL]);
    leg_turn(R, 1, -angle[LEG_KNEE]);
    angle[LEG_HIP_ROLL] = portable_asin(fmin(fmax(-R[5], -1), 1));
    angle[LEG_HIP_PITCH] = portable_atan2(R[2], R[8]);
    angle[LEG_HIP_YAW] = portable_atan2(R[3], R[4]);
    return reached;
}

/* Rotates v by minus an angle about the x, y or z axis. */
static void leg_turn_back(double v[3], int axis, double angle)
{
    const double unit[3] = {axis == 0, axis == 1, axis == 2};
    double turn[9], old[3];

    mat3_about_axis(unit, angle, turn);
    memcpy(old, v, sizeof old);
    mat3_apply_transposed(turn, old, v);
}

/* Computes the joint angles of a leg of the second kind (see leg.h). Returns false if the foot is
 * out of reach. */
static bool leg_inverse_roll_first(const struct leg_geometry *leg, const struct body_pose *foot,
                                   double least_knee, double greatest_knee,
                                   double angle[LEG_JOINTS])
{
    const double *d = leg->offset;
    double T = leg->thigh_m, S = leg->shank_m;
    double f[3] = {foot->R[0], foot->R[3], foot->R[6]}, a[3], R[9], turned[9], back[9];
    double A, B, ratio, along, down, scale;
    bool reached, in_plane;

    /* Hip roll: solve the equation of leg.h, A cos h1 + B sin h1 = fx dy. It puts ankle and foot
     * into the leg's plane */
    vec3_sub(foot->p, leg->hip, a);
    vec3_add_scaled(a, 1, d, a);
    A = f[0] * a[1] - f[1] * (a[0] - d[0]);
    B = f[0] * a[2] - f[2] * (a[0] - d[0]);
    ratio = f[0] * d[1] / sqrt(A * A + B * B);
    in_plane = fabs(ratio) <= 1;
    ratio = in_plane ? ratio : ratio > 0 ? 1 : -1;
    angle[LEG_HIP_ROLL] = portable_atan2(B, A) + portable_acos(ratio);

    /* Hip yaw: direction of the foot's x axis. Then compute the ankle relative to the hip, in the
     * plane */
    leg_turn_back(a, 0, angle[LEG_HIP_ROLL]);
    leg_turn_back(f, 0, angle[LEG_HIP_ROLL]);
    angle[LEG_HIP_YAW] = portable_atan2(f[1], f[0]);
    vec3_sub(a, d, a);
    leg_turn_back(a, 2, angle[LEG_HIP_YAW]);

    /* Hip pitch and knee: thigh and shank reach the ankle */
    reached = leg_bend_knee(leg, vec3_norm(a), least_knee, greatest_knee, &angle[LEG_KNEE], &scale);
    along = -S * portable_sin(angle[LEG_KNEE]);
    down = -T - S * portable_cos(angle[LEG_KNEE]);
    angle[LEG_HIP_PITCH] = portable_atan2(down * a[0] - along * a[2], along * a[0] + down * a[2]);

    /* Ankle: the remaining rotation, Ry Rx */
    mat3_identity(turned);
    leg_turn(turned, 0, angle[LEG_HIP_ROLL]);
    leg_turn(turned, 2, angle[LEG_HIP_YAW]);
    leg_turn(turned, 1, angle[LEG_HIP_PITCH] + angle[LEG_KNEE]);
    mat3_transpose(turned, back);
    mat3_mul(back, foot->R, R);
    angle[LEG_ANKLE_PITCH] = portable_atan2(-R[6], R[0]);
    angle[LEG_ANKLE_ROLL] = portable_atan2(-R[5], R[4]);
    return reached && in_plane;
}

bool leg_inverse(const struct leg_geometry *leg, const struct body_pose *foot, double least_knee,
                 double greatest_knee, double angle[LEG_JOINTS])
{
    return leg->roll_first ? leg_inverse_roll_first(leg, foot, least_knee, greatest_knee, angle)
                           : leg_inverse_pitch_first(leg, foot, least_knee, greatest_knee, angle);
}
