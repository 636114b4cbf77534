/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The background thread of a run: prints events (rate-limited) and the status line, four times a
 * second in place on a terminal, every five seconds as a line otherwise; a service manager gets the
 * status instead of the lines, and is told that the run is alive. Not RT-safe.
 */
#ifndef APP_CLI_MONITOR_H
#define APP_CLI_MONITOR_H

#include "app/cli/eventlog.h"
#include "app/cli/notify.h"
#include "sim/simulator.h"

#include <pthread.h>

struct monitor_config {
    struct simulator *simulator;
    struct notify *manager;      /* stays the caller's */
    FILE *out;                   /* stderr, or a test's file */
    bool terminal, quiet;        /* quiet: events, no status */
    void (*each)(void *context); /* called in the thread once a period; NULL = nothing */
    /* Called with every event, in the thread; NULL = nothing */
    void (*event)(void *context, uint64_t key, const char *text);
    void *context;
};

struct monitor {
    struct monitor_config config;
    struct eventlog log;
    atomic_bool stop;
    bool replaced; /* another run will follow: this one is not ready any more. Set by `each` */
    pthread_t thread;
    int64_t next_status_ns;
    struct simulator_status last; /* as of the last status line, for the factor and the loads */
};

/* Starts the thread. */
enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error);

/* Prints the remaining events and joins the thread. */
void monitor_stop(struct monitor *monitor);

#endif
