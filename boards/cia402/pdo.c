/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Process data objects (CiA 301, 7.2.2): mapping, transmission types, transmission and reception.
 *
 * A node answers the SYNC of a tick at the tick's end, with the readings of its sensors then. The
 * types: 0 with a SYNC when the data have changed, 1 to 240 with every so many SYNCs, 254 and 255
 * when the data have changed or the event timer has run out, not before the inhibit time is over;
 * and each at the end of a tick in which a remote frame asked for it, unless bit 30 of its COB-ID
 * is set. RPDOs of types 0 to 240 wait for the next SYNC, others are applied at once.
 *
 * The mapping of a PDO can be changed while bit 31 of its COB-ID is set and, its objects, while
 * their count is 0.
 */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

#include <string.h>

enum {
    SYNCHRONOUS_MAX = 240,
    MANUFACTURER_EVENT = 254,
    PDO_BYTES = 8,
    CODE_TOO_SHORT = 0x8210, /* EMCY */
    CODE_TOO_LONG = 0x8220,
    DUMMY_FIRST = CIA402_I8, /* data types that RPDOs map to skip bytes */
    DUMMY_LAST = CIA402_U32,
};

#define INHIBIT_UNIT_NS INT64_C(100000)

/* Returns whether a PDO is valid: bit 31 of its COB-ID is 0. */
static bool cia402_pdo_is_valid(const struct cia402_pdo *pdo)
{
    return !(pdo->cob_id & CIA402_COB_INVALID);
}

/* Returns whether an object belongs to an RPDO. */
static bool cia402_entry_is_rpdo(const struct cia402_entry *entry)
{
    return entry->object->scope == CIA402_OF_RPDO;
}

/* Returns the PDO of an object. */
static struct cia402_pdo *cia402_entry_pdo(struct cia402_node *node,
                                           const struct cia402_entry *entry)
{
    return cia402_entry_is_rpdo(entry) ? &node->settings.rpdo[entry->unit]
                                       : &node->settings.tpdo[entry->unit];
}

/* ---- mapping ---- */

/* Finds the object that a mapping object stands for. */
static enum cia402_abort cia402_pdo_resolve(const struct cia402_node *node, int64_t mapping,
                                            bool receive, struct cia402_entry *entry)
{
    unsigned index = (unsigned)(mapping >> 16), sub = (unsigned)(mapping >> 8 & 0xff);
    unsigned bits = (unsigned)(mapping & 0xff);
    unsigned right = receive ? CIA402_MAP_RPDO : CIA402_MAP_TPDO;
    enum cia402_abort reason;

    if (receive && index >= DUMMY_FIRST && index <= DUMMY_LAST && sub == 0) {
        *entry = (struct cia402_entry){.type = (enum cia402_type)index};
    } else {
        reason = cia402_find(node, index, sub, entry);
        if (reason) {
            return reason;
        }
        if (!entry->object || !(entry->object->access & right)) {
            return CIA402_ABORT_NOT_MAPPABLE;
        }
    }
    return bits == cia402_type_bits(entry->type) ? CIA402_DONE : CIA402_ABORT_LENGTH;
}

/* Prepares a PDO for work by its parameters, which have been checked. */
static void cia402_pdo_prepare(struct cia402_node *node, const struct cia402_pdo *pdo,
                               struct cia402_channel *channel, bool receive)
{
    memset(channel, 0, sizeof *channel);
    channel->waits = !receive;
    for (int i = 0; i < pdo->count; i++) {
        cia402_pdo_resolve(node, pdo->object[i], receive, &channel->entry[i]);
        channel->bytes[i] = (uint8_t)(cia402_type_bits(channel->entry[i].type) / 8);
        channel->length = (uint8_t)(channel->length + channel->bytes[i]);
    }
}

/* Prepares the PDO of an object anew. */
static void cia402_pdo_link_entry(struct cia402_node *node, const struct cia402_entry *entry)
{
    bool receive = cia402_entry_is_rpdo(entry);

    cia402_pdo_prepare(node, cia402_entry_pdo(node, entry),
                       receive ? &node->rx[entry->unit] : &node->tx[entry->unit], receive);
}

void cia402_pdo_link(struct cia402_node *node)
{
    for (unsigned i = 0; i < cia402_pdos(node); i++) {
        cia402_pdo_prepare(node, &node->settings.rpdo[i], &node->rx[i], true);
        cia402_pdo_prepare(node, &node->settings.tpdo[i], &node->tx[i], false);
    }
}

void cia402_pdo_start(struct cia402_node *node)
{
    cia402_pdo_link(node);
    node->syncs = 0;
}

/* ---- parameters ---- */

enum cia402_abort cia402_pdo_write_cob(struct cia402_node *node, const struct cia402_entry *entry,
                                       int64_t value)
{
    const int64_t known = CIA402_COB_INVALID | CIA402_COB_NO_REMOTE | CIA402_COB_MASK;
    struct cia402_pdo *pdo = cia402_entry_pdo(node, entry);
    bool valid = !(value & CIA402_COB_INVALID);

    /* The identifier of a valid PDO cannot change, nor become one that is not for PDOs */
    if (value & ~known || (valid && cia402_cob_is_restricted((unsigned)value & CIA402_COB_MASK)) ||
        (valid && cia402_pdo_is_valid(pdo) && (value ^ pdo->cob_id) & CIA402_COB_MASK)) {
        return CIA402_ABORT_VALUE;
    }
    pdo->cob_id = value;
    cia402_pdo_link_entry(node, entry);
    return CIA402_DONE;
}

enum cia402_abort cia402_pdo_write_type(struct cia402_node *node, const struct cia402_entry *entry,
                                        int64_t value)
{
    if (value > SYNCHRONOUS_MAX && value < MANUFACTURER_EVENT) {
        return CIA402_ABORT_VALUE;
    }
    cia402_entry_pdo(node, entry)->type = value;
    return CIA402_DONE;
}

enum cia402_abort cia402_pdo_write_inhibit(struct cia402_node *node,
                                           const struct cia402_entry *entry, int64_t value)
{
    struct cia402_pdo *pdo = cia402_entry_pdo(node, entry);

    if (cia402_pdo_is_valid(pdo)) {
        return CIA402_ABORT_STATE;
    }
    pdo->inhibit_100us = value;
    return CIA402_DONE;
}

enum cia402_abort cia402_pdo_write_count(struct cia402_node *node, const struct cia402_entry *entry,
                                         int64_t value)
{
    struct cia402_pdo *pdo = cia402_entry_pdo(node, entry);
    unsigned bits = 0;

    /* Only the mapping of an invalid PDO can change */
    if (cia402_pdo_is_valid(pdo)) {
        return CIA402_ABORT_STATE;
    }
    if (value > CIA402_MAPPED_MAX) {
        return CIA402_ABORT_MAPPED_LENGTH;
    }
    /* The mapped objects exist, and fit into a frame */
    for (int i = 0; i < value; i++) {
        struct cia402_entry mapped;
        enum cia402_abort reason =
            cia402_pdo_resolve(node, pdo->object[i], cia402_entry_is_rpdo(entry), &mapped);

        if (reason) {
            return reason;
        }
        bits += cia402_type_bits(mapped.type);
    }
    if (bits > 8 * PDO_BYTES) {
        return CIA402_ABORT_MAPPED_LENGTH;
    }
    pdo->count = value;
    cia402_pdo_link_entry(node, entry);
    return CIA402_DONE;
}

enum cia402_abort cia402_pdo_write_object(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value)
{
    struct cia402_pdo *pdo = cia402_entry_pdo(node, entry);
    struct cia402_entry mapped;
    enum cia402_abort reason;

    if (cia402_pdo_is_valid(pdo) || pdo->count > 0) {
        return CIA402_ABORT_STATE;
    }
    reason = value == 0 ? CIA402_DONE
                        : cia402_pdo_resolve(node, value, cia402_entry_is_rpdo(entry), &mapped);
    if (!reason) {
        pdo->object[entry->sub - 1] = value;
    }
    return reason;
}

/* ---- the factory's ---- */

/* Sets a PDO of an axis as CiA 402 has it: the first maps the controlword or statusword, the
 * others another object beside it; those of the first axis have identifiers. */
static void cia402_pdo_set_drive(struct cia402_node *node, unsigned axis, unsigned number)
{
    static const uint32_t second[2][CIA402_AXIS_PDOS] = {{0, 0x60600008, 0x607a0020, 0x60ff0020},
                                                         {0, 0x60610008, 0x60640020, 0x606c0020}};
    const uint32_t step = (uint32_t)CIA402_AXIS_STEP << 16;
    unsigned at = CIA402_AXIS_PDOS * axis + number;

    for (int send = 0; send < 2; send++) {
        struct cia402_pdo *pdo = send ? &node->settings.tpdo[at] : &node->settings.rpdo[at];
        uint32_t id = (send ? CIA402_TPDO : CIA402_RPDO) + 0x100 * number + node->board.address;

        *pdo = (struct cia402_pdo){
            .cob_id = axis == 0 ? id | (number ? CIA402_COB_INVALID : 0) : CIA402_COB_INVALID,
            .type = 255,
            .count = second[send][number] ? 2 : 1,
            .object = {cia402_mapping(send ? CIA402_O_STATUSWORD : CIA402_O_CONTROLWORD, 0, 16) +
                           axis * step,
                       second[send][number] ? second[send][number] + axis * step : 0}};
    }
}

/* Sets the PDOs of a sensor by the plan of its kind. */
static void cia402_pdo_set_plan(struct cia402_node *node)
{
    struct cia402_plan plan;

    for (unsigned row = 0; cia402_plan_row(node->kind, 0, row, &plan); row++) {
        struct cia402_pdo *pdo = &node->settings.tpdo[row];

        *pdo = (struct cia402_pdo){
            .cob_id = plan.cob_id + node->board.address, .type = plan.type, .count = plan.count};
        for (int i = 0; i < plan.count; i++) {
            pdo->object[i] = plan.object[i];
        }
    }
}

void cia402_pdo_set_factory(struct cia402_node *node)
{
    for (unsigned i = 0; i < CIA402_PDOS; i++) {
        node->settings.rpdo[i].cob_id = node->settings.tpdo[i].cob_id = CIA402_COB_INVALID;
    }
    for (unsigned i = 0; i < CIA402_AXIS_PDOS * node->axes; i++) {
        cia402_pdo_set_drive(node, i / CIA402_AXIS_PDOS, i % CIA402_AXIS_PDOS);
    }
    if (node->sensor) {
        cia402_pdo_set_plan(node);
    }
}

/* ---- reception ---- */

/* Writes the data of an RPDO into the mapped objects. */
static void cia402_pdo_apply(struct cia402_node *node, const struct cia402_channel *channel)
{
    const uint8_t *data = channel->data;

    for (int i = 0; i < CIA402_MAPPED_MAX && channel->bytes[i]; i++) {
        const struct cia402_entry *entry = &channel->entry[i];

        /* A value out of its range is left out */
        if (entry->object) {
            cia402_write(node, entry, cia402_get(entry->type, data));
        }
        data += channel->bytes[i];
    }
}

bool cia402_pdo_receive(struct cia402_node *node, const struct bus_frame *frame,
                        enum board_verdict *verdict)
{
    bool found = false;

    for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
        const struct cia402_pdo *pdo = &node->settings.rpdo[i];
        struct cia402_channel *channel = &node->rx[i];

        if (!cia402_pdo_is_valid(pdo) || (pdo->cob_id & CIA402_COB_MASK) != frame->id) {
            continue;
        }
        /* A frame that is too short is refused, one that is too long reported */
        found = true;
        if (frame->len != channel->length) {
            bool short_of = frame->len < channel->length;

            *verdict = BOARD_MALFORMED;
            cia402_emcy_raise(node, short_of ? CODE_TOO_SHORT : CODE_TOO_LONG,
                              CIA402_REGISTER_COMMUNICATION, 0, 0);
            channel->unfit = true;
            if (short_of) {
                continue;
            }
        } else if (channel->unfit) {
            channel->unfit = false;
            cia402_emcy_resolve_communication(node);
        }
        /* The data wait for SYNC, or are applied at once */
        memcpy(channel->data, frame->data, channel->length);
        channel->waits = pdo->type <= SYNCHRONOUS_MAX;
        if (!channel->waits) {
            cia402_pdo_apply(node, channel);
        }
    }
    return found;
}

bool cia402_pdo_request(struct cia402_node *node, unsigned id)
{
    bool found = false;

    for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
        const struct cia402_pdo *pdo = &node->settings.tpdo[i];

        if (cia402_pdo_is_valid(pdo) && !(pdo->cob_id & CIA402_COB_NO_REMOTE) &&
            (pdo->cob_id & CIA402_COB_MASK) == id) {
            node->tx[i].requested = true;
            found = true;
        }
    }
    return found;
}

void cia402_pdo_sync(struct cia402_node *node)
{
    if (node->state != CIA402_OPERATIONAL) {
        return;
    }
    node->syncs++;
    for (unsigned i = 0; i < cia402_pdos(node); i++) {
        if (node->rx[i].waits) {
            node->rx[i].waits = false;
            cia402_pdo_apply(node, &node->rx[i]);
        }
    }
}

/* ---- transmission ---- */

/* Returns whether a TPDO is due by its transmission type. */
static bool cia402_pdo_is_due(const struct cia402_node *node, const struct cia402_pdo *pdo,
                              struct cia402_channel *channel, bool changed)
{
    int64_t since_ns = node->board.boards->now_ns - channel->time_ns;

    if (pdo->type == 0) {
        return node->syncs > 0 && (changed || channel->waits);
    }
    if (pdo->type <= SYNCHRONOUS_MAX) {
        channel->syncs += node->syncs;
        return channel->syncs >= pdo->type;
    }
    return channel->waits || ((changed || (pdo->event_ms > 0 && since_ns >= pdo->event_ms * MS)) &&
                              since_ns >= pdo->inhibit_100us * INHIBIT_UNIT_NS);
}

void cia402_pdo_transmit(struct cia402_node *node, struct frame_sink *sink)
{
    for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
        const struct cia402_pdo *pdo = &node->settings.tpdo[i];
        struct cia402_channel *channel = &node->tx[i];
        uint8_t data[PDO_BYTES] = {0}, *to = data;

        if (!cia402_pdo_is_valid(pdo) || pdo->count == 0) {
            continue;
        }
        /* Collects the mapped values */
        for (int k = 0; k < pdo->count; k++) {
            const struct cia402_entry *entry = &channel->entry[k];

            cia402_put(entry->type, *cia402_field(node, entry), to);
            to += channel->bytes[k];
        }
        /* Sends them when they are due */
        if (cia402_pdo_is_due(node, pdo, channel, memcmp(data, channel->data, PDO_BYTES) != 0) ||
            channel->requested) {
            memcpy(channel->data, data, PDO_BYTES);
            channel->waits = channel->requested = false;
            channel->syncs = 0;
            channel->time_ns = node->board.boards->now_ns;
            board_send(&node->board, sink, (uint32_t)pdo->cob_id & CIA402_COB_MASK, channel->length,
                       data);
        }
    }
    node->syncs = 0;
}
