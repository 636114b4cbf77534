/* SPDX-License-Identifier: Apache-2.0 */
/* What the benchmarks share: progress, other simulators. Not RT-safe. */
#ifndef APP_BENCH_OUTPUT_H
#define APP_BENCH_OUTPUT_H

#include "app/bench/peers.h"

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
    "is looked for beside the program, then in tests/ from there; without it only our own "      \
    "figures are measured."

/* Loads the module with other simulators. That none is found is no error unless a path was given:
 * then library->peers is NULL and a line on stderr says so, ending in consequence. */
enum error_code bench_peers(const char *path, const char *consequence,
                            struct peers_library *library, struct error *error);

/* How far a run has come, on stderr when that is a terminal; the line goes away at the end. */
void bench_progress(const char *name, size_t done, size_t all);

#endif
