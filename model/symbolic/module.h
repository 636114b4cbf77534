/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A generated module: one robot's dynamics as compiled code. The generated C file defines one
 * external function,
 *
 *     const struct dynamics_module *NAME_dynamics(void);
 *
 * NAME is the letters and digits of the robot's name in lower case (symbolic_symbol in
 * model/symbolic/symbolic.h). The function returns the variant for its CPU: plain C, AVX2 or
 * AVX-512VL. All give the same bits. The file may be linked, or compiled alone and loaded.
 *
 * Arrays are flat and in the order of model/dynamics.h. A wrench is force, moment (6 numbers), a
 * motion R, p, w, v (18), an acceleration alpha, a (6). Every function is RT-safe and reentrant,
 * because it uses only locals and constants.
 *
 * Masses, centers of mass and inertias are constants of the code (ninertia 0; inertia may be NULL)
 * or inputs (ninertia > 0). Functions read the inputs from the array inertia, aligned to 32 bytes.
 * model/symbolic/module.c fills this array for the present robot.
 *
 * Each generated file repeats the declaration below, so that it needs no other header.
 */
#ifndef HIL_DYNAMICS_MODULE
#define HIL_DYNAMICS_MODULE

#include <stddef.h>
#include <stdint.h>

struct dynamics_module {
    uint32_t nbody, njoint, nq, nv;
    uint32_t nobserved;
    const int *observed;    /* indices of the observed bodies, ascending */
    uint64_t robot_hash;    /* hash of the robot from which it was generated */
    uint64_t massless_hash; /* hash of that robot without mass properties */
    uint32_t lanes;         /* maximum number of lanes of the generated code */
    uint32_t ninertia;      /* size of inertia; 0 = constants of the code */
    uint32_t npose;         /* size of pose */
    const char *robot;
    const char *variant;                   /* "plain", "avx2" or "avx512" */
    const struct dynamics_module *plainer; /* the next simpler variant, NULL after "plain" */
    /* floating-point operations of forward without wrenches, without sines and cosines; each lane
     * counts */
    uint32_t operations;
    /* Computes vdot. ext: 6 nbody numbers, or NULL. */
    void (*forward)(const double *inertia, const double *q, const double *v, const double *tau,
                    const double *ext, double *vdot);
    /* Computes vdot of (Mass + E + sum Jb^T A_b Jb) vdot = tau - bias + sum Jb^T ext_b. E is the
     * diagonal matrix of extra (njoint, on the joints' own coordinates). A_b is a symmetric matrix
     * for each observed body: 21 numbers, the upper triangle by rows in the order of v (linear xyz,
     * angular xyz), in the body's frame about its origin. Jb v is the body's velocity in that
     * frame. */
    void (*implicit)(const double *inertia, const double *q, const double *v, const double *tau,
                     const double *ext, const double *extra, const double *added, double *vdot);
    /* Computes the generalized forces f (nv) that produce vdot. ext may be NULL. */
    void (*inverse)(const double *inertia, const double *q, const double *v, const double *vdot,
                    const double *ext, double *f);
    /* Fill the observed bodies' entries of motion (18 nbody) or acceleration (6 nbody). kinematics
     * also fills pose, aligned to 32 bytes, which the other two functions read. velocities fills
     * only w and v of motion. */
    void (*kinematics)(const double *q, const double *v, double *pose, double *motion);
    void (*velocities)(const double *v, const double *pose, double *motion);
    void (*acceleration)(const double *v, const double *vdot, const double *pose,
                         double *acceleration);
    /* Computes the kinetic energy[0] and the potential energy[1], J. */
    void (*energy)(const double *inertia, const double *q, const double *v, double *energy);
    /* Computes sine and cosine of 8 numbers as the module does. Arrays are aligned to 64 bytes. */
    void (*sincos)(const double *x, double *sine, double *cosine);
};

#endif
