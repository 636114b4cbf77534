/* SPDX-License-Identifier: Apache-2.0 */
/* Solves the torque balance of a drive at constant speed. */
#include "model/drives/steady.h"

#include "model/drives/effects.h"

#include <math.h>

/* Number of bisection steps, and of doublings to find the end of the interval. */
enum { HALVINGS = 100, DOUBLINGS = 40 };

/* Returns the motor's torque minus losses and load. */
static double find_surplus(const struct robot_sea *sea, double motor, double load, double speed,
                           int sense)
{
    const struct effects_carried carried = {.motor = motor, .external = -load};
    const double friction = sea->effects ? effects_friction(sea, speed, &carried) : 0.0;

    return motor - (double)sense * (sea->Dm * speed + friction) - load;
}

double steady_load(const struct robot_sea *sea, double motor, double speed, int sense)
{
    double low = 0.0, high = fmax(motor, 1e-9);

    for (int i = 0; i < DOUBLINGS && find_surplus(sea, motor, high, speed, sense) > 0.0; i++) {
        high *= 2.0;
    }
    if (find_surplus(sea, motor, low, speed, sense) < 0.0 ||
        find_surplus(sea, motor, high, speed, sense) > 0.0) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);

        *(find_surplus(sea, motor, middle, speed, sense) > 0.0 ? &low : &high) = middle;
    }
    return low;
}

double steady_motor(const struct robot_sea *sea, double load, double speed, int sense)
{
    double low = 0.0, high = fmax(load, 1e-9);

    for (int i = 0; i < DOUBLINGS && find_surplus(sea, high, load, speed, sense) < 0.0; i++) {
        high *= 2.0;
    }
    if (find_surplus(sea, low, load, speed, sense) > 0.0 ||
        find_surplus(sea, high, load, speed, sense) < 0.0) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);

        *(find_surplus(sea, middle, load, speed, sense) < 0.0 ? &low : &high) = middle;
    }
    return high;
}

double steady_speed(const struct robot_sea *sea, double voltage, double load)
{
    double low = 0.0, high = voltage / sea->Kw;

    if (find_surplus(sea, sea->Kt * voltage / sea->R, load, 0.0, 1) < 0.0) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);
        const double motor = sea->Kt * (voltage - sea->Kw * middle) / sea->R;

        *(find_surplus(sea, motor, load, middle, 1) > 0.0 ? &low : &high) = middle;
    }
    return low;
}
