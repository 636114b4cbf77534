/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Real-time service of the system for the calling thread: a FIFO priority, locked memory, a
 * processor of its own, no deep idle states. Each is used when the system allows it; when it does
 * not, one warning says why and how to allow it. Not RT-safe: call it before the loop.
 */
#ifndef RT_REALTIME_H
#define RT_REALTIME_H

#include <stdbool.h>
#include <stddef.h>

struct realtime_config {
    int priority;     /* SCHED_FIFO priority of the calling thread, 1-99; 0 = leave it alone */
    bool lock_memory; /* mlockall, now and for what comes, page by page as it is touched */
    int cpu;          /* the calling thread stays on this processor; -1 = anywhere */
};

enum { REALTIME_WARNINGS_MAX = 4 };

struct realtime_report {
    bool fifo, locked, pinned;
    bool awake; /* /dev/cpu_dma_latency is held at 0 until the process ends */
    size_t count;
    char warning[REALTIME_WARNINGS_MAX][256];
};

/* Applies what it can to the calling thread, touches its stack, and reports the rest. Idle states
 * that cannot be held off are no warning: on many machines none matter. */
void realtime_apply(const struct realtime_config *config, struct realtime_report *report);

/* Prefaults what a loop uses beside its arena, for any clock: the calling thread's stack, and the
 * code and data of the program and its libraries, whose pages the system otherwise maps at first
 * use. */
void realtime_touch(void);

#endif
