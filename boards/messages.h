/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message that a rig's buses can carry between boards and host, one after the other, out of
 * the tables that the boards work from: what an export of the protocol (DBC) or a page on it writes
 * down. Pure functions of the configuration; not RT-safe.
 */
#ifndef BOARDS_MESSAGES_H
#define BOARDS_MESSAGES_H

#include "boards/board.h"
#include "boards/field.h"

enum { MESSAGE_NO_BOARD = -1, MESSAGE_NO_CODE = -1 };

/* Bit of the code that tells the second axis from the first, of messages with axis_bit. */
enum { MESSAGE_AXIS_BIT = 0x80 };

/* What the number in an identifier counts. */
enum message_number {
    MESSAGE_OF_ADDRESS,
    MESSAGE_OF_NODE, /* the same where a board is called a node */
    MESSAGE_OF_SLOT, /* axes of the bus, numbered through */
    MESSAGE_OF_GROUP /* of slots */
};

/* Sections of the page of a protocol that names none. */
enum message_section { MESSAGE_FROM_HOST, MESSAGE_FROM_BOARDS };

/*
 * A message of a command class comes once for every command: they share identifier and length of
 * the frame, and byte 0 (code) tells which it is; the fields begin at byte 1. Other messages have
 * no code.
 */
struct message {
    const char *name;
    uint32_t id;
    uint32_t id_mask; /* bits of the identifier that fields in it fill, here 0 */
    /* id is base + step * number, and on nodes with PDOs for each axis axis_step * axis more */
    uint32_t base, step, axis_step;
    unsigned number;
    enum message_number counts;
    bool fd, extended, remote, bit_rate_switch; /* bit_rate_switch: with fd */
    int sender, receiver; /* index of a board, MESSAGE_NO_BOARD: the host, or as receiver all */
    bool from_host;
    uint8_t length;     /* longest, of the whole frame */
    uint8_t shortest;   /* of commands; 0: as length */
    int code;           /* byte 0, MESSAGE_NO_CODE: none */
    bool axis_bit;      /* the command is one of two axes: MESSAGE_AXIS_BIT of the code */
    const char *family; /* what the commands with this identifier are called together */
    const char *answer; /* name of the message that answers; NULL: none, or that with the code */
    uint8_t section;    /* of the page (struct protocol) */
    uint32_t cycle_ns;  /* 0: on demand; at most so often while it has its usual policy */
    bool cycle_varies;  /* with the address */
    bool constant;      /* all that it says is which it is */
    const void *row;    /* of the protocol's table, for its own functions; NULL: none */
    const struct field *fields;
    const struct field *id_fields; /* in the identifier, from bit 0 on; NULL: none */
    uint8_t first_byte;            /* where the fields begin */
    uint8_t repeats;               /* how often the fields follow each other, 1 or more */
    int slot;  /* of the axis that it is about, or of the first of those of a list; -1: none */
    bool list; /* the fields follow each other for one axis after the other */
};

/* Calls visit for each message of a bus, in the order of board, class and code; those of the host
 * to all boards first. Stops when visit returns false. */
void boards_messages(const struct boards_config *config, int bus,
                     bool (*visit)(void *context, const struct message *message), void *context);

/* A walk under way, as a protocol's functions get it; they hand on each message by message_visit.
 */
struct message_walk {
    const struct boards_config *config;
    const struct boards_bus_config *bus;
    bool (*visit)(void *context, const struct message *message);
    void *context;
    unsigned slots; /* axes of the bus */
    bool going;     /* visit wants more */
};

void message_visit(struct message_walk *walk, const struct message *message);

/* ---- what fields are about ---- */

/* A field of a message. */
struct message_field {
    const struct message *message;
    const struct field *field;
    int index;  /* of the field in its list, padding aside */
    int repeat; /* of message->repeats */
    int code;   /* value of byte 0, MESSAGE_NO_CODE: none */
};

/* The subject of a field, and what a count of it is worth: count * scale + offset in unit. */
struct field_subject {
    const struct board_axis_config *axis; /* NULL: of no axis */
    int channel;                          /* of a force-torque or torque board; -1: of none */
    double scale, offset;
    const char *unit; /* "": a bare number */
};

void boards_describe_field(const struct boards_config *config, int bus,
                           const struct message_field *field, struct field_subject *subject);

/* Returns the slot of a board's first axis. */
unsigned boards_first_slot(const struct boards_config *config, int board);

/* ---- load ---- */

/* A frame that comes again and again. */
struct load_frame {
    uint8_t flags; /* of canbus/frame.h */
    uint8_t length;
    double period_s;
    bool from_host;
};

/* Calls visit for each frame that comes again and again, at the worst: of the boards, then of a
 * host that commands every command_period_s where the protocol lets it choose. */
void boards_load(const struct boards_config *config, int bus, double command_period_s,
                 void (*visit)(void *context, const struct load_frame *frame), void *context);

/* A walk under way, as a protocol's functions get it. */
struct load_walk {
    const struct boards_config *config;
    const struct boards_bus_config *bus;
    int index; /* of the bus */
    void (*visit)(void *context, const struct load_frame *frame);
    void *context;
    double tick_s;           /* but not below the millisecond of the boards */
    double command_period_s; /* of the host */
    bool from_host;          /* what is visited now */
};

/* Visits a frame in the format of the bus, and one of a length that it does not have (CAN FD). */
void load_visit(const struct load_walk *walk, unsigned length, double period_s);

/* Returns the period that a host asks of a board's telemetry: the rig's, or else the tick. */
double load_period_s(const struct load_walk *walk, int64_t period_ns);

/* Return the number of axes of a board that have a joint; of the whole bus. */
unsigned load_axes(const struct board_config *board);
unsigned load_bus_axes(const struct load_walk *walk);

#endif
