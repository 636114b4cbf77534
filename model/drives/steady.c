/* SPDX-License-Identifier: Apache-2.0 */
/* Solves the torque balance of a drive at constant speed. */
#include "model/drives/steady.h"

#include "model/drives/effects.h"

#include <math.h>

/* Number of bisection steps, and of steps by GROWTH to find the end of the interval. */
enum { HALVINGS = 100, STEPS = 130 };
#define GROWTH 1.25

/* A steady state; with a voltage above 0, the current follows from voltage and speed. */
struct steady {
    const struct robot_sea *sea;
    double I, load, speed, voltage;
    int sense;
};

/* Returns the motor's torque at a current. */
static double motor_torque(const struct robot_sea *sea, double I)
{
    return sea->Kt * effects_saturation(sea, I) * I;
}

double steady_current(const struct robot_sea *sea, double voltage, double speed)
{
    const double R = sea->R + effects_skin(sea, speed);
    const double free = voltage / R, turning = (voltage - sea->Kw * speed) / R;
    double low = fmin(free, turning), high = fmax(free, turning);

    if (effects_saturation(sea, turning) == 1.0) {
        return turning;
    }
    for (int i = 0; i < HALVINGS; i++) {
        const double I = 0.5 * (low + high), emf = sea->Kw * effects_saturation(sea, I) * speed;

        *(R * I + emf > voltage ? &high : &low) = I;
    }
    return low;
}

/* Returns the motor's torque minus losses and load. */
static double find_surplus(const struct steady *at)
{
    const struct robot_sea *sea = at->sea;
    const double I = at->voltage > 0.0 ? steady_current(sea, at->voltage, at->speed) : at->I;
    const struct effects_carried carried = {.motor = motor_torque(sea, I), .external = -at->load};
    const double friction = sea->effects ? effects_friction(sea, at->speed, &carried) : 0.0;

    return carried.motor - (double)at->sense * (effects_damping(sea, I) * at->speed + friction) -
           at->load;
}

/* Returns the quantity x of a state at which sign times the surplus falls through 0, or NAN. */
static double find_root(struct steady *at, double *x, double first, double sign)
{
    double low = 0.0, high = first;

    *x = high;
    for (int i = 0; i < STEPS && sign * find_surplus(at) > 0.0; i++) {
        *x = high *= GROWTH;
    }
    if (!(sign * find_surplus(at) <= 0.0)) {
        return NAN;
    }
    *x = low;
    if (!(sign * find_surplus(at) >= 0.0)) {
        return NAN;
    }
    for (int i = 0; i < HALVINGS; i++) {
        *x = 0.5 * (low + high);
        *(sign * find_surplus(at) > 0.0 ? &low : &high) = *x;
    }
    return low;
}

double steady_load(const struct robot_sea *sea, double motor, double speed, int sense)
{
    struct steady at = {
        .sea = sea, .I = effects_current(sea, motor), .speed = speed, .sense = sense};

    return find_root(&at, &at.load, fmax(motor, 1e-9), 1.0);
}

double steady_motor(const struct robot_sea *sea, double load, double speed, int sense)
{
    struct steady at = {.sea = sea, .load = load, .speed = speed, .sense = sense};

    return motor_torque(sea, find_root(&at, &at.I, fmax(load, 1e-9) / sea->Kt, -1.0));
}

double steady_speed(const struct robot_sea *sea, double voltage, double load)
{
    struct steady at = {.sea = sea, .load = load, .voltage = voltage, .sense = 1};

    return find_root(&at, &at.speed, voltage / sea->Kw, 1.0);
}
