/* SPDX-License-Identifier: Apache-2.0 */
/* The queues of the nodes, arbitration, and frames that go well. */
#include "canbus/wire_private.h"

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
    *out = wire;
    return ERROR_NONE;
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

/* ---- queues: a binary heap of slots ---- */

static bool goes_before(const struct wire *wire, const struct wire_slot *a,
                        const struct wire_slot *b)
{
    if (wire->config.order == WIRE_PRIORITY && a->priority != b->priority) {
        return a->priority < b->priority;
    }
    return (int32_t)(a->order - b->order) < 0;
}

static void queue_push(const struct wire *wire, struct wire_node *node, uint16_t slot)
{
    size_t at = node->waiting++;

    while (at > 0) {
        size_t parent = (at - 1) / 2;

        if (!goes_before(wire, &node->slot[slot], &node->slot[node->heap[parent]])) {
            break;
        }
        node->heap[at] = node->heap[parent];
        at = parent;
    }
    node->heap[at] = slot;
}

static uint16_t queue_pop(const struct wire *wire, struct wire_node *node)
{
    const uint16_t first = node->heap[0], moved = node->heap[--node->waiting];
    size_t at = 0, child;

    while ((child = 2 * at + 1) < node->waiting) {
        if (child + 1 < node->waiting &&
            goes_before(wire, &node->slot[node->heap[child + 1]], &node->slot[node->heap[child]])) {
            child++;
        }
        if (!goes_before(wire, &node->slot[node->heap[child]], &node->slot[moved])) {
            break;
        }
        node->heap[at] = node->heap[child];
        at = child;
    }
    node->heap[at] = moved;
    return first;
}

static void slot_free(struct wire *wire, struct wire_node *node, uint16_t slot)
{
    node->spare[node->nspare++] = slot;
    node->stats.queued--;
    wire->stats.queued--;
}

void wire_count_drop(struct wire *wire, size_t node, enum wire_drop drop)
{
    wire->node[node].stats.dropped[drop]++;
    wire->stats.dropped[drop]++;
}

static void count_queued(struct wire *wire, struct wire_node *node)
{
    node->stats.queued++;
    wire->stats.queued++;
    if (node->stats.queued > node->stats.queued_peak) {
        node->stats.queued_peak = node->stats.queued;
    }
    if (wire->stats.queued > wire->stats.queued_peak) {
        wire->stats.queued_peak = wire->stats.queued;
    }
}

bool wire_transmit(struct wire *wire, size_t index, const struct bus_frame *frame)
{
    struct wire_node *node = &wire->node[index];
    struct wire_slot *slot;
    uint16_t free_slot;

    if (!frame_valid(frame) || (frame->flags & FRAME_ERROR) ||
        ((frame->flags & FRAME_FD) && !wire->config.fd)) {
        wire_count_drop(wire, index, WIRE_DROP_INVALID);
        return false;
    }
    if (wire->off & WIRE_BIT(index)) {
        wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        return false;
    }
    if (!node->nspare) {
        wire_count_drop(wire, index, WIRE_DROP_QUEUE_FULL);
        return false;
    }
    free_slot = node->spare[--node->nspare];
    slot = &node->slot[free_slot];
    slot->frame = *frame;
    slot->ready_ns = wire->now_ns;
    slot->priority = wire_priority(frame);
    slot->order = node->order++;
    queue_push(wire, node, free_slot);
    count_queued(wire, node);
    wire->pending |= WIRE_BIT(index);
    return true;
}

/* ---- error counters and states ---- */

static enum wire_state state_of(const struct wire_node *node)
{
    if (node->stats.tec >= WIRE_BUS_OFF_FROM) {
        return WIRE_BUS_OFF;
    }
    if (wire_is_passive(node)) {
        return WIRE_ERROR_PASSIVE;
    }
    return node->stats.tec >= WIRE_WARNING_FROM || node->stats.rec >= WIRE_WARNING_FROM
               ? WIRE_ERROR_WARNING
               : WIRE_ERROR_ACTIVE;
}

static void enter_bus_off(struct wire *wire, size_t index, int64_t time_ns)
{
    struct wire_node *node = &wire->node[index];

    while (node->waiting) {
        slot_free(wire, node, node->heap[--node->waiting]);
        wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
    }
    wire->pending &= ~WIRE_BIT(index);
    wire->off |= WIRE_BIT(index);
    node->runs = 0;
    node->recovery_ns =
        wire->config.restart_delay_ns < 0 ? WIRE_NEVER : time_ns + wire->config.restart_delay_ns;
    node->stats.bus_offs++;
    wire->stats.bus_offs++;
}

void wire_count_errors(struct wire *wire, size_t index, int64_t time_ns, int tec, int rec)
{
    struct wire_node *node = &wire->node[index];
    struct wire_node_stats *stats = &node->stats;
    enum wire_state before = stats->state;

    stats->tec = tec < 0 && !stats->tec ? 0 : (unsigned)((int)stats->tec + tec);
    if (rec < 0) {
        /* a received frame brings a passive receiver back to the limit at once */
        stats->rec =
            stats->rec >= WIRE_PASSIVE_FROM ? WIRE_PASSIVE_FROM - 1 : stats->rec - (stats->rec > 0);
    } else {
        stats->rec += (unsigned)rec;
        stats->rec = stats->rec > 255 ? 255 : stats->rec;
    }
    stats->tec_peak = stats->tec > stats->tec_peak ? stats->tec : stats->tec_peak;
    stats->rec_peak = stats->rec > stats->rec_peak ? stats->rec : stats->rec_peak;
    wire->counting &= ~WIRE_BIT(index);
    wire->counting |= stats->tec || stats->rec ? WIRE_BIT(index) : 0;
    stats->state = state_of(node);
    if (stats->state == before) {
        return;
    }
    if (stats->state == WIRE_BUS_OFF) {
        enter_bus_off(wire, index, time_ns);
    }
    wire_notify(wire, &(struct wire_event){.kind = WIRE_STATUS,
                                           .time_ns = time_ns,
                                           .node = index,
                                           .state = stats->state,
                                           .tec = stats->tec,
                                           .rec = stats->rec});
}

static void recover(struct wire *wire, size_t index, int64_t time_ns)
{
    struct wire_node_stats *stats = &wire->node[index].stats;

    wire->off &= ~WIRE_BIT(index);
    stats->tec = stats->rec = 0;
    wire_count_errors(wire, index, time_ns, 0, 0);
}

void wire_force_bus_off(struct wire *wire, size_t node)
{
    if (!(wire->off & WIRE_BIT(node))) {
        wire_count_errors(wire, node, wire->now_ns,
                          WIRE_BUS_OFF_FROM - (int)wire->node[node].stats.tec, 0);
    }
}

void wire_restart(struct wire *wire, size_t node)
{
    if (wire->off & WIRE_BIT(node) && wire->node[node].recovery_ns > wire->now_ns) {
        wire->node[node].recovery_ns = wire->now_ns;
    }
}

void wire_connect(struct wire *wire, size_t node, bool connected)
{
    if (connected && wire->unplugged & WIRE_BIT(node)) {
        wire->unplugged &= ~WIRE_BIT(node);
        /* it joins in after eleven recessive bits, which at the very beginning everybody has
         * seen */
        wire->node[node].hold_ns =
            wire->now_ns > 0 ? wire->now_ns + wire_bits_ns(wire, WIRE_RUN_BITS) : 0;
    } else if (!connected && !(wire->unplugged & WIRE_BIT(node))) {
        wire->unplugged |= WIRE_BIT(node);
        wire->node[node].void_ns = wire->now_ns;
    }
}

void wire_set_bitrate(struct wire *wire, size_t node, int64_t bitrate)
{
    const bool other = bitrate > 0 && bitrate != wire->config.bitrate;

    wire->node[node].bitrate = other ? bitrate : 0;
    wire->mismatched &= ~WIRE_BIT(node);
    wire->mismatched |= other ? WIRE_BIT(node) : 0;
}

/* When the recovery of a node in bus-off would be complete if the bus stayed idle. */
static int64_t recovery_end(const struct wire *wire, const struct wire_node *node)
{
    int64_t from = node->recovery_ns > wire->recessive_ns ? node->recovery_ns : wire->recessive_ns;

    if (node->recovery_ns == WIRE_NEVER) {
        return WIRE_NEVER;
    }
    return from + wire_bits_ns(wire, (int64_t)(WIRE_RECOVERY_RUNS - node->runs) * WIRE_RUN_BITS);
}

/* A frame starts: what nodes in bus-off have seen of recessive bits before it. */
static void count_runs(struct wire *wire, int64_t start_ns)
{
    const int64_t run_ns = wire_bits_ns(wire, WIRE_RUN_BITS);
    size_t index;

    WIRE_FOR_EACH(index, wire->off)
    {
        struct wire_node *node = &wire->node[index];
        int64_t from =
            node->recovery_ns > wire->recessive_ns ? node->recovery_ns : wire->recessive_ns;

        if (start_ns > from) {
            node->runs += (unsigned)((start_ns - from) / run_ns);
        }
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

static int64_t next_start(const struct wire *wire)
{
    int64_t first = WIRE_NEVER;
    size_t index;

    WIRE_FOR_EACH(index, wire->pending & ~wire->unplugged)
    {
        int64_t at = may_start(wire, index);

        first = at < first ? at : first;
    }
    return first;
}

/* The nodes that send the frame of the lowest priority number; the others of those that compete are
 * left in *losers. */
static uint64_t arbitrate(const struct wire *wire, int64_t time_ns, uint64_t *losers)
{
    uint64_t winners = 0, all = 0;
    uint32_t lowest = UINT32_MAX;
    size_t index;

    if (!(wire->pending & (wire->pending - 1))) {
        *losers = 0;
        return wire->pending;
    }
    WIRE_FOR_EACH(index, wire->pending & ~wire->unplugged)
    {
        const struct wire_node *node = &wire->node[index];
        uint32_t priority = node->slot[node->heap[0]].priority;

        if (may_start(wire, index) > time_ns) {
            continue;
        }
        all |= WIRE_BIT(index);
        if (priority < lowest || !winners) {
            lowest = priority;
            winners = 0;
        }
        winners |= priority == lowest ? WIRE_BIT(index) : 0;
    }
    *losers = all & ~winners;
    return winners;
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

    node->flying = queue_pop(wire, node);
    wire->pending &= node->waiting ? UINT64_MAX : ~WIRE_BIT(index);
    frame = &node->slot[node->flying].frame;
    if (frame->flags & FRAME_FD) {
        frame->flags &= (uint8_t)~FRAME_ESI;
        frame->flags |= wire_is_passive(node) ? FRAME_ESI : 0;
    }
}

static void start(struct wire *wire, int64_t time_ns)
{
    struct wire_flight *flight = &wire->flight;
    uint64_t losers;
    struct bus_frame *frame;
    size_t index;

    *flight = (struct wire_flight){.busy = true, .start_ns = time_ns};
    flight->senders = arbitrate(wire, time_ns, &losers);
    WIRE_FOR_EACH(index, flight->senders)
    {
        take_off(wire, index);
    }
    count_runs(wire, time_ns);
    frame = &wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame;
    frame->time_ns = time_ns;
    tell_losers(wire, losers, frame);
    flight->end_ns = time_ns + wire_length_ns(wire_frame_length(&wire->tables, frame),
                                              wire->config.bitrate, wire->config.data_bitrate);
    if (wire->armed || wire->mismatched || (flight->senders & (flight->senders - 1)) ||
        !wire_listeners(wire)) {
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
    slot_free(wire, node, node->flying);
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
            slot_free(wire, node, node->flying);
        } else if (wire->off & WIRE_BIT(index)) {
            slot_free(wire, node, node->flying);
            wire_count_drop(wire, index, WIRE_DROP_BUS_OFF);
        } else {
            queue_push(wire, node, node->flying);
            wire->pending |= WIRE_BIT(index);
        }
    }
}

static void finish(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    const uint64_t gone = (flight->senders | flight->beaten) & (wire->off | wire->unplugged);
    const uint64_t senders = flight->senders | flight->beaten;
    size_t index;

    /* who was unplugged or put into bus-off meanwhile has sent nothing */
    take_back(wire, gone);
    flight->senders &= ~gone;
    flight->beaten &= ~gone;
    wire->idle_ns = flight->end_ns + wire->intermission_ns;
    wire->recessive_ns = flight->end_ns - wire->delimiter_ns;
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
    /* up to the ACK slot, without ACK delimiter and EOF; then flag, delimiter and intermission */
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
            consider(&step, STEP_RECOVER, recovery_end(wire, &wire->node[index]), index);
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
        int64_t at = next_start(wire);

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

    switch (step.kind) {
    case STEP_NONE:
        return false;
    case STEP_FINISH:
        finish(wire);
        break;
    case STEP_RECOVER:
        recover(wire, step.index, step.time_ns);
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
        start(wire, step.time_ns);
        break;
    }
    return true;
}

/* The same when only frames can happen. */
static bool take_frame_step(struct wire *wire, int64_t to_ns)
{
    int64_t at;

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
    at = next_start(wire);
    if (at >= to_ns) {
        return false;
    }
    start(wire, at);
    return true;
}

void wire_advance(struct wire *wire, int64_t to_ns)
{
    if (to_ns <= wire->now_ns) {
        return;
    }
    /* nearly always there is nothing but frames */
    while (wire->off | wire->unplugged | wire->nlate ? take_any_step(wire, to_ns)
                                                     : take_frame_step(wire, to_ns)) {
    }
    wire->now_ns = to_ns;
}
