/* SPDX-License-Identifier: Apache-2.0 */
/* Does what the benchmarks share. */
#include "app/bench/output.h"

#include <unistd.h>

enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error)
{
    enum error_code code = peers_open(path, library, error);

    if (code && !path) {
        fprintf(stderr, "coman-hil-bench: %s: %s\n", error->text, consequence);
        return ERROR_NONE;
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
