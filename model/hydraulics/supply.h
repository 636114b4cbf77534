/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The supply of a robot's hydraulic joints: a pump of constant flow, an accumulator, a relief valve
 * (docs/hydraulics.md; Merritt, Hydraulic Control Systems, 1967):
 *
 *     V p' = n p (Q_pump - Q_relief - Q_leak - Q_drawn)   above precharge: p V^n constant, n = 1.4
 *     p' = beta_l / V_l (the same flows) below it: the accumulator is empty
 *
 * V_l is the oil volume in manifold and hoses, beta_l their stiffness. At the return's pressure,
 * valves draw oil from the tank through the pump. Without an accumulator the pressure is constant
 * for any flow.
 *
 * SI units, gauge pressures. Pure functions. RT-safe.
 */
#ifndef MODEL_HYDRAULICS_SUPPLY_H
#define MODEL_HYDRAULICS_SUPPLY_H

#include "model/plant_io.h"
#include "model/robot.h"

/* Powers, W, or their integrals over time, J. Balance: pump = relief + leak (both lost) + flow to
 * the valves + the rate of hydraulic_supply_energy. */
struct hydraulic_supply_power {
    double pump, relief, leak;
};

/* Returns the rate of the supply pressure while this flow is drawn, Pa/s. power may be NULL. */
double hydraulic_supply_derive(const struct robot_hydraulic_supply *s,
                               const struct hydraulic_supply_condition *condition, double pressure,
                               double drawn, struct hydraulic_supply_power *power);

/* Returns whether the accumulator is empty. The pressure then follows the drawn flow immediately,
 * and hydraulic_supply_advance needs the flow that the valves draw at the end pressure. */
bool hydraulic_supply_is_empty(const struct robot_hydraulic_supply *s, double pressure);

/* Returns the pressure after t seconds in which this volume is drawn at constant flow. Adds the
 * energies to work. held: pressure for which the volume was computed, normally the pressure at the
 * start (linearly implicit). For an empty accumulator, held is a guess of the end pressure
 * (implicit). The result equals held if held is the solution. */
double hydraulic_supply_advance(const struct robot_hydraulic_supply *s,
                                const struct hydraulic_supply_condition *condition, double pressure,
                                double held, double drawn, double t,
                                struct hydraulic_supply_power *work);

/* Returns the energy of the accumulator's gas or, below precharge, of the compressed oil, J. */
double hydraulic_supply_energy(const struct robot_hydraulic_supply *s, double pressure);

#endif
