/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The friction law of contact.h for LANES springs at a time: the coefficient of friction with its
 * fall from static to dynamic (Stribeck), regularized friction, and the Coulomb limit of sticking
 * bristles. The native engine computes the friction of springs only here. SI units. Pure functions;
 * RT-safe.
 */
#ifndef CONTACT_NATIVE_FRICTION_H
#define CONTACT_NATIVE_FRICTION_H

#include "contact/friction_slope.h"
#include "contact/lanes.h"
#include "contact/native/friction_sums.h"

#include <float.h>

/* Returns S(x)/x^2 of contact.h's smooth step S(x) = 10 x^3 - 15 x^4 + 6 x^5. */
LANES_INLINE lanes friction_step_over_square(lanes x)
{
    return x * (10 - x * (15 - 6 * x));
}

/* Returns the coefficient of friction without its viscous part: static up to the transition
 * velocity, then falling to dynamic at three times it. u: sliding speed over the transition
 * velocity. */
LANES_INLINE lanes friction_fall(lanes u, const struct native_law *law)
{
    lanes t = (u - 1) * 0.5;
    lanes zero = {0}, one = zero + 1;

    t = lanes_pick(lanes_less(t, one), t, one);
    t = lanes_pick(lanes_less(zero, t), t, zero);
    return law->us - (law->us - law->ud) * (t * t * friction_step_over_square(t));
}

/* Returns the regularized coefficient of friction divided by the sliding speed v (m/s), finite at
 * rest. Multiplied by the normal force and the velocity it is the friction force. */
LANES_INLINE lanes friction_over_speed(lanes v, const struct native_law *law)
{
    lanes u = v * law->transition_inverse;
    lanes sticking, sliding, zero = {0}, one = zero + 1;

    sticking = law->us * law->transition_inverse * (u * (10 - u * (15 - 6 * u)) * u);
    sliding = friction_fall(u, law) / (v + DBL_MIN);
    return lanes_pick(lanes_less(u, one), sticking, sliding) + law->uv;
}

/* Returns an upper bound of the slope of regularized friction against the speed v, relative to
 * us/v_t and without the viscous part, like contact_friction_damping. */
LANES_INLINE lanes friction_slope_bound(lanes v, const struct native_law *law)
{
    const lanes zero = {0}, half = zero + 0.5, one = zero + 1;
    lanes x = v * law->transition_inverse;
    lanes y = lanes_pick(lanes_less(x, half), x, half);

    return lanes_pick(lanes_less(x, one), 30 * (y * y) * ((1 - y) * (1 - y)),
                      CONTACT_FRICTION_STEEPEST / (x + DBL_MIN));
}

/* ---- sticking friction ---- */

/* Springs with the relative velocity of the surfaces at them. */
struct friction_spring {
    lanes p[3], d[3], u[3]; /* point, normal, sliding velocity of the first body */
    lanes leaving;          /* separation speed along d */
    lanes force, normal;    /* elastic force; normal force with dissipation, never negative */
    lanes rate;             /* stiffness: change of the force with the depth, N/m */
};

/* Loads the springs from i on from the batch and computes their sliding velocity and normal
 * force. */
LANES_INLINE void friction_load_spring(const struct native_batch *b, size_t i,
                                       const struct native_law *law,
                                       const struct native_relative *relative,
                                       struct friction_spring *s)
{
    const double *w = relative->w, *v = relative->v;
    lanes zero = {0};

    for (int k = 0; k < 3; k++) {
        s->p[k] = lanes_load(b->p[k] + i);
        s->d[k] = lanes_load(b->d[k] + i);
    }
    s->u[0] = v[0] + (w[1] * s->p[2] - w[2] * s->p[1]);
    s->u[1] = v[1] + (w[2] * s->p[0] - w[0] * s->p[2]);
    s->u[2] = v[2] + (w[0] * s->p[1] - w[1] * s->p[0]);
    s->leaving = s->u[0] * s->d[0] + s->u[1] * s->d[1] + s->u[2] * s->d[2];
    for (int k = 0; k < 3; k++) {
        s->u[k] -= s->leaving * s->d[k];
    }

    /* Normal force: elastic with damping, never negative */
    s->rate = lanes_load(b->rate + i);
    s->force = lanes_load(b->force + i);
    s->normal = s->force * (1 - law->dissipation * s->leaving);
    s->normal = lanes_pick(lanes_less(zero, s->normal), s->normal, zero);
}

/* Bristles at the springs: how far they are bent, and the friction that they bear. */
struct friction_bend {
    lanes e[3];      /* g + sqrt(s) t_d v of contact.h */
    lanes square;    /* |g|^2 */
    lanes share;     /* alpha: the spring's share of the area */
    lanes limit;     /* l: Coulomb limit mu f_n/sqrt(s) */
    lanes stiffness; /* the friction force is minus this times e */
    lanes slide[3];  /* unit direction of e where the spring slides at its limit; else 0 */
};

/* Computes the bend and the stiffness of the bristles at the springs. The stiffness is alpha
 * sqrt(s) while bristles stick, and less where a spring slides at its Coulomb limit. */
LANES_INLINE void friction_find_bend(const struct friction_spring *s, const struct native_law *law,
                                     const struct sticking_patch *patch, struct friction_bend *out)
{
    const double *n = patch->normal, *c = patch->center, *y = patch->bristle;
    const double twist = y[BRISTLE_TWIST] * patch->inverse_radius;
    const double retarded = patch->delay_s * patch->root;
    lanes arm[3], g[3], size, speed, along, part, zero = {0};

    /* Bend g = y_s + y_n n x (p - c)/r: one rigid motion for all springs, minus its component along
     * the spring */
    for (int k = 0; k < 3; k++) {
        arm[k] = s->p[k] - c[k];
    }
    g[0] = y[0] + twist * (n[1] * arm[2] - n[2] * arm[1]);
    g[1] = y[1] + twist * (n[2] * arm[0] - n[0] * arm[2]);
    g[2] = y[2] + twist * (n[0] * arm[1] - n[1] * arm[0]);
    along = g[0] * s->d[0] + g[1] * s->d[1] + g[2] * s->d[2];
    for (int k = 0; k < 3; k++) {
        g[k] -= along * s->d[k];
        out->e[k] = g[k] + retarded * s->u[k];
    }
    out->square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];

    /* Friction min(alpha, l/|e|) sqrt(s) e: no more than the limit mu(v) f_n */
    speed = lanes_root(s->u[0] * s->u[0] + s->u[1] * s->u[1] + s->u[2] * s->u[2]);
    out->share = s->rate * patch->inverse_area;
    out->limit = (friction_fall(speed * law->transition_inverse, law) + law->uv * speed) *
                 (s->normal * (patch->inverse_normal * patch->reach));
    size = lanes_root(out->e[0] * out->e[0] + out->e[1] * out->e[1] + out->e[2] * out->e[2]);
    part = out->limit / (size + DBL_MIN);
    out->stiffness = patch->root * lanes_pick(lanes_less(part, out->share), part, out->share);
    for (int k = 0; k < 3; k++) {
        out->slide[k] =
            lanes_pick(lanes_less(part, out->share), out->e[k] / (size + DBL_MIN), zero);
    }
}

#endif
