/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side that both kinds of iCub motor boards share: class 7 discovery, modes, and the
 * boards beside them with forces, joint torques or the inertial sensor (host_inertial.c).
 */
#include "tasks/host_private.h"

#include "boards/icub/protocol.h"

void host_discover_icub(struct host *host, size_t bus)
{
    static const uint8_t ask[1] = {ICUB_DISCOVER};
    struct bus_frame frame = frame_make(icub_id(ICUB_MANAGEMENT, ICUB_HOST, ICUB_EVERYONE), 1, ask);

    host_queue(host, bus, &frame);
}

bool host_read_discovery(struct host *host, size_t bus, struct host_node *node,
                         const struct bus_frame *frame)
{
    static const uint8_t leave[1] = {ICUB_UPDATE_END};
    unsigned address = frame->id >> 4 & 0xf;

    if (frame->id >> 8 != ICUB_MANAGEMENT || (frame->id & 0xf) != ICUB_HOST) {
        return false;
    }
    /* A bootloader answers with 4 bytes, without a build number, and waits for its host from then
     * on: it is sent on to its application, which answers the next time */
    if (frame->len == 4 && frame->data[0] == ICUB_DISCOVER) {
        struct bus_frame end = frame_make(icub_id(ICUB_MANAGEMENT, ICUB_HOST, address), 1, leave);

        host_queue(host, bus, &end);
    }
    node->found = node->found || (frame->len >= 5 && frame->data[0] == ICUB_DISCOVER);
    return true;
}

enum host_motor host_motor_of_mode(uint8_t mode)
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

/* Returns the value of a STRAIN channel, an offset binary of 16 bits, in units of its full
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

    /* Joint torques, a channel a joint */
    for (int c = 0; c < 3; c++) {
        int axis = node->channel[first + c];

        if (axis >= 0) {
            host->joint[axis].torque_nm = host_strain_value(
                frame->data + 2 * c, host->config.axis[axis].torque_full_scale_nm);
            host->joint[axis].torque_time_ns = host->now_ns;
        }
    }
}

void host_strain_read(struct host *host, struct host_node *node, const struct bus_frame *frame)
{
    const uint8_t *data = frame->data;

    if (node->kind == HOST_INERTIAL_BOARD) {
        host_inertial_read(host, node, frame);
    } else if (frame->id >> 8 == ICUB_PERIODIC_ANALOG) {
        host_strain_read_forces(host, node, frame);
    } else if (frame->id >> 8 != ICUB_POLLING_ANALOG || (frame->id & 0xf) != ICUB_HOST) {
        return;
    } else if (frame->len == 8 && data[0] == ICUB_STRAIN_GET_FIRMWARE) {
        node->answered = node->requested;
    } else if (frame->len == 4 && data[0] == ICUB_STRAIN_GET_FULL_SCALE &&
               (data[1] & 0xf) < HOST_CHANNELS) {
        node->full_scale[data[1] & 0xf] = get_u16_be(data + 2);
        node->answered = node->requested;
    }
}

/* Makes a request of the start-up: firmware version, the full scale of each channel of forces,
 * the period when the rig has one, then the command to transmit. */
bool host_strain_request(const struct host_node *node, unsigned address, int number,
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
