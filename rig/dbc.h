/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The DBC database of a bus of a rig. It has a node for the host and each board, all messages that
 * they exchange (boards/messages.h), and the lockstep frames. Not RT-safe.
 *
 * Units that depend on the rig are converted: encoder ticks and rotor angles to radians of the
 * joint, PWM counts to percent of the supply, STRAIN channels to N and Nm. The commands of a class
 * are one message, multiplexed by byte 0. On icub motor boards each command has two values, one per
 * axis. A name has at most DBC_NAME_MAX letters: if a command's name is longer, all its words are
 * shortened equally.
 */
#ifndef RIG_DBC_H
#define RIG_DBC_H

#include "canbus/dbc.h"
#include "rig/rig.h"

/* Makes the database of a bus; the arena owns all memory. */
enum error_code rig_dbc(const struct rig *rig, size_t bus, struct arena *arena, struct dbc **dbc,
                        struct error *error);

#endif
