/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A protocol as a module. struct protocol is the interface between the program and a protocol of
 * the boards. Each folder of boards/ that is a module fills one struct protocol, and
 * boards/protocol_list.h lists them. No other code depends on a particular protocol. Capabilities
 * are data, behavior is functions. A function may be NULL where its comment says so.
 *
 * The tables are immutable. No function here is RT-safe: the loop uses the functions of the buses
 * and boards (boards/board_private.h).
 */
#ifndef BOARDS_PROTOCOL_H
#define BOARDS_PROTOCOL_H

#include "boards/messages.h"

#include <stdio.h>

struct board;
struct board_ops;
struct board_bus_ops;

/* How `coman-hil import` lays out a rig for an imported robot. */
struct protocol_bench {
    /* axes per bus, beside an F/T board, for a bus load of at most 80 %; 0 = not offered */
    uint8_t bus_axes;
    uint8_t board_axes; /* axes per motor board */
    /* torque address: used with protocol.torque_boards */
    uint8_t ft_address, torque_address;
    const char *ft_period_s, *torque_period_s; /* text as in a rig file */
    const char *command_period_s;              /* command period of the host */
    /* further lines for the rig's key motors; NULL = none */
    const char *motors;
};

struct protocol {
    const char *name;    /* name in the rig's keys and the program's options */
    const char *summary; /* one line that describes the boards */

    /* Limits of addresses and axes. slots_max: most axes on a bus that numbers its axes
     * consecutively; 0 = limited only by the number of boards */
    uint8_t motor_address_max, address_max;
    uint8_t axes_max; /* axes of a motor board, at most BOARD_AXES_MAX */
    uint8_t slots_max;
    bool spare_axes;    /* a motor board may have an axis without a joint */
    bool torque_boards; /* has boards that report joint torques (BOARD_TORQUE) */
    bool switches;      /* motor boards support limit and home switches (struct board_switches) */
    bool canfd;         /* frames may be CAN FD */
    bool canfd_only;    /* frames must be CAN FD */
    bool motors_only;   /* has no pure sensor boards */
    bool no_valves;     /* its boards cannot move servo valves */
    bool padded;        /* commands may be padded to 8 bytes */
    /* a host can read the frames without configuring the boards; real boards may therefore be on
     * the bus */
    bool external;
    bool external_torque; /* as external, and motor boards report joint torques */
    /* a file that the rig names describes the protocol (boards_bus_config.described) */
    bool needs_file;

    /* time of the boards' answers, unless the rig has another; ignored if needs_file */
    struct board_reply_time reply;

    /* Text of the built-in protocol files, for classic CAN and CAN FD; NULL = none */
    const char *text, *text_fd;

    /* Functions and sizes of a bus, and of boards by enum board_kind (boards/board_private.h) */
    const struct board_bus_ops *bus;
    const struct board_ops *board[BOARD_INERTIAL + 1];

    /* Gets the last firmware download (boards_firmware). NULL = the bootloader accepts none. */
    bool (*firmware)(const struct board *board, struct board_firmware *firmware);

    /* Visit the messages from the host to all boards, and the messages of one board, whose axes
     * have the slots from first_slot on. */
    void (*visit_broadcasts)(struct message_walk *walk);
    void (*visit_board)(struct message_walk *walk, int board, unsigned first_slot);

    /* Corrects the quantity of a field that boards_describe_field derives from the table. NULL = no
     * corrections. */
    void (*describe_field)(const struct boards_config *config, int bus,
                           const struct message_field *field, struct field_subject *subject);

    /* Write a note to text on a message, or on a field, for facts that the table cannot express; ""
     * = no note. `field` counts the fields of the data, then those of the identifier, without
     * padding. NULL = no notes. */
    void (*comment_message)(const struct message *message, char *text, size_t size);
    void (*note_field)(const struct message *message, size_t field, char *text, size_t size);

    /* Returns whether the protocol uses an 11-bit identifier on this bus. bus NULL = on the buses
     * of any rig. If so, writes to text which message uses it and which identifiers are free. NULL
     * = never in use. */
    bool (*claims_id)(const struct boards_bus_config *bus, uint32_t id, char *text, size_t size);

    /* Visit the periodic frames of a board, and of the host, in the worst case. NULL = the load
     * consists of the messages that have a cycle. */
    void (*visit_board_load)(struct load_walk *walk, const struct board_config *board);
    void (*visit_command_load)(struct load_walk *walk);

    /* Names for the log and the pages. mode_name returns "unknown" for an unknown mode. fault_names
     * are in the order of the bits and end with NULL. */
    const char *(*mode_name)(uint32_t mode);
    const char *const *fault_names;
    /* Writes an event with the names from the bus's protocol file. Returns false for an event that
     * the file does not name. NULL = the common texts are used for all events. */
    bool (*describe_event)(const struct boards_bus_config *bus, const struct board_event *event,
                           char *text, size_t size);
    bool modes_are_states;    /* modes are states of the drive; no command selects one */
    const char *timeout_text; /* log text: what happens after a command time-out */
    /* log text after the position of BOARD_EVENT_LIMIT: unit and consequence */
    const char *limit_text;

    /* The protocol's page. sections: titles by message.section, terminated by NULL. sections NULL =
     * the default titles of enum message_section. print_appendix NULL = no appendix. */
    const char *help;
    const char *const *sections;
    void (*print_appendix)(FILE *out);

    /* Writes the object dictionary of a board as an electronic data sheet (CiA 306) named `name`.
     * Write errors stay in `out`. NULL = the boards have no dictionary. */
    enum error_code (*write_eds)(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

    struct protocol_bench bench, bench_fd; /* for classic CAN, for CAN FD */
};

#endif
