/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Network management (CiA 301, 7.2.8): states, boot-up, heartbeat, node guarding.
 *
 * A node that hears no heartbeat of the producer in 0x1016 for its time, or no guarding for guard
 * time times life time factor, having heard one before, reports 0x8130, does as 0x1029 says, and
 * its axes do as 0x6007 says.
 */
#include "boards/cia402/private.h"

enum {
    CODE_LIFE_GUARD = 0x8130,
    TO_PRE_OPERATIONAL = 0, /* 0x1029 */
    TO_STOPPED = 2,
};

/* Enters a state of NMT; PDOs start, and axes without commands stop. */
static void cia402_nmt_enter(struct cia402_node *node, enum cia402_nmt_state state)
{
    if (state == node->state) {
        return;
    }
    node->state = state;
    if (state == CIA402_OPERATIONAL) {
        cia402_pdo_start(node);
    }
    /* An axis that can no longer be commanded loses its connection */
    for (unsigned k = 0; k < node->axes && state == CIA402_STOPPED; k++) {
        cia402_axis_lose_connection(node, &node->axis[k]);
    }
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

/* ---- what others expect of the node ---- */

/* Queues a heartbeat with a state. */
static void cia402_nmt_tell_state(struct cia402_node *node, uint8_t data)
{
    board_queue(&node->board, CIA402_HEARTBEAT + node->board.address, 1, &data);
}

/* Answers node guarding with a bit that alternates; a heartbeat producer does not answer. */
void cia402_nmt_guard(struct cia402_node *node)
{
    if (node->settings.producer_ms > 0) {
        return;
    }
    cia402_nmt_tell_state(node, (uint8_t)(node->state | (node->guard_toggle ? 0x80 : 0)));
    node->guard_toggle = !node->guard_toggle;
    node->guarded = true;
    node->guard_lost = false;
    node->guard_ns = node->board.boards->now_ns;
    cia402_emcy_resolve_communication(node);
}

void cia402_nmt_transmit(struct cia402_node *node, struct frame_sink *sink)
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

/* Sets the period of heartbeats; the first comes a period from now. */
enum cia402_abort cia402_nmt_write_producer(struct cia402_node *node,
                                            const struct cia402_entry *entry, int64_t value)
{
    (void)entry;
    node->settings.producer_ms = value;
    node->heartbeat_ns = node->board.boards->now_ns + value * MS;
    return CIA402_DONE;
}

/* ---- what the node expects of others ---- */

/* Returns the Node-ID whose heartbeat the node expects. */
static unsigned cia402_nmt_producer(const struct cia402_node *node)
{
    return (unsigned)(node->settings.consumer >> 16);
}

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

void cia402_nmt_hear(struct cia402_node *node, unsigned producer)
{
    if (producer == cia402_nmt_producer(node) && (node->settings.consumer & 0xffff) > 0) {
        node->consumes = true;
        node->consumer_lost = false;
        node->consumer_ns = node->board.boards->now_ns;
        cia402_emcy_resolve_communication(node);
    }
}

/* Reacts to a lost heartbeat or guarding: an emergency, the axes, the state. */
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

void cia402_nmt_watch(struct cia402_node *node)
{
    const struct cia402_communication *settings = &node->settings;
    int64_t now_ns = node->board.boards->now_ns;
    int64_t life_ns = settings->guard_ms * settings->life_factor * MS;
    int64_t heartbeat_ns = (settings->consumer & 0xffff) * MS;

    if (node->consumes && !node->consumer_lost && now_ns - node->consumer_ns > heartbeat_ns) {
        node->consumer_lost = true;
        cia402_nmt_lose(node);
    }
    if (node->guarded && !node->guard_lost && life_ns > 0 && now_ns - node->guard_ns > life_ns) {
        node->guard_lost = true;
        cia402_nmt_lose(node);
    }
}
