/* SPDX-License-Identifier: Apache-2.0 */
/* A force-torque board of the compact protocol: six channels, each cut at its full scale. */
#include "boards/compact/private.h"
#include "boards/axis.h"

#include <math.h>
#include <string.h>

enum { HALF = BOARD_CHANNELS / 2, ALL_CHANNELS = 255 };

struct compact_ft {
    struct compact_node node;
    int64_t full_scale[BOARD_CHANNELS], saved_scale[BOARD_CHANNELS]; /* mN, mN m */
    int64_t tare[BOARD_CHANNELS], saved_tare[BOARD_CHANNELS];
    int64_t counts[BOARD_CHANNELS]; /* without the tare */
    uint8_t saturated;              /* bit = channel */
    uint16_t frames, faults, reported_faults;
    bool sensors_bad;
    double supply_v;
};

static struct compact_ft *compact_ft_of(const struct board *board)
{
    return container_of(board, struct compact_ft, node.board);
}

/* Returns the worth of a count of a channel, N or N m. */
static double compact_ft_resolution(int channel)
{
    return channel < HALF ? COMPACT_FORCE_N : COMPACT_MOMENT_NM;
}

/* Restores the saved settings, those of the rig at first (struct board_ops). */
static void compact_ft_power_up(struct board *board)
{
    struct compact_ft *ft = compact_ft_of(board);

    if (compact_node_power_up(&ft->node)) {
        for (int i = 0; i < BOARD_CHANNELS; i++) {
            ft->saved_scale[i] = llround(board->config.full_scale[i] * 1e3);
        }
    } else {
        compact_node_identify(&ft->node);
    }
    memcpy(ft->full_scale, ft->saved_scale, sizeof ft->full_scale);
    memcpy(ft->tare, ft->saved_tare, sizeof ft->tare);
    ft->frames = 0;
    ft->faults = ft->reported_faults = 0;
}

/* Converts a channel to counts, cut at its full scale. It is saturated too when its peak within the
 * tick is beyond. */
static void compact_ft_convert(struct compact_ft *ft, int channel, double value, double peak)
{
    double limit = (double)ft->full_scale[channel] * 1e-3;
    int32_t counts;

    if (fabs(value) > limit || fabs(peak) > limit) {
        ft->saturated |= (uint8_t)(1u << channel);
    }
    if (fabs(value) > limit) {
        value = value > 0.0 ? limit : -limit;
    }
    if (control_quantize(value / compact_ft_resolution(channel), &counts)) {
        ft->counts[channel] = control_clamp(counts, INT16_MIN, INT16_MAX);
    } else {
        ft->sensors_bad = true; /* the value before is repeated */
    }
}

/* Converts all channels and updates the faults (struct board_ops). */
static void compact_ft_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct compact_ft *ft = compact_ft_of(board);
    const struct ft_sense *sense = &sensors->ft[board->config.ft];

    ft->supply_v = board_supply_v(sensors);
    ft->saturated = 0;
    ft->sensors_bad = false;
    for (int i = 0; i < HALF; i++) {
        compact_ft_convert(ft, i, sense->force_n[i], sense->peak_n[i]);
        compact_ft_convert(ft, HALF + i, sense->torque_nm[i], sense->peak_nm[i]);
    }
    ft->faults = (uint16_t)((ft->saturated ? COMPACT_FAULT_SATURATED : 0) |
                            (ft->sensors_bad ? COMPACT_FAULT_TORQUE_SENSOR : 0) |
                            (board->lost_in_status ? COMPACT_FAULT_OVERFLOW : 0));
}

/* Reads or writes the tare of a channel, or of all of them. */
static enum compact_result compact_ft_access_tare(struct compact_ft *ft, unsigned channel,
                                                  bool write, int64_t *value)
{
    if (!write) {
        *value = channel < BOARD_CHANNELS ? ft->tare[channel] : 0;
        return channel < BOARD_CHANNELS ? COMPACT_OK : COMPACT_NO_SUCH_AXIS;
    }
    /* One channel to a value, or all to 0 or so that they read 0 now */
    if (channel < BOARD_CHANNELS) {
        if (*value < INT16_MIN || *value > INT16_MAX) {
            *value = ft->tare[channel];
            return COMPACT_OUT_OF_RANGE;
        }
        ft->tare[channel] = *value;
    } else if (channel == ALL_CHANNELS && (*value == 0 || *value == 1)) {
        for (int i = 0; i < BOARD_CHANNELS; i++) {
            ft->tare[i] = *value ? -ft->counts[i] : 0;
        }
    } else {
        return channel == ALL_CHANNELS ? COMPACT_OUT_OF_RANGE : COMPACT_NO_SUCH_AXIS;
    }
    ft->node.is_saved = false;
    return COMPACT_OK;
}

/* Reads or writes the full scale of a channel, up to the rig's. */
static enum compact_result compact_ft_access_full_scale(const struct board *board, unsigned channel,
                                                        bool write, int64_t *value)
{
    struct compact_ft *ft = compact_ft_of(board);
    enum compact_result result = COMPACT_OK;

    if (channel >= BOARD_CHANNELS) {
        return COMPACT_NO_SUCH_AXIS;
    }
    if (write && (*value < 1 || *value > llround(board->config.full_scale[channel] * 1e3))) {
        result = COMPACT_OUT_OF_RANGE;
    } else if (write) {
        ft->full_scale[channel] = *value;
        ft->node.is_saved = false;
    }
    *value = ft->full_scale[channel];
    return result;
}

/* Reads or writes a parameter (struct compact_node_ops). */
static enum compact_result compact_ft_access_parameter(struct compact_node *node,
                                                       unsigned parameter, unsigned axis,
                                                       bool write, int64_t *value)
{
    struct board *board = &node->board;
    struct compact_ft *ft = compact_ft_of(board);
    enum compact_result result;

    switch (parameter) {
    case COMPACT_P_FULL_SCALE:
        return compact_ft_access_full_scale(board, axis, write, value);
    case COMPACT_P_TARE:
        return compact_ft_access_tare(ft, axis, write, value);
    case COMPACT_P_FAULTS:
        *value = ft->faults;
        return write ? COMPACT_READ_ONLY : COMPACT_OK;
    default:
        result = compact_node_access_parameter(node, parameter, write, value);
        if (result == COMPACT_OK && write && parameter == COMPACT_P_SAVE) {
            memcpy(ft->saved_scale, ft->full_scale, sizeof ft->saved_scale);
            memcpy(ft->saved_tare, ft->tare, sizeof ft->saved_tare);
        }
        return result;
    }
}

/* Sends forces and moments: one FD frame, or two classic ones. */
static void compact_ft_send_wrench(struct board *board, struct frame_sink *sink)
{
    struct compact_ft *ft = compact_ft_of(board);
    int64_t values[BOARD_CHANNELS];
    uint8_t data[COMPACT_WRENCH_FD_LENGTH];

    for (int i = 0; i < BOARD_CHANNELS; i++) {
        values[i] = ft->counts[i] + ft->tare[i];
    }
    ft->frames++;
    if (board->bus->config.fd) {
        fields_encode(compact_message(COMPACT_WRENCH_FD)->fields, values, data);
        board_send(board, sink, compact_id(COMPACT_WRENCH_FD, board->address), sizeof data, data);
    } else {
        compact_node_send(&ft->node, sink, COMPACT_FORCE, board->address, values);
        compact_node_send(&ft->node, sink, COMPACT_MOMENT, board->address, values + HALF);
    }
}

/* Sends the wrench when it is due, and FT_STATE periodically and when faults change. */
static void compact_ft_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct compact_ft *ft = compact_ft_of(board);
    int32_t supply = 0;

    if (compact_node_due(&ft->node)) {
        compact_ft_send_wrench(board, sink);
    }
    if (!compact_state_due(span, board->address) && ft->faults == ft->reported_faults) {
        return;
    }
    ft->reported_faults = ft->faults;
    control_quantize(ft->supply_v / COMPACT_SUPPLY_V, &supply);
    board->lost_in_status = board->lost_in_overflow = false;
    compact_node_send(&ft->node, sink, COMPACT_FT_STATE, board->address,
                      (const int64_t[]){ft->saturated, ft->faults, supply, 0, ft->frames});
}

static const struct board_ops compact_ft_ops = {
    .identity = {.type = COMPACT_KIND_FT, .major = 1, .minor = 0, .build = 4},
    .periodic_max = 3,
    .power_up = compact_ft_power_up,
    .sample = compact_ft_sample,
    .transmit = compact_ft_transmit,
};

static const struct compact_node_ops compact_ft_node_ops = {
    .parameter = compact_ft_access_parameter,
};

struct board *compact_ft_create(struct arena *arena)
{
    struct compact_ft *ft = arena_alloc(arena, 1, sizeof *ft);

    if (!ft) {
        return NULL;
    }
    ft->node.board.ops = &compact_ft_ops;
    ft->node.ops = &compact_ft_node_ops;
    return &ft->node.board;
}
