/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the messages of a described bus, for boards/described/protocol.c. Not RT-safe. */
#ifndef BOARDS_DESCRIBED_MESSAGES_H
#define BOARDS_DESCRIBED_MESSAGES_H

#include "boards/messages.h"

void described_visit_broadcasts(struct message_walk *walk);
void described_visit_board(struct message_walk *walk, int board, unsigned first_slot);

/* Writes a comment with what signals cannot say: fields of the identifier, the counter, the
 * checksum. */
void described_comment_message(const struct message *message, char *text, size_t size);

/* Writes a note for a field that is more than a number: the counter, the checksum. */
void described_note_field(const struct message *message, size_t field, char *text, size_t size);

#endif
