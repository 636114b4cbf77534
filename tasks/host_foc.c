/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of boards/foc/protocol.h: one axis a board, all set-points of a bus in one frame
 * every millisecond, answered by every board.
 */
#include "base/portable_math.h"
#include "tasks/host_private.h"

#include "boards/foc/protocol.h"

#include <math.h>

static const int64_t TARGET_PERIOD_NS = 1000000; /* period of DESIRED_TARGETS; the boards answer
                                                  * each one */

static const char *const fault_name[32] = {
    "wrong CAN protocol",
    "Hall sequence",
    "AS5045 checksum",
    "Hall value",
    "over-current",
    "over-voltage",
    "under-voltage",
    "emergency button",
    NULL,
    "over-heating",
    "CAN receive warning",
    "CAN transmit warning",
    "CAN receive passive",
    "CAN transmit passive",
    "set-point expired",
    "CAN overrun",
    "PWM",
    "AS5045 calculation",
    "SPI timing",
    "rotor encoder",
    "EMUROM checksum",
    "EMUROM",
    "I2t",
    "ADC calibration",
    "lower position limit",
    "upper position limit",
    "silicon revision",
    "CAN length",
    "CAN was in warning",
    "CAN remote frame",
    "CAN receive was passive",
    "CAN transmit was passive",
};

/* ---- what arrives ---- */

/* Reads current and rotor angle of an axis and computes the link's angle from the measured
 * torque and the spring. */
static void host_foc_read_feedback(struct host *host, const struct host_node *node,
                                   const struct bus_frame *frame)
{
    const struct host_axis *axis = &host->config.axis[node->axis[0]];
    struct host_joint *joint = &host->joint[node->axis[0]];

    joint->current_a = get_i16_le(frame->data) * 1e-3;
    joint->motor_rad =
        get_i32_le(frame->data + 4) * (2 * M_PI / FOC_ICUBDEG_PER_REV) / axis->drive.gear;
    joint->motor_time_ns = host->now_ns;
    joint->joint_rad = axis->drive.valve
                           ? joint->motor_rad
                           : joint->motor_rad - joint->torque_nm / axis->drive.spring_nm_rad;
    joint->joint_time_ns = host->now_ns;
}

/* Reads faults and mode of an axis. */
static void host_foc_read_status(struct host_joint *joint, const struct bus_frame *frame)
{
    joint->fault = get_u32_le(frame->data + 4);
    joint->motor = host_motor_of_mode(frame->data[0]);
}

/* Passes a frame to the reader of its class (struct host_ops). */
static void host_foc_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_node *node = &host->line[bus].node[frame->id >> 4 & 0xf];
    unsigned cls = frame->id >> 8, x = frame->id & 0xf;

    if (node->kind == HOST_NO_BOARD || host_read_discovery(host, bus, node, frame)) {
        return;
    }
    if (node->kind != HOST_MOTOR_BOARD) {
        host_strain_read(host, node, frame);
    } else if (cls == ICUB_PERIODIC_MOTOR && x == FOC_FEEDBACK &&
               frame->len == FOC_FEEDBACK_LENGTH) {
        host_foc_read_feedback(host, node, frame);
    } else if (cls == ICUB_PERIODIC_MOTOR && x == FOC_STATUS && frame->len == FOC_STATUS_LENGTH) {
        host_foc_read_status(&host->joint[node->axis[0]], frame);
    } else if (cls == ICUB_POLLING_MOTOR && x == ICUB_HOST && frame->len == 8 &&
               frame->data[0] == FOC_GET_FIRMWARE_VERSION && frame->data[7] == 1) {
        node->answered = node->requested;
    }
}

/* ---- what is sent ---- */

/* Writes a current in mA, 1 to INT16_MAX. */
static void host_foc_put_milliamperes(uint8_t *data, double ampere)
{
    put_u16_le(data, (uint16_t)lrint(fmin(fmax(ampere * 1e3, 1), INT16_MAX)));
}

/* Computes and writes the PI gains that hold the current at its peak. The law runs once a
 * millisecond in the board, so that the winding has the pole a = exp(-1 ms R/L) and the gains
 * put one at 1/2. Gains are in thousandths of the supply a mA, as 16 bits with a common shift. */
static void host_foc_put_current_law(const struct host *host, const struct host_drive *drive,
                                     uint8_t *data)
{
    double a =
        drive->winding_h > 0 ? portable_exp(-1e-3 * drive->winding_ohm / drive->winding_h) : 0;
    double sum = 0.5 * drive->winding_ohm / (1 - a) / host->config.supply_v;
    double kp = sum * (1 + a) / 2, ki = sum * (1 - a);
    /* The largest shift with which both gains fit */
    int shift = 15;

    while (shift > 0 && fmax(kp, ki) * (1 << shift) > INT16_MAX) {
        shift--;
    }
    put_u16_le(data, (uint16_t)lrint(fmin(kp * (1 << shift), INT16_MAX)));
    put_u16_le(data + 2, (uint16_t)lrint(fmin(ki * (1 << shift), INT16_MAX)));
    data[6] = (uint8_t)shift;
}

/* Makes a request of the start-up: firmware version with the protocol check, without which
 * nothing is obeyed; the motor; the limits of its current; the gains that hold them. */
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
    case 0: /* who we are */
        data[0] = FOC_GET_FIRMWARE_VERSION;
        data[1] = ICUB_PROTOCOL_MAJOR;
        data[2] = ICUB_PROTOCOL_MINOR;
        len = 3;
        break;
    case 1: /* the motor */
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
    default: /* the current limiter's law */
        data[0] = FOC_SET_CURRENT_PID;
        host_foc_put_current_law(host, &axis->drive, data + 1);
        break;
    }

    /* Only the first is answered */
    request->frame = frame_make(icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, address), len, data);
    request->reply = number == 0;
    return number <= 3;
}

/* Queues the mode of a motor: open loop (voltage), or idle. */
static void host_foc_set_motor(struct host *host, size_t axis, bool on)
{
    const struct host_axis *at = &host->config.axis[axis];
    uint8_t data[2] = {FOC_SET_CONTROL_MODE, on ? ICUB_MODE_OPEN_LOOP : ICUB_MODE_FORCE_IDLE};
    struct bus_frame frame =
        frame_make(icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, at->address), 2, data);

    host_queue(host, (size_t)at->bus, &frame);
}

/* Queues DESIRED_TARGETS with the duties of all axes of a bus when it is due; on a bus without
 * motors it never is. */
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

const struct host_ops host_foc = {
    .name = "foc",
    .rotor_only = true,
    .motor_address_max = FOC_AXES_MAX,
    .address_max = ICUB_ADDRESS_MAX,
    .axes = 1,
    .discover = host_discover_icub,
    .request = host_foc_request,
    .read = host_foc_read_frame,
    .set_motor = host_foc_set_motor,
    .end_period = host_foc_send_targets,
    .fault_name = fault_name,
};
