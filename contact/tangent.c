/* SPDX-License-Identifier: Apache-2.0 */
/* Computes tangents (stiffness and damping) of contact pairs from their surface elements. */
#include "contact/tangent.h"

#include "contact/native/moments.h"

void contact_tangent_add(struct contact_tangent *tangent, const struct contact_element *element)
{
    const double *n = element->normal;
    double arm[3];

    /* Computes the element's moments for a weight of 1. Friction is added in all directions, so its
     * part along the normal is subtracted */
    vec3_sub(element->point, tangent->center, arm);
    const struct moments unit = {1,
                                 {arm[0], arm[1], arm[2]},
                                 {arm[0] * arm[0], arm[0] * arm[1], arm[0] * arm[2],
                                  arm[1] * arm[1], arm[1] * arm[2], arm[2] * arm[2]}};

    tangent_add_along(element->stiffness, &unit, n, tangent->K);
    tangent_add_along(element->damping - element->friction, &unit, n, tangent->D);
    tangent_add_across(element->friction, &unit, tangent->D);
}
