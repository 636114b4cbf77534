/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of boards/compact/protocol.h: set-points by slot, all of a bus in one or few
 * frames every period, telemetry every period.
 */
#include "tasks/host_private.h"

#include "boards/compact/protocol.h"

#include <math.h>
#include <string.h>

static const char *const fault_name[32] = {
    "under-voltage",  "over-voltage",  "over-current", "rotor encoder",
    "link encoder",   "torque sensor", "temperature",  "stale set-point",
    "position limit", "frames lost",   "saturated",    "inertial sensor",
};

/* ---- what arrives ---- */

/* Returns the lowest bits of a field as a signed number of that width. */
static int32_t compact_sign_extend(uint64_t bits, int width)
{
    return (int32_t)((int64_t)(bits << (64 - width)) >> (64 - width));
}

/* Translates a board's mode into the state of a motor. */
static void compact_set_joint_mode(struct host_joint *joint, unsigned mode)
{
    joint->motor = mode == COMPACT_VOLTAGE ? HOST_MOTOR_ON
                   : mode == COMPACT_OFF   ? HOST_MOTOR_OFF
                   : mode == COMPACT_FAULT ? HOST_MOTOR_FAULT
                                           : HOST_MOTOR_OTHER;
}

/* Reads the telemetry of an axis: rotor angle (22 bits), deflection (16), current and torque (12
 * each). */
static void host_compact_read_telemetry(struct host *host, struct host_joint *joint,
                                        const struct bus_frame *frame)
{
    uint64_t bits = (uint64_t)get_u32_le(frame->data + 4) << 32 | get_u32_le(frame->data);
    int32_t motor = compact_sign_extend(bits, 22), deflection = compact_sign_extend(bits >> 22, 16);

    joint->motor_rad = motor * COMPACT_POSITION_RAD;
    joint->joint_rad = (motor - deflection) * COMPACT_POSITION_RAD;
    joint->current_a = compact_sign_extend(bits >> 38, 12) * COMPACT_CURRENT_A;
    joint->torque_nm = compact_sign_extend(bits >> 50, 12) * COMPACT_TORQUE_NM;
    joint->motor_time_ns = joint->joint_time_ns = joint->torque_time_ns = host->now_ns;
}

/* Reads the telemetry of an axis in an FD frame, with its mode. */
static void host_compact_read_telemetry_fd(struct host *host, struct host_joint *joint,
                                           const uint8_t *data)
{
    joint->motor_rad = get_i32_le(data) * COMPACT_POSITION_RAD;
    joint->joint_rad = get_i32_le(data + 4) * COMPACT_POSITION_RAD;
    joint->current_a = get_i16_le(data + 10) * COMPACT_SET_CURRENT_A;
    joint->torque_nm =
        compact_sign_extend(get_u32_le(data + 12) & 0xffffff, 24) * COMPACT_TORQUE_FD_NM;
    joint->motor_time_ns = joint->joint_time_ns = joint->torque_time_ns = host->now_ns;
    compact_set_joint_mode(joint, data[15] & 7);
}

/* Reads a frame that a board sends about one of its axes, whose slot is in the identifier. */
static void host_compact_read_axis(struct host *host, struct host_line *line,
                                   const struct bus_frame *frame)
{
    unsigned function = frame->id >> 5, slot = frame->id & 0x1f;
    struct host_joint *joint = line->slot[slot] < 0 ? NULL : &host->joint[line->slot[slot]];

    if (!joint) {
        return;
    }
    if (function == COMPACT_TELEMETRY && frame->len == COMPACT_TELEMETRY_LENGTH) {
        host_compact_read_telemetry(host, joint, frame);
    } else if (function == COMPACT_STATE && frame->len == COMPACT_STATE_LENGTH) {
        joint->fault = get_u16_le(frame->data + 1);
        compact_set_joint_mode(joint, frame->data[0] & 7);
    }
}

/* Reads forces, moments, or both in an FD frame. */
static void host_compact_read_wrench(struct host *host, const struct host_node *node,
                                     const struct bus_frame *frame)
{
    struct host_force *force = &host->force[node->ft];
    unsigned function = frame->id >> 5;
    bool both = function == COMPACT_WRENCH_FD;
    const uint8_t *moment = frame->data + (both ? COMPACT_FORCE_LENGTH : 0);

    if (frame->len != (both ? COMPACT_WRENCH_FD_LENGTH : COMPACT_FORCE_LENGTH)) {
        return;
    }
    for (int c = 0; c < 3; c++) {
        if (function != COMPACT_MOMENT) {
            force->force_n[c] = get_i16_le(frame->data + 2 * c) * COMPACT_FORCE_N;
            force->force_time_ns = host->now_ns;
        }
        if (function != COMPACT_FORCE) {
            force->torque_nm[c] = get_i16_le(moment + 2 * c) * COMPACT_MOMENT_NM;
            force->torque_time_ns = host->now_ns;
        }
    }
}

/* Reads a board's answer to discovery, which says which slots its axes have. What contradicts
 * the rig ends the start-up. */
static void host_compact_read_identity(struct host *host, size_t bus, struct host_node *node,
                                       const struct bus_frame *frame)
{
    struct host_line *line = &host->line[bus];
    const uint8_t *data = frame->data;
    bool motor = node->kind == HOST_MOTOR_BOARD;
    enum compact_kind kind = motor                               ? COMPACT_KIND_MOTOR
                             : node->kind == HOST_INERTIAL_BOARD ? COMPACT_KIND_INERTIAL
                                                                 : COMPACT_KIND_FT;
    unsigned axes = data[1], first = data[2];

    if (frame->len != COMPACT_IDENTITY_LENGTH || node->found) {
        return;
    }

    /* Is it the board that the rig has there? */
    if (data[3] != COMPACT_PROTOCOL_VERSION) {
        host_fail_node(host, bus, frame->id & 0x1f, "speaks another version of the protocol");
        return;
    }
    if (data[0] != kind || axes > HOST_AXES || first + axes > HOST_SLOTS) {
        host_fail_node(host, bus, frame->id & 0x1f, "is of another kind");
        return;
    }

    /* Set-points go by slot from now on */
    for (unsigned k = 0; k < HOST_AXES; k++) {
        if (motor && node->axis[k] >= 0 && (k >= axes || line->slot[first + k] != node->axis[k])) {
            host_fail_node(host, bus, frame->id & 0x1f, "has other axes");
            return;
        }
        if (motor && k < axes) {
            line->slot[first + k] = node->axis[k];
        }
    }
    node->found = true;
}

/* Reads the answer to a start-up request; a refusal ends the start-up. */
static void host_compact_read_reply(struct host *host, size_t bus, struct host_node *node,
                                    const struct bus_frame *frame)
{
    if (frame->len != COMPACT_REPLY_LENGTH || node->answered == node->requested) {
        return;
    }
    if (frame->data[6] != COMPACT_OK) {
        host_fail_node(host, bus, frame->id & 0x1f, "refuses a start-up request");
        return;
    }
    node->answered = node->requested;
}

/* Reads a frame that is about a board as a whole. */
static void host_compact_read_node(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_node *node = &host->line[bus].node[frame->id & 0x1f];

    if (node->kind == HOST_NO_BOARD) {
        return;
    }
    switch (frame->id >> 5) {
    /* Telemetry: on FD buses all axes of a motor board, the wrench of a sensor */
    case COMPACT_TELEMETRY_FD:
        for (int k = 0; k < HOST_AXES && node->kind == HOST_MOTOR_BOARD; k++) {
            struct host_joint *joint = host_node_joint(host, node, k);

            if (joint && frame->len >= (k + 1) * COMPACT_TELEMETRY_FD_LENGTH) {
                host_compact_read_telemetry_fd(host, joint,
                                               frame->data + k * COMPACT_TELEMETRY_FD_LENGTH);
            }
        }
        break;
    case COMPACT_FORCE:
    case COMPACT_MOMENT:
    case COMPACT_WRENCH_FD:
        if (node->kind == HOST_FT_BOARD) {
            host_compact_read_wrench(host, node, frame);
        }
        break;
    case COMPACT_FT_STATE:
        if (node->kind == HOST_FT_BOARD && frame->len == COMPACT_STATE_LENGTH) {
            host->force[node->ft].overflow = frame->data[0];
        }
        break;
    case COMPACT_ACCELERATION:
    case COMPACT_RATE:
    case COMPACT_ORIENTATION:
    case COMPACT_INERTIAL_FD:
        if (node->kind == HOST_INERTIAL_BOARD) {
            host_inertial_read_compact(host, frame);
        }
        break;

    /* The start-up */
    case COMPACT_REPLY:
        host_compact_read_reply(host, bus, node, frame);
        break;
    case COMPACT_IDENTITY:
        host_compact_read_identity(host, bus, node, frame);
        break;
    default:
        break;
    }
}

/* Passes a frame to the reader of axes or of boards (struct host_ops). */
static void host_compact_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    unsigned function = frame->id >> 5;

    if (function == COMPACT_TELEMETRY || function == COMPACT_STATE) {
        host_compact_read_axis(host, &host->line[bus], frame);
    } else {
        host_compact_read_node(host, bus, frame);
    }
}

/* ---- what is sent ---- */

/* Queues a frame, in FD format on FD buses. */
static void host_compact_queue(struct host *host, size_t bus, uint32_t id, uint8_t len,
                               const uint8_t *data)
{
    struct bus_frame frame = {.id = id, .len = len};

    memcpy(frame.data, data, len);
    frame.flags = host->config.bus[bus].fd ? FRAME_FD | FRAME_BRS : 0;
    host_queue(host, bus, &frame);
}

/* Queues the question who is there. */
static void host_compact_discover(struct host *host, size_t bus)
{
    static const uint8_t nothing[1];

    host_compact_queue(host, bus, compact_id(COMPACT_DISCOVER, 0), 0, nothing);
}

/* Makes the one request of the start-up: telemetry once a control period, or as often as the rig
 * says. */
static bool host_compact_request(const struct host *host, size_t bus, unsigned address, int number,
                                 struct host_request *request)
{
    const struct host_node *node = &host->line[bus].node[address];
    int64_t period_ns = node->period_ns > 0 ? node->period_ns : host->config.period_ns;
    uint32_t ms = (uint32_t)(period_ns > 1000000 ? period_ns / 1000000 : 1);
    uint8_t data[COMPACT_WRITE_LENGTH] = {COMPACT_P_TELEMETRY_PERIOD | COMPACT_WRITE};

    put_u32_le(data + 2, ms);
    request->frame = frame_make(compact_id(COMPACT_REQUEST, address), sizeof data, data);
    request->frame.flags = host->config.bus[bus].fd ? FRAME_FD | FRAME_BRS : 0;
    request->reply = true;
    return number == 0;
}

/* Notes the slot of a motor that is switched: one frame at the end of the period switches all of
 * a bus. */
static void host_compact_set_motor(struct host *host, size_t axis, bool on)
{
    struct host_line *line = &host->line[host->config.axis[axis].bus];

    for (unsigned slot = 0; slot < HOST_SLOTS; slot++) {
        if (line->slot[slot] == (int)axis) {
            *(on ? &line->slots_on : &line->slots_off) |= UINT32_C(1) << slot;
            *(on ? &line->slots_off : &line->slots_on) &= ~(UINT32_C(1) << slot);
        }
    }
}

/* Queues a mode for a set of slots and empties the set. */
static void host_compact_queue_mode(struct host *host, size_t bus, enum compact_mode mode,
                                    uint32_t *slots)
{
    uint8_t data[COMPACT_MODE_LENGTH] = {(uint8_t)mode};

    if (*slots) {
        put_u32_le(data + 1, *slots);
        host_compact_queue(host, bus, compact_id(COMPACT_MODE, 0), sizeof data, data);
        *slots = 0;
    }
}

/* Queues COMMAND with the voltages of the slots from first on, as far as there are axes of ours. */
static void host_compact_queue_command(struct host *host, size_t bus, unsigned first,
                                       unsigned count)
{
    const struct host_line *line = &host->line[bus];
    uint8_t data[64] = {0};
    unsigned used = 0;

    for (unsigned k = 0; k < count; k++) {
        int axis = line->slot[first + k];

        if (axis >= 0) {
            double counts = host->volts[axis] / COMPACT_VOLTAGE_V;

            put_u16_le(data + 2 * k, (uint16_t)lrint(fmin(fmax(counts, -INT16_MAX), INT16_MAX)));
            used = 2 * (k + 1);
        }
    }
    if (used > 0) {
        host_compact_queue(host, bus, compact_id(COMPACT_COMMAND, first / COMPACT_GROUP),
                           frame_fd_length(used), data);
    }
}

/* Queues the frames of a period: modes first, then the set-points of all axes. */
static void host_compact_end_period(struct host *host, size_t bus)
{
    struct host_line *line = &host->line[bus];
    unsigned count = host->config.bus[bus].fd ? HOST_SLOTS : COMPACT_GROUP;

    host_compact_queue_mode(host, bus, COMPACT_OFF, &line->slots_off);
    host_compact_queue_mode(host, bus, COMPACT_VOLTAGE, &line->slots_on);
    for (unsigned first = 0; first < HOST_SLOTS && line->driving; first += count) {
        host_compact_queue_command(host, bus, first, count);
    }
}

const struct host_ops host_compact = {
    .name = "compact",
    .motor_address_max = COMPACT_NODE_MAX,
    .address_max = COMPACT_NODE_MAX,
    .axes = COMPACT_BOARD_AXES,
    .discover = host_compact_discover,
    .request = host_compact_request,
    .read = host_compact_read_frame,
    .set_motor = host_compact_set_motor,
    .end_period = host_compact_end_period,
    .fault_name = fault_name,
};
