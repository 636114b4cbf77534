/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction of contact.h at the springs of one pair, for the native engine's kernels. In
 * the frame of the first surface, as contact/native_law.h; bristles are bent by the first body's
 * motion against the second's, in J^0.5. SI units. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_STICK_H
#define CONTACT_NATIVE_STICK_H

#include "contact/native_law.h"
#include "contact/native_moments.h"

/* Sums over the springs that push, by which the patch's bristles are found. f: normal force, p:
 * where it acts, u: sliding velocity there. */
struct native_gather {
    double along[3];  /* f times its direction */
    double second[6]; /* f p p: xx, xy, xz, yy, yz, zz */
    double slip[3];   /* f u */
    double turn[3];   /* f p x u */
    /* Only of springs that push one way: what is needed for their tangent, about the frame's
     * origin */
    struct moments stiffness, damping;
};

/* The bristles of a patch and where they stand, and what they bear. */
struct native_grip {
    double normal[3], center[3]; /* mean normal, center of pressure */
    double inverse_radius;       /* 1/r; 0 for a point */
    double inverse_normal;       /* 1/N */
    double root;                 /* sqrt(s) */
    double reach;                /* N/sqrt(s) */
    double bristle[CONTACT_BRISTLE];
    double delay_s;  /* of the retardation that counts in the force */
    double follow_s; /* by which the force follows the velocity, and */
    double bend_s;   /* the bristles do: for tangents */
    /* Found with the force: power of friction (W); sums of w min(|g|, l)|g|, of w l |g|, and of
     * w |g|^2 where |g| < l */
    double power, held, most, open;
    bool keeps; /* what the springs resist is kept in the batch, for tangents */
    /* Springs that push one way and are far from yielding hold as one: the force is that of the
     * whole patch, no spring of it was asked */
    bool rigid;
    double second[6];                  /* then the sum of f r r about the center, and */
    struct moments stiffness, damping; /* those of struct native_gather */
};

/* Adds the springs from start on to the normal force, its energies and what sum->gather wants. Of
 * springs that push one way by their moments alone. */
void native_stick_gather(const struct native_batch *batch, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum);

/* Adds their friction to the force and to what is found in sum->grip. */
void native_stick_hold(struct native_batch *batch, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum);

#endif
