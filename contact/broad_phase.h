/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Broad phase of the native engine: finds the pairs that may touch. Two bounding balls, or a ball
 * and a half-space, must meet. It tests a row of up to eight pairs at a time: one surface against
 * eight consecutive surfaces. Then it discards pairs whose bounding capsules are apart.
 *
 * It keeps a list of pairs within a margin, with their gaps. A pair is tested when surfaces have
 * moved by its gap. The list is made again when a surface has moved so far that another pair may
 * have come near (Verlet's list, Phys. Rev. 159, 1967). So the result does not depend on earlier
 * calls. Lengths are meters in the world frame. The arena owns the memory.
 */
#ifndef CONTACT_BROAD_PHASE_H
#define CONTACT_BROAD_PHASE_H

#include "contact/contact.h"
#include "contact/variant.h"

#include <stdint.h>

#define BROAD_LANES 8 /* surfaces in a row: a multiple of each number of lanes */

/* Bounding ball of each surface: center and radius (reach), m. Arrays have nsurface entries,
 * padded to a multiple of BROAD_LANES with balls that meet nothing. For a half-space they hold the
 * plane: x, y, z are the normal, reach is minus the offset. */
struct broad_balls {
    double *x, *y, *z, *reach;
};

/* Bounding capsule of a surface about the center of its ball; unused for a half-space. */
struct broad_capsule {
    double half[3]; /* vector from the middle of the axis to an end */
    double radius;
};

/* A row of pairs: one surface against BROAD_LANES consecutive surfaces. */
struct broad_row {
    int surface;
    int first;                 /* index of the first of these; a multiple of BROAD_LANES */
    bool plane;                /* the surface is a half-space */
    unsigned wanted;           /* bit l: there is a pair with surface first + l */
    int pair[BROAD_LANES];     /* index of the pair */
    double slack[BROAD_LANES]; /* slack of the pair, m */
};

/* A pair within the margin: tested by each evaluation. */
struct broad_candidate {
    int surface, other; /* if one is a half-space, it is surface */
    int pair;           /* index of the pair */
    bool plane;
    double slack; /* overlap that does not count, m */
    double gap;   /* lower bound of the gap when the list was made, m */
};

struct broad_phase {
    struct broad_balls ball;       /* the caller updates the centers before each find */
    struct broad_capsule *capsule; /* the caller updates the axes before each find */
    size_t nsurface, nrow, nword;
    const struct broad_row *row;

    /* The list of pairs within the margin, and the poses of the surfaces when the list was made */
    bool keeps; /* true: no half-space moves, so the list can be kept */
    bool found;
    size_t ncandidate;
    struct broad_candidate *candidate; /* has room for all pairs */
    struct broad_balls then;           /* centers when the list was made; reach is unused */
    struct broad_capsule *capsule_then;
};

/* Makes the rows of a configuration that has passed contact_config_check, with all balls far away.
 * The only error is ERROR_MEMORY. Not RT-safe. */
enum error_code broad_phase_make(const struct contact_config *config, struct arena *arena,
                                 struct broad_phase *broad, struct error *error);

/* Fills near (nword words): bit p % 64 of word p / 64 is set when pair p may touch. RT-safe. */
void broad_phase_find(struct broad_phase *broad, uint64_t *near);

#endif
