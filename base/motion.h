/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How a rigid body moves: what the model computes of its bodies and the contact engines take. One
 * struct for both, so that an array of it passes from one to the other as it is.
 *
 * World frame throughout, SI units. The matrix is row-major (base/vec3.h). Plain data: copied at
 * will, owned by whoever declares it, RT-safe.
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
