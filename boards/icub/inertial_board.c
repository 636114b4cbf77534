/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Inertial boards: commands in class 2, telemetry in class 5. SET_CONFIG selects the sensors and
 * stops the telemetry; TRANSMIT starts it with a period. Each period the board sends one frame per
 * selected sensor, in the order of enum icub_inertial_sensor: type 4 for the quaternion, type 3 for
 * the others. All type 3 frames of a period have the same sequence number.
 *
 * Without fusion, the sensors that need it (Euler angles, quaternion, linear acceleration, gravity)
 * read 0, as from a sensor chip in that mode. Mask and period are reset by a restart.
 */
#include "boards/icub/board.h"
#include "boards/sensing/inertial.h"

enum {
    USUAL_MASK =
        1 << ICUB_SENSOR_ACCELERATION | 1 << ICUB_SENSOR_GYRO | 1 << ICUB_SENSOR_QUATERNION,
    FUSED_MASK = 1 << ICUB_SENSOR_EULER | 1 << ICUB_SENSOR_QUATERNION | 1 << ICUB_SENSOR_LINEAR |
                 1 << ICUB_SENSOR_GRAVITY,
    RAW_MASK = 1 << ICUB_SENSOR_ACCELERATION | 1 << ICUB_SENSOR_MAGNETIC | 1 << ICUB_SENSOR_GYRO,
};

struct inertial_board {
    struct icub_board icub;
    int64_t counts[ICUB_INERTIAL_SENSORS][4]; /* by sensor; element 3 only for the quaternion */
    /* bit masks of sensors: without a reading; beyond the range */
    uint16_t bad, cut;
    uint16_t mask;
    uint8_t fusion;  /* enum icub_fusion */
    uint32_t ranges; /* stored for the host, without effect */
    uint8_t sequence;
    int64_t period_ns, next_ns; /* period 0 = no telemetry */
};

static struct inertial_board *inertial_board_of(const struct board *board)
{
    return container_of(board, struct inertial_board, icub.board);
}

/* Sets the telemetry period, starting now; 0 stops the telemetry. */
static void inertial_board_set_period(struct inertial_board *inertial, int64_t period_ns)
{
    inertial->period_ns = period_ns;
    inertial->next_ns = inertial->icub.board.boards->now_ns + period_ns;
}

/* Resets the board (struct board_ops). */
static void inertial_board_power_up(struct board *board)
{
    struct inertial_board *inertial = inertial_board_of(board);
    int64_t period_ns = board->config.period_ns > 0 ? board->config.period_ns : MS;

    inertial->mask = board->config.transmit_at_start ? USUAL_MASK : 0;
    inertial->fusion = ICUB_FUSION_ON;
    inertial->ranges = 0;
    inertial->sequence = 0;
    inertial_board_set_period(inertial, board->config.transmit_at_start ? period_ns : 0);
}

/* ---- values ---- */

/* Converts the values of a sensor to counts. Marks a sensor without a reading in `bad`, a saturated
 * sensor in `cut`. */
static void inertial_board_convert(struct inertial_board *inertial, unsigned sensor,
                                   const double *value, int count, double worth)
{
    bool bad = false, whole = true;

    for (int i = 0; i < count; i++) {
        whole = inertial_quantize(value[i], worth, &inertial->counts[sensor][i], &bad) && whole;
    }
    inertial->bad = (uint16_t)(inertial->bad | bad << sensor);
    inertial->cut = (uint16_t)(inertial->cut | !whole << sensor);
}

/* Converts the values of all sensors (struct board_ops). */
static void inertial_board_sample(struct board *board, const struct plant_sensors *sensors)
{
    struct inertial_board *inertial = inertial_board_of(board);
    struct inertial_values v;
    const double degree = M_PI / 180.0;
    int64_t *status = inertial->counts[ICUB_SENSOR_STATUS];

    inertial_derive(&sensors->imu, inertial->fusion != ICUB_FUSION_OFF, &v);
    inertial->bad = inertial->cut = 0;
    inertial_board_convert(inertial, ICUB_SENSOR_ACCELERATION, v.acceleration_m_s2, 3,
                           ICUB_ACCELERATION_M_S2);
    inertial_board_convert(inertial, ICUB_SENSOR_MAGNETIC, v.magnetic_t, 3,
                           ICUB_MAGNETIC_UT * 1e-6);
    inertial_board_convert(inertial, ICUB_SENSOR_GYRO, v.rate_rad_s, 3, ICUB_INERTIAL_DEG * degree);
    inertial_board_convert(inertial, ICUB_SENSOR_EULER, v.euler_rad, 3, ICUB_INERTIAL_DEG * degree);
    inertial_board_convert(inertial, ICUB_SENSOR_QUATERNION, v.quaternion, 4, ICUB_QUATERNION);
    inertial_board_convert(inertial, ICUB_SENSOR_LINEAR, v.linear_m_s2, 3, ICUB_ACCELERATION_M_S2);
    inertial_board_convert(inertial, ICUB_SENSOR_GRAVITY, v.gravity_m_s2, 3,
                           ICUB_ACCELERATION_M_S2);
    /* Status: two bits per part of the sensor chip, 3 = calibrated */
    status[0] = (v.oriented ? ICUB_CALIBRATED << 6 : 0) |
                (inertial->bad >> ICUB_SENSOR_MAGNETIC & 1 ? 0 : ICUB_CALIBRATED) |
                (inertial->bad >> ICUB_SENSOR_ACCELERATION & 1 ? 0 : ICUB_CALIBRATED << 2) |
                (inertial->bad >> ICUB_SENSOR_GYRO & 1 ? 0 : ICUB_CALIBRATED << 4);
    status[1] = inertial->cut;
    status[2] = inertial->bad;
}

/* ---- commands ---- */

/* Obeys a command of class 2 (struct icub_board_ops). */
static bool inertial_board_command(struct icub_board *icub, const struct bus_frame *frame,
                                   const int64_t *request, int64_t *reply, bool *answer)
{
    struct board *board = &icub->board;
    struct inertial_board *inertial = inertial_board_of(board);

    (void)answer;
    switch (frame->data[0]) {
    /* Selection of sensors, and telemetry period */
    case ICUB_INERTIAL_GET_CONFIG:
        reply[0] = inertial->mask;
        reply[1] = inertial->fusion;
        reply[2] = inertial->ranges;
        return true;
    case ICUB_INERTIAL_SET_CONFIG:
        inertial->mask = (uint16_t)request[0];
        inertial->fusion = (uint8_t)request[1];
        inertial->ranges = (uint32_t)request[2];
        inertial_board_set_period(inertial, 0);
        return true;
    case ICUB_INERTIAL_TRANSMIT:
        inertial_board_set_period(inertial, request[0] * MS);
        return true;

    /* Version and address of the board */
    case ICUB_STRAIN_GET_FIRMWARE:
        icub_board_report_firmware(board, ICUB_STRAIN_PROTOCOL_MAJOR, ICUB_STRAIN_PROTOCOL_MINOR,
                                   request[0] == ICUB_STRAIN_PROTOCOL_MAJOR &&
                                       request[1] <= ICUB_STRAIN_PROTOCOL_MINOR,
                                   reply);
        return true;
    case ICUB_STRAIN_SET_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);
    default:
        return false;
    }
}

/* ---- periodic frames ---- */

/* Sends one frame per selected sensor when the period is due (struct board_ops). */
static void inertial_board_transmit(struct board *board, struct ms_span span,
                                    struct frame_sink *sink)
{
    struct inertial_board *inertial = inertial_board_of(board);
    unsigned known = RAW_MASK | FUSED_MASK | 1u << ICUB_SENSOR_STATUS;

    (void)span;
    if (inertial->period_ns == 0 || !board_is_due(board, &inertial->next_ns, inertial->period_ns)) {
        return;
    }
    for (unsigned sensor = 0; sensor < ICUB_INERTIAL_SENSORS; sensor++) {
        bool four = sensor == ICUB_SENSOR_QUATERNION;
        enum icub_inertial_type type = four ? ICUB_INERTIAL_QUATERNION : ICUB_INERTIAL_TRIPLE;
        const int64_t *counts = inertial->counts[sensor];
        const int64_t triple[] = {inertial->sequence, sensor, counts[0], counts[1], counts[2]};
        uint8_t data[8] = {0};

        if (inertial->mask & known & 1u << sensor) {
            fields_encode(icub_inertial_frames[type].fields, four ? counts : triple, data);
            board_send(board, sink, icub_id(ICUB_PERIODIC_INERTIAL, board->address, type),
                       sizeof data, data);
        }
    }
    inertial->sequence++;
}

const struct icub_board_ops inertial_icub_ops = {
    .base =
        {
            .size = sizeof(struct inertial_board),
            .identity = {.type = ICUB_BOARD_RFE, .major = 1, .minor = 0, .build = 1},
            .periodic_max = 8,
            .power_up = inertial_board_power_up,
            .sample = inertial_board_sample,
            .transmit = inertial_board_transmit,
        },
    .commands = icub_inertial_commands,
    .command_count = ICUB_STRAIN_COMMANDS,
    .command_class = ICUB_POLLING_ANALOG,
    .loader_type = ICUB_BOARD_RFE,
    .command = inertial_board_command,
};
