/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Requests real-time service from the system for the calling thread: a FIFO priority, locked
 * memory, a processor of its own, no deep idle states. Uses each service that the system allows.
 * For each refused service, one warning says why and how to allow it. Not RT-safe: call it before
 * the loop.
 */
#ifndef RT_REALTIME_H
#define RT_REALTIME_H

#include <stdbool.h>
#include <stddef.h>

struct realtime_config {
    int priority; /* SCHED_FIFO priority of the calling thread, 1-99; 0 = unchanged */
    /* mlockall of present and future memory; each page locks when it is touched */
    bool lock_memory;
    int cpu; /* the calling thread stays on this processor; -1 = anywhere */
};

enum { REALTIME_WARNINGS_MAX = 4 };

struct realtime_report {
    bool fifo, locked, pinned;
    bool awake; /* holds /dev/cpu_dma_latency at 0 until the process ends */
    size_t count;
    char warning[REALTIME_WARNINGS_MAX][256];
};

/* Applies the configuration to the calling thread, touches its stack, and reports each refused
 * service. Gives no warning if deep idle states remain allowed, because they have no effect on many
 * machines. */
void realtime_apply(const struct realtime_config *config, struct realtime_report *report);

/* Maps the memory that a loop uses outside its arena, for any clock: the calling thread's stack,
 * and the code and data of the program and its libraries. The system would otherwise map these
 * pages at first use. */
void realtime_touch(void);

#endif
