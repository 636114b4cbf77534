/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions that the protocols with iCub motor boards (icub, foc) have in common: their messages,
 * the STRAIN and inertial boards beside the motors, words and identifiers. Not RT-safe.
 */
#ifndef BOARDS_ICUB_MESSAGES_H
#define BOARDS_ICUB_MESSAGES_H

#include "boards/icub/table.h"
#include "boards/protocol.h"

/* What tells the motor boards of one protocol from those of the other. */
struct icub_dialect {
    const struct icub_frame_type *frames; /* class 1, by type */
    const struct icub_command *commands;  /* class 0 */
    bool axis_bit;                        /* a command is for one of two axes */
    int host_frame;                       /* type of class 1 that the host sends; -1: none */
    int spread_frame;                     /* whose cycle varies with the address; -1: none */
    uint32_t (*cycle_ns)(const struct board_config *board, unsigned type); /* of class 1 */
};

/* DISCOVER; the messages of a board. */
void icub_visit_discovery(struct message_walk *walk);
void icub_visit_messages(struct message_walk *walk, int board, const struct icub_dialect *dialect);

/* Section of the page that class 1 has; titles of all. */
enum { ICUB_SECTION_TELEMETRY };
extern const char *const icub_sections[];

/* Returns the board that a message is from or for; NULL: all. */
const struct board_config *icub_message_board(const struct boards_config *config,
                                              const struct message *message);

/* Describes channels of the STRAIN boards: their unit and scale, by the full scale. */
void icub_describe_channel(const struct boards_config *config, const struct message_field *field,
                           struct field_subject *subject);

/* Visits the frames of a STRAIN or an inertial board that come again and again. */
void icub_visit_sensor_load(struct load_walk *walk, const struct board_config *board);

bool icub_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text, size_t size);
const char *icub_mode_name(uint32_t mode);

/* Creates a STRAIN or an inertial board; NULL without memory. */
struct board *icub_make_sensor(const struct board_config *config, struct arena *arena);
bool icub_firmware(const struct board *board, struct board_firmware *firmware);

#endif
