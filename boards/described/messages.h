/* SPDX-License-Identifier: Apache-2.0 */
/* The messages of a described bus, for boards/described/protocol.c. Not RT-safe. */
#ifndef BOARDS_DESCRIBED_MESSAGES_H
#define BOARDS_DESCRIBED_MESSAGES_H

#include "boards/messages.h"

void described_visit_broadcasts(struct message_walk *walk);
void described_visit_board(struct message_walk *walk, int board, unsigned first_slot);

/* What signals cannot say: fields of the identifier, the counter, the checksum. */
void described_comment_message(const struct message *message, char *text, size_t size);

/* What makes a field more than a number: the counter, the checksum. */
void described_note_field(const struct message *message, size_t field, char *text, size_t size);

#endif
