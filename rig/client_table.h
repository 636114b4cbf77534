/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data that a client of a bus needs in addition to the bus's DBC. A DBC has one message for each
 * identifier, and it does not say what a message is for. For a protocol file, this table has the
 * frames, the states, the laws and the meaning of each field. It also lists the frames that
 * discover, configure, switch and command boards. The format is JSON, for the client libraries. Not
 * RT-safe.
 */
#ifndef RIG_CLIENT_TABLE_H
#define RIG_CLIENT_TABLE_H

#include "rig/rig.h"

#include <stdio.h>

/* Writes the table of a bus. Writes null if no file describes the bus's protocol. */
void rig_client_table(const struct rig *rig, size_t bus, FILE *out);

#endif
