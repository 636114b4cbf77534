/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bristles of sticking friction in a stage of the implicit integrator. Contact was evaluated
 * with them as the velocities at the point would bend them from the base to the stage; what the
 * velocities at the stage differ by, the tangents take into account in the wrenches, and here in
 * their slope.
 */
#include "model/implicit/private.h"

#include <math.h>

/* Twice the energy that bent bristles store, J. */
static double bent_square(const double y[BRISTLE_BENT])
{
    double square = 0.0;

    for (int k = 0; k < BRISTLE_BENT; k++) {
        square += y[k] * y[k];
    }
    return square;
}

void implicit_advance_bristles(struct plant *plant, double h)
{
    const struct implicit *im = plant->implicit;
    double *y = plant->state + plant->at.bristle;

    if (plant->nbristle == 0 || !plant->bristles_follow) {
        return;
    }
    for (size_t i = 0; i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        add_scaled(h, plant->bristle_rate + from, y + from, CONTACT_BRISTLE);
    }
    for (size_t t = 0; t < im->nactive; t++) {
        const struct contact_tangent *tangent = &im->tangent[t];
        const struct spatial *beyond = &im->active[t].beyond;
        double *own = y + CONTACT_BRISTLE * (size_t)tangent->pair;
        const double before = bent_square(own);
        double velocity[3], along, after, most;

        /* Where they stand */
        vec3_cross(beyond->a, tangent->bristle_arm, velocity);
        vec3_add_scaled(velocity, 1, beyond->l, velocity);
        along = vec3_dot(tangent->normal, velocity);
        for (int k = 0; k < 3; k++) {
            own[BRISTLE_SHEAR + k] +=
                h * tangent->bristle_per_m_s * (velocity[k] - along * tangent->normal[k]);
        }
        own[BRISTLE_TWIST] +=
            h * tangent->bristle_per_rad_s * vec3_dot(tangent->bristle_axis, beyond->a);

        /* What the stage's velocities bend beyond the limit yields: at an impact, which they do not
         * foresee, bristles would store more than friction takes */
        after = bent_square(own);
        most = fmax(before, tangent->bristle_most * tangent->bristle_most);
        for (int k = 0; k < BRISTLE_BENT && after > most; k++) {
            own[k] *= sqrt(most / after);
        }
    }
}
