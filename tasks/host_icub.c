/* SPDX-License-Identifier: Apache-2.0 */
/* The host's side of the iCub protocols, for BLL and 2FOC motor boards. */
#include "tasks/host_private.h"

#include "base/portable_math.h"
#include "boards/foc/protocol.h"
#include "boards/icub/protocol.h"

void host_read_values(struct host *host, double *to, int64_t *time_ns, const uint8_t *data,
                      int count, double worth)
{
    for (int i = 0; i < count; i++) {
        to[i] = get_i16_le(data + 2 * i) * worth;
    }
    *time_ns = host->now_ns;
}

/* ---- inertial and STRAIN boards ---- */

/* Reads a frame of the inertial board. */
static void host_inertial_read(struct host *host, const struct bus_frame *frame)
{
    struct host_motion *motion = &host->motion;
    const uint8_t *data = frame->data;
    unsigned type = frame->id & 0xf;

    if (frame->id >> 8 != ICUB_PERIODIC_INERTIAL || frame->len != ICUB_INERTIAL_LENGTH) {
        return;
    }
    if (type == ICUB_INERTIAL_QUATERNION) {
        host_read_values(host, motion->quaternion, &motion->quaternion_time_ns, data, 4,
                         ICUB_QUATERNION);
    } else if (type == ICUB_INERTIAL_TRIPLE && data[1] == ICUB_SENSOR_ACCELERATION) {
        host_read_values(host, motion->acceleration_m_s2, &motion->acceleration_time_ns, data + 2,
                         3, ICUB_ACCELERATION_M_S2);
    } else if (type == ICUB_INERTIAL_TRIPLE && data[1] == ICUB_SENSOR_GYRO) {
        host_read_values(host, motion->rate_rad_s, &motion->rate_time_ns, data + 2, 3,
                         ICUB_INERTIAL_DEG * M_PI / 180.0);
    }
}

/* Makes a start-up request. In order: firmware version, sensors, and the period, which starts the
 * board. */
static bool host_inertial_request(const struct host_node *node, unsigned address, int number,
                                  struct host_request *request)
{
    const unsigned mask =
        1u << ICUB_SENSOR_ACCELERATION | 1u << ICUB_SENSOR_GYRO | 1u << ICUB_SENSOR_QUATERNION;
    uint8_t data[8] = {ICUB_STRAIN_GET_FIRMWARE, ICUB_PROTOCOL_MAJOR, 0};
    uint8_t len = 3;

    request->reply = number == 0;
    if (number == 1) {
        data[0] = ICUB_INERTIAL_SET_CONFIG;
        put_u16_le(data + 1, (uint16_t)mask);
        data[3] = ICUB_FUSION_ON;
        len = 8;
    } else if (number == 2) {
        data[0] = ICUB_INERTIAL_TRANSMIT;
        data[1] = (uint8_t)(node->period_ns > HOST_MS ? node->period_ns / HOST_MS : 1);
        len = 2;
    }
    request->frame = frame_make(icub_id(ICUB_POLLING_ANALOG, ICUB_HOST, address), len, data);
    return number <= 2;
}

static void host_discover_icub(struct host *host, size_t bus)
{
    static const uint8_t ask[1] = {ICUB_DISCOVER};
    struct bus_frame frame = frame_make(icub_id(ICUB_MANAGEMENT, ICUB_HOST, ICUB_EVERYONE), 1, ask);

    host_queue(host, bus, &frame);
}

static bool host_read_discovery(struct host *host, size_t bus, struct host_node *node,
                                const struct bus_frame *frame)
{
    static const uint8_t leave[1] = {ICUB_UPDATE_END};
    unsigned address = frame->id >> 4 & 0xf;

    if (frame->id >> 8 != ICUB_MANAGEMENT || (frame->id & 0xf) != ICUB_HOST) {
        return false;
    }
    /* A bootloader answers with 4 bytes, without a build number, and waits. Start the board's
     * application, which answers the next discovery */
    if (frame->len == 4 && frame->data[0] == ICUB_DISCOVER) {
        struct bus_frame end = frame_make(icub_id(ICUB_MANAGEMENT, ICUB_HOST, address), 1, leave);

        host_queue(host, bus, &end);
    }
    node->found = node->found || (frame->len >= 5 && frame->data[0] == ICUB_DISCOVER);
    return true;
}

static enum host_motor host_motor_of_mode(uint8_t mode)
{
    switch (mode) {
    case ICUB_MODE_OPEN_LOOP:
        return HOST_MOTOR_ON;
    case ICUB_MODE_HARDWARE_FAULT:
        return HOST_MOTOR_FAULT;
    case ICUB_MODE_IDLE:
    case ICUB_MODE_NOT_CONFIGURED:
    case ICUB_MODE_CONFIGURED:
        return HOST_MOTOR_OFF;
    default:
        return HOST_MOTOR_OTHER;
    }
}

/* Returns the value of a STRAIN channel. data: 16 bits, offset binary, in units of the full
 * scale. */
static double host_strain_value(const uint8_t *data, double full_scale)
{
    return (get_u16_le(data) - ICUB_STRAIN_ZERO) * full_scale / ICUB_STRAIN_ZERO;
}

/* Reads a periodic frame: three channels of a force-torque sensor, or of joint torques. */
static void host_strain_read_forces(struct host *host, struct host_node *node,
                                    const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    int first = type == ICUB_TORQUE ? 3 : 0;

    if ((type != ICUB_FORCE && type != ICUB_TORQUE) ||
        (frame->len != ICUB_STRAIN_LENGTH && frame->len != ICUB_STRAIN_SATURATED_LENGTH)) {
        return;
    }

    /* A force-torque sensor sends forces and torques in two frames */
    if (node->kind == HOST_FT_BOARD) {
        struct host_force *force = &host->force[node->ft];

        for (int c = 0; c < 3; c++) {
            double value = host_strain_value(frame->data + 2 * c, node->full_scale[first + c]);

            *(first ? &force->torque_nm[c] : &force->force_n[c]) = value;
        }
        *(first ? &force->torque_time_ns : &force->force_time_ns) = host->now_ns;
        force->overflow = frame->len == ICUB_STRAIN_SATURATED_LENGTH && frame->data[6];
        return;
    }

    /* A torque board sends joint torques, one channel per joint */
    for (int c = 0; c < 3; c++) {
        int axis = node->channel[first + c];

        if (axis >= 0) {
            host->joint[axis].torque_nm = host_strain_value(
                frame->data + 2 * c, host->config.axis[axis].torque_full_scale_nm);
            host->joint[axis].torque_time_ns = host->now_ns;
        }
    }
}

/* Makes a start-up request. In order: firmware version, full scale of each force channel, the rig's
 * period if given, and the transmit command. */
static bool host_strain_request(const struct host_node *node, unsigned address, int number,
                                struct host_request *request)
{
    int scales = node->kind == HOST_FT_BOARD ? HOST_CHANNELS : 0;
    uint8_t data[3] = {ICUB_STRAIN_GET_FIRMWARE, ICUB_PROTOCOL_MAJOR, 0};
    uint8_t len = 2;

    if (node->kind == HOST_INERTIAL_BOARD) {
        return host_inertial_request(node, address, number, request);
    }
    request->reply = number <= scales;
    if (number == 0) {
        len = 3;
    } else if (number <= scales) {
        data[0] = ICUB_STRAIN_GET_FULL_SCALE;
        data[1] = (uint8_t)(number - 1);
    } else if (number == scales + 1 && node->period_ns > 0) {
        data[0] = ICUB_STRAIN_SET_PERIOD;
        data[1] = (uint8_t)(node->period_ns / 1000000);
    } else {
        data[0] = ICUB_STRAIN_SET_TRANSMIT_MODE;
        data[1] = ICUB_STRAIN_CALIBRATED;
    }
    request->frame = frame_make(icub_id(ICUB_POLLING_ANALOG, ICUB_HOST, address), len, data);
    return number <= scales + (node->period_ns > 0 ? 2 : 1);
}

/*
 * The host's side of boards/foc/protocol.h. A board has one axis. One frame per millisecond has the
 * set points of all boards of a bus, and every board answers.
 */

/* period of DESIRED_TARGETS; the boards answer each of these frames */
static const int64_t TARGET_PERIOD_NS = 1000000;

/* ---- receiving ---- */

/* ---- sending ---- */

/* Writes a current in mA, limited to 1 to INT16_MAX. */
static void host_foc_put_milliamperes(uint8_t *data, double ampere)
{
    put_u16_le(data, (uint16_t)lrint(fmin(fmax(ampere * 1e3, 1), INT16_MAX)));
}

/* Computes and writes the PI gains of the board's current limiter, which holds the current at its
 * peak. The controller runs once per millisecond. The winding's pole is a = exp(-1 ms R/L). The
 * gains place a pole at 1/2. Their unit is a thousandth of the supply voltage per mA, as 16 bits
 * with a common shift. */
static void host_foc_put_current_law(const struct host *host, const struct host_drive *drive,
                                     uint8_t *data)
{
    double a =
        drive->winding_h > 0 ? portable_exp(-1e-3 * drive->winding_ohm / drive->winding_h) : 0;
    double sum = 0.5 * drive->winding_ohm / (1 - a) / host->config.supply_v;
    double kp = sum * (1 + a) / 2, ki = sum * (1 - a);
    /* Find the largest shift with which both gains fit into 16 bits */
    int shift = 15;

    while (shift > 0 && fmax(kp, ki) * (1 << shift) > INT16_MAX) {
        shift--;
    }
    put_u16_le(data, (uint16_t)lrint(fmin(kp * (1 << shift), INT16_MAX)));
    put_u16_le(data + 2, (uint16_t)lrint(fmin(ki * (1 << shift), INT16_MAX)));
    data[6] = (uint8_t)shift;
}

/* Makes a start-up request. In order: firmware version with protocol check, motor data, current
 * limits, gains of the current limiter. */
static bool host_foc_request(const struct host *host, size_t bus, unsigned address, int number,
                             struct host_request *request)
{
    const struct host_node *node = &host->line[bus].node[address];
    const struct host_axis *axis;
    uint8_t data[8] = {0}, len = 8;

    if (node->kind != HOST_MOTOR_BOARD) {
        return host_strain_request(node, address, number, request);
    }

    axis = &host->config.axis[node->axis[0]];
    switch (number) {
    case 0: /* firmware version */
        data[0] = FOC_GET_FIRMWARE_VERSION;
        data[1] = ICUB_PROTOCOL_MAJOR;
        data[2] = ICUB_PROTOCOL_MINOR;
        len = 3;
        break;
    case 1: /* motor data */
        data[0] = FOC_SET_MOTOR_CONFIG;
        data[1] = FOC_HAS_QE;
        put_u16_le(data + 2,
                   (uint16_t)lrint(axis->motor_ticks_per_rad * 2 * M_PI / axis->drive.gear));
        data[6] = (uint8_t)axis->drive.poles;
        len = 7;
        break;
    case 2: /* nominal, peak and overload current */
        data[0] = FOC_SET_CURRENT_LIMIT;
        host_foc_put_milliamperes(data + 2, axis->drive.current_limit_a);
        host_foc_put_milliamperes(data + 4, 1.5 * axis->drive.current_limit_a);
        host_foc_put_milliamperes(data + 6, 2 * axis->drive.current_limit_a);
        break;
    default: /* gains of the current limiter */
        data[0] = FOC_SET_CURRENT_PID;
        host_foc_put_current_law(host, &axis->drive, data + 1);
        break;
    }

    /* The board answers only the first request */
    request->frame = frame_make(icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, address), len, data);
    request->reply = number == 0;
    return number <= 3;
}

/* Queues DESIRED_TARGETS, with the duties of all axes of a bus, when it is due. A bus without
 * motors gets none. */
static void host_foc_send_targets(struct host *host, size_t bus)
{
    struct host_line *line = &host->line[bus];
    uint8_t data[FOC_TARGETS_LENGTH] = {0};
    struct bus_frame frame;

    if (!line->driving || host->now_ns < line->targets_due_ns) {
        return;
    }
    line->targets_due_ns = host->now_ns + TARGET_PERIOD_NS;
    for (unsigned a = 1; a <= FOC_AXES_MAX; a++) {
        const struct host_node *node = &line->node[a];

        if (node->kind == HOST_MOTOR_BOARD) {
            double counts = host_duty(host, (size_t)node->axis[0]) * FOC_PWM_FULL_SCALE;

            put_u16_le(data + 2 * (a - 1), (uint16_t)lrint(counts));
        }
    }
    frame = frame_make(FOC_DESIRED_TARGETS_ID, FOC_TARGETS_LENGTH, data);
    host_queue(host, bus, &frame);
}

/* Telemetry that the host needs: POSITION, STATUS, CURRENT, MOTOR_POSITION */
static const uint32_t POLICY = 1u << (ICUB_POSITION - 1) | 1u << (ICUB_STATUS - 1) |
                               1u << (ICUB_CURRENT - 1) | 1u << (ICUB_MOTOR_POSITION - 1);

/* ---- receiving ---- */

/* Passes a frame to the reader of the frame's class (struct host_ops). */
static void host_icub_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_node *node = &host->line[bus].node[frame->id >> 4 & 0xf];
    unsigned cls = frame->id >> 8;

    if (node->kind == HOST_NO_BOARD || host_read_discovery(host, bus, node, frame)) {
        return;
    }
    if (node->kind != HOST_MOTOR_BOARD) {
        const uint8_t *data = frame->data;
        bool answer = frame->id >> 8 == ICUB_POLLING_ANALOG && (frame->id & 0xf) == ICUB_HOST;

        if (answer && frame->len == 8 && data[0] == ICUB_STRAIN_GET_FIRMWARE) {
            node->answered = node->requested;
        } else if (answer && frame->len == 4 && data[0] == ICUB_STRAIN_GET_FULL_SCALE &&
                   (data[1] & 0xf) < HOST_CHANNELS) {
            node->full_scale[data[1] & 0xf] = get_u16_be(data + 2);
            node->answered = node->requested;
        } else if (node->kind == HOST_INERTIAL_BOARD) {
            host_inertial_read(host, frame);
        } else if (frame->id >> 8 == ICUB_PERIODIC_ANALOG) {
            host_strain_read_forces(host, node, frame);
        }
    } else if (cls == ICUB_PERIODIC_MOTOR && host->line[bus].ops == &host_foc) {
        const struct host_drive *drive = &host->config.axis[node->axis[0]].drive;
        struct host_joint *joint = &host->joint[node->axis[0]];

        /* Read a periodic frame of a 2FOC board: current and rotor angle, or faults and mode.
         * Compute the link's angle from the measured torque and the spring. */
        if ((frame->id & 0xf) == FOC_FEEDBACK && frame->len == FOC_FEEDBACK_LENGTH) {
            joint->current_a = get_i16_le(frame->data) * 1e-3;
            joint->motor_rad =
                get_i32_le(frame->data + 4) * (2 * M_PI / FOC_ICUBDEG_PER_REV) / drive->gear;
            joint->joint_rad = drive->valve
                                   ? joint->motor_rad
                                   : joint->motor_rad - joint->torque_nm / drive->spring_nm_rad;
            joint->motor_time_ns = joint->joint_time_ns = host->now_ns;
        } else if ((frame->id & 0xf) == FOC_STATUS && frame->len == FOC_STATUS_LENGTH) {
            joint->fault = get_u32_le(frame->data + 4);
            joint->motor = host_motor_of_mode(frame->data[0]);
        }
    } else if (cls == ICUB_PERIODIC_MOTOR) {
        /* Read a periodic message of a motor board; it has the values of both axes */
        unsigned type = frame->id & 0xf;

        if (frame->len == 8) {
            for (int k = 0; k < 2; k++) {
                struct host_joint *joint = host_node_joint(host, node, k);

                if (!joint) {
                    continue;
                }
                if (type == ICUB_MOTOR_POSITION) {
                    joint->motor_rad = get_i32_le(frame->data + 4 * k) /
                                       host->config.axis[node->axis[k]].motor_ticks_per_rad;
                    joint->motor_time_ns = host->now_ns;
                } else if (type == ICUB_POSITION) {
                    joint->joint_rad = get_i32_le(frame->data + 4 * k) /
                                       host->config.axis[node->axis[k]].joint_ticks_per_rad;
                    joint->joint_time_ns = host->now_ns;
                } else if (type == ICUB_STATUS) {
                    joint->fault = frame->data[2 * k];
                    joint->motor = host_motor_of_mode(frame->data[2 * k + 1]);
                } else if (type == ICUB_CURRENT) {
                    joint->current_a = get_i16_le(frame->data + 2 * k) * 1e-3;
                }
            }
        }
    } else if (cls == ICUB_POLLING_MOTOR && (frame->id & 0xf) == ICUB_HOST && frame->len == 8 &&
               frame->data[0] == ICUB_GET_FIRMWARE_VERSION && frame->data[7] == 1) {
        node->answered = node->requested;
    }
}

/* ---- sending ---- */

/* Makes a start-up request. In order: firmware version with protocol check, selection of
 * telemetry. */
static bool host_icub_request(const struct host *host, size_t bus, unsigned address, int number,
                              struct host_request *request)
{
    const struct host_node *node = &host->line[bus].node[address];
    uint8_t data[5] = {ICUB_GET_FIRMWARE_VERSION, ICUB_PROTOCOL_MAJOR, ICUB_PROTOCOL_MINOR};
    uint8_t len = 3;

    if (node->kind != HOST_MOTOR_BOARD) {
        return host_strain_request(node, address, number, request);
    }
    if (number == 1) {
        data[0] = ICUB_SET_BROADCAST_POLICY;
        put_u32_le(data + 1, POLICY);
        len = 5;
    }
    request->frame = frame_make(icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, address), len, data);
    request->reply = number == 0;
    return number <= 1;
}

/* Queues a command to an axis: the command byte with the axis bit, then the payload. */
static void host_icub_queue_command(struct host *host, size_t axis, uint8_t command, uint8_t len,
                                    const uint8_t *payload)
{
    const struct host_axis *at = &host->config.axis[axis];
    struct bus_frame frame = {
        .id = icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, at->address),
        .len = len,
        .data = {(uint8_t)(command | (at->axis ? ICUB_AXIS_BIT : 0))},
    };

    for (unsigned i = 1; i < len; i++) {
        frame.data[i] = payload[i - 1];
    }
    host_queue(host, (size_t)at->bus, &frame);
}

/* Queues the mode of a motor: open loop (voltage), or idle. */
static void host_icub_set_motor(struct host *host, size_t axis, bool on)
{
    uint8_t mode = on ? ICUB_MODE_OPEN_LOOP : ICUB_MODE_FORCE_IDLE;

    host_icub_queue_command(host, axis, ICUB_SET_CONTROL_MODE, 2, &mode);
}

/* Queues the duty of a motor. */
static void host_icub_set_voltage(struct host *host, size_t axis)
{
    uint8_t payload[2];

    put_u16_le(payload, (uint16_t)lrint(host_duty(host, axis) * ICUB_PWM_FULL_SCALE));
    host_icub_queue_command(host, axis, ICUB_SET_OPEN_LOOP, 3, payload);
}

const struct host_ops host_icub = {
    .torque_apart = true,
    .discover = host_discover_icub,
    .request = host_icub_request,
    .read = host_icub_read_frame,
    .set_motor = host_icub_set_motor,
    .set_voltage = host_icub_set_voltage,
    .unnamed_fault = "a strict board wants a position PID, and a calibration if the rig requires "
                     "it, which this host does not give",
};

const struct host_ops host_foc = {
    .rotor_only = true,
    .discover = host_discover_icub,
    .request = host_foc_request,
    .read = host_icub_read_frame,
    .set_motor = host_icub_set_motor,
    .end_period = host_foc_send_targets,
};
