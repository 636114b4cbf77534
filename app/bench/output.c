/* SPDX-License-Identifier: Apache-2.0 */
/* What the benchmarks share. */
#include "rt/bench_output.h"

#include <errno.h>
#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error)
{
    enum error_code code = peers_open(path, library, error);

    if (code && !path) {
        fprintf(stderr, "coman-hil bench: %s: %s\n", error->text, consequence);
        return ERROR_NONE;
    }
    return code;
}

enum error_code bench_open(const char *folder, const char *name, FILE **out, struct error *error)
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

enum error_code bench_close(FILE *out, const char *name, enum error_code code, struct error *error)
{
    bool failed = ferror(out) != 0;

    if ((fclose(out) || failed) && !code) {
        return error_set_errno(error, errno, "%s", name);
    }
    return code;
}

void bench_progress(const char *name, size_t done, size_t all)
{
    size_t percent = 100 * done / all;

    if (!isatty(STDERR_FILENO) || percent == 100 * (done - 1) / all) {
        return;
    }
    fprintf(stderr, "\r%s: %zu %%", name, percent);
    if (done == all) {
        fprintf(stderr, "\r\033[K");
    }
}
