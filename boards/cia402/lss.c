/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Layer setting services of a node as the slave (CiA 305): switching of its state, all nodes or the
 * one with an address (0x1018), inquiries, Node-ID, storing, and fastscan. The bit rate is the
 * bus's and no other is taken.
 *
 * A Node-ID takes effect with the next reset of communication, or, of a node that had none, when
 * the master ends the configuration; without storing the next power-up brings the old one back.
 * COB-IDs that contain the old Node-ID follow. A node without one (255) does nothing but LSS; it
 * stays so, too, where another node of the bus has the one that it should take.
 */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

enum {
    STATE_WAITING = 0,
    STATE_CONFIGURATION = 1,
    ADDRESS_PARTS = 4,
    NODE_ID_MASK = 0x7f,
    SCAN_BITS = 32,
    SCAN_RESET = 0x80, /* in place of a bit: every node without a Node-ID answers */
    ERROR_NOT_SUPPORTED = 1,
    ERROR_NODE_ID = 1, /* out of range */
    ERROR_SPECIFIC = 255,
    ERROR_NODE_ID_TAKEN = 1, /* of ERROR_SPECIFIC; ours */
};

/* Queues an answer with a number. */
static void cia402_lss_answer(struct cia402_node *node, unsigned command, uint32_t value)
{
    uint8_t data[CIA402_LSS_LENGTH] = {(uint8_t)command};

    put_u32_le(data + 1, value);
    board_queue(&node->board, CIA402_LSS_REPLY, sizeof data, data);
}

/* ---- the Node-ID ---- */

/* Returns whether a Node-ID is free for a node. */
static bool cia402_lss_id_is_free(const struct cia402_node *node, unsigned id)
{
    const struct board *other = node->board.bus->by_address[id];

    return !other || other == &node->board;
}

/* Puts the new Node-ID into a COB-ID that has the old one. */
static void cia402_lss_move_cob(int64_t *cob_id, unsigned from, unsigned to)
{
    if ((*cob_id & NODE_ID_MASK) == (int64_t)from) {
        *cob_id = (*cob_id & ~(int64_t)NODE_ID_MASK) | to;
    }
}

/* Puts the new Node-ID into the COB-IDs of the settings. */
static void cia402_lss_move_settings(struct cia402_communication *settings, unsigned from,
                                     unsigned to)
{
    cia402_lss_move_cob(&settings->cob_emcy, from, to);
    for (unsigned i = 0; i < CIA402_PDOS; i++) {
        cia402_lss_move_cob(&settings->rpdo[i].cob_id, from, to);
        cia402_lss_move_cob(&settings->tpdo[i].cob_id, from, to);
    }
}

/* Takes a node without a Node-ID off the list of its bus. */
static void cia402_lss_leave_bus(struct cia402_node *node)
{
    struct board **place = &node->board.bus->by_address[node->board.address];

    if (*place == &node->board) {
        *place = NULL;
    }
    if (!node->nameless) {
        board_event(&node->board, BOARD_EVENT_ADDRESS, 0, node->board.address, CIA402_NO_NODE_ID);
    }
    node->nameless = true;
}

void cia402_lss_take_id(struct cia402_node *node)
{
    /* The configuration ends */
    unsigned from = node->board.address, to = node->lss.next;

    node->lss.configuring = false;
    node->lss.selected = node->lss.scanned = 0;
    /* Without a free Node-ID the node does nothing but LSS */
    if (to == CIA402_NO_NODE_ID || !cia402_lss_id_is_free(node, to)) {
        cia402_lss_leave_bus(node);
        return;
    }
    if (to == from && !node->nameless) {
        return;
    }
    /* Moves the node on the bus, and its COB-IDs with it */
    board_event(&node->board, BOARD_EVENT_ADDRESS, 0, node->nameless ? CIA402_NO_NODE_ID : from,
                to);
    if (node->board.bus->by_address[from] == &node->board) {
        node->board.bus->by_address[from] = NULL;
    }
    node->board.bus->by_address[to] = &node->board;
    node->board.address = (uint8_t)to;
    node->nameless = false;
    cia402_lss_move_settings(&node->settings, from, to);
    cia402_lss_move_settings(&node->saved, from, to);
    cia402_lss_move_cob(&node->sdo_request, from, to);
    cia402_lss_move_cob(&node->sdo_reply, from, to);
}

void cia402_lss_power_up(struct cia402_node *node, bool first)
{
    if (first) {
        node->lss.stored = node->board.address;
    }
    node->lss.next = node->lss.stored;
}

/* Sets the next Node-ID. Returns the error, 0 for none. */
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

/* Switches the state of all nodes; a new Node-ID takes effect where there was none. */
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

/* Returns a part of the address of a node. */
static uint32_t cia402_lss_part(const struct cia402_node *node, unsigned part)
{
    return (uint32_t)node->identity[part];
}

/* Compares a part of the address; the four parts come one after the other. */
static void cia402_lss_select(struct cia402_node *node, const uint8_t *data)
{
    unsigned part = data[0] - CIA402_LSS_SELECT_VENDOR;
    bool fits = (part == 0 || part == node->lss.selected) &&
                get_u32_le(data + 1) == cia402_lss_part(node, part);

    node->lss.selected = (uint8_t)(fits ? part + 1 : 0);
    if (node->lss.selected == ADDRESS_PARTS) {
        node->lss.selected = 0;
        node->lss.configuring = true;
        cia402_lss_answer(node, CIA402_LSS_SELECTED, 0);
    }
}

/* Compares bits of a part of the address: the master finds it bit by bit, from the highest, by
 * the answers. */
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
               get_u32_le(data + 1) >> bit != cia402_lss_part(node, part) >> bit) {
        return;
    } else {
        lss->scanned = (uint8_t)next;
        lss->configuring = bit == 0 && next < part; /* the last bit of the last part */
    }
    cia402_lss_answer(node, CIA402_LSS_IDENTIFIED, 0);
}

/* ---- requests ---- */

/* Obeys requests that only a node in state LSS configuration obeys; false: no such request. */
static bool cia402_lss_configure(struct cia402_node *node, const uint8_t *data)
{
    bool acts = node->lss.configuring;
    unsigned command = data[0], error = 0;

    switch (command) {
    case CIA402_LSS_SET_NODE_ID:
        error = acts ? cia402_lss_set_id(node, data[1]) : 0;
        break;
    case CIA402_LSS_SET_BIT_TIMING:
        error = ERROR_NOT_SUPPORTED;
        break;
    case CIA402_LSS_STORE:
        node->lss.stored = acts ? node->lss.next : node->lss.stored;
        break;
    case CIA402_LSS_ACTIVATE_BIT_TIMING:
        return true; /* has no answer, and there is none to activate */
    default:
        return false;
    }
    if (acts) {
        cia402_lss_answer(node, command, error);
    }
    return true;
}

/* Answers an inquiry: a part of the address, or the Node-ID. */
static void cia402_lss_tell(struct cia402_node *node, unsigned command)
{
    uint32_t value = command == CIA402_LSS_INQUIRE_NODE_ID
                         ? (node->nameless ? CIA402_NO_NODE_ID : node->board.address)
                         : cia402_lss_part(node, command - CIA402_LSS_INQUIRE_VENDOR);

    cia402_lss_answer(node, command, value);
}

bool cia402_lss_receive(struct cia402_node *node, const uint8_t *data)
{
    /* Requests to all nodes: switching, selection and fastscan */
    bool configuring = node->lss.configuring;

    if (data[0] == CIA402_LSS_SWITCH_GLOBAL) {
        cia402_lss_switch(node, data);
        return true;
    }
    if (data[0] >= CIA402_LSS_SELECT_VENDOR && data[0] <= CIA402_LSS_SELECT_SERIAL) {
        if (!configuring) {
            cia402_lss_select(node, data);
        }
        return true;
    }
    if (data[0] == CIA402_LSS_FASTSCAN) {
        if (!configuring) {
            cia402_lss_scan(node, data);
        }
        return true;
    }
    /* Requests to the selected node */
    if (data[0] >= CIA402_LSS_INQUIRE_VENDOR && data[0] <= CIA402_LSS_INQUIRE_NODE_ID) {
        if (configuring) {
            cia402_lss_tell(node, data[0]);
        }
        return true;
    }
    return cia402_lss_configure(node, data);
}
