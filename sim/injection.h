/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Faults in a running simulator: the table of boards/faults.h joined with what carries it out. The
 * boards and their sensors look at the table themselves; motors and the supply are told through the
 * plant's command, buses through a port with rules, wires through their own faults.
 */
#ifndef SIM_INJECTION_H
#define SIM_INJECTION_H

#include "boards/faults.h"
#include "sim/buses.h"
#include "rig/rig.h"

struct injection_config {
    const struct rig *rig;
    struct faults *faults;
    struct plant_command *command;
    struct wire *const *wire; /* by bus; NULL where a bus is none */
};

struct injection;

/* Ports of buses that have faults are replaced in *ports by others in front of them. Memory from
 * arena. Not RT-safe. */
enum error_code injection_create(const struct injection_config *config, struct arena *arena,
                                 struct bus_ports *ports, struct injection **injection,
                                 struct error *error);

/* Before the tick that begins at time_ns, virtual: windows open and close, faults begin and end.
 * RT-safe. */
void injection_step(struct injection *injection, int64_t time_ns);

/* All that moves has gone back to an earlier time: what the ports count and say follows. RT-safe. */
void injection_went_back(struct injection *injection);

#endif
