/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The DBC database of one bus of a rig. It has a node for the host and for each board, all messages
 * between them (boards/messages.h), and the lockstep frames. Not RT-safe.
 *
 * Units that depend on the rig are converted. Encoder ticks and rotor angles become radians of the
 * joint. PWM counts become percent of the supply. STRAIN channels become N and Nm.
 *
 * The commands of a class are one message, multiplexed by byte 0. On icub motor boards each command
 * has two values, one per axis. A name has at most DBC_NAME_MAX letters. In a longer command name,
 * all words are shortened equally.
 */
#ifndef RIG_DBC_H
#define RIG_DBC_H

#include "canbus/dbc.h"
#include "rig/rig.h"

/* Makes the database of a bus. The arena owns all memory. */
enum error_code rig_dbc(const struct rig *rig, size_t bus, struct arena *arena, struct dbc **dbc,
                        struct error *error);

#endif
