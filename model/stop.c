/* SPDX-License-Identifier: Apache-2.0 */
/* Computes mechanical stops, their implicit steps, and passive joints. */
#include "model/stop.h"

double stop_depth(double lower, double upper, double x)
{
    return x > upper ? x - upper : x < lower ? x - lower : 0.0;
}

/* Returns k x + d x', the argument of the law F = max(0, k x + d x'). If the stop pushes, its sign
 * is the sign of the depth. */
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

/* Engages a stop on one side. The rate at the end of the step is r' = r + h a. So the force there
 * is k (depth + h r') + d r'. It is the force without acceleration, k (depth + h r) + d r, plus (d
 * + h k) h a. */
static void engage_stop(const struct robot_stop *stop, double limit, double x, double rate,
                        double h, int side, struct stop_step *step)
{
    step->side = side;
    step->torque = -press_stop(stop, x + h * rate - limit, rate);
    step->extra = h * (stop->damping + h * stop->stiffness);
}

void stop_step_begin(const struct robot_stop *stop, double lower, double upper, double x,
                     double rate, double h, struct stop_step *step)
{
    double depth = stop_depth(lower, upper, x + h * rate);

    *step = (struct stop_step){0};
    if (stop_torque(stop, depth, rate) != 0.0) {
        engage_stop(stop, depth > 0.0 ? upper : lower, x, rate, h, depth > 0.0 ? 1 : -1, step);
    }
}

void stop_step_continue(const struct robot_stop *stop, double lower, double upper, double x,
                        double rate, double h, int side, double earlier, struct stop_step *step)
{
    *step = (struct stop_step){.earlier = earlier};
    engage_stop(stop, side > 0 ? upper : lower, x, rate, h, side, step);
}

bool stop_step_revise(const struct robot_stop *stop, double lower, double upper, double x,
                      double rate, double h, double a, struct stop_step *step)
{
    double end = rate + h * a, depth = stop_depth(lower, upper, x + h * end);

    /* Release a stop that pulls */
    if (step->side != 0 && !step->left &&
        step->side * (step->torque - step->extra * a + step->earlier) > 0.0) {
        *step = (struct stop_step){.engaged = step->engaged, .left = true};
        return true;
    }

    /* Engage a stop that is missing */
    if (step->side == 0 && !step->left && !step->engaged && stop_torque(stop, depth, end) != 0.0) {
        engage_stop(stop, depth > 0.0 ? upper : lower, x, rate, h, depth > 0.0 ? 1 : -1, step);
        step->engaged = true;
        return true;
    }
    return false;
}

bool passive_is_present(const struct robot_passive *passive)
{
    return passive->stiffness > 0.0 || passive->damping > 0.0;
}

double passive_torque(const struct robot_passive *passive, double q, double qd)
{
    return -passive->stiffness * (q - passive->rest) - passive->damping * qd;
}

double passive_energy(const struct robot_passive *passive, double q)
{
    const double bend = q - passive->rest;

    return 0.5 * passive->stiffness * bend * bend;
}

double passive_loss(const struct robot_passive *passive, double qd)
{
    return passive->damping * qd * qd;
}
