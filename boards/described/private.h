/* SPDX-License-Identifier: Apache-2.0 */
/* The boards of a described protocol. bus.c finds the receivers of a frame. node.c sends frames.
 * motor_board.c and sensor_board.c implement the boards. RT-safe, except functions that create an
 * object. */
#ifndef BOARDS_DESCRIBED_PRIVATE_H
#define BOARDS_DESCRIBED_PRIVATE_H

#include "boards/board_private.h"
#include "boards/described/protocol.h"

struct described_node;

/* The axis at a slot. */
struct described_slot {
    struct described_node *node;
    unsigned axis;
};

struct described_bus {
    struct board_bus bus;
    struct described_slot slot[DESCRIBED_SLOTS];
    unsigned slots;
    /* Last counter value + 1 of each frame from the host, by frame and number; 0 = none yet */
    uint32_t heard[DESCRIBED_FRAMES_MAX][BOARD_ADDRESSES];
};

enum {
    DESCRIBED_TARGETS = DESCRIBED_TARGETS_END - DESCRIBED_SET_POINT,
    DESCRIBED_CHANNELS = DESCRIBED_MEANINGS - DESCRIBED_CHANNEL,
};

/* An axis. A sensor board has one axis and uses only its state and its faults. */
struct described_axis {
    struct axis base;                 /* base.mode: the law in force, or the fault law */
    int state, law;                   /* law: selected by the host */
    int64_t result;                   /* result of the last requested state */
    int64_t entered_ns;               /* time of the last change of state */
    enum described_law active;        /* the law in force */
    uint32_t latched;                 /* faults that opened the bridge */
    uint32_t present;                 /* faults in the last tick */
    uint32_t faults;                  /* faults that the axis reports */
    double target[DESCRIBED_TARGETS]; /* SI; index: meaning - DESCRIBED_SET_POINT */
    int64_t command_ns;
    uint32_t commands; /* number of commands received */
    double setting[DESCRIBED_SETTINGS_END - DESCRIBED_SETTING];
    double integral_nm, zero_rad;
    int32_t temperature_c;
};

/* State of an axis or a sensor in its last report, and the number of frames that reported it. */
struct described_report {
    int state;
    int64_t result;
    uint32_t faults, sent;
};

struct described_node {
    struct board board;
    const struct described_protocol *protocol;
    unsigned kind;             /* enum described_kind */
    unsigned axes, first_slot; /* axes: number of axes, 0 for sensors */
    bool powered;
    int64_t telemetry_ms, started_ns, next_ns;
    uint32_t sequence; /* number of telemetry periods */
    struct described_axis axis[DESCRIBED_AXES];
    /* channels of a sensor; index: meaning - DESCRIBED_CHANNEL */
    double channel[DESCRIBED_CHANNELS];
    uint32_t saturated; /* one bit per channel of a sensor */
    uint32_t host_number, answer_id;
    /* By axis and parameter: values of DESCRIBED_STORED; values that a restart restores */
    uint32_t stored[DESCRIBED_AXES][DESCRIBED_PARAMETERS_MAX];
    uint32_t kept[DESCRIBED_AXES][DESCRIBED_PARAMETERS_MAX];
    bool is_kept[DESCRIBED_AXES][DESCRIBED_PARAMETERS_MAX];
    struct described_report report[DESCRIBED_AXES][DESCRIBED_FRAMES_MAX];
};

/* Returns a bus as a described bus. */
static inline struct described_bus *described_bus_of(const struct board_bus *bus)
{
    return container_of(bus, struct described_bus, bus);
}

/* Returns a board as a described node. */
static inline struct described_node *described_node_of(const struct board *board)
{
    return container_of(board, struct described_node, board);
}

/* Returns the kind of a board. */
static inline unsigned described_kind(enum board_kind kind)
{
    return kind == BOARD_MOTOR ? DESCRIBED_MOTOR
           : kind == BOARD_FT  ? DESCRIBED_FT
                               : DESCRIBED_INERTIAL;
}

/* Returns the index of a kind in arrays by kind. */
static inline unsigned described_kind_index(unsigned kind)
{
    return kind >> 1;
}

/* ---- node.c ---- */

/* Powers up a node. Returns true the first time. */
bool described_node_power_up(struct described_node *node);

/* Resets the counters of the host's frames to a board, so that any count is valid. Called when
 * the board restarts (bus.c). */
void described_bus_forget_counts(struct described_bus *bus, const struct described_node *node);

/* Sends the frames that report a restart. */
void described_node_announce(struct described_node *node);

/* Sends the periodic frames. */
void described_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink);

/* Queues frame `index` for an axis. request: the frame to be answered, with its counts `values`;
 * NULL = no answer. */
void described_node_answer(struct described_node *node, unsigned axis, size_t index,
                           const struct described_frame *request, const int64_t *values);

/* Returns the count of a field for an axis. request: the frame to be answered, with its counts
 * `values`; NULL = no answer. */
int64_t described_node_count(const struct described_node *node, unsigned axis,
                             const struct described_field *field,
                             const struct described_frame *request, const int64_t *values);

/* Returns the value of a count, with the present value of the field's factor. */
double described_node_value(const struct described_node *node, unsigned axis,
                            const struct described_field *field, int64_t count);

/* Sets the telemetry period; 0 = no telemetry. */
void described_node_set_period(struct described_node *node, int64_t period_ms);

/* ---- for protocol.c ---- */

/* Creates a bus; NULL = out of memory. Not RT-safe. */
extern const struct board_bus_ops described_bus_ops;

extern const struct board_ops described_motor_ops, described_ft_ops, described_inertial_ops;

/* ---- axes (motor_board.c) ---- */

/* Obeys a host's frame for an axis. values: the checked counts of the frame. Changes nothing and
 * returns false if the axis lacks the requested law. */
bool described_axis_obey(struct described_node *node, unsigned axis,
                         const struct described_frame *frame, const int64_t *values);

/* Returns the current limit of an axis, A. */
double described_axis_current_limit(const struct described_node *node, unsigned axis);

/* Returns whether the bridge of an axis is on. */
static inline bool described_axis_runs(const struct described_axis *axis)
{
    return axis->active != DESCRIBED_OFF && axis->active != DESCRIBED_FAULT;
}

#endif
