/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Hydraulic joints in a stage of the implicit integrator, handled like drives with effects
 * (model/implicit/effects.c). The torque at the stage is linearized at the predicted
 * position of the cylinder, with the cylinder's own slope against the joint's rate. The supply
 * pressure is constant over a span; then it changes with the volume drawn. With an empty
 * accumulator the pressure changes with any small volume. It is then solved together with the
 * volume drawn at this pressure.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Solver for the pressure of an empty supply: tolerance, and largest number of steps. Five or six
 * steps are usual. */
#define SUPPLY_TOLERANCE_PA 1e3
enum { SUPPLY_STEPS = 12 };

static const struct robot_hydraulic *cylinder_of(const struct plant *plant, size_t c)
{
    return &plant->config.robot->joint[plant->hydraulic_joint[c]].hydraulic;
}

void implicit_linearize_hydraulics(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const double h = im->stage_h;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const size_t j = plant->hydraulic_joint[c];
        const double rate = plant_joint_rate(plant, im->point, j);
        const double *begin = im->base + plant->at.hydraulic + HYDRAULIC_STATE * c;
        struct hydraulic_port port = plant_hydraulic_port(plant, im->base, c);
        double state[HYDRAULIC_STATE], slope;

        memcpy(state, begin, sizeof state);
        port.qd = rate;
        hydraulic_advance(cylinder_of(plant, c), &port, h, state, NULL, &slope);
        im->torque[j] += hydraulic_torque(cylinder_of(plant, c), state, port.q + h * rate, rate) +
                         slope * (plant_joint_rate(plant, im->base, j) - rate);
        im->extra[j] -= slope * h;
    }
}

/* Returns the volume (m3) that the cylinders draw in t seconds at the joints' rates from a supply
 * with this pressure. */
static double draw_at_pressure(const struct plant *plant, double supply, double t,
                               const double *rates)
{
    const struct implicit *im = plant->implicit;
    double drawn = 0.0;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        struct hydraulic_port port = plant_hydraulic_port(plant, im->base, c);
        struct hydraulic_power done = {0};
        double state[HYDRAULIC_STATE];

        memcpy(state, im->base + plant->at.hydraulic + HYDRAULIC_STATE * c, sizeof state);
        port.supply = supply;
        port.qd = rates[plant->hydraulic_joint[c]];
        hydraulic_advance(cylinder_of(plant, c), &port, t, state, &done, NULL);
        drawn += done.drawn;
    }
    return drawn;
}

/* Returns the end pressure of an empty supply minus the pressure held at its valves, Pa. */
static double supply_excess(const struct plant *plant, double held, double t, const double *rates)
{
    struct hydraulic_supply_power unused = {0};

    return hydraulic_supply_advance(&plant->config.robot->hydraulic_supply, &plant->command.oil,
                                    plant->implicit->base[plant_hydraulic_supply(plant)], held,
                                    draw_at_pressure(plant, held, t, rates), t, &unused) -
           held;
}

/* Returns the end pressure of an empty supply (regula falsi, Illinois variant). A higher pressure
 * draws more volume. So there is one solution between return pressure and precharge, or one of
 * these bounds is the result. */
static double solve_empty_supply(const struct plant *plant, double t, const double *rates)
{
    const struct robot_hydraulic_supply *s = &plant->config.robot->hydraulic_supply;
    double low = s->back, high = s->precharge, middle = low;
    double below = supply_excess(plant, low, t, rates), above;
    int side = 0;

    /* Return a bound if there is no solution between the bounds */
    if (below <= 0.0) {
        return low;
    }
    above = supply_excess(plant, high, t, rates);
    if (above >= 0.0) {
        return high;
    }
    /* The root of the secant replaces the bound whose excess has the same sign. If the other bound
     * stays twice, its excess is halved */
    for (int k = 0; k < SUPPLY_STEPS; k++) {
        double excess;

        middle = low + (high - low) * below / (below - above);
        excess = supply_excess(plant, middle, t, rates);
        if (fabs(excess) < SUPPLY_TOLERANCE_PA || high - low < SUPPLY_TOLERANCE_PA) {
            break;
        }
        if (excess > 0.0) {
            low = middle;
            below = excess;
            above *= side > 0 ? 0.5 : 1.0;
            side = 1;
        } else {
            high = middle;
            above = excess;
            below *= side < 0 ? 0.5 : 1.0;
            side = -1;
        }
    }
    return middle;
}

void implicit_advance_hydraulics(struct plant *plant, double t, const double *rates)
{
    const struct robot_hydraulic_supply *s = &plant->config.robot->hydraulic_supply;
    struct implicit *im = plant->implicit;
    const size_t at = plant_hydraulic_supply(plant);
    const double held = hydraulic_supply_is_empty(s, im->base[at])
                            ? solve_empty_supply(plant, t, rates)
                            : im->base[at];
    struct hydraulic_supply_power pump = {0};
    double drawn = 0.0;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        struct hydraulic_port port = plant_hydraulic_port(plant, im->base, c);
        struct hydraulic_power done = {0};

        port.supply = held;
        port.qd = rates[plant->hydraulic_joint[c]];
        hydraulic_advance(cylinder_of(plant, c), &port, t,
                          im->base + plant->at.hydraulic + HYDRAULIC_STATE * c, &done, NULL);
        plant_hydraulic_account(&done, port.supply, im->work);
        drawn += done.drawn;
    }
    im->base[at] =
        hydraulic_supply_advance(s, &plant->command.oil, im->base[at], held, drawn, t, &pump);
    plant_hydraulic_account_supply(&pump, im->work);
}
