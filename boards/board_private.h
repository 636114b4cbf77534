/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the sources of this folder share: a board is a common head (address, replies, identity) and
 * the state of its kind behind a small function table.
 */
#ifndef BOARDS_BOARD_PRIVATE_H
#define BOARDS_BOARD_PRIVATE_H

#include "base/ring.h"
#include "boards/board.h"
#include "boards/icub_table.h"

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
};

struct board_ops {
    uint8_t type, major, minor, build; /* identity */
    size_t periodic_max;               /* frames in a transmission at most */
    const struct icub_command *commands;
    size_t command_count;
    enum icub_class command_class;

    /* Obeys a command whose length and values are right; request has its values, reply takes those
     * of the answer, which is sent when the row has one. Returns false when the board refuses the
     * value after all; sets *answer to false to suppress the answer. */
    bool (*command)(struct board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer);
    void (*power_up)(struct board *board);
    void (*discovered)(struct board *board); /* may be NULL, as control and shut_down */
    void (*sample)(struct board *board, const struct plant_sensors *sensors);
    /* One tick; span holds the milliseconds that it completes. */
    void (*control)(struct board *board, struct ms_span span, struct plant_command *command);
    void (*transmit)(struct board *board, struct ms_span span, struct frame_sink *sink);
    void (*shut_down)(struct board *board, struct plant_command *command);
};

/* The last frames of a STRAIN board, as motor boards on the bus hear them. */
struct torque_source {
    int16_t value[BOARD_CHANNELS];
    int64_t time_ns; /* of the newest, since power-up */
    bool heard;
};

struct queued_reply {
    struct board *board;
    uint16_t id;
    uint8_t len;
    uint8_t data[8];
};

struct board_bus {
    struct board *by_address[ICUB_ADDRESS_MAX + 1]; /* [0] stays empty: the host */
    struct torque_source source[ICUB_ADDRESS_MAX + 2];
    struct queued_reply *replies; /* circular */
    size_t capacity, head, waiting;
    size_t transmit_max;
    int64_t sent_ms; /* milliseconds whose periodic frames have been sent */
};

struct motor_board;
struct strain_board;

struct board {
    struct boards *boards;
    const struct board_ops *ops;
    struct board_config config; /* name points into the arena */
    struct board_bus *bus;
    uint8_t address;
    char info[ICUB_INFO_LENGTH];
    int64_t application_ns; /* in the bootloader until then */
    bool in_bootloader;
    bool sampled;                          /* the sensors of this tick have been read */
    unsigned replies;                      /* of this board, waiting */
    uint64_t lost;                         /* frames it could not send */
    bool lost_in_status, lost_in_overflow; /* to be reported there */
    struct motor_board *motor;
    struct strain_board *strain;
};

struct boards {
    struct boards_counters counters;
    struct ring events;
    int64_t tick_ns;
    int64_t time_ns;        /* since power-up */
    int64_t sensor_time_ns; /* newest time stamp of the plant, for events */
    size_t nbus, nboard;
    struct board_bus *bus;
    struct board *board;
};

extern const struct board_ops motor_board_ops, ft_board_ops, torque_board_ops;

/* Make the state of a kind; config has been checked. NULL without memory. */
struct motor_board *motor_board_create(struct arena *arena);
struct strain_board *strain_board_create(struct arena *arena);

/* An axis of it is in hardware fault. */
bool motor_board_fault(const struct motor_board *motor);

void board_event(const struct board *board, enum board_event_kind kind, unsigned axis, uint32_t a,
                 uint32_t b);

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
void bus_hear_strain(struct board_bus *bus, uint8_t address, unsigned type, const uint8_t *data,
                     int64_t time_ns);

#endif
