/* SPDX-License-Identifier: Apache-2.0 */
/* The inertial board of the compact protocol: acceleration, rate, orientation and field. */
#include "boards/compact/private.h"
#include "boards/sensing/inertial.h"
#include "boards/axis.h"

#include <math.h>

/* Values in the order of INERTIAL_FD */
enum { ACCELERATION = 0, RATE = 3, ORIENTATION = 6, MAGNETIC = 10, EULER = 13, VALUES = 16 };
enum { STATE_CHANNELS = ORIENTATION }; /* those that INERTIAL_STATE tells of */

struct compact_inertial {
    struct compact_node node;
    int64_t counts[VALUES];
    uint8_t saturated; /* bit = channel */
    uint16_t frames, faults, reported_faults;
    double supply_v;
};

static struct compact_inertial *compact_inertial_of(const struct board *board)
{
    return container_of(board, struct compact_inertial, node.board);
}

/* Resets the counters; after a restart sends the identity (struct board_ops). */
static void compact_inertial_power_up(struct board *board)
{
    struct compact_inertial *inertial = compact_inertial_of(board);

    if (!compact_node_power_up(&inertial->node)) {
        compact_node_identify(&inertial->node);
    }
    inertial->frames = 0;
    inertial->faults = inertial->reported_faults = 0;
}

/* Converts values to counts; notes channels that were cut and values without a number. */
static void compact_inertial_convert(struct compact_inertial *inertial, int first, int count,
                                     const double *value, double worth, bool *bad)
{
    for (int i = 0; i < count; i++) {
        bool whole = inertial_quantize(value[i], worth, &inertial->counts[first + i], bad);

        if (!whole && first + i < STATE_CHANNELS) {
            inertial->saturated = (uint8_t)(inertial->saturated | 1u << (first + i));
        }
    }
}

/* Converts all values and updates the faults (struct board_ops). */
static void compact_inertial_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct compact_inertial *inertial = compact_inertial_of(board);
    struct inertial_values v;
    bool bad;

    inertial_derive(&sensors->imu, true, &v);
    bad = !v.oriented;
    inertial->supply_v = board_supply_v(sensors);
    inertial->saturated = 0;
    compact_inertial_convert(inertial, ACCELERATION, 3, v.acceleration_m_s2,
                             COMPACT_ACCELERATION_M_S2, &bad);
    compact_inertial_convert(inertial, RATE, 3, v.rate_rad_s, COMPACT_RATE_RAD_S, &bad);
    compact_inertial_convert(inertial, ORIENTATION, 4, v.quaternion, COMPACT_QUATERNION, &bad);
    compact_inertial_convert(inertial, MAGNETIC, 3, v.magnetic_t, COMPACT_MAGNETIC_UT * 1e-6, &bad);
    compact_inertial_convert(inertial, EULER, 3, v.euler_rad, COMPACT_EULER_RAD, &bad);
    inertial->faults = (uint16_t)((inertial->saturated ? COMPACT_FAULT_SATURATED : 0) |
                                  (bad ? COMPACT_FAULT_INERTIAL : 0) |
                                  (board->lost_in_status ? COMPACT_FAULT_OVERFLOW : 0));
}

/* Reads or writes a parameter (struct compact_node_ops). */
static enum compact_result compact_inertial_access_parameter(struct compact_node *node,
                                                             unsigned parameter, unsigned axis,
                                                             bool write, int64_t *value)
{
    (void)axis;
    if (parameter == COMPACT_P_FAULTS) {
        *value = compact_inertial_of(&node->board)->faults;
        return write ? COMPACT_READ_ONLY : COMPACT_OK;
    }
    return compact_node_access_parameter(node, parameter, write, value);
}

/* Sends acceleration, rate and orientation: one FD frame, or three classic ones. */
static void compact_inertial_send_motion(struct board *board, struct frame_sink *sink)
{
    struct compact_inertial *inertial = compact_inertial_of(board);
    struct compact_node *node = &inertial->node;
    uint8_t data[COMPACT_INERTIAL_FD_LENGTH];

    inertial->frames++;
    if (board->bus->config.fd) {
        fields_encode(compact_message(COMPACT_INERTIAL_FD)->fields, inertial->counts, data);
        board_send(board, sink, compact_id(COMPACT_INERTIAL_FD, board->address), sizeof data, data);
        return;
    }
    compact_node_send(node, sink, COMPACT_ACCELERATION, board->address,
                      inertial->counts + ACCELERATION);
    compact_node_send(node, sink, COMPACT_RATE, board->address, inertial->counts + RATE);
    compact_node_send(node, sink, COMPACT_ORIENTATION, board->address,
                      inertial->counts + ORIENTATION);
}

/* Sends the motion when it is due, and INERTIAL_STATE periodically and when faults change. */
static void compact_inertial_transmit(struct board *board, struct ms_span span,
                                      struct frame_sink *sink)
{
    struct compact_inertial *inertial = compact_inertial_of(board);
    int32_t supply = 0;

    if (compact_node_due(&inertial->node)) {
        compact_inertial_send_motion(board, sink);
    }
    if (!compact_state_due(span, board->address) && inertial->faults == inertial->reported_faults) {
        return;
    }
    /* The field is slow: on classic buses it comes with the state */
    if (!board->bus->config.fd && inertial->node.settings.telemetry_ms > 0) {
        compact_node_send(&inertial->node, sink, COMPACT_MAGNETIC, board->address,
                          inertial->counts + MAGNETIC);
    }
    inertial->reported_faults = inertial->faults;
    control_quantize(inertial->supply_v / COMPACT_SUPPLY_V, &supply);
    board->lost_in_status = board->lost_in_overflow = false;
    compact_node_send(
        &inertial->node, sink, COMPACT_INERTIAL_STATE, board->address,
        (const int64_t[]){inertial->saturated, inertial->faults, supply, 0, inertial->frames});
}

static const struct board_ops compact_inertial_ops = {
    .identity = {.type = COMPACT_KIND_INERTIAL, .major = 1, .minor = 0, .build = 1},
    .periodic_max = 5,
    .power_up = compact_inertial_power_up,
    .sample = compact_inertial_sample,
    .transmit = compact_inertial_transmit,
};

static const struct compact_node_ops compact_inertial_node_ops = {
    .parameter = compact_inertial_access_parameter,
};

struct board *compact_inertial_create(struct arena *arena)
{
    struct compact_inertial *inertial = arena_alloc(arena, 1, sizeof *inertial);

    if (!inertial) {
        return NULL;
    }
    inertial->node.board.ops = &compact_inertial_ops;
    inertial->node.ops = &compact_inertial_node_ops;
    return &inertial->node.board;
}
