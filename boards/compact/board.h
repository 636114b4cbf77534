/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Creates the buses and boards of the compact protocol. NULL without memory; the configuration has
 * been checked (boards/config_check.c). Memory is the arena's. Not RT-safe.
 */
#ifndef BOARDS_COMPACT_BOARD_H
#define BOARDS_COMPACT_BOARD_H

#include "base/arena.h"

struct board;
struct board_bus;

struct board_bus *compact_bus_create(struct arena *arena);
struct board *compact_motor_create(struct arena *arena);
struct board *compact_ft_create(struct arena *arena);
struct board *compact_inertial_create(struct arena *arena);

#endif
