/* SPDX-License-Identifier: Apache-2.0 */
/* Emergency messages and the history of errors (CiA 301, 7.2.7 and 7.5.2.2 to 7.5.2.4). */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

#include <string.h>

#define INHIBIT_UNIT_NS INT64_C(100000)

/* Puts an error first in the history; a code of 0 tells that errors are gone and is not kept. */
static void cia402_emcy_remember(struct cia402_node *node, unsigned code, unsigned axis)
{
    memmove(node->history + 1, node->history, (CIA402_HISTORY - 1) * sizeof *node->history);
    node->history[0] = (int64_t)axis << 16 | code;
    node->history_count += node->history_count < CIA402_HISTORY;
}

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
    cia402_emcy_remember(node, code, axis);
    cia402_emcy_queue(node, code, axis, faults);
}

/* Returns whether a node that was heard is silent, or the last frame of some RPDO did not fit. */
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

void cia402_emcy_resolve_communication(struct cia402_node *node)
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

void cia402_emcy_transmit(struct cia402_node *node, struct frame_sink *sink)
{
    const struct cia402_communication *settings = &node->settings;
    int64_t now_ns = node->board.boards->now_ns;

    /* Emergencies are lost while nothing may be sent, except for the history */
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

/* Empties the history: only 0 may be written. */
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
