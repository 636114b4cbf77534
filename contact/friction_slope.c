/* SPDX-License-Identifier: Apache-2.0 */
/* Upper bound for the slope of regularized friction, as damping for implicit integration. */
#include "contact/friction_slope.h"

#include <math.h>

double contact_friction_damping(double static_friction, double viscous_friction,
                                double transition_velocity_m_s, double normal_n, double speed)
{
    double x = speed / transition_velocity_m_s, y = fmin(x, 0.5);
    /* S'(y), which increases up to y = 1/2 */
    double slope = x < 1 ? 30 * y * y * (1 - y) * (1 - y) : CONTACT_FRICTION_STEEPEST / x;

    /* The slope of the viscous force is the same at any speed */
    return (slope * static_friction / transition_velocity_m_s + viscous_friction) * normal_n;
}
