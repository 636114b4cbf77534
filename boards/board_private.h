/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the sources of this folder share: a board is a common head (address, replies, identity) and
 * the state of its kind behind a small function table.
 */
#ifndef BOARDS_BOARD_PRIVATE_H
#define BOARDS_BOARD_PRIVATE_H

#include "base/ring.h"
#include "boards/board.h"
#include "boards/compact/protocol.h"
#include "boards/faults.h"
#include "boards/icub/table.h"

#include <stdint.h>

enum { MS = 1000000 }; /* nanoseconds */

struct board;

/* An inclusive-exclusive run of milliseconds since power-up. */
struct ms_span {
    int64_t from, to;
};

/* Where boards_transmit writes. */
struct frame_sink {
    struct bus_frame *frames;
    size_t count, max;
    int64_t time_ns;
    uint8_t flags; /* of every frame: FRAME_FD and FRAME_BRS, or none */
};

struct board_ops {
    uint8_t type, major, minor, build; /* identity */
    size_t periodic_max;               /* frames in a transmission at most */
    const struct icub_command *commands;
    size_t command_count;
    enum icub_class command_class;
    bool axis_bit;    /* bit 7 of a class 0 command is the axis */
    bool no_info;     /* gives no additional information */
    bool turns_field; /* the motor's field turns by firmware: when that hangs it stands still */

    /* Obeys a command whose length and values are right; request has its values, reply takes those
     * of the answer, which is sent when the row has one. Returns false when the board refuses the
     * value after all; sets *answer to false to suppress the answer. */
    bool (*command)(struct board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer);
    /* Periodic frames of the host (DESIRED_TARGETS); NULL: none. False: wrong length. */
    bool (*targets)(struct board *board, const struct bus_frame *frame);
    /* Reads or writes a parameter of a compact board; *value is the one in force afterwards. */
    enum compact_result (*parameter)(struct board *board, unsigned parameter, unsigned axis,
                                     bool write, int64_t *value);
    void (*power_up)(struct board *board);
    void (*discovered)(struct board *board); /* may be NULL, as control and shut_down */
    void (*sample)(struct board *board, const struct plant_sensors *sensors);
    /* One tick; span holds the milliseconds that it completes. */
    void (*control)(struct board *board, struct ms_span span, struct plant_command *command);
    void (*transmit)(struct board *board, struct ms_span span, struct frame_sink *sink);
    void (*shut_down)(struct board *board, struct plant_command *command);
    bool (*fault)(const struct board *board); /* an axis is in hardware fault; NULL: never */
    const struct board_settings *settings;    /* NULL: none */
};

/* The settings of a kind's axes (boards/board.h). The index is below count. */
struct board_settings {
    size_t count;
    void (*describe)(const struct board *board, unsigned axis, size_t index,
                     struct board_setting *setting);
    double (*get)(const struct board *board, unsigned axis, size_t index);
    bool (*set)(struct board *board, unsigned axis, size_t index, double value);
};

/* The last frames of a STRAIN board, as motor boards on the bus hear them. */
struct torque_source {
    int16_t value[BOARD_CHANNELS];
    int64_t time_ns; /* of the newest, since power-up */
    bool heard;
};

struct queued_reply {
    struct board *board;
    bool lost; /* with the board's power */
    uint16_t id;
    uint8_t len;
    uint8_t data[8];
};

enum { BOARD_ADDRESSES = COMPACT_NODE_MAX + 1 };

/* Which axis stands behind a slot of a compact bus. */
struct board_slot {
    struct board *board; /* NULL: none */
    unsigned axis;
};

struct board_bus {
    struct boards_bus_config config;
    struct board *by_address[BOARD_ADDRESSES]; /* [0] stays empty: the host */
    struct board_slot slot[COMPACT_SLOTS];     /* BOARD_COMPACT */
    unsigned slots;
    uint16_t nodes; /* boards: each is a CAN node of its own */
    struct torque_source source[ICUB_ADDRESS_MAX + 2];
    struct queued_reply *replies; /* circular */
    size_t capacity, head, waiting;
    size_t transmit_max;
    int64_t sent_ms; /* milliseconds whose periodic frames have been sent */
};

struct motor_board;
struct foc_board;
struct compact_motor;
struct compact_ft;
struct strain_board;
struct board_faults;

struct board {
    struct boards *boards;
    const struct board_ops *ops;
    struct board_config config; /* name points into the arena */
    struct board_bus *bus;
    uint8_t address;
    uint16_t node; /* of its frames: which of its bus's boards it is, counted as configured */
    char info[ICUB_INFO_LENGTH];
    int64_t application_ns; /* in the bootloader until then */
    bool in_bootloader;
    bool sampled;                          /* the sensors of this tick have been read */
    unsigned replies;                      /* of this board, waiting */
    uint64_t lost;                         /* frames it could not send */
    bool lost_in_status, lost_in_overflow; /* to be reported there */
    struct motor_board *motor;             /* of these, the one of its kind */
    struct strain_board *strain;
    struct foc_board *foc;
    struct compact_motor *compact;
    struct compact_ft *wrench;
    struct board_faults *faults; /* NULL = it can have none (board_faults.c) */
    bool away;                   /* a fault keeps it from the bus */
    struct board_can_state can;
};

/* The joint of an axis, -1 = none: a spare axis, or one that such a board has not. */
static inline int board_joint(const struct board *board, size_t axis)
{
    return board->config.kind == BOARD_MOTOR &&
                   axis < board_axes_max(board->bus->config.personality)
               ? board->config.axis[axis].joint
               : -1;
}

/* Limits of ISO 11898-1 */
enum { BOARD_CAN_WARNING = 96, BOARD_CAN_PASSIVE = 128 };

/* Neither obeys nor answers commands of its application. */
static inline bool board_is_deaf(const struct board *board)
{
    return board->in_bootloader || board->away;
}

struct boards {
    struct boards_counters counters;
    struct ring events;
    int64_t tick_ns;
    int64_t time_ns;        /* since power-up */
    int64_t sensor_time_ns; /* newest time stamp of the plant, for events */
    uint64_t settings_changes;
    size_t nbus, nboard;
    struct board_bus *bus;
    struct board *board;
    void (*restarted)(void *context, int joint);
    void *context;
};

extern const struct board_settings motor_settings, foc_settings, compact_settings;
extern const struct board_ops motor_board_ops, ft_board_ops, torque_board_ops;
extern const struct board_ops foc_board_ops, compact_motor_ops, compact_ft_ops;

/* Make the state of a kind; config has been checked. NULL without memory. */
struct motor_board *motor_board_create(struct arena *arena);
struct strain_board *strain_board_create(struct arena *arena);
struct foc_board *foc_board_create(struct arena *arena);
struct compact_motor *compact_motor_create(struct arena *arena);
struct compact_ft *compact_ft_create(struct arena *arena);

/* Whether the boards can be made (check.c). */
enum error_code boards_check(const struct boards_config *config, struct error *error);

/* What the boards of a bus speak. */
enum board_personality boards_personality(const struct boards_config *config, int bus);

/* A frame that is no error frame, for the boards of a bus of either kind. */
void icub_bus_receive(struct boards *boards, struct board_bus *bus, const struct bus_frame *frame);
void compact_bus_receive(struct boards *boards, struct board_bus *bus,
                         const struct bus_frame *frame);

enum board_verdict { BOARD_OBEYED, BOARD_UNKNOWN, BOARD_MALFORMED };

/* Counts a frame for listener (NULL: for no board here), with an event when it was unwelcome. */
void boards_count_frame(struct boards *boards, struct board *listener, enum board_verdict verdict,
                        const struct bus_frame *frame);

/* Into the bootloader for so long from now on, and out of it. */
void board_enter_bootloader(struct board *board, int64_t duration_ns);
void board_leave_bootloader(struct board *board);

/* Whether the electronics of a board work in a tick. */
enum board_health {
    BOARD_WORKS,
    BOARD_WITHOUT_POWER,
    BOARD_HUNG, /* its bridges have been served */
};

/* Faults of boards (board_faults.c). Finds those that boards can have; false without memory. The
 * others are for boards that have faults: one tick of power and contact; what the faults leave of
 * the frames from `from` on; a transmission. */
bool board_faults_create(struct boards *boards, const struct faults *faults, struct arena *arena);
enum board_health board_faults_control(struct board *board, const struct plant_sensors *sensors,
                                       struct plant_command *command);
void board_faults_filter(struct board *board, struct frame_sink *sink, size_t from);
void board_faults_transmit(struct board *board, struct ms_span span, struct frame_sink *sink);

void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b);

/* Counts a frame that the board could not send; it will tell the host. */
void board_lose(struct board *board);

/* Queues an answer (or a PRINT frame). */
void board_queue(struct board *board, uint32_t id, uint8_t len, const uint8_t *data);

/* The eight frames of additional information in the class of id. */
void board_queue_info(struct board *board, uint32_t id);
void board_set_info(struct board *board, const int64_t *part);

/* Moves to another address; false when it is taken. */
bool board_set_address(struct board *board, uint8_t address);

/* Sends a periodic frame; when sink is full the frame is lost and counted. */
void board_send(struct board *board, struct frame_sink *sink, uint32_t id, uint8_t len,
                const uint8_t *data);

/* What other boards on the bus hear of a STRAIN frame of six bytes of data. */
void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, unsigned type,
                          const uint8_t *data, int64_t time_ns);

#endif
