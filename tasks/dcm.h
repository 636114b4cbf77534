/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The divergent component of motion xi = c + c'/omega of the linear inverted pendulum c'' =
 * omega^2 (c - r), and its plan in closed form (Englsberger, Ott, Albu-Schaeffer: Three-dimensional
 * bipedal walking control based on divergent component of motion, IEEE Trans. Robotics 31(2),
 * 2015). r, the zero-moment point, moves along straight lines, one after the other; where the last
 * one ends xi is to come to rest. Backward through a line that lasts T, from r0 with the rate r' to
 * r1,
 *
 *     xi0 = r0 + r'/omega + exp(-omega T) (xi1 - r1 - r'/omega).
 *
 * Horizontal components only; m, s. RT-safe.
 */
#ifndef TASKS_DCM_H
#define TASKS_DCM_H

#include <stddef.h>

enum { DCM_LINES = 16 };

struct dcm_line {
    double duration_s;
    double from[2], to[2]; /* zero-moment point at its begin and end, m */
};

struct dcm_plan {
    double omega; /* rad/s: sqrt(g / height of the center of mass) */
    size_t nline;
    struct dcm_line line[DCM_LINES];
};

/* Appends a line; drops it when there are DCM_LINES already or it has no duration. */
void dcm_add(struct dcm_plan *plan, double duration_s, const double from[2], const double to[2]);

/* Computes the zero-moment point and the DCM elapsed_s after the first line's begin, and the DCM
 * at the first line's end; elapsed_s within the first line. */
void dcm_evaluate(const struct dcm_plan *plan, double elapsed_s, double zmp[2], double dcm[2],
                  double dcm_end[2]);

/* Moves the begin of the first line so that the plan has that DCM at its begin. */
void dcm_begin_at(struct dcm_plan *plan, const double dcm[2]);

/* Computes the DCM after duration_s with the zero-moment point at rest in zmp. */
void dcm_advance(double omega, double duration_s, const double zmp[2], const double dcm[2],
                 double after[2]);

#endif
