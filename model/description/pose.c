/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the poses of a robot's bodies for given joint positions (forward kinematics). */
#include "model/robot.h"

#include "base/vec3.h"

#include <string.h>

void robot_place_child(const struct robot_joint *joint, double q, double R[9], double p[3])
{
    double turn[9], slide[3];

    memcpy(p, joint->origin, 3 * sizeof *p);
    if (joint->type == JOINT_REVOLUTE) {
        mat3_about_axis(joint->axis, q, turn);
        mat3_mul(joint->rotation, turn, R);
        return;
    }
    memcpy(R, joint->rotation, 9 * sizeof *R);
    mat3_apply(R, joint->axis, slide);
    vec3_add_scaled(p, q, slide, p);
}

void robot_place_bodies(const struct robot *robot, const double position[3],
                        const double quaternion[4], const double *joint, struct body_motion *motion)
{
    memset(motion, 0, robot->nbody * sizeof *motion);
    mat3_identity(motion[0].R);
    if (robot->floating) {
        memcpy(motion[0].p, position, sizeof motion[0].p);
        mat3_from_quaternion(quaternion, motion[0].R);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct body_motion *parent = &motion[robot->body[j + 1].parent];
        double R[9], p[3], arm[3];

        robot_place_child(&robot->joint[j], joint[j], R, p);
        mat3_mul(parent->R, R, motion[j + 1].R);
        mat3_apply(parent->R, p, arm);
        vec3_add_scaled(arm, 1, parent->p, motion[j + 1].p);
    }
}
