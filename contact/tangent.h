/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Adds up the tangent of a pair (contact.h) element by element, for both engines. SI units, world
 * frame. Nothing fails; RT-safe.
 */
#ifndef CONTACT_TANGENT_H
#define CONTACT_TANGENT_H

#include "contact/contact.h"

/* One surface element under load; world frame. */
struct contact_element {
    double point[3];  /* point of action of the force */
    double normal[3]; /* unit vector, of either sign */
    double stiffness; /* of the normal force, N/m */
    double damping;   /* of the normal force, N s/m */
    double friction;  /* of the tangential force, N s/m: from contact_friction_damping */
};

/* Adds an element's stiffness to K and its damping to D, about the tangent's center. */
void contact_tangent_add(struct contact_tangent *tangent, const struct contact_element *element);

#endif
