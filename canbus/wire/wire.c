/* SPDX-License-Identifier: Apache-2.0 */
/* Time, arbitration, and frames that go well. */
#include "canbus/wire/private.h"

#include <string.h>

enum { QUEUE_MAX = 4096, FOREIGN_QUEUE = 1 };

#define WINDOW_DEFAULT_NS 100000000

/* ---- creation ---- */

static enum error_code check_config(const struct wire_config *config, struct error *error)
{
    if (config->nodes < 1 || config->nodes > WIRE_NODES_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu nodes on a wire, expected 1 to %d",
                         config->nodes, WIRE_NODES_MAX);
    }
    if (config->queue < 1 || config->queue > QUEUE_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found a transmit queue of %zu frames, expected 1 to %d", config->queue,
                         QUEUE_MAX);
    }
    if (config->bitrate < 1000 || config->bitrate > 1000000) {
        return error_set(error, ERROR_INPUT, "found a bit rate of %lld bit/s, expected 1000 to 1e6",
                         (long long)config->bitrate);
    }
    if (config->data_bitrate &&
        (config->data_bitrate < config->bitrate || config->data_bitrate > 20000000)) {
        return error_set(error, ERROR_INPUT,
                         "found a data bit rate of %lld bit/s, expected the nominal %lld to 20e6",
                         (long long)config->data_bitrate, (long long)config->bitrate);
    }
    if (config->window_ns < 0) {
        return error_set(error, ERROR_INPUT, "found a negative window of the load");
    }
    return ERROR_NONE;
}

static bool create_node(struct wire_node *node, size_t queue, struct arena *arena)
{
    node->slot = arena_alloc(arena, queue, sizeof *node->slot);
    node->heap = arena_alloc(arena, queue, sizeof *node->heap);
    node->spare = arena_alloc(arena, queue, sizeof *node->spare);
    if (!node->slot || !node->heap || !node->spare) {
        return false;
    }
    while (node->nspare < queue) {
        node->spare[node->nspare] = (uint16_t)(queue - 1 - node->nspare);
        node->nspare++;
    }
    return true;
}

enum error_code wire_create(const struct wire_config *config, struct arena *arena,
                            struct wire **out, struct error *error)
{
    struct wire *wire;
    enum error_code code = check_config(config, error);
    bool good;

    if (code) {
        return code;
    }
    wire = arena_alloc(arena, 1, sizeof *wire);
    good = wire && (wire->node = arena_alloc(arena, config->nodes + 1, sizeof *wire->node));
    for (size_t i = 0; good && i <= config->nodes; i++) {
        good =
            create_node(&wire->node[i], i < config->nodes ? config->queue : FOREIGN_QUEUE, arena);
    }
    if (!good) {
        return error_set(error, ERROR_MEMORY, "no memory for a wire of %zu nodes", config->nodes);
    }
    wire->config = *config;
    if (!config->data_bitrate) {
        wire->config.data_bitrate = config->bitrate;
    }
    if (!config->window_ns) {
        wire->config.window_ns = WINDOW_DEFAULT_NS;
    }
    if (!config->events) {
        wire->config.events = UINT32_MAX;
    }
    wire_tables_make(&wire->tables);
    wire->all = WIRE_BIT(config->nodes) - 1;
    wire->intermission_ns = wire_bits_ns(wire, WIRE_INTERMISSION_BITS);
    wire->delimiter_ns = wire_bits_ns(wire, WIRE_DELIMITER_BITS);
    wire->random = random_named(config->seed, "wire");
    wire->size = (size_t)(arena->memory + arena->used - (unsigned char *)wire);
    *out = wire;
    return ERROR_NONE;
}

void *wire_memory(struct wire *wire, size_t *size)
{
    *size = wire->size;
    return wire;
}

int64_t wire_now(const struct wire *wire)
{
    return wire->now_ns;
}

void wire_notify(const struct wire *wire, const struct wire_event *event)
{
    if (wire->config.notify && wire->config.events & 1u << event->kind) {
        wire->config.notify(wire->config.context, event);
    }
}

/* ---- arbitration ---- */

static inline int64_t may_start(const struct wire *wire, size_t index)
{
    const struct wire_node *node = &wire->node[index];
    int64_t at = node->slot[node->heap[0]].ready_ns;

    at = wire->idle_ns > at ? wire->idle_ns : at;
    return node->hold_ns > at ? node->hold_ns : at;
}

/* Who starts next. */
struct contest {
    int64_t at_ns;   /* WIRE_NEVER: nobody */
    uint64_t winner; /* those with the frame of the lowest priority number */
    uint64_t loser;  /* the others that start at that time */
};

static inline struct contest next_contest(const struct wire *wire)
{
    struct contest next = {.at_ns = WIRE_NEVER};
    uint32_t lowest = UINT32_MAX;
    size_t index;

    WIRE_FOR_EACH(index, wire->pending & ~wire->unplugged)
    {
        const struct wire_node *node = &wire->node[index];
        const uint32_t priority = node->slot[node->heap[0]].priority;
        const int64_t at = may_start(wire, index);
        const uint64_t bit = WIRE_BIT(index);

        if (at < next.at_ns) {
            next = (struct contest){.at_ns = at, .winner = bit};
            lowest = priority;
        } else if (at > next.at_ns) {
            continue;
        } else if (priority < lowest) {
            next.loser |= next.winner;
            next.winner = bit;
            lowest = priority;
        } else if (priority == lowest) {
            next.winner |= bit;
        } else {
            next.loser |= bit;
        }
    }
    return next;
}

static void tell_losers(struct wire *wire, uint64_t losers, const struct bus_frame *frame)
{
    size_t index;

    WIRE_FOR_EACH(index, losers)
    {
        wire->node[index].stats.arbitration_lost++;
        wire->stats.arbitration_lost++;
        if (!(wire->config.events & 1 << WIRE_ARBITRATION_LOST)) {
            continue;
        }
        wire_notify(wire, &(struct wire_event){.kind = WIRE_ARBITRATION_LOST,
                                               .time_ns = wire->flight.start_ns,
                                               .node = index,
                                               .frame = frame});
    }
}

/* Takes the head of the queue to the wire; the controller says itself in FD frames that it is error
 * passive. */
static void take_off(struct wire *wire, size_t index)
{
    struct wire_node *node = &wire->node[index];
    struct bus_frame *frame;

    node->flying = wire_queue_pop(wire, node);
    wire->pending &= node->waiting ? UINT64_MAX : ~WIRE_BIT(index);
    frame = &node->slot[node->flying].frame;
    if (frame->flags & FRAME_FD) {
        frame->flags &= (uint8_t)~FRAME_ESI;
        frame->flags |= wire_is_passive(node) ? FRAME_ESI : 0;
    }
}

static void start(struct wire *wire, const struct contest *contest)
{
    struct wire_flight *flight = &wire->flight;
    const int64_t time_ns = contest->at_ns;
    struct bus_frame *frame;
    size_t index;

    *flight = (struct wire_flight){.busy = true, .start_ns = time_ns, .senders = contest->winner};
    WIRE_FOR_EACH(index, flight->senders)
    {
        take_off(wire, index);
    }
    if (wire->off) {
        wire_count_runs(wire, time_ns);
    }
    frame = &wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame;
    frame->time_ns = time_ns;
    tell_losers(wire, contest->loser, frame);
    flight->end_ns = time_ns + wire_length_ns(wire_frame_length(&wire->tables, frame),
                                              wire->config.bitrate, wire->config.data_bitrate);
    if (wire->armed || wire->mismatched || (flight->senders & (flight->senders - 1)) ||
        !wire_listeners(wire)) {
        flight->disturbed = true;
        wire_disturb(wire);
    }
}

/* ---- the end of a frame ---- */

static void deliver(struct wire *wire, size_t sender, const struct bus_frame *frame,
                    uint64_t receivers)
{
    if (receivers) {
        wire_notify(wire, &(struct wire_event){.kind = WIRE_TRANSMIT,
                                               .time_ns = frame->time_ns,
                                               .node = sender,
                                               .frame = frame,
                                               .receivers = receivers});
    }
}

static void deliver_later(struct wire *wire, size_t sender, const struct bus_frame *frame,
                          uint64_t receivers)
{
    struct wire_late *late = &wire->late[wire->nlate];

    if (wire->nlate == WIRE_LATE_MAX) {
        wire_count_drop(wire, sender, WIRE_DROP_LATE_FULL);
        return;
    }
    wire->nlate++;
    late->frame = *frame;
    late->frame.time_ns = late->time_ns = frame->time_ns + wire->flight.late_ns;
    late->node = sender;
    late->receivers = receivers;
}

static void confirm(struct wire *wire, size_t index)
{
    struct wire_node *node = &wire->node[index];
    struct wire_slot *slot = &node->slot[node->flying];

    slot->frame.time_ns = wire->flight.end_ns;
    node->stats.confirmed++;
    if (index < wire->config.nodes) {
        wire_latency_add(wire, &slot->frame, wire->flight.end_ns - slot->ready_ns);
    }
    if (wire->config.events & 1 << WIRE_CONFIRM) {
        wire_notify(wire, &(struct wire_event){.kind = WIRE_CONFIRM,
                                               .time_ns = wire->flight.end_ns,
                                               .node = index,
                                               .frame = &slot->frame});
    }
    wire_slot_free(wire, node, node->flying);
}

static void finish_good(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    const uint64_t listeners = wire_listeners(wire);
    const uint64_t receivers = listeners & ~(flight->lost | flight->blind);
    const size_t sender = (size_t)__builtin_ctzll(flight->senders);
    struct bus_frame *frame = &wire_flying(wire, sender)->frame;
    size_t index;

    frame->time_ns = flight->end_ns;
    wire->stats.frames++;
    deliver(wire, sender, frame, receivers & ~flight->late);
    if (receivers & flight->late) {
        deliver_later(wire, sender, frame, receivers & flight->late);
    }
    if (flight->repeat) {
        return;
    }
    WIRE_FOR_EACH(index, flight->senders)
    {
        confirm(wire, index);
    }
    WIRE_FOR_EACH(index, wire->counting & (flight->senders | (listeners & ~flight->blind)))
    {
        bool sent = flight->senders & WIRE_BIT(index);

        wire_count_errors(wire, index, flight->end_ns, sent ? -1 : 0, sent ? 0 : -1);
    }
}

/* Gives frames back to the queues of nodes that could not send them. */
static void take_back(struct wire *wire, uint64_t nodes)
{
    size_t index;

    WIRE_FOR_EACH(index, nodes)
    {
        struct wire_node *node = &wire->node[index];

        if (index == wire->config.nodes) {
            wire_slot_free(wire, node, node->flying);
        } else if (wire->off & WIRE_BIT(index)) {
            wire_slot_free(wire, node, node->flying);
            wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        } else {
            wire_queue_push(wire, node, node->flying);
            wire->pending |= WIRE_BIT(index);
        }
    }
}

/* What else there is to do when not all is well with the frame or with those who sent it. */
static void finish_disturbed(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    const uint64_t senders = flight->senders | flight->beaten;
    const uint64_t gone = senders & (wire->off | wire->unplugged);
    size_t index;

    /* Who was unplugged or put into bus-off meanwhile has sent nothing */
    take_back(wire, gone);
    flight->senders &= ~gone;
    flight->beaten &= ~gone;
    if (flight->senders && !flight->failed) {
        finish_good(wire);
    }
    if (flight->failed || flight->repeat) {
        take_back(wire, flight->senders);
    }
    take_back(wire, flight->beaten);
    if (flight->failed || flight->repeat || flight->beaten || flight->blind) {
        wire_finish_error(wire);
    }
    WIRE_FOR_EACH(index, senders & wire->counting)
    {
        if (wire_is_passive(&wire->node[index])) {
            wire->node[index].hold_ns = wire->idle_ns + wire_bits_ns(wire, WIRE_SUSPEND_BITS);
        }
    }
}

static void finish(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;

    wire->idle_ns = flight->end_ns + wire->intermission_ns;
    wire->recessive_ns = flight->end_ns - wire->delimiter_ns;
    if (flight->disturbed || wire->off | wire->unplugged | wire->counting) {
        finish_disturbed(wire);
    } else {
        finish_good(wire);
    }
    wire->stats.busy_ns += wire->idle_ns - flight->start_ns;
    wire_load_add(&wire->load, wire->config.window_ns, flight->start_ns, wire->idle_ns);
    flight->busy = false;
}

/* ---- what happens beside the frames ---- */

/* One attempt of an unplugged node: nobody acknowledges, its own error flag follows. */
static int64_t attempt_end(const struct wire *wire, size_t index)
{
    const struct wire_node *node = &wire->node[index];
    const struct wire_slot *slot = &node->slot[node->heap[0]];
    const int64_t begin = slot->ready_ns > node->void_ns ? slot->ready_ns : node->void_ns;

    if (!node->waiting || wire_is_passive(node)) {
        return WIRE_NEVER;
    }
    /* Up to the ACK slot, without ACK delimiter and EOF; then flag, delimiter and intermission */
    return begin +
           wire_length_ns(wire_frame_length(&wire->tables, &slot->frame), wire->config.bitrate,
                          wire->config.data_bitrate) +
           wire_bits_ns(wire, WIRE_ERROR_FLAG_BITS + WIRE_DELIMITER_BITS + WIRE_INTERMISSION_BITS -
                                  WIRE_EOF_BITS - 1);
}

enum step_kind { STEP_NONE, STEP_FINISH, STEP_RECOVER, STEP_LATE, STEP_ATTEMPT, STEP_START };

struct step {
    enum step_kind kind;
    int64_t time_ns;
    size_t index;
};

static void consider(struct step *step, enum step_kind kind, int64_t time_ns, size_t index)
{
    if (time_ns < step->time_ns) {
        *step = (struct step){kind, time_ns, index};
    }
}

/* What happens next, up to and with to_ns; of things at one time the first in the order below. */
static struct step next_step(const struct wire *wire, int64_t to_ns)
{
    struct step step = {STEP_NONE, to_ns < WIRE_NEVER ? to_ns + 1 : to_ns, 0};
    size_t index;

    if (wire->flight.busy) {
        consider(&step, STEP_FINISH, wire->flight.end_ns, 0);
    } else if (wire->off) {
        WIRE_FOR_EACH(index, wire->off)
        {
            consider(&step, STEP_RECOVER, wire_recovery_end(wire, &wire->node[index]), index);
        }
    }
    for (size_t i = 0; i < wire->nlate; i++) {
        consider(&step, STEP_LATE, wire->late[i].time_ns, i);
    }
    WIRE_FOR_EACH(index, wire->unplugged & wire->pending)
    {
        consider(&step, STEP_ATTEMPT, attempt_end(wire, index), index);
    }
    if (!wire->flight.busy && wire->pending & ~wire->unplugged) {
        const int64_t at = next_contest(wire).at_ns;

        if (at < to_ns) {
            consider(&step, STEP_START, at, 0);
        }
    }
    return step;
}

/* Whether something happened. */
static bool take_any_step(struct wire *wire, int64_t to_ns)
{
    const struct step step = next_step(wire, to_ns);
    struct wire_late *late = &wire->late[step.index];
    struct contest contest;

    switch (step.kind) {
    case STEP_NONE:
        return false;
    case STEP_FINISH:
        finish(wire);
        break;
    case STEP_RECOVER:
        wire_recover(wire, step.index, step.time_ns);
        break;
    case STEP_LATE:
        deliver(wire, late->node, &late->frame, late->receivers);
        wire->nlate--;
        memmove(late, late + 1, (wire->nlate - step.index) * sizeof *late);
        break;
    case STEP_ATTEMPT:
        wire->node[step.index].void_ns = step.time_ns;
        wire->node[step.index].stats.errors++;
        wire_count_errors(wire, step.index, step.time_ns, 8, 0);
        break;
    case STEP_START:
        contest = next_contest(wire);
        start(wire, &contest);
        break;
    }
    return true;
}

/* The same when only frames can happen. */
static bool take_frame_step(struct wire *wire, int64_t to_ns)
{
    struct contest next;

    if (wire->flight.busy) {
        if (wire->flight.end_ns > to_ns) {
            return false;
        }
        finish(wire);
        return true;
    }
    if (!wire->pending) {
        return false;
    }
    next = next_contest(wire);
    if (next.at_ns >= to_ns) {
        return false;
    }
    start(wire, &next);
    return true;
}

void wire_advance(struct wire *wire, int64_t to_ns)
{
    if (to_ns <= wire->now_ns) {
        return;
    }
    /* Nearly always there is nothing but frames */
    while (wire->off | wire->unplugged | wire->nlate ? take_any_step(wire, to_ns)
                                                     : take_frame_step(wire, to_ns)) {
    }
    wire->now_ns = to_ns;
}
