/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to the benchmarks. */
#include "app/bench/bench.h"
#include "base/config.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

double bench_cpu_s(void)
{
    struct timespec now;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

enum error_code bench_find_program(char path[PATH_MAX], struct error *error)
{
    config_program_folder(path);
    strcat(path, "/coman-hil");
    return access(path, X_OK) ? error_set_file(error, errno, path, "cannot be run") : ERROR_NONE;
}

/* Orders doubles for qsort. */
static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

void bench_sort(double *value, size_t count)
{
    qsort(value, count, sizeof *value, compare_doubles);
}

double bench_median(double *value, size_t count)
{
    bench_sort(value, count);
    return value[count / 2];
}

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
