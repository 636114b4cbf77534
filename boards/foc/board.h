/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Creates a 2FOC board; its bus is an iCub one (boards/icub/board.h). NULL without memory; the
 * configuration has been checked (boards/check.c). Memory is the arena's. Not RT-safe.
 */
#ifndef BOARDS_FOC_BOARD_H
#define BOARDS_FOC_BOARD_H

#include "base/arena.h"

struct board;

struct board *foc_board_create(struct arena *arena);

#endif
