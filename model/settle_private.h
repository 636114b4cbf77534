/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the parts of the static equilibrium: settle.c (unknowns and refusals) and
 * settle_newton.c (a step of the iteration, described there). World frame, SI units. The caller's
 * arena owns the memory. Functions with an error code return the contact engine's failure, with
 * plant->failure set. Not RT-safe.
 */
#ifndef MODEL_SETTLE_PRIVATE_H
#define MODEL_SETTLE_PRIVATE_H

#include "model/plant_private.h"
#include "model/settle.h"

/* The unknowns of a body. The last ones are determined only by friction. */
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

/* Smallest damping, and the damping with which an equilibrium must be stable, in parts of one
 * weight per length of damping. */
#define LEAST_DAMPING 1e-6

/* A body whose position at rest is unknown: the robot as a whole, or a free body. */
struct rest {
    const char *name;
    bool robot;
    size_t free;           /* index of the free body */
    double weight, radius; /* N; radius of gyration, m */
    /* remaining force and moment, world frame; about the base's origin or the center of mass */
    double force[3], moment[3];
    double risen, moved[2]; /* motion so far: m along up and across */
    double tilt[3];         /* rad */
};

struct settle {
    struct plant *plant;
    double up[3], across[2][3];
    /* true: sticking friction, with bristles that bend with the motion; all unknowns are used */
    bool holds;
    size_t unknowns; /* unknowns per body */
    size_t nrest, n; /* n = unknowns * nrest */
    struct rest *rest;
    double *zero, *f;   /* nv */
    double *g, *ahead;  /* n: remaining forces, and moments divided by the radius */
    double *K, *factor; /* n x n: K = symmetric part of -dg/dx; its Cholesky factor */
    double *step;       /* n: m; tilts multiplied by the radius */
    size_t weak;        /* body at which factorization failed */
    double *before;     /* copy of the state */
};

/* Starts a search with or without sticking friction: lists its bodies and unknowns. */
void settle_begin(struct settle *s, bool holds);

/* Fills g and the remaining forces for the present state. */
enum error_code settle_weigh(struct settle *s, double *g);

/* Computes the inverse dynamics of the robot at rest under plant->ext: fills f and, unless rest is
 * NULL, the remaining force on its base. */
void settle_weigh_robot(struct settle *s, struct rest *rest);

/* Returns the largest remaining force on a body relative to its weight; *worst receives the
 * body. */
double settle_residual(const struct settle *s, const double *g, size_t *worst);

/* Fills K by central differences. */
enum error_code settle_differentiate(struct settle *s);

/* Computes the Cholesky factor of K + damping. Returns false if the matrix is not positive
 * definite, and sets s->weak to the responsible body. */
bool settle_factorize(struct settle *s, double damping);

/* Fills step with (K + damping)^-1 g from the factor, limited to the largest allowed step. */
void settle_solve(struct settle *s);

/* Measures the steepest slope on which friction holds a body, rad, by a slow motion along its
 * support. The state must be the equilibrium without friction, with a sideways force on the body.
 * Restores the state. */
enum error_code settle_friction_angle(struct settle *s, size_t body, double *angle);

/* Moves by the step. Halves the step until it lowers the potential or the residual. *moved is false
 * if no part of the step does. */
enum error_code settle_advance(struct settle *s, bool *moved);

#endif
