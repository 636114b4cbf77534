/* SPDX-License-Identifier: Apache-2.0 */
/* A CAN port that records the kernel's time stamps of frames. */
#include "app/bench/latency_tap.h"

#include <string.h>

/* Copies the state and the counters of the inner port. */
static void latency_tap_copy_state(struct latency_tap *tap)
{
    tap->port.state = tap->inner->state;
    tap->port.counters = tap->inner->counters;
}

/* Checks whether a frame was sent by this port. If so, removes it from the list of sent frames. */
static bool latency_tap_comes_back(struct latency_tap *tap, const struct bus_frame *frame)
{
    for (size_t i = 0; i < tap->nsent; i++) {
        const struct bus_frame *sent = &tap->sent[i];

        if (sent->id != frame->id || sent->flags != frame->flags || sent->len != frame->len ||
            memcmp(sent->data, frame->data, frame->len)) {
            continue;
        }
        if (!tap->sent_ns) {
            tap->sent_ns = frame->time_ns;
        }
        tap->nsent--;
        memmove(&tap->sent[i], &tap->sent[i + 1], (tap->nsent - i) * sizeof *tap->sent);
        return true;
    }
    return false;
}

/* Returns at most one received frame; skips frames that this port has sent. */
static size_t latency_tap_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct latency_tap *tap = (struct latency_tap *)port;

    while (max > 0) {
        if (tap->first == tap->nwaiting) {
            tap->first = 0;
            tap->nwaiting = tap->inner->ops->receive(tap->inner, tap->waiting, LATENCY_TAP_WAITING);
            latency_tap_copy_state(tap);
        }
        if (tap->nwaiting == 0) {
            return 0;
        }
        frames[0] = tap->waiting[tap->first++];
        if (!latency_tap_comes_back(tap, &frames[0])) {
            tap->frames++;
            tap->received_ns = frames[0].time_ns;
            return 1;
        }
    }
    return 0;
}

/* Sends frames and stores them until the interface returns them. */
static size_t latency_tap_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct latency_tap *tap = (struct latency_tap *)port;
    size_t sent;

    /* Drop the oldest frames that the interface has not returned, for example because it is down */
    for (size_t i = 0; i < count; i++) {
        if (tap->nsent == LATENCY_TAP_SENT) {
            tap->nsent--;
            memmove(tap->sent, tap->sent + 1, tap->nsent * sizeof *tap->sent);
        }
        tap->sent[tap->nsent++] = frames[i];
    }
    sent = tap->inner->ops->send(tap->inner, frames, count);
    latency_tap_copy_state(tap);
    return sent;
}

/* Returns the descriptor of the inner port. */
static int latency_tap_descriptor(const struct can_port *port)
{
    const struct latency_tap *tap = (const struct latency_tap *)port;

    return tap->inner->ops->descriptor(tap->inner);
}

/* Closes the inner port. */
static void latency_tap_close(struct can_port *port)
{
    struct latency_tap *tap = (struct latency_tap *)port;

    tap->inner->ops->close(tap->inner);
}

static const struct can_port_ops ops = {
    .name = "latency tap",
    .receive = latency_tap_receive,
    .send = latency_tap_send,
    .descriptor = latency_tap_descriptor,
    .close = latency_tap_close,
};

void latency_tap_mark(struct latency_tap *tap)
{
    tap->nsent = 0;
    tap->sent_ns = 0;
}

enum error_code latency_tap_create(struct can_port *inner, struct arena *arena,
                                   struct latency_tap **tap, struct error *error)
{
    *tap = arena_alloc(arena, 1, sizeof **tap);
    if (!*tap) {
        return error_set(error, ERROR_MEMORY, "no memory left to watch %s", inner->bus);
    }
    (*tap)->inner = inner;
    (*tap)->port = (struct can_port){.ops = &ops, .bus = inner->bus, .fd = inner->fd};
    latency_tap_copy_state(*tap);
    return ERROR_NONE;
}
