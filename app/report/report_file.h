/* SPDX-License-Identifier: Apache-2.0 */
/* Files of results in a folder of their own, each complete or not there (base/whole_file.h). Not
 * RT-safe. */
#ifndef APP_REPORT_REPORT_FILE_H
#define APP_REPORT_REPORT_FILE_H

#include "base/whole_file.h"

#include <limits.h>

/* A file of results being written. */
struct report_file {
    struct whole_file whole; /* write to whole.out */
    char path[PATH_MAX];
};

/* Opens folder/name for writing; makes the folder if necessary. The struct must not move until the
 * file is closed. */
enum error_code report_file_open(struct report_file *file, const char *folder, const char *name,
                                 struct error *error);

/* Closes the file. code: the result of writing it, which is returned unless closing fails. */
enum error_code report_file_close(struct report_file *file, enum error_code code,
                                  struct error *error);

#endif
