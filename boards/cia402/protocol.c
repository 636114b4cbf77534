/* SPDX-License-Identifier: Apache-2.0 */
/* The CANopen drives, cia402, as a module. */
#include "boards/cia402/protocol.h"

#include "boards/cia402/board.h"
#include "boards/cia402/eds.h"
#include "boards/cia402/frames.h"
#include "boards/cia402/object_list.h"
#include "boards/protocol_list.h"
#include "manual/protocol_cia402.h"

/* Creates a board by its kind (struct protocol). */
static struct board *cia402_make_board(const struct board_config *config, struct arena *arena)
{
    return config->kind == BOARD_MOTOR      ? cia402_motor_create(arena)
           : config->kind == BOARD_INERTIAL ? cia402_inertial_create(arena)
                                            : cia402_ft_create(arena);
}

/* Returns whether nodes use an identifier that other boards do not: the last TPDO and RPDO, and
 * SDO. */
static bool cia402_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text,
                             size_t size)
{
    snprintf(text, size,
             "cia402 boards, expected one from 0x5a0 to 0x5ff, 0x620 to 0x67f or 0x6c0 to 0x6ff");
    return bus && (id <= CIA402_SDO_REPLY + CIA402_NODE_MAX ||
                   (id >= CIA402_SDO_REQUEST && id <= CIA402_SDO_REQUEST + CIA402_NODE_MAX));
}

/* Visits the periodic frames of a board: TPDOs with every so many SYNCs; those that tell a
 * change at their event timer, as if nothing changed; the heartbeat. */
static void cia402_visit_board_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, board->period_ns);
    struct cia402_plan plan;

    load_visit(walk, 1, CIA402_HEARTBEAT_MS * 1e-3);
    for (unsigned i = 0; cia402_plan_row(cia402_kind_of(board), load_axes(board), i, &plan); i++) {
        if (!plan.receive) {
            load_visit(walk, plan.length,
                       plan.event_ms ? plan.event_ms * 1e-3 : plan.type * period_s);
        }
    }
}

/* Visits the periodic frames of the host: SYNC, and the voltages of all axes of each node. */
static void cia402_visit_command_load(struct load_walk *walk)
{
    load_visit(walk, 0, load_period_s(walk, 0));
    for (size_t i = 0; i < walk->config->nboard; i++) {
        const struct board_config *board = &walk->config->board[i];

        if (board->bus == walk->index && load_axes(board) > 0) {
            load_visit(walk, 2 * load_axes(board), load_period_s(walk, 0));
        }
    }
}

/* Returns the name of a state of CiA 402, which takes the place of a mode. */
static const char *cia402_state_name(uint32_t state)
{
    static const char *const names[CIA402_STATES] = {
        [CIA402_NOT_READY] = "not ready to switch on",
        [CIA402_SWITCH_ON_DISABLED] = "switch on disabled",
        [CIA402_READY_TO_SWITCH_ON] = "ready to switch on",
        [CIA402_SWITCHED_ON] = "switched on",
        [CIA402_OPERATION_ENABLED] = "operation enabled",
        [CIA402_QUICK_STOP_ACTIVE] = "quick stop active",
        [CIA402_FAULT_REACTION_ACTIVE] = "fault reaction active",
        [CIA402_FAULT] = "fault",
    };

    return state < CIA402_STATES ? names[state] : "unknown";
}

static const char *const cia402_fault_names[] = {
    "under-voltage", "over-voltage",   "over-current",  "motor encoder",
    "link encoder",  "torque sensor",  "temperature",   "following error",
    "connection",    "stale command",  "limit",         "saturated",
    "no reading",    "under-pressure", "over-pressure", NULL};

const struct protocol protocol_cia402 = {
    .name = "cia402",
    .summary = "CANopen drives (CiA 301, CiA 402), one to four axes a node, and sensors",
    .motor_address_max = CIA402_NODE_MAX,
    .address_max = CIA402_NODE_MAX,
    .axes_max = CIA402_BOARD_AXES,
    .switches = true,
    .make_bus = cia402_bus_create,
    .make_board = cia402_make_board,
    .visit_broadcasts = cia402_visit_broadcasts,
    .visit_board = cia402_visit_board,
    .claims_id = cia402_claims_id,
    .visit_board_load = cia402_visit_board_load,
    .visit_command_load = cia402_visit_command_load,
    .mode_name = cia402_state_name,
    .fault_names = cia402_fault_names,
    .modes_are_states = true,
    .timeout_text = "reference set to 0",
    .limit_text = "x 1e-5 rad, only commands that lead back are obeyed",
    .help = MANUAL_PROTOCOL_CIA402,
    .print_appendix = cia402_print_objects,
    .write_eds = cia402_eds_write,
};
