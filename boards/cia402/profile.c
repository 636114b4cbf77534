/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Trapezoidal profiles in steps of dt. A position moves by the velocity of the step's end, so that
 * stopping from v takes v^2 / (2 d) + v dt / 2; what remains of the way bounds the velocity.
 */
#include "boards/cia402/private.h"

#include <math.h>

void cia402_profile_accelerate(struct cia402_profile *profile, double velocity, double acceleration,
                               double deceleration, double dt)
{
    double v = profile->velocity;
    bool slower = fabs(velocity) < fabs(v) || velocity * v < 0.0;
    double step = (slower ? deceleration : acceleration) * dt;

    profile->velocity = fabs(velocity - v) <= step ? velocity : v + copysign(step, velocity - v);
    profile->position += profile->velocity * dt;
}

void cia402_profile_move(struct cia402_profile *profile, double goal, double speed,
                         double acceleration, double deceleration, double dt)
{
    double way = goal - profile->position, distance = fabs(way);
    double half = deceleration * dt / 2.0;
    double v = way < 0.0 ? -profile->velocity : profile->velocity;
    double most = fmin(speed, sqrt(half * half + 2.0 * deceleration * distance) - half);

    if (v < 0.0) { /* away from the goal */
        v = fmin(v + deceleration * dt, most);
    } else {
        v = v < most ? fmin(v + acceleration * dt, most) : fmax(v - deceleration * dt, most);
    }
    if (v * dt >= distance && v <= 2.0 * deceleration * dt) {
        profile->position = goal;
        profile->velocity = 0.0;
        return;
    }
    profile->velocity = way < 0.0 ? -v : v;
    profile->position += profile->velocity * dt;
}
