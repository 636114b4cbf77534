/* SPDX-License-Identifier: Apache-2.0 */
/* The protocols that boards speak, and how they are found. Immutable; RT-safe but for
 * protocols_list. */
#ifndef BOARDS_PROTOCOL_LIST_H
#define BOARDS_PROTOCOL_LIST_H

#include "base/yaml.h"
#include "boards/protocol.h"
#include "list/protocols.h"

/* PROTOCOLS(LINE) is the list, made by the build: each folder NAME of boards/ that is a module
 * fills protocol_NAME, whose name is NAME. The first is what a bus speaks of which nothing else is
 * said. */
#define PROTOCOL_DECLARE(NAME) extern const struct protocol protocol_##NAME;
PROTOCOLS(PROTOCOL_DECLARE)
#undef PROTOCOL_DECLARE

/* Returns the index-th protocol of the list, from 0; NULL from its end on. */
const struct protocol *protocol_at(size_t index);

/* Returns the protocol of that name; NULL when there is none. */
const struct protocol *protocol_find(const char *name);

/* The words of the list with their index, as a schema takes them. */
extern const struct word protocol_words[];

/* Writes which protocols have a capability: "icub, compact or foc". capability is the offset of a
 * bool in struct protocol. Returns text. */
const char *protocols_list(size_t capability, char *text, size_t size);

#endif
