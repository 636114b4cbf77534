/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Measures the time from a frame that goes out to the frame that answers it, by the kernel's time
 * stamps: for an echo by a bare thread on the same interface, and for boards, virtual or real, from
 * the command that switches a motor to the first telemetry that says so. Beside them how late a
 * timer wakes the measuring thread, as cyclictest does. One sample of each in turn. Not RT-safe.
 */
#ifndef APP_BENCH_LATENCY_H
#define APP_BENCH_LATENCY_H

#include "canbus/port.h"
#include "rt/histogram.h"
#include "tasks/host.h"

#include <stdio.h>

/* Extended identifiers that no board here knows and that lose every arbitration. */
enum { LATENCY_PING = 0x1ffffff0, LATENCY_PONG = 0x1ffffff1 };

enum latency_kind { LATENCY_WAKE_UP, LATENCY_ECHO, LATENCY_BOARDS, LATENCY_KINDS };

/* The samples of all kinds. */
struct latency_result {
    struct histogram of[LATENCY_KINDS];
    uint64_t lost[LATENCY_KINDS]; /* samples without an answer within LATENCY_TIMEOUT_NS */
};

#define LATENCY_TIMEOUT_NS INT64_C(1000000000)

/* The boards that are measured; tap[bus] are the host's ports. */
struct latency_boards {
    struct host *host;
    struct latency_tap **tap;
    size_t nbus, axis, bus; /* axis whose motor is switched, and its bus */
    int64_t period_ns;      /* of the host */
    const char *joint;
};

/* Finds and configures the boards and switches the motor off; leaves the others as they are.
 * ERROR_SYSTEM with the host's message when they do not answer. */
enum error_code latency_find_boards(const struct latency_boards *boards, struct error *error);

/* Takes count samples of each kind, in turn; boards may be NULL. ping hears its own frames
 * (receive_own) and pongs; echo is the port of the echo, which runs in a thread of its own with the
 * priority. Ends early when *stop is set. Leaves the motor off. */
enum error_code latency_measure(const struct latency_boards *boards, struct latency_tap *ping,
                                struct can_port *echo, int priority, size_t count,
                                const volatile bool *stop, struct latency_result *result,
                                struct error *error);

/* Prints a table of percentiles, us, and how many samples lie between 1, 2, 5, 10 ... us. */
void latency_print(const struct latency_result *result, const char *joint, FILE *out);

/* Writes every bucket that is not empty: its upper edge in us, and the counts. */
void latency_write_csv(const struct latency_result *result, FILE *out);

/* ---- ports that tell when frames passed the kernel (latency_tap.c) ---- */

enum { LATENCY_TAP_SENT = 64, LATENCY_TAP_WAITING = 64 };

struct latency_tap {
    struct can_port port;
    struct can_port *inner;
    struct bus_frame waiting[LATENCY_TAP_WAITING]; /* received, but not handed on yet */
    size_t first, nwaiting;
    struct bus_frame sent[LATENCY_TAP_SENT]; /* sent, but not come back yet */
    size_t nsent;
    uint64_t frames;     /* frames handed on so far */
    int64_t sent_ns;     /* time at which the first frame sent after the mark left; 0 = not yet */
    int64_t received_ns; /* time at which the last frame handed on came in */
};

/* Creates a tap, whose receive hands on one frame at most. inner stays open when there is no
 * memory. Not RT-safe. */
enum error_code latency_tap_create(struct can_port *inner, struct arena *arena,
                                   struct latency_tap **tap, struct error *error);

/* Makes the next frame that is sent the one whose time counts. */
void latency_tap_mark(struct latency_tap *tap);

#endif
