/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction (stiction) of contact.h at the springs of one pair, for the native engine's
 * kernels. In the frame of the first surface, as contact/native/law.h; bristles are bent by the
 * first body's motion against the second's, in J^0.5. SI units. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_STICK_H
#define CONTACT_NATIVE_STICK_H

#include "contact/native/law.h"
#include "contact/native/moments.h"

/* Sums over the springs of a patch, from which its normal, center of pressure and anchor are
 * computed. f: normal force, p: where it acts. */
struct native_gather {
    double along[3];     /* f times its direction */
    double second[6];    /* f p p: xx, xy, xz, yy, yz, zz */
    struct moments area; /* of the springs' stiffness, so of their area; about the origin */
    double elastic;      /* sum of the elastic forces, N */
    /* Only of springs that push one way: moments of stiffness and damping along the normal, for
     * their tangent, about the frame's origin */
    struct moments stiffness, damping;
};

/* The bristles of a patch: the anchor where they stand, how far they are bent, and the friction
 * force that they bear. */
struct native_grip {
    double normal[3];               /* mean, unit: the way the first body is pushed */
    double center[3];               /* where the bristles stand: the anchor's point c */
    double axis[3];                 /* that their twist turns about */
    double inverse_radius;          /* 1/r of the anchor; 0 for a point */
    double pressure[3];             /* center of pressure */
    double inverse_pressure_radius; /* 1/r of the pressure about it; 0 for a point */
    double inverse_normal;          /* 1/N */
    double inverse_area;            /* of the sum of the springs' rates */
    double root;                    /* sqrt(s) */
    double reach;                   /* N/sqrt(s) */
    double bristle[BRISTLE_BENT];   /* shear y_s and twist y_n, J^0.5 */
    double delay_s;                 /* t_d: retardation (damping) that counts in the force */
    double follow_s;                /* for tangents: damping over stiffness of the force, */
    double bend_s;                  /* and how long the bristles bend at the velocity */
    double whole; /* share of the friction that the patch bears as a whole; the rest is what each
                   * spring (element) bears up to its own limit */
    double force[3], moment[3]; /* of friction, on the first body about the frame's origin */
    /* Found with the force: power of friction (W); sums over the springs of min(alpha |g|, l)|g|,
     * of l |g|, and of alpha |g|^2 where alpha |g| < l, when whole < 1 */
    double power, held, most, open;
    bool keeps; /* the springs' stiffness is kept in the batch, for tangents; else held, most and
                 * open alone are wanted */
    struct moments stiffness, damping; /* those of struct native_gather, when whole is 1 */
};

/* Adds normal force and energies, without friction, of the springs from start on to sum, and the
 * sums that sticking friction needs to sum->gather. For springs that push one way it uses their
 * moments alone. */
void native_stick_gather(const struct native_batch *batch, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum);

/* Adds force, moment and the sums of struct native_gather of springs that all push along d, from
 * the moments of their normal forces. */
void native_gather_add(const struct moments *normal, const double d[3], struct native_sum *sum);

/* Adds the sticking friction of the same springs, each up to its Coulomb limit, to force and
 * moment, and power, held, most and open to sum->grip; only the last three if it does not keep. */
void native_stick_hold(struct native_batch *batch, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum);

#endif
