/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the boards of iCub buses share, whatever motor boards stand there: class 7, the way from a
 * frame to a row of the tables and back to an answer, and the torques that one board hears of
 * another. Embedded in each kind of these boards. RT-safe but for what creates.
 */
#ifndef BOARDS_ICUB_BOARD_H
#define BOARDS_ICUB_BOARD_H

#include "boards/board_private.h"
#include "boards/icub/table.h"

/*
 * The bootloader of an iCub board: takes a firmware download, acknowledges it as the real one does,
 * and keeps what came, so that an update can be rehearsed and compared with its file.
 *
 * A download is START, then lines (ADDRESS: how many bytes, where to; DATA: up to seven at a time;
 * acknowledged once, when the last byte of the line is there), RUN, END. Nothing is acknowledged
 * before START, nor a line that is incomplete or has more bytes than it announced. END leads back
 * to the application, which is the one it was before: what is kept is never run.
 *
 * Of each complete line, in the order of their coming, the checksum takes address (two bytes, low
 * one first), memory and data: CRC-32 as of zlib. Bytes that a DSP board takes are also kept in an
 * image of its two memories, program and data, of 16-bit words, low byte first on the wire. All
 * RT-safe.
 */
enum { ICUB_LINE_MAX = 255, ICUB_MEMORY_WORDS = 1 << 16, ICUB_MEMORIES = 2 };

struct icub_loader {
    bool downloading; /* START has been obeyed */
    uint32_t boot;    /* the stay in the bootloader that this belongs to */

    /* The line under way */
    bool line_open;
    uint16_t address;
    uint8_t memory, length, filled;
    uint8_t line[ICUB_LINE_MAX];

    /* What has come in complete lines since START */
    uint32_t lines, bytes, crc;
    uint16_t *image; /* ICUB_MEMORIES times ICUB_MEMORY_WORDS words; NULL = not kept */
};

enum icub_line { ICUB_LINE_REFUSED, ICUB_LINE_GROWS, ICUB_LINE_COMPLETE };

/* The last frames of a STRAIN board, as motor boards on the bus hear them. */
struct torque_source {
    int16_t value[BOARD_CHANNELS]; /* counts, 0x8000 = its full scale */
    int64_t time_ns;               /* of the newest, since power-up */
    bool heard;
};

enum { ICUB_SOURCES = 16 }; /* by the four bits of an address */

struct icub_bus {
    struct board_bus bus;
    struct torque_source source[ICUB_SOURCES];
};

struct icub_board;

/* A kind of iCub board beyond what every board has. */
struct icub_board_ops {
    struct board_ops base;
    const struct icub_command *commands;
    size_t command_count;
    enum icub_class command_class;
    bool axis_bit;       /* bit 7 of a class 0 command is the axis */
    bool no_info;        /* gives no additional information */
    uint8_t loader_type; /* what its bootloader says in discovery */

    /* Obeys a command whose length and values are right; request has its values, reply takes those
     * of the answer, which is sent when the row has one. Returns false when the board refuses the
     * value after all; sets *answer to false to suppress the answer. */
    bool (*command)(struct icub_board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer);
    /* DESIRED_TARGETS; NULL: not for this kind. False: wrong length. */
    bool (*targets)(struct icub_board *board, const struct bus_frame *frame);
    void (*discovered)(struct icub_board *board); /* by class 7; NULL: no matter */
};

struct icub_board {
    struct board board;
    struct icub_loader loader;
    char info[ICUB_INFO_LENGTH];
};

static inline struct icub_bus *icub_bus_of(const struct board_bus *bus)
{
    return container_of(bus, struct icub_bus, bus);
}

/* Any board of an iCub bus is one. */
static inline struct icub_board *icub_board_of(const struct board *board)
{
    return container_of(board, struct icub_board, board);
}

/* Returns the functions of the kind of a board. */
static inline const struct icub_board_ops *icub_ops_of(const struct icub_board *board)
{
    return container_of(board->board.ops, struct icub_board_ops, base);
}

/* NULL without memory; not RT-safe. The configuration has been checked. kind: BOARD_FT,
 * BOARD_TORQUE. */
struct board_bus *icub_bus_create(struct arena *arena);
struct board *motor_board_create(struct arena *arena);
struct board *strain_board_create(enum board_kind kind, struct arena *arena);
struct board *inertial_board_create(struct arena *arena);

/* Records what other boards on the bus hear of a STRAIN frame of six bytes of data. */
void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, enum icub_analog_type type,
                          const uint8_t *data, int64_t time_ns);

/* Queues the eight frames of additional information in the class of id; sets a part of it. */
void icub_board_queue_info(struct icub_board *board, uint32_t id);
void icub_board_set_info(struct icub_board *board, const int64_t *part);

/* Fills the answer to GET_FIRMWARE_VERSION of a board that speaks protocol major.minor. */
void icub_board_report_firmware(const struct board *board, unsigned major, unsigned minor,
                                bool acknowledged, int64_t *reply);

#endif
