/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the rates and steps of the bus that supplies the bridges. */
#include "model/drives/supply.h"

#include <math.h>

/* Number of parts of a step, and of Newton steps per part; the start is near the root, so
 * convergence is quadratic. */
enum { SUPPLY_PARTS = 16, NEWTON_STEPS = 8 };

/* Returns the current of the source into a bus at V, A; a rectifier blocks reverse current. */
static double source_current(const struct supply_bus *bus, double source_v, double ohm, double V)
{
    const double I = (source_v - V) / ohm;

    return bus->returns ? I : fmax(0.0, I);
}

void supply_rates(const struct supply_bus *bus, double source_v, double ohm, double power,
                  const double state[SUPPLY_STATE], struct supply_rates *rates)
{
    const double V = fmax(SUPPLY_LEAST_V, state[SUPPLY_VOLTAGE]);
    const double I = source_current(bus, source_v, ohm, V);
    const double brake = state[SUPPLY_CHOPPING] != 0.0 ? V / bus->brake_ohm : 0.0;

    rates->source = source_v * I;
    rates->source_loss = ohm * I * I;
    rates->chopper = V * brake;
    rates->voltage = (I - brake - power / V) / bus->capacitance_f;
    if (state[SUPPLY_VOLTAGE] <= SUPPLY_LEAST_V && rates->voltage < 0.0) {
        rates->source -= bus->capacitance_f * V * rates->voltage;
        rates->voltage = 0.0;
    }
}

void supply_switch_chopper(const struct supply_bus *bus, double state[SUPPLY_STATE])
{
    if (bus->on_v > 0.0 && state[SUPPLY_VOLTAGE] >= bus->on_v) {
        state[SUPPLY_CHOPPING] = 1.0;
    } else if (state[SUPPLY_VOLTAGE] <= bus->off_v) {
        state[SUPPLY_CHOPPING] = 0.0;
    }
}

void supply_advance(const struct supply_bus *bus, double source_v, double ohm, double energy,
                    double t, double state[SUPPLY_STATE], double work[3])
{
    const double h = t / SUPPLY_PARTS, C = bus->capacitance_f;

    for (int part = 0; part < SUPPLY_PARTS; part++) {
        const double conductance = state[SUPPLY_CHOPPING] != 0.0 ? 1.0 / bus->brake_ohm : 0.0;
        const double V = state[SUPPLY_VOLTAGE];

        /* Compute the voltage at the middle of a part of h seconds that begins at voltage V, by
         * Newton's method. The voltage is the root m of 2 C (m - V) m = h (source - losses) -
         * energy. The left side is the change of C V^2/2. */
        double m = V;

        for (int k = 0; k < NEWTON_STEPS; k++) {
            const double I = source_current(bus, source_v, ohm, m),
                         slope = I != 0.0 ? -1.0 / ohm : 0.0;
            const double f = 2.0 * bus->capacitance_f * (m - V) * m -
                             h * (I * m - conductance * m * m) + energy / SUPPLY_PARTS;
            const double df = 2.0 * bus->capacitance_f * (2.0 * m - V) -
                              h * (I + slope * m - 2.0 * conductance * m);

            m = fmax(0.5 * (V + SUPPLY_LEAST_V), df > 0.0 ? m - f / df : m);
        }

        const double I = source_current(bus, source_v, ohm, m);
        const double stored = 2.0 * C * (m - V) * m;
        const double chopper = h * conductance * m * m, loss = h * ohm * I * I;
        const double given = h * source_v * I;

        /* At the lowest voltage the source supplies the missing power */
        work[0] += m > 0.5 * (V + SUPPLY_LEAST_V) ? given
                                                  : stored + energy / SUPPLY_PARTS + chopper + loss;
        work[1] += loss;
        work[2] += chopper;
        state[SUPPLY_VOLTAGE] = 2.0 * m - V;
        supply_switch_chopper(bus, state);
    }
}
