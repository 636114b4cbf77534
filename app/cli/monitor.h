/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Background thread of a run: prints events (rate-limited) and the status line. On a terminal it
 * updates the line in place four times a second, otherwise it prints a line every five seconds. A
 * service manager gets the status instead of lines, and notifications that the run is alive. Not
 * RT-safe.
 */
#ifndef APP_CLI_MONITOR_H
#define APP_CLI_MONITOR_H

#include "app/cli/eventlog.h"
#include "app/cli/notify.h"
#include "sim/simulator.h"

#include <pthread.h>

/* Inputs of the thread; the caller owns the pointers. */
struct monitor_config {
    struct simulator *simulator;
    struct notify *manager;      /* owned by the caller */
    FILE *out;                   /* stderr, or a test's file */
    bool terminal, quiet;        /* quiet: events, but no status */
    void (*each)(void *context); /* called in the thread once per period; NULL = none */
    /* Called in the thread with each event; NULL = none */
    void (*event)(void *context, uint64_t key, const char *text);
    void *context;
};

struct monitor {
    struct monitor_config config;
    struct eventlog log;
    atomic_bool stop;
    bool replaced; /* another run will follow, so this one is no longer ready; `each` sets it */
    pthread_t thread;
    int64_t next_status_ns;
    /* Values at the last status line, for the real-time factor and the loads */
    struct simulator_status last;
};

/* Starts the thread. */
enum error_code monitor_start(struct monitor *monitor, const struct monitor_config *config,
                              struct error *error);

/* Prints the remaining events and joins the thread. */
void monitor_stop(struct monitor *monitor);

#endif
