/* SPDX-License-Identifier: Apache-2.0 */
/* A command line with an option of every type, for the tests of options and their fuzzer. */
#ifndef TESTS_UNIT_BASE_TRY_COMMAND_H
#define TESTS_UNIT_BASE_TRY_COMMAND_H

#include "base/options.h"

#include <stdint.h>

/* Where the options put what they read. */
struct try_values {
    bool quiet;
    const char *directory;
    double duration;
    int64_t count;
    int clock;
    struct option_list buses;
};

static const struct try_values try_defaults = {.duration = 10.0, .count = 7};
static struct try_values given;

static const struct word try_clocks[] = {{"real", 1}, {"free", 2}, {NULL, 0}};
static const struct option_spec try_options[] = {
    {.name = "--quiet", .type = OPTION_FLAG, .help = "no status line", .value = &given.quiet},
    {.name = "--record",
     .type = OPTION_STRING,
     .argument = "DIR",
     .help = "record there",
     .value = &given.directory,
     .letter = "-r"},
    {.name = "--duration",
     .type = OPTION_REAL,
     .argument = "S",
     .help = "stop after S seconds",
     .value = &given.duration,
     .min = 0.0,
     .max = 1e6,
     .unit = "seconds"},
    {.name = "--count",
     .type = OPTION_INT,
     .argument = "N",
     .help = "so many",
     .value = &given.count,
     .min = -5,
     .max = 9007199254740992.0},
    {.name = "--clock",
     .type = OPTION_ENUM,
     .argument = "CLOCK",
     .help = "which clock",
     .value = &given.clock,
     .words = try_clocks},
    {.name = "--bus",
     .type = OPTION_LIST,
     .argument = "NAME=INTERFACE",
     .help = "which interface",
     .value = &given.buses},
};

#endif
