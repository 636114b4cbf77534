/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction (stiction) of contact.h for the springs of one pair, in the native engine's
 * kernels. Frame of the first surface, as in contact/native/law.h. The motion of the first body
 * against the second bends the bristles, in J^0.5. SI units. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_FRICTION_SUMS_H
#define CONTACT_NATIVE_FRICTION_SUMS_H

#include "contact/native/law.h"
#include "contact/native/moments.h"

/* Sums over the springs of a patch, from which its normal, center of pressure and anchor follow.
 * f: normal force, p: point of action. */
struct native_gather {
    double along[3];  /* sum of f times its direction */
    double second[6]; /* sum of f p p: xx, xy, xz, yy, yz, zz */
    /* moments of the springs' stiffness, which is proportional to area; about the origin */
    struct moments area;
    double elastic; /* sum of the elastic forces, N */
    /* Only for springs that push one way: moments of stiffness and damping along the normal, for
     * their tangent, about the frame's origin */
    struct moments stiffness, damping;
};

/* The bristles of a patch: their anchor, their bend, and their friction force. */
struct sticking_patch {
    double normal[3];               /* mean unit direction in which the first body is pushed */
    double center[3];               /* anchor's point c */
    double axis[3];                 /* axis of the twist */
    double inverse_radius;          /* 1/r of the anchor; 0 for a point */
    double pressure[3];             /* center of pressure */
    double inverse_pressure_radius; /* 1/r_p of contact.h; 0 for a point */
    double inverse_normal;          /* 1/N */
    double inverse_area;            /* 1/(sum of the springs' rates) */
    double root;                    /* sqrt(s) */
    double reach;                   /* N/sqrt(s): bend at which bristles bear N */
    double bristle[BRISTLE_BENT];   /* shear y_s and twist y_n, J^0.5 */
    double delay_s;                 /* t_d: retardation (damping) included in the force */
    double follow_s;                /* for tangents: damping over stiffness of the bristles */
    /* for tangents: time for which the velocity bends the bristles */
    double bend_s;
    /* share of the friction that the patch bears as a whole. The springs bear the rest, each up to
     * its own limit */
    double whole;
    double force[3], moment[3]; /* friction wrench on the first body about the frame's origin */
    /* Computed with the force: power of friction (W) and, if whole < 1, sums over the springs of
     * min(alpha |g|, l)|g|, of l |g|, and of alpha |g|^2 where alpha |g| < l */
    double power, held, most, open;
    double sliding; /* share of the friction that is at its limit */
    /* add the friction to the sums; otherwise compute only held, most and open */
    bool keeps;
    struct moments stiffness, damping; /* moments from struct native_gather, if whole is 1 */
};

/* Adds normal force and energies of the springs from start on to sum, without friction, and the
 * sums for sticking friction to sum->gather. All springs must push one way; the sums follow from
 * their moments. */
void friction_sums_gather(const struct native_batch *batch, const struct native_law *law,
                          const struct native_relative *relative, struct native_sum *sum);

/* Adds force, moment and struct native_gather sums of springs that all push along d, from the
 * moments of their normal forces. */
void native_gather_add(const struct moments *normal, const double d[3], struct native_sum *sum);

/* keeps: adds the sticking friction of the springs, each up to its Coulomb limit, to force and
 * moment, and power, held, most and open to sum->sticking. Otherwise computes only held, most and
 * open. */
void friction_sums_hold(const struct native_batch *batch, const struct native_law *law,
                        const struct native_relative *relative, struct native_sum *sum);

#endif
