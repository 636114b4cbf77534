/* SPDX-License-Identifier: Apache-2.0 */
/* Decides the end of a disturbed frame. If a fault or a collision may affect a frame, its bits are
 * written to wire->bits[0] when it starts. The code then finds the errors that nodes would detect,
 * and the total length of the overlapping error flags. The earliest error ends the frame. A
 * position is the index of a bit. */
#include "canbus/wire/private.h"

/* An error that ends the frame, as the first node detects it. */
struct wire_detection {
    int64_t after_ns;   /* from SOF to the first bit of the error flag */
    unsigned flag_bits; /* length of the combined error flags */
    enum wire_error error;
    uint64_t first; /* receivers that find it before the sender */
    bool unacknowledged;
};

enum {
    FLAG = WIRE_ERROR_FLAG_BITS,
    STUFF_ERROR = 6, /* number of equal bits that is an error */
};

static void wire_keep_earliest(struct wire_detection *kept, const struct wire_detection *other)
{
    if (other->after_ns < kept->after_ns) {
        *kept = *other;
    }
}

static int64_t wire_time_of_bits(const struct wire *wire, const struct wire_bits *bits, size_t n)
{
    size_t end = n < bits->slow ? n : bits->slow;
    size_t fast = end > bits->fast ? end - bits->fast : 0;

    return wire_length_ns(
        (struct wire_length){.nominal = (uint16_t)(n - fast), .data = (uint16_t)fast},
        wire->config.bitrate, wire->config.data_bitrate);
}

static bool wire_any_error_active(const struct wire *wire, uint64_t nodes)
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

/* Returns the length of the run of bits equal to `value` that ends at `at`, at most 6. The bit at
 * `at` is read as `seen`. */
static unsigned wire_run_of_bits(const struct wire_bits *bits, size_t at, unsigned seen,
                                 unsigned value)
{
    unsigned length = seen == value;

    while (length && length < STUFF_ERROR && length <= at && bits->bit[at - length] == value) {
        length++;
    }
    return length;
}

/* Returns the total length of the error flags when a sender detects an error at a bit. The other
 * nodes send their flags after six equal bits. The first of these bits may belong to the frame. */
static unsigned wire_flag_bits_by_sender(const struct wire *wire, const struct wire_bits *bits,
                                         size_t at, unsigned seen)
{
    const bool active = wire_any_error_active(wire, wire->flight.senders);
    const unsigned run = wire_run_of_bits(bits, at, seen, active ? 0 : 1);

    if (wire_run_of_bits(bits, at, seen, seen) == STUFF_ERROR) {
        /* A stuff bit was hit: all nodes find the error at the same time */
        return FLAG;
    }
    /* Without an error active receiver no other flag follows; a passive flag ends after six equal
     * bits */
    return active && !wire_any_error_active(wire, wire_listeners(wire)) ? FLAG : 2 * FLAG - run;
}

/* Returns the total length of the error flags when a receiver detects an error at a bit. The sender
 * starts its flag after the first recessive bit that it reads as dominant. The other receivers
 * start their flags after six dominant bits. After the ACK field all nodes start at once. */
static unsigned wire_flag_bits_by_receiver(const struct wire_bits *bits, size_t at)
{
    unsigned sender = 0, others;

    if (at >= bits->ack) {
        return FLAG + 1;
    }
    while (sender < FLAG && at + 1 + sender < bits->count && !bits->bit[at + 1 + sender]) {
        sender++;
    }
    others = FLAG - wire_run_of_bits(bits, at, bits->bit[at], 0);
    return FLAG + (sender + 1 > others ? sender + 1 : others);
}

/* ---- detection of errors ---- */

static struct wire_detection wire_detect_by_sender(const struct wire *wire, size_t at,
                                                   unsigned seen)
{
    return (struct wire_detection){
        .after_ns = wire_time_of_bits(wire, &wire->bits[0], at + 1),
        .flag_bits = wire_flag_bits_by_sender(wire, &wire->bits[0], at, seen),
        .error = WIRE_BIT_ERROR,
    };
}

/* Finds the bit where a receiver detects its misread bit: at six equal bits, else by the CRC, which
 * it checks behind the ACK field. */
static size_t wire_misread_detected_at(struct wire_bits *bits, size_t wrong)
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

/* ---- effects of faults ---- */

/* Checks whether a fault hits the starting frame: armed, in its time window, matching sender and
 * identifier, and by its probability. */
static bool wire_fault_matches(struct wire *wire, struct wire_armed *armed)
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

/* Makes the foreign node (index config.nodes) send the same identifier with other data at the same
 * time; false = impossible. */
static bool wire_add_foreign_sender(struct wire *wire)
{
    const size_t index = wire->config.nodes;
    struct wire_node *foreign = &wire->node[index];
    struct wire_slot *slot;

    if ((wire->off & WIRE_BIT(index)) || foreign->hold_ns > wire->flight.start_ns ||
        !foreign->nspare) {
        return false;
    }
    /* Its frame is a copy of the sender's */
    foreign->flying = foreign->spare[--foreign->nspare];
    foreign->stats.queued++;
    wire->stats.queued++;
    slot = &foreign->slot[foreign->flying];
    *slot = *wire_flying(wire, (size_t)__builtin_ctzll(wire->flight.senders));

    /* It differs in its data, or without data in its length */
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

/* Returns a random bit between the arbitration field and the CRC delimiter. */
static size_t wire_random_bit(struct wire *wire)
{
    const struct wire_bits *bits = &wire->bits[0];

    return bits->control + random_bits(&wire->random) % (bits->crc_end - bits->control);
}

/* Returns the receivers that a fault affects, as a mask. */
static uint64_t wire_fault_receivers(const struct wire_fault *fault)
{
    return fault->receiver == WIRE_ANY ? UINT64_MAX : WIRE_BIT(fault->receiver);
}

/* Applies a fault to the frame; false = it has no effect. */
static bool wire_apply_fault(struct wire *wire, const struct wire_fault *fault,
                             struct wire_detection *kept)
{
    struct wire_flight *flight = &wire->flight;
    struct wire_detection found;
    size_t at;

    switch (fault->kind) {
    case WIRE_FAULT_COLLISION:
        return wire_add_foreign_sender(wire);
    case WIRE_FAULT_CORRUPT:
        /* The sender reads back a wrong bit */
        at = wire_random_bit(wire);
        found = wire_detect_by_sender(wire, at, !wire->bits[0].bit[at]);
        wire_keep_earliest(kept, &found);
        return true;
    case WIRE_FAULT_CORRUPT_AT:
        /* One receiver, if it listens, detects it by stuffing or by the CRC. An error active one
         * destroys the frame; a passive one only misses it. Behind the ACK field the error is a
         * form error */
        if (!(wire_listeners(wire) & WIRE_BIT(fault->receiver))) {
            return false;
        }
        at = wire_misread_detected_at(&wire->bits[0], wire_random_bit(wire));
        if (wire_is_passive(&wire->node[fault->receiver])) {
            flight->blind |= WIRE_BIT(fault->receiver);
            return true;
        }
        found = (struct wire_detection){
            .after_ns = wire_time_of_bits(wire, &wire->bits[0], at + 1),
            .flag_bits = wire_flag_bits_by_receiver(&wire->bits[0], at),
            .error = at >= wire->bits[0].ack ? WIRE_FORM_ERROR : WIRE_BIT_ERROR,
            .first = WIRE_BIT(fault->receiver),
        };
        wire_keep_earliest(kept, &found);
        return true;
    case WIRE_FAULT_LOSS:
        /* The bus carries the frame; these receivers lose it at the end */
        flight->lost |= wire_fault_receivers(fault);
        return true;
    case WIRE_FAULT_LATE:
        flight->late |= wire_fault_receivers(fault);
        flight->late_ns = fault->delay_ns;
        return true;
    case WIRE_FAULT_DUPLICATE:
        flight->repeat = true;
        return true;
    }
    return false;
}

/* Applies the first collision that hits the frame, or all other faults. */
static void wire_apply_faults(struct wire *wire, bool collision, struct wire_detection *kept)
{
    bool hit = false;

    for (size_t i = 0; i < WIRE_FAULTS_MAX && !(collision && hit); i++) {
        struct wire_armed *armed = &wire->fault[i];

        if ((armed->fault.kind == WIRE_FAULT_COLLISION) == collision &&
            wire_fault_matches(wire, armed)) {
            hit = wire_apply_fault(wire, &armed->fault, kept);
            armed->hits += hit;
        }
    }
}

/* ---- arming ---- */

static bool wire_node_exists(const struct wire *wire, int node, bool any)
{
    return (any && node == WIRE_ANY) || (node >= 0 && (size_t)node < wire->config.nodes);
}

int wire_inject(struct wire *wire, const struct wire_fault *fault)
{
    if (!wire_node_exists(wire, fault->node, true) ||
        !wire_node_exists(wire, fault->receiver, fault->kind != WIRE_FAULT_CORRUPT_AT)) {
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

uint64_t wire_heal(struct wire *wire, int fault)
{
    wire->armed -= wire->fault[fault].armed;
    wire->fault[fault].armed = false;
    return wire->fault[fault].hits;
}

enum {
    COUNT_SENDER = 8,
    COUNT_RECEIVER = 1,
    /* 1 + 8: the receiver that found the error first also reads a dominant bit behind its own
     * flag */
    COUNT_FIRST = 9,
};

/* ---- collisions ---- */

/* Returns the senders whose bit at a position is recessive, as a mask. */
static uint64_t wire_recessive_senders(struct wire *wire, size_t at)
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

/* Resolves the collision of nodes that send the same identifier. At the first different bit, a node
 * that sends recessive reads dominant. Its error flag ends the frame; if it is error passive, it
 * only drops out. Leaves the bits of the remaining frame in bits[0]. */
static void wire_resolve_collision(struct wire *wire, struct wire_detection *kept)
{
    struct wire_flight *flight = &wire->flight;

    for (;;) {
        size_t at = WIRE_BITS_MAX, index;
        uint64_t recessive;

        wire_frame_encode(&wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame,
                          &wire->bits[0]);

        /* Find the first bit in which a sender differs from the first sender */
        WIRE_FOR_EACH(index, flight->senders & (flight->senders - 1))
        {
            wire_frame_encode(&wire_flying(wire, index)->frame, &wire->bits[1]);
            for (size_t i = 0; i < at && i < wire->bits[0].count && i < wire->bits[1].count; i++) {
                at = wire->bits[0].bit[i] != wire->bits[1].bit[i] ? i : at;
            }
        }
        if (at == WIRE_BITS_MAX) {
            return;
        }

        /* If a recessive sender is error active, its flag ends the frame. Passive senders drop out;
         * compare the remaining senders again */
        recessive = wire_recessive_senders(wire, at);
        if (wire_any_error_active(wire, recessive)) {
            struct wire_detection found = wire_detect_by_sender(wire, at, 0);

            wire_keep_earliest(kept, &found);
            return;
        }
        flight->beaten |= recessive;
        flight->senders &= ~recessive;
    }
}

/* ---- interface to wire.c ---- */

void wire_disturb(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    struct wire_detection kept = {.after_ns = WIRE_NEVER}, found;

    /* Find all errors that may end the frame; keep the earliest */
    wire_apply_faults(wire, true, &kept);
    wire_resolve_collision(wire, &kept);
    wire_apply_faults(wire, false, &kept);
    if (!(wire_listeners(wire) & ~flight->blind)) {
        found = (struct wire_detection){
            .after_ns = wire_time_of_bits(wire, &wire->bits[0], wire->bits[0].ack + 1),
            .flag_bits = FLAG,
            .error = WIRE_ACK_ERROR,
            .unacknowledged = true,
        };
        wire_keep_earliest(&kept, &found);
    }

    /* No error: the frame ends normally */
    flight->end_ns =
        flight->start_ns + wire_time_of_bits(wire, &wire->bits[0], wire->bits[0].count);
    flight->rest = (struct wire_rest){0};
    if (kept.after_ns == WIRE_NEVER) {
        return;
    }

    /* An error: the frame ends behind the error delimiter */
    flight->failed = true;
    flight->repeat = false;
    flight->error = kept.error;
    flight->first = kept.first;
    flight->unacknowledged = kept.unacknowledged;
    flight->end_ns = flight->start_ns + kept.after_ns +
                     wire_bits_ns(wire, (int64_t)kept.flag_bits + WIRE_DELIMITER_BITS);
}

void wire_finish_error(struct wire *wire)
{
    const struct wire_flight *flight = &wire->flight;
    const uint64_t on = wire->all & ~(wire->off | wire->unplugged);
    const uint64_t receivers = on & ~(flight->senders | flight->beaten);
    uint64_t failed = flight->beaten, counted = flight->blind & receivers;
    size_t index;

    if (flight->repeat) {
        /* The receivers treat the sender's flag as an overload flag and answer one bit later */
        int64_t more_ns = wire_bits_ns(wire, WIRE_ERROR_FLAG_BITS + 1 + WIRE_DELIMITER_BITS);

        wire->idle_ns += more_ns;
        wire->recessive_ns += more_ns;
    }

    /* Find the failed senders, and the receivers that count an error */
    if (flight->failed || flight->repeat) {
        failed |= flight->senders;
    }
    if (flight->failed && !flight->unacknowledged) {
        counted = receivers;
    }
    if (failed) {
        wire->stats.errors[flight->failed ? flight->error : WIRE_BIT_ERROR]++;
    }

    /* A lone node becomes error passive but never bus-off: a passive sender does not count a
     * missing acknowledgment */
    WIRE_FOR_EACH(index, failed)
    {
        bool spare = flight->unacknowledged && wire_is_passive(&wire->node[index]);

        /* Count a failed transmission of a node (TEC + 8; with `spare` no change) and report it */
        struct wire_node *node = &wire->node[index];

        node->stats.errors++;
        wire_count_errors(wire, index, wire->flight.end_ns, spare ? 0 : COUNT_SENDER, 0);
        wire_notify(wire,
                    &(struct wire_event){.kind = WIRE_BUS_ERROR,
                                         .time_ns = wire->flight.end_ns,
                                         .node = index,
                                         .frame = &node->slot[node->flying].frame,
                                         .error = flight->failed ? flight->error : WIRE_BIT_ERROR,
                                         .tec = node->stats.tec,
                                         .rec = node->stats.rec});
    }

    /* The receiver that found the error first reads the others' flags as a second error */
    WIRE_FOR_EACH(index, counted)
    {
        wire_count_errors(wire, index, flight->end_ns, 0,
                          flight->first & WIRE_BIT(index) ? COUNT_FIRST : COUNT_RECEIVER);
    }
}
