/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The services of a CANopen node except SDO: emergencies, PDOs, network management, LSS, stored
 * parameters. Also the bus, which passes frames to the nodes.
 */
#include "boards/cia402/private.h"

#define INHIBIT_UNIT_NS INT64_C(100000)

enum { NODE_ID_MASK = 0x7f };

/* ---- emergency messages and error history (CiA 301, 7.2.7 and 7.5.2.2 to 7.5.2.4) ---- */

/* Queues an emergency message. */
static void cia402_emcy_queue(struct cia402_node *node, unsigned code, unsigned axis,
                              uint32_t faults)
{
    unsigned at = (node->emergency_first + node->emergencies) % CIA402_EMERGENCIES;

    if (node->emergencies == CIA402_EMERGENCIES) {
        board_lose(&node->board);
        return;
    }
    node->emergencies++;
    node->emergency[at] = (struct cia402_emergency){(uint16_t)code, (uint8_t)node->error_register,
                                                    (uint8_t)axis, faults};
}

void cia402_emcy_raise(struct cia402_node *node, unsigned code, unsigned error_register,
                       unsigned axis, uint32_t faults)
{
    node->error_register |= error_register | CIA402_REGISTER_GENERIC;
    memmove(node->history + 1, node->history, (CIA402_HISTORY - 1) * sizeof *node->history);
    node->history[0] = (int64_t)axis << 16 | code;
    node->history_count += node->history_count < CIA402_HISTORY;
    cia402_emcy_queue(node, code, axis, faults);
}

/* Returns whether a communication error persists: a monitored node is silent, or the length of an
 * RPDO's last frame was wrong. */
static bool cia402_emcy_is_disturbed(const struct cia402_node *node)
{
    bool disturbed = node->guard_lost || node->consumer_lost;

    for (unsigned i = 0; i < cia402_pdos(node); i++) {
        disturbed = disturbed || node->rx[i].unfit;
    }
    return disturbed;
}

void cia402_emcy_clear(struct cia402_node *node)
{
    node->error_register = cia402_emcy_is_disturbed(node)
                               ? CIA402_REGISTER_GENERIC | CIA402_REGISTER_COMMUNICATION
                               : 0;
    cia402_emcy_queue(node, 0, 0, 0);
}

/* Clears the communication error, and queues a message about it, if no cause is left. */
static void cia402_emcy_resolve_communication(struct cia402_node *node)
{
    bool latched = false;

    if (!(node->error_register & CIA402_REGISTER_COMMUNICATION) || cia402_emcy_is_disturbed(node)) {
        return;
    }
    node->error_register &= ~(int64_t)CIA402_REGISTER_COMMUNICATION;
    for (unsigned k = 0; k < node->axes; k++) {
        latched = latched || node->axis[k].latched;
    }
    if (node->error_register == CIA402_REGISTER_GENERIC && !latched) {
        node->error_register = 0;
    }
    cia402_emcy_queue(node, 0, 0, 0);
}

/* Sends waiting emergency messages; the inhibit time limits their rate. */
static void cia402_emcy_transmit(struct cia402_node *node, struct frame_sink *sink)
{
    const struct cia402_communication *settings = &node->settings;
    int64_t now_ns = node->board.boards->now_ns;

    /* While sending is disabled, discard the messages; the history still has the errors */
    if (node->state == CIA402_STOPPED || settings->cob_emcy & CIA402_COB_INVALID) {
        node->emergencies = 0;
        return;
    }
    while (node->emergencies > 0 &&
           now_ns - node->emergency_ns >= settings->emcy_inhibit_100us * INHIBIT_UNIT_NS) {
        const struct cia402_emergency *emergency = &node->emergency[node->emergency_first];
        uint8_t data[CIA402_EMCY_LENGTH] = {0};

        put_u16_le(data, emergency->code);
        data[2] = emergency->error_register;
        data[3] = emergency->axis;
        put_u32_le(data + 4, emergency->faults);
        board_send(&node->board, sink, (uint32_t)settings->cob_emcy & CIA402_COB_MASK, sizeof data,
                   data);
        node->emergency_ns = now_ns;
        node->emergency_first = (node->emergency_first + 1) % CIA402_EMERGENCIES;
        node->emergencies--;
    }
}

/* Clears the error history. The host must write 0. */
enum cia402_abort cia402_emcy_write_history(struct cia402_node *node,
                                            const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    if (value != 0) {
        return CIA402_ABORT_VALUE;
    }
    node->history_count = 0;
    memset(node->history, 0, sizeof node->history);
    return CIA402_DONE;
}

/*
 * Process data objects (CiA 301, 7.2.2): mapping, transmission types, transmission and reception.
 *
 * A node answers a SYNC at the end of the tick, with the sensor readings of that time. The
 * transmission type of a TPDO says when it is sent:
 *
 *   0         with a SYNC, if the data have changed
 *   1 to 240  with every n-th SYNC
 *   254, 255  when the data have changed or the event timer has expired, after the inhibit time
 *
 * A remote frame also requests a TPDO, unless bit 30 of its COB-ID is set. The TPDO is then sent at
 * the end of the tick. The node applies RPDOs of types 0 to 240 at the next SYNC, others at once.
 *
 * The mapping of a PDO can change only while bit 31 of its COB-ID is set. The mapped objects can
 * change only while their count is 0.
 */

enum {
    SYNCHRONOUS_MAX = 240,
    MANUFACTURER_EVENT = 254,
    PDO_BYTES = 8,
    CODE_TOO_SHORT = 0x8210, /* codes of emergency messages */
    CODE_TOO_LONG = 0x8220,
    DUMMY_FIRST = CIA402_I8, /* dummies: an RPDO maps these data types to skip bytes */
    DUMMY_LAST = CIA402_U32,
};

/* Returns whether a PDO is valid: bit 31 of its COB-ID is 0. */
static bool cia402_pdo_is_valid(const struct cia402_pdo *pdo)
{
    return !(pdo->cob_id & CIA402_COB_INVALID);
}

/* Returns whether an object is a parameter of an RPDO. */
static bool cia402_entry_is_rpdo(const struct cia402_entry *entry)
{
    return entry->object->scope == CIA402_OF_RPDO;
}

/* Returns the PDO whose parameter an object is. */
static struct cia402_pdo *cia402_entry_pdo(struct cia402_node *node,
                                           const struct cia402_entry *entry)
{
    return cia402_entry_is_rpdo(entry) ? &node->settings.rpdo[entry->unit]
                                       : &node->settings.tpdo[entry->unit];
}

/* ---- mapping ---- */

/* Finds the object that a mapping entry names, and checks that it may be mapped. */
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

/* Prepares the state of a PDO from its parameters, which the caller has checked. */
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

/* Prepares the PDO of a changed parameter again. */
static void cia402_pdo_link_entry(struct cia402_node *node, const struct cia402_entry *entry)
{
    bool receive = cia402_entry_is_rpdo(entry);

    cia402_pdo_prepare(node, cia402_entry_pdo(node, entry),
                       receive ? &node->rx[entry->unit] : &node->tx[entry->unit], receive);
}

static void cia402_pdo_start(struct cia402_node *node)
{
    for (unsigned i = 0; i < cia402_pdos(node); i++) {
        cia402_pdo_prepare(node, &node->settings.rpdo[i], &node->rx[i], true);
        cia402_pdo_prepare(node, &node->settings.tpdo[i], &node->tx[i], false);
    }
    node->syncs = 0;
}

/* ---- parameters ---- */

enum cia402_abort cia402_pdo_write_cob(struct cia402_node *node, const struct cia402_entry *entry,
                                       int64_t value)
{
    const int64_t known = CIA402_COB_INVALID | CIA402_COB_NO_REMOTE | CIA402_COB_MASK;
    struct cia402_pdo *pdo = cia402_entry_pdo(node, entry);
    bool valid = !(value & CIA402_COB_INVALID);

    /* Refuse to change the identifier of a valid PDO, and refuse a restricted identifier */
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

    /* Refuse to change the mapping of a valid PDO */
    if (cia402_pdo_is_valid(pdo)) {
        return CIA402_ABORT_STATE;
    }
    if (value > CIA402_MAPPED_MAX) {
        return CIA402_ABORT_MAPPED_LENGTH;
    }
    /* Check that the mapped objects exist and fit into a frame */
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

/* ---- factory settings ---- */

/* Sets RPDO and TPDO `number` of an axis to the defaults of CiA 402. Each maps the controlword or
 * the statusword; numbers from 1 on map a second object. Only the PDOs of axis 0 have
 * identifiers. */
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

void cia402_pdo_set_factory(struct cia402_node *node)
{
    for (unsigned i = 0; i < CIA402_PDOS; i++) {
        node->settings.rpdo[i].cob_id = node->settings.tpdo[i].cob_id = CIA402_COB_INVALID;
    }
    for (unsigned i = 0; i < CIA402_AXIS_PDOS * node->axes; i++) {
        cia402_pdo_set_drive(node, i / CIA402_AXIS_PDOS, i % CIA402_AXIS_PDOS);
    }
    if (node->sensor) {
        /* Set the TPDOs of a sensor node from its plan (struct cia402_plan) */
        struct cia402_plan plan;

        for (unsigned row = 0; cia402_plan_row(node->kind, 0, row, &plan); row++) {
            struct cia402_pdo *pdo = &node->settings.tpdo[row];

            *pdo = (struct cia402_pdo){.cob_id = plan.cob_id + node->board.address,
                                       .type = plan.type,
                                       .count = plan.count};
            for (int i = 0; i < plan.count; i++) {
                pdo->object[i] = plan.object[i];
            }
        }
    }
}

/* ---- reception ---- */

/* Writes the data of an RPDO into the mapped objects. */
static void cia402_pdo_apply(struct cia402_node *node, const struct cia402_channel *channel)
{
    const uint8_t *data = channel->data;

    for (int i = 0; i < CIA402_MAPPED_MAX && channel->bytes[i]; i++) {
        const struct cia402_entry *entry = &channel->entry[i];

        /* Skip a value that is out of range */
        if (entry->object) {
            cia402_write(node, entry, cia402_get(entry->type, data));
        }
        data += channel->bytes[i];
    }
}

static bool cia402_pdo_receive(struct cia402_node *node, const struct bus_frame *frame,
                               enum board_verdict *verdict)
{
    bool found = false;

    for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
        const struct cia402_pdo *pdo = &node->settings.rpdo[i];
        struct cia402_channel *channel = &node->rx[i];

        if (!cia402_pdo_is_valid(pdo) || (pdo->cob_id & CIA402_COB_MASK) != frame->id) {
            continue;
        }
        /* Refuse a frame that is too short; report one that is too long */
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
        /* Keep the data for SYNC, or apply them at once */
        memcpy(channel->data, frame->data, channel->length);
        channel->waits = pdo->type <= SYNCHRONOUS_MAX;
        if (!channel->waits) {
            cia402_pdo_apply(node, channel);
        }
    }
    return found;
}

/* ---- transmission ---- */

/* Returns whether the transmission type of a TPDO requires a frame in this tick. changed: the data
 * differ from the last frame. */
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

/*
 * Network management (CiA 301, 7.2.8): states, boot-up, heartbeat, node guarding.
 *
 * A node monitors the heartbeat of the producer in 0x1016 after the first heartbeat. It monitors
 * node guarding after the first guarding frame; the time-out is guard time times life time factor.
 * At a time-out the node sends emergency 0x8130 and reacts by 0x1029; its axes react by 0x6007.
 */

enum {
    CODE_LIFE_GUARD = 0x8130,
    TO_PRE_OPERATIONAL = 0, /* value of object 0x1029: enter PRE-OPERATIONAL */
    TO_STOPPED = 2,
};

/* Enters an NMT state. OPERATIONAL starts the PDOs. In STOPPED the axes lose their connection. */
static void cia402_nmt_enter(struct cia402_node *node, enum cia402_nmt_state state)
{
    if (state == node->state) {
        return;
    }
    node->state = state;
    if (state == CIA402_OPERATIONAL) {
        cia402_pdo_start(node);
    }
    /* In STOPPED no host can command the axes */
    for (unsigned k = 0; k < node->axes && state == CIA402_STOPPED; k++) {
        cia402_axis_lose_connection(node, &node->axis[k]);
    }
}

/* Returns whether a Node-ID is free on the bus, or belongs to this node. */
static bool cia402_lss_id_is_free(const struct cia402_node *node, unsigned id)
{
    const struct board *other = node->board.bus->by_address[id];

    return !other || other == &node->board;
}

/* Replaces the Node-ID in a COB-ID, if the COB-ID contains the old one. */
static void cia402_lss_move_cob(int64_t *cob_id, unsigned from, unsigned to)
{
    if ((*cob_id & NODE_ID_MASK) == (int64_t)from) {
        *cob_id = (*cob_id & ~(int64_t)NODE_ID_MASK) | to;
    }
}

/* Replaces the Node-ID in the COB-IDs of the settings. */
static void cia402_lss_move_settings(struct cia402_communication *settings, unsigned from,
                                     unsigned to)
{
    cia402_lss_move_cob(&settings->cob_emcy, from, to);
    for (unsigned i = 0; i < CIA402_PDOS; i++) {
        cia402_lss_move_cob(&settings->rpdo[i].cob_id, from, to);
        cia402_lss_move_cob(&settings->tpdo[i].cob_id, from, to);
    }
}

static void cia402_lss_take_id(struct cia402_node *node)
{
    /* End LSS configuration */
    unsigned from = node->board.address, to = node->lss.next;

    node->lss.configuring = false;
    node->lss.selected = node->lss.scanned = 0;
    /* Leave the bus if there is no Node-ID or it is not free; then only LSS works */
    if (to == CIA402_NO_NODE_ID || !cia402_lss_id_is_free(node, to)) {
        struct board **place = &node->board.bus->by_address[node->board.address];

        if (*place == &node->board) {
            *place = NULL;
        }
        if (!node->nameless) {
            board_event(&node->board, BOARD_EVENT_ADDRESS, 0, node->board.address,
                        CIA402_NO_NODE_ID);
        }
        node->nameless = true;
        return;
    }
    if (to == from && !node->nameless) {
        return;
    }
    /* Give the node its new address on the bus, and change its COB-IDs */
    board_event(&node->board, BOARD_EVENT_ADDRESS, 0, node->nameless ? CIA402_NO_NODE_ID : from,
                to);
    if (node->board.bus->by_address[from] == &node->board) {
        node->board.bus->by_address[from] = NULL;
    }
    board_bus_place(node->board.bus, to, &node->board);
    node->board.address = (uint8_t)to;
    node->nameless = false;
    cia402_lss_move_settings(&node->settings, from, to);
    cia402_lss_move_settings(&node->saved, from, to);
    cia402_lss_move_cob(&node->sdo_request, from, to);
    cia402_lss_move_cob(&node->sdo_reply, from, to);
}

/* Starts communication: goes to PRE-OPERATIONAL, or to OPERATIONAL if the rig demands it
 * (transmit_at_start). Needs a Node-ID. */
static void cia402_node_start_communication(struct cia402_node *node)
{
    cia402_lss_take_id(node);
    node->state = node->nameless                         ? CIA402_BOOT_UP
                  : node->board.config.transmit_at_start ? CIA402_OPERATIONAL
                                                         : CIA402_PRE_OPERATIONAL;
    node->boot_up_due = true;
    node->guard_toggle = node->guarded = node->guard_lost = false;
    node->consumes = node->consumer_lost = false;
    memset(&node->transfer, 0, sizeof node->transfer);
    cia402_pdo_start(node);
    cia402_emcy_resolve_communication(node);
}

static void cia402_node_reset_communication(struct cia402_node *node)
{
    node->settings = node->saved;
    for (unsigned k = 0; k < node->axes; k++) {
        cia402_axis_lose_connection(node, &node->axis[k]);
    }
    cia402_node_start_communication(node);
}

void cia402_nmt_command(struct cia402_node *node, unsigned command)
{
    switch (command) {
    case CIA402_NMT_START:
        cia402_nmt_enter(node, CIA402_OPERATIONAL);
        break;
    case CIA402_NMT_STOP:
        cia402_nmt_enter(node, CIA402_STOPPED);
        break;
    case CIA402_NMT_PRE_OPERATIONAL:
        cia402_nmt_enter(node, CIA402_PRE_OPERATIONAL);
        break;
    case CIA402_NMT_RESET_NODE:
        board_enter_bootloader(&node->board, node->board.config.boot_ns);
        break;
    default:
        cia402_node_reset_communication(node);
        break;
    }
}

/* ---- heartbeat producer and answers to guarding ---- */

static void cia402_nmt_transmit(struct cia402_node *node, struct frame_sink *sink)
{
    int64_t now_ns = node->board.boards->now_ns, period_ns = node->settings.producer_ms * MS;
    uint8_t data = CIA402_BOOT_UP;

    if (node->boot_up_due) {
        node->boot_up_due = false;
        node->heartbeat_ns = now_ns + period_ns;
        board_send(&node->board, sink, CIA402_HEARTBEAT + node->board.address, 1, &data);
        return;
    }
    if (period_ns > 0 && now_ns >= node->heartbeat_ns) {
        data = (uint8_t)node->state;
        node->heartbeat_ns += ((now_ns - node->heartbeat_ns) / period_ns + 1) * period_ns;
        board_send(&node->board, sink, CIA402_HEARTBEAT + node->board.address, 1, &data);
    }
}

/* Sets the heartbeat period; the first heartbeat comes one period later. */
enum cia402_abort cia402_nmt_write_producer(struct cia402_node *node,
                                            const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    node->settings.producer_ms = value;
    node->heartbeat_ns = node->board.boards->now_ns + value * MS;
    return CIA402_DONE;
}

/* ---- heartbeat consumer and guarding time-out ---- */

enum cia402_abort cia402_nmt_write_consumer(struct cia402_node *node,
                                            const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    if (value >> 16 > 127) {
        return CIA402_ABORT_VALUE;
    }
    node->settings.consumer = value;
    node->consumes = node->consumer_lost = false;
    cia402_emcy_resolve_communication(node);
    return CIA402_DONE;
}

/* Reacts to a lost heartbeat or lost guarding: sends an emergency, informs the axes, changes the
 * state. */
static void cia402_nmt_lose(struct cia402_node *node)
{
    int64_t behavior = node->settings.error_behavior;

    cia402_emcy_raise(node, CODE_LIFE_GUARD, CIA402_REGISTER_COMMUNICATION, 0,
                      CIA402_FAULT_CONNECTION);
    for (unsigned k = 0; k < node->axes; k++) {
        cia402_axis_lose_connection(node, &node->axis[k]);
    }
    if (behavior == TO_STOPPED) {
        cia402_nmt_enter(node, CIA402_STOPPED);
    } else if (behavior == TO_PRE_OPERATIONAL && node->state == CIA402_OPERATIONAL) {
        cia402_nmt_enter(node, CIA402_PRE_OPERATIONAL);
    }
}

/*
 * Layer setting services (LSS, CiA 305) of a node as LSS slave: state switch of all nodes or of the
 * node with an LSS address (object 0x1018), inquiries, setting and storing the Node-ID, fastscan.
 * The node refuses to change the bit rate.
 *
 * A new Node-ID takes effect at the next reset of communication. On a node without a Node-ID it
 * takes effect when the master ends the configuration. Unless stored, it is lost at the next
 * power-up. COB-IDs that contain the old Node-ID change too. A node without a Node-ID (255) runs
 * only LSS. It stays without a Node-ID if another node of the bus already has the new one.
 */

enum {
    STATE_WAITING = 0,
    STATE_CONFIGURATION = 1,
    ADDRESS_PARTS = 4,
    SCAN_BITS = 32,
    SCAN_RESET = 0x80, /* value of the bit number: every node without a Node-ID answers */
    ERROR_NOT_SUPPORTED = 1,
    ERROR_NODE_ID = 1, /* Node-ID out of range */
    ERROR_SPECIFIC = 255,
    /* manufacturer's code with ERROR_SPECIFIC: another node has the Node-ID */
    ERROR_NODE_ID_TAKEN = 1,
};

/* Queues an LSS answer with a 32-bit value. */
static void cia402_lss_answer(struct cia402_node *node, unsigned command, uint32_t value)
{
    uint8_t data[CIA402_LSS_LENGTH] = {(uint8_t)command};

    put_u32_le(data + 1, value);
    board_queue(&node->board, CIA402_LSS_REPLY, sizeof data, data);
}

/* ---- the Node-ID ---- */

/* Sets the Node-ID for the next reset. Returns the LSS error; 0 = none. */
static unsigned cia402_lss_set_id(struct cia402_node *node, unsigned id)
{
    if ((id == 0 || id > CIA402_NODE_MAX) && id != CIA402_NO_NODE_ID) {
        return ERROR_NODE_ID;
    }
    if (id != CIA402_NO_NODE_ID && !cia402_lss_id_is_free(node, id)) {
        return ERROR_SPECIFIC | ERROR_NODE_ID_TAKEN << 8;
    }
    node->lss.next = (uint8_t)id;
    return 0;
}

/* ---- states ---- */

/* Switches the LSS state, by a request to all nodes. At the end of the configuration, a node
 * without a Node-ID adopts its new one. */
static void cia402_lss_switch(struct cia402_node *node, const uint8_t *data)
{
    bool was_configuring = node->lss.configuring;

    if (data[1] > STATE_CONFIGURATION) {
        return;
    }
    node->lss.configuring = data[1] == STATE_CONFIGURATION;
    node->lss.selected = 0;
    if (was_configuring && data[1] == STATE_WAITING && node->nameless &&
        node->lss.next != CIA402_NO_NODE_ID) {
        cia402_node_reset_communication(node);
    }
}

/* Runs a step of fastscan: answers if the bits of an address part match. The master finds the
 * address bit by bit, highest bit first, from these answers. */
static void cia402_lss_scan(struct cia402_node *node, const uint8_t *data)
{
    struct cia402_lss_slave *lss = &node->lss;
    unsigned bit = data[5], part = data[6], next = data[7];

    if (!node->nameless || lss->next != CIA402_NO_NODE_ID || part >= ADDRESS_PARTS ||
        next >= ADDRESS_PARTS || (bit >= SCAN_BITS && bit != SCAN_RESET)) {
        return;
    }
    if (bit == SCAN_RESET) {
        lss->scanned = 0;
    } else if (lss->scanned != part ||
               get_u32_le(data + 1) >> bit != (uint32_t)node->identity[part] >> bit) {
        return;
    } else {
        lss->scanned = (uint8_t)next;
        lss->configuring = bit == 0 && next < part; /* true after the last bit of the last part */
    }
    cia402_lss_answer(node, CIA402_LSS_IDENTIFIED, 0);
}

/* ---- requests ---- */

/* Handles an LSS request of 8 bytes. Returns false for an unknown request. Requests to the selected
 * node have an effect only in the state LSS configuration. Selection and fastscan have an effect
 * only in the state LSS waiting. */
static bool cia402_lss_receive(struct cia402_node *node, const uint8_t *data)
{
    bool configuring = node->lss.configuring;
    unsigned command = data[0];
    uint32_t answer = 0;

    switch (command) {
    /* Requests to all nodes */
    case CIA402_LSS_SWITCH_GLOBAL:
        cia402_lss_switch(node, data);
        return true;
    case CIA402_LSS_FASTSCAN:
        if (!configuring) {
            cia402_lss_scan(node, data);
        }
        return true;

    /* Requests to the selected node */
    case CIA402_LSS_SET_NODE_ID:
        answer = configuring ? cia402_lss_set_id(node, data[1]) : 0;
        break;
    case CIA402_LSS_SET_BIT_TIMING:
        answer = ERROR_NOT_SUPPORTED;
        break;
    case CIA402_LSS_STORE:
        node->lss.stored = configuring ? node->lss.next : node->lss.stored;
        break;
    case CIA402_LSS_ACTIVATE_BIT_TIMING:
        return true; /* no answer, because the bit rate cannot change */
    case CIA402_LSS_INQUIRE_NODE_ID:
        answer = node->nameless ? CIA402_NO_NODE_ID : node->board.address;
        break;
    default:
        if (command >= CIA402_LSS_SELECT_VENDOR && command <= CIA402_LSS_SELECT_SERIAL) {
            if (!configuring) {
                /* Compare one part of the LSS address; the master sends the four parts in order.
                 * Select the node when all have matched. */
                unsigned part = data[0] - CIA402_LSS_SELECT_VENDOR;
                bool fits = (part == 0 || part == node->lss.selected) &&
                            get_u32_le(data + 1) == (uint32_t)node->identity[part];

                node->lss.selected = (uint8_t)(fits ? part + 1 : 0);
                if (node->lss.selected == ADDRESS_PARTS) {
                    node->lss.selected = 0;
                    node->lss.configuring = true;
                    cia402_lss_answer(node, CIA402_LSS_SELECTED, 0);
                }
            }
            return true;
        }
        if (command < CIA402_LSS_INQUIRE_VENDOR || command > CIA402_LSS_INQUIRE_SERIAL) {
            return false;
        }
        answer = (uint32_t)node->identity[command - CIA402_LSS_INQUIRE_VENDOR];
        break;
    }
    if (configuring) {
        cia402_lss_answer(node, command, answer);
    }
    return true;
}

/* ---- power-up, stored parameters, transmission in a tick ---- */

/* "save" and "load", little-endian (CiA 301) */
enum { SIGNATURE_SAVE = 0x65766173, SIGNATURE_LOAD = 0x64616f6c };

/* Stores settings, user data and tare, when the host writes "save". */
static void cia402_node_store(struct cia402_node *node)
{
    node->saved = node->settings;
    memcpy(node->saved_note, node->note, sizeof node->saved_note);
    node->saved_data = node->data;
    for (unsigned k = 0; k < node->axes; k++) {
        node->axis[k].saved = node->axis[k].settings;
    }
    if (node->sensor) {
        memcpy(node->sensor->saved_tare, node->sensor->tare, sizeof node->sensor->saved_tare);
    }
}

bool cia402_node_power_up(struct cia402_node *node)
{
    bool first = !node->powered;

    if (first || node->restore) {
        cia402_set_factory(node);
        cia402_node_store(node);
        node->powered = true;
        node->restore = false;
    }

    /* Load the last stored values */
    node->settings = node->saved;
    memcpy(node->note, node->saved_note, sizeof node->note);
    node->data = node->saved_data;
    for (unsigned k = 0; k < node->axes; k++) {
        node->axis[k].settings = node->axis[k].saved;
    }
    if (node->sensor) {
        memcpy(node->sensor->tare, node->sensor->saved_tare, sizeof node->sensor->tare);
    }
    node->lss.stored = first ? node->board.address : node->lss.stored;
    node->lss.next = node->lss.stored;
    node->error_register = 0;
    node->emergencies = 0;
    cia402_node_start_communication(node);
    return first;
}

enum cia402_abort cia402_node_write_store(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    if (value != SIGNATURE_SAVE) {
        return CIA402_ABORT_STORE;
    }
    for (unsigned k = 0; k < node->axes; k++) {
        if (node->axis[k].state == CIA402_OPERATION_ENABLED) {
            return CIA402_ABORT_STATE;
        }
    }
    cia402_node_store(node);
    node->restore = false;
    return CIA402_DONE;
}

/* Requests factory settings. They take effect at the next reset or power-up. */
enum cia402_abort cia402_node_write_restore(struct cia402_node *node,
                                            const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    if (value != SIGNATURE_LOAD) {
        return CIA402_ABORT_STORE;
    }
    node->restore = true;
    return CIA402_DONE;
}

void cia402_node_step(struct cia402_node *node, struct ms_span span)
{
    if (!node->nameless) {
        const struct cia402_communication *settings = &node->settings;
        int64_t now_ns = node->board.boards->now_ns;
        int64_t life_ns = settings->guard_ms * settings->life_factor * MS;
        int64_t heartbeat_ns = (settings->consumer & 0xffff) * MS;

        if (node->consumes && !node->consumer_lost && now_ns - node->consumer_ns > heartbeat_ns) {
            node->consumer_lost = true;
            cia402_nmt_lose(node);
        }
        if (node->guarded && !node->guard_lost && life_ns > 0 &&
            now_ns - node->guard_ns > life_ns) {
            node->guard_lost = true;
            cia402_nmt_lose(node);
        }
        cia402_block_step(node, span);
    }
}

void cia402_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct cia402_node *node = cia402_node_of(board);

    (void)span;
    if (!node->nameless) {
        cia402_nmt_transmit(node, sink);
        cia402_emcy_transmit(node, sink);

        /* Send the TPDOs that are due or requested */
        for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
            const struct cia402_pdo *pdo = &node->settings.tpdo[i];
            struct cia402_channel *channel = &node->tx[i];
            uint8_t data[PDO_BYTES] = {0}, *to = data;

            if (!cia402_pdo_is_valid(pdo) || pdo->count == 0) {
                continue;
            }
            /* Collect the values of the mapped objects */
            for (int k = 0; k < pdo->count; k++) {
                const struct cia402_entry *entry = &channel->entry[k];

                cia402_put(entry->type, *cia402_field(node, entry), to);
                to += channel->bytes[k];
            }
            if (cia402_pdo_is_due(node, pdo, channel,
                                  memcmp(data, channel->data, PDO_BYTES) != 0) ||
                channel->requested) {
                memcpy(channel->data, data, PDO_BYTES);
                channel->waits = channel->requested = false;
                channel->syncs = 0;
                channel->time_ns = node->board.boards->now_ns;
                board_send(&node->board, sink, (uint32_t)pdo->cob_id & CIA402_COB_MASK,
                           channel->length, data);
            }
        }
        node->syncs = 0;
    }
    board->lost_in_status = board->lost_in_overflow = false;
}

/* ---- the bus: passes frames to the nodes that use them ---- */

enum { NODES = CIA402_NODE_MAX + 1 };

_Static_assert((int)NODES <= (int)BOARD_ADDRESSES, "a node is an address of its bus");

/* Returns the node with a Node-ID, if it can receive; NULL = none. */
static struct cia402_node *cia402_bus_node(const struct board_bus *bus, unsigned id)
{
    struct board *board = id > 0 && id < NODES ? bus->by_address[id] : NULL;

    return board && !board_is_deaf(board) ? cia402_node_of(board) : NULL;
}

/* Executes an NMT command for one node or for all nodes. */
static void cia402_bus_receive_nmt(struct boards *boards, struct board_bus *bus,
                                   const struct bus_frame *frame)
{
    unsigned command = frame->data[0];
    bool known = command == CIA402_NMT_START || command == CIA402_NMT_STOP ||
                 command == CIA402_NMT_PRE_OPERATIONAL || command == CIA402_NMT_RESET_NODE ||
                 command == CIA402_NMT_RESET_COMMUNICATION;
    enum board_verdict verdict = frame->len != CIA402_NMT_LENGTH ? BOARD_MALFORMED
                                 : known                         ? BOARD_OBEYED
                                                                 : BOARD_UNKNOWN;
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);

        if (node &&
            (frame->len < CIA402_NMT_LENGTH || frame->data[1] == 0 || frame->data[1] == id)) {
            listener = &node->board;
            if (verdict == BOARD_OBEYED) {
                cia402_nmt_command(node, command);
            }
        }
    }
    boards_count_frame(boards, listener, verdict, frame);
}

/* Passes a frame to all nodes that use it: a heartbeat, boot-up, SYNC or PDO, or a remote frame for
 * a TPDO. Returns false when no node uses the frame. Counts the frame once: for the first node that
 * refuses it, otherwise for the last node that accepts it. */
static bool cia402_bus_offer(struct boards *boards, struct board_bus *bus,
                             const struct bus_frame *frame)
{
    unsigned producer = frame->id & NODE_ID_MASK;
    bool heartbeat = (frame->id & ~(unsigned)NODE_ID_MASK) == CIA402_HEARTBEAT;
    enum board_verdict verdict = BOARD_OBEYED;
    struct board *listener = NULL;

    for (unsigned id = 1; id < NODES; id++) {
        struct cia402_node *node = cia402_bus_node(bus, id);
        enum board_verdict own = BOARD_OBEYED;
        bool used = node;

        if (!node) {
            continue;
        }
        if (frame->flags & FRAME_REMOTE) {
            /* Mark the TPDOs that the remote frame requests */
            used = false;
            for (unsigned i = 0; i < cia402_pdos(node) && node->state == CIA402_OPERATIONAL; i++) {
                const struct cia402_pdo *pdo = &node->settings.tpdo[i];

                if (cia402_pdo_is_valid(pdo) && !(pdo->cob_id & CIA402_COB_NO_REMOTE) &&
                    (pdo->cob_id & CIA402_COB_MASK) == frame->id) {
                    node->tx[i].requested = true;
                    used = true;
                }
            }
        } else if (heartbeat) {
            used = node->settings.consumer >> 16 == producer;
            if (used && (node->settings.consumer & 0xffff) > 0) {
                node->consumes = true;
                node->consumer_lost = false;
                node->consumer_ns = node->board.boards->now_ns;
                cia402_emcy_resolve_communication(node);
            }
        } else if (node->state == CIA402_STOPPED) {
            used = false;
        } else if (node->settings.cob_sync != (int64_t)frame->id) {
            used = cia402_pdo_receive(node, frame, &own);
        } else if (frame->len > 1) {
            own = BOARD_MALFORMED;
        } else if (node->state == CIA402_OPERATIONAL) {
            node->syncs++;
            board_queue_transmit(&node->board); /* synchronous TPDOs */
            for (unsigned i = 0; i < cia402_pdos(node); i++) {
                if (node->rx[i].waits) {
                    node->rx[i].waits = false;
                    cia402_pdo_apply(node, &node->rx[i]);
                }
            }
        }
        if (used && verdict == BOARD_OBEYED) {
            listener = &node->board;
            verdict = own;
        }
    }
    if (listener) {
        boards_count_frame(boards, listener, verdict, frame);
    }
    return listener;
}

/* Passes a frame to its service by the identifier. Returns false when no node uses the frame. */
static bool cia402_bus_dispatch(struct boards *boards, struct board_bus *bus,
                                const struct bus_frame *frame)
{
    unsigned id = frame->id & NODE_ID_MASK, service = frame->id & ~(unsigned)NODE_ID_MASK;
    struct cia402_node *node = cia402_bus_node(bus, id);

    /* A remote frame requests either node guarding or a TPDO */
    if (frame->flags & FRAME_REMOTE && service == CIA402_HEARTBEAT) {
        if (node) {
            /* Answer a guarding frame with the state and a toggle bit. A heartbeat producer does
             * not answer. */
            if (node->settings.producer_ms <= 0) {
                uint8_t data = (uint8_t)(node->state | (node->guard_toggle ? 0x80 : 0));

                board_queue(&node->board, CIA402_HEARTBEAT + node->board.address, 1, &data);
                node->guard_toggle = !node->guard_toggle;
                node->guarded = true;
                node->guard_lost = false;
                node->guard_ns = node->board.boards->now_ns;
                cia402_emcy_resolve_communication(node);
            }
            boards_count_frame(boards, &node->board, BOARD_OBEYED, frame);
        }
        return node;
    }
    if (!(frame->flags & FRAME_REMOTE)) {
        if (frame->id == CIA402_LSS_REQUEST) {
            /* Pass an LSS request to all nodes, including those without a Node-ID */
            enum board_verdict verdict = BOARD_MALFORMED;
            struct board *listener = NULL;

            for (size_t i = 0; i < boards->nboard; i++) {
                struct board *board = boards->board[i];

                if (board->bus != bus || board_is_deaf(board)) {
                    continue;
                }
                listener = board;
                if (frame->len == CIA402_LSS_LENGTH) {
                    bool known = cia402_lss_receive(cia402_node_of(board), frame->data);

                    verdict = known ? BOARD_OBEYED : BOARD_UNKNOWN;
                }
            }
            boards_count_frame(boards, listener, verdict, frame);

            return true;
        }
        if (service == CIA402_NMT) {
            if (id == 0) {
                cia402_bus_receive_nmt(boards, bus, frame);
            }
            return id == 0;
        }
        if (service == CIA402_SDO_REQUEST) {
            bool serves = node && node->state != CIA402_STOPPED;

            if (serves) {
                enum board_verdict verdict = BOARD_MALFORMED;

                if (frame->len == CIA402_SDO_LENGTH) {
                    enum cia402_abort reason = cia402_sdo_receive(node, frame->data);

                    verdict = reason == CIA402_DONE ? BOARD_OBEYED
                              : reason == CIA402_ABORT_NO_OBJECT ||
                                      reason == CIA402_ABORT_NO_SUB_INDEX ||
                                      reason == CIA402_ABORT_COMMAND
                                  ? BOARD_UNKNOWN
                                  : BOARD_MALFORMED;
                }
                boards_count_frame(boards, &node->board, verdict, frame);
            }
            return serves;
        }
    }
    return cia402_bus_offer(boards, bus, frame);
}

/* Receives a frame of the bus (struct protocol). */
static void cia402_bus_receive(struct boards *boards, struct board_bus *bus,
                               const struct bus_frame *frame)
{
    if (!cia402_bus_dispatch(boards, bus, frame)) {
        boards->counters.foreign++;
    }
}

const struct board_bus_ops cia402_bus_ops = {
    .size = sizeof(struct board_bus),
    .remote = true,
    .receive = cia402_bus_receive,
};
