/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Faults in a running simulator: joins the table of faults/faults.h with the parts that carry
 * faults out. Boards and sensors read the table themselves; motors and the supply get them through
 * the plant's command, buses through a port with rules (canbus/fault_port.h), wires through faults
 * of their own. Virtual times in ns.
 */
#ifndef SIM_FAULT_INJECTION_H
#define SIM_FAULT_INJECTION_H

#include "faults/faults.h"
#include "rig/rig.h"
#include "sim/buses.h"

struct fault_injection_config {
    const struct rig *rig;
    struct faults *faults;
    struct plant_command *command;
    struct wire *const *wire; /* by bus; NULL where a bus is none */
};

struct fault_injection;

/* Creates the injection; the ports of buses that have faults are replaced in *ports by others in
 * front of them. Memory from arena; the rest is borrowed. ERROR_MEMORY, ERROR_UNSUPPORTED. Not
 * RT-safe. */
enum error_code fault_injection_create(const struct fault_injection_config *config,
                                       struct arena *arena, struct bus_ports *ports,
                                       struct fault_injection **injection, struct error *error);

/* Begins and ends faults as their windows open and close, at the beginning of the tick at
 * now_ns. Called with the same time again it changes only what was switched meanwhile. RT-safe. */
void fault_injection_step(struct fault_injection *injection, int64_t now_ns);

/* Updates counters and states of the ports after a checkpoint was restored. RT-safe. */
void fault_injection_restored(struct fault_injection *injection);

#endif
