/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations that the boards of a compact bus share, each a node of it: telemetry period,
 * identity, parameters of the board; and the state of its motor boards. RT-safe but for what
 * creates.
 */
#ifndef BOARDS_COMPACT_PRIVATE_H
#define BOARDS_COMPACT_PRIVATE_H

#include "boards/board_private.h"
#include "boards/compact/board.h"
#include "boards/compact/table.h"
#include "boards/axis.h"

struct compact_node;
struct compact_motor;

/* The axis behind a slot. */
struct compact_slot {
    struct compact_motor *motor; /* NULL: none */
    unsigned axis;
};

struct compact_bus {
    struct board_bus bus;
    struct compact_slot slot[COMPACT_SLOTS];
    unsigned slots;
};

/* Settings that SAVE keeps over a restart. */
struct compact_settings {
    int64_t telemetry_ms, timeout_ms;
};

/* A kind of node beyond what every board has. */
struct compact_node_ops {
    /* Reads or writes a parameter; *value is the one in force afterwards. */
    enum compact_result (*parameter)(struct compact_node *node, unsigned parameter, unsigned axis,
                                     bool write, int64_t *value);
};

struct compact_node {
    struct board board;
    const struct compact_node_ops *ops;
    struct compact_settings settings, saved;
    bool is_saved, powered;
    int64_t started_ns; /* when the application began */
    int64_t next_ns;    /* telemetry */
};

static inline struct compact_bus *compact_bus_of(const struct board_bus *bus)
{
    return container_of(bus, struct compact_bus, bus);
}

/* Any board of a compact bus is one. */
static inline struct compact_node *compact_node_of(const struct board *board)
{
    return container_of(board, struct compact_node, board);
}

/* Restores the settings of the first power-up, or what was saved. Returns true at the first. */
bool compact_node_power_up(struct compact_node *node);

/* Returns whether telemetry is due in this transmission. */
bool compact_node_due(struct compact_node *node);

/* Returns whether a STATE frame is due that comes every COMPACT_STATE_PERIOD_MS, by a phase of
 * its own. */
bool compact_state_due(struct ms_span span, unsigned phase);

/* Queues IDENTITY. */
void compact_node_identify(struct compact_node *node);

/* Reads or writes a parameter of the board as a whole; COMPACT_UNKNOWN_PARAMETER when it is not
 * one of these. */
enum compact_result compact_node_access_parameter(struct compact_node *node, unsigned parameter,
                                                  bool write, int64_t *value);

/* Builds a frame from the row of its function and sends it. */
void compact_node_send(struct compact_node *node, struct frame_sink *sink,
                       enum compact_function function, unsigned number, const int64_t *values);

/* ---- motor boards ---- */

/* Temperature limit of the board where the rig gives none. */
enum { COMPACT_TEMPERATURE_MAX_C = 125 };

/* Settings that SAVE keeps. */
struct compact_axis_settings {
    int64_t current_limit_ma;
    int64_t min_position, max_position; /* 1e-5 rad */
    int64_t current_kp, current_ki;     /* mV/A, mV/(A s) */
    int64_t back_emf;                   /* mV s/rad */
    int64_t temperature_limit_c;
};

struct compact_axis {
    struct compact_axis_settings settings, saved;
    enum compact_mode mode;
    uint16_t latched; /* faults that have opened the bridge */
    uint16_t faults;  /* these and the present ones */
    int64_t set_point;
    int64_t command_ns;
    uint8_t commands; /* taken, modulo 16 */
    double integral_v, overload_ms, voltage_v;

    int32_t motor, link; /* 1e-5 rad */
    double motor_rad, before_rad, velocity_rad_s;
    double current_a, torque_nm;
    int32_t temperature_c;
    bool bad_motor, bad_link, bad_torque;

    uint8_t sequence;
    uint16_t reported_faults;
    enum compact_mode reported_mode;
};

struct compact_motor {
    struct compact_node node;
    struct compact_axis axis[BOARD_AXES_MAX];
    unsigned axes, first_slot;
    double supply_v;
    int64_t sampled_ms;
    bool started;
};

static inline struct compact_motor *compact_motor_of(const struct board *board)
{
    return container_of(board, struct compact_motor, node.board);
}

static inline bool compact_axis_runs(const struct compact_axis *axis)
{
    return axis->mode == COMPACT_VOLTAGE || axis->mode == COMPACT_CURRENT;
}

static inline unsigned compact_axis_index(const struct board *board,
                                          const struct compact_axis *axis)
{
    return (unsigned)(axis - compact_motor_of(board)->axis);
}

static inline int64_t compact_counts(double value, double worth)
{
    int32_t count = 0;

    control_quantize(value / worth, &count);
    return count;
}

static inline int64_t compact_temperature_limit(const struct board_axis_config *config)
{
    return config->temperature_limit_c > 0.0
               ? control_clamp(compact_counts(config->temperature_limit_c, 1.0), 1,
                               COMPACT_TEMPERATURE_MAX_C)
               : COMPACT_TEMPERATURE_MAX_C;
}

/* Reads or writes a parameter of a motor board (settings.c); see struct compact_node_ops. */
enum compact_result compact_motor_access_parameter(struct compact_node *node, unsigned parameter,
                                                   unsigned axis, bool write, int64_t *value);

/* Settings that may be changed beside the bus (settings.c). */
extern const struct board_settings compact_settings;

/* Give an axis its mode or set-point. */
/* Returns false when the axis has no such mode; it then stays in its own. */
bool compact_axis_command_mode(struct board *board, unsigned axis, enum compact_mode mode);
void compact_axis_command(struct board *board, unsigned axis, int16_t set_point);

/* Returns the first slot of a board; COMPACT_SLOTS when it has none. */
unsigned compact_first_slot(const struct board *board);

#endif
