/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Prepares a robot's description for the numeric dynamics. Each joint becomes a fixed rotation,
 * then a rotation about or a displacement along one coordinate axis. A body whose joint axis is +x,
 * +y or +z keeps its frame. Any other body gets an inner frame whose z axis is the joint axis.
 */
#include "model/dynamics_kernels.h"

/* Returns the index of the coordinate axis that equals a unit vector, or -1. */
static int axis_number(const double axis[3])
{
    for (int k = 0; k < 3; k++) {
        if (axis[k] == 1.0 && axis[(k + 1) % 3] == 0.0 && axis[(k + 2) % 3] == 0.0) {
            return k;
        }
    }
    return -1;
}

void generic_prepare_link(const struct robot_body *body, const struct robot_joint *joint,
                          const struct link *parent, struct link *link)
{
    link->parent = body->parent;
    if (joint) {
        /* Converts the joint of a body to a fixed rotation and a coordinate axis */
        double parent_to_inner[9], turned[9];
        int k = axis_number(joint->axis);

        /* Choose the inner frame: the body's frame, or a frame whose z axis is the joint axis */
        link->type = joint->type;
        link->inner = k < 0;
        link->axis = link->inner ? 2 : k;
        if (link->inner) {
            double x[3] = {0.0, 0.0, 0.0}, y[3], norm;
            int least = 0;

            /* Compute a rotation whose third column is the unit vector axis */
            for (int m = 1; m < 3; m++) {
                if (fabs(joint->axis[m]) < fabs(joint->axis[least])) {
                    least = m;
                }
            }

            /* Make two columns orthogonal to the axis, starting from the coordinate axis farthest
             * from it */
            x[least] = 1.0;
            vec3_cross(joint->axis, x, y);
            norm = vec3_norm(y);
            for (int m = 0; m < 3; m++) {
                y[m] /= norm;
            }
            vec3_cross(y, joint->axis, x);
            for (int m = 0; m < 3; m++) {
                link->align[3 * m] = x[m];
                link->align[3 * m + 1] = y[m];
                link->align[3 * m + 2] = joint->axis[m];
            }
        } else {
            mat3_identity(link->align);
        }

        /* Compute the pose of the inner frame in the parent's inner frame */
        mat3_transpose(parent->align, parent_to_inner);
        mat3_mul(parent_to_inner, joint->rotation, turned);
        mat3_mul(turned, link->align, link->fixed);
        link->turned = !mat3_is_identity(link->fixed);
        mat3_apply(parent_to_inner, joint->origin, link->origin);
        for (int m = 0; m < 3; m++) {
            link->slide[m] = link->fixed[3 * m + link->axis];
        }
        link->offset = joint->type == JOINT_PRISMATIC || vec3_dot(link->origin, link->origin) > 0.0;
    } else {
        mat3_identity(link->align);
    }

    /* Computes the inertia of a body in its inner frame */
    double I[6], com[3], body_to_inner[9];

    memcpy(I, body->inertia.I, sizeof I);
    mat3_transpose(link->align, body_to_inner);
    mat3_apply(body_to_inner, body->inertia.com, com);
    if (link->inner) {
        sym3_rotate(body_to_inner, I);
    }
    link->mass = body->inertia.mass;
    for (int m = 0; m < 3; m++) {
        link->moment[m] = body->inertia.mass * com[m];
    }
    spatial_inertia_rigid(body->inertia.mass, com, I, &link->rigid);
    memcpy(link->I, link->rigid.J, sizeof link->I);
}
