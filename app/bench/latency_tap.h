/* SPDX-License-Identifier: Apache-2.0 */
/* A CAN port that records the kernel's time stamps of sent and received frames. Not RT-safe. */
#ifndef APP_BENCH_LATENCY_TAP_H
#define APP_BENCH_LATENCY_TAP_H

#include "canbus/port.h"

enum { LATENCY_TAP_SENT = 64, LATENCY_TAP_WAITING = 64 };

struct latency_tap {
    struct can_port port;
    struct can_port *inner;
    struct bus_frame waiting[LATENCY_TAP_WAITING]; /* received, not yet returned */
    size_t first, nwaiting;
    struct bus_frame sent[LATENCY_TAP_SENT]; /* sent, but not yet returned by the interface */
    size_t nsent;
    uint64_t frames;     /* number of frames returned to the caller */
    int64_t sent_ns;     /* time of the first frame sent after the mark; 0 = none yet */
    int64_t received_ns; /* time at which the last returned frame was received */
};

/* Creates a tap around inner. Its receive function returns at most one frame. inner stays open if
 * there is no memory. Not RT-safe. */
enum error_code latency_tap_create(struct can_port *inner, struct arena *arena,
                                   struct latency_tap **tap, struct error *error);

/* Forgets the frames sent so far. sent_ns then receives the time of the next sent frame. */
void latency_tap_mark(struct latency_tap *tap);

#endif
