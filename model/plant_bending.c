/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the bending moments across the joints' axes, for the joints' sensors. They are reaction
 * moments of the joints, from Newton's and Euler's laws, summed from the leaves to the base. */
#include "base/vec3.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

void plant_sample_bending(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    const double *v = plant->state + plant->at.v;

    plant->whole.ops->kinematics(&plant->whole, plant->q, v, plant->whole_motion);
    plant->whole.ops->acceleration(&plant->whole, plant->q, v, plant->vdot,
                                   plant->bending_acceleration);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        const struct body_motion *motion = &plant->whole_motion[b];
        const struct body_acceleration *acceleration = &plant->bending_acceleration[b];
        double com[3], a[3], spin[3], w[3], alpha[3], rate[3], outside[3], turned[3];

        /* Compute the wrench that accelerates body b, minus the external wrenches, in the world
         * frame about the body's origin */
        /* Force: m (acceleration of the center of mass - g) */
        mat3_apply(motion->R, inertia->com, com);
        vec3_cross(motion->w, com, spin);
        memcpy(a, acceleration->a, sizeof a);
        vec3_add_cross(acceleration->alpha, com, a);
        vec3_add_cross(motion->w, spin, a);
        mat3_apply(motion->R, plant->ext[b].force, outside);
        for (int i = 0; i < 3; i++) {
            plant->bending_load[b].force[i] = inertia->mass * (a[i] - robot->gravity[i]);
        }

        /* Moment: I alpha + w x I w in the body's axes, plus the moment of the force about the
         * origin */
        mat3_apply_transposed(motion->R, motion->w, w);
        mat3_apply_transposed(motion->R, acceleration->alpha, alpha);
        sym3_apply(inertia->I, alpha, rate);
        sym3_apply(inertia->I, w, spin);
        vec3_add_cross(w, spin, rate);
        vec3_sub(rate, plant->ext[b].moment, turned);
        mat3_apply(motion->R, turned, plant->bending_load[b].moment);
        vec3_add_cross(com, plant->bending_load[b].force, plant->bending_load[b].moment);
        vec3_sub(plant->bending_load[b].force, outside, plant->bending_load[b].force);
    }
    /* Sum from the leaves to the base. Children have higher indices than parents */
    for (size_t b = robot->nbody - 1; b > 0; b--) {
        const size_t parent = (size_t)robot->body[b].parent;
        const struct wrench *load = &plant->bending_load[b];
        struct wrench *onto = &plant->bending_load[parent];
        double axes[2][3], moment[3], arm[3];

        mat3_apply_transposed(plant->whole_motion[b].R, load->moment, moment);

        /* Fill axes with two unit vectors orthogonal to the joint's axis and to each other. The
         * first is the coordinate axis most orthogonal to the joint's axis, minus its component
         * along that axis */
        const double *axis = robot->joint[b - 1].axis;
        double length;
        int most = 0;

        for (int i = 1; i < 3; i++) {
            most = fabs(axis[i]) < fabs(axis[most]) ? i : most;
        }
        length = sqrt(1.0 - axis[most] * axis[most]);
        for (int i = 0; i < 3; i++) {
            axes[0][i] = ((i == most) - axis[most] * axis[i]) / length;
        }
        vec3_cross(axis, axes[0], axes[1]);
        for (int k = 0; k < 2; k++) {
            plant->sensors.motor[b - 1].bending_nm[k] = vec3_dot(moment, axes[k]);
        }
        vec3_sub(plant->whole_motion[b].p, plant->whole_motion[parent].p, arm);
        vec3_add_scaled(onto->force, 1.0, load->force, onto->force);
        vec3_add_scaled(onto->moment, 1.0, load->moment, onto->moment);
        vec3_add_cross(arm, load->force, onto->moment);
    }
}
