/* SPDX-License-Identifier: Apache-2.0 */
#include "tasks/motion_profile.h"

#include <math.h>

/* Returns the greatest rate from which a distance is enough to stop when the rate falls by a dt
 * in each step: the steps cover v dt + (v - a dt) dt + ... = v^2 / (2 a) + v dt / 2. */
static double stopping_rate(double distance, double acceleration, double dt)
{
    return acceleration * (sqrt(dt * dt / 4 + 2 * distance / acceleration) - dt / 2);
}

void motion_profile_step(struct motion_profile *profile, double goal_rad, double rate_rad_s,
                         double acceleration_rad_s2, double dt_s)
{
    double away = goal_rad - profile->angle_rad, most = acceleration_rad_s2 * dt_s;
    double wanted =
        copysign(fmin(rate_rad_s, stopping_rate(fabs(away), acceleration_rad_s2, dt_s)), away);
    double change = fmin(fmax(wanted - profile->rate_rad_s, -most), most);

    profile->rate_rad_s += change;

    /* The last step ends at the goal, at rest */
    if (fabs(away) <= most * dt_s && fabs(profile->rate_rad_s) <= most) {
        profile->angle_rad = goal_rad;
        profile->rate_rad_s = 0;
        return;
    }
    profile->angle_rad += profile->rate_rad_s * dt_s;
}
