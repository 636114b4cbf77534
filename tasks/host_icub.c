/* SPDX-License-Identifier: Apache-2.0 */
/* The host's side of boards/icub/protocol.h: two axes a board, telemetry every 4 ms. */
#include "tasks/host_private.h"

#include "boards/icub/protocol.h"

#include <math.h>
#include <string.h>

enum { AXES = 2 };

/* The telemetry that the host needs: POSITION, STATUS, CURRENT, MOTOR_POSITION */
static const uint32_t POLICY = 1u << (ICUB_POSITION - 1) | 1u << (ICUB_STATUS - 1) |
                               1u << (ICUB_CURRENT - 1) | 1u << (ICUB_MOTOR_POSITION - 1);

static const char *const fault_name[32] = {
    "under-voltage", "over-voltage", "emergency button", "over-current",
    "Hall sensors",  "link encoder", "rotor encoder",
};

/* ---- what arrives ---- */

/* Takes the rotor's or link's encoder of the k-th axis of a board. */
static void host_icub_read_position(struct host *host, const struct host_node *node, int k,
                                    int32_t ticks, bool rotor)
{
    const struct host_axis *axis = &host->config.axis[node->axis[k]];
    struct host_joint *joint = &host->joint[node->axis[k]];

    if (rotor) {
        joint->motor_rad = ticks / axis->motor_ticks_per_rad;
        joint->motor_time_ns = host->now_ns;
    } else {
        joint->joint_rad = ticks / axis->joint_ticks_per_rad;
        joint->joint_time_ns = host->now_ns;
    }
}

/* Reads a periodic message of a motor board, which has both axes. */
static void host_icub_read_periodic(struct host *host, const struct host_node *node,
                                    const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;

    if (frame->len != 8) {
        return;
    }
    for (int k = 0; k < AXES; k++) {
        struct host_joint *joint = host_node_joint(host, node, k);

        if (!joint) {
            continue;
        }
        if (type == ICUB_POSITION || type == ICUB_MOTOR_POSITION) {
            host_icub_read_position(host, node, k, get_i32_le(frame->data + 4 * k),
                                    type == ICUB_MOTOR_POSITION);
        } else if (type == ICUB_STATUS) {
            joint->fault = frame->data[2 * k];
            joint->motor = host_motor_of_mode(frame->data[2 * k + 1]);
        } else if (type == ICUB_CURRENT) {
            joint->current_a = get_i16_le(frame->data + 2 * k) * 1e-3;
        }
    }
}

/* Passes a frame to the reader of its class (struct host_ops). */
static void host_icub_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_node *node = &host->line[bus].node[frame->id >> 4 & 0xf];
    unsigned cls = frame->id >> 8;

    if (node->kind == HOST_NO_BOARD || host_read_discovery(host, bus, node, frame)) {
        return;
    }
    if (node->kind != HOST_MOTOR_BOARD) {
        host_strain_read(host, node, frame);
    } else if (cls == ICUB_PERIODIC_MOTOR) {
        host_icub_read_periodic(host, node, frame);
    } else if (cls == ICUB_POLLING_MOTOR && (frame->id & 0xf) == ICUB_HOST && frame->len == 8 &&
               frame->data[0] == ICUB_GET_FIRMWARE_VERSION && frame->data[7] == 1) {
        node->answered = node->requested;
    }
}

/* ---- what is sent ---- */

/* Makes a request of the start-up: firmware version with the protocol check, then which
 * telemetry to send. */
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

/* Queues a command to an axis: its byte with the axis bit, then the payload. */
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
    .name = "icub",
    .torque_apart = true,
    .motor_address_max = ICUB_ADDRESS_MAX,
    .address_max = ICUB_ADDRESS_MAX,
    .axes = AXES,
    .discover = host_discover_icub,
    .request = host_icub_request,
    .read = host_icub_read_frame,
    .set_motor = host_icub_set_motor,
    .set_voltage = host_icub_set_voltage,
    .fault_name = fault_name,
    .unnamed_fault =
        "a strict board wants a position PID, and a calibration if the rig requires it, "
        "which this host does not give",
};
