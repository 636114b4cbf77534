/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the rates and steps of the supply of hydraulic joints. */
#include "model/hydraulics/supply.h"

#include "base/portable_math.h"

#include <math.h>

/* Exponent of the accumulator's gas, adiabatic nitrogen. */
#define GAS_EXPONENT 1.4

/* Bulk modulus of oil in hoses with a little air, Pa: 100,000 psi (Merritt 1967, section 2-4). */
#define LINE_BULK_PA 6.9e8

/* The pump's motor stalls at this multiple of the relief valve's pressure; its flow falls to 0
 * over the last tenth (our assumption). This happens only if the relief valve does not open. */
#define STALL_RATIO 1.5
#define STALL_SHARE 0.1

/* Returns the volume of the accumulator's gas at a pressure, m3. */
static double gas_volume(const struct robot_hydraulic_supply *s, double pressure)
{
    return s->accumulator * portable_pow(s->precharge / pressure, 1.0 / GAS_EXPONENT);
}

bool hydraulic_supply_is_empty(const struct robot_hydraulic_supply *s, double pressure)
{
    return s->accumulator > 0.0 && pressure <= s->precharge;
}

/* Returns the pressure rise per net inflow, Pa/s per m3/s. */
static double supply_pressure_rate(const struct robot_hydraulic_supply *s, bool empty,
                                   double pressure, double flow)
{
    return empty ? flow * LINE_BULK_PA / s->line
                 : flow * GAS_EXPONENT * pressure / gas_volume(s, pressure);
}

/* Flows of the supply at a pressure, m3/s. slope: decrease of the net inflow per Pa. */
struct supply_flows {
    double pump, relief, leak, slope;
};

/* Computes the flows of pump, relief valve and leak at a pressure, in a condition. */
static struct supply_flows find_supply_flows(const struct robot_hydraulic_supply *s,
                                             const struct hydraulic_supply_condition *condition,
                                             double pressure)
{
    struct supply_flows flows = {.pump = s->pump - s->pump * condition->pump_loss,
                                 .leak = condition->leak * fmax(0.0, pressure - s->back),
                                 .slope = condition->leak};
    const double stall = STALL_RATIO * s->relief, span = STALL_SHARE * stall;

    if (condition->relief_shut && pressure > stall - span) {
        flows.slope += flows.pump / span;
        flows.pump *= fmax(0.0, (stall - pressure) / span);
    } else if (!condition->relief_shut && pressure > s->relief) {
        flows.slope += s->relief_flow;
        flows.relief = s->relief_flow * (pressure - s->relief);
    }
    return flows;
}

/* Adds the energies of these flows at a pressure over t seconds. */
static void account_supply_flows(const struct supply_flows *flows, double pressure, double t,
                                 struct hydraulic_supply_power *work)
{
    work->pump += t * (pressure * flows->pump);
    work->relief += t * (pressure * flows->relief);
    work->leak += t * (pressure * flows->leak);
}

double hydraulic_supply_derive(const struct robot_hydraulic_supply *s,
                               const struct hydraulic_supply_condition *condition, double pressure,
                               double drawn, struct hydraulic_supply_power *power)
{
    struct supply_flows flows;

    if (s->accumulator == 0.0) {
        if (power) {
            *power = (struct hydraulic_supply_power){.pump = pressure * drawn};
        }
        return 0.0;
    }
    flows = find_supply_flows(s, condition, pressure);
    if (pressure <= s->back) {
        flows.pump = fmax(flows.pump, drawn); /* the pump passes oil from the tank */
    }
    if (power) {
        *power = (struct hydraulic_supply_power){0};
        account_supply_flows(&flows, pressure, 1.0, power);
    }
    return supply_pressure_rate(s, hydraulic_supply_is_empty(s, pressure), pressure,
                                flows.pump - flows.relief - flows.leak - drawn);
}

double hydraulic_supply_advance(const struct robot_hydraulic_supply *s,
                                const struct hydraulic_supply_condition *condition, double pressure,
                                double held, double drawn, double t,
                                struct hydraulic_supply_power *work)
{
    const bool empty = hydraulic_supply_is_empty(s, pressure);
    struct supply_flows flows;
    double rate, stiff, end;

    if (s->accumulator == 0.0) {
        work->pump += pressure * drawn;
        return pressure;
    }
    flows = find_supply_flows(s, condition, held);
    account_supply_flows(&flows, held, t, work);
    /* Linearly implicit Euler step. With an empty accumulator, the flows are already the flows at
     * the end pressure */
    rate = supply_pressure_rate(s, empty, pressure,
                                flows.pump - flows.relief - flows.leak - drawn / t);
    stiff = empty ? 0.0 : supply_pressure_rate(s, false, pressure, flows.slope);
    end = pressure + t * rate / (1.0 + t * stiff);

    /* If the pressure passes precharge, use the other stiffness for the volume beyond it */
    if (empty != hydraulic_supply_is_empty(s, end)) {
        end = s->precharge + (end - s->precharge) /
                                 supply_pressure_rate(s, empty, s->precharge, 1.0) *
                                 supply_pressure_rate(s, !empty, s->precharge, 1.0);
    }
    /* At the return's pressure the pump draws from the tank */
    if (end < s->back) {
        work->pump += s->back * (s->back - end) / supply_pressure_rate(s, true, s->back, 1.0);
        end = s->back;
    }
    return end;
}

double hydraulic_supply_energy(const struct robot_hydraulic_supply *s, double pressure)
{
    if (s->accumulator == 0.0) {
        return 0.0;
    }
    if (hydraulic_supply_is_empty(s, pressure)) {
        return s->precharge * s->accumulator / (GAS_EXPONENT - 1.0) -
               0.5 * s->line / LINE_BULK_PA * (s->precharge * s->precharge - pressure * pressure);
    }
    return pressure * gas_volume(s, pressure) / (GAS_EXPONENT - 1.0);
}
