/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The DBC database of a bus of a rig: a node for the host and each board, every message that they
 * exchange (boards/messages.h) and the lockstep frames. Not RT-safe.
 *
 * What the boards' tables leave to the rig is worked out: encoder ticks and rotor angles become
 * radians of the joint, PWM counts percent of the supply, STRAIN channels N and Nm. Commands of a
 * class are one message, multiplexed by byte 0; on icub motor boards each command has two values,
 * one an axis. A name is DBC_NAME_MAX letters at most: the words of a command that make it longer
 * are cut short, all alike.
 */
#ifndef RIG_DBC_H
#define RIG_DBC_H

#include "canbus/dbc.h"
#include "rig/rig.h"

/* Makes the database of a bus; everything lives in arena. */
enum error_code rig_dbc(const struct rig *rig, size_t bus, struct arena *arena, struct dbc **dbc,
                        struct error *error);

#endif
