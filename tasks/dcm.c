/* SPDX-License-Identifier: Apache-2.0 */
/* Evaluates the plan of the divergent component of motion (DCM, xi), backward from its end. */
#include "tasks/dcm.h"

#include "base/portable_math.h"

#include <math.h>

void dcm_add(struct dcm_plan *plan, double duration_s, const double from[2], const double to[2])
{
    if (plan->nline < DCM_LINES && duration_s > 0) {
        plan->line[plan->nline++] =
            (struct dcm_line){duration_s, {from[0], from[1]}, {to[0], to[1]}};
    }
}

/* Computes xi where left_s of a line are left, from xi at the line's end (the equation in the
 * header). */
static void dcm_line_back(const struct dcm_line *line, double omega, double left_s,
                          const double end[2], double dcm[2])
{
    double decay = portable_exp(-omega * left_s);

    for (int k = 0; k < 2; k++) {
        double rate = (line->to[k] - line->from[k]) / line->duration_s;
        double zmp = line->to[k] - rate * left_s;

        dcm[k] = zmp + rate / omega + decay * (end[k] - line->to[k] - rate / omega);
    }
}

/* Computes xi at the end of the first line, backward from the end of the plan, where xi rests. */
static void dcm_first_end(const struct dcm_plan *plan, double end[2])
{
    const struct dcm_line *last = &plan->line[plan->nline - 1];

    end[0] = last->to[0];
    end[1] = last->to[1];
    for (size_t i = plan->nline; i-- > 1;) {
        double begin[2];

        dcm_line_back(&plan->line[i], plan->omega, plan->line[i].duration_s, end, begin);
        end[0] = begin[0];
        end[1] = begin[1];
    }
}

void dcm_begin_at(struct dcm_plan *plan, const double dcm[2])
{
    struct dcm_line *first = &plan->line[0];
    double lasts = plan->omega * first->duration_s, decay = portable_exp(-lasts), end[2];

    dcm_first_end(plan, end);
    /* The equation in the header, solved for r0, with r' = (r1 - r0) / T */
    for (int k = 0; k < 2; k++) {
        first->from[k] =
            (dcm[k] - first->to[k] * (1 - decay) / lasts - decay * (end[k] - first->to[k])) /
            (1 - (1 - decay) / lasts);
    }
}

void dcm_evaluate(const struct dcm_plan *plan, double elapsed_s, double zmp[2], double dcm[2],
                  double dcm_end[2])
{
    const struct dcm_line *first = &plan->line[0];
    double share = fmin(fmax(elapsed_s / first->duration_s, 0), 1), end[2];

    dcm_first_end(plan, end);
    dcm_line_back(first, plan->omega, (1 - share) * first->duration_s, end, dcm);
    for (int k = 0; k < 2; k++) {
        zmp[k] = first->from[k] + share * (first->to[k] - first->from[k]);
        dcm_end[k] = end[k];
    }
}

void dcm_advance(double omega, double duration_s, const double zmp[2], const double dcm[2],
                 double after[2])
{
    double growth = portable_exp(omega * duration_s);

    for (int k = 0; k < 2; k++) {
        after[k] = zmp[k] + growth * (dcm[k] - zmp[k]);
    }
}
