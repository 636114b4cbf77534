/* SPDX-License-Identifier: Apache-2.0 */
/* Services of every node: power-up, stored parameters, transmission in a tick. */
#include "boards/cia402/private.h"

#include <string.h>

/* "save" and "load", little-endian, as CiA 301 wants them */
enum { SIGNATURE_SAVE = 0x65766173, SIGNATURE_LOAD = 0x64616f6c };

/* Stores settings, user data and tare, as "save" asks. */
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

/* Loads what was stored last. */
static void cia402_node_load(struct cia402_node *node)
{
    node->settings = node->saved;
    memcpy(node->note, node->saved_note, sizeof node->note);
    node->data = node->saved_data;
    for (unsigned k = 0; k < node->axes; k++) {
        node->axis[k].settings = node->axis[k].saved;
    }
    if (node->sensor) {
        memcpy(node->sensor->tare, node->sensor->saved_tare, sizeof node->sensor->tare);
    }
}

/* Goes from initialization into PRE-OPERATIONAL, or further where the rig wants it; not without
 * a Node-ID. */
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

bool cia402_node_power_up(struct cia402_node *node)
{
    bool first = !node->powered;

    if (first || node->restore) {
        cia402_set_factory(node);
        cia402_node_store(node);
        node->powered = true;
        node->restore = false;
    }
    cia402_node_load(node);
    cia402_lss_power_up(node, first);
    node->error_register = 0;
    node->emergencies = 0;
    cia402_node_start_communication(node);
    return first;
}

void cia402_node_reset_communication(struct cia402_node *node)
{
    node->settings = node->saved;
    for (unsigned k = 0; k < node->axes; k++) {
        cia402_axis_lose_connection(node, &node->axis[k]);
    }
    cia402_node_start_communication(node);
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

/* Orders the factory's settings, which take effect at the next reset or power-up. */
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
        cia402_nmt_watch(node);
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
        cia402_pdo_transmit(node, sink);
    }
    board->lost_in_status = board->lost_in_overflow = false;
}
