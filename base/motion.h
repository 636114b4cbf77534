/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The motion of a rigid body. The model computes it, and the contact engines read it. Both use this
 * struct, so arrays pass between them without conversion.
 *
 * All quantities are in the world frame, in SI units. The matrix is row-major (base/vec3.h). Plain
 * data; RT-safe.
 */
#ifndef BASE_MOTION_H
#define BASE_MOTION_H

/* Pose and velocity of a body's frame in the world frame. */
struct body_motion {
    double R[9]; /* rotation, body to world */
    double p[3]; /* position of the body's origin, m */
    double w[3]; /* angular velocity, rad/s */
    double v[3]; /* velocity of the body's origin, m/s */
};

#endif
