/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The path of the control position: at once to the command without limits, else with speed and
 * acceleration limited, so that it arrives with the commanded velocity. A commanded position moves
 * with the commanded velocity.
 */
#include "boards/moteus/private.h"

#include <math.h>

#define STEP_S 1e-3

/* Returns a value within +-limit; NaN does not limit. */
static double path_clamp(double value, double limit)
{
    return fmax(fmin(value, limit), -limit);
}

/* Returns the speed towards the target at the end of a step from which the limit still allows to
 * arrive with it: the way of the step and the one to stop, v^2 / 2a, are the distance. */
static double path_speed(double distance, double speed, double acceleration)
{
    double half = acceleration * STEP_S / 2.0;
    double square = half * half + 2.0 * (acceleration * distance - half * speed);

    return isnan(acceleration) ? distance / STEP_S : fmax(sqrt(fmax(square, 0.0)) - half, 0.0);
}

void moteus_path_step(struct moteus_path *path, double target_velocity, double velocity_limit,
                      double acceleration_limit)
{
    double change = acceleration_limit * STEP_S, wanted = target_velocity, before = path->velocity;

    /* Without limits the command is the path */
    if (isnan(velocity_limit) && isnan(acceleration_limit)) {
        path->position = isnan(path->target) ? path->position : path->target;
        path->target = NAN;
        path->velocity = target_velocity;
        path->position += target_velocity * STEP_S;
        path->done = true;
        return;
    }

    /* The speed that leads to the target, or that is wanted, as far as the limits allow it */
    if (!isnan(path->target)) {
        double distance = path->target - path->position;

        double speed = (before - target_velocity) * (distance < 0.0 ? -1.0 : 1.0);

        wanted += copysign(path_speed(fabs(distance), speed, acceleration_limit), distance);
        path->target += target_velocity * STEP_S;
    }
    wanted = path_clamp(wanted, velocity_limit);
    path->velocity = isnan(change) ? wanted : before + path_clamp(wanted - before, change);
    path->position += (isnan(change) ? path->velocity : (before + path->velocity) / 2.0) * STEP_S;

    /* Arrived: at the speed, and where a position is wanted there */
    change = isnan(change) ? 0.0 : change;
    path->done = fabs(path->velocity - target_velocity) <= change + 1e-9;
    if (!isnan(path->target)) {
        path->done = path->done && fabs(path->target - path->position) <= change * STEP_S + 1e-9;
        if (path->done) {
            path->position = path->target;
            path->velocity = path_clamp(target_velocity, velocity_limit);
            path->target = NAN;
        }
    }
}
