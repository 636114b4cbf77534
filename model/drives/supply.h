/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The supply of the bridges as a bus that regeneration can lift: a source of voltage U behind a
 * resistance R and a diode, which lets no current back (a battery has none), a capacitor C, and a
 * brake chopper, which puts a resistor across the bus from on_v up until the bus is down to off_v:
 *
 *     C V' = max(0, (U - V)/R) - [chopper] V/R_b - P/V
 *
 * with the power P that the bridges take or give. SI units. Pure functions. RT-safe.
 */
#ifndef MODEL_DRIVES_SUPPLY_H
#define MODEL_DRIVES_SUPPLY_H

#include <stdbool.h>

struct supply_bus {
    double capacitance_f; /* 0 = there is no bus, the supply is the source */
    double on_v, off_v;   /* voltages of the chopper; on_v 0 = there is none */
    double brake_ohm;
    bool returns; /* the source takes energy back, as a battery does */
};

/* Parts of the state. */
enum supply_part { SUPPLY_VOLTAGE, SUPPLY_CHOPPING, SUPPLY_STATE };

/* The least voltage of a bus, V: under a load beyond what the source can give it stays there, and
 * the source gives what is missing. */
#define SUPPLY_LEAST_V 1.0

/* Powers, W, and the rate of the voltage. */
struct supply_rates {
    double source, source_loss, chopper;
    double voltage; /* V/s */
};

/* Computes the rates while the bridges take that power, W; ohm > 0. */
void supply_rates(const struct supply_bus *bus, double source_v, double ohm, double power,
                  const double state[SUPPLY_STATE], struct supply_rates *rates);

/* Switches the chopper as the voltage says. */
void supply_switch_chopper(const struct supply_bus *bus, double state[SUPPLY_STATE]);

/* Advances the bus by t seconds in which the bridges take that energy, J, at an even power:
 * implicit midpoint rule in a fixed number of parts, between which the chopper switches. Adds
 * the energies of source and losses, J, to work, in the order of struct supply_rates. The
 * balance C V^2/2 = source - losses - energy holds to rounding. */
void supply_advance(const struct supply_bus *bus, double source_v, double ohm, double energy,
                    double t, double state[SUPPLY_STATE], double work[3]);

#endif
