/* SPDX-License-Identifier: Apache-2.0 */
/* Options, progress and other simulators, which the benchmarks share. Not RT-safe. */
#ifndef APP_BENCH_OUTPUT_H
#define APP_BENCH_OUTPUT_H

#include "app/bench/peers.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define BENCH_OUT_OPTION(folder, files)                                                            \
    {                                                                                              \
        .name = "--out", .type = OPTION_STRING, .argument = "DIR",                                 \
        .help = "write " files " into this folder, which is made if necessary", .value = (folder), \
        .letter = "-o"                                                                             \
    }

#define BENCH_PEERS_OPTION(path)                                                                   \
    {                                                                                              \
        .name = "--peers", .type = OPTION_STRING, .argument = "PATH",                              \
        .help = "the module with other simulators (default: see below)", .value = (path)           \
    }

/* Loads the module with other simulators. Without path a missing module is no error: library->peers
 * is NULL then, and a line on stderr says so and ends in consequence. */
enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error);

/* Shows the progress of a run on stderr when that is a terminal; clears the line at the end. */
void bench_progress(const char *name, size_t done, size_t all);

/* Returns the CPU time of the calling thread, s. */
double bench_cpu_s(void);

/* Sorts the values, ascending. */
void bench_sort(double *value, size_t count);

/* Returns the median of at least one value, of an even number the upper one of the middle; sorts
 * the values. */
double bench_median(double *value, size_t count);

/* ---- the benchmarks: argv[0] is the name; each returns an enum exit_status (base/options.h), and
 * prints its own manual for --help ---- */

int bench_contact(int argc, char **argv);
int bench_dynamics(int argc, char **argv);
int bench_latency(int argc, char **argv);
int bench_paper(int argc, char **argv);
int bench_throughput(int argc, char **argv);
int bench_ticks(int argc, char **argv);

#endif
