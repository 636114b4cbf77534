/* SPDX-License-Identifier: Apache-2.0 */
/* Opens and closes files of results. */
#include "app/report/report_file.h"

#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <sys/stat.h>

enum error_code report_file_open(const char *folder, const char *name, FILE **out,
                                 struct error *error)
{
    char path[PATH_MAX];

    if (mkdir(folder, 0777) && errno != EEXIST) {
        return error_set_errno(error, errno, "%s", folder);
    }
    if (snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path) {
        return error_set(error, ERROR_INPUT, "the name of the folder %.40s... is too long", folder);
    }
    *out = fopen(path, "w");
    return *out ? ERROR_NONE : error_set_errno(error, errno, "%s", path);
}

enum error_code report_file_close(FILE *out, const char *name, enum error_code code,
                                  struct error *error)
{
    bool failed = ferror(out) != 0;

    if ((fclose(out) || failed) && !code) {
        return error_set_errno(error, errno, "%s", name);
    }
    return code;
}
