/* SPDX-License-Identifier: Apache-2.0 */
/* The object dictionary of the cia402 boards as a section of their page. Not RT-safe. */
#ifndef APP_CLI_OBJECT_LIST_H
#define APP_CLI_OBJECT_LIST_H

#include <stdio.h>

void object_list_print(FILE *out);

#endif
