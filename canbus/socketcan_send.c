/* SPDX-License-Identifier: Apache-2.0 */
/* Sends by raw SocketCAN sockets in batches, and handles a full queue of the interface: the
 * newest frame of each identifier is held, and sent first when the queue moves again. */
#include "canbus/socketcan_private.h"

#include <errno.h>
#include <string.h>

enum {
    BACK_OFF_FIRST_NS = 10000000,
    BACK_OFF_LAST_NS = 1000000000,
};

/* ---- the interface's queue ---- */

void socketcan_note_queue_moving(struct socketcan *can)
{
    can->full_since_ns = can->back_off_ns = can->attempt_ns = 0;
    if (can->port.state == CAN_PORT_STUCK) {
        can->port.state = CAN_PORT_UP;
    }
}

/* Notes that the interface's queue is full, which is nothing unusual; if it stays full, no node
 * on the bus takes the frames. */
static void socketcan_note_queue_full(struct socketcan *can)
{
    const int64_t now = socketcan_clock_ns(CLOCK_MONOTONIC);

    can->port.counters.tx_queue_full++;
    if (!can->full_since_ns) {
        can->full_since_ns = now;
    }

    /* Full for so long is stuck: attempts become rarer (exponential back-off) */
    if (now - can->full_since_ns < SOCKETCAN_STUCK_NS) {
        return;
    }
    can->back_off_ns = can->back_off_ns ? 2 * can->back_off_ns : BACK_OFF_FIRST_NS;
    if (can->back_off_ns > BACK_OFF_LAST_NS) {
        can->back_off_ns = BACK_OFF_LAST_NS;
    }
    can->attempt_ns = now + can->back_off_ns;
    if (can->port.state != CAN_PORT_BUS_OFF) {
        can->port.state = CAN_PORT_STUCK;
    }
}

/* ---- batches ---- */

/* Converts a frame to the kernel's format; returns its size. Bytes beyond the data are zero, as
 * peers can see them. */
static size_t socketcan_encode_frame(const struct bus_frame *frame, struct canfd_frame *raw)
{
    memset(raw, 0, sizeof *raw);
    raw->can_id = frame->id;
    raw->can_id |= (frame->flags & FRAME_EXTENDED) ? CAN_EFF_FLAG : 0;
    raw->can_id |= (frame->flags & FRAME_REMOTE) ? CAN_RTR_FLAG : 0;
    raw->can_id |= (frame->flags & FRAME_ERROR) ? CAN_ERR_FLAG : 0;
    raw->len = frame->len;
    raw->flags |= (frame->flags & FRAME_BRS) ? CANFD_BRS : 0;
    raw->flags |= (frame->flags & FRAME_ESI) ? CANFD_ESI : 0;
    if (!(frame->flags & FRAME_REMOTE)) {
        memcpy(raw->data, frame->data, frame->len);
    }
    return (frame->flags & FRAME_FD) ? CANFD_MTU : CAN_MTU;
}

/* Fills the batch with frames up to the first one that the port may not send; returns how many. */
static size_t socketcan_fill_batch(struct socketcan *can, const struct bus_frame *frames,
                                   size_t count)
{
    size_t size = 0;

    for (; size < count && size < SOCKETCAN_BATCH && port_may_send(&can->port, &frames[size]);
         size++) {
        can->vector[size] = (struct iovec){
            .iov_base = &can->raw[size],
            .iov_len = socketcan_encode_frame(&frames[size], &can->raw[size]),
        };
        can->message[size] = (struct mmsghdr){
            .msg_hdr = {.msg_iov = &can->vector[size], .msg_iovlen = 1},
        };
    }
    return size;
}

/* Sends a batch of size frames; returns how many are done with: *taken of them by the kernel,
 * the others dropped because the device cannot carry them. */
static size_t socketcan_send_batch(struct socketcan *can, const struct bus_frame *frames,
                                   size_t size, size_t *taken)
{
    size_t slot = 0;

    while (slot < size) {
        const int sent =
            sendmmsg(can->socket, &can->message[slot], (unsigned)(size - slot), MSG_DONTWAIT);

        if (sent > 0) {
            for (int i = 0; i < sent; i++) {
                port_count_sent(&can->port, &frames[slot++]);
            }
            *taken += (size_t)sent;
            socketcan_note_queue_moving(can);
            /* || A frame that the device cannot carry is skipped */
        } else if (errno == EINVAL || errno == EMSGSIZE) {
            slot++;
            can->port.counters.tx_dropped++;
        } else if (errno == ENOBUFS || errno == EAGAIN) {
            socketcan_note_queue_full(can);
            break;
        } else {
            if (socketcan_error_means_lost(errno)) {
                socketcan_lose_interface(can, errno);
            }
            break;
        }
    }
    return slot;
}

/* Sends frames until one does not go; returns how many are done with: *taken of them by the kernel,
 * the others are dropped. */
static size_t socketcan_transmit(struct socketcan *can, const struct bus_frame *frames,
                                 size_t count, size_t *taken)
{
    size_t at = 0;

    while (at < count) {
        const size_t size = socketcan_fill_batch(can, frames + at, count - at);
        const size_t done = socketcan_send_batch(can, frames + at, size, taken);

        at += done;
        if (done < size) {
            break;
        }
        if (at < count && !port_may_send(&can->port, &frames[at])) {
            can->port.counters.tx_dropped++;
            at++;
        }
    }
    return at;
}

/* ---- held frames ---- */

/* Checks whether two frames have the same identifier and format. */
static bool socketcan_same_identifier(const struct bus_frame *a, const struct bus_frame *b)
{
    return a->id == b->id && !((a->flags ^ b->flags) & (FRAME_EXTENDED | FRAME_REMOTE));
}

/* Holds a frame that met a full queue, in the place of an older one of its identifier; false =
 * there was no room and it is dropped. */
static bool socketcan_hold_frame(struct socketcan *can, const struct bus_frame *frame)
{
    struct can_counters *counters = &can->port.counters;
    size_t i = 0;

    while (i < can->nheld && !socketcan_same_identifier(&can->held[i], frame)) {
        i++;
    }
    if (!port_may_send(&can->port, frame) || i == SOCKETCAN_HELD_MAX) {
        counters->tx_dropped++;
        return false;
    }
    if (i < can->nheld) {
        counters->tx_dropped++;
    } else {
        can->nheld++;
    }
    can->held[i] = *frame;
    counters->tx_held++;
    return true;
}

bool socketcan_send_held(struct socketcan *can)
{
    size_t done, taken = 0;

    if (!can->nheld) {
        return true;
    }
    if (can->attempt_ns && socketcan_clock_ns(CLOCK_MONOTONIC) < can->attempt_ns) {
        return false;
    }
    done = socketcan_transmit(can, can->held, can->nheld, &taken);
    if (socketcan_is_lost(&can->port)) {
        return false;
    }
    can->nheld -= done;
    memmove(can->held, can->held + done, can->nheld * sizeof *can->held);
    return can->nheld == 0;
}

size_t socketcan_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct socketcan *can = socketcan_of_port(port);
    size_t accepted = 0, at = 0;

    if (socketcan_is_lost(port)) {
        socketcan_find_interface(can);
    }
    if (!socketcan_is_lost(port) && socketcan_send_held(can)) {
        at = socketcan_transmit(can, frames, count, &accepted);
    }

    /* Frames that found the queue full are held */
    for (; at < count && can->full_since_ns; at++) {
        accepted += socketcan_hold_frame(can, &frames[at]);
    }
    port->counters.tx_dropped += count - at;
    return accepted;
}
