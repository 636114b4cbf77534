/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Frames that do not go well. When a frame starts and something may happen to it, its bits are
 * written out and everything that some node will take for an error is looked for; the earliest one
 * ends the frame. Comparing bits also tells how long the error flags of the nodes overlap.
 */
#include "canbus/wire/private.h"

enum {
    FLAG = WIRE_ERROR_FLAG_BITS,
    STUFF_ERROR = 6, /* equal bits */
    COUNT_SENDER = 8,
    COUNT_RECEIVER = 1,
    COUNT_FIRST = 9, /* the flags of the others are the dominant bit behind its own */
};

/* An error that ends the frame. */
struct trouble {
    int64_t after_ns;   /* from SOF to the first bit of the error flag */
    unsigned flag_bits; /* of all nodes together */
    enum wire_error error;
    uint64_t first; /* receivers that find it before the sender does */
    bool unacknowledged;
};

static void keep_earliest(struct trouble *kept, const struct trouble *other)
{
    if (other->after_ns < kept->after_ns) {
        *kept = *other;
    }
}

/* Time of the first n bits. */
static int64_t time_of(const struct wire *wire, const struct wire_bits *bits, size_t n)
{
    size_t end = n < bits->slow ? n : bits->slow;
    size_t fast = end > bits->fast ? end - bits->fast : 0;

    return wire_length_ns(
        (struct wire_length){.nominal = (uint16_t)(n - fast), .data = (uint16_t)fast},
        wire->config.bitrate, wire->config.data_bitrate);
}

static bool any_active(const struct wire *wire, uint64_t nodes)
{
    size_t index;

    WIRE_FOR_EACH(index, nodes)
    {
        if (!wire_is_passive(&wire->node[index])) {
            return true;
        }
    }
    return false;
}

/* ---- overlapping flags ---- */

/* Bits equal to `value` that end with the one at `at`, which is read as `seen`; at most 6. */
static unsigned run_at(const struct wire_bits *bits, size_t at, unsigned seen, unsigned value)
{
    unsigned length = seen == value;

    while (length && length < STUFF_ERROR && length <= at && bits->bit[at - length] == value) {
        length++;
    }
    return length;
}

/* The sender finds an error at a bit and sends its flag; the others answer when they have read six
 * equal bits, the first of which may have been part of the frame. */
static unsigned flag_of_sender(const struct wire *wire, const struct wire_bits *bits, size_t at,
                               unsigned seen)
{
    const bool active = any_active(wire, wire->flight.senders);
    const unsigned run = run_at(bits, at, seen, active ? 0 : 1);

    if (run_at(bits, at, seen, seen) == STUFF_ERROR) {
        /* A stuff bit was hit: everybody has found it at once */
        return FLAG;
    }
    /* Without an active receiver nobody answers; a passive flag ends after six equal bits only */
    return active && !any_active(wire, wire_listeners(wire)) ? FLAG : 2 * FLAG - run;
}

/* A receiver finds an error at a bit; the sender answers after the first recessive bit that it
 * cannot send, the other receivers after six dominant ones. Behind the ACK field all answer at
 * once. */
static unsigned flag_of_receiver(const struct wire_bits *bits, size_t at)
{
    unsigned sender = 0, others;

    if (at >= bits->ack) {
        return FLAG + 1;
    }
    while (sender < FLAG && at + 1 + sender < bits->count && !bits->bit[at + 1 + sender]) {
        sender++;
    }
    others = FLAG - run_at(bits, at, bits->bit[at], 0);
    return FLAG + (sender + 1 > others ? sender + 1 : others);
}

/* ---- who finds what ---- */

static struct trouble found_by_sender(const struct wire *wire, size_t at, unsigned seen)
{
    return (struct trouble){
        .after_ns = time_of(wire, &wire->bits[0], at + 1),
        .flag_bits = flag_of_sender(wire, &wire->bits[0], at, seen),
        .error = WIRE_BIT_ERROR,
    };
}

static struct trouble found_by_receiver(const struct wire *wire, size_t at, size_t receiver)
{
    return (struct trouble){
        .after_ns = time_of(wire, &wire->bits[0], at + 1),
        .flag_bits = flag_of_receiver(&wire->bits[0], at),
        .error = at >= wire->bits[0].ack ? WIRE_FORM_ERROR : WIRE_BIT_ERROR,
        .first = WIRE_BIT(receiver),
    };
}

static struct trouble unacknowledged(const struct wire *wire)
{
    const struct wire_bits *bits = &wire->bits[0];

    return (struct trouble){
        .after_ns = time_of(wire, bits, bits->ack + 1),
        .flag_bits = FLAG,
        .error = WIRE_ACK_ERROR,
        .unacknowledged = true,
    };
}

/* Where a receiver that reads one bit wrong notices it: six equal bits, else the CRC, which is
 * judged behind the ACK field. */
static size_t misread_found_at(struct wire_bits *bits, size_t wrong)
{
    size_t found = bits->ack + 1;
    unsigned run = 0;

    bits->bit[wrong] ^= 1;
    for (size_t i = 0; i < bits->crc_end; i++) {
        run = i && bits->bit[i] == bits->bit[i - 1] ? run + 1 : 1;
        if (run == STUFF_ERROR && i >= wrong) {
            found = i;
            break;
        }
    }
    bits->bit[wrong] ^= 1;
    return found;
}

/* The same for a node of another bit rate: it samples at 80 % of its own bits, from the edge of SOF
 * on, without resynchronizing. */
static size_t mismatch_found_at(const struct wire *wire, const struct wire_bits *bits,
                                int64_t bitrate)
{
    const double period_ns = 1e9 / (double)bitrate;
    unsigned run = 0, last = 2;
    size_t at = 0;

    for (size_t sample = 0;; sample++) {
        const int64_t time_ns = (int64_t)(((double)sample + 0.8) * period_ns);

        while (at <= bits->ack && time_of(wire, bits, at + 1) <= time_ns) {
            at++;
        }
        if (at > bits->ack) {
            return bits->ack + 1;
        }
        run = bits->bit[at] == last ? run + 1 : 1;
        last = bits->bit[at];
        if (run == STUFF_ERROR) {
            return at;
        }
    }
}

/* A sender of another bit rate: bits of the bus until its receivers have read six equal ones;
 * behind its frame the line is recessive. */
static int64_t foreign_rate_found_after(const struct wire *wire, const struct wire_bits *bits,
                                        int64_t bitrate)
{
    unsigned run = 0, last = 2;

    for (int64_t sample = 0;; sample++) {
        const double time = ((double)sample + 0.8) / (double)wire->config.bitrate;
        const size_t at = (size_t)(time * (double)bitrate);
        const unsigned bit = at < bits->count ? bits->bit[at] : 1;

        run = bit == last ? run + 1 : 1;
        last = bit;
        if (run == STUFF_ERROR) {
            return sample + 1;
        }
    }
}

/* ---- collisions ---- */

/* The first bit in which two encoded frames differ; false when they are the same. */
static bool first_difference(const struct wire_bits *a, const struct wire_bits *b, size_t *at)
{
    size_t count = a->count < b->count ? a->count : b->count;

    for (size_t i = 0; i < count; i++) {
        if (a->bit[i] != b->bit[i]) {
            *at = i;
            return true;
        }
    }
    return false;
}

/* The senders whose bit at `at` is recessive. */
static uint64_t recessive_senders(struct wire *wire, size_t at)
{
    uint64_t recessive = 0;
    size_t index;

    WIRE_FOR_EACH(index, wire->flight.senders)
    {
        wire_frame_encode(&wire_flying(wire, index)->frame, &wire->bits[1]);
        recessive |= wire->bits[1].bit[at] ? WIRE_BIT(index) : 0;
    }
    return recessive;
}

/* Several nodes send behind the same arbitration field. At the first bit that differs who sends
 * recessive reads dominant: its error flag ends the frame, unless it is passive and only drops out.
 * Leaves the frame that stays in bits[0]. */
static void collide(struct wire *wire, struct trouble *kept)
{
    struct wire_flight *flight = &wire->flight;

    for (;;) {
        size_t at = WIRE_BITS_MAX, here, index;
        uint64_t recessive;

        wire_frame_encode(&wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame,
                          &wire->bits[0]);
        WIRE_FOR_EACH(index, flight->senders & (flight->senders - 1))
        {
            wire_frame_encode(&wire_flying(wire, index)->frame, &wire->bits[1]);
            if (first_difference(&wire->bits[0], &wire->bits[1], &here) && here < at) {
                at = here;
            }
        }
        if (at == WIRE_BITS_MAX) {
            return;
        }
        recessive = recessive_senders(wire, at);
        if (any_active(wire, recessive)) {
            struct trouble trouble = found_by_sender(wire, at, 0);

            keep_earliest(kept, &trouble);
            return;
        }
        flight->beaten |= recessive;
        flight->senders &= ~recessive;
    }
}

/* ---- faults ---- */

static bool hits(struct wire *wire, struct wire_armed *armed)
{
    const struct wire_fault *fault = &armed->fault;
    const struct wire_flight *flight = &wire->flight;
    const struct bus_frame *frame =
        &wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame;

    if (!armed->armed || (fault->count && armed->hits >= fault->count) ||
        flight->start_ns < fault->from_ns ||
        (fault->until_ns && flight->start_ns >= fault->until_ns) ||
        (fault->node != WIRE_ANY && !(flight->senders & WIRE_BIT(fault->node))) ||
        ((frame->id ^ fault->id) & fault->id_mask)) {
        return false;
    }
    return fault->probability <= 0.0 || fault->probability >= 1.0 ||
           random_uniform(&wire->random) < fault->probability;
}

/* The foreign node joins in with the same identifier and other data. */
static bool add_foreign(struct wire *wire)
{
    const size_t index = wire->config.nodes;
    struct wire_node *foreign = &wire->node[index];
    struct wire_slot *slot;

    if ((wire->off & WIRE_BIT(index)) || foreign->hold_ns > wire->flight.start_ns ||
        !foreign->nspare) {
        return false;
    }
    foreign->flying = foreign->spare[--foreign->nspare];
    foreign->stats.queued++;
    wire->stats.queued++;
    slot = &foreign->slot[foreign->flying];
    *slot = *wire_flying(wire, (size_t)__builtin_ctzll(wire->flight.senders));
    if (slot->frame.len && !(slot->frame.flags & FRAME_REMOTE)) {
        for (size_t i = 0; i < slot->frame.len; i++) {
            slot->frame.data[i] ^= 0xFF;
        }
    } else {
        slot->frame.len = slot->frame.len ? 0 : 1;
    }
    if (slot->frame.flags & FRAME_FD) {
        slot->frame.flags &= (uint8_t)~FRAME_ESI;
        slot->frame.flags |= wire_is_passive(foreign) ? FRAME_ESI : 0;
    }
    wire->flight.senders |= WIRE_BIT(index);
    return true;
}

static void let_collide(struct wire *wire)
{
    for (size_t i = 0; i < WIRE_FAULTS_MAX; i++) {
        struct wire_armed *armed = &wire->fault[i];

        if (armed->fault.kind == WIRE_FAULT_COLLISION && hits(wire, armed) && add_foreign(wire)) {
            armed->hits++;
            return;
        }
    }
}

static size_t somewhere(struct wire *wire)
{
    const struct wire_bits *bits = &wire->bits[0];

    return bits->control + random_bits(&wire->random) % (bits->crc_end - bits->control);
}

static uint64_t receivers_of(const struct wire_fault *fault)
{
    return fault->receiver == WIRE_ANY ? UINT64_MAX : WIRE_BIT(fault->receiver);
}

/* A receiver reads a bit wrong. */
static void misread(struct wire *wire, size_t receiver, size_t found_at, struct trouble *kept)
{
    if (wire_is_passive(&wire->node[receiver])) {
        wire->flight.blind |= WIRE_BIT(receiver);
    } else {
        struct trouble trouble = found_by_receiver(wire, found_at, receiver);

        keep_earliest(kept, &trouble);
    }
}

/* Does what a fault does to the frame; false when it has nothing to act on. */
static bool apply(struct wire *wire, const struct wire_fault *fault, struct trouble *kept)
{
    struct wire_flight *flight = &wire->flight;
    struct trouble trouble;
    size_t at;

    switch (fault->kind) {
    case WIRE_FAULT_CORRUPT:
        at = somewhere(wire);
        trouble = found_by_sender(wire, at, !wire->bits[0].bit[at]);
        keep_earliest(kept, &trouble);
        return true;
    case WIRE_FAULT_CORRUPT_AT:
        if (!(wire_listeners(wire) & WIRE_BIT(fault->receiver))) {
            return false;
        }
        misread(wire, (size_t)fault->receiver, misread_found_at(&wire->bits[0], somewhere(wire)),
                kept);
        return true;
    case WIRE_FAULT_LOSS:
        flight->lost |= receivers_of(fault);
        return true;
    case WIRE_FAULT_LATE:
        flight->late |= receivers_of(fault);
        flight->late_ns = fault->delay_ns;
        return true;
    case WIRE_FAULT_DUPLICATE:
        flight->repeat = true;
        return true;
    default:
        return false;
    }
}

static void apply_faults(struct wire *wire, struct trouble *kept)
{
    for (size_t i = 0; i < WIRE_FAULTS_MAX; i++) {
        struct wire_armed *armed = &wire->fault[i];

        if (armed->fault.kind != WIRE_FAULT_COLLISION && hits(wire, armed)) {
            armed->hits += apply(wire, &armed->fault, kept);
        }
    }
}

/* ---- bit rates ---- */

static void mismatch_sender(struct wire *wire, size_t sender, struct trouble *kept)
{
    const uint64_t listeners = wire_listeners(wire);
    const int64_t bitrate = wire->node[sender].bitrate;
    struct trouble trouble;

    if (any_active(wire, listeners)) {
        trouble = (struct trouble){
            .after_ns = wire_bits_ns(wire, foreign_rate_found_after(wire, &wire->bits[0], bitrate)),
            .flag_bits = 2 * FLAG,
            .error = WIRE_BIT_ERROR,
            .first = listeners,
        };
    } else {
        trouble = unacknowledged(wire);
        trouble.after_ns = (int64_t)((double)(wire->bits[0].ack + 1) * 1e9 / (double)bitrate);
        wire->flight.blind |= listeners;
    }
    keep_earliest(kept, &trouble);
}

static void mismatch(struct wire *wire, struct trouble *kept)
{
    const uint64_t on = wire->mismatched & ~(wire->off | wire->unplugged);
    size_t index;

    WIRE_FOR_EACH(index, on & wire->flight.senders)
    {
        mismatch_sender(wire, index, kept);
    }
    WIRE_FOR_EACH(index, on & ~(wire->flight.senders | wire->flight.beaten))
    {
        misread(wire, index, mismatch_found_at(wire, &wire->bits[0], wire->node[index].bitrate),
                kept);
    }
}

/* ---- seams ---- */

void wire_disturb(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    struct trouble kept = {.after_ns = WIRE_NEVER}, trouble;

    if (wire->armed) {
        let_collide(wire);
    }
    collide(wire, &kept);
    apply_faults(wire, &kept);
    mismatch(wire, &kept);
    if (!(wire_listeners(wire) & ~flight->blind)) {
        trouble = unacknowledged(wire);
        keep_earliest(&kept, &trouble);
    }
    flight->end_ns = flight->start_ns + time_of(wire, &wire->bits[0], wire->bits[0].count);
    if (kept.after_ns == WIRE_NEVER) {
        return;
    }
    flight->failed = true;
    flight->repeat = false;
    flight->error = kept.error;
    flight->first = kept.first;
    flight->unacknowledged = kept.unacknowledged;
    flight->end_ns = flight->start_ns + kept.after_ns +
                     wire_bits_ns(wire, (int64_t)kept.flag_bits + WIRE_DELIMITER_BITS);
}

/* The error counters of a node that sent, and its event. */
static void fail_sender(struct wire *wire, size_t index, enum wire_error error, bool spare)
{
    struct wire_node *node = &wire->node[index];

    node->stats.errors++;
    wire_count_errors(wire, index, wire->flight.end_ns, spare ? 0 : COUNT_SENDER, 0);
    wire_notify(wire, &(struct wire_event){.kind = WIRE_BUS_ERROR,
                                           .time_ns = wire->flight.end_ns,
                                           .node = index,
                                           .frame = &node->slot[node->flying].frame,
                                           .error = error,
                                           .tec = node->stats.tec,
                                           .rec = node->stats.rec});
}

void wire_finish_error(struct wire *wire)
{
    const struct wire_flight *flight = &wire->flight;
    const uint64_t on = wire->all & ~(wire->off | wire->unplugged);
    const uint64_t receivers = on & ~(flight->senders | flight->beaten);
    uint64_t failed = flight->beaten, counted = flight->blind & receivers;
    size_t index;

    if (flight->repeat) {
        /* The flag, which the receivers take for an overload and answer a bit later */
        int64_t more_ns = wire_bits_ns(wire, FLAG + 1 + WIRE_DELIMITER_BITS);

        wire->idle_ns += more_ns;
        wire->recessive_ns += more_ns;
    }
    if (flight->failed || flight->repeat) {
        failed |= flight->senders;
    }
    if (flight->failed && !flight->unacknowledged) {
        counted = receivers;
    }
    if (failed) {
        wire->stats.errors[flight->failed ? flight->error : WIRE_BIT_ERROR]++;
    }
    WIRE_FOR_EACH(index, failed)
    {
        bool spare = flight->unacknowledged && wire_is_passive(&wire->node[index]);

        fail_sender(wire, index, flight->failed ? flight->error : WIRE_BIT_ERROR, spare);
    }
    WIRE_FOR_EACH(index, counted)
    {
        wire_count_errors(wire, index, flight->end_ns, 0,
                          flight->first & WIRE_BIT(index) ? COUNT_FIRST : COUNT_RECEIVER);
    }
}

/* ---- arming ---- */

static bool node_exists(const struct wire *wire, int node, bool any)
{
    return (any && node == WIRE_ANY) || (node >= 0 && (size_t)node < wire->config.nodes);
}

int wire_inject(struct wire *wire, const struct wire_fault *fault)
{
    if (!node_exists(wire, fault->node, true) ||
        !node_exists(wire, fault->receiver, fault->kind != WIRE_FAULT_CORRUPT_AT)) {
        return -1;
    }
    for (int i = 0; i < WIRE_FAULTS_MAX; i++) {
        if (!wire->fault[i].armed) {
            wire->fault[i] = (struct wire_armed){.armed = true, .fault = *fault};
            wire->armed++;
            return i;
        }
    }
    return -1;
}

uint64_t wire_fault_hits(const struct wire *wire, int fault)
{
    return wire->fault[fault].hits;
}

uint64_t wire_heal(struct wire *wire, int fault)
{
    wire->armed -= wire->fault[fault].armed;
    wire->fault[fault].armed = false;
    return wire->fault[fault].hits;
}
