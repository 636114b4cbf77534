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
 * Arrays as in model/dynamics.h, flat: a wrench is force, moment (6); a motion R, p, w, v (18); an
 * acceleration alpha, a (6). Every function is RT-safe and reentrant: locals and constants only.
 *
 * Masses, centers of mass and inertias are constants of the code, or inputs (ninertia > 0) that the
 * functions read from inertia: the array that tree_write_inertia (model/symbolic/tree.h) fills for
 * the present robot, aligned to 32 bytes. If they are constants, inertia may be NULL.
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
    uint64_t massless_hash; /* hash without mass properties */
    uint32_t lanes;         /* maximum number of lanes of the generated code */
    uint32_t ninertia;      /* size of inertia; 0 = constants of the code */
    uint32_t npose;         /* size of pose */
    const char *robot;
    const char *variant;                   /* "plain", "avx2" or "avx512" */
    const struct dynamics_module *plainer; /* the next simpler variant, NULL after "plain" */
    /* floating-point operations of forward without wrenches and without sine and cosine; each lane
     * counts */
    uint32_t operations;
    /* vdot; ext (6 nbody) or NULL. */
    void (*forward)(const double *inertia, const double *q, const double *v, const double *tau,
                    const double *ext, double *vdot);
    /* Computes vdot of (Mass + E + sum Jb^T A_b Jb) vdot = tau - bias + sum Jb^T ext_b: with extra
     * (njoint) inertia on the joints' own coordinates and for each observed body a symmetric
     * matrix A_b, 21 numbers, the upper triangle by rows in the order of v (linear xyz, angular
     * xyz), in the body's frame about its origin. Jb v is the body's velocity there. */
    void (*implicit)(const double *inertia, const double *q, const double *v, const double *tau,
                     const double *ext, const double *extra, const double *added, double *vdot);
    /* Generalized forces f (nv) of vdot; ext or NULL. */
    void (*inverse)(const double *inertia, const double *q, const double *v, const double *vdot,
                    const double *ext, double *f);
    /* Observed bodies' entries of motion (18 nbody) and acceleration (6 nbody). kinematics fills
     * pose, aligned to 32 bytes, for the other two functions. velocities fills only w and v of
     * motion. */
    void (*kinematics)(const double *q, const double *v, double *pose, double *motion);
    void (*velocities)(const double *v, const double *pose, double *motion);
    void (*acceleration)(const double *v, const double *vdot, const double *pose,
                         double *acceleration);
    /* energy[0] kinetic, energy[1] potential, J. */
    void (*energy)(const double *inertia, const double *q, const double *v, double *energy);
    /* Sine and cosine of 8 numbers, as used by the module; arrays aligned to 64 bytes. */
    void (*sincos)(const double *x, double *sine, double *cosine);
};

#endif
