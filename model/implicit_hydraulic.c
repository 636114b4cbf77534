/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Hydraulic joints in a stage of the implicit integrator, as drives with effects are
 * (model/implicit_effects.c): the torque at the stage is linearized where the cylinder comes to at
 * the rate that the step foretells, with its own slope against that rate. The supply's pressure is
 * held over a span and follows by what was drawn in it.
 */
#include "model/implicit_private.h"

#include <string.h>

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

void implicit_advance_hydraulics(struct plant *plant, double t, const double *rates)
{
    struct implicit *im = plant->implicit;
    const size_t at = plant_hydraulic_supply(plant);
    struct hydraulic_supply_power pump = {0};
    double drawn = 0.0;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        struct hydraulic_port port = plant_hydraulic_port(plant, im->base, c);
        struct hydraulic_power done = {0};

        port.qd = rates[plant->hydraulic_joint[c]];
        hydraulic_advance(cylinder_of(plant, c), &port, t,
                          im->base + plant->at.hydraulic + HYDRAULIC_STATE * c, &done, NULL);
        plant_hydraulic_account(&done, port.supply, im->work);
        drawn += done.drawn;
    }
    im->base[at] = hydraulic_supply_advance(&plant->config.robot->hydraulic_supply, im->base[at],
                                            drawn, t, &pump);
    im->work[WORK_HYDRAULIC] += pump.pump;
    im->work[WORK_RELIEF] += pump.relief;
}
