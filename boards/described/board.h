/* SPDX-License-Identifier: Apache-2.0 */
/* Creation of boards and buses of described protocols, for boards/boards.c. */
#ifndef BOARDS_DESCRIBED_BOARD_H
#define BOARDS_DESCRIBED_BOARD_H

#include "base/arena.h"

struct board;
struct board_bus;

/* Creates a bus of a described protocol, NULL without memory. Not RT-safe. */
struct board_bus *described_bus_create(struct arena *arena);
struct board *described_motor_create(struct arena *arena);
struct board *described_ft_create(struct arena *arena);
struct board *described_inertial_create(struct arena *arena);

#endif
