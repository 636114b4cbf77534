/* SPDX-License-Identifier: Apache-2.0 */
/* Force-torque and inertial boards of a described protocol. A channel is in the unit of its
 * meaning. A channel without a reading keeps its value and reports a fault. */
#include "boards/described/private.h"
#include "boards/sensing/inertial.h"

enum { HALF = BOARD_CHANNELS / 2 };

/* Powers up a sensor board (struct board_ops). */
static void described_sensor_power_up(struct board *board)
{
    struct described_node *node = described_node_of(board);

    if (!described_node_power_up(node)) {
        described_node_announce(node);
    }
}

/* Updates the faults after a sample: saturation, missing readings, lost frames. */
static void described_sensor_note(struct described_node *node, bool bad, enum described_fault fault)
{
    node->axis[0].faults = (uint32_t)(node->saturated != 0) << DESCRIBED_CHANNEL_SATURATED |
                           (uint32_t)bad << fault |
                           (uint32_t)node->board.lost_in_status << DESCRIBED_OVERFLOW;
}

/* Stores a force or a moment, clamped to its full scale. Marks the channel as saturated if the
 * value, or its peak within the tick, exceeds the full scale. Without a reading, sets *bad and
 * keeps the old value. */
static void described_ft_convert(struct described_node *node, int channel, double value,
                                 double peak, bool *bad)
{
    double limit = node->board.config.full_scale[channel];

    if (isnan(value)) {
        *bad = true;
        return;
    }
    if (fabs(value) > limit || fabs(peak) > limit) {
        node->saturated |= UINT32_C(1) << channel;
    }
    if (fabs(value) > limit) {
        value = value > 0.0 ? limit : -limit;
    }
    node->channel[channel] = value;
}

/* Reads a force-torque sensor (struct board_ops). */
static void described_ft_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_node *node = described_node_of(board);
    const struct ft_sense *sense = &sensors->ft[board->config.ft];
    bool bad = false;

    node->saturated = 0;
    for (int i = 0; i < HALF; i++) {
        described_ft_convert(node, i, sense->force_n[i], sense->peak_n[i], &bad);
        described_ft_convert(node, HALF + i, sense->torque_nm[i], sense->peak_nm[i], &bad);
    }
    described_sensor_note(node, bad, DESCRIBED_TORQUE_SENSOR);
}

/* Stores `count` values in the channels from `first` on. Sets *bad if there is no reading. */
static void described_inertial_convert(struct described_node *node, enum described_meaning first,
                                       int count, const double *value, bool *bad)
{
    for (int i = 0; i < count; i++) {
        if (isfinite(value[i])) {
            node->channel[(int)first - DESCRIBED_CHANNEL + i] = value[i];
        } else {
            *bad = true;
        }
    }
}

/* Reads the inertial sensor (struct board_ops). */
static void described_inertial_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_node *node = described_node_of(board);
    struct inertial_values v;
    bool bad;

    inertial_derive(&sensors->imu, true, &v);
    bad = !v.oriented;
    described_inertial_convert(node, DESCRIBED_ACCELERATION, 3, v.acceleration_m_s2, &bad);
    described_inertial_convert(node, DESCRIBED_RATE, 3, v.rate_rad_s, &bad);
    described_inertial_convert(node, DESCRIBED_QUATERNION, 4, v.quaternion, &bad);
    described_inertial_convert(node, DESCRIBED_MAGNETIC, 3, v.magnetic_t, &bad);
    described_inertial_convert(node, DESCRIBED_EULER, 3, v.euler_rad, &bad);
    described_sensor_note(node, bad, DESCRIBED_INERTIAL_SENSOR);
}

const struct board_ops described_ft_ops = {
    .size = sizeof(struct described_node),
    .identity = {.type = 3, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX,
    .power_up = described_sensor_power_up,
    .sample = described_ft_sample,
    .transmit = described_node_transmit,
};

const struct board_ops described_inertial_ops = {
    .size = sizeof(struct described_node),
    .identity = {.type = 4, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX,
    .power_up = described_sensor_power_up,
    .sample = described_inertial_sample,
    .transmit = described_node_transmit,
};
