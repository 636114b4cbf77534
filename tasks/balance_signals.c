/* SPDX-License-Identifier: Apache-2.0 */
/* Signals of the balance controller for recordings: what it estimates and plans. */
#include "base/portable_math.h"
#include "tasks/balance_private.h"

#include <math.h>
#include <string.h>

const char *const balance_signal_name[BALANCE_SIGNALS] = {
    "estimate.roll_rad",
    "estimate.pitch_rad",
    "estimate.yaw_rad",
    "estimate.pelvis_x_m",
    "estimate.pelvis_y_m",
    "estimate.pelvis_z_m",
    "estimate.com_x_m",
    "estimate.com_y_m",
    "estimate.com_z_m",
    "estimate.com_vx_m_s",
    "estimate.com_vy_m_s",
    "estimate.com_vz_m_s",
    "estimate.zmp_x_m",
    "estimate.zmp_y_m",
    "estimate.right_fz_n",
    "estimate.left_fz_n",
    "estimate.right_cop_x_m",
    "estimate.right_cop_y_m",
    "estimate.left_cop_x_m",
    "estimate.left_cop_y_m",
    "plan.zmp_x_m",
    "plan.zmp_y_m",
    "plan.dcm_x_m",
    "plan.dcm_y_m",
    "plan.com_x_m",
    "plan.com_y_m",
    "wanted.zmp_x_m",
    "wanted.zmp_y_m",
    "wanted.right_cop_x_m",
    "wanted.right_cop_y_m",
    "wanted.left_cop_x_m",
    "wanted.left_cop_y_m",
    "wanted.left_weight",
    "plan.phase",
    "plan.stance",
    "plan.right_z_m",
    "plan.left_z_m",
    "plan.next_x_m",
    "plan.next_y_m",
    "plan.steps",
    "estimate.right_x_m",
    "estimate.right_y_m",
    "estimate.left_x_m",
    "estimate.left_y_m",
    "estimate.right_z_m",
    "estimate.left_z_m",
    "estimate.right_pitch_rad",
    "estimate.left_pitch_rad",
    "estimate.right_roll_rad",
    "estimate.left_roll_rad",
    "plan.right_pitch_rad",
    "plan.left_pitch_rad",
    "plan.right_roll_rad",
    "plan.left_roll_rad",
    "plan.landed",
};

void balance_signals(const struct balance *balance, double value[BALANCE_SIGNALS])
{
    const struct estimate *e = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;
    const struct balance_leg *right = &balance->leg[BODY_RIGHT], *left = &balance->leg[BODY_LEFT];
    /* One value for each name above, in the same order */
    const double now[BALANCE_SIGNALS] = {
        e->roll_rad,
        e->pitch_rad,
        e->yaw_rad,
        e->pelvis_m[0],
        e->pelvis_m[1],
        e->pelvis_m[2],
        e->com_m[0],
        e->com_m[1],
        e->com_m[2],
        e->com_m_s[0],
        e->com_m_s[1],
        e->com_m_s[2],
        e->zmp_m[0],
        e->zmp_m[1],
        /* Vertical forces and centers of pressure, right foot first as in enum BODY_RIGHT */
        e->foot[0].force_n[2],
        e->foot[1].force_n[2],
        e->foot[0].cop_m[0],
        e->foot[0].cop_m[1],
        e->foot[1].cop_m[0],
        e->foot[1].cop_m[1],
        /* The plan, and the zero-moment point and centers of pressure that feedback makes of it */
        plan->zmp[0],
        plan->zmp[1],
        plan->dcm[0],
        plan->dcm[1],
        plan->com[0],
        plan->com[1],
        balance->zmp[0],
        balance->zmp[1],
        right->cop_m[0],
        right->cop_m[1],
        left->cop_m[0],
        left->cop_m[1],
        left->weight,
        /* The step: its phase, heights of the feet (of the plan), next foothold */
        plan->phase,
        plan->stance,
        plan->foot[0].p[2] + (plan->stance == BODY_LEFT ? plan->height_m : 0),
        plan->foot[1].p[2] + (plan->stance == BODY_RIGHT ? plan->height_m : 0),
        balance->gait.next.p[0],
        balance->gait.next.p[1],
        balance->gait.steps,
        /* Estimated soles: place, then pitch and roll out of their rotation matrices */
        e->foot[0].sole.p[0],
        e->foot[0].sole.p[1],
        e->foot[1].sole.p[0],
        e->foot[1].sole.p[1],
        e->foot[0].sole.p[2],
        e->foot[1].sole.p[2],
        portable_asin(fmin(fmax(-e->foot[0].sole.R[6], -1), 1)),
        portable_asin(fmin(fmax(-e->foot[1].sole.R[6], -1), 1)),
        portable_atan2(e->foot[0].sole.R[7], e->foot[0].sole.R[8]),
        portable_atan2(e->foot[1].sole.R[7], e->foot[1].sole.R[8]),
        /* Planned tilts */
        plan->foot[0].pitch,
        plan->foot[1].pitch,
        plan->foot[0].roll,
        plan->foot[1].roll,
        balance->gait.landed,
    };

    memcpy(value, now, sizeof now);
}
