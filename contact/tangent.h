/* SPDX-License-Identifier: Apache-2.0 */
/*
 * For engines: the tangent of a pair (contact.h), put together element by element. SI units, world
 * frame. Nothing fails; RT-safe.
 */
#ifndef CONTACT_TANGENT_H
#define CONTACT_TANGENT_H

#include "contact/contact.h"

/* Steepest slope of contact.h's S(x) = 10 x^3 - 15 x^4 + 6 x^5, at x = 1/2. */
#define CONTACT_FRICTION_STEEPEST 1.875

/* One surface element under load; world frame. */
struct contact_element {
    double point[3];  /* where the force acts */
    double normal[3]; /* unit vector, of either sign */
    double stiffness; /* of the normal force, N/m */
    double damping;   /* of the normal force, N s/m */
    double friction;  /* of the tangential force, N s/m: see contact_friction_damping */
};

/* Adds an element to K and D about the tangent's center. */
void contact_tangent_add(struct contact_tangent *tangent, const struct contact_element *element);

/* Damping that bounds contact.h's friction law from above, N s/m: the law's steepest slope
 * between rest and the present speed while it sticks (15/8 us/v_t from half of v_t on), no less
 * than the ratio of force and speed when it slides, so that a linearly implicit step ends a
 * slide and does not turn it around. More than that would do no harm to stability, but what is
 * too much acts on the body like a mass of h times the surplus: with the steepest slope of all
 * at any speed, 2.9 kg on each of COMAN's feet at steps of 1 ms. normal_n: the normal force;
 * speed: of sliding. */
double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed);

#endif
