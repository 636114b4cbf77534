/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Fault injection in a running simulator: connects the table of faults/faults.h with the parts that
 * implement faults. Boards and sensors read the table themselves. Motors and supply get faults
 * through the plant's command, buses through a port with rules (canbus/fault_port.h), wires through
 * their own fault functions. Virtual times in ns.
 */
#ifndef SIM_FAULT_INJECTION_H
#define SIM_FAULT_INJECTION_H

#include "faults/faults.h"
#include "sim/buses.h"

struct fault_injection_config {
    const struct rig *rig;
    struct faults *faults;
    struct plant_command *command;
    struct wire *const *wire; /* by bus; NULL for a bus without wire */
};

struct fault_injection;

/* Creates the injection. In *ports, replaces the port of each bus with faults by a fault port that
 * wraps it. Memory from arena; the rest is borrowed. ERROR_MEMORY, ERROR_UNSUPPORTED. Not
 * RT-safe. */
enum error_code fault_injection_create(const struct fault_injection_config *config,
                                       struct arena *arena, struct bus_ports *ports,
                                       struct fault_injection **injection, struct error *error);

/* Starts and ends faults by their time windows, at the start of the tick at now_ns. A second call
 * with the same time applies only the faults that were switched after the first call. RT-safe. */
void fault_injection_step(struct fault_injection *injection, int64_t now_ns);

/* Applies the faults of a bus to a frame that its wire hands to the boards. Writes up to two frames
 * to out and returns their number. RT-safe. */
size_t fault_injection_hear(struct fault_injection *injection, size_t bus,
                            const struct bus_frame *frame, struct bus_frame out[2]);

/* Updates counters and states of the ports after a checkpoint is restored. RT-safe. */
void fault_injection_restored(struct fault_injection *injection);

#endif
