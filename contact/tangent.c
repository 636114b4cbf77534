/* SPDX-License-Identifier: Apache-2.0 */
/* Tangents of contact pairs from their elements. */
#include "contact/tangent.h"

#include <math.h>

/* Adds what resists a point at an arm equally in every direction. */
static void add_isotropic(double weight, const double arm[3], double S[21])
{
    double x = weight * arm[0], y = weight * arm[1], z = weight * arm[2];

    /* force by velocity */
    S[0] += weight;
    S[6] += weight;
    S[11] += weight;
    /* force by angular velocity */
    S[4] += z;
    S[5] -= y;
    S[8] -= z;
    S[10] += x;
    S[12] += y;
    S[13] -= x;
    /* moment by angular velocity */
    S[15] += y * arm[1] + z * arm[2];
    S[16] -= x * arm[1];
    S[17] -= x * arm[2];
    S[18] += x * arm[0] + z * arm[2];
    S[19] -= y * arm[2];
    S[20] += x * arm[0] + y * arm[1];
}

void contact_tangent_add(struct contact_tangent *tangent, const struct contact_element *element)
{
    const double *n = element->normal;
    /* friction resists in every direction, less what it does not along the normal */
    double damping = element->damping - element->friction;
    double arm[3], w[6];

    for (int i = 0; i < 3; i++) {
        arm[i] = element->point[i] - tangent->center[i];
        w[i] = n[i];
    }
    w[3] = arm[1] * n[2] - arm[2] * n[1];
    w[4] = arm[2] * n[0] - arm[0] * n[2];
    w[5] = arm[0] * n[1] - arm[1] * n[0];
    for (int row = 0, at = 0; row < 6; row++) {
        for (int column = row; column < 6; column++, at++) {
            double both = w[row] * w[column];

            tangent->K[at] += element->stiffness * both;
            tangent->D[at] += damping * both;
        }
    }
    add_isotropic(element->friction, arm, tangent->D);
}

double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed)
{
    double x = speed / transition_velocity_m_s, y = fmin(x, 0.5);
    /* S'(y), which rises up to y = 1/2 */
    double slope = x < 1 ? 30 * y * y * (1 - y) * (1 - y) : CONTACT_FRICTION_STEEPEST / x;

    /* the viscous part of the force is proportional to the speed, and so its own slope */
    return (slope * static_friction / transition_velocity_m_s + viscous_friction) * normal_n;
}
