/* SPDX-License-Identifier: Apache-2.0 */
/* Plays recorded frames before the received frames of a port. */
#include "canbus/replay_port.h"

#include "canbus/port_private.h"

struct replay_port {
    struct can_port port;
    struct replay_port_config config;
    size_t next;                /* index of the next frame */
    struct can_counters played; /* counters of played frames */
};

static struct replay_port *replay_port_of(const struct can_port *port)
{
    return container_of(port, struct replay_port, port);
}

/* Copies state and counters of the inner port, and adds the played frames. */
static void replay_port_copy_state(struct replay_port *r)
{
    r->port.counters = r->config.port->counters;
    r->port.counters.rx_frames += r->played.rx_frames;
    r->port.counters.rx_bits += r->played.rx_bits;
    r->port.counters.fast_bits += r->played.fast_bits;
    r->port.state = r->config.port->state;
}

/* Receives due recorded frames, then frames of the inner port. */
static size_t replay_port_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct replay_port *r = replay_port_of(port);
    const struct replay_port_config *config = &r->config;
    size_t count = 0;

    for (; count < max && r->next < config->count &&
           config->frame[r->next].time_ns <= *config->now_ns;
         count++) {
        frames[count] = config->frame[r->next++];
        r->played.rx_frames++;
        r->played.rx_bits += frame_bits(&frames[count]);
        r->played.fast_bits += frame_fast_bits(&frames[count]);
    }
    count += count < max ? can_receive(config->port, frames + count, max - count) : 0;
    replay_port_copy_state(r);
    return count;
}

static size_t replay_port_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct replay_port *r = replay_port_of(port);
    size_t sent = can_send(r->config.port, frames, count);

    replay_port_copy_state(r);
    return sent;
}

static const struct can_port_ops replay_port_ops = {
    .name = "replay",
    .receive = replay_port_receive,
    .send = replay_port_send,
    .descriptor = port_inner_descriptor,
    .close = port_inner_close,
};

enum error_code replay_port_create(const struct replay_port_config *config, struct arena *arena,
                                   struct can_port **port, struct error *error)
{
    struct replay_port *made = arena_alloc(arena, 1, sizeof *made);

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the frames to play");
    }
    made->config = *config;
    made->port = (struct can_port){.ops = &replay_port_ops,
                                   .bus = config->port->bus,
                                   .fd = config->port->fd,
                                   .inner = config->port};
    replay_port_copy_state(made);
    *port = &made->port;
    return ERROR_NONE;
}
