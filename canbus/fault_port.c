/* SPDX-License-Identifier: Apache-2.0 */
/* Applies fault rules (loss, corruption, delay, duplication, bus-off) to the frames of a port, and
 * stores delayed frames. */
#include "canbus/fault_port.h"

#include "base/random.h"
#include "canbus/port_private.h"

#include <stdio.h>
#include <string.h>

enum { BATCH = 64 };

struct fault_port_armed {
    struct fault_port_rule rule;
    struct random_stream random;
};

struct fault_port_held_frame {
    int64_t due_ns;
    struct bus_frame frame;
};

/* Delayed frames of one direction, in the order of sending. Delays may differ, so due frames can be
 * anywhere in the list. */
struct fault_port_held {
    struct fault_port_held_frame *frame;
    size_t count;
    uint64_t dropped;
};

struct fault_port_direction {
    struct fault_port_armed *rule;
    struct fault_port_held held;
};

struct fault_port {
    struct can_port port;
    struct fault_port_config config;
    struct fault_port_direction rx, tx;
    int64_t now_ns;
    uint64_t refused; /* frames sent while bus-off */
};

static struct fault_port *fault_port_of(const struct can_port *port)
{
    return container_of(port, struct fault_port, port);
}

/* ---- rules ---- */

/* Checks whether a bus-off rule is active. */
static bool fault_port_is_off(const struct fault_port *f)
{
    for (size_t i = 0; i < f->config.nrule; i++) {
        if (f->config.rule[i].kind == FAULT_PORT_BUS_OFF && *f->config.rule[i].active) {
            return true;
        }
    }
    return false;
}

/* Checks whether a frame (STEP or DONE) is exempt from faults. It passes even in bus-off. */
static bool fault_port_exempts(const struct fault_port *f, const struct bus_frame *frame)
{
    return frame_has_standard_id(frame, f->config.exempt, f->config.nexempt);
}

/* Checks whether an active rule applies to a frame. The frame has the rule's identifier, or the
 * rule is for all frames and the frame is not exempt. */
static bool fault_port_rule_matches(const struct fault_port *f, const struct fault_port_rule *rule,
                                    const struct bus_frame *frame)
{
    if (!*rule->active || (frame->flags & FRAME_ERROR)) {
        return false;
    }
    if (rule->id >= 0) {
        return frame->id == (uint32_t)rule->id;
    }
    return !fault_port_exempts(f, frame);
}

/* Stores a frame until due_ns. Without room, drops and counts it. */
static void fault_port_hold_frame(struct fault_port_direction *d, const struct bus_frame *frame,
                                  int64_t due_ns)
{
    if (d->held.count == FAULT_PORT_HELD) {
        d->held.dropped++;
        return;
    }
    d->held.frame[d->held.count++] = (struct fault_port_held_frame){due_ns, *frame};
}

/* Applies the rules to a frame. Writes up to two frames to out and returns their number; stores or
 * drops the others. */
static size_t fault_port_apply_rules(struct fault_port *f, struct fault_port_direction *d,
                                     const struct bus_frame *from, struct bus_frame out[2])
{
    struct bus_frame frame = *from;
    int64_t delay_ns = 0;
    size_t copies = 1;

    /* Apply the rules in order; each rule draws from its own random stream */
    for (size_t i = 0; i < f->config.nrule; i++) {
        struct fault_port_armed *rule = &d->rule[i];
        const struct fault_port_rule *r = &rule->rule;

        if (!fault_port_rule_matches(f, r, &frame)) {
            continue;
        }
        if (r->kind == FAULT_PORT_LATE) {
            delay_ns += r->delay_ns;
        } else if (r->kind != FAULT_PORT_BUS_OFF &&
                   random_uniform(&rule->random) < r->probability) {
            if (r->kind == FAULT_PORT_LOSS) {
                return 0;
            }
            if (r->kind == FAULT_PORT_CORRUPTION) {
                if (frame.len > 0) {
                    uint64_t bit = random_bits(&rule->random) % (8u * frame.len);

                    frame.data[bit / 8] ^= (uint8_t)(1u << bit % 8);
                }
            } else {
                copies = 2;
            }
        }
    }

    /* Pass on the frame and its duplicate now, or hold them until their delay is over */
    for (size_t i = 0; i < copies; i++) {
        if (delay_ns > 0) {
            fault_port_hold_frame(d, &frame, f->now_ns + delay_ns);
        } else {
            out[i] = frame;
        }
    }
    return delay_ns > 0 ? 0 : copies;
}

/* Removes the due frames, in order, at most max. Returns their number. */
static size_t fault_port_release_due(struct fault_port *f, struct fault_port_direction *d,
                                     struct bus_frame *out, size_t max)
{
    size_t released = 0, kept = 0;

    for (size_t i = 0; i < d->held.count; i++) {
        if (released < max && d->held.frame[i].due_ns <= f->now_ns) {
            out[released++] = d->held.frame[i].frame;
        } else {
            d->held.frame[kept++] = d->held.frame[i];
        }
    }
    d->held.count = kept;
    return released;
}

/* ---- the port ---- */

/* Copies state and counters of the inner port, and adds what the rules dropped and refused. */
static void fault_port_copy_state(struct fault_port *f)
{
    f->port.counters = f->port.inner->counters;
    f->port.counters.tx_dropped += f->tx.held.dropped + f->refused;
    f->port.counters.rx_dropped += f->rx.held.dropped;
    f->port.state = fault_port_is_off(f) ? CAN_PORT_BUS_OFF : f->port.inner->state;
}

/* Receives up to max frames: first stored ones that are due, then frames of the inner port after
 * the rules. */
static size_t fault_port_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct fault_port *f = fault_port_of(port);
    size_t count, got;
    bool off = fault_port_is_off(f);

    /* In bus-off, stored frames are lost; otherwise due frames come first */
    if (off) {
        f->rx.held.count = f->tx.held.count = 0;
    }
    count = fault_port_release_due(f, &f->rx, frames, max);

    /* Then receive from the inner port; store frames that do not fit */
    do {
        struct bus_frame batch[BATCH], out[2];
        size_t room = max - count;

        got = room ? can_receive(f->port.inner, batch, room < BATCH ? room : BATCH) : 0;
        for (size_t i = 0; i < got; i++) {
            size_t n = off && !fault_port_exempts(f, &batch[i])
                           ? 0
                           : fault_port_apply_rules(f, &f->rx, &batch[i], out);

            for (size_t k = 0; k < n; k++) {
                if (count < max) {
                    frames[count++] = out[k];
                } else {
                    fault_port_hold_frame(&f->rx, &out[k], f->now_ns); /* for the next call */
                }
            }
        }
    } while (got > 0);
    fault_port_copy_state(f);
    return count;
}

/* Sends due stored frames, then new frames after the rules. Returns how many new ones were
 * accepted. */
static size_t fault_port_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct fault_port *f = fault_port_of(port);
    struct bus_frame batch[BATCH];
    size_t waiting, refused = 0, lost = 0;
    bool off = fault_port_is_off(f);

    /* Send due held frames first */
    do {
        waiting = off ? 0 : fault_port_release_due(f, &f->tx, batch, BATCH);
        if (waiting > 0) {
            can_send(f->port.inner, batch, waiting);
        }
    } while (waiting == BATCH);
    /* Send the new frames in batches; duplication can double a frame */
    waiting = 0;
    for (size_t i = 0; i < count; i++) {
        if (off && !fault_port_exempts(f, &frames[i])) {
            lost++;
        } else {
            waiting += fault_port_apply_rules(f, &f->tx, &frames[i], batch + waiting);
        }
        if (waiting + 2 > BATCH || i + 1 == count) {
            refused += waiting - (waiting ? can_send(f->port.inner, batch, waiting) : 0);
            waiting = 0;
        }
    }
    /* Bus-off refuses frames. A loss rule accepts them, because the sender must not notice the
     * loss */
    f->refused += lost;
    refused += lost;
    fault_port_copy_state(f);
    return refused < count ? count - refused : 0;
}

size_t fault_port_hear(struct can_port *port, const struct bus_frame *frame,
                       struct bus_frame out[2])
{
    struct fault_port *f = fault_port_of(port);

    return fault_port_is_off(f) ? 0 : fault_port_apply_rules(f, &f->rx, frame, out);
}

static const struct can_port_ops ops = {
    .name = "fault",
    .receive = fault_port_receive,
    .send = fault_port_send,
    .descriptor = port_inner_descriptor,
    .close = port_inner_close,
};

void fault_port_time(struct can_port *port, int64_t time_ns)
{
    fault_port_of(port)->now_ns = time_ns;
    fault_port_copy_state(
        fault_port_of(port)); /* the rules' counts may have gone back with virtual time */
}

/* Arms the rules of one direction, each with its own random stream. Allocates the list of held
 * frames. */
static bool fault_port_create_direction(struct fault_port *f, struct fault_port_direction *d,
                                        const char *name, struct arena *arena)
{
    d->rule = arena_alloc(arena, f->config.nrule, sizeof *d->rule);
    d->held.frame = arena_alloc(arena, FAULT_PORT_HELD, sizeof *d->held.frame);
    for (size_t i = 0; d->rule && i < f->config.nrule; i++) {
        const struct fault_port_rule *rule = &f->config.rule[i];
        char stream[128];

        snprintf(stream, sizeof stream, "%s %s %s", name, f->port.inner->bus, rule->stream);
        d->rule[i] = (struct fault_port_armed){*rule, random_named(f->config.seed, stream)};
    }
    return d->rule && d->held.frame;
}

enum error_code fault_port_create(const struct fault_port_config *config, struct arena *arena,
                                  struct can_port **port, struct error *error)
{
    struct fault_port *f = arena_alloc(arena, 1, sizeof *f);
    struct fault_port_rule *rules = arena_alloc(arena, config->nrule, sizeof *rules);

    if (!f || !rules) {
        return error_set(error, ERROR_MEMORY, "no memory left for the faults of a bus");
    }
    memcpy(rules, config->rule, config->nrule * sizeof *rules);
    f->config = *config;
    f->config.rule = rules;
    f->port = (struct can_port){
        .ops = &ops, .bus = config->port->bus, .fd = config->port->fd, .inner = config->port};
    if (!fault_port_create_direction(f, &f->rx, "rx", arena) ||
        !fault_port_create_direction(f, &f->tx, "tx", arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the faults of a bus");
    }
    fault_port_copy_state(f);
    *port = &f->port;
    return ERROR_NONE;
}
