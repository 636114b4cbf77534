/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message of the compact protocol as a table: its number space, lengths and fields. The
 * boards build and read frames from these rows, and an export of the protocol (DBC) reads the same
 * rows. Immutable; RT-safe.
 */
#ifndef BOARDS_COMPACT_TABLE_H
#define BOARDS_COMPACT_TABLE_H

#include "boards/compact/protocol.h"
#include "boards/field.h"

/* Meaning of the low five bits of an identifier. */
enum compact_number { COMPACT_BY_NONE, COMPACT_BY_SLOT, COMPACT_BY_GROUP, COMPACT_BY_NODE };

struct compact_message {
    const char *name;
    enum compact_function function;
    enum compact_number by;
    bool from_host;
    uint8_t length;     /* without repetition */
    uint8_t repeats;    /* how often fields may follow each other, 1 or more */
    uint16_t period_ms; /* as the boards send it unless set otherwise; 0: on demand */
    const struct field *fields;
};

enum { COMPACT_MESSAGES = 19 };
extern const struct compact_message compact_messages[COMPACT_MESSAGES];

/* Returns the row of a function; NULL when there is none. */
const struct compact_message *compact_message(unsigned function);

extern const struct field_value compact_mode_names[];

#endif
