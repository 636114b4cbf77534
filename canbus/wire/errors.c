/* SPDX-License-Identifier: Apache-2.0 */
/* Decides what ends a disturbed frame. When a frame starts and something may happen to it, its
 * bits are written out and every error that a node would detect is searched (detection.c); the
 * earliest one ends the frame. */
#include "canbus/wire/private.h"

enum {
    COUNT_SENDER = 8,
    COUNT_RECEIVER = 1,
    COUNT_FIRST = 9, /* the flags of the others are the dominant bit behind its own */
};

/* ---- collisions ---- */

/* Finds the first bit in which two encoded frames differ; false = they are the same. */
static bool wire_first_difference(const struct wire_bits *a, const struct wire_bits *b, size_t *at)
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

/* Resolves the collision of several nodes that have won the arbitration with the same
 * identifier. At the first bit that differs, a node that sends recessive reads dominant: its
 * error flag ends the frame, unless it is error passive and only drops out. Leaves the bits of
 * the remaining frame in bits[0]. */
static void wire_resolve_collision(struct wire *wire, struct wire_detection *kept)
{
    struct wire_flight *flight = &wire->flight;

    for (;;) {
        size_t at = WIRE_BITS_MAX, here, index;
        uint64_t recessive;

        wire_frame_encode(&wire_flying(wire, (size_t)__builtin_ctzll(flight->senders))->frame,
                          &wire->bits[0]);

        /* The first bit in which any of them differs from the first sender */
        WIRE_FOR_EACH(index, flight->senders & (flight->senders - 1))
        {
            wire_frame_encode(&wire_flying(wire, index)->frame, &wire->bits[1]);
            if (wire_first_difference(&wire->bits[0], &wire->bits[1], &here) && here < at) {
                at = here;
            }
        }
        if (at == WIRE_BITS_MAX) {
            return;
        }

        /* An error active node among the recessive ones ends the frame; passive ones drop out,
         * and the rest is compared anew */
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

/* ---- bit rates ---- */

/* Applies a sender of another bit rate: error active receivers destroy its frame, passive ones
 * only miss it. */
static void wire_mismatch_sender(struct wire *wire, size_t sender, struct wire_detection *kept)
{
    const uint64_t listeners = wire_listeners(wire);
    const int64_t bitrate = wire->node[sender].bitrate;
    struct wire_detection found;

    if (wire_any_error_active(wire, listeners)) {
        found = (struct wire_detection){
            .after_ns =
                wire_bits_ns(wire, wire_foreign_rate_detected_after(wire, &wire->bits[0], bitrate)),
            .flag_bits = 2 * WIRE_ERROR_FLAG_BITS,
            .error = WIRE_BIT_ERROR,
            .first = listeners,
        };
    } else {
        found = wire_detect_missing_ack(wire);
        found.after_ns = (int64_t)((double)(wire->bits[0].ack + 1) * 1e9 / (double)bitrate);
        wire->flight.blind |= listeners;
    }
    wire_keep_earliest(kept, &found);
}

/* Applies what nodes of another bit rate do to the frame, as its senders and as its receivers. */
static void wire_apply_mismatch(struct wire *wire, struct wire_detection *kept)
{
    const uint64_t on = wire->mismatched & ~(wire->off | wire->unplugged);
    size_t index;

    WIRE_FOR_EACH(index, on & wire->flight.senders)
    {
        wire_mismatch_sender(wire, index, kept);
    }
    WIRE_FOR_EACH(index, on & ~(wire->flight.senders | wire->flight.beaten))
    {
        wire_misread_by_receiver(
            wire, index, wire_mismatch_detected_at(wire, &wire->bits[0], wire->node[index].bitrate),
            kept);
    }
}

/* ---- seams ---- */

void wire_disturb(struct wire *wire)
{
    struct wire_flight *flight = &wire->flight;
    struct wire_detection kept = {.after_ns = WIRE_NEVER}, found;

    /* Every error that may end the frame; the earliest is kept */
    if (wire->armed) {
        wire_apply_collisions(wire);
    }
    wire_resolve_collision(wire, &kept);
    wire_apply_faults(wire, &kept);
    wire_apply_mismatch(wire, &kept);
    if (!(wire_listeners(wire) & ~flight->blind)) {
        found = wire_detect_missing_ack(wire);
        wire_keep_earliest(&kept, &found);
    }

    /* No error: the frame goes to its end */
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

/* Counts a failed transmission of a node (TEC + 8, or none when `spare`) and reports it. */
static void wire_fail_sender(struct wire *wire, size_t index, enum wire_error error, bool spare)
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
        /* The sender's flag, which the receivers take for an overload and answer a bit later */
        int64_t more_ns = wire_bits_ns(wire, WIRE_ERROR_FLAG_BITS + 1 + WIRE_DELIMITER_BITS);

        wire->idle_ns += more_ns;
        wire->recessive_ns += more_ns;
    }

    /* Who has failed to send, and who counts a receive error */
    if (flight->failed || flight->repeat) {
        failed |= flight->senders;
    }
    if (flight->failed && !flight->unacknowledged) {
        counted = receivers;
    }
    if (failed) {
        wire->stats.errors[flight->failed ? flight->error : WIRE_BIT_ERROR]++;
    }

    /* Being alone makes a node error passive but never bus-off: a passive sender without
     * acknowledgment does not count */
    WIRE_FOR_EACH(index, failed)
    {
        bool spare = flight->unacknowledged && wire_is_passive(&wire->node[index]);

        wire_fail_sender(wire, index, flight->failed ? flight->error : WIRE_BIT_ERROR, spare);
    }

    /* The receiver that found the error first reads the others' flags as a second error */
    WIRE_FOR_EACH(index, counted)
    {
        wire_count_errors(wire, index, flight->end_ns, 0,
                          flight->first & WIRE_BIT(index) ? COUNT_FIRST : COUNT_RECEIVER);
    }
}
