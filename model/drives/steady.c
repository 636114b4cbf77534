/* SPDX-License-Identifier: Apache-2.0 */
/* Solves the torque balance of a drive at constant speed. */
#include "model/drives/steady.h"

#include "model/drives/effects.h"

#include <math.h>

/* Number of bisection steps, and of steps by GROWTH to find the end of the interval. */
enum { HALVINGS = 100, STEPS = 130 };
#define GROWTH 1.25

/* Returns the motor's torque at a current. */
static double motor_torque(const struct robot_sea *sea, double I)
{
    return sea->Kt * effects_saturation(sea, I) * I;
}

/* Returns the motor's torque at a current, minus losses and load. */
static double find_surplus(const struct robot_sea *sea, double I, double load, double speed,
                           int sense)
{
    const double motor = motor_torque(sea, I);
    const struct effects_carried carried = {.motor = motor, .external = -load};
    const double friction = sea->effects ? effects_friction(sea, speed, &carried) : 0.0;

    return motor - (double)sense * (effects_damping(sea, I) * speed + friction) - load;
}

double steady_load(const struct robot_sea *sea, double motor, double speed, int sense)
{
    const double I = effects_current(sea, motor);
    double low = 0.0, high = fmax(motor, 1e-9);

    for (int i = 0; i < STEPS && find_surplus(sea, I, high, speed, sense) > 0.0; i++) {
        high *= GROWTH;
    }
    if (!(find_surplus(sea, I, low, speed, sense) >= 0.0 &&
          find_surplus(sea, I, high, speed, sense) <= 0.0)) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);

        *(find_surplus(sea, I, middle, speed, sense) > 0.0 ? &low : &high) = middle;
    }
    return low;
}

double steady_motor(const struct robot_sea *sea, double load, double speed, int sense)
{
    double low = 0.0, high = fmax(load, 1e-9) / sea->Kt;

    for (int i = 0; i < STEPS && find_surplus(sea, high, load, speed, sense) < 0.0; i++) {
        high *= GROWTH;
    }
    if (find_surplus(sea, low, load, speed, sense) > 0.0 ||
        find_surplus(sea, high, load, speed, sense) < 0.0) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);

        *(find_surplus(sea, middle, load, speed, sense) < 0.0 ? &low : &high) = middle;
    }
    return motor_torque(sea, high);
}

double steady_current(const struct robot_sea *sea, double voltage, double speed)
{
    const double free = voltage / sea->R, turning = (voltage - sea->Kw * speed) / sea->R;
    double low = fmin(free, turning), high = fmax(free, turning);

    if (effects_saturation(sea, turning) == 1.0) {
        return turning;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double I = 0.5 * (low + high), emf = sea->Kw * effects_saturation(sea, I) * speed;

        *(sea->R * I + emf > voltage ? &high : &low) = I;
    }
    return low;
}

double steady_speed(const struct robot_sea *sea, double voltage, double load)
{
    double low = 0.0, high = voltage / sea->Kw;

    if (find_surplus(sea, voltage / sea->R, load, 0.0, 1) < 0.0) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high), I = steady_current(sea, voltage, middle);

        *(find_surplus(sea, I, load, middle, 1) > 0.0 ? &low : &high) = middle;
    }
    return low;
}
