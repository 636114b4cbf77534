/* SPDX-License-Identifier: Apache-2.0 */
/* Forward kinematics, center of mass and static torques of a tree of links. */
#include "tasks/body_model.h"

#include "base/vec3.h"

#include <string.h>

void body_place(const struct body_model *model, const double *angle, struct body_pose *pose)
{
    mat3_identity(pose[0].R);
    memset(pose[0].p, 0, sizeof pose[0].p);
    for (size_t i = 1; i < model->nlink; i++) {
        const struct body_link *link = &model->link[i];
        const struct body_pose *parent = &pose[link->parent];
        double turn[9], fixed[9], offset[3];

        /* link = parent * Trans(origin) * rotation * Rot(direction, angle) */
        mat3_apply(parent->R, link->origin, offset);
        vec3_add_scaled(parent->p, 1, offset, pose[i].p);
        mat3_about_axis(link->direction, link->axis < 0 ? link->fixed_rad : angle[link->axis],
                        turn);
        mat3_mul(parent->R, link->rotation, fixed);
        mat3_mul(fixed, turn, pose[i].R);
    }
}

void body_center_of_mass(const struct body_model *model, const struct body_pose *pose,
                         double com[3])
{
    double sum[3] = {0};

    for (size_t i = 0; i < model->nlink; i++) {
        const struct body_link *link = &model->link[i];
        double arm[3];

        mat3_apply(pose[i].R, link->com_m, arm);
        vec3_add_scaled(arm, 1, pose[i].p, arm);
        vec3_add_scaled(sum, link->mass_kg, arm, sum);
    }
    for (int k = 0; k < 3; k++) {
        com[k] = sum[k] / model->mass_kg;
    }
}

void body_place_frame(const struct body_frame *frame, const struct body_pose *link,
                      struct body_pose *pose)
{
    double offset[3];

    mat3_apply(link->R, frame->position, offset);
    vec3_add_scaled(link->p, 1, offset, pose->p);
    mat3_mul(link->R, frame->rotation, pose->R);
}

double body_static_torque(const struct body_model *model, const struct body_pose *pose,
                          const int *chain, size_t nchain, const double force[3],
                          const double point[3], const double down[3])
{
    const struct body_pose *at = &pose[chain[0]];
    double axis[3], arm[3], moment[3];

    /* Sum the moments about the joint: of the force, then of each link's weight */
    vec3_sub(point, at->p, arm);
    vec3_cross(arm, force, moment);
    for (size_t i = 0; i < nchain; i++) {
        const struct body_link *link = &model->link[chain[i]];
        double weight[3] = {0};

        mat3_apply(pose[chain[i]].R, link->com_m, arm);
        vec3_add_scaled(arm, 1, pose[chain[i]].p, arm);
        vec3_sub(arm, at->p, arm);
        vec3_add_scaled(weight, link->mass_kg * model->gravity_m_s2, down, weight);
        vec3_add_cross(arm, weight, moment);
    }
    mat3_apply(at->R, model->link[chain[0]].direction, axis);
    return -vec3_dot(axis, moment);
}

int body_find_link(const struct body_model *model, const char *joint)
{
    for (size_t i = 1; i < model->nlink; i++) {
        if (strcmp(model->link[i].joint, joint) == 0) {
            return (int)i;
        }
    }
    return -1;
}
