/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Slope of contact.h's regularized friction law: the bound that the tangents of both engines use.
 * contact/native/friction.h has the same for many springs at once. Pure functions; RT-safe.
 */
#ifndef CONTACT_FRICTION_SLOPE_H
#define CONTACT_FRICTION_SLOPE_H

/* Steepest slope of contact.h's S(x) = 10 x^3 - 15 x^4 + 6 x^5, at x = 1/2. */
#define CONTACT_FRICTION_STEEPEST 1.875

/* Returns a damping that bounds contact.h's friction law from above, N s/m: the law's steepest
 * slope between rest and the present speed while it sticks (15/8 us/v_t from half of v_t on), no
 * less than the ratio of force and speed when it slides, so that a linearly implicit step ends a
 * slide and does not turn it around. More than that would do no harm to stability, but what is too
 * much acts on the body like a mass of h times the surplus: with the steepest slope of all at any
 * speed, 2.9 kg on each of COMAN's feet at steps of 1 ms. normal_n: the normal force, N; speed: of
 * sliding, m/s. */
double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed);

#endif
