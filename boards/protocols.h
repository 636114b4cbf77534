/* SPDX-License-Identifier: Apache-2.0 */
/* The protocols that boards speak, and how they are found. Immutable; RT-safe but for
 * protocols_list. */
#ifndef BOARDS_PROTOCOLS_H
#define BOARDS_PROTOCOLS_H

#include "base/yaml.h"
#include "boards/protocol.h"

/* The list: the folder of that name fills protocol_NAME, whose name is NAME. The first is what a
 * bus speaks of which nothing else is said. */
#define PROTOCOLS(LINE)                                                                            \
    LINE(icub)                                                                                     \
    LINE(foc)                                                                                      \
    LINE(compact)                                                                                  \
    LINE(cia402)                                                                                   \
    LINE(described)

#define PROTOCOL_DECLARE(NAME) extern const struct protocol protocol_##NAME;
PROTOCOLS(PROTOCOL_DECLARE)
#undef PROTOCOL_DECLARE

/* Returns the index-th protocol of the list, from 0; NULL from its end on. */
const struct protocol *protocol_at(size_t index);

/* Returns the protocol of that name; NULL when there is none. */
const struct protocol *protocol_find(const char *name);

/* The words of the list with their index, as a schema takes them. */
extern const struct word protocol_words[];

/* Writes which protocols have a capability: "icub, foc or compact". capability is the offset of a
 * bool in struct protocol. Returns text. */
const char *protocols_list(size_t capability, char *text, size_t size);

#endif
