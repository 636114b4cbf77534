/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the paper's actuator equations for one drive. */
#include "model/drives/actuator.h"

#include "model/stop.h"

#include <math.h>

/* Returns the depth of the spring in its stop, rad, with the sign of the deflection. */
static double spring_stop_depth(const struct robot_sea *sea, double deflection)
{
    return sea->stop.stiffness > 0.0 ? stop_depth(-sea->deflection, sea->deflection, deflection)
                                     : 0.0;
}

double sea_torque_pressed(const struct robot_sea *sea, const struct sea_state *state, double q,
                          double qd)
{
    double depth = spring_stop_depth(sea, state->qm - q), twist = state->qmd - qd;

    return sea->Ks * (state->qm - q) + sea->Ds * twist - stop_torque(&sea->stop, depth, twist);
}

struct sea_spring sea_spring_at(const struct robot_sea *sea, double deflection, double rate)
{
    struct sea_spring spring = {.Ks = sea->Ks, .Ds = sea->Ds};
    double depth = spring_stop_depth(sea, deflection);

    if (stop_torque(&sea->stop, depth, rate) != 0.0) {
        spring.Ks += sea->stop.stiffness;
        spring.Ds += sea->stop.damping;
        spring.offset = -copysign(sea->stop.stiffness * sea->deflection, depth);
    }
    return spring;
}

double sea_deflection(const struct robot_sea *sea, double tau)
{
    double free = tau / sea->Ks;

    if (fabs(free) > sea->deflection && sea->stop.stiffness > 0.0) {
        return copysign((fabs(tau) + sea->stop.stiffness * sea->deflection) /
                            (sea->Ks + sea->stop.stiffness),
                        tau);
    }
    return free;
}

void sea_derivative(const struct robot_sea *sea, const struct sea_state *state, double q, double qd,
                    double V, bool bridge_on, struct sea_state *derivative)
{
    double tau = sea_torque(sea, state, q, qd);

    /* Compute the derivatives by eqs (2) and (4) */
    derivative->qm = state->qmd;
    derivative->qmd = (sea->Kt * state->I - sea->Dm * state->qmd - tau) / sea->J;
    derivative->I = bridge_on ? (V - sea->R * state->I - sea->Kw * state->qmd) / sea->L : 0.0;
}

void sea_power(const struct robot_sea *sea, const struct sea_state *state, double q, double qd,
               double V, struct sea_power *power)
{
    double twist = state->qmd - qd;

    power->electrical = V * state->I;
    power->joule = sea->R * state->I * state->I;
    power->friction =
        sea->Dm * state->qmd * state->qmd + (sea->Kw - sea->Kt) * state->I * state->qmd;
    power->spring_damping = sea->Ds * twist * twist +
                            stop_loss(&sea->stop, spring_stop_depth(sea, state->qm - q), twist);
}

double sea_energy(const struct robot_sea *sea, const struct sea_state *state, double q)
{
    double deflection = state->qm - q;

    return 0.5 * (sea->L * state->I * state->I + sea->J * state->qmd * state->qmd +
                  sea->Ks * deflection * deflection) +
           stop_energy(&sea->stop, spring_stop_depth(sea, deflection));
}

/* Returns the extension x = p - r s q of the parallel spring, m; it pulls while x < 0. */
static double parallel_spring_extension(const struct robot_parallel_spring *spring, double p,
                                        double q)
{
    return p - spring->r * spring->s * q;
}

/* Eq. (5): the spring pulls only while it is stretched, x < 0. */
double parallel_spring_force(const struct robot_parallel_spring *spring, double p, double pd,
                             double q, double qd)
{
    double x = parallel_spring_extension(spring, p, q);
    double xd = pd - spring->r * spring->s * qd;

    return x < 0.0 ? spring->k_p * x + spring->d_p * xd : 0.0;
}

double parallel_spring_torque(const struct robot_parallel_spring *spring, double p, double pd,
                              double q, double qd)
{
    return spring->s * spring->r * parallel_spring_force(spring, p, pd, q, qd);
}

void parallel_spring_step(const struct robot_parallel_spring *spring, double p, double pd, double q,
                          double qd, double h, double *torque, double *extra)
{
    double x = parallel_spring_extension(spring, p, q);
    double yield = spring->d_p + h * spring->k_p;

    *torque = 0.0;
    *extra = 0.0;
    if (x < 0.0) {
        double xd = pd - spring->r * spring->s * qd;

        *torque = spring->s * spring->r * (spring->k_p * x + yield * xd);
        *extra = h * yield * spring->r * spring->r;
    }
}

double parallel_spring_energy(const struct robot_parallel_spring *spring, double p, double q)
{
    double x = parallel_spring_extension(spring, p, q);

    return x < 0.0 ? 0.5 * spring->k_p * x * x : 0.0;
}

double parallel_spring_damping(const struct robot_parallel_spring *spring, double p, double pd,
                               double q, double qd)
{
    double x = parallel_spring_extension(spring, p, q);
    double xd = pd - spring->r * spring->s * qd;

    return x < 0.0 ? spring->d_p * xd * xd : 0.0;
}
