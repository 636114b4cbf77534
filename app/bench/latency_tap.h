/* SPDX-License-Identifier: Apache-2.0 */
/* A port that notes when the frames that are sent and received passed the kernel. Not RT-safe. */
#ifndef APP_BENCH_LATENCY_TAP_H
#define APP_BENCH_LATENCY_TAP_H

#include "canbus/port.h"

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
