/* SPDX-License-Identifier: Apache-2.0 */
/* The law of mechanical stops, and its implicit step. */
#include "model/stop.h"

#include <math.h>

double stop_depth(double lower, double upper, double x)
{
    return x > upper ? x - upper : x < lower ? x - lower : 0.0;
}

/* Of the law F = max(0, k x + d x') the inner value, with the depth's sign. */
static double press_stop(const struct robot_stop *stop, double depth, double rate)
{
    return stop->stiffness * depth + stop->damping * rate;
}

double stop_torque(const struct robot_stop *stop, double depth, double rate)
{
    double press = depth != 0.0 ? press_stop(stop, depth, rate) : 0.0;

    return press * depth > 0.0 ? -press : 0.0;
}

double stop_energy(const struct robot_stop *stop, double depth)
{
    return 0.5 * stop->stiffness * depth * depth;
}

double stop_loss(const struct robot_stop *stop, double depth, double rate)
{
    return -(stop_torque(stop, depth, rate) + stop->stiffness * depth) * rate;
}

/* With the rate r' = r + h a at the end, k (depth + h r') + d r' there: the depth that the rate r
 * would lead to, plus (d + h k) h a. */
void stop_step_begin(const struct robot_stop *stop, double lower, double upper, double x,
                     double rate, double h, struct stop_step *step)
{
    *step = (struct stop_step){0};
    if (stop->stiffness > 0.0) {
        step->torque = stop_torque(stop, stop_depth(lower, upper, x + h * rate), rate);
        step->active = step->torque != 0.0;
    }
    if (step->active) {
        step->extra = h * (stop->damping + h * stop->stiffness);
    }
}

bool stop_step_pulls(const struct stop_step *step, double a)
{
    return step->active && step->torque * (step->torque - step->extra * a) < 0.0;
}
