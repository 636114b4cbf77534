/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A protocol as a module: all that the rest of the program knows of what the boards of a bus speak.
 * Each folder of boards/ fills one struct protocol, boards/protocol_list.h lists them, and nobody
 * else asks which one a bus has. What a protocol can do is data, how it does it is a function; NULL
 * stands where a protocol has nothing to add, as the line above says.
 *
 * The tables are immutable. No function here is RT-safe: the loop works with the functions of the
 * boards and buses that make_bus and make_board have made (boards/board_private.h).
 */
#ifndef BOARDS_PROTOCOL_H
#define BOARDS_PROTOCOL_H

#include "boards/board.h"
#include "boards/messages.h"

#include <stdio.h>

struct board;
struct board_bus;

/* How `coman-hil import` lays out the bench of a robot that it reads. */
struct protocol_bench {
    uint8_t bus_axes;   /* that load a bus to four fifths at most, with an F/T board beside them;
                         * 0: not offered */
    uint8_t board_axes; /* of a motor board */
    uint8_t ft_address, torque_address;        /* torque: with protocol.torque_boards */
    const char *ft_period_s, *torque_period_s; /* as a rig file writes them */
    const char *command_period_s;              /* of the host */
    const char *motors;                        /* further lines of the key motors; NULL: none */
};

struct protocol {
    const char *name;    /* as the keys and options named personality have it */
    const char *summary; /* what such boards are, in a line */

    /* What it can address and carry. slots_max: axes of a bus where they are numbered through; 0:
     * as many as there are boards for */
    uint8_t motor_address_max, address_max;
    uint8_t axes_max; /* of a motor board, BOARD_AXES_MAX or less */
    uint8_t slots_max;
    bool spare_axes;      /* an axis of a motor board may be without a joint */
    bool torque_boards;   /* it has boards that tell the torques of joints (BOARD_TORQUE) */
    bool switches;        /* motor boards know limit and home switches (struct board_switches) */
    bool canfd;           /* its frames may be CAN FD ones */
    bool canfd_only;      /* and do not fit into others */
    bool motors_only;     /* it has no boards with sensors alone */
    bool padded;          /* its commands may be padded to 8 bytes */
    bool external;        /* a host reads its frames without having configured the boards, so that
                           * real ones can stand on the bus */
    bool external_torque; /* and whose motor boards tell the torque of their joints */
    bool needs_file;      /* a file that the rig names describes it (boards_bus_config.described) */

    /* The text of the files that describe it, on classic CAN and on CAN FD; NULL: none */
    const char *text, *text_fd;

    /* Both return NULL without memory. The configuration was checked (boards/config_check.c). */
    struct board_bus *(*make_bus)(struct arena *arena);
    struct board *(*make_board)(const struct board_config *config, struct arena *arena);

    /* Checks what the limits above do not say; NULL: nothing. */
    enum error_code (*check_board)(const struct boards_bus_config *bus,
                                   const struct board_config *board, struct error *error);

    /* What a host has downloaded (boards_firmware); NULL: its bootloader takes nothing. */
    bool (*firmware)(const struct board *board, struct board_firmware *firmware);

    /* Visits the messages from the host to all boards, then those of each board, whose axes have
     * slots from first_slot on. */
    void (*visit_broadcasts)(struct message_walk *walk);
    void (*visit_board)(struct message_walk *walk, int board, unsigned first_slot);

    /* Corrects what the table of fields says of one (boards_describe_field); NULL: nothing. */
    void (*describe_field)(const struct boards_config *config, int bus,
                           const struct message_field *field, struct field_subject *subject);

    /* Writes what fields cannot say of a message; "" = nothing. note_field: of a field of it, by
     * its index in data and identifier, padding aside. NULL: never anything. */
    void (*comment_message)(const struct message *message, char *text, size_t size);
    void (*note_field)(const struct message *message, size_t field, char *text, size_t size);

    /* Whether an 11-bit identifier is taken, on a bus of this protocol or, with NULL, on all
     * buses of every rig; text then says by whom and what is free. NULL: never. */
    bool (*claims_id)(const struct boards_bus_config *bus, uint32_t id, char *text, size_t size);

    /* Visits the frames that come again and again, at the worst, of a board and of the host. NULL:
     * they are the messages with a cycle. */
    void (*visit_board_load)(struct load_walk *walk, const struct board_config *board);
    void (*visit_command_load)(struct load_walk *walk);

    /* Words for the log and the pages. mode_name: "unknown" where there is no such mode;
     * fault_names: by bit, NULL at the end. */
    const char *(*mode_name)(uint32_t mode);
    const char *const *fault_names;
    bool modes_are_states;    /* of a drive, which no command bears */
    const char *timeout_text; /* what a command that timed out leads to */
    const char *limit_text;   /* behind a position beyond its limit: its unit and what follows */

    /* The page of the protocol. sections: titles, by message.section, NULL at the end; NULL: those
     * of enum message_section. print_appendix: NULL: none. */
    const char *help;
    const char *const *sections;
    void (*print_appendix)(FILE *out);

    /* Writes the object dictionary of a board as an electronic data sheet (CiA 306) that is called
     * name; write errors stay with out. NULL: its boards have none. */
    enum error_code (*write_eds)(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

    struct protocol_bench bench, bench_fd; /* on classic CAN, on CAN FD */
};

#endif
