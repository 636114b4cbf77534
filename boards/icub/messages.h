/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions common to the protocols with iCub motor boards (icub, foc): messages, the STRAIN and
 * inertial boards on the same bus, names and identifiers. Not RT-safe.
 */
#ifndef BOARDS_ICUB_MESSAGES_H
#define BOARDS_ICUB_MESSAGES_H

#include "boards/icub/table.h"
#include "boards/protocol.h"

/* Properties in which the motor boards of icub and foc differ. */
struct icub_dialect {
    const struct icub_frame_type *frames; /* class 1, indexed by type */
    const struct icub_command *commands;  /* class 0 */
    bool axis_bit;                        /* commands select one of two axes */
    int host_frame;                       /* class 1 type that the host sends; -1 = none */
    /* class 1 type with a cycle that depends on the address; -1 = none */
    int spread_frame;
    /* Returns the cycle of a class 1 type; 0 = none */
    uint32_t (*cycle_ns)(const struct board_config *board, unsigned type);
};

/* Visit DISCOVER; visit all messages of a board. */
void icub_visit_discovery(struct message_walk *walk);
void icub_visit_messages(struct message_walk *walk, int board, const struct icub_dialect *dialect);

/* Sections of the printed protocol: index of class 1, and all titles. */
enum { ICUB_SECTION_TELEMETRY };
extern const char *const icub_sections[];

/* Returns the board that sends or receives a message; NULL = all boards. */
const struct board_config *icub_message_board(const struct boards_config *config,
                                              const struct message *message);

/* Describes a channel of a STRAIN board: unit and scale, computed from the full scale. */
void icub_describe_channel(const struct boards_config *config, const struct message_field *field,
                           struct field_subject *subject);

/* Visits the periodic frames of a STRAIN or an inertial board. */
void icub_visit_sensor_load(struct load_walk *walk, const struct board_config *board);

bool icub_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text, size_t size);
const char *icub_mode_name(uint32_t mode);

bool icub_firmware(const struct board *board, struct board_firmware *firmware);

/* Members common to the protocols of iCub boards. The delay of replies is an assumption, because no
 * measured delay has been published. */
#define ICUB_MEMBERS(motor)                                                                        \
    .address_max = ICUB_ADDRESS_MAX, .torque_boards = true, .padded = true, .external = true,      \
    .reply = {.delay_ns = 100000}, .bus = &icub_bus_ops,                                           \
    .board = {[BOARD_MOTOR] = motor,                                                               \
              [BOARD_FT] = &ft_icub_ops.base,                                                      \
              [BOARD_TORQUE] = &torque_icub_ops.base,                                              \
              [BOARD_INERTIAL] = &inertial_icub_ops.base},                                         \
    .firmware = icub_firmware, .claims_id = icub_claims_id, .mode_name = icub_mode_name,           \
    .limit_text = "ticks, voltage set to 0", .sections = icub_sections

#endif
