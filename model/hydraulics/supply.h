/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What feeds the hydraulic joints of a robot: a pump of constant flow, an accumulator, a relief
 * valve (docs/hydraulics.md; Merritt, Hydraulic Control Systems, 1967):
 *
 *     V p' = n p (Q_pump - Q_relief - Q_leak - Q_drawn)   above precharge: p V^n constant, n = 1.4
 *     p' = beta_l / V_l (the same)                        below it: the accumulator is empty
 *
 * with the volume V_l of oil in manifold and hoses and their stiffness beta_l. At the return's
 * pressure valves draw from the tank through the pump. Without an accumulator the pressure is
 * constant, whatever is drawn.
 *
 * SI units, pressures above the air's. Pure functions. RT-safe.
 */
#ifndef MODEL_HYDRAULICS_SUPPLY_H
#define MODEL_HYDRAULICS_SUPPLY_H

#include "model/plant_io.h"
#include "model/robot.h"

/* Powers, W, or over a time works, J: pump = relief + leak (both lost) + flow to the valves + the
 * rate of hydraulic_supply_energy. */
struct hydraulic_supply_power {
    double pump, relief, leak;
};

/* Returns the rate of its pressure while that flow is drawn, Pa/s. power may be NULL. */
double hydraulic_supply_derive(const struct robot_hydraulic_supply *s,
                               const struct hydraulic_supply_condition *condition, double pressure,
                               double drawn, struct hydraulic_supply_power *power);

/* Returns whether the accumulator holds no oil, so that the pressure follows what is drawn at
 * once: hydraulic_supply_advance needs what the valves draw at the pressure it ends at. */
bool hydraulic_supply_is_empty(const struct robot_hydraulic_supply *s, double pressure);

/* Returns the pressure t seconds later, with that volume drawn evenly while the valves saw the
 * pressure held, which is that at the start (linearly implicit), or of an empty accumulator that
 * at the end (implicit): then the result is held itself where held is the solution, more above
 * it, less below. Adds to work. */
double hydraulic_supply_advance(const struct robot_hydraulic_supply *s,
                                const struct hydraulic_supply_condition *condition, double pressure,
                                double held, double drawn, double t,
                                struct hydraulic_supply_power *work);

/* Returns the energy of the accumulator's gas and of the oil that is compressed below precharge,
 * J. */
double hydraulic_supply_energy(const struct robot_hydraulic_supply *s, double pressure);

#endif
