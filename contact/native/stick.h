/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction of contact.h at the springs of one pair, for the native engine's kernels. In
 * the frame of the first surface, as contact/native/law.h; bristles are bent by the first body's
 * motion against the second's, in J^0.5. SI units. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_STICK_H
#define CONTACT_NATIVE_STICK_H

#include "contact/native/law.h"
#include "contact/native/moments.h"

/* Sums over the springs of a patch, by which its bristles are found. f: normal force, p: where it
 * acts. */
struct native_gather {
    double along[3];     /* f times its direction */
    double second[6];    /* f p p: xx, xy, xz, yy, yz, zz */
    struct moments area; /* of the springs' stiffness, which is as their area, about the origin */
    double elastic;      /* their elastic forces */
    /* Only of springs that push one way: what is needed for their tangent, about the frame's
     * origin */
    struct moments stiffness, damping;
};

/* The bristles of a patch: where they stand, and what they bear. */
struct native_grip {
    double normal[3];               /* mean */
    double center[3];               /* where the bristles stand: the anchor's point c */
    double axis[3];                 /* that their twist turns about */
    double inverse_radius;          /* 1/r of the anchor; 0 for a point */
    double pressure[3];             /* center of pressure */
    double inverse_pressure_radius; /* 1/r of the pressure about it; 0 for a point */
    double inverse_normal;          /* 1/N */
    double inverse_area;            /* of the sum of the springs' rates */
    double root;                    /* sqrt(s) */
    double reach;                   /* N/sqrt(s) */
    double bristle[BRISTLE_BENT];
    double delay_s;  /* of the retardation that counts in the force */
    double follow_s; /* by which the force follows the velocity, and */
    double bend_s;   /* the bristles do: for tangents */
    double whole; /* share of the force that the patch bears as a whole, by its springs' area; the
                      * rest is what each spring bears by its pressure */
    double force[3], moment[3]; /* of friction, on the first body about the frame's origin */
    /* Found with the force: power of friction (W); sums over the springs of min(alpha |g|, l)|g|,
     * of l |g|, and of alpha |g|^2 where alpha |g| < l, when whole < 1 */
    double power, held, most, open;
    bool keeps;                        /* what springs resist is kept in the batch, for tangents */
    struct moments stiffness, damping; /* those of struct native_gather, when whole is 1 */
};

/* Adds the springs from start on to the normal force, its energies and what sum->gather wants. Of
 * springs that push one way by their moments alone. */
void native_stick_gather(const struct native_batch *batch, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum);

/* Adds their friction to the force and to what is found in sum->grip. */
void native_stick_hold(struct native_batch *batch, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum);

#endif
