/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message that a rig's buses can carry between boards and host, one after the other, out of
 * the tables that the boards work from: what an export of the protocol (DBC) writes down. Pure
 * functions of the configuration; not RT-safe.
 */
#ifndef BOARDS_MESSAGES_H
#define BOARDS_MESSAGES_H

#include "boards/board.h"
#include "boards/field.h"

enum { MESSAGE_NO_BOARD = -1, MESSAGE_NO_CODE = -1 };

/*
 * A message of a command class comes once for every command: they share identifier and length of
 * the frame, and byte 0 (code) tells which it is; the fields begin at byte 1. Other messages have
 * no code. On icub motor boards bit 7 of the code is the axis.
 */
struct message {
    const char *name;
    uint32_t id;
    uint32_t id_mask; /* described: bits of the identifier that fields in it fill, here 0 */
    bool fd, extended, remote, bit_rate_switch; /* bit_rate_switch: with fd */
    int sender, receiver; /* index of a board, MESSAGE_NO_BOARD: the host, or as receiver all */
    bool from_host;
    uint8_t length;    /* longest, of the whole frame */
    uint8_t shortest;  /* of commands; 0: as length */
    int code;          /* byte 0, MESSAGE_NO_CODE: none */
    uint32_t cycle_ns; /* 0: on demand; at most so often while it has its usual policy */
    const struct field *fields;
    const struct field *id_fields; /* described: in the identifier, from bit 0 on; NULL: none */
    uint8_t first_byte;            /* where the fields begin */
    uint8_t repeats;               /* how often the fields follow each other, 1 or more */
    int slot; /* compact, cia402, described: of the axis that it is about, or of the
                         * first of those whose fields follow each other; else -1 */
};

/* Calls visit for each message of a bus, in the order of board, class and code; those of the host
 * to all boards first. Stops when visit returns false. */
void boards_messages(const struct boards_config *config, int bus,
                     bool (*visit)(void *context, const struct message *message), void *context);

#endif
