/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Shared by the boards of a described protocol: the table, telemetry and replies; and the state of
 * motor boards. RT-safe except for functions that create.
 */
#ifndef BOARDS_DESCRIBED_PRIVATE_H
#define BOARDS_DESCRIBED_PRIVATE_H

#include "boards/board_private.h"
#include "boards/described/board.h"
#include "boards/described/protocol.h"
#include "boards/motor_control.h"

struct described_motor;

/* Axis of a slot. */
struct described_slot {
    struct described_motor *motor;
    unsigned axis;
};

struct described_bus {
    struct board_bus bus;
    struct described_slot slot[DESCRIBED_SLOTS];
    unsigned slots;
    /* Of frames from the host with a counter: the last count and 1, by number; 0: none yet */
    uint32_t heard[DESCRIBED_FRAMES_MAX][DESCRIBED_SLOTS];
};

struct described_node;

/* A kind of node beyond what every board has. */
struct described_node_ops {
    unsigned kind; /* enum described_kind */
    /* Computes what a field of an axis, 0 where there are none, carries: a value in its unit, or
     * a count (return true). */
    bool (*source)(const struct described_node *node, unsigned axis,
                   const struct described_field *field, double *value, int64_t *count);
    uint32_t (*faults)(const struct described_node *node, unsigned axis);
    int (*state)(const struct described_node *node, unsigned axis);
};

/* State of an axis, or a sensor, when a frame last told of it, and the number of frames that
 * have counted. */
struct described_report {
    int state;
    uint32_t faults, sent;
};

struct described_node {
    struct board board;
    const struct described_node_ops *ops;
    const struct described_protocol *protocol;
    unsigned axes, first_slot; /* axes: 0 of sensors */
    bool powered;
    int64_t telemetry_ms, started_ns, next_ns;
    double supply_v, oil_pa; /* oil: of a motor board */
    uint32_t sequence;       /* telemetry periods so far */
    struct described_report report[DESCRIBED_AXES][DESCRIBED_FRAMES_MAX];
};

/* Returns the described bus of a bus. */
static inline struct described_bus *described_bus_of(const struct board_bus *bus)
{
    return container_of(bus, struct described_bus, bus);
}

/* Returns the node of a board of a described bus, each of which is one. */
static inline struct described_node *described_node_of(const struct board *board)
{
    return container_of(board, struct described_node, board);
}

/* ---- node.c ---- */

/* Powers up a node; returns true at the first time. */
bool described_node_power_up(struct described_node *node);

/* Forgets the counts of the frames that the host has sent to a board: after its restart any may
 * come (bus.c). */
void described_bus_forget_counts(struct described_bus *bus, const struct described_node *node);

/* Sends the frames that tell of a restart. */
void described_node_announce(struct described_node *node);

/* Sends the periodic frames. */
void described_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink);

/* Queues the frame that answers request, whose counts are values. */
void described_node_reply(struct described_node *node, unsigned axis,
                          const struct described_frame *request, const int64_t *values);

/* Sets the telemetry period from now on; 0 = never. */
void described_node_set_period(struct described_node *node, int64_t period_ms);

/* ---- motor boards ---- */

enum { DESCRIBED_TARGETS = DESCRIBED_TO_KD - DESCRIBED_SET_POINT + 1 };

struct described_axis {
    int state, law;                   /* law: that the host has selected */
    uint32_t latched;                 /* faults that have opened the bridge */
    uint32_t faults;                  /* these and the present ones */
    double target[DESCRIBED_TARGETS]; /* by meaning from DESCRIBED_SET_POINT on; SI */
    int64_t command_ns;
    uint32_t commands; /* taken */
    double setting[DESCRIBED_SETTINGS_END - DESCRIBED_SETTING];
    double wanted_a;        /* of the current loop; 0 while it does not run */
    double kp_v_a, ki_v_as; /* of the current loop; 0: the rig says nothing of the winding */
    double integral_v, integral_nm, overload_ms, voltage_v;
    double motor_rad, link_rad, before_rad, velocity_rad_s, zero_rad;
    double current_a, torque_nm;
    double pressure_bar[2], valve_opening;
    int32_t temperature_c;
    bool bad_motor, bad_link, bad_torque;
};

struct described_motor {
    struct described_node node;
    struct described_axis axis[DESCRIBED_AXES];
    int64_t sampled_ms;
    bool started;
};

/* Returns the motor board of a board. */
static inline struct described_motor *described_motor_of(const struct board *board)
{
    return container_of(board, struct described_motor, node.board);
}

/* Returns the number of an axis on its board. */
static inline unsigned described_axis_index(const struct board *board,
                                            const struct described_axis *axis)
{
    return (unsigned)(axis - described_motor_of(board)->axis);
}

/* Returns a setting of an axis. */
static inline double described_axis_setting(const struct described_axis *axis,
                                            enum described_meaning setting)
{
    return axis->setting[setting - DESCRIBED_SETTING];
}

/* Returns the law in force. */
enum described_law described_axis_law(const struct described_protocol *protocol,
                                      const struct described_axis *axis);

/* Returns whether the bridge is on with a law. */
static inline bool described_law_drives(enum described_law law)
{
    return law != DESCRIBED_OFF && law != DESCRIBED_FAULT;
}

/* Obeys a host's frame for an axis; its counts, values, have been checked. False: it asks for a
 * law that the axis does not have, and nothing changes. */
bool described_axis_obey(struct board *board, unsigned axis, const struct described_frame *frame,
                         const int64_t *values);

/* Runs one millisecond of an axis: its bridge voltage (laws.c). */
void described_axis_step(const struct board *board, struct described_axis *axis);

/* Forgets set-points, integrals and overload. */
void described_axis_forget(const struct board *board, struct described_axis *axis);

#endif
