/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Broad phase of the native engine: which pairs may touch, because the balls about their surfaces
 * meet, or a ball and a half-space. Tests a row of up to eight pairs at a time, those of one
 * surface with eight others that follow each other in the list of surfaces. Of what is left, pairs
 * of which the capsules about the surfaces are apart are not near either.
 *
 * Only pairs within a margin are kept in mind, with the gap between them, and tested when surfaces
 * have moved by as much since. They are found anew when one has moved so far that others could have
 * come near (Verlet's list, Phys. Rev. 159, 1967), so that what is found does not depend on what
 * was asked before. Lengths are meters in the world's frame.
 * Memory is the arena's.
 */
#ifndef CONTACT_BROAD_PHASE_H
#define CONTACT_BROAD_PHASE_H

#include "contact/contact.h"
#include "contact/variant.h"

#include <stdint.h>

#define BROAD_LANES 8 /* surfaces in a row: a multiple of any number of lanes */

/* Bounding ball of each surface: center and radius (reach), m. Arrays have nsurface entries, padded
 * to a multiple of BROAD_LANES with balls that nothing meets. For a half-space the plane instead:
 * x, y, z its normal, reach its offset with the opposite sign. */
struct broad_balls {
    double *x, *y, *z, *reach;
};

/* Bounding capsule of a surface about the center of its ball; unused for a half-space. */
struct broad_capsule {
    double half[3]; /* from the middle of its axis to an end */
    double radius;
};

/* A row of pairs: one surface against BROAD_LANES others from first on. */
struct broad_row {
    int surface;
    int first;                 /* a multiple of BROAD_LANES */
    bool plane;                /* the surface is a half-space */
    unsigned wanted;           /* bit l: there is a pair with surface first + l */
    int pair[BROAD_LANES];     /* its index */
    double slack[BROAD_LANES]; /* that it has, m */
};

/* A pair within the margin: tested by each evaluation. */
struct broad_candidate {
    int surface, other; /* surface is the half-space if there is one */
    int pair;           /* its index */
    bool plane;
    double slack; /* by which the two have to overlap, m */
    double gap;   /* between them when the list was made, m: at least */
};

struct broad_phase {
    struct broad_balls ball;       /* updated by the caller before each find, */
    struct broad_capsule *capsule; /* and these; reach and radius do not change */
    size_t nsurface, nrow, nword;
    const struct broad_row *row;

    /* The pairs within the margin, and where the surfaces were when they were found */
    bool keeps; /* no half-space moves, so that they can be kept */
    bool found;
    size_t ncandidate;
    struct broad_candidate *candidate; /* as many as there are pairs */
    struct broad_balls then;           /* without reach */
    struct broad_capsule *capsule_then;
};

/* Makes the rows of a configuration that has passed contact_config_check, all balls far away.
 * ERROR_MEMORY is the only error. Not RT-safe. */
enum error_code broad_phase_make(const struct contact_config *config, struct arena *arena,
                                 struct broad_phase *broad, struct error *error);

/* Fills near (nword words): bit p % 64 of word p / 64 is set when pair p may touch. RT-safe. */
void broad_phase_find(struct broad_phase *broad, uint64_t *near);

#endif
