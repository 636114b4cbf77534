/* SPDX-License-Identifier: Apache-2.0 */
/* Force-torque and inertial boards of a described protocol: channels, each in its unit. A
 * channel without a reading keeps its value, and a fault reports it. */
#include "boards/described/private.h"
#include "boards/sensing/inertial.h"

#include <math.h>
#include <string.h>

enum { HALF = BOARD_CHANNELS / 2, CHANNELS = DESCRIBED_MEANINGS - DESCRIBED_CHANNEL };

struct described_sensor {
    struct described_node node;
    double channel[CHANNELS]; /* by meaning from DESCRIBED_CHANNEL on */
    uint32_t saturated;       /* bit = channel of a force-torque sensor */
    uint32_t faults;
};

/* Returns the sensor board of a board. */
static struct described_sensor *described_sensor_of(const struct board *board)
{
    return container_of(board, struct described_sensor, node.board);
}

/* Powers up a sensor board (struct board_ops). */
static void described_sensor_power_up(struct board *board)
{
    struct described_sensor *sensor = described_sensor_of(board);

    if (!described_node_power_up(&sensor->node)) {
        described_node_announce(&sensor->node);
    }
    sensor->faults = 0;
}

/* Notes the faults of a sample: saturation, missing readings, lost frames. */
static void described_sensor_note(struct described_sensor *sensor, bool bad,
                                  enum described_fault fault)
{
    const struct board *board = &sensor->node.board;

    sensor->faults = (uint32_t)(sensor->saturated != 0) << DESCRIBED_CHANNEL_SATURATED |
                     (uint32_t)bad << fault | (uint32_t)board->lost_in_status << DESCRIBED_OVERFLOW;
}

/* Takes a force or a moment, within its full scale, and its peak within the tick, which saturates
 * the channel too; bad: no reading. */
static void described_ft_convert(struct described_sensor *sensor, int channel, double value,
                                 double peak, bool *bad)
{
    double limit = sensor->node.board.config.full_scale[channel];

    if (isnan(value)) {
        *bad = true;
        return;
    }
    if (fabs(value) > limit || fabs(peak) > limit) {
        sensor->saturated |= UINT32_C(1) << channel;
    }
    if (fabs(value) > limit) {
        value = value > 0.0 ? limit : -limit;
    }
    sensor->channel[channel] = value;
}

/* Reads a force-torque sensor (struct board_ops). */
static void described_ft_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_sensor *sensor = described_sensor_of(board);
    const struct ft_sense *sense = &sensors->ft[board->config.ft];
    bool bad = false;

    sensor->node.supply_v = board_supply_v(sensors);
    sensor->saturated = 0;
    for (int i = 0; i < HALF; i++) {
        described_ft_convert(sensor, i, sense->force_n[i], sense->peak_n[i], &bad);
        described_ft_convert(sensor, HALF + i, sense->torque_nm[i], sense->peak_nm[i], &bad);
    }
    described_sensor_note(sensor, bad, DESCRIBED_TORQUE_SENSOR);
}

/* Takes count values in channels from first on; bad: no reading. */
static void described_inertial_convert(struct described_sensor *sensor,
                                       enum described_meaning first, int count, const double *value,
                                       bool *bad)
{
    for (int i = 0; i < count; i++) {
        if (isfinite(value[i])) {
            sensor->channel[(int)first - DESCRIBED_CHANNEL + i] = value[i];
        } else {
            *bad = true;
        }
    }
}

/* Reads the inertial sensor (struct board_ops). */
static void described_inertial_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct described_sensor *sensor = described_sensor_of(board);
    struct inertial_values v;
    bool bad;

    inertial_derive(&sensors->imu, true, &v);
    bad = !v.oriented;
    sensor->node.supply_v = board_supply_v(sensors);
    described_inertial_convert(sensor, DESCRIBED_ACCELERATION, 3, v.acceleration_m_s2, &bad);
    described_inertial_convert(sensor, DESCRIBED_RATE, 3, v.rate_rad_s, &bad);
    described_inertial_convert(sensor, DESCRIBED_QUATERNION, 4, v.quaternion, &bad);
    described_inertial_convert(sensor, DESCRIBED_MAGNETIC, 3, v.magnetic_t, &bad);
    described_inertial_convert(sensor, DESCRIBED_EULER, 3, v.euler_rad, &bad);
    described_sensor_note(sensor, bad, DESCRIBED_INERTIAL_SENSOR);
}

/* Computes what a field of a sensor carries (struct described_node_ops). */
static bool described_sensor_source(const struct described_node *node, unsigned axis,
                                    const struct described_field *field, double *value,
                                    int64_t *count)
{
    const struct described_sensor *sensor = described_sensor_of(&node->board);

    (void)axis;
    if (field->meaning >= DESCRIBED_CHANNEL) {
        *value = sensor->channel[field->meaning - DESCRIBED_CHANNEL];
        return false;
    }
    *count = field->meaning == DESCRIBED_SATURATED ? sensor->saturated : 0;
    return true;
}

/* Returns the faults of a sensor (struct described_node_ops). */
static uint32_t described_sensor_faults(const struct described_node *node, unsigned axis)
{
    (void)axis;
    return described_sensor_of(&node->board)->faults;
}

/* Returns the state of a sensor, which is off (struct described_node_ops). */
static int described_sensor_state(const struct described_node *node, unsigned axis)
{
    (void)axis;
    return node->protocol->off_state;
}

static const struct board_ops described_ft_ops = {
    .identity = {.type = 3, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX,
    .power_up = described_sensor_power_up,
    .sample = described_ft_sample,
    .transmit = described_node_transmit,
};

static const struct board_ops described_inertial_ops = {
    .identity = {.type = 4, .major = 1},
    .periodic_max = DESCRIBED_FRAMES_MAX,
    .power_up = described_sensor_power_up,
    .sample = described_inertial_sample,
    .transmit = described_node_transmit,
};

static const struct described_node_ops described_ft_node_ops = {
    .kind = DESCRIBED_FT,
    .source = described_sensor_source,
    .faults = described_sensor_faults,
    .state = described_sensor_state,
};

static const struct described_node_ops described_inertial_node_ops = {
    .kind = DESCRIBED_INERTIAL,
    .source = described_sensor_source,
    .faults = described_sensor_faults,
    .state = described_sensor_state,
};

/* Creates a sensor board of a kind. Returns NULL without memory. */
static struct board *described_sensor_create(struct arena *arena, const struct board_ops *ops,
                                             const struct described_node_ops *node_ops)
{
    struct described_sensor *sensor = arena_alloc(arena, 1, sizeof *sensor);

    if (!sensor) {
        return NULL;
    }
    sensor->node.board.ops = ops;
    sensor->node.ops = node_ops;
    return &sensor->node.board;
}

struct board *described_ft_create(struct arena *arena)
{
    return described_sensor_create(arena, &described_ft_ops, &described_ft_node_ops);
}

struct board *described_inertial_create(struct arena *arena)
{
    return described_sensor_create(arena, &described_inertial_ops, &described_inertial_node_ops);
}
