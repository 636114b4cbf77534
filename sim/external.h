/* SPDX-License-Identifier: Apache-2.0 */
/*
 * External boards: real ones on the buses, beside the simulator's. Their frames are read with the
 * codec of the host (tasks/host.h), and the motors of their joints follow what they say:
 *
 *   an angle (that of the rotor, the link's where the frames tell no other): the rotor goes there,
 *   through a low-pass filter whose time constant is the time between the last two frames; with a
 *   frame a tick it is there at the end of the tick. It stays within the joint's range;
 *   a torque, where the rig says so: the rotor goes to where the spring, with its damping, exerts
 *   it on the link, the mean over the tick. It is bounded by the drive's stall torque;
 *   the rotor is no faster than the drive without load at the supply's voltage. Before the first
 *   frame, after a silence, and while the rig clamps the links it stands still.
 *
 * The spring between rotor and link is the model's. State lives in the arena, a checkpoint holds
 * it. SI units, link side of the gear, virtual time in ns.
 */
#ifndef SIM_EXTERNAL_H
#define SIM_EXTERNAL_H

#include "model/plant.h"
#include "rig/rig.h"

struct external;

/* Creates the listener; *external stays NULL if the rig has no external board. With boards and
 * plant both NULL it only listens, and external_control must not be called. Memory from arena;
 * the rest is borrowed. Not RT-safe. ERROR_MEMORY, ERROR_INPUT. */
enum error_code external_create(const struct rig *rig, struct boards *boards, struct plant *plant,
                                struct arena *arena, struct external **external,
                                struct error *error);

/* Reads a frame that has arrived, whoever sent it. RT-safe. */
void external_receive(struct external *external, int64_t now_ns, size_t bus,
                      const struct bus_frame *frame);

/* Returns when an external board (index in the rig's boards) last sent telemetry; -1 = never.
 * RT-safe. */
int64_t external_heard_ns(const struct external *external, size_t board);

/* Sets, before the plant steps, how the rotors of external boards move in the coming tick.
 * RT-safe. */
void external_control(struct external *external, int64_t now_ns);

#endif
