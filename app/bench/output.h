/* SPDX-License-Identifier: Apache-2.0 */
/* What the benchmarks share: result files, progress, other simulators. Not RT-safe. */
#ifndef RT_BENCH_OUTPUT_H
#define RT_BENCH_OUTPUT_H

#include "rt/peers.h"

#include <stdbool.h>
#include <stdio.h>

#define BENCH_OUT_OPTION(folder, files)                                                            \
    {                                                                                              \
        .name = "--out", .type = OPTION_STRING, .argument = "DIR",                                 \
        .help = "write " files " into this folder, which is made if need be", .value = (folder)    \
    }

#define BENCH_PEERS_OPTION(path)                                                                   \
    {                                                                                              \
        .name = "--peers", .type = OPTION_STRING, .argument = "PATH",                              \
        .help = "the module with other simulators (default: see below)", .value = (path)           \
    }

#define BENCH_PEERS_MANUAL                                                                         \
    "Other simulators (Simbody, MuJoCo, ODE) are no part of this program. They come in a module, " \
    "libhil-peers.so, that the build makes with the tests where their libraries are installed. "   \
    "It "                                                                                          \
    "is looked for beside the program, then in ../tests from there; without it only our own "      \
    "figures are measured."

/* Loads the module with other simulators. That none is found is no error unless a path was given:
 * then library->peers is NULL and a line on stderr says so, ending in consequence. */
enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error);

/* Opens folder/name for writing and makes the folder. */
enum error_code bench_open(const char *folder, const char *name, FILE **out, struct error *error);

/* Closes; code is what writing came to. Returns code, or what went wrong on closing. */
enum error_code bench_close(FILE *out, const char *name, enum error_code code, struct error *error);

/* How far a run has come, on stderr when that is a terminal; the line goes away at the end. */
void bench_progress(const char *name, size_t done, size_t all);

#endif
