/* SPDX-License-Identifier: Apache-2.0 */
/* The compact protocol as a module. */
#include "boards/compact/board.h"
#include "boards/compact/messages.h"
#include "boards/compact/table.h"
#include "boards/protocol_list.h"
#include "manual/protocol_compact.h"

/* Creates a board of the configured kind (struct protocol). */
static struct board *compact_make_board(const struct board_config *config, struct arena *arena)
{
    return config->kind == BOARD_MOTOR      ? compact_motor_create(arena)
           : config->kind == BOARD_INERTIAL ? compact_inertial_create(arena)
                                            : compact_ft_create(arena);
}

/* Returns whether an identifier belongs to the protocol. The other functions lie where the iCub
 * boards have theirs. */
static bool compact_claims_id(const struct boards_bus_config *bus, uint32_t id, char *text,
                              size_t size)
{
    unsigned function = id >> 5;

    (void)bus;
    snprintf(text, size, "compact boards, expected one from 0x400 to 0x67f or from 0x6c0 to 0x6ff");
    return function == COMPACT_REQUEST || function == COMPACT_REPLY;
}

/* ---- load ---- */

/* Visits the frames that an inertial board sends again and again. */
static void visit_inertial_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, board->period_ns);

    load_visit(walk, COMPACT_STATE_LENGTH, COMPACT_STATE_PERIOD_MS * 1e-3);
    if (walk->bus->fd) {
        load_visit(walk, COMPACT_INERTIAL_FD_LENGTH, period_s);
        return;
    }
    load_visit(walk, COMPACT_ACCELERATION_LENGTH, COMPACT_STATE_PERIOD_MS * 1e-3); /* MAGNETIC */
    load_visit(walk, COMPACT_ACCELERATION_LENGTH, period_s);
    load_visit(walk, COMPACT_ACCELERATION_LENGTH, period_s); /* RATE */
    load_visit(walk, COMPACT_ORIENTATION_LENGTH, period_s);
}

/* Visits the frames that a force-torque board sends again and again. */
static void visit_ft_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, board->period_ns);

    load_visit(walk, COMPACT_STATE_LENGTH, COMPACT_STATE_PERIOD_MS * 1e-3);
    if (walk->bus->fd) {
        load_visit(walk, COMPACT_WRENCH_FD_LENGTH, period_s);
        return;
    }
    load_visit(walk, COMPACT_FORCE_LENGTH, period_s);
    load_visit(walk, COMPACT_FORCE_LENGTH, period_s); /* MOMENT */
}

/* Visits the frames that a board sends again and again (struct protocol). */
static void compact_visit_board_load(struct load_walk *walk, const struct board_config *board)
{
    double period_s = load_period_s(walk, board->period_ns);
    unsigned axes = load_axes(board);

    if (board->kind == BOARD_INERTIAL) {
        visit_inertial_load(walk, board);
        return;
    }
    if (board->kind == BOARD_FT) {
        visit_ft_load(walk, board);
        return;
    }
    for (unsigned k = 0; k < axes; k++) {
        load_visit(walk, COMPACT_STATE_LENGTH, COMPACT_STATE_PERIOD_MS * 1e-3);
        if (!walk->bus->fd) {
            load_visit(walk, COMPACT_TELEMETRY_LENGTH, period_s);
        }
    }
    if (walk->bus->fd) {
        load_visit(walk, axes * COMPACT_TELEMETRY_FD_LENGTH, period_s);
    }
}

/* Visits the set-points of all slots, once a tick. */
static void compact_visit_command_load(struct load_walk *walk)
{
    unsigned most = walk->bus->fd ? COMPACT_SLOTS : COMPACT_GROUP;

    for (unsigned left = load_bus_axes(walk); left > 0; left -= left < most ? left : most) {
        load_visit(walk, 2 * (left < most ? left : most), (double)walk->config->tick_ns * 1e-9);
    }
}

/* ---- words ---- */

/* Returns the name of a mode (struct protocol). */
static const char *compact_mode_name(uint32_t mode)
{
    return mode == COMPACT_OFF       ? "off"
           : mode == COMPACT_VOLTAGE ? "voltage"
           : mode == COMPACT_CURRENT ? "current"
           : mode == COMPACT_FAULT   ? "fault"
                                     : "unknown";
}

static const char *const compact_fault_names[] = {"under-voltage",
                                                  "over-voltage",
                                                  "over-current",
                                                  "motor encoder",
                                                  "link encoder",
                                                  "torque sensor",
                                                  "temperature",
                                                  "stale command",
                                                  "limit",
                                                  "overflow",
                                                  "saturated",
                                                  "inertial sensor",
                                                  NULL};

const struct protocol protocol_compact = {
    .name = "compact",
    .summary = "our own, classic CAN or CAN FD, one axis a slot, 1 kHz",
    .motor_address_max = COMPACT_NODE_MAX,
    .address_max = COMPACT_NODE_MAX,
    .axes_max = COMPACT_BOARD_AXES,
    .slots_max = COMPACT_SLOTS,
    .canfd = true,
    .external = true,
    .external_torque = true,
    .make_bus = compact_bus_create,
    .make_board = compact_make_board,
    .visit_broadcasts = compact_visit_broadcasts,
    .visit_board = compact_visit_board,
    .claims_id = compact_claims_id,
    .visit_board_load = compact_visit_board_load,
    .visit_command_load = compact_visit_command_load,
    .mode_name = compact_mode_name,
    .fault_names = compact_fault_names,
    .timeout_text = "reference set to 0",
    .limit_text = "x 1e-5 rad, only commands that lead back are obeyed",
    .help = MANUAL_PROTOCOL_COMPACT,
    .fd_text = "The frames above but telemetry and forces, which are these:",
    .bench = {.bus_axes = 3,
              .board_axes = 1,
              .ft_address = 30,
              .ft_period_s = "0.005",
              .command_period_s = "0.001"},
    .bench_fd = {.bus_axes = 12,
                 .board_axes = 4,
                 .ft_address = 30,
                 .ft_period_s = "0.001",
                 .command_period_s = "0.001"},
};
