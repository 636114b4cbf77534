/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the protocols and finds them by name or index. Immutable; RT-safe except protocols_list. */
#ifndef BOARDS_PROTOCOL_LIST_H
#define BOARDS_PROTOCOL_LIST_H

#include "base/yaml.h"
#include "boards/protocol.h"
#include "list/protocols.h"

/* PROTOCOLS(LINE) is the list, which the build generates. Each folder NAME of boards/ that is a
 * module defines the struct protocol_NAME, and NAME is its name. The first entry is the default. */
#define PROTOCOL_DECLARE(NAME) extern const struct protocol protocol_##NAME;
PROTOCOLS(PROTOCOL_DECLARE)
#undef PROTOCOL_DECLARE

/* Returns entry `index` of the list, from 0; NULL beyond its end. */
const struct protocol *protocol_at(size_t index);

/* Returns the protocol with this name; NULL = none. */
const struct protocol *protocol_find(const char *name);

/* Writes the names of the set fault bits, separated by commas. */
void protocol_list_faults(const struct protocol *protocol, uint32_t bits, char *text, size_t size);

/* Names of the protocols with their index, for the schema of a rig's key. */
extern const struct word protocol_words[];

/* Writes the names of the protocols that have a capability: "icub, compact or foc". capability is
 * the offset of a bool in struct protocol. Returns text. */
const char *protocols_list(size_t capability, char *text, size_t size);

#endif
