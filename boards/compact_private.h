/* SPDX-License-Identifier: Apache-2.0 */
/* What the boards of a compact bus share: telemetry period, identity, parameters of the board. */
#ifndef BOARDS_COMPACT_PRIVATE_H
#define BOARDS_COMPACT_PRIVATE_H

#include "boards/board_private.h"
#include "boards/compact_table.h"

/* Settings that SAVE keeps over a restart. */
struct compact_settings {
    int64_t telemetry_ms, timeout_ms;
};

struct compact_node {
    struct compact_settings settings, saved;
    bool is_saved, powered;
    int64_t started_ns; /* when the application began */
    int64_t next_ns;    /* telemetry */
    int64_t state_ms;   /* STATE frames up to here have been sent */
};

/* Settings of the first power-up, or what was saved. Returns true at the first. */
bool compact_node_power_up(struct board *board, struct compact_node *node);

/* Telemetry is due in this transmission. */
bool compact_node_due(const struct board *board, struct compact_node *node);

/* A STATE frame is due that comes every COMPACT_STATE_PERIOD_MS, by a phase of its own. */
bool compact_state_due(struct ms_span span, unsigned phase);

/* Queues IDENTITY. */
void compact_identify(struct board *board);

/* A parameter of the board as a whole; COMPACT_UNKNOWN_PARAMETER when it is not one of these. */
enum compact_result compact_node_parameter(struct board *board, struct compact_node *node,
                                           unsigned parameter, bool write, int64_t *value);

/* Builds a frame from the row of its function and sends it. */
void compact_send(struct board *board, struct frame_sink *sink, enum compact_function function,
                  unsigned number, const int64_t *values);

/* A motor board's axis gets its mode or set-point. */
void compact_motor_mode(struct board *board, unsigned axis, enum compact_mode mode);
void compact_motor_command(struct board *board, unsigned axis, int16_t set_point);

/* First slot of a motor board. */
unsigned compact_first_slot(const struct board *board);

#endif
