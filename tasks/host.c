/* SPDX-License-Identifier: Apache-2.0 */
/* The host of iCub boards: start-up, telemetry, commands. Protocol: boards/icub_protocol.h. */
#include "tasks/host.h"

#include "boards/icub_protocol.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    ADDRESSES = 16,
    AXES = 2,
    CHANNELS = 6,
    QUEUE_MAX = 96, /* frames that one bus may be sent in one period */
    RECEIVE_BATCH = 64,
};

static const int64_t MS = 1000000;
static const int64_t DISCOVERY_TIMEOUT = 3000; /* ms: longer than a slow simulator's start */
static const int64_t ENABLE_TIMEOUT = 1000;    /* ms; a STATUS frame follows a mode within 4 */
static const int64_t REPLY_TIMEOUT = 300;      /* ms a request, as real hosts wait */
static const int64_t TELEMETRY_TIMEOUT = 200;  /* ms without rotor positions */

/* POSITION, STATUS, CURRENT, MOTOR_POSITION */
static const uint32_t POLICY = 1u << (ICUB_POSITION - 1) | 1u << (ICUB_STATUS - 1) |
                               1u << (ICUB_CURRENT - 1) | 1u << (ICUB_MOTOR_POSITION - 1);

enum node_kind { NODE_NONE, NODE_MOTOR, NODE_FT, NODE_TORQUE };

/* What stands at one address of one bus. */
struct node {
    enum node_kind kind;
    int axis[AXES];        /* NODE_MOTOR: host axis, -1 = not ours */
    int ft;                /* NODE_FT */
    int channel[CHANNELS]; /* NODE_TORQUE: host axis, -1 = unused */
    bool found;
    int requested, answered; /* start-up requests sent and confirmed */
    int64_t request_time_ns;
    double full_scale[CHANNELS]; /* as the board says */
};

struct bus {
    struct node node[ADDRESSES];
    struct bus_frame queue[QUEUE_MAX];
    size_t queued;
    bool done; /* DONE of the present tick has come (lockstep) */
};

struct host {
    struct host_config config;
    struct bus *bus;
    struct host_joint *joint;
    struct host_force *force;
    enum host_phase phase;
    int64_t phase_since_ns;
    bool phase_entered;
    int64_t now_ns;       /* host time */
    uint32_t tick;        /* lockstep: tick that the next STEP expects */
    int64_t step_sent_ns; /* caller's time of the last STEP */
    bool step_waits;      /* a STEP is out and its DONE has not come on every bus */
    bool step_refused;    /* it was not the tick that the simulator is at */
    char message[160];
};

/* ---- creation ---- */

static enum error_code claim_node(struct host *host, int bus, unsigned address, enum node_kind kind,
                                  struct node **out, struct error *error)
{
    struct node *node;

    if (bus < 0 || (size_t)bus >= host->config.nbus || address < 1 || address > ICUB_ADDRESS_MAX) {
        return error_set(error, ERROR_INPUT, "host: no address %u on bus %d", address, bus);
    }
    node = &host->bus[bus].node[address];
    if (node->kind == NODE_NONE) {
        node->kind = kind;
        node->axis[0] = node->axis[1] = -1;
        for (int c = 0; c < CHANNELS; c++) {
            node->channel[c] = -1;
        }
    } else if (node->kind != kind) {
        return error_set(error, ERROR_INPUT, "host: address %u on bus %d has two kinds of board",
                         address, bus);
    }
    *out = node;
    return ERROR_NONE;
}

static enum error_code map_axis(struct host *host, size_t index, struct error *error)
{
    const struct host_axis *axis = &host->config.axis[index];
    struct node *node;
    enum error_code code = claim_node(host, axis->bus, axis->address, NODE_MOTOR, &node, error);

    if (code) {
        return code;
    }
    if (axis->axis >= AXES || node->axis[axis->axis] >= 0) {
        return error_set(error, ERROR_INPUT, "host: joint %s shares its axis", axis->joint);
    }
    node->axis[axis->axis] = (int)index;
    if (axis->torque_address < 0) {
        return ERROR_NONE;
    }
    code = claim_node(host, axis->bus, (unsigned)axis->torque_address, NODE_TORQUE, &node, error);
    if (code) {
        return code;
    }
    if (axis->torque_channel < 0 || axis->torque_channel >= CHANNELS) {
        return error_set(error, ERROR_INPUT, "host: joint %s has torque channel %d", axis->joint,
                         axis->torque_channel);
    }
    node->channel[axis->torque_channel] = (int)index;
    return ERROR_NONE;
}

enum error_code host_create(const struct host_config *config, struct arena *arena,
                            struct host **out, struct error *error)
{
    struct host *host = arena_alloc(arena, 1, sizeof *host);
    enum error_code code = ERROR_NONE;

    if (host) {
        host->bus = arena_alloc(arena, config->nbus, sizeof *host->bus);
        host->joint = arena_alloc(arena, config->naxis, sizeof *host->joint);
        host->force = arena_alloc(arena, config->nft, sizeof *host->force);
    }
    if (!host || !host->bus || !host->joint || !host->force) {
        return error_set(error, ERROR_MEMORY, "no memory for the host");
    }
    host->config = *config;
    host->phase_entered = true;
    for (size_t i = 0; i < config->naxis && !code; i++) {
        host->joint[i].motor_time_ns = -1;
        host->joint[i].mode = ICUB_MODE_UNKNOWN;
        code = map_axis(host, i, error);
    }
    for (size_t i = 0; i < config->nft && !code; i++) {
        struct node *node;

        code = claim_node(host, config->ft[i].bus, config->ft[i].address, NODE_FT, &node, error);
        if (!code) {
            node->ft = (int)i;
        }
    }
    *out = host;
    return code;
}

/* ---- telemetry ---- */

static void read_positions(struct host *host, const struct node *node,
                           const struct bus_frame *frame, bool rotor)
{
    for (int k = 0; k < AXES; k++) {
        const struct host_axis *axis;
        struct host_joint *joint;
        int32_t ticks = get_i32_le(frame->data + 4 * k);

        if (node->axis[k] < 0) {
            continue;
        }
        axis = &host->config.axis[node->axis[k]];
        joint = &host->joint[node->axis[k]];
        if (rotor) {
            joint->motor_rad = ticks / axis->motor_ticks_per_rad;
            joint->motor_time_ns = host->now_ns;
        } else {
            joint->joint_rad = ticks / axis->joint_ticks_per_rad;
            joint->joint_seen = true;
        }
    }
}

static void read_motor_frame(struct host *host, struct node *node, const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;

    if (frame->len != 8) {
        return;
    }
    if (type == ICUB_POSITION || type == ICUB_MOTOR_POSITION) {
        read_positions(host, node, frame, type == ICUB_MOTOR_POSITION);
        return;
    }
    for (int k = 0; k < AXES; k++) {
        struct host_joint *joint = node->axis[k] < 0 ? NULL : &host->joint[node->axis[k]];

        if (joint && type == ICUB_STATUS) {
            joint->fault = frame->data[2 * k];
            joint->mode = frame->data[2 * k + 1];
            joint->status_seen = true;
        } else if (joint && type == ICUB_CURRENT) {
            joint->current_a = get_i16_le(frame->data + 2 * k) * 1e-3;
        }
    }
}

static double analog_value(const uint8_t *data, double full_scale)
{
    return ((int)get_u16_le(data) - 0x8000) * full_scale / 0x8000;
}

static void read_analog_frame(struct host *host, struct node *node, const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    int first = type == ICUB_TORQUE ? 3 : 0;

    if ((type != ICUB_FORCE && type != ICUB_TORQUE) || (frame->len != 6 && frame->len != 7)) {
        return;
    }
    if (node->kind == NODE_FT) {
        struct host_force *force = &host->force[node->ft];

        for (int c = 0; c < 3; c++) {
            double value = analog_value(frame->data + 2 * c, node->full_scale[first + c]);

            *(first ? &force->torque_nm[c] : &force->force_n[c]) = value;
        }
        *(first ? &force->torque_seen : &force->force_seen) = true;
        force->overflow = frame->len == 7 && frame->data[6];
        return;
    }
    for (int c = 0; c < 3; c++) {
        int axis = node->channel[first + c];

        if (axis >= 0) {
            host->joint[axis].torque_nm =
                analog_value(frame->data + 2 * c, host->config.axis[axis].torque_full_scale_nm);
        }
    }
}

static void read_done(struct host *host, struct bus *bus, const struct bus_frame *frame)
{
    uint32_t tick;
    uint16_t flags;

    if (frame->len != LOCKSTEP_LENGTH) {
        return;
    }
    flags = get_u16_le(frame->data + 4);
    tick = get_u32_le(frame->data);
    if (flags & LOCKSTEP_MISMATCH) {
        /* a refusal that asks for the very tick of the STEP that is out was meant for an earlier
         * copy of a repeated one */
        host->step_refused = host->step_refused || tick != host->tick;
    } else {
        bus->done = true;
    }
    host->tick = tick;
    if (flags & LOCKSTEP_STOPPING) {
        host->phase = HOST_FAILED;
        snprintf(host->message, sizeof host->message, "the simulator is stopping");
    }
}

/* Replies to start-up requests. */
static void read_reply(struct node *node, const struct bus_frame *frame, enum icub_class cls)
{
    if (cls == ICUB_MANAGEMENT && frame->len >= 4 && frame->data[0] == ICUB_DISCOVER) {
        node->found = true;
    } else if (cls == ICUB_POLLING_MOTOR && frame->len == 8 &&
               frame->data[0] == ICUB_GET_FIRMWARE_VERSION && frame->data[7] == 1) {
        node->answered = node->requested;
    } else if (cls == ICUB_POLLING_ANALOG && frame->len == 8 &&
               frame->data[0] == ICUB_STRAIN_GET_FIRMWARE) {
        node->answered = node->requested;
    } else if (cls == ICUB_POLLING_ANALOG && frame->len == 4 &&
               frame->data[0] == ICUB_STRAIN_GET_FULL_SCALE && (frame->data[1] & 0xf) < CHANNELS) {
        node->full_scale[frame->data[1] & 0xf] = frame->data[2] << 8 | frame->data[3];
        node->answered = node->requested;
    }
}

static void read_frame(struct host *host, struct bus *bus, const struct bus_frame *frame)
{
    enum icub_class cls = (enum icub_class)(frame->id >> 8 & 7);
    struct node *node = &bus->node[frame->id >> 4 & 0xf];

    if (frame->flags & (FRAME_ERROR | FRAME_EXTENDED | FRAME_REMOTE)) {
        return;
    }
    if (host->config.lockstep && frame->id == host->config.done_id) {
        read_done(host, bus, frame);
    } else if (node->kind == NODE_NONE) {
        return;
    } else if (cls == ICUB_PERIODIC_MOTOR && node->kind == NODE_MOTOR) {
        read_motor_frame(host, node, frame);
    } else if (cls == ICUB_PERIODIC_ANALOG && node->kind != NODE_MOTOR) {
        read_analog_frame(host, node, frame);
    } else if ((frame->id & 0xf) == ICUB_HOST) {
        read_reply(node, frame, cls);
    }
}

bool host_receive(struct host *host, int64_t now_ns)
{
    struct bus_frame frames[RECEIVE_BATCH];
    bool all_done = true;
    size_t count;

    if (!host->config.lockstep) {
        host->now_ns = now_ns;
    }
    for (size_t b = 0; b < host->config.nbus; b++) {
        do {
            count = can_receive(host->config.port[b], frames, RECEIVE_BATCH);
            for (size_t i = 0; i < count; i++) {
                read_frame(host, &host->bus[b], &frames[i]);
            }
        } while (count == RECEIVE_BATCH);
        all_done = all_done && host->bus[b].done;
    }
    if (!host->config.lockstep) {
        return true;
    }
    if (host->step_waits && !all_done && !host->step_refused) {
        return false;
    }
    for (size_t b = 0; b < host->config.nbus; b++) {
        host->bus[b].done = false;
    }
    host->step_waits = false;
    host->step_refused = false;
    host->now_ns = host->tick * host->config.period_ns;
    return true;
}

int64_t host_time_ns(const struct host *host)
{
    return host->now_ns;
}

/* ---- commands ---- */

static void queue_frame(struct host *host, size_t bus, uint32_t id, uint8_t len,
                        const uint8_t *data)
{
    struct bus *to = &host->bus[bus];

    if (to->queued < QUEUE_MAX) {
        to->queue[to->queued] = frame_make(id, len, data);
        to->queue[to->queued++].time_ns = host->now_ns;
    }
}

static void queue_motor_command(struct host *host, size_t axis, uint8_t command, uint8_t len,
                                const uint8_t *payload)
{
    const struct host_axis *at = &host->config.axis[axis];
    uint8_t data[8] = {0};

    data[0] = (uint8_t)(command | (at->axis ? ICUB_AXIS_BIT : 0));
    memcpy(data + 1, payload, len - 1u);
    queue_frame(host, (size_t)at->bus, icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, at->address), len,
                data);
}

void host_set_mode(struct host *host, size_t axis, uint8_t mode)
{
    queue_motor_command(host, axis, ICUB_SET_CONTROL_MODE, 2, &mode);
}

void host_set_voltage(struct host *host, size_t axis, double volts)
{
    double counts = volts / host->config.supply_v * ICUB_PWM_FULL_SCALE;
    uint8_t payload[2];

    counts = fmin(fmax(counts, -ICUB_PWM_FULL_SCALE), ICUB_PWM_FULL_SCALE);
    put_u16_le(payload, (uint16_t)(int16_t)lrint(counts));
    queue_motor_command(host, axis, ICUB_SET_OPEN_LOOP, 3, payload);
}

static struct bus_frame step_frame(const struct host *host)
{
    uint8_t data[LOCKSTEP_LENGTH];

    put_u32_le(data, host->tick);
    put_u16_le(data + 4, 1);
    return frame_make(host->config.step_id, LOCKSTEP_LENGTH, data);
}

void host_send(struct host *host)
{
    for (size_t b = 0; b < host->config.nbus; b++) {
        struct bus *bus = &host->bus[b];

        if (bus->queued) {
            can_send(host->config.port[b], bus->queue, bus->queued);
            bus->queued = 0;
        }
    }
    if (host->config.lockstep) {
        struct bus_frame step = step_frame(host);

        can_send(host->config.port[host->config.lockstep_bus], &step, 1);
        host->step_waits = true;
        host->step_sent_ns = -1;
    }
}

void host_repeat_step(struct host *host, int64_t now_ns)
{
    if (!host->step_waits) {
        return;
    }
    if (host->step_sent_ns < 0) {
        host->step_sent_ns = now_ns;
    }
    if (now_ns - host->step_sent_ns >= 100 * MS) {
        struct bus_frame step = step_frame(host);

        can_send(host->config.port[host->config.lockstep_bus], &step, 1);
        host->step_sent_ns = now_ns;
    }
}

/* ---- start-up ---- */

static void enter(struct host *host, enum host_phase phase)
{
    host->phase = phase;
    host->phase_since_ns = host->now_ns;
    host->phase_entered = true;
}

static enum host_phase fail_node(struct host *host, size_t bus, int address, const char *what)
{
    snprintf(host->message, sizeof host->message, "board %d on %s %s", address,
             host->config.port[bus]->bus, what);
    return host->phase = HOST_FAILED;
}

/* Calls step for every board of ours; true when it was true for all. */
static bool every_node(struct host *host, bool (*step)(struct host *, size_t bus, int address))
{
    bool all = true;

    for (size_t b = 0; b < host->config.nbus; b++) {
        for (int a = 1; a <= ICUB_ADDRESS_MAX; a++) {
            if (host->bus[b].node[a].kind != NODE_NONE && !step(host, b, a)) {
                all = false;
            }
        }
    }
    return all;
}

static bool node_found(struct host *host, size_t bus, int address)
{
    return host->bus[bus].node[address].found;
}

static enum host_phase discover(struct host *host)
{
    static const uint8_t ask[1] = {ICUB_DISCOVER};

    if (host->phase_entered) {
        host->phase_since_ns = host->now_ns;
        for (size_t b = 0; b < host->config.nbus; b++) {
            queue_frame(host, b, icub_id(ICUB_MANAGEMENT, ICUB_HOST, ICUB_EVERYONE), 1, ask);
        }
        host->phase_entered = false;
    }
    if (every_node(host, node_found)) {
        enter(host, HOST_CONFIGURING);
    } else if (host->now_ns - host->phase_since_ns > DISCOVERY_TIMEOUT * MS) {
        for (size_t b = 0; b < host->config.nbus; b++) {
            for (int a = 1; a <= ICUB_ADDRESS_MAX; a++) {
                if (host->bus[b].node[a].kind != NODE_NONE && !host->bus[b].node[a].found) {
                    return fail_node(host, b, a, "does not answer discovery");
                }
            }
        }
    }
    return host->phase;
}

/* The requests that a board gets, one after the other. Returns false when there are no more; *reply
 * says whether an answer is due. */
static bool start_up_request(const struct node *node, int number, uint8_t data[8], uint8_t *len,
                             bool *reply)
{
    memset(data, 0, 8);
    *reply = true;
    if (number == 0) {
        data[0] = node->kind == NODE_MOTOR ? (uint8_t)ICUB_GET_FIRMWARE_VERSION
                                           : (uint8_t)ICUB_STRAIN_GET_FIRMWARE;
        data[1] = ICUB_PROTOCOL_MAJOR;
        data[2] = node->kind == NODE_MOTOR ? ICUB_PROTOCOL_MINOR : 0;
        *len = 3;
        return true;
    }
    if (node->kind == NODE_MOTOR) {
        data[0] = ICUB_SET_BROADCAST_POLICY;
        put_u32_le(data + 1, POLICY);
        *len = 5;
        *reply = false;
        return number == 1;
    }
    *len = 2;
    if (node->kind == NODE_FT && number <= CHANNELS) {
        data[0] = ICUB_STRAIN_GET_FULL_SCALE;
        data[1] = (uint8_t)(number - 1);
        return true;
    }
    number -= node->kind == NODE_FT ? CHANNELS : 0;
    *reply = false;
    data[0] = number == 1 ? ICUB_STRAIN_SET_PERIOD : ICUB_STRAIN_SET_TRANSMIT_MODE;
    data[1] = number == 1 ? 4 : ICUB_STRAIN_CALIBRATED; /* ms, as the motor boards' slots */
    return number <= 2;
}

static bool configure_node(struct host *host, size_t bus, int address)
{
    struct node *node = &host->bus[bus].node[address];
    enum icub_class cls = node->kind == NODE_MOTOR ? ICUB_POLLING_MOTOR : ICUB_POLLING_ANALOG;
    uint8_t data[8], len;
    bool reply;

    if (node->answered < node->requested) {
        if (host->now_ns - node->request_time_ns > REPLY_TIMEOUT * MS) {
            fail_node(host, bus, address, "does not answer a start-up request");
        }
        return false;
    }
    if (!start_up_request(node, node->requested, data, &len, &reply)) {
        return true;
    }
    queue_frame(host, bus, icub_id(cls, ICUB_HOST, (unsigned)address), len, data);
    node->requested++;
    node->answered += !reply;
    node->request_time_ns = host->now_ns;
    return false;
}

static enum host_phase enable(struct host *host)
{
    bool all = true;

    if (host->phase_entered) {
        for (size_t i = 0; i < host->config.naxis; i++) {
            host_set_mode(host, i, ICUB_MODE_OPEN_LOOP);
        }
        host->phase_entered = false;
    }
    for (size_t i = 0; i < host->config.naxis; i++) {
        const struct host_joint *joint = &host->joint[i];
        bool ready =
            joint->mode == ICUB_MODE_OPEN_LOOP && joint->motor_time_ns >= 0 && joint->joint_seen;

        if (!ready && host->now_ns - host->phase_since_ns > ENABLE_TIMEOUT * MS) {
            snprintf(host->message, sizeof host->message,
                     "joint %s did not enter open loop (mode 0x%02X, fault 0x%02X)",
                     host->config.axis[i].joint, joint->mode, joint->fault);
            return host->phase = HOST_FAILED;
        }
        all = all && ready;
    }
    if (all) {
        enter(host, HOST_READY);
    }
    return host->phase;
}

enum host_phase host_start_up(struct host *host)
{
    switch (host->phase) {
    case HOST_DISCOVERING:
        return discover(host);
    case HOST_CONFIGURING:
        if (every_node(host, configure_node) && host->phase == HOST_CONFIGURING) {
            enter(host, HOST_ENABLING);
        }
        return host->phase;
    case HOST_ENABLING:
        return enable(host);
    default:
        return host->phase;
    }
}

/* ---- what others ask ---- */

bool host_healthy(struct host *host)
{
    for (size_t i = 0; i < host->config.naxis && host->phase != HOST_FAILED; i++) {
        const struct host_joint *joint = &host->joint[i];
        const char *name = host->config.axis[i].joint;

        if (joint->mode == ICUB_MODE_HARDWARE_FAULT) {
            snprintf(host->message, sizeof host->message, "joint %s is in fault 0x%02X", name,
                     joint->fault);
            host->phase = HOST_FAILED;
        } else if (host->now_ns - joint->motor_time_ns > TELEMETRY_TIMEOUT * MS) {
            snprintf(host->message, sizeof host->message, "joint %s has gone silent", name);
            host->phase = HOST_FAILED;
        }
    }
    return host->phase != HOST_FAILED;
}

const struct host_joint *host_joint(const struct host *host, size_t axis)
{
    return &host->joint[axis];
}

const struct host_force *host_force(const struct host *host, size_t ft)
{
    return &host->force[ft];
}

const struct host_config *host_configuration(const struct host *host)
{
    return &host->config;
}

int host_find_axis(const struct host *host, const char *joint)
{
    for (size_t i = 0; i < host->config.naxis; i++) {
        if (strcmp(host->config.axis[i].joint, joint) == 0) {
            return (int)i;
        }
    }
    return -1;
}

const char *host_message(const struct host *host)
{
    return host->message;
}
