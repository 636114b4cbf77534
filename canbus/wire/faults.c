/* SPDX-License-Identifier: Apache-2.0 */
/* Injects faults: decides which frames they hit, and what they do to them. */
#include "canbus/wire/private.h"

/* ---- hitting frames ---- */

/* Checks whether a fault hits the frame that starts: armed, in its time, its sender and
 * identifier, and by chance. */
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

/* Lets the foreign node (index config.nodes) send the same identifier with other data at the
 * same time; false = it cannot. */
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

    /* It differs in its data, or in its length where there are none */
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

void wire_apply_collisions(struct wire *wire)
{
    for (size_t i = 0; i < WIRE_FAULTS_MAX; i++) {
        struct wire_armed *armed = &wire->fault[i];

        if (armed->fault.kind == WIRE_FAULT_COLLISION && wire_fault_matches(wire, armed) &&
            wire_add_foreign_sender(wire)) {
            armed->hits++;
            return;
        }
    }
}

/* Returns a random bit between the arbitration field and the CRC delimiter. */
static size_t wire_random_bit(struct wire *wire)
{
    const struct wire_bits *bits = &wire->bits[0];

    return bits->control + random_bits(&wire->random) % (bits->crc_end - bits->control);
}

/* Returns the receivers that a fault concerns, as a mask. */
static uint64_t wire_fault_receivers(const struct wire_fault *fault)
{
    return fault->receiver == WIRE_ANY ? UINT64_MAX : WIRE_BIT(fault->receiver);
}

/* Applies a fault to the frame; false = it has nothing to act on. */
static bool wire_apply_fault(struct wire *wire, const struct wire_fault *fault,
                             struct wire_detection *kept)
{
    struct wire_flight *flight = &wire->flight;
    struct wire_detection found;
    size_t at;

    switch (fault->kind) {
    case WIRE_FAULT_CORRUPT:
        /* The sender reads back another bit than it sent */
        at = wire_random_bit(wire);
        found = wire_detect_by_sender(wire, at, !wire->bits[0].bit[at]);
        wire_keep_earliest(kept, &found);
        return true;
    case WIRE_FAULT_CORRUPT_AT:
        /* One receiver, if it listens, detects it by stuffing or by the CRC */
        if (!(wire_listeners(wire) & WIRE_BIT(fault->receiver))) {
            return false;
        }
        wire_misread_by_receiver(wire, (size_t)fault->receiver,
                                 wire_misread_detected_at(&wire->bits[0], wire_random_bit(wire)),
                                 kept);
        return true;
    case WIRE_FAULT_LOSS:
        /* The bus carries the frame; which receivers miss it is decided at its end */
        flight->lost |= wire_fault_receivers(fault);
        return true;
    case WIRE_FAULT_LATE:
        flight->late |= wire_fault_receivers(fault);
        flight->late_ns = fault->delay_ns;
        return true;
    case WIRE_FAULT_DUPLICATE:
        flight->repeat = true;
        return true;
    default:
        return false;
    }
}

void wire_apply_faults(struct wire *wire, struct wire_detection *kept)
{
    for (size_t i = 0; i < WIRE_FAULTS_MAX; i++) {
        struct wire_armed *armed = &wire->fault[i];

        if (armed->fault.kind != WIRE_FAULT_COLLISION && wire_fault_matches(wire, armed)) {
            armed->hits += wire_apply_fault(wire, &armed->fault, kept);
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
