/* SPDX-License-Identifier: Apache-2.0 */
/* Computes tangents (stiffness and damping) of contact pairs from their surface elements. */
#include "contact/tangent.h"

#include "base/vec3.h"

#include <string.h>

/* Element of a packed tangent by row and column axis names. */
#define AT(row, column) CONTACT_TANGENT_AT(CONTACT_##row, CONTACT_##column)

/* Adds an isotropic resistance of the given weight (N s/m) at an arm (m). */
static void tangent_add_isotropic(double weight, const double arm[3],
                                  double S[CONTACT_TANGENT_SIZE])
{
    double x = weight * arm[0], y = weight * arm[1], z = weight * arm[2];

    /* Force by velocity: the identity */
    S[AT(MOVE_X, MOVE_X)] += weight;
    S[AT(MOVE_Y, MOVE_Y)] += weight;
    S[AT(MOVE_Z, MOVE_Z)] += weight;

    /* Force by angular velocity: the cross product with the arm */
    S[AT(MOVE_X, TURN_Y)] += z;
    S[AT(MOVE_X, TURN_Z)] -= y;
    S[AT(MOVE_Y, TURN_X)] -= z;
    S[AT(MOVE_Y, TURN_Z)] += x;
    S[AT(MOVE_Z, TURN_X)] += y;
    S[AT(MOVE_Z, TURN_Y)] -= x;

    /* Moment by angular velocity: squared arm minus its outer product */
    S[AT(TURN_X, TURN_X)] += y * arm[1] + z * arm[2];
    S[AT(TURN_X, TURN_Y)] -= x * arm[1];
    S[AT(TURN_X, TURN_Z)] -= x * arm[2];
    S[AT(TURN_Y, TURN_Y)] += x * arm[0] + z * arm[2];
    S[AT(TURN_Y, TURN_Z)] -= y * arm[2];
    S[AT(TURN_Z, TURN_Z)] += x * arm[0] + y * arm[1];
}

void contact_tangent_add(struct contact_tangent *tangent, const struct contact_element *element)
{
    const double *n = element->normal;
    /* Friction is added in all directions, so its part along the normal is subtracted here */
    double damping = element->damping - element->friction;
    double arm[3], along[CONTACT_AXES];

    /* The normal, and the moment of a unit force along it */
    vec3_sub(element->point, tangent->center, arm);
    memcpy(along + CONTACT_MOVE_X, n, sizeof arm);
    vec3_cross(arm, n, along + CONTACT_TURN_X);

    for (int row = 0; row < CONTACT_AXES; row++) {
        for (int column = row; column < CONTACT_AXES; column++) {
            int at = CONTACT_TANGENT_AT(row, column);
            double both = along[row] * along[column];

            tangent->K[at] += element->stiffness * both;
            tangent->D[at] += damping * both;
        }
    }
    tangent_add_isotropic(element->friction, arm, tangent->D);
}
