/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lists every message that a rig's buses can carry between boards and host, from the tables that
 * the boards use. The DBC export and the protocol pages use this list. Pure functions of the
 * configuration; not RT-safe.
 */
#ifndef BOARDS_MESSAGES_H
#define BOARDS_MESSAGES_H

#include "boards/board.h"
#include "boards/field.h"

enum { MESSAGE_NO_BOARD = -1, MESSAGE_NO_CODE = -1 };

/* Bit of the code that selects the second axis, in messages with axis_bit. */
enum { MESSAGE_AXIS_BIT = 0x80 };

/* Meaning of the number in an identifier. */
enum message_number {
    MESSAGE_OF_ADDRESS,
    MESSAGE_OF_NODE, /* address of a board, where boards are called nodes */
    MESSAGE_OF_SLOT, /* axes of the bus, numbered consecutively */
    MESSAGE_OF_GROUP /* groups of slots */
};

/* Default sections of a protocol's page. */
enum message_section { MESSAGE_FROM_HOST, MESSAGE_FROM_BOARDS };

/*
 * A message. A command class has one message per command. They share the identifier and the frame
 * length; byte 0 (code) selects the command, and the fields begin at byte 1. Other messages have no
 * code.
 */
struct message {
    const char *name;
    uint32_t id;
    uint32_t id_mask; /* identifier bits that hold fields; 0 in base */
    /* id = base + step * number; on nodes with PDOs, + axis_step * axis */
    uint32_t base, step, axis_step;
    unsigned number;
    enum message_number counts;
    bool fd, extended, remote, bit_rate_switch; /* bit_rate_switch: only with fd */
    int sender, receiver; /* index of a board; MESSAGE_NO_BOARD = host, as receiver all boards */
    bool from_host;
    uint8_t length;     /* longest frame, bytes */
    uint8_t shortest;   /* shortest command, bytes; 0 = same as length */
    int code;           /* value of byte 0; MESSAGE_NO_CODE = none */
    bool axis_bit;      /* the command has an axis: MESSAGE_AXIS_BIT of the code */
    const char *family; /* common name of the commands with this identifier */
    /* name of the answer; NULL = no answer, or an answer with the same code */
    const char *answer;
    uint8_t section;   /* section of the page (struct protocol) */
    uint32_t cycle_ns; /* shortest period under the usual policy; 0 = on demand */
    bool cycle_varies; /* the period depends on the address */
    bool constant;     /* the message has no variable content */
    const void *row;   /* row of the protocol's table, for its own functions; NULL = none */
    const struct field *fields;
    const struct field *id_fields; /* fields in the identifier, from bit 0 up; NULL = none */
    uint8_t first_byte;            /* byte where the fields begin */
    uint8_t repeats;               /* how often the list of fields repeats, 1 or more */
    int slot;  /* slot of the message's axis, or of the first axis in a list; -1 = none */
    bool list; /* each repetition of the fields is for the next axis */
};

/* Calls visit for each message of a bus: first the messages from the host to all boards, then by
 * board, class and code. Stops when visit returns false. */
void boards_messages(const struct boards_config *config, int bus,
                     bool (*visit)(void *context, const struct message *message), void *context);

/* State of a walk over the messages of a bus. A protocol's functions pass each message to
 * message_visit. */
struct message_walk {
    const struct boards_config *config;
    const struct boards_bus_config *bus;
    bool (*visit)(void *context, const struct message *message);
    void *context;
    unsigned slots; /* number of axes on the boards visited so far */
    bool going;     /* visit has not returned false yet */
};

void message_visit(struct message_walk *walk, const struct message *message);

/* ---- meaning of fields ---- */

/* A field of a message. */
struct message_field {
    const struct message *message;
    const struct field *field;
    int index;  /* index of the field in its list, without padding */
    int repeat; /* index of the repetition, below message->repeats */
    int code;   /* value of byte 0; MESSAGE_NO_CODE = none */
};

/* The quantity of a field. One count is worth count * scale + offset in `unit`. */
struct field_subject {
    const struct board_axis_config *axis; /* NULL = no axis */
    int channel;                          /* channel of a force-torque or torque board; -1 = none */
    double scale, offset;
    const char *unit; /* "" = dimensionless */
};

void boards_describe_field(const struct boards_config *config, int bus,
                           const struct message_field *field, struct field_subject *subject);

/* Returns the slot of a board's first axis. */
unsigned boards_first_slot(const struct boards_config *config, int board);

/* ---- load ---- */

/* A periodic frame. */
struct load_frame {
    uint8_t flags; /* flags of canbus/frame.h */
    uint8_t length;
    double period_s;
    bool from_host;
};

/* Calls visit for each periodic frame in the worst case: first the frames of the boards, then those
 * of the host. command_period_s: command period of the host, used if the protocol leaves it to the
 * host. */
void boards_load(const struct boards_config *config, int bus, double command_period_s,
                 void (*visit)(void *context, const struct load_frame *frame), void *context);

/* State of a walk over the periodic frames of a bus, for a protocol's functions. */
struct load_walk {
    const struct boards_config *config;
    const struct boards_bus_config *bus;
    int index; /* index of the bus */
    void (*visit)(void *context, const struct load_frame *frame);
    void *context;
    double tick_s;           /* at least 1 ms, the period of the boards */
    double command_period_s; /* command period of the host */
    bool from_host;          /* the frames come from the host */
};

/* Visits a frame in the format of the bus. On CAN FD, rounds the length up to the next valid
 * one. */
void load_visit(const struct load_walk *walk, unsigned length, double period_s);

/* Returns the telemetry period that a host requests, s: period_ns from the rig, or the tick if
 * period_ns is 0. At least 1 ms. */
double load_period_s(const struct load_walk *walk, int64_t period_ns);

/* Return the number of axes with a joint: of a board, and of the whole bus. */
unsigned load_axes(const struct board_config *board);
unsigned load_bus_axes(const struct load_walk *walk);

#endif
