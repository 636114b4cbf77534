/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions common to all boards of an iCub bus, for the protocols icub and foc: commands of class
 * 7, the path of a command through its table row to an answer, and the torques that STRAIN boards
 * send to motor boards. Each kind of board embeds struct icub_board. RT-safe, except the functions
 * that create an object.
 */
#ifndef BOARDS_ICUB_BOARD_H
#define BOARDS_ICUB_BOARD_H

#include "boards/board_private.h"
#include "boards/icub/table.h"

/*
 * The bootloader of an iCub board. It accepts a firmware download, acknowledges it as the real
 * bootloader does, and keeps the data. A host can rehearse an update and then compare the data with
 * its file.
 *
 * A download consists of START, lines, RUN and END. A line consists of one ADDRESS (number of
 * bytes, target address) and DATA frames of up to seven bytes. The bootloader acknowledges each
 * line once, after its last byte. It sends no acknowledgment before START, and none for a line that
 * is incomplete or too long. END starts the unchanged application: the downloaded code never runs.
 *
 * The checksum is the CRC-32 of zlib over all complete lines in order of arrival. Each line adds
 * its address (two bytes, low byte first), its memory and its data. Data for a DSP board is also
 * stored in an image of the DSP's two memories, program and data. The image has 16-bit words; the
 * frames carry the low byte first. All functions are RT-safe.
 */
enum { ICUB_LINE_MAX = 255, ICUB_MEMORY_WORDS = 1 << 16, ICUB_MEMORIES = 2 };

struct icub_loader {
    bool downloading; /* START was received */
    uint32_t boot;    /* value of board.boots when START was received */

    /* The line that is being received */
    bool line_open;
    uint16_t address;
    uint8_t memory, length, filled;
    uint8_t line[ICUB_LINE_MAX];

    /* Totals of complete lines since START */
    uint32_t lines, bytes, crc;
    uint16_t *image; /* ICUB_MEMORIES times ICUB_MEMORY_WORDS words; NULL = no image */
};

enum icub_line { ICUB_LINE_REFUSED, ICUB_LINE_GROWS, ICUB_LINE_COMPLETE };

/* The last frames of a STRAIN board, as received by motor boards on the bus. */
struct torque_source {
    int16_t value[BOARD_CHANNELS]; /* counts, 0x8000 = full scale of the sending board */
    int64_t time_ns;               /* time of the newest frame; 0 = none received yet */
};

enum { ICUB_SOURCES = 16 }; /* one per four-bit address */

struct icub_bus {
    struct board_bus bus;
    struct torque_source source[ICUB_SOURCES];
};

struct icub_board;

/* Functions and properties of a kind of iCub board. */
struct icub_board_ops {
    struct board_ops base;
    const struct icub_command *commands;
    size_t command_count;
    enum icub_class command_class;
    bool axis_bit;       /* bit 7 of a class 0 command selects the axis */
    bool no_info;        /* sends no additional information */
    uint8_t loader_type; /* board type that its bootloader reports in discovery */

    /* Obeys a command whose length and values are valid. request: values of the command. reply:
     * receives the values of the answer, if the row has one. Returns false if the board refuses the
     * command. Sets *answer to false to suppress the answer. */
    bool (*command)(struct icub_board *board, const struct bus_frame *frame, const int64_t *request,
                    int64_t *reply, bool *answer);
    /* Receives DESIRED_TARGETS; NULL = not supported. Returns false for a wrong length. */
    bool (*targets)(struct icub_board *board, const struct bus_frame *frame);
    /* called after discovery (class 7); NULL = not needed */
    void (*discovered)(struct icub_board *board);
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

/* Returns a board as an iCub board. Every board of an iCub bus is a struct icub_board. */
static inline struct icub_board *icub_board_of(const struct board *board)
{
    return container_of(board, struct icub_board, board);
}

/* Returns the functions for the kind of a board. */
static inline const struct icub_board_ops *icub_ops_of(const struct icub_board *board)
{
    return container_of(board->board.ops, struct icub_board_ops, base);
}

extern const struct board_bus_ops icub_bus_ops;
extern const struct icub_board_ops motor_icub_ops, ft_icub_ops, torque_icub_ops, inertial_icub_ops;

/* Stores a STRAIN frame of six data bytes, so that motor boards on the bus can use its torques. */
void icub_bus_hear_strain(struct board_bus *bus, uint8_t address, enum icub_analog_type type,
                          const uint8_t *data, int64_t time_ns);

/* Queue the additional information as eight frames, in the class of `id`; store a part of the
 * additional information. */
void icub_board_queue_info(struct icub_board *board, uint32_t id);
void icub_board_set_info(struct icub_board *board, const int64_t *part);

/* Fills the answer to GET_FIRMWARE_VERSION with protocol version major.minor. */
void icub_board_report_firmware(const struct board *board, unsigned major, unsigned minor,
                                bool acknowledged, int64_t *reply);

#endif
