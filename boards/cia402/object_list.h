/* SPDX-License-Identifier: Apache-2.0 */
/* The object dictionary of the cia402 boards as a section of their page. Not RT-safe. */
#ifndef BOARDS_CIA402_OBJECT_LIST_H
#define BOARDS_CIA402_OBJECT_LIST_H

#include <stdio.h>

void cia402_print_objects(FILE *out);

#endif
