/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bristles of sticking friction in a stage of the implicit integrator. The evaluation of
 * contact bends the bristles from the base to the stage with the velocities at the point. The
 * velocities at the stage differ. The tangents correct the wrenches for this difference, and the
 * functions here correct the bristles' slope.
 *
 * Bristles never store more energy than friction has taken from the motion. This energy follows
 * from the wrenches and velocities of the stage, which move the bodies. Without this limit bristles
 * could gain energy when they yield, rotate with their patch, or lose contact in an impact. The
 * reason is that the scheme extends a stage's slope beyond the stage.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Returns twice the energy stored in bent bristles, J. */
static double bent_square(const double y[BRISTLE_BENT])
{
    double square = 0.0;

    for (int k = 0; k < BRISTLE_BENT; k++) {
        square += y[k] * y[k];
    }
    return square;
}

void implicit_pair_velocity(const struct plant *plant, const struct active_pair *pair,
                            struct spatial *velocity)
{
    memset(velocity, 0, sizeof *velocity);
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        const double sign = side == PAIR_B ? 1.0 : -1.0;
        const struct body_motion *motion;
        double arm[3], turn[3];

        if (pair->body[side] < 0) {
            continue;
        }
        motion = implicit_motion(plant, pair->body[side]);
        implicit_arm(plant, pair->body[side], pair->center, arm);
        vec3_cross(motion->w, arm, turn);
        for (int i = 0; i < 3; i++) {
            velocity->a[i] += sign * motion->w[i];
            velocity->l[i] += sign * (motion->v[i] + turn[i]);
        }
    }
}

/* Returns the power that a pair's friction takes from the motion at the stage, W. */
static double friction_power(const struct plant *plant, const struct contact_tangent *tangent,
                             const struct active_pair *pair)
{
    const double h = plant->implicit->stage_h;
    const double *force = tangent->friction + CONTACT_MOVE_X;
    const double *moment = tangent->friction + CONTACT_TURN_X;
    struct spatial beyond = pair->beyond, velocity, decrease;
    struct spatial_inertia D;

    /* The velocity at the point, and the difference of the stage's velocity */
    implicit_pair_velocity(plant, pair, &velocity);
    for (int i = 0; i < 3; i++) {
        beyond.a[i] *= h;
        beyond.l[i] *= h;
        velocity.a[i] += beyond.a[i];
        velocity.l[i] += beyond.l[i];
    }

    /* The wrench on b decreases by D times the difference of both velocities */
    spatial_inertia_unpack(tangent->friction_D, &D);
    spatial_inertia_apply(&D, &beyond, &decrease);
    return vec3_dot(decrease.l, velocity.l) + vec3_dot(decrease.a, velocity.a) -
           vec3_dot(force, velocity.l) - vec3_dot(moment, velocity.a);
}

void implicit_advance_bristles(struct plant *plant, double h)
{
    const struct implicit *im = plant->implicit;
    double *y = plant->state + plant->at.bristle;

    if (plant->nbristle == 0 || !plant->bristles_follow) {
        return;
    }
    for (size_t t = 0; t < im->nactive; t++) {
        im->active[t].bent = bent_square(y + CONTACT_BRISTLE * (size_t)im->tangent[t].pair);
    }
    for (size_t i = 0; i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        add_scaled(h, plant->bristle_rate + from, y + from, CONTACT_BRISTLE);
    }
    for (size_t t = 0; t < im->nactive; t++) {
        const struct active_pair *pair = &im->active[t];
        double *own = y + CONTACT_BRISTLE * (size_t)pair->index;
        double after, most;

        /* Bend the pair's bristles over h seconds by the difference between the velocities at the
         * stage and at the point */
        const struct contact_tangent *tangent = &im->tangent[t];
        double velocity[3], along;

        vec3_cross(pair->beyond.a, tangent->bristle_arm, velocity);
        vec3_add_scaled(velocity, 1, pair->beyond.l, velocity);
        along = vec3_dot(tangent->normal, velocity);
        for (int k = 0; k < 3; k++) {
            own[BRISTLE_SHEAR + k] +=
                h * tangent->bristle_per_m_s * (velocity[k] - along * tangent->normal[k]);
        }
        own[BRISTLE_TWIST] +=
            h * tangent->bristle_per_rad_s * vec3_dot(tangent->bristle_axis, pair->beyond.a);
        after = bent_square(own);
        most = pair->bent + 2.0 * h * friction_power(plant, &im->tangent[t], pair);
        for (int k = 0; k < BRISTLE_BENT && after > most; k++) {
            own[k] *= sqrt(fmax(0.0, most) / after);
        }
    }
}
