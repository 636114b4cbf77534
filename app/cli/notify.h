/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Notifies a service manager by the datagrams of sd_notify(3), and feeds its watchdog. Without a
 * manager (no NOTIFY_SOCKET) nothing here has any effect. Not RT-safe: for the monitor's thread.
 */
#ifndef APP_CLI_NOTIFY_H
#define APP_CLI_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/un.h>

/* The connection to a manager. */
struct notify {
    int descriptor; /* -1 = no manager listens */
    struct sockaddr_un address;
    socklen_t length;
    int64_t
        watchdog_ns; /* the manager kills a service that is silent for so long; 0 = it does not */
    /* the watchdog's state */
    bool ready;
    uint64_t beat;
    int64_t feed_ns;
};

/* State of the loop, as the monitor sees it. */
struct notify_health {
    bool ready;    /* the first tick has run, or in lockstep the loop waits for its STEP */
    uint64_t beat; /* changes while the loop lives: with each tick, and while it waits for a STEP */
};

/* Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and removes them from the environment so
 * that no child process notifies in this one's name. A socket that cannot be reached counts as
 * none. */
void notify_open(struct notify *notify);

/* Call it once a period of the monitor: sends READY=1 when the loop is ready, then feeds the
 * watchdog at half its time, as long as the beat has changed since it was last fed. (A run that
 * fails ends, and the manager sees its exit status.) */
void notify_watch(struct notify *notify, const struct notify_health *health, int64_t now_ns);

/* Sends the line that `systemctl status` shows. */
void notify_status(const struct notify *notify, const char *text);

/* Announce that the run is ending (STOPPING=1), or restarting (RELOADING=1) until the next
 * READY=1. */
void notify_stopping(const struct notify *notify);
void notify_reloading(struct notify *notify);

void notify_close(struct notify *notify);

#endif
