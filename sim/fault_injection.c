/* SPDX-License-Identifier: Apache-2.0 */
/* Executes the faults of motors, valves, supplies and buses while they are active. */
#include "sim/fault_injection.h"

#include "canbus/fault_port.h"
#include "canbus/wire/wire.h"

#include <math.h>

/* A fault that a wire executes. */
struct wire_injection {
    struct wire *wire; /* NULL: not a fault of a wire */
    int armed;         /* index of the fault in the wire; -1 = inactive */
    bool was_active;
};

struct fault_injection {
    struct fault_injection_config config;
    struct wire_injection *wire;          /* by fault */
    struct can_port *port[RIG_BUSES_MAX]; /* fault ports with rules; NULL = none */
    int64_t now_ns;
};

/* ---- buses ---- */

/* Returns the kind of port rule for a fault; FAULT_PORT_LOSS by default. */
static enum fault_port_kind fault_port_kind_of(enum fault_kind kind)
{
    switch (kind) {
    case FAULT_CORRUPTION:
        return FAULT_PORT_CORRUPTION;
    case FAULT_LATE:
        return FAULT_PORT_LATE;
    case FAULT_DUPLICATE:
        return FAULT_PORT_DUPLICATE;
    case FAULT_BUS_OFF:
        return FAULT_PORT_BUS_OFF;
    default:
        return FAULT_PORT_LOSS;
    }
}

/* Wraps a bus's port in a fault port, if a fault of the bus needs port rules. */
static enum error_code injection_create_port(struct fault_injection *injection, size_t bus,
                                             struct arena *arena, struct can_port **port,
                                             struct error *error)
{
    const struct fault_injection_config *config = &injection->config;
    const struct loop_lockstep *lockstep = &config->rig->lockstep;
    size_t count = faults_count(config->faults), on_wire = 0;
    struct fault_port_rule *rule = arena_alloc(arena, count + 1, sizeof *rule);
    struct fault_port_config made = {.port = *port,
                                     .rule = rule,
                                     .exempt = {lockstep->step_id, lockstep->done_id},
                                     .nexempt = 2,
                                     .seed = faults_seed(config->faults)};
    enum error_code code;

    if (!rule) {
        return error_set(error, ERROR_MEMORY, "no memory left for the faults of a bus");
    }
    /* Each fault of this bus goes to its wire or becomes a rule of the port */
    for (size_t i = 0; i < count; i++) {
        const struct fault *fault = faults_at(config->faults, i);

        if (fault->target != FAULT_BUS || fault->index != bus) {
            continue;
        }
        if (fault->kind == FAULT_ERROR_BURST || fault->kind == FAULT_ID_COLLISION) {
            injection->wire[i].wire = config->wire[bus];
            on_wire++;
        } else {
            rule[made.nrule++] = (struct fault_port_rule){
                .kind = fault_port_kind_of(fault->kind),
                .probability = fault->value[0],
                .delay_ns = fault->kind == FAULT_LATE ? (int64_t)(fault->value[0] * 1e9) : 0,
                .id = fault->id,
                .active = &fault->active,
                .stream = fault->name,
            };
        }
    }
    if (on_wire > WIRE_FAULTS_MAX) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "bus %s: found %zu faults that its wire carries out, expected at most %d",
                         config->rig->bus[bus].name, on_wire, WIRE_FAULTS_MAX);
    }

    /* A bus without rules keeps its port */
    if (made.nrule == 0) {
        return ERROR_NONE;
    }
    code = fault_port_create(&made, arena, &injection->port[bus], error);
    if (code) {
        return code;
    }
    *port = injection->port[bus];
    return ERROR_NONE;
}

enum error_code fault_injection_create(const struct fault_injection_config *config,
                                       struct arena *arena, struct bus_ports *ports,
                                       struct fault_injection **out, struct error *error)
{
    struct fault_injection *injection = arena_alloc(arena, 1, sizeof *injection);
    size_t count = faults_count(config->faults);
    enum error_code code = ERROR_NONE;

    if (!injection || !(injection->wire = arena_alloc(arena, count + 1, sizeof *injection->wire))) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu faults", count);
    }
    injection->config = *config;
    for (size_t i = 0; i < count; i++) {
        injection->wire[i].armed = -1;
    }
    for (size_t b = 0; b < ports->count; b++) {
        code = injection_create_port(injection, b, arena, &ports->port[b], error);
        if (code) {
            return code;
        }
    }
    *out = injection;
    return ERROR_NONE;
}

/* ---- motors, valves and supplies ---- */

/* Returns the drive condition that a fault causes; 0 = none. */
static unsigned fault_drive_condition(enum fault_kind kind)
{
    switch (kind) {
    case FAULT_OPEN_PHASE:
        return DRIVE_OPEN_PHASE;
    case FAULT_SHORT:
        return DRIVE_SHORT;
    case FAULT_JAM:
        return DRIVE_JAM;
    case FAULT_SPRING_BREAK:
        return DRIVE_SPRING_BREAK;
    default:
        return 0;
    }
}

/* Adds the effect of a fault on a valve or cylinder. pressure: supply pressure at which a leak's
 * flow is given, Pa. */
static void break_valve(const struct fault *fault, double pressure, struct motor_command *motor)
{
    switch (fault->kind) {
    case FAULT_OFF:
        motor->condition |= DRIVE_VALVE_OFF;
        break;
    case FAULT_STUCK:
        motor->condition |= DRIVE_VALVE_STUCK;
        break;
    case FAULT_SHIFTED:
        motor->valve_shift += fault->value[0];
        break;
    default:
        motor->piston_leak += fault->value[0] / pressure;
        break;
    }
}

/* Adds the effect of a fault on the hydraulic supply. pressure: supply pressure at which a leak's
 * flow is given, Pa. */
static void break_hydraulic_supply(const struct fault *fault, double pressure,
                                   struct hydraulic_supply_condition *oil)
{
    switch (fault->kind) {
    case FAULT_PUMP_LOSS:
        oil->pump_loss = fmin(1.0, oil->pump_loss + fault->value[0]);
        break;
    case FAULT_LEAK:
        oil->leak += fault->value[0] / pressure;
        break;
    default:
        oil->relief_shut = true;
        break;
    }
}

/* Sets the virtual time of the fault ports. */
static void injection_set_port_time(struct fault_injection *injection)
{
    for (size_t b = 0; b < RIG_BUSES_MAX; b++) {
        if (injection->port[b]) {
            fault_port_time(injection->port[b], injection->now_ns);
        }
    }
}

size_t fault_injection_hear(struct fault_injection *injection, size_t bus,
                            const struct bus_frame *frame, struct bus_frame out[2])
{
    if (injection->port[bus]) {
        return fault_port_hear(injection->port[bus], frame, out);
    }
    out[0] = *frame;
    return 1;
}

void fault_injection_restored(struct fault_injection *injection)
{
    injection_set_port_time(injection);
}

void fault_injection_step(struct fault_injection *injection, int64_t now_ns)
{
    size_t count = faults_count(injection->config.faults);

    if (count == 0) {
        return;
    }
    injection->now_ns = now_ns;
    faults_step(injection->config.faults, now_ns);

    /* Clears the plant's command and writes all active faults of drives, valves and supplies to
     * it */
    const double pressure = injection->config.rig->robot->hydraulic_supply.pressure;
    struct plant_command *command = injection->config.command;

    command->supply_sag_v = 0.0;
    command->oil = (struct hydraulic_supply_condition){0};
    for (size_t j = 0; j < command->njoint; j++) {
        command->motor[j].condition = 0;
        command->motor[j].valve_shift = command->motor[j].piston_leak = 0.0;
    }
    for (size_t i = 0; i < faults_count(injection->config.faults); i++) {
        const struct fault *fault = faults_at(injection->config.faults, i);

        if (fault->active && fault->target == FAULT_MOTOR) {
            command->motor[fault->index].condition |= fault_drive_condition(fault->kind);
        } else if (fault->active && fault->target == FAULT_SUPPLY) {
            command->supply_sag_v +=
                fault->kind == FAULT_SURGE ? -fault->value[0] : fault->value[0];
        } else if (fault->active && fault->target == FAULT_VALVE) {
            break_valve(fault, pressure, &command->motor[fault->index]);
        } else if (fault->active && fault->target == FAULT_HYDRAULIC_SUPPLY) {
            break_hydraulic_supply(fault, pressure, &command->oil);
        }
    }
    for (size_t i = 0; i < count; i++) {
        if (injection->wire[i].wire) {
            /* Arms a wire's fault at its start, and removes it at its end */
            const struct fault *fault = faults_at(injection->config.faults, i);
            struct wire_injection *state = &injection->wire[i];
            bool begins = fault->active && !state->was_active,
                 ends = !fault->active && state->was_active;

            state->was_active = fault->active;
            if (begins) {
                const struct wire_fault noise = {
                    .kind = fault->kind == FAULT_ERROR_BURST ? WIRE_FAULT_CORRUPT
                                                             : WIRE_FAULT_COLLISION,
                    .node = WIRE_ANY,
                    .receiver = WIRE_ANY,
                    .id = fault->id >= 0 ? (uint32_t)fault->id : 0,
                    .id_mask = fault->id >= 0 ? UINT32_MAX : 0,
                    .probability = fault->value[0],
                    .from_ns = injection->now_ns,
                };

                state->armed = wire_inject(state->wire, &noise);
            }
            if (ends && state->armed >= 0) {
                wire_heal(state->wire, state->armed);
                state->armed = -1;
            }
        }
    }
    injection_set_port_time(injection);
}
