/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is said while the dynamics of a robot are compiled, which takes seconds to a minute the
 * first time: on a terminal a line that counts the seconds, else a line now and then; a service
 * manager is asked for patience every few seconds, for ten minutes at most, so that a compiler that
 * hangs does not hold a service for ever. Not RT-safe.
 */
#ifndef APP_CLI_COMPILING_H
#define APP_CLI_COMPILING_H

#include "app/cli/notify.h"
#include "model/symbolic/symbolic.h"

#include <stdio.h>

struct compiling {
    const struct notify *manager; /* NULL = none */
    FILE *out;                    /* stderr, or a test's file */
    bool terminal;
    double next_line_s, next_notice_s;
    bool shown; /* a line stands on the terminal */
};

/* The progress of a build that is told with it; manager may be NULL. */
struct symbolic_progress compiling_begin(struct compiling *compiling, const struct notify *manager,
                                         FILE *out, bool terminal);

/* Clears the terminal's line. */
void compiling_end(struct compiling *compiling);

#endif
