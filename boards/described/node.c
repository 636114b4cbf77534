/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to all boards of a described protocol: telemetry period, frames, answers. */
#include "boards/described/private.h"

#include "base/hash.h"

#include <string.h>

/* ---- power-up ---- */

/* Finds the first slot of a node; 0 for sensors. */
static void described_node_find_slot(struct described_node *node)
{
    const struct described_bus *bus = described_bus_of(node->board.bus);
    unsigned slot = 0;

    while (slot < bus->slots && bus->slot[slot].node != node) {
        slot++;
    }
    node->first_slot = slot < bus->slots ? slot : 0;
}

struct board *described_node_create(struct arena *arena, const struct board_ops *ops, unsigned kind)
{
    struct described_node *node = arena_alloc(arena, 1, sizeof *node);

    if (!node) {
        return NULL;
    }
    node->board.ops = ops;
    node->kind = kind;
    return &node->board;
}

bool described_node_power_up(struct described_node *node)
{
    const struct board_config *config = &node->board.config;
    int64_t period_ms = config->period_ns > 0 ? config->period_ns / MS : 1;
    bool first = !node->powered;

    /* If the host sets the period, it is 0 at first, unless the rig gives one */
    node->protocol = node->board.bus->config.described;
    node->axes = board_config_axes(config);
    node->powered = true;
    node->started_ns = node->board.boards->now_ns;
    node->sequence = 0;
    for (unsigned axis = 0; axis < DESCRIBED_AXES; axis++) {
        node->axis[axis].state = node->protocol->off_state;
        node->axis[axis].faults = 0;
        for (size_t i = 0; i < DESCRIBED_FRAMES_MAX; i++) {
            node->report[axis][i] = (struct described_report){.state = node->protocol->off_state};
        }
    }
    described_node_find_slot(node);
    described_bus_forget_counts(described_bus_of(node->board.bus), node);
    described_node_set_period(
        node, node->protocol->period_settable && !config->transmit_at_start ? 0 : period_ms);
    return first;
}

void described_node_set_period(struct described_node *node, int64_t period_ms)
{
    node->telemetry_ms = period_ms;
    node->next_ns = node->board.boards->now_ns + period_ms * MS;
}

/* Returns whether telemetry is due, and sets the next time. */
static bool described_node_due(struct described_node *node)
{
    int64_t period_ns = node->telemetry_ms * MS;
    int64_t late = node->board.boards->now_ns - node->next_ns;

    if (period_ns == 0 || late < 0) {
        return false;
    }
    node->next_ns += (late / period_ns + 1) * period_ns;
    return true;
}

/* ---- frames ---- */

/* A frame to send. */
struct described_out {
    uint32_t id;
    uint8_t length, data[DESCRIBED_LENGTH_MAX];
};

/* Returns the bits of the parameter that a request reads. */
static int64_t described_node_parameter(const struct described_node *node, unsigned axis,
                                        const struct described_frame *request,
                                        const int64_t *values);

/* Returns the count of a motor axis's field. */
static int64_t described_axis_count(const struct described_node *node, unsigned index,
                                    const struct described_field *field)
{
    const struct board_axis_config *config = &node->board.config.axis[index];
    const struct described_axis *axis = &node->axis[index];
    double bridge_v = described_axis_runs(axis) ? axis->base.voltage_v : 0.0, value;
    int32_t motor = 0, link = 0;

    switch (field->meaning) {
    /* Sensors */
    case DESCRIBED_MOTOR_POSITION:
        value = axis->base.motor_rad - axis->zero_rad;
        break;
    case DESCRIBED_LINK_POSITION:
        value = axis->base.link_rad - axis->zero_rad;
        break;
    case DESCRIBED_DEFLECTION:
        /* difference of counts, so that a host gets the link's exact count */
        control_quantize(axis->base.motor_rad / field->scale, &motor);
        control_quantize(axis->base.link_rad / field->scale, &link);
        return (int64_t)motor - link;
    case DESCRIBED_MOTOR_VELOCITY:
        value = axis->base.velocity_rad_s;
        break;
    case DESCRIBED_AXIS_CURRENT:
        value = axis->base.current_a;
        break;
    case DESCRIBED_AXIS_TORQUE:
        value = axis->base.torque_nm;
        break;
    case DESCRIBED_DRIVE_TORQUE:
        value = axis->base.current_a * config->torque_nm_a;
        break;
    case DESCRIBED_PISTON_PRESSURE:
    case DESCRIBED_ROD_PRESSURE:
        value = axis->base.pressure_pa[field->meaning - DESCRIBED_PISTON_PRESSURE] * 1e-5;
        break;
    case DESCRIBED_VALVE_OPENING:
        value = axis->base.valve_opening;
        break;
    case DESCRIBED_TEMPERATURE:
        value = axis->temperature_c;
        break;
    /* Targets and outputs */
    case DESCRIBED_AXIS_VOLTAGE:
        value = axis->base.voltage_v;
        break;
    case DESCRIBED_AXIS_DUTY:
        value = node->board.boards->supply_v > 0.0
                    ? axis->base.voltage_v / node->board.boards->supply_v
                    : 0.0;
        break;
    case DESCRIBED_CURRENT_TARGET:
        value = axis->wanted_a;
        break;
    case DESCRIBED_TORQUE_TARGET:
        value = axis->wanted_a * config->torque_nm_a;
        break;
    case DESCRIBED_ELECTRICAL_POWER:
        value = bridge_v * axis->base.current_a;
        break;
    case DESCRIBED_MECHANICAL_POWER:
        value = axis->base.current_a * config->torque_nm_a * axis->base.velocity_rad_s;
        break;
    case DESCRIBED_SUPPLY_CURRENT:
        value = node->board.boards->supply_v > 0.0
                    ? bridge_v * axis->base.current_a / node->board.boards->supply_v
                    : 0.0;
        break;
    /* Settings and state */
    case DESCRIBED_CURRENT_LIMIT:
        value = described_axis_current_limit(node, index);
        break;
    case DESCRIBED_VELOCITY_LIMIT:
    case DESCRIBED_POSITION_GAIN:
    case DESCRIBED_VELOCITY_GAIN:
    case DESCRIBED_INTEGRAL_GAIN:
        value = axis->setting[field->meaning - DESCRIBED_SETTING];
        break;
    case DESCRIBED_LAW:
        return node->protocol->nlaw ? node->protocol->law[axis->law].value : 0;
    case DESCRIBED_COMMANDS:
        return described_wrap(field, axis->commands);
    case DESCRIBED_LATCHED_FAULTS:
        return described_fault_bits(node->protocol, axis->latched);
    default:
        return 0;
    }
    return described_count(field, value);
}

/* Returns the count of a field for an axis; request: the frame that it answers, or NULL. */
static int64_t described_node_count(const struct described_node *node, unsigned index,
                                    const struct described_field *field,
                                    const struct described_frame *request, const int64_t *values)
{
    const struct described_protocol *protocol = node->protocol;
    const struct described_axis *axis = &node->axis[index];
    double value;

    switch (field->meaning) {
    case DESCRIBED_NOTHING:
        return 0;
    case DESCRIBED_CONSTANT:
        return field->constant;
    case DESCRIBED_ECHO:
        return request && field->constant >= 0 && (size_t)field->constant < request->nfield
                   ? values[field->constant]
                   : 0;
    case DESCRIBED_ADDRESS:
        return node->board.address;
    case DESCRIBED_AXIS:
        return index;
    case DESCRIBED_SLOT:
        return node->first_slot + index;
    case DESCRIBED_FIRST_SLOT:
        return node->first_slot;
    case DESCRIBED_AXES_COUNT:
        return node->axes;
    case DESCRIBED_STATE:
        return protocol->state[axis->state].value;
    case DESCRIBED_RESULT:
        return protocol->state[axis->state].result;
    case DESCRIBED_PARAMETER_VALUE:
        return described_node_parameter(node, index, request, values);
    case DESCRIBED_SERIAL:
        return (uint32_t)hash_bytes(HASH_START, node->board.config.name,
                                    strlen(node->board.config.name));
    case DESCRIBED_FAULTS:
        return described_fault_bits(protocol, axis->faults);
    case DESCRIBED_FAULTY:
        return (axis->faults & DESCRIBED_FATAL) != 0;
    case DESCRIBED_SEQUENCE:
        return described_wrap(field, node->sequence);
    case DESCRIBED_SUPPLY:
        return described_count(field, node->board.boards->supply_v);
    case DESCRIBED_UPTIME:
        value = (double)(node->board.boards->now_ns - node->started_ns) * 1e-9;
        return described_count(field, value);
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(field, (double)node->telemetry_ms * 1e-3);
    default:
        break;
    }
    /* A motor board has no channels, a sensor no axis */
    if (node->kind == DESCRIBED_MOTOR) {
        return described_axis_count(node, index, field);
    }
    if (field->meaning >= DESCRIBED_CHANNEL) {
        return described_count(field, node->channel[field->meaning - DESCRIBED_CHANNEL]);
    }
    return field->meaning == DESCRIBED_SATURATED ? node->saturated : 0;
}

static int64_t described_node_parameter(const struct described_node *node, unsigned axis,
                                        const struct described_frame *request,
                                        const int64_t *values)
{
    int number = request ? described_find_field(request, DESCRIBED_PARAMETER) : -1;
    const struct described_parameter *parameter =
        number < 0 ? NULL : described_find_parameter(node->protocol, values[number]);

    return parameter ? described_node_count(node, axis, &parameter->field, NULL, NULL) & UINT32_MAX
                     : 0;
}

/* Writes a frame for an axis, or for all axes if the frame repeats its fields; as an answer if
 * there is a request. */
static void described_node_fill(struct described_node *node, unsigned axis, size_t index,
                                const struct described_frame *request, const int64_t *values,
                                struct described_out *out)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    unsigned parts = frame->repeats > 1 ? node->axes : 1;
    unsigned number = frame->by == DESCRIBED_BY_ADDRESS ? node->board.address
                      : frame->by == DESCRIBED_BY_SLOT  ? node->first_slot + axis
                                                        : 0;

    *out = (struct described_out){.id = described_id(frame, number),
                                  .length = described_length(frame, parts)};
    for (unsigned part = 0; part < parts; part++) {
        for (size_t i = 0; i < frame->nfield; i++) {
            const struct described_field *field = &frame->field[i];
            unsigned of = axis + part + field->axis; /* a field may belong to another axis */
            int64_t count = 0;

            if (field->meaning == DESCRIBED_COUNTER) {
                uint32_t *sent =
                    &node->report[frame->by == DESCRIBED_BY_SLOT ? axis : 0][index].sent;

                count = described_wrap(field, (*sent)++);
            } else if (of < node->axes || of == 0) {
                count = described_node_count(node, of, field, request, values);
            }
            described_put(field, count, part * frame->length, out->data, &out->id);
        }
    }
    described_close(frame, out->data);
}

/* Queues a frame as an answer. */
static void described_node_queue(struct described_node *node, unsigned axis, size_t index,
                                 const struct described_frame *request, const int64_t *values)
{
    struct described_out out;

    described_node_fill(node, axis, index, request, values, &out);
    board_queue_as(&node->board, out.id, node->protocol->frame[index].flags, out.length, out.data);
}

void described_node_reply(struct described_node *node, unsigned axis,
                          const struct described_frame *request, const int64_t *values)
{
    int reply = request->reply[described_kind_index(node->kind)];

    if (reply >= 0) {
        described_node_queue(node, axis, (size_t)reply, request, values);
    }
}

void described_node_announce(struct described_node *node)
{
    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        unsigned count = frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;

        for (unsigned axis = 0; frame->on_restart && frame->of & node->kind && axis < count;
             axis++) {
            described_node_queue(node, axis, i, NULL, NULL);
        }
    }
}

/* ---- periodic frames ---- */

/* Returns whether a time of a period's grid, delayed by after_ms, is in the span. */
static bool described_grid_due(struct ms_span span, int64_t period_ms, int64_t after_ms)
{
    int64_t shift = 2 * period_ms - 1 - after_ms % period_ms;

    return (span.to + shift) / period_ms > (span.from + shift) / period_ms;
}

/* Sends a periodic frame and stores the state that it reports. */
static void described_node_send(struct described_node *node, unsigned axis, size_t index,
                                struct frame_sink *sink)
{
    struct described_report *report = &node->report[axis][index];
    struct described_out out;

    report->state = node->axis[axis].state;
    report->faults = node->axis[axis].faults;
    described_node_fill(node, axis, index, NULL, NULL, &out);
    board_send_as(&node->board, sink, out.id, node->protocol->frame[index].flags, out.length,
                  out.data);
}

/* Returns whether a frame other than telemetry is due: by its period, or because state or faults
 * have changed since its last report. */
static bool described_frame_due(const struct described_node *node, unsigned axis, size_t index,
                                struct ms_span span)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    const struct described_report *report = &node->report[axis][index];
    int64_t number = frame->by == DESCRIBED_BY_SLOT ? node->first_slot + axis : node->board.address;

    if (frame->telemetry) {
        return false;
    }
    return (frame->period_ns > 0 &&
            described_grid_due(span, frame->period_ns / MS, number * frame->spread_ms)) ||
           (frame->on_change &&
            (report->state != node->axis[axis].state || report->faults != node->axis[axis].faults));
}

void described_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct described_node *node = described_node_of(board);
    const struct described_protocol *protocol = node->protocol;
    const struct described_schedule *telemetry =
        &protocol->telemetry[described_kind_index(node->kind)];
    const struct described_schedule *other = &protocol->other[described_kind_index(node->kind)];
    bool lost = board->lost_in_status, told = false;

    /* Frames by slot are sent once per axis, each at its own time */
    if (described_node_due(node)) {
        for (size_t i = 0; i < telemetry->count; i++) {
            size_t index = telemetry->frame[i];
            unsigned count = protocol->frame[index].by == DESCRIBED_BY_SLOT ? node->axes : 1;

            for (unsigned axis = 0; axis < count; axis++) {
                described_node_send(node, axis, index, sink);
            }
        }
        node->sequence++;
    }
    for (size_t i = 0; i < other->count; i++) {
        size_t index = other->frame[i];
        const struct described_frame *frame = &protocol->frame[index];
        unsigned count = frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;

        for (unsigned axis = 0; axis < count; axis++) {
            if (described_frame_due(node, axis, index, span)) {
                described_node_send(node, axis, index, sink);
            }
            if (frame->on_change) {
                told = node->report[axis][index].faults >> DESCRIBED_OVERFLOW & 1;
                lost = lost && told;
            }
        }
    }
    /* Clear the lost-frames fault after every frame on changes has reported it */
    if (lost && told) {
        board->lost_in_status = board->lost_in_overflow = false;
    }
}
