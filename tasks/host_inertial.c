/* SPDX-License-Identifier: Apache-2.0 */
/* The host's side of the inertial board, in the icub and cia402 protocols. */
#include "tasks/host_private.h"

#include "boards/cia402/protocol.h"
#include "boards/icub/protocol.h"

#include <math.h>

/* Takes count signed 16-bit values with a scale, and notes the time. */
static void host_motion_take(struct host *host, double *to, int64_t *time_ns, const uint8_t *data,
                             int count, double worth)
{
    for (int i = 0; i < count; i++) {
        to[i] = get_i16_le(data + 2 * i) * worth;
    }
    *time_ns = host->now_ns;
}

/* ---- icub ---- */

void host_inertial_read(struct host *host, struct host_node *node, const struct bus_frame *frame)
{
    struct host_motion *motion = &host->motion;
    const uint8_t *data = frame->data;
    unsigned type = frame->id & 0xf;

    if (frame->id >> 8 == ICUB_POLLING_ANALOG && type == ICUB_HOST && frame->len == 8 &&
        data[0] == ICUB_STRAIN_GET_FIRMWARE) {
        node->answered = node->requested;
    }
    if (frame->id >> 8 != ICUB_PERIODIC_INERTIAL || frame->len != ICUB_INERTIAL_LENGTH) {
        return;
    }
    if (type == ICUB_INERTIAL_QUATERNION) {
        host_motion_take(host, motion->quaternion, &motion->quaternion_time_ns, data, 4,
                         ICUB_QUATERNION);
    } else if (type == ICUB_INERTIAL_TRIPLE && data[1] == ICUB_SENSOR_ACCELERATION) {
        host_motion_take(host, motion->acceleration_m_s2, &motion->acceleration_time_ns, data + 2,
                         3, ICUB_ACCELERATION_M_S2);
    } else if (type == ICUB_INERTIAL_TRIPLE && data[1] == ICUB_SENSOR_GYRO) {
        host_motion_take(host, motion->rate_rad_s, &motion->rate_time_ns, data + 2, 3,
                         ICUB_INERTIAL_DEG * M_PI / 180.0);
    }
}

/* Makes a request of the start-up: firmware version, the sensors, then the period, which starts
 * the board. */
bool host_inertial_request(const struct host_node *node, unsigned address, int number,
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

/* ---- cia402 ---- */

void host_inertial_read_cia402(struct host *host, unsigned number, const struct bus_frame *frame)
{
    struct host_motion *motion = &host->motion;

    if (number == 0 && frame->len == 6) {
        host_motion_take(host, motion->acceleration_m_s2, &motion->acceleration_time_ns,
                         frame->data, 3, CIA402_ACCELERATION_M_S2);
    } else if (number == 1 && frame->len == 6) {
        host_motion_take(host, motion->rate_rad_s, &motion->rate_time_ns, frame->data, 3,
                         CIA402_RATE_RAD_S);
    } else if (number == 2 && frame->len == 8) {
        host_motion_take(host, motion->quaternion, &motion->quaternion_time_ns, frame->data, 4,
                         CIA402_QUATERNION);
    }
}
