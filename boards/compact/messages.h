/* SPDX-License-Identifier: Apache-2.0 */
/* The messages of a compact bus, for boards/compact/protocol.c. Not RT-safe. */
#ifndef BOARDS_COMPACT_MESSAGES_H
#define BOARDS_COMPACT_MESSAGES_H

#include "boards/messages.h"

void compact_visit_broadcasts(struct message_walk *walk);
void compact_visit_board(struct message_walk *walk, int board, unsigned first_slot);

#endif
