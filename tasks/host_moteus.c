/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of boards/moteus/protocol.h. In each period, one frame per axis commands and
 * reads the controller.
 *
 * The controller runs in position mode with kp scaled to 0. It reproduces the effect of a voltage.
 * The feed-forward torque is the torque that the voltage produces at rest. The controller's kd is
 * configured to the slope of the back-EMF. It subtracts the effect of the motion at the
 * controller's own rate, without the delay of the bus.
 */
#include "tasks/host_private.h"

#include "boards/moteus/protocol.h"

#define TURN_RAD (2.0 * M_PI)

/* ---- receiving ---- */

/* The registers that the host uses from a reply. */
struct moteus_reply {
    float value[MOTEUS_R_FAULT + 1]; /* by register */
    uint32_t has;                    /* mask of the registers in the reply */
};

/* Reads a varuint of one or two bytes, which is enough for the host's registers. Returns the index
 * of the next byte. The index is beyond the frame if the varuint is incomplete. */
static unsigned reply_read_varuint(const struct bus_frame *frame, unsigned at, unsigned *value)
{
    *value = 0;
    for (unsigned shift = 0; shift < 14 && at < frame->len; shift += 7) {
        *value |= (unsigned)(frame->data[at] & 0x7f) << shift;
        if (!(frame->data[at++] & 0x80)) {
            return at;
        }
    }
    return frame->len + 1u;
}

/* Reads the subframes of a reply. Stops at an invalid or truncated subframe. */
static struct moteus_reply moteus_read_reply(const struct bus_frame *frame)
{
    struct moteus_reply reply = {.has = 0};
    unsigned at = 0;

    while (at < frame->len && frame->data[at] >= MOTEUS_REPLY &&
           frame->data[at] < MOTEUS_WRITE_ERROR) {
        unsigned type = frame->data[at] & 0xc, count = frame->data[at] & 3, first;
        unsigned bytes = type == MOTEUS_INT8 ? 1 : type == MOTEUS_INT16 ? 2 : 4;

        at = count ? at + 1 : reply_read_varuint(frame, at + 1, &count);
        at = reply_read_varuint(frame, at, &first);
        for (unsigned i = 0; i < count && at + bytes <= frame->len; i++, at += bytes) {
            float value = (int8_t)frame->data[at];
            uint32_t bits;

            if (first + i > MOTEUS_R_FAULT || (type != MOTEUS_INT8 && type != MOTEUS_FLOAT)) {
                continue;
            }
            if (type == MOTEUS_FLOAT) {
                bits = get_u32_le(frame->data + at);
                memcpy(&value, &bits, sizeof value);
            }
            reply.value[first + i] = value;
            reply.has |= (isfinite(value) ? UINT32_C(1) : 0) << (first + i);
        }
    }
    return reply;
}

/* Returns whether a reply has all of these registers. */
static bool moteus_has(const struct moteus_reply *reply, uint32_t registers)
{
    return (reply->has & registers) == registers;
}

/* Reads a reply to the host (struct host_ops). */
static void host_moteus_read(struct host *host, size_t bus, const struct bus_frame *frame)
{
    unsigned address = frame->id >> 8;
    const struct host_drive *drive;
    struct host_joint *joint;
    struct moteus_reply reply;
    struct host_node *node;
    int mode, code;

    if ((frame->id & 0xff) != 0 || address < 1 || address > MOTEUS_ADDRESS_MAX ||
        host->line[bus].node[address].kind != HOST_MOTOR_BOARD) {
        return;
    }
    node = &host->line[bus].node[address];
    node->found = true;
    reply = moteus_read_reply(frame);
    joint = &host->joint[node->axis[0]];
    drive = &host->config.axis[node->axis[0]].drive;
    if (moteus_has(&reply, 1u << MOTEUS_R_MODE | 1u << MOTEUS_R_FAULT)) {
        mode = (int)reply.value[MOTEUS_R_MODE];
        code = mode == MOTEUS_FAULT ? (int)reply.value[MOTEUS_R_FAULT] - MOTEUS_FAULT_FIRST : -1;
        joint->motor = mode == MOTEUS_POSITION               ? HOST_MOTOR_ON
                       : mode == MOTEUS_TIMEOUT              ? HOST_MOTOR_FAULT
                       : mode == MOTEUS_FAULT                ? HOST_MOTOR_FAULT
                       : mode <= MOTEUS_CALIBRATION_COMPLETE ? HOST_MOTOR_OFF /* or soon on */
                                                             : HOST_MOTOR_OTHER;
        joint->fault = code >= 0 && code < 32 ? UINT32_C(1) << code : 0;
    }
    /* The absolute encoder gives the link's angle within a turn. Use the turn that is nearest to
     * the motor's angle. The difference of both encoders gives the spring's torque */
    if (moteus_has(&reply,
                   1u << MOTEUS_R_POSITION | 1u << MOTEUS_R_TORQUE | 1u << MOTEUS_R_ABS_POSITION)) {
        double motor = (double)reply.value[MOTEUS_R_POSITION];
        double link = (double)reply.value[MOTEUS_R_ABS_POSITION];
        double torque_nm = (double)reply.value[MOTEUS_R_TORQUE];

        joint->motor_rad = motor * TURN_RAD;
        joint->joint_rad = (link + round(motor - link)) * TURN_RAD;
        joint->current_a = drive->torque_nm_a > 0.0 ? torque_nm / drive->torque_nm_a : 0.0;
        joint->torque_nm = drive->spring_nm_rad > 0.0
                               ? drive->spring_nm_rad * (joint->motor_rad - joint->joint_rad)
                               : torque_nm;
        joint->motor_time_ns = joint->joint_time_ns = joint->torque_time_ns = host->now_ns;
    }
}

/* ---- sending ---- */

/* Queues a read for each controller of the rig (struct host_ops). */
static void host_moteus_discover(struct host *host, size_t bus)
{
    for (unsigned address = 1; address <= MOTEUS_ADDRESS_MAX; address++) {
        if (host->line[bus].node[address].kind == HOST_MOTOR_BOARD) {
            const struct bus_frame frame = moteus_query(address, (const uint8_t *)"", 0);

            host_queue(host, bus, &frame);
        }
    }
}

/* Stores that a motor is switched. The next frame switches it (struct host_ops). */
static void host_moteus_set_motor(struct host *host, size_t axis, bool on)
{
    host->want[axis].on = on;
    host->want[axis].switch_off = !on;
}

/* Queues a frame for each axis, once motors have been switched on. Before, queues only stop
 * commands of switched motors (struct host_ops). */
static void host_moteus_end_period(struct host *host, size_t bus)
{
    for (size_t axis = 0; axis < host->config.naxis; axis++) {
        struct host_want *want = &host->want[axis];

        if (host->config.axis[axis].bus == (int)bus &&
            (host->line[bus].driving || want->switch_off)) {
            want->switch_off = false;

            /* Queue a motor's stop command, or its torque command */
            const struct host_axis *of = &host->config.axis[axis];
            double ampere =
                of->drive.winding_ohm > 0.0 ? host->volts[axis] / of->drive.winding_ohm : 0.0;
            float torque = (float)(of->drive.torque_nm_a * ampere);
            uint8_t stop[] = {MOTEUS_WRITE | MOTEUS_INT8 | 1, MOTEUS_R_MODE, MOTEUS_STOPPED};
            uint8_t drive[] = {
                MOTEUS_WRITE | MOTEUS_INT8 | 1,
                MOTEUS_R_MODE,
                MOTEUS_POSITION,
                MOTEUS_WRITE | MOTEUS_INT8 | 1,
                MOTEUS_R_POSITION_COMMAND,
                0x80, /* from the present position */
                MOTEUS_WRITE | MOTEUS_FLOAT | 1,
                MOTEUS_R_FEEDFORWARD_TORQUE,
                0,
                0,
                0,
                0,
                MOTEUS_WRITE | MOTEUS_INT8 | 1,
                MOTEUS_R_KP_SCALE,
                0,
            };
            uint32_t bits;

            memcpy(&bits, &torque, sizeof bits);
            put_u32_le(drive + 8, bits);

            /* During the start-up, send a stop first, which clears a fault of an earlier run */
            const struct bus_frame frame =
                host->want[axis].on && !(host->phase == HOST_ENABLING &&
                                         host->joint[axis].motor == HOST_MOTOR_FAULT)
                    ? moteus_query(of->address, drive, sizeof drive)
                    : moteus_query(of->address, stop, sizeof stop);

            host_queue(host, (size_t)of->bus, &frame);
        }
    }
}

const struct host_ops host_moteus = {
    .extended = true,
    .discover = host_moteus_discover,
    .read = host_moteus_read,
    .set_motor = host_moteus_set_motor,
    .end_period = host_moteus_end_period,
    .unnamed_fault = "watchdog time-out",
};
