/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data and functions that every board has, whatever it speaks: an address, a place on its bus,
 * answers that wait, a bootloader, faults. A protocol embeds struct board in the structure of each
 * kind of its boards and struct board_bus in that of its buses, and stands behind their tables of
 * functions; this header knows no protocol.
 *
 * Units: nanoseconds of virtual time since power-up unless a name says otherwise. All memory is the
 * arena's of boards_create. Everything here is RT-safe but what is said to create something.
 */
#ifndef BOARDS_BOARD_PRIVATE_H
#define BOARDS_BOARD_PRIVATE_H

#include "base/array.h"
#include "base/ring.h"
#include "boards/axis.h"
#include "boards/board.h"
#include "faults/faults.h"
#include "boards/protocol.h"

#include <math.h>
#include <stdint.h>

enum { MS = 1000000 }; /* nanoseconds */

struct board;
struct board_bus;
struct board_faults;
struct voltage_delay;

/* A run of milliseconds since power-up: from inclusive, to exclusive. */
struct ms_span {
    int64_t from, to;
};

/* Destination of the frames that boards_transmit collects. */
struct frame_sink {
    struct bus_frame *frames;
    size_t count, max;
    int64_t time_ns;
};

/* Identity of a board, as discovery tells it. */
struct board_identity {
    uint8_t type, major, minor, build;
};

/* A kind of board. */
struct board_ops {
    struct board_identity identity;
    size_t periodic_max; /* frames in a transmission at most */
    bool turns_field; /* the firmware commutates the motor: when it hangs the field stands still */

    void (*power_up)(struct board *board);
    /* Reads and quantizes the sensors, at the time boards->now_ns. */
    void (*sample)(struct board *board, const struct plant_sensors *sensors);
    /* One tick; span holds the milliseconds that it completes. NULL: no motors, as shut_down. */
    void (*control)(struct board *board, struct ms_span span);
    void (*transmit)(struct board *board, struct ms_span span, struct frame_sink *sink);
    /* A periodic frame of this board is on the bus, where others hear it. NULL: none listens. */
    void (*sent)(struct board *board, const struct bus_frame *frame);
    void (*shut_down)(struct board *board); /* opens the bridges; NULL: there are none */
    size_t axes, axis_size; /* offset of the first axis and size of each (boards/axis.h), where the
                             * board opens and closes their bridges; 0: none */
    const struct board_settings *settings; /* NULL: none */
};

/* The settings of a kind's axes (boards/board.h). The index is below count. */
struct board_settings {
    size_t count;
    void (*describe)(const struct board *board, unsigned axis, size_t index,
                     struct board_setting *setting);
    bool (*set)(struct board *board, unsigned axis, size_t index, double value);
};

/* Functions of a protocol for its buses. */
struct board_bus_ops {
    /* A board has got its address; before its power-up. NULL: nothing to do. */
    void (*add_board)(struct board_bus *bus, struct board *board);
    bool remote;   /* remote frames mean something */
    bool extended; /* so do identifiers of 29 bits */
    /* A frame with an identifier and a length that the bus allows. */
    void (*receive)(struct boards *boards, struct board_bus *bus, const struct bus_frame *frame);
};

struct queued_reply {
    struct board *board;
    bool lost; /* with the board's power */
    uint8_t flags, len;
    uint32_t id;
    uint8_t data[64];
};

enum { BOARD_ADDRESSES = 32 }; /* of all protocols; [0] is the host */

/* Embedded in the bus of each protocol. */
struct board_bus {
    const struct board_bus_ops *ops;
    struct boards_bus_config config;
    struct board *by_address[BOARD_ADDRESSES];
    uint16_t nodes;               /* boards: each is a CAN node of its own */
    struct queued_reply *replies; /* circular */
    size_t capacity, head, waiting;
    size_t transmit_max;
    size_t can_errors; /* boards whose CAN controller has any */
    int64_t sent_ms;   /* milliseconds whose periodic frames have been sent */
};

/* Embedded in the boards of each protocol. */
struct board {
    const struct board_ops *ops;
    struct boards *boards;
    struct board_bus *bus;
    struct board_config config; /* name points into the arena */
    uint16_t index;             /* in the configuration */
    uint16_t node;              /* of its frames: its number among the boards of its bus */
    uint8_t address;
    bool in_bootloader;
    bool away;                             /* a fault keeps it from the bus, or it is a real one */
    bool present, silence_told;            /* external: heard; that it is not has been told */
    uint32_t boots;                        /* how often it has entered the bootloader */
    int64_t application_ns;                /* in the bootloader until then */
    int64_t heard_ns;                      /* the last frame meant for it; -1 = none yet */
    unsigned replies;                      /* of this board, waiting */
    uint64_t lost;                         /* frames that it could not send */
    bool lost_in_status, lost_in_overflow; /* to be reported there */
    struct board_faults *faults;           /* NULL = it can have none (board_faults.c) */
    struct board_can_state can;
};

struct boards {
    struct boards_counters counters;
    struct ring events;
    int64_t tick_ns;
    /* Both are set by each phase from the now_ns of its caller: the time stamp of events, and what
     * a board's timers show. They differ in boards_control, which computes what the boards have
     * done by the end of the tick. */
    int64_t event_ns, now_ns;
    double supply_v, oil_pa; /* as sampled: numbers, 0 or more */
    uint64_t settings_changes;
    size_t nbus, nboard;
    struct board_bus **bus;
    struct board **board;
    struct voltage_delay *delay; /* NULL: voltages hold from the tick that sets them */
    void (*restarted)(void *context, int joint);
    void *context;
};

/* Returns the joint of an axis, -1 = none: a spare axis, or one that such a board does not have. */
static inline int board_joint(const struct board *board, size_t axis)
{
    return board->config.kind == BOARD_MOTOR && axis < board->bus->config.protocol->axes_max
               ? board->config.axis[axis].joint
               : -1;
}

/* Return the number of axes that a board embeds, spare ones too, and one of them. */
static inline unsigned board_axes(const struct board *board)
{
    return board->ops->axis_size ? board->bus->config.protocol->axes_max : 0;
}

static inline struct axis *board_axis(const struct board *board, unsigned index)
{
    return (struct axis *)((uintptr_t)board + board->ops->axes + index * board->ops->axis_size);
}

/* Returns the number of axes of a board whose axes end with the first spare one. */
static inline unsigned board_config_axes(const struct board_config *config)
{
    unsigned count = 0;

    while (config->kind == BOARD_MOTOR && count < BOARD_AXES_MAX &&
           config->axis[count].joint >= 0) {
        count++;
    }
    return count;
}

/* Limits of the error counters, ISO 11898-1 */
enum { BOARD_CAN_WARNING = 96, BOARD_CAN_PASSIVE = 128 };

/* Returns whether a board neither obeys nor answers commands of its application. */
static inline bool board_is_deaf(const struct board *board)
{
    return board->in_bootloader || board->away;
}

/* Allocate a board and a bus of a protocol, whose structures begin with them; NULL without memory.
 * Not RT-safe. */
struct board *board_create(struct arena *arena, size_t size, const struct board_ops *ops);
struct board_bus *board_bus_create(struct arena *arena, size_t size,
                                   const struct board_bus_ops *ops);

/* Checks whether the boards can be made (config_check.c). Not RT-safe. */
enum error_code boards_check(const struct boards_config *config, struct error *error);

/* Return the configuration of a bus, and the protocol of its boards, with the defaults where
 * config says nothing. */
const struct boards_bus_config *boards_bus(const struct boards_config *config, int bus);
const struct protocol *boards_protocol(const struct boards_config *config, int bus);

enum board_verdict { BOARD_OBEYED, BOARD_UNKNOWN, BOARD_MALFORMED };

/* Counts a frame for listener (NULL: for no board here), with an event when it was not obeyed. */
void boards_count_frame(struct boards *boards, struct board *listener, enum board_verdict verdict,
                        const struct bus_frame *frame);

/* Notes that a frame is meant for the board. */
static inline void board_hear(struct board *board)
{
    board->heard_ns = board->boards->now_ns;
}

/* Returns whether frames of a period are due, and plans the next ones. */
static inline bool board_is_due(const struct board *board, int64_t *next_ns, int64_t period_ns)
{
    int64_t late = board->boards->now_ns - *next_ns;

    *next_ns += late < 0 ? 0 : (late / period_ns + 1) * period_ns;
    return late >= 0;
}

/* Enters the bootloader for so long from now on, and leaves it. */
void board_enter_bootloader(struct board *board, int64_t duration_ns);
void board_leave_bootloader(struct board *board);

/* Queues an event, stamped with the time of the phase under way. */
void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b);

/* Counts a frame that the board could not send; its next STATUS will report it. */
void board_lose(struct board *board);

/* Queues an answer (or a PRINT frame) in the format of the bus, or with flags of its own. */
void board_queue(struct board *board, uint32_t id, uint8_t len, const uint8_t *data);
void board_queue_as(struct board *board, uint32_t id, uint8_t flags, uint8_t len,
                    const uint8_t *data);

/* Moves to another address; false when it is taken. */
bool board_set_address(struct board *board, uint8_t address);

/* Sends a periodic frame in the format of the bus, or with flags of its own; when sink is full the
 * frame is lost and counted. */
void board_send(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t len,
                const uint8_t *data);
void board_send_as(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t flags,
                   uint8_t len, const uint8_t *data);

/* Whether the electronics of a board work in a tick. */
enum board_health {
    BOARD_WORKS,
    BOARD_WITHOUT_POWER,
    BOARD_HUNG, /* its bridges have been served */
};

/* Faults of boards (board_faults.c). Finds those that boards can have; false without memory; not
 * RT-safe. The others are for boards that have faults: one tick of power and contact; what the
 * faults leave of the frames from `from` on. */
bool board_faults_create(struct boards *boards, const struct faults *faults, struct arena *arena);
enum board_health board_faults_control(struct board *board, struct plant_command *command);
void board_faults_filter(struct board *board, struct frame_sink *sink, size_t from);

#endif
