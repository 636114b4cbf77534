/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Slope of contact.h's regularized friction law: the bound used by the tangents of both engines.
 * contact/native/friction.h has the same bound for many springs at once. Pure functions; RT-safe.
 */
#ifndef CONTACT_FRICTION_SLOPE_H
#define CONTACT_FRICTION_SLOPE_H

/* Steepest slope of contact.h's S(x) = 10 x^3 - 15 x^4 + 6 x^5, at x = 1/2. */
#define CONTACT_FRICTION_STEEPEST 1.875

/* Returns a damping that bounds the slope of contact.h's friction law from above, N s/m. While the
 * contact sticks, it is the steepest slope between rest and the present speed (15/8 us/v_t from
 * half of v_t on). While it slides, it is at least force over speed, so that a linearly implicit
 * step ends a slide without reversing it. A larger bound would be stable too, but its surplus would
 * act on the body as a mass: the surplus times the time step. With the steepest slope at any speed,
 * this is 2.9 kg on each of COMAN's feet at steps of 1 ms. normal_n: normal force, N; speed:
 * sliding speed, m/s. */
double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed);

#endif
