/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Notifies a service manager by datagrams of sd_notify(3), and feeds its watchdog. Without a
 * manager (no NOTIFY_SOCKET) all functions do nothing. Not RT-safe: only for the monitor's thread.
 */
#ifndef APP_CLI_NOTIFY_H
#define APP_CLI_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/un.h>

/* The connection to a manager. */
struct notify {
    int descriptor; /* -1 = no manager */
    struct sockaddr_un address;
    socklen_t length;
    /* the manager kills a service after this time without a notification; 0 = never */
    int64_t watchdog_ns;
    /* the watchdog's state */
    bool ready;
    uint64_t beat;
    int64_t feed_ns;
};

/* State of the loop for the monitor. */
struct notify_health {
    bool ready; /* the first tick has run, or the loop waits for its STEP in lockstep */
    /* changes while the loop is alive: with each tick, and while it waits for a STEP */
    uint64_t beat;
};

/* Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and removes them from the environment so
 * that no child process sends notifications for this one. An unreachable socket counts as no
 * manager. */
void notify_open(struct notify *notify);

/* Call it once per period of the monitor. Sends READY=1 when the loop is ready. Then feeds the
 * watchdog after half of its time, if the beat has changed since the last feed. A failed run ends,
 * and the manager gets its exit status. */
void notify_watch(struct notify *notify, const struct notify_health *health, int64_t now_ns);

/* Sends the status line for `systemctl status`. */
void notify_status(const struct notify *notify, const char *text);

/* Announce that the run is ending (STOPPING=1), or restarting (RELOADING=1) until the next
 * READY=1. */
void notify_stopping(const struct notify *notify);
void notify_reloading(struct notify *notify);

void notify_close(struct notify *notify);

#endif
