/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Shared by the parts of the exporter of a rig's DBC database: dbc.c writes nodes and messages,
 * dbc_names.c names things, dbc_signals.c writes signals with their units. Not RT-safe.
 */
#ifndef RIG_DBC_PRIVATE_H
#define RIG_DBC_PRIVATE_H

#include "boards/protocol.h"
#include "rig/dbc.h"

enum { HOST = 0, SIMULATOR = 1, FIRST_BOARD = 2 }; /* nodes */
enum { IDS = 0x800, NAME_SIZE = DBC_NAME_MAX + 1 };

struct dbc_exporter {
    const struct rig *rig;
    size_t bus;
    const struct protocol *protocol;
    struct dbc *dbc;
    struct error *error;
    enum error_code code;
    uint8_t longest[IDS]; /* frame of an identifier */
    bool constants;       /* in turn now: messages without values */
};

/* Field that becomes a signal. */
struct dbc_field {
    struct message_field of;
    struct field_subject subject;
    unsigned bit;          /* where it starts in the frame */
    const char *joint;     /* that it is about; NULL = none */
    const char *quantity;  /* of the joint; the field's name but for torque sensors */
    const char *component; /* of a force-torque sensor: "fx" to "mz"; NULL = none */
};

/* ---- dbc_names.c ---- */

/* Returns the board that a message is from or for; NULL = all. */
const struct board_config *dbc_message_board(const struct dbc_exporter *e,
                                             const struct message *message);

/* Returns the node of a board, by its index in the rig. */
int dbc_board_node(const struct dbc_exporter *e, int board);

/* Makes a board's name an identifier that no other node has. */
void dbc_make_node_name(const struct dbc *dbc, const char *board, char name[NAME_SIZE]);
void dbc_make_message_name(const struct dbc_exporter *e, const struct message *message,
                           char name[NAME_SIZE]);
/* Makes a name that no other signal of to has: JOINT_QUANTITY for values of a joint that a board
 * sends and for targets of all boards in one frame, the component of a force-torque sensor, else
 * as in the boards' tables. */
void dbc_make_signal_name(const struct dbc_exporter *e, const struct dbc_message *to,
                          const struct dbc_field *p, char name[NAME_SIZE]);

/* ---- dbc_signals.c ---- */

/* Returns the nodes that a message is for, as a bit set. */
uint64_t dbc_message_receivers(const struct dbc_exporter *e, const struct message *message);

/* Writes the fields of a message as signals; command: the value of byte 0 that selects them, or
 * MESSAGE_NO_CODE. */
void dbc_export_fields(struct dbc_exporter *e, struct dbc_message *to,
                       const struct message *message, int command);

#endif
