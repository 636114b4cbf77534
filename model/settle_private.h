/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations that the parts of the static equilibrium share: settle.c (what is looked for, and
 * what is refused) and settle_newton.c (a step of the iteration, described there). World frame, SI
 * units. Memory is the caller's arena's. Functions with an error code return the contact engine's
 * failure, with plant->failure set. Not RT-safe.
 */
#ifndef MODEL_SETTLE_PRIVATE_H
#define MODEL_SETTLE_PRIVATE_H

#include "model/plant_private.h"
#include "model/settle.h"

/* The unknowns of a body; those that only friction holds are last. */
enum settle_unknown {
    UNKNOWN_UP,
    UNKNOWN_FIRST_TILT,
    UNKNOWN_SECOND_TILT,
    UNKNOWN_FIRST_ACROSS,
    UNKNOWN_SECOND_ACROSS,
    UNKNOWN_HEADING,
    UNKNOWNS,
    UNKNOWNS_WITHOUT_FRICTION = UNKNOWN_FIRST_ACROSS,
};

/* The damping at the equilibrium, and least damping at which it has to be stable: part of one
 * weight per length of damping. */
#define LEAST_DAMPING 1e-6

/* A body that has to find its rest: the robot as one, or a free body. */
struct rest {
    const char *name;
    bool robot;
    size_t free;                /* which free body */
    double weight, radius;      /* N; m, of gyration */
    double force[3], moment[3]; /* left over, world frame; about the base's origin or the center of
                                 * mass */
    double risen, moved[2];     /* so far: m along up and across */
    double tilt[3];             /* rad */
};

struct settle {
    struct plant *plant;
    double up[3], across[2][3];
    bool holds;      /* friction does, by bristles that bend with the motion: all unknowns */
    size_t unknowns; /* of a body */
    size_t nrest, n; /* n = unknowns * nrest */
    struct rest *rest;
    double *zero, *f;   /* nv */
    double *g, *ahead;  /* n: forces left over; tilts' moments over the radius */
    double *K, *factor; /* n x n: symmetric part of -dg/dx; Cholesky factor */
    double *step;       /* n: m; tilts times the radius */
    size_t weak;        /* body that factorize stopped at */
    double *before;     /* copy of the state */
};

/* Up, against gravity, and two directions across. */
void settle_choose_axes(const double gravity[3], struct settle *s);

/* Starts anew, with friction that holds or without friction: lists what belongs to it. */
void settle_begin(struct settle *s, bool holds);

/* Fills g and the forces left over of the present state. */
enum error_code settle_weigh(struct settle *s, double *g);

/* Inverse dynamics of the robot at rest under plant->ext: fills f, and the forces left over on its
 * base when rest is not NULL. */
void settle_weigh_robot(struct settle *s, struct rest *rest);

/* Returns the largest part of its weight that is left over on a body; *worst says on which. */
double settle_residual(const struct settle *s, const double *g, size_t *worst);

/* Fills K by central differences. */
enum error_code settle_differentiate(struct settle *s);

/* Computes the Cholesky factor of K + damping; returns false when that is not positive definite,
 * for a body that s->weak then names. */
bool settle_factorize(struct settle *s, double damping);

/* Fills step: (K + damping)^-1 g by the factor, cut to the longest that is allowed. */
void settle_solve(struct settle *s);

/* Measures the steepest slope that friction holds a body on, rad: drags it slowly along what
 * carries it. Expects the equilibrium without friction, where the body is pushed sideways; leaves
 * the state as it was. */
enum error_code settle_friction_angle(struct settle *s, size_t body, double *angle);

/* Takes the step, or the half of it and so on, until it lowers the potential or the residual;
 * *moved is false when no part does. */
enum error_code settle_advance(struct settle *s, bool *moved);

#endif
