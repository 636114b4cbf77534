/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rigid-body dynamics of one robot, paper eq. (1): the interface of two implementations. generic is
 * the numeric articulated-body algorithm for any tree; generated is the code of the symbolic
 * generator for one robot. Both give the same numbers within rounding.
 *
 * q, v, accelerations and their order: model/robot.h. tau: njoint joint torques (N m) or forces
 * (N). A base quaternion need not have unit length; its direction gives the rotation. All functions
 * are RT-safe: no allocation, no locks, bounded work; they write only to work.
 */
#ifndef MODEL_DYNAMICS_H
#define MODEL_DYNAMICS_H

#include "base/motion.h"
#include "model/robot.h"

/* A force and a moment about the body's origin, in the body frame unless said otherwise. */
struct wrench {
    double force[3];  /* N */
    double moment[3]; /* N m */
};

/* Classical accelerations in the world frame (gravity not included). */
struct body_acceleration {
    double alpha[3]; /* rad/s2 */
    double a[3];     /* of the origin, m/s2 */
};

/* A symmetric 6x6 matrix added to a body's inertia: upper triangle by rows, in the order of v
 * (linear xyz, angular xyz), in the body's frame about its origin. */
struct added_inertia {
    double A[21];
};

struct dynamics;

struct dynamics_ops {
    const char *name;
    /* Forward dynamics: vdot (nv) from q, v, tau and external wrenches ext (nbody entries, each in
     * its body's frame about its origin; NULL = none). */
    void (*forward)(const struct dynamics *d, const double *q, const double *v, const double *tau,
                    const struct wrench *ext, double *vdot);
    /* Forward dynamics with added inertia, for implicit integration: vdot of
     *     (Mass + E + sum Jb^T A_b Jb) vdot = tau - bias + sum Jb^T ext_b
     * E is the diagonal matrix of extra (njoint, on the joints' own coordinates). A_b is the entry
     * of added for observed body b; there is one entry per observed body, in ascending order. Jb v
     * is the body's velocity in its frame at its origin. The whole matrix must be positive
     * definite. ext must not be NULL. */
    void (*implicit)(const struct dynamics *d, const double *q, const double *v, const double *tau,
                     const struct wrench *ext, const double *extra,
                     const struct added_inertia *added, double *vdot);
    /* Computes the change of vdot (nv numbers) that each of `count` vectors of joint torques tau
     * (njoint numbers) causes, with the positions and inertias of the last call of implicit. NULL
     * if not implemented. */
    void (*respond)(const struct dynamics *d, size_t count, const double *tau, double *vdot);
    /* Inverse dynamics: generalized forces f (nv) that produce vdot. With a floating base, the
     * base's force and moment in the base frame come first, in the order of v. */
    void (*inverse)(const struct dynamics *d, const double *q, const double *v, const double *vdot,
                    const struct wrench *ext, double *f);
    /* Motion of each observed body. Entries of other bodies may stay unchanged. */
    void (*kinematics)(const struct dynamics *d, const double *q, const double *v,
                       struct body_motion *motion);
    /* Updates only v and w of motion for a new v. q must equal q in the last call of kinematics. */
    void (*velocities)(const struct dynamics *d, const double *q, const double *v,
                       struct body_motion *motion);
    /* Accelerations of each observed body from vdot. q must equal q in the last call of
     * kinematics. */
    void (*acceleration)(const struct dynamics *d, const double *q, const double *v,
                         const double *vdot, struct body_acceleration *acceleration);
    /* Kinetic and potential energy, J; the potential energy is zero if all masses are at the
     * world's origin. */
    void (*energy)(const struct dynamics *d, const double *q, const double *v, double *kinetic,
                   double *potential);
};

struct dynamics {
    const struct dynamics_ops *ops;
    const struct robot *robot;
    void *work; /* private scratch: one instance serves one thread */
};

/* The numeric articulated-body implementation (Featherstone, Rigid Body Dynamics Algorithms, 2008,
 * table 7.1). It sets the motions and accelerations of all bodies, observed or not. Memory from
 * arena. Not RT-safe itself. */
enum error_code dynamics_generic(const struct robot *robot, struct arena *arena,
                                 struct dynamics *out, struct error *error);

/* Computes the rates qdot (nq) of the coordinates q from q and v, including the quaternion's rate.
 * RT-safe. */
void dynamics_qdot(const struct robot *robot, const double *q, const double *v, double *qdot);

#endif
