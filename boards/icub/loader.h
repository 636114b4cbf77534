/* SPDX-License-Identifier: Apache-2.0 */
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
#ifndef BOARDS_ICUB_LOADER_H
#define BOARDS_ICUB_LOADER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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

#endif
