/* SPDX-License-Identifier: Apache-2.0 */
/* For engines: the tangent of a pair, put together element by element. RT-safe. */
#ifndef CONTACT_TANGENT_H
#define CONTACT_TANGENT_H

#include "contact/contact.h"

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

/* Damping that bounds contact.h's friction law from above, N s/m: no less than the law's steepest
 * slope while it sticks (15/8 us/v_t), no less than the ratio of force and speed when it slides, so
 * that a linearly implicit step ends a slide and does not turn it around. normal_n: the normal
 * force; speed: of sliding. */
double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed);

#endif
