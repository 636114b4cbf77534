/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sensor nodes in the style of CiA 404. Their process values are six force and torque channels, or
 * acceleration, rate, orientation and magnetic field of an inertial sensor.
 */
#include "boards/cia402/private.h"

#include "boards/sensing/inertial.h"

enum { FRAMES_MAX = 2 + CIA402_EMERGENCIES + CIA402_AXIS_PDOS, HALF = BOARD_CHANNELS / 2 };

/* First channel of each quantity of the inertial sensor. */
enum { ACCELERATION = 0, RATE = 3, ORIENTATION = 6, MAGNETIC = 10 };

/* Returns the struct cia402_sensor_board that contains a board. */
static struct cia402_sensor_board *cia402_sensor_of(const struct board *board)
{
    return container_of(board, struct cia402_sensor_board, node.board);
}

/* Powers up a sensor node (struct board_ops). */
static void cia402_sensor_power_up(struct board *board)
{
    struct cia402_sensor_board *own = cia402_sensor_of(board);

    cia402_node_power_up(&own->node);
    own->sensor.faults = own->sensor.saturated = 0;
}

/* Computes the process values: measured counts plus tare, clamped to 16 bits. */
static void cia402_sensor_add_tare(struct cia402_sensor *sensor)
{
    for (int i = 0; i < sensor->channels; i++) {
        sensor->value[i] = control_clamp(sensor->counts[i] + sensor->tare[i], INT16_MIN, INT16_MAX);
    }
}

/* Writes the tare of a channel. It takes effect at once. */
enum cia402_abort cia402_sensor_write_tare(struct cia402_node *node,
                                           const struct cia402_entry *entry, int64_t value)
{
    *cia402_field(node, entry) = value;
    cia402_sensor_add_tare(node->sensor);
    return CIA402_DONE;
}

/* ---- force and torque ---- */

/* Converts a force or a moment to counts, clamped to full scale. Sets *bad when there is no
 * reading. */
static void cia402_ft_convert(struct cia402_sensor *sensor, int channel, double value, double limit,
                              bool *bad)
{
    double worth = channel < HALF ? CIA402_FORCE_N : CIA402_MOMENT_NM;
    int32_t counts;

    if (fabs(value) > limit) {
        sensor->saturated |= INT64_C(1) << channel;
        value = copysign(limit, value);
    }
    if (control_quantize(value / worth, &counts)) {
        sensor->counts[channel] = control_clamp(counts, INT16_MIN, INT16_MAX);
    } else {
        *bad = true; /* the channel keeps its last value */
    }
}

/* Marks a channel as saturated if its peak within the tick exceeds full scale. */
static void cia402_ft_note_peak(struct cia402_sensor *sensor, int channel, double peak,
                                double limit)
{
    if (fabs(peak) > limit) {
        sensor->saturated |= INT64_C(1) << channel;
    }
}

/* Reads a force-torque sensor (struct board_ops). */
static void cia402_ft_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct cia402_sensor *sensor = &cia402_sensor_of(board)->sensor;
    const struct ft_sense *sense = &sensors->ft[board->config.ft];
    const double *limit = board->config.full_scale;
    bool bad = false;

    sensor->saturated = 0;
    for (int i = 0; i < HALF; i++) {
        cia402_ft_convert(sensor, i, sense->force_n[i], limit[i], &bad);
        cia402_ft_convert(sensor, HALF + i, sense->torque_nm[i], limit[HALF + i], &bad);
        cia402_ft_note_peak(sensor, i, sense->peak_n[i], limit[i]);
        cia402_ft_note_peak(sensor, HALF + i, sense->peak_nm[i], limit[HALF + i]);
    }
    sensor->faults =
        (sensor->saturated ? CIA402_FAULT_SATURATED : 0) | (bad ? CIA402_FAULT_SENSOR : 0);
    cia402_sensor_add_tare(sensor);
}

/* ---- the inertial sensor ---- */

/* Converts `count` values to counts of `worth`, into the channels from `first` on. Sets *bad when a
 * value has no reading. */
static void cia402_inertial_convert(struct cia402_sensor *sensor, int first, int count,
                                    const double *value, double worth, bool *bad)
{
    for (int i = 0; i < count; i++) {
        if (!inertial_quantize(value[i], worth, &sensor->counts[first + i], bad)) {
            sensor->saturated |= INT64_C(1) << (first + i);
        }
    }
}

/* Reads the inertial sensor (struct board_ops). */
static void cia402_inertial_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct cia402_sensor *sensor = &cia402_sensor_of(board)->sensor;
    struct inertial_values v;
    bool bad;

    inertial_derive(&sensors->imu, true, &v);
    bad = !v.oriented;
    sensor->saturated = 0;
    cia402_inertial_convert(sensor, ACCELERATION, 3, v.acceleration_m_s2, CIA402_ACCELERATION_M_S2,
                            &bad);
    cia402_inertial_convert(sensor, RATE, 3, v.rate_rad_s, CIA402_RATE_RAD_S, &bad);
    cia402_inertial_convert(sensor, ORIENTATION, 4, v.quaternion, CIA402_QUATERNION, &bad);
    cia402_inertial_convert(sensor, MAGNETIC, 3, v.magnetic_t, CIA402_MAGNETIC_UT * 1e-6, &bad);
    sensor->faults =
        (sensor->saturated ? CIA402_FAULT_SATURATED : 0) | (bad ? CIA402_FAULT_SENSOR : 0);
    cia402_sensor_add_tare(sensor);
}

/* ---- both ---- */

/* Runs one tick of a sensor node's services (struct board_ops). */
static void cia402_sensor_control(struct board *board, struct ms_span span)
{
    cia402_node_step(cia402_node_of(board), span);
}

/* Functions common to both kinds of sensor node */
#define SENSOR_BOARD(kind, function)                                                               \
    {                                                                                              \
        .size = sizeof(struct cia402_sensor_board),                                                \
        .identity = {.type = kind, .major = 1, .minor = 0, .build = 1},                            \
        .periodic_max = FRAMES_MAX, .power_up = cia402_sensor_power_up, .sample = function,        \
        .control = cia402_sensor_control, .transmit = cia402_node_transmit                         \
    }

const struct board_ops cia402_ft_ops = SENSOR_BOARD(CIA402_KIND_FT, cia402_ft_sample);
const struct board_ops cia402_inertial_ops =
    SENSOR_BOARD(CIA402_KIND_INERTIAL, cia402_inertial_sample);
