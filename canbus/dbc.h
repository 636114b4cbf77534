/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A DBC database: the meaning of the frames on one bus, in the text format of CAN tools (nodes,
 * messages, signals, multiplexing, value tables, comments, cycle times, CAN FD). The caller adds
 * entries one by one; each entry is checked when it is added. dbc_write writes the database as
 * plain ASCII, with the attributes below. Not RT-safe.
 *
 *   GenMsgCycleTime  of a message, ms; 0 = on demand
 *   VFrameFormat     of a message: StandardCAN, ExtendedCAN, StandardCAN_FD, ExtendedCAN_FD
 *   IdentifierMask   of a message: identifier bits that carry values; these bits are 0 in the
 *                    written identifier; 0 = none. Ours; tools show it.
 *   FrameLength      of a multiplexed signal: length of its frame, if the frames of the message
 *                    differ in length; 0 = length of the message. Ours; tools show it.
 *   SystemNodeLongSymbol, SystemMessageLongSymbol, SystemSignalLongSymbol  the whole name, if it is
 *                    longer than DBC_NAME_MAX or was shortened for another reason
 *   DBName, BusType, Baudrate, BaudrateCANFD  of the database
 */
#ifndef CANBUS_DBC_H
#define CANBUS_DBC_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"

#include <stdio.h>

enum {
    DBC_NAME_MAX = 32,  /* longest name; a name is a C identifier */
    DBC_TEXT_MAX = 255, /* longest unit, value name or comment: printable ASCII without " and \ */
    DBC_NODES_MAX = 64,
    DBC_MESSAGES_MAX = 2048,
    DBC_SIGNALS_MAX = 4096, /* signals per message */
    DBC_VALUES_MAX = 512,   /* value names per signal */
    DBC_CYCLE_MAX_MS = 3600000,
};

enum { DBC_NO_NODE = -1 };

#define DBC_EXTENDED                                                                               \
    UINT32_C(0x80000000) /* flag in an identifier: it has 29 bits, as in the file format */

enum dbc_role { DBC_PLAIN, DBC_MULTIPLEXOR, DBC_MULTIPLEXED };
enum dbc_type { DBC_UNSIGNED, DBC_SIGNED, DBC_FLOAT };

/* The name of one raw value of a signal. */
struct dbc_value {
    struct dbc_value *next;
    int64_t number;
    const char *text;
};

struct dbc_signal {
    struct dbc_signal *next;
    const char *name;
    enum dbc_role role;
    uint32_t selector; /* DBC_MULTIPLEXED: present when the multiplexor has this value */
    /* Bit 8 i + j is bit j (0 = least significant) of byte i. Little-endian signals start at their
     * least significant bit, big-endian ones at their most significant bit */
    uint16_t start;
    uint8_t bits; /* 1 to 64, DBC_FLOAT 32 */
    bool big_endian;
    enum dbc_type type;
    double scale, offset, min, max; /* value = raw * scale + offset; min = max = 0: no limits */
    const char *unit;               /* "" = none */
    uint64_t receivers;             /* bit i = node i */
    uint8_t frame_length;           /* FrameLength */
    const char *comment;            /* NULL = none */
    const char *long_name;          /* NULL = none */
    struct dbc_value *value;        /* linked list; NULL = plain numbers */
    struct dbc_value *last_value;
    size_t nvalue;
};

struct dbc_message {
    struct dbc_message *next;
    uint32_t id;      /* 11 bits, or 29 and DBC_EXTENDED */
    uint32_t id_mask; /* IdentifierMask */
    const char *name;
    bool fd;
    uint8_t length;
    int sender; /* index of a node; DBC_NO_NODE = none */
    uint32_t cycle_ms;
    const char *comment;       /* NULL = none */
    const char *long_name;     /* NULL = none */
    struct dbc_signal *signal; /* linked list */
    struct dbc_signal *last_signal;
    const struct dbc_signal *multiplexor; /* NULL = none */
    size_t nsignal;
};

struct dbc_node {
    const char *name;
    const char *comment;   /* NULL = none */
    const char *long_name; /* NULL = none */
};

struct dbc {
    struct arena *arena; /* owns all memory */
    const char *name;
    const char *comment; /* NULL = none */
    bool fd;
    int64_t bitrate, data_bitrate; /* bit/s; data_bitrate 0 without fd */
    struct dbc_node node[DBC_NODES_MAX];
    size_t nnode;
    struct dbc_message *message; /* linked list */
    struct dbc_message *last_message;
    size_t nmessage;
};

/* Creates an empty database in arena; copies its name. NULL = out of memory. */
struct dbc *dbc_create(struct arena *arena, const char *name);

/*
 * Add a copy of an entry, including its strings. Lists, comments and counts of the copy start
 * empty. The message of ERROR_INPUT names the found and the expected value. A message with more
 * than 8 bytes is FD. A signal lies within its message and shares no bit with another signal of the
 * same frame. Add the multiplexor before the signals that it selects.
 */
enum error_code dbc_add_node(struct dbc *dbc, const char *name, struct error *error);
enum error_code dbc_add_message(struct dbc *dbc, const struct dbc_message *message,
                                struct dbc_message **added, struct error *error);
enum error_code dbc_add_signal(struct dbc *dbc, struct dbc_message *message,
                               const struct dbc_signal *signal, struct dbc_signal **added,
                               struct error *error);
enum error_code dbc_add_value(struct dbc *dbc, struct dbc_signal *signal, int64_t number,
                              const char *text, struct error *error);

/* Copies text into a comment or a long name. Each can be set only once. */
enum error_code dbc_set_comment(struct dbc *dbc, const char **comment, const char *text,
                                struct error *error);

/* Checks whether a name is valid: a C identifier of at most DBC_NAME_MAX characters that is not a
 * DBC keyword. */
bool dbc_is_name(const char *name);

int dbc_find_node(const struct dbc *dbc, const char *name); /* DBC_NO_NODE = none */
struct dbc_message *dbc_find_message(const struct dbc *dbc, uint32_t id);
struct dbc_signal *dbc_find_signal(const struct dbc_message *message, const char *name);

/* Returns the position of bit k of a signal, in the numbering of `start`; 0 = the least significant
 * bit, k < bits. */
unsigned dbc_bit(const struct dbc_signal *signal, unsigned k);

/* Finds the message of a frame by its identifier, ignoring bits that carry values; NULL = none. */
const struct dbc_message *dbc_find_frame(const struct dbc *dbc, const struct bus_frame *frame);

/* Reads a signal from a frame of its message. Returns false when the frame does not contain it: too
 * short, or another multiplexor value. */
bool dbc_read_signal(const struct dbc_message *message, const struct dbc_signal *signal,
                     const struct bus_frame *frame, double *value);

/* Writes a database as text. Equal databases give equal bytes. */
enum error_code dbc_write(const struct dbc *dbc, FILE *file, struct error *error);

#endif
