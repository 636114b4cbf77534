/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a client of a bus needs beside its DBC, which has one message for each identifier and knows
 * no roles: of a protocol file the frames, states and laws, the meaning of each field, and which
 * frames discover, configure, switch and command. As JSON, for the client libraries. Not RT-safe.
 */
#ifndef RIG_CLIENT_TABLE_H
#define RIG_CLIENT_TABLE_H

#include "rig/rig.h"

#include <stdio.h>

/* Writes the table of a bus; null for a protocol that no file describes. */
void rig_client_table(const struct rig *rig, size_t bus, FILE *out);

#endif
