/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Creates a bus of moteus controllers, and one of them. NULL without memory; the configuration has
 * been checked (boards/check.c). Memory is the arena's. Not RT-safe.
 */
#ifndef BOARDS_MOTEUS_BOARD_H
#define BOARDS_MOTEUS_BOARD_H

#include "base/arena.h"

struct board;
struct board_bus;

struct board_bus *moteus_bus_create(struct arena *arena);
struct board *moteus_board_create(struct arena *arena);

#endif
