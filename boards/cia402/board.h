/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Creates the buses and boards of the CANopen protocol. The functions return NULL without memory;
 * the configuration has been checked (boards/check.c). Memory is the arena's. Not RT-safe.
 */
#ifndef BOARDS_CIA402_BOARD_H
#define BOARDS_CIA402_BOARD_H

#include "base/arena.h"

struct board;
struct board_bus;

struct board_bus *cia402_bus_create(struct arena *arena);
struct board *cia402_motor_create(struct arena *arena);
struct board *cia402_ft_create(struct arena *arena);
struct board *cia402_inertial_create(struct arena *arena);

#endif
