/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The frames of a cia402 bus as our host sets up its PDOs (struct cia402_plan), with the fields
 * that the mapped objects make, and their messages. Pure functions; not RT-safe.
 */
#ifndef BOARDS_CIA402_FRAMES_H
#define BOARDS_CIA402_FRAMES_H

#include "boards/cia402/protocol.h"
#include "boards/board.h"
#include "boards/field.h"
#include "boards/messages.h"

struct cia402_frame {
    const char *name;
    uint32_t id;
    bool from_host;
    uint8_t length, repeats; /* how often the fields follow each other */
    uint32_t cycle_ns;       /* 0: on demand */
    const struct field *fields;
    const char *answer; /* name of the frame that answers; NULL: none */
    int axis;           /* that it is about; -1: none, or all */
    bool list;          /* the fields follow each other for all axes of the node */
};

/* Return the kind of a board, and the fields of a PDO of its plan: those of a mapped object,
 * once where the plan has it for each axis. */
enum cia402_kind cia402_kind_of(const struct board_config *board);
const struct field *cia402_plan_fields(const struct cia402_plan *plan);

#endif
