/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data and functions of every board, for any protocol: address, bus, waiting answers, bootloader,
 * faults. A protocol embeds struct board in its boards and struct board_bus in its buses, and fills
 * their tables of functions. This header does not depend on a protocol.
 *
 * Units: ns of virtual time since power-up unless a name says otherwise. All memory comes from the
 * arena of boards_create. All functions are RT-safe except those that create something.
 */
#ifndef BOARDS_BOARD_PRIVATE_H
#define BOARDS_BOARD_PRIVATE_H

#include "base/array.h"
#include "base/random.h"
#include "base/ring.h"
#include "boards/axis.h"
#include "faults/faults.h"
#include "boards/protocol.h"

enum { MS = 1000000 }; /* ns per millisecond */

struct board;
struct board_bus;
struct board_faults;
struct voltage_delay;

/* A range of milliseconds since power-up: from inclusive, to exclusive. */
struct ms_span {
    int64_t from, to;
};

/* Destination of the frames that boards_transmit collects. */
struct frame_sink {
    struct bus_frame *frames;
    size_t count, max;
    int64_t time_ns;
};

/* Identity of a board, as it reports in discovery. */
struct board_identity {
    uint8_t type, major, minor, build;
};

/* The functions and properties of one kind of board. */
struct board_ops {
    size_t size; /* of a board, whose first member is struct board */
    struct board_identity identity;
    size_t periodic_max; /* most frames per transmission */
    /* the firmware commutates the motor: when the firmware hangs, the magnetic field stops
     * turning */
    bool turns_field;

    void (*power_up)(struct board *board);
    /* Reads and quantizes the sensors, at the time boards->now_ns. */
    void (*sample)(struct board *board, const struct plant_sensors *sensors);
    /* Runs one tick. `span`: the milliseconds that end in this tick. NULL = no motors; shut_down is
     * then NULL too. */
    void (*control)(struct board *board, struct ms_span span);
    void (*transmit)(struct board *board, struct ms_span span, struct frame_sink *sink);
    /* Called when a periodic frame of this board is on the bus and other boards hear it. NULL = not
     * needed. */
    void (*sent)(struct board *board, const struct bus_frame *frame);
    void (*shut_down)(struct board *board); /* opens the bridges; NULL = the board has none */
    /* offset of the first axis, and size of each (boards/axis.h), if the board opens and closes
     * bridges; 0 = no axes */
    size_t axes, axis_size;
    const struct board_settings *settings; /* NULL = no settings */
};

/* The settings of one kind of axis (boards/board.h). An index is below count. */
struct board_settings {
    size_t count;
    void (*describe)(const struct board *board, unsigned axis, size_t index,
                     struct board_setting *setting);
    bool (*set)(struct board *board, unsigned axis, size_t index, double value);
};

/* The functions and properties of a protocol's buses. */
struct board_bus_ops {
    size_t size; /* of a bus, whose first member is struct board_bus */
    /* Called after a board gets its address, before its power-up; false = out of memory. NULL = not
     * needed. */
    bool (*add_board)(struct board_bus *bus, struct board *board, struct arena *arena);
    bool remote;   /* accepts remote frames */
    bool extended; /* accepts 29-bit identifiers */
    /* Receives a frame with an identifier and a length that the bus allows. */
    void (*receive)(struct boards *boards, struct board_bus *bus, const struct bus_frame *frame);
};

struct queued_reply {
    struct board *board;
    int64_t due_ns;
    bool lost;     /* the board has lost power, and with it the answer */
    bool transmit; /* not a frame: the board's transmit writes the answer when it is due */
    uint8_t flags, len;
    uint32_t id;
    uint8_t data[64];
};

enum { BOARD_ADDRESSES = BOARD_ADDRESS_MAX + 1 }; /* for any protocol; [0] is the host */

/* Common part of a bus: first member of each protocol's bus structure. */
struct board_bus {
    const struct board_bus_ops *ops;
    struct boards_bus_config config;
    struct board *by_address[BOARD_ADDRESSES];
    unsigned address_end;         /* addresses from this one on have no board */
    uint16_t nodes;               /* number of boards; each board is a CAN node */
    struct queued_reply *replies; /* circular queue, by due_ns */
    struct board_reply_time reply;
    size_t capacity, head, waiting;
    size_t transmit_max;
    size_t can_errors; /* number of boards with CAN errors */
    int64_t sent_ms;   /* boards_transmit has sent the periodic frames before this millisecond */
};

/* Puts a board at an address of its bus. */
static inline void board_bus_place(struct board_bus *bus, unsigned address, struct board *board)
{
    bus->by_address[address] = board;
    bus->address_end = bus->address_end > address ? bus->address_end : address + 1;
}

/* Common part of a board: first member of each protocol's board structure. */
struct board {
    const struct board_ops *ops;
    struct boards *boards;
    struct board_bus *bus;
    struct board_config config; /* the name is in the arena */
    uint16_t index;             /* index in the configuration */
    uint16_t node;              /* CAN node: index among the boards of its bus */
    uint8_t address;
    uint8_t axes; /* number of axes, including spare ones; 0 for sensors */
    bool in_bootloader;
    bool away; /* disconnected from the bus by a fault, or external */
    /* external boards: present: has sent a frame within the time-out; silence_told: an event has
     * reported the silence */
    bool present, silence_told;
    uint32_t boots;         /* how often the board has entered the bootloader */
    int64_t application_ns; /* time at which the board leaves the bootloader */
    /* time of the last frame for this board; -1 = none yet */
    int64_t heard_ns;
    unsigned replies;            /* number of waiting answers of this board */
    int64_t reply_ns;            /* due time of its last answer to a command */
    struct random_stream random; /* random part of its reply time */
    uint64_t lost;               /* frames that the board could not send */
    /* a loss is not yet reported: in STATUS; as an OVERFLOW event */
    bool lost_in_status, lost_in_overflow;
    struct board_faults *faults; /* NULL = no faults for this board (board_faults.c) */
    struct board_can_state can;
};

/* Why a frame is malformed, for struct board_event. */
struct board_reason {
    uint8_t row, why;
    uint32_t found, expected;
};

struct boards {
    struct boards_counters counters;
    struct board_reason reason;   /* reason for the next frame that boards_count_frame counts */
    struct board_event malformed; /* event of the last malformed frame */
    struct ring events;
    int64_t tick_ns;
    /* Each phase sets both from its argument now_ns. event_ns is the time stamp of events; now_ns
     * is the time for the boards' timers. In boards_control they differ, because the boards compute
     * their state at the end of the tick. */
    int64_t event_ns, now_ns;
    /* the time of answers to the frame that is being received, and the frame's arrival; NULL: no
     * frame, so that a message is due at once */
    const struct board_reply_time *reply;
    int64_t arrival_ns;
    double supply_v, oil_pa; /* supply voltage and pressure of the last sample; finite, 0 or more */
    uint64_t settings_changes, seed;
    size_t nbus, nboard;
    struct board_bus **bus;
    struct board **board;
    struct voltage_delay *delay; /* NULL = a voltage takes effect in the tick that sets it */
    void (*restarted)(void *context, int joint);
    void *context;
};

/* Returns the joint of an axis; -1 = a spare axis, or no such axis. */
static inline int board_joint(const struct board *board, size_t axis)
{
    return board->config.kind == BOARD_MOTOR && axis < board->bus->config.protocol->axes_max
               ? board->config.axis[axis].joint
               : -1;
}

/* Returns an axis of a board. */
static inline struct axis *board_axis(const struct board *board, unsigned index)
{
    return (struct axis *)((uintptr_t)board + board->ops->axes + index * board->ops->axis_size);
}

/* Returns the number of axes before the first spare axis of a motor board. */
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

/* Returns whether a board ignores commands: it is in its bootloader or off the bus. */
static inline bool board_is_deaf(const struct board *board)
{
    return board->in_bootloader || board->away;
}

/* Return the configuration and the protocol of a bus, with defaults filled in. */
const struct boards_bus_config *boards_bus(const struct boards_config *config, int bus);
const struct protocol *boards_protocol(const struct boards_config *config, int bus);

enum board_verdict { BOARD_OBEYED, BOARD_UNKNOWN, BOARD_MALFORMED };

/* Counts a frame that `listener` received; NULL = no board here. Emits an event if the verdict is
 * not BOARD_OBEYED. */
void boards_count_frame(struct boards *boards, struct board *listener, enum board_verdict verdict,
                        const struct bus_frame *frame);

/* Stores the time of a frame that is meant for the board. */
static inline void board_hear(struct board *board)
{
    board->heard_ns = board->boards->now_ns;
}

/* Returns whether periodic frames are due. If so, advances *next_ns to the next due time. */
static inline bool board_is_due(const struct board *board, int64_t *next_ns, int64_t period_ns)
{
    int64_t late = board->boards->now_ns - *next_ns;

    *next_ns += late < 0 ? 0 : (late / period_ns + 1) * period_ns;
    return late >= 0;
}

/* Enter the bootloader for duration_ns, and leave it. */
void board_enter_bootloader(struct board *board, int64_t duration_ns);
void board_leave_bootloader(struct board *board);

/* Queues an event, stamped with the time of the present phase. */
void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b);

/* Counts a frame that the board could not send; the next STATUS reports it. */
void board_lose(struct board *board);

/* Queue an answer (or a PRINT frame) in the format of the bus, or with the given flags. */
void board_queue(struct board *board, uint32_t id, uint8_t len, const uint8_t *data);
void board_queue_as(struct board *board, uint32_t id, uint8_t flags, uint8_t len,
                    const uint8_t *data);

/* Queues a call of the board's transmit as the answer to the present command. The frames have the
 * values at the time of the answer. */
void board_queue_transmit(struct board *board);

/* Moves the board to another address; false = the address is taken. */
bool board_set_address(struct board *board, uint8_t address);

/* Send a periodic frame. board_send uses the given data and the format of the bus. board_add_frame
 * returns an empty frame for the caller to fill. When sink is full, the frame is lost and counted,
 * and board_add_frame returns NULL. */
void board_send(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t len,
                const uint8_t *data);
struct bus_frame *board_add_frame(struct board *board, struct frame_sink *sink);

/* State of a board's electronics in this tick. */
enum board_health {
    BOARD_WORKS,
    BOARD_WITHOUT_POWER,
    BOARD_HUNG, /* the firmware hangs; the bridges of this tick are already set */
};

/* Faults of boards (board_faults.c). board_faults_create gives the boards their faults; false = out
 * of memory; not RT-safe. The other two are for boards with faults only. board_faults_control
 * updates power, contact and hang of a board once a tick. board_faults_filter applies the faults to
 * the frames from index `from` on. */
bool board_faults_create(struct boards *boards, const struct faults *faults, struct arena *arena);
enum board_health board_faults_control(struct board *board, struct plant_command *command);
void board_faults_filter(struct board *board, struct frame_sink *sink, size_t from);

#endif
