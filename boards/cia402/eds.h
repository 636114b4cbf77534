/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes the object dictionary of a node as an electronic data sheet (CiA 306), with the factory's
 * values that its configuration leads to. The Node-ID stays open ($NODEID). The text depends on the
 * configuration only. Not RT-safe.
 */
#ifndef BOARDS_CIA402_EDS_H
#define BOARDS_CIA402_EDS_H

#include "boards/board.h"

#include <stdio.h>

/* Writes the data sheet of board, one of a cia402 bus that boards_create takes; name: name of
 * the file. Memory from arena while it writes. Write errors stay with out. */
enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

#endif
