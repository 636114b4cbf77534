/* SPDX-License-Identifier: Apache-2.0 */
/* Files of results in a folder of their own. Not RT-safe. */
#ifndef APP_REPORT_REPORT_FILE_H
#define APP_REPORT_REPORT_FILE_H

#include "base/error.h"

#include <stdio.h>

/* Opens folder/name for writing; makes the folder if necessary. */
enum error_code report_file_open(const char *folder, const char *name, FILE **out,
                                 struct error *error);

/* Closes the file. code: the result of writing it, which is returned unless closing fails. */
enum error_code report_file_close(FILE *out, const char *name, enum error_code code,
                                  struct error *error);

#endif
