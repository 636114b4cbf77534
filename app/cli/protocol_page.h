/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Prints what boards speak as a page in Markdown: every frame with its fields, units, ranges and
 * answer, and the fault bits, from the tables of the boards (boards/messages.h). Not RT-safe.
 */
#ifndef APP_CLI_PROTOCOL_PAGE_H
#define APP_CLI_PROTOCOL_PAGE_H

#include "boards/board.h"

#include <stdio.h>

/* Prints the page of a protocol that needs no file. */
void protocol_page_print(const struct protocol *protocol, FILE *out);

/* Prints the page of a protocol that a file describes. */
void protocol_page_print_described(const struct described_protocol *described, FILE *out);

#endif
