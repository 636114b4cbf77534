/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Friction of contact.h's law at as many springs at a time as there are lanes: the one place where
 * the native engine computes it. SI units. Pure functions; RT-safe.
 */
#ifndef CONTACT_NATIVE_FRICTION_H
#define CONTACT_NATIVE_FRICTION_H

#include "contact/friction.h"
#include "contact/lanes.h"
#include "contact/native_law.h"

#include <float.h>

/* 10 x^3 - 15 x^4 + 6 x^5 over x^2 */
LANES_INLINE lanes friction_step_over_square(lanes x)
{
    return x * (10 - x * (15 - 6 * x));
}

/* The coefficient of friction over the sliding velocity v, finite at rest. */
LANES_INLINE lanes friction_over_speed(lanes v, const struct native_law *law)
{
    lanes u = v * law->transition_inverse;
    lanes t = (u - 1) * 0.5;
    lanes sticking, sliding, zero = {0}, one = zero + 1;

    t = lanes_pick(lanes_less(t, one), t, one);
    t = lanes_pick(lanes_less(zero, t), t, zero);
    sticking = law->us * law->transition_inverse * (u * (10 - u * (15 - 6 * u)) * u);
    sliding =
        (law->us - (law->us - law->ud) * (t * t * friction_step_over_square(t))) / (v + DBL_MIN);
    return lanes_pick(lanes_less(u, one), sticking, sliding) + law->uv;
}

/* The slope of the static friction's share over us/v_t, bounded as by contact_friction_damping. */
LANES_INLINE lanes friction_slope_bound(lanes v, const struct native_law *law)
{
    const lanes zero = {0}, half = zero + 0.5, one = zero + 1;
    lanes x = v * law->transition_inverse;
    lanes y = lanes_pick(lanes_less(x, half), x, half);

    return lanes_pick(lanes_less(x, one), 30 * (y * y) * ((1 - y) * (1 - y)),
                      CONTACT_FRICTION_STEEPEST / (x + DBL_MIN));
}

#endif
