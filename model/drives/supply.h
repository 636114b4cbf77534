/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The supply of the bridges as a bus whose voltage rises under regeneration. The bus has a source
 * of voltage U behind a resistance R and a diode, which blocks reverse current (a battery has no
 * diode). It has a capacitor C and a brake chopper. The chopper connects a resistor R_b when the
 * voltage reaches on_v, until the voltage falls to off_v:
 *
 *     C V' = max(0, (U - V)/R) - [chopper] V/R_b - P/V
 *
 * P is the power that the bridges take (negative if they return it). SI units. Pure functions.
 * RT-safe.
 */
#ifndef MODEL_DRIVES_SUPPLY_H
#define MODEL_DRIVES_SUPPLY_H

#include <stdbool.h>

struct supply_bus {
    double capacitance_f; /* 0 = no bus: the source supplies the bridges directly */
    double on_v, off_v;   /* voltages of the chopper; on_v 0 = no chopper */
    double brake_ohm;
    bool returns; /* the source accepts reverse current, like a battery */
};

/* Parts of the state. */
enum supply_part { SUPPLY_VOLTAGE, SUPPLY_CHOPPING, SUPPLY_STATE };

/* Lowest voltage of a bus, V. If the load exceeds the source's maximum power, the voltage stays
 * there and the source supplies the missing power. */
#define SUPPLY_LEAST_V 1.0

/* Powers, W, and the rate of the voltage. */
struct supply_rates {
    double source, source_loss, chopper;
    double voltage; /* V/s */
};

/* Computes the rates while the bridges take this power, W; ohm > 0. */
void supply_rates(const struct supply_bus *bus, double source_v, double ohm, double power,
                  const double state[SUPPLY_STATE], struct supply_rates *rates);

/* Switches the chopper according to the voltage. */
void supply_switch_chopper(const struct supply_bus *bus, double state[SUPPLY_STATE]);

/* Advances the bus by t seconds in which the bridges take this energy, J, at constant power. Uses
 * the implicit midpoint rule in a fixed number of parts; the chopper switches between parts. Adds
 * the energies of source and losses, J, to work, in the order of struct supply_rates. The balance
 * C V^2/2 = source - losses - energy holds to rounding. */
void supply_advance(const struct supply_bus *bus, double source_v, double ohm, double energy,
                    double t, double state[SUPPLY_STATE], double work[3]);

#endif
