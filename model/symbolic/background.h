/* SPDX-License-Identifier: Apache-2.0 */
/*
 * symbolic_build in a process of its own, for the next start: nobody waits for it, and nothing of
 * this process is changed when it ends.
 *
 * It has its own session, no files but the cache's, the lowest priority there is (SCHED_IDLE, nice
 * 19, the first to go when memory runs out) and, where there is another, not the loop's CPU. One
 * works on a module at a time. A failure is noted in the cache with what the compiler said, and not
 * tried again until the compiler is another one or the note is removed. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_BACKGROUND_H
#define MODEL_SYMBOLIC_BACKGROUND_H

#include "model/symbolic/symbolic.h"

enum symbolic_state {
    SYMBOLIC_MISSING,   /* reason: why it cannot be compiled; "" where it can */
    SYMBOLIC_COMPILED,  /* it is in the folder */
    SYMBOLIC_COMPILING, /* by this start or, with a reason, another */
    SYMBOLIC_FAILED,    /* reason: why, and where the compiler's output is */
};

/* How it is with robot's module in a cache folder; changes nothing. */
enum symbolic_state symbolic_state(const struct robot *robot,
                                   const struct symbolic_options *options, const char *folder,
                                   struct error *reason);

/* The same, after a build was begun of one that is missing. avoided_cpu: the loop's; -1 = none. The
 * compiler is killed after options->limit_s, 0 = an hour. Before the process has threads. */
enum symbolic_state symbolic_build_in_background(const struct robot *robot,
                                                 const struct symbolic_options *options,
                                                 const char *folder, int avoided_cpu,
                                                 struct error *reason);

#endif
