/* SPDX-License-Identifier: Apache-2.0 */
/* Opens and closes files of results. */
#include "app/report/report_file.h"

enum error_code report_file_open(struct report_file *file, const char *folder, const char *name,
                                 struct error *error)
{
    enum error_code code = folder_make(folder, NULL, error);

    if (code) {
        return code;
    }
    if (snprintf(file->path, sizeof file->path, "%s/%s", folder, name) >= (int)sizeof file->path) {
        return error_set(error, ERROR_INPUT, "the name of the folder %.40s... is too long", folder);
    }
    return whole_file_open(&file->whole, file->path, error);
}

enum error_code report_file_close(struct report_file *file, enum error_code code,
                                  struct error *error)
{
    return whole_file_close(&file->whole, code, error);
}
