/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of boards/cia402/protocol.h. The start-up resets the communication of all nodes,
 * and requests their device types. SDOs then set up each node's PDOs (struct cia402_plan) and the
 * voltage mode of its axes. The host then starts the node. It starts the node again if the
 * heartbeat shows another state.
 *
 * Every period, the host sends the voltages of each node and a SYNC, which triggers all telemetry.
 * Controlwords switch the motors. Each controlword makes one transition of the state machine, and
 * the statusword confirms it. Without a confirmation, the controlwords are repeated every
 * CONTROL_REPEAT_NS.
 */
#include "tasks/host_private.h"

#include "boards/cia402/protocol.h"

enum { CIA402_NODES = CIA402_NODE_MAX + 1 };

enum { NODE_ID_MASK = 0x7f, SYNCS_MAX = 240 };

/* minimum time between SYNCs, so that each period has only one */
static const int64_t SYNC_APART_NS = 3 * HOST_MS / 4;
static const int64_t CONTROL_REPEAT_NS = 10 * HOST_MS;

/* Returns the number of axes of a motor board, up to the last axis that the host uses; 0 for other
 * boards. */
static unsigned host_cia402_axes(const struct host_node *node)
{
    unsigned axes = HOST_AXES;

    while (axes > 0 && node->axis[axes - 1] < 0) {
        axes--;
    }
    return node->kind == HOST_MOTOR_BOARD ? axes : 0;
}

/* ---- receiving ---- */

/* Reads a TPDO of the predefined connection set. number: from 0. */
static void host_cia402_read_pdo(struct host *host, struct host_node *node, unsigned number,
                                 const struct bus_frame *frame)
{
    struct host_force *force = &host->force[node->ft];
    struct host_motion *motion = &host->motion;
    struct host_joint *joint;
    int32_t motor;

    switch (node->kind) {
    /* Read rotor angle, spring deflection and torque of an axis */
    case HOST_MOTOR_BOARD:
        joint = number < HOST_AXES ? host_node_joint(host, node, (int)number) : NULL;
        if (joint && frame->len == 8) {
            motor = get_i32_le(frame->data);
            joint->motor_rad = motor * CIA402_POSITION_RAD;
            joint->joint_rad = (motor - get_i16_le(frame->data + 4)) * CIA402_POSITION_RAD;
            joint->torque_nm = get_i16_le(frame->data + 6) * CIA402_SPRING_NM;
            joint->motor_time_ns = joint->joint_time_ns = joint->torque_time_ns = host->now_ns;
        }
        break;
    case HOST_FT_BOARD:
        if (number == 0 && frame->len == 6) {
            host_read_values(host, force->force_n, &force->force_time_ns, frame->data, 3,
                             CIA402_FORCE_N);
        } else if (frame->len == 6) {
            host_read_values(host, force->torque_nm, &force->torque_time_ns, frame->data, 3,
                             CIA402_MOMENT_NM);
        }
        break;
    case HOST_INERTIAL_BOARD:
        if (number == 0 && frame->len == 6) {
            host_read_values(host, motion->acceleration_m_s2, &motion->acceleration_time_ns,
                             frame->data, 3, CIA402_ACCELERATION_M_S2);
        } else if (number == 1 && frame->len == 6) {
            host_read_values(host, motion->rate_rad_s, &motion->rate_time_ns, frame->data, 3,
                             CIA402_RATE_RAD_S);
        } else if (number == 2 && frame->len == 8) {
            host_read_values(host, motion->quaternion, &motion->quaternion_time_ns, frame->data, 4,
                             CIA402_QUATERNION);
        }
        break;
    default:
        break;
    }
}

/* Queues a frame for the end of the period. */
static void host_cia402_queue(struct host *host, size_t bus, uint32_t id, uint8_t len,
                              const uint8_t *data)
{
    struct bus_frame frame = frame_make(id, len, data);

    host_queue(host, bus, &frame);
}

/* Reads an SDO answer: the device type in discovery, then the confirmation of each start-up
 * request. */
static void host_cia402_read_sdo(struct host *host, size_t bus, struct host_node *node,
                                 const struct bus_frame *frame)
{
    unsigned id = frame->id & NODE_ID_MASK, command;
    uint32_t type = node->kind == HOST_MOTOR_BOARD ? CIA402_DEVICE_DRIVE : CIA402_DEVICE_SENSOR;
    uint32_t profile = type & 0xffff; /* the upper bits depend on the number of axes */
    struct host_request request;

    if (frame->len != CIA402_SDO_LENGTH) {
        return;
    }
    /* In discovery, the node reports its device type */
    command = frame->data[0] & CIA402_COMMAND_MASK;
    if (!node->found) {
        if (command != CIA402_UPLOAD_REPLY || get_u16_le(frame->data + 4) != profile) {
            host_fail_node(host, bus, id, "is of another kind");
            return;
        }
        node->found = true;
        return;
    }

    /* Accept only an answer to the last request, for the same object */
    if (node->answered == node->requested ||
        !host_cia402.request(host, bus, id, node->answered, &request) ||
        memcmp(request.frame.data + 1, frame->data + 1, 3) != 0) {
        return;
    }
    if (command == CIA402_ABORT) {
        host_fail_node(host, bus, id, "refuses a start-up request");
    } else if (command == CIA402_DOWNLOAD_REPLY) {
        node->answered = node->requested;
    }
}

/* Passes a frame to the reader of its service, by the upper bits of its identifier. */
static void host_cia402_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    unsigned id = frame->id & NODE_ID_MASK, function = frame->id & ~(unsigned)NODE_ID_MASK;
    struct host_node *node = id < CIA402_NODES ? &host->line[bus].node[id] : NULL;
    bool gone;

    /* Statuswords have separate identifiers, above the identifiers of the first TPDOs */
    if (id >= 0x40 && id - 0x40 < CIA402_NODES && function == CIA402_TPDO) {
        node = &host->line[bus].node[id - 0x40];
        if (node->kind == HOST_MOTOR_BOARD) {
            /* Read the statuswords of a motor board, one per axis, and set the states of its
             * motors */
            for (int k = 0; k < HOST_AXES && 2 * (k + 1) <= frame->len; k++) {
                struct host_joint *joint = host_node_joint(host, node, k);
                unsigned word = get_u16_le(frame->data + 2 * k),
                         state = word & CIA402_SW_STATE_MASK;

                node->statusword[k] = (uint16_t)word;
                node->status_seen = true;
                if (joint) {
                    joint->motor = state == 0x27             ? HOST_MOTOR_ON
                                   : state == 0x07           ? HOST_MOTOR_OTHER
                                   : state & CIA402_SW_FAULT ? HOST_MOTOR_FAULT
                                                             : HOST_MOTOR_OFF;
                }
            }
        }
        return;
    }
    if (!node || node->kind == HOST_NO_BOARD) {
        return;
    }
    switch (function) {
    case CIA402_EMCY: /* the faults of one axis, or the end of all faults of the board */
        gone = get_u16_le(frame->data) == 0;
        for (int k = 0; k < HOST_AXES && frame->len == CIA402_EMCY_LENGTH; k++) {
            struct host_joint *joint = host_node_joint(host, node, k);

            if (joint && (gone || frame->data[3] == k)) {
                joint->fault = gone ? 0 : get_u32_le(frame->data + 4);
            }
        }
        break;
    case CIA402_TPDO:
    case CIA402_TPDO + 0x100:
    case CIA402_TPDO + 0x200:
    case CIA402_TPDO + 0x300:
        host_cia402_read_pdo(host, node, (function - CIA402_TPDO) / 0x100, frame);
        break;
    case CIA402_SDO_REPLY:
        host_cia402_read_sdo(host, bus, node, frame);
        break;
    case CIA402_HEARTBEAT:
        /* Read a heartbeat. A node that boots has lost its settings, and its motors are off. Start
         * a node that waits for its start. */
        if (host->phase > HOST_CONFIGURING && frame->len == 1) {
            if (frame->data[0] == CIA402_PRE_OPERATIONAL) {
                const uint8_t start[CIA402_NMT_LENGTH] = {CIA402_NMT_START,
                                                          (uint8_t)(frame->id & NODE_ID_MASK)};

                host_cia402_queue(host, bus, CIA402_NMT, sizeof start, start);
            }
            for (int k = 0; k < HOST_AXES && frame->data[0] == CIA402_BOOT_UP; k++) {
                struct host_joint *joint = host_node_joint(host, node, k);

                if (joint) {
                    joint->motor = HOST_MOTOR_OFF;
                }
            }
        }
        break;
    default:
        break;
    }
}

/* ---- the start-up ---- */

/* Resets the communication of all nodes, which removes the settings of an earlier host. Then
 * requests the nodes' device types. */
static void host_cia402_discover(struct host *host, size_t bus)
{
    const uint8_t reset[CIA402_NMT_LENGTH] = {CIA402_NMT_RESET_COMMUNICATION};
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_UPLOAD};

    host_cia402_queue(host, bus, CIA402_NMT, sizeof reset, reset);
    put_u16_le(data + 1, CIA402_O_DEVICE_TYPE);
    for (unsigned id = 1; id < CIA402_NODES; id++) {
        const struct host_node *node = &host->line[bus].node[id];

        if (node->kind != HOST_NO_BOARD && !node->found) {
            host_cia402_queue(host, bus, CIA402_SDO_REQUEST + id, sizeof data, data);
        }
    }
}

/* A write to an object, with its size in bytes. */
struct setting {
    unsigned index, sub, bytes;
    uint32_t value;
};

/* Finds write `number` to a node: its PDOs, the modes of its axes, its heartbeat, in this order.
 * Returns false if there are no more writes. */
static bool host_cia402_find_setting(const struct host *host, const struct host_node *node,
                                     unsigned id, unsigned number, struct setting *setting)
{
    enum cia402_kind kind = node->kind == HOST_MOTOR_BOARD      ? CIA402_KIND_DRIVE
                            : node->kind == HOST_INERTIAL_BOARD ? CIA402_KIND_INERTIAL
                                                                : CIA402_KIND_FT;
    unsigned axes = host_cia402_axes(node);
    int64_t sync_ns = host->config.period_ns > HOST_MS ? host->config.period_ns : HOST_MS;
    struct cia402_plan plan;

    /* A PDO is sent at every n-th SYNC, according to the rig's period */
    for (unsigned row = 0; cia402_plan_row(kind, axes, row, &plan); row++) {
        int64_t syncs = node->period_ns / sync_ns * plan.type;
        unsigned type = plan.type > SYNCS_MAX || syncs < 1 ? plan.type
                        : syncs > SYNCS_MAX                ? SYNCS_MAX
                                                           : (unsigned)syncs;

        /* Find write number `step` of the setup of a PDO. CiA 301 requires this order: disable,
         * parameters, zero objects, each object, number of objects, enable. */
        unsigned parameter =
            (plan.receive ? CIA402_O_RPDO_PARAMETER : CIA402_O_TPDO_PARAMETER) + plan.number;
        unsigned mapping =
            (plan.receive ? CIA402_O_RPDO_MAPPING : CIA402_O_TPDO_MAPPING) + plan.number;
        uint32_t cob_id = plan.cob_id + id;
        const struct setting before[] = {{parameter, 1, 4, cob_id | CIA402_COB_INVALID},
                                         {parameter, 2, 1, type},
                                         {parameter, 5, 2, plan.event_ms},
                                         {mapping, 0, 1, 0}};
        const struct setting after[] = {{mapping, 0, 1, plan.count}, {parameter, 1, 4, cob_id}};
        const unsigned first = sizeof before / sizeof *before, objects = first + plan.count;

        if (number < first) {
            *setting = before[number];
        } else if (number < objects) {
            *setting =
                (struct setting){mapping, number - first + 1, 4, plan.object[number - first]};
        } else if (number < objects + 2) {
            *setting = after[number - objects];
        }

        /* The host uses no event timer for RPDOs */
        if (plan.receive && number == 2) {
            *setting = before[1];
        }
        unsigned count = objects + 2;

        if (number < count) {
            return true;
        }
        number -= count;
    }
    /* Voltage mode of each axis; the heartbeat comes last */
    if (number < axes) {
        *setting = (struct setting){CIA402_O_MODE + CIA402_AXIS_STEP * number, 0, 1,
                                    (uint8_t)CIA402_VOLTAGE_MODE};
        return true;
    }
    *setting = (struct setting){CIA402_O_HEARTBEAT, 0, 2, CIA402_HEARTBEAT_MS};
    return number == axes;
}

/* Makes request `number` of a node's start-up (struct host_ops). */
static bool host_cia402_request(const struct host *host, size_t bus, unsigned address, int number,
                                struct host_request *request)
{
    const struct host_node *node = &host->line[bus].node[address];
    uint8_t data[CIA402_SDO_LENGTH] = {0};
    struct setting setting;

    /* Write an object by an expedited SDO download, which the node confirms */
    if (host_cia402_find_setting(host, node, address, (unsigned)number, &setting)) {
        data[0] =
            (uint8_t)(CIA402_DOWNLOAD | (4 - setting.bytes) << 2 | CIA402_EXPEDITED | CIA402_SIZED);
        put_u16_le(data + 1, (uint16_t)setting.index);
        data[3] = (uint8_t)setting.sub;
        put_u32_le(data + 4, setting.value);
        request->frame = frame_make(CIA402_SDO_REQUEST + address, sizeof data, data);
        request->reply = true;
        return true;
    }

    /* The last request starts the node and has no answer */
    if (number > 0 &&
        host_cia402_find_setting(host, node, address, (unsigned)number - 1, &setting)) {
        data[0] = CIA402_NMT_START;
        data[1] = (uint8_t)address;
        request->frame = frame_make(CIA402_NMT, CIA402_NMT_LENGTH, data);
        request->reply = false;
        return true;
    }
    return false;
}

/* ---- every period ---- */

/* Stores the requested state of a motor. The controlwords are sent at the end of the period.
 * Switching off also resets the motor's faults. */
static void host_cia402_set_motor(struct host *host, size_t axis, bool on)
{
    const struct host_axis *to = &host->config.axis[axis];
    struct host_node *node = &host->line[to->bus].node[to->address];

    node->wanted[to->axis] = on;
    node->control_due_ns = host->now_ns;
    if (!on) {
        node->clearing[to->axis] = true;
    }
}

/* Returns the controlword for the next transition of an axis. */
static uint16_t host_cia402_control(struct host_node *node, int axis)
{
    unsigned state = node->statusword[axis] & CIA402_SW_STATE_MASK;

    /* A rising bit resets an old fault, once after each switching off */
    if (state & CIA402_SW_FAULT && node->clearing[axis]) {
        return node->controlword[axis] & CIA402_CW_FAULT_RESET ? 0 : CIA402_CW_FAULT_RESET;
    }
    node->clearing[axis] = false;
    if (!node->wanted[axis]) {
        return 0;
    }
    switch (state) {
    case 0x40:
        return CIA402_CW_SHUTDOWN;
    case 0x21:
        return CIA402_CW_SWITCH_ON_ONLY;
    case 0x23:
    case 0x27:
        return CIA402_CW_ENABLE;
    default:
        return 0;
    }
}

/* Queues the controlwords of a node if one has changed. Repeats them while the node does not
 * follow. */
static void host_cia402_queue_control(struct host *host, size_t bus, unsigned id)
{
    struct host_node *node = &host->line[bus].node[id];
    unsigned axes = host_cia402_axes(node);
    uint8_t data[8] = {0};
    bool changed = false, settled = true;

    for (unsigned k = 0; k < axes; k++) {
        bool on = (node->statusword[k] & CIA402_SW_STATE_MASK) == 0x27;
        uint16_t word = host_cia402_control(node, (int)k);

        changed = changed || word != node->controlword[k];
        settled = settled && on == node->wanted[k] && !node->clearing[k];
        node->controlword[k] = word;
        put_u16_le(data + 2 * k, word);
    }
    if (changed || (!settled && host->now_ns >= node->control_due_ns)) {
        node->control_due_ns = host->now_ns + CONTROL_REPEAT_NS;
        host_cia402_queue(host, bus, CIA402_RPDO + 0x100 + id, (uint8_t)(2 * axes), data);
    }
}

/* Queues the frames of a period: controlwords and voltages of every motor board, then SYNC. */
static void host_cia402_end_period(struct host *host, size_t bus)
{
    struct host_line *line = &host->line[bus];
    static const uint8_t nothing[1];

    if (host->phase <= HOST_CONFIGURING || host->now_ns < line->targets_due_ns) {
        return;
    }
    line->targets_due_ns = host->now_ns + SYNC_APART_NS;
    for (unsigned id = 1; id < CIA402_NODES; id++) {
        const struct host_node *node = &line->node[id];
        unsigned axes = host_cia402_axes(node);
        uint8_t data[8] = {0};

        if (axes > 0 && node->status_seen) {
            host_cia402_queue_control(host, bus, id);
        }
        /* Send the voltages of all axes in one RPDO */
        for (unsigned k = 0; k < axes; k++) {
            double volts = node->axis[k] < 0 ? 0.0 : host->volts[node->axis[k]];
            double counts = fmin(fmax(volts / CIA402_VOLTAGE_V, -INT16_MAX), INT16_MAX);

            put_u16_le(data + 2 * k, (uint16_t)lrint(counts));
        }
        if (axes > 0 && line->driving) {
            host_cia402_queue(host, bus, CIA402_RPDO + id, (uint8_t)(2 * axes), data);
        }
    }
    host_cia402_queue(host, bus, CIA402_SYNC, 0, nothing);
}

const struct host_ops host_cia402 = {
    .restarts = true,
    .discover = host_cia402_discover,
    .request = host_cia402_request,
    .read = host_cia402_read_frame,
    .set_motor = host_cia402_set_motor,
    .end_period = host_cia402_end_period,
};
