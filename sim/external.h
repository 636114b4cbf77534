/* SPDX-License-Identifier: Apache-2.0 */
/*
 * External boards: real boards on the buses, in addition to simulated ones. The codec of the host
 * (tasks/host.h) reads their frames, and the rotors of their joints follow the reported values:
 *
 *   angle (of the rotor, or of the link if the frames have no rotor angle): the rotor moves to it
 *   through a low-pass filter. Its time constant is the time between the last two frames; with one
 *   frame per tick the rotor arrives at the end of the tick. It stays within the joint's range;
 *   torque, if the rig chooses it: the rotor moves to where spring and spring damping exert this
 *   torque on the link, as a mean over the tick. The torque is limited to the drive's stall torque;
 *   the rotor's speed is limited to the drive's no-load speed at the supply voltage. The rotor
 *   stands still before the first frame, after a timeout, and while the rig clamps the links.
 *
 * The spring between rotor and link is the model's. The state is in the arena and part of
 * checkpoints. SI units, link side of the gear, virtual time in ns.
 */
#ifndef SIM_EXTERNAL_H
#define SIM_EXTERNAL_H

#include "model/plant.h"
#include "rig/rig.h"

struct external;

/* Creates the listener; *external stays NULL if the rig has no external board. If boards and plant
 * are both NULL, it only listens, and external_control must not be called. Memory from arena; the
 * rest is borrowed. Not RT-safe. ERROR_MEMORY, ERROR_INPUT. */
enum error_code external_create(const struct rig *rig, struct boards *boards, struct plant *plant,
                                struct arena *arena, struct external **external,
                                struct error *error);

/* Reads a received frame from any sender. RT-safe. */
void external_receive(struct external *external, int64_t now_ns, size_t bus,
                      const struct bus_frame *frame);

/* Returns the time of the last telemetry of an external board (index in the rig's boards); -1 =
 * never. RT-safe. */
int64_t external_heard_ns(const struct external *external, size_t board);

/* Sets the motion of external boards' rotors in the coming tick; call it before the plant steps.
 * RT-safe. */
void external_control(struct external *external, int64_t now_ns);

#endif
