/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Background thread of a run: prints events (rate-limited) and the status line, four times a second
 * in place on a terminal, every five seconds as a line otherwise; a service manager gets the status
 * instead of the lines, and is told that the run is alive. Not RT-safe.
 */
#ifndef APP_CLI_MONITOR_H
#define APP_CLI_MONITOR_H

#include "app/cli/eventlog.h"
#include "app/cli/notify.h"
#include "sim/simulator.h"

#include <pthread.h>

/* What the thread works on; pointers stay the caller's. */
struct monitor_config {
    struct simulator *simulator;
    struct notify *manager;      /* stays the caller's */
    FILE *out;                   /* stderr, or a test's file */
    bool terminal, quiet;        /* quiet: events, but no status */
    void (*each)(void *context); /* called in the thread once a period; NULL = nothing */
    /* Called with every event, in the thread; NULL = nothing */
    void (*event)(void *context, uint64_t key, const char *text);
    void *context;
};

struct monitor {
    struct monitor_config config;
    struct eventlog log;
    atomic_bool stop;
    bool replaced; /* another run will follow, so this one is no longer ready; set by `each` */
    pthread_t thread;
    int64_t next_status_ns;
    /* At the last status line, for the real-time factor and the loads. */
    struct simulator_status last;
};

/* Starts the thread. */
enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error);

/* Prints the remaining events and joins the thread. */
void monitor_stop(struct monitor *monitor);

#endif
