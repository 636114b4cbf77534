/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Logs in the format of `candump -L`: "(1436509052.249713) can0 123#DEADBEEF", FD as
 * "123##1<data>", remote "123#R", error frames with the 8-digit id of the error class. canplayer
 * and log2asc read this format. The reader also accepts times with one to nine digits behind the
 * point, and the output of `candump -ta`, with or without -x: " (1436509052.249713)  can0  RX - -
 * 123   [4]  DE AD BE EF". Writing a line is RT-safe, reading is not.
 */
#ifndef CANBUS_CANDUMP_H
#define CANBUS_CANDUMP_H

#include "base/error.h"
#include "canbus/frame.h"

#include <stdio.h>

enum { CANDUMP_LINE_MAX = 256 };

/* Shortest gap between frames of a log, ns, that a replay reports to the user in advance. */
#define LOG_GAP_NS INT64_C(3000000000)

/* Writes one line with newline and terminating zero. Returns its length without the zero. The time
 * is frame->time_ns, in microseconds. RT-safe. */
size_t candump_format(const struct bus_frame *frame, const char *bus, char line[CANDUMP_LINE_MAX]);

/* Parses one line of size bytes, with or without newline. bus receives the interface name (at most
 * 15 characters). ERROR_INPUT with the column of the error. */
enum error_code candump_parse(const char *line, size_t size, struct bus_frame *frame, char bus[16],
                              struct error *error);

/* Reads a log line by line; errors carry file:line:column. next returns ERROR_NONE and sets *end at
 * the end of the file. A line that does not begin with a time has no frame (comment, empty line,
 * DROPCOUNT). candump_next skips and counts such lines. */
struct candump_reader {
    FILE *file;
    const char *path;
    int line;
    uint64_t skipped; /* lines without a frame */
    int skipped_line; /* number of the first skipped line */
    uint64_t lost;    /* number of lost frames according to the DROPCOUNT lines */
};
enum error_code candump_open(struct candump_reader *reader, const char *path, struct error *error);
enum error_code candump_next(struct candump_reader *reader, struct bus_frame *frame, char bus[16],
                             bool *end, struct error *error);
void candump_close(struct candump_reader *reader);

/* Writes a sentence about the skipped lines; false = none was skipped. */
bool candump_skipped(const struct candump_reader *reader, char *text, size_t size);

#endif
