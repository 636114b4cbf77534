/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to all boards of a described protocol: telemetry period, frames, answers. */
#include "boards/described/private.h"

/* ---- power-up ---- */

bool described_node_power_up(struct described_node *node)
{
    const struct board_config *config = &node->board.config;
    struct described_bus *bus = described_bus_of(node->board.bus);
    int64_t period_ms = config->period_ns > 0 ? config->period_ns / MS : 1;
    bool first = !node->powered;

    node->protocol = node->board.bus->config.described;
    node->kind = described_kind(config->kind);
    node->axes = board_config_axes(config);
    node->powered = true;
    node->started_ns = node->board.boards->now_ns;
    node->sequence = 0;
    for (unsigned axis = 0; axis < DESCRIBED_AXES; axis++) {
        node->axis[axis].state = node->protocol->off_state;
        node->axis[axis].faults = 0;
        node->axis[axis].result = node->protocol->state[node->protocol->off_state].result;
        for (size_t i = 0; i < DESCRIBED_FRAMES_MAX; i++) {
            node->report[axis][i] = (struct described_report){.state = node->protocol->off_state,
                                                              .result = node->axis[axis].result};
        }
    }
    /* A sensor board has no slots and reports first slot 0 */
    node->first_slot = 0;
    while (node->axes > 0 && bus->slot[node->first_slot].node != node) {
        node->first_slot++;
    }
    node->host_number = 0;
    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        int host = described_find_field(frame, DESCRIBED_HOST_NUMBER);

        if (frame->answer_id) {
            node->answer_id =
                described_id(frame, frame->by == DESCRIBED_BY_ADDRESS ? node->board.address : 0);
        }
        node->host_number =
            !frame->from_host && host >= 0 ? (uint32_t)frame->field[host].host : node->host_number;
    }
    described_bus_forget_counts(bus, node);
    /* Without transmit_at_start, a period that the host can set starts at 0: no telemetry */
    described_node_set_period(
        node, node->protocol->period_settable && !config->transmit_at_start ? 0 : period_ms);
    return first;
}

void described_node_set_period(struct described_node *node, int64_t period_ms)
{
    node->telemetry_ms = period_ms;
    node->next_ns = node->board.boards->now_ns + period_ms * MS;
}

/* ---- frames ---- */

/* Returns the parameter that a request reads; NULL = none. */
static const struct described_field *described_node_parameter(const struct described_node *node,
                                                              const struct described_frame *request,
                                                              const int64_t *values)
{
    int number = request ? described_find_field(request, DESCRIBED_PARAMETER) : -1;
    const struct described_parameter *parameter =
        number < 0 ? NULL : described_find_parameter(node->protocol, values[number]);

    return parameter ? &parameter->field : NULL;
}

/* Returns a field that has a factor, with the present value of the factor. */
static struct described_field described_node_field(const struct described_node *node, unsigned axis,
                                                   const struct described_field *field)
{
    const struct described_parameter *factor = &node->protocol->parameter[field->times];

    return node->axes == 0
               ? described_model_field(node->protocol, 0, field)
               : described_scaled(
                     field, described_value(&factor->field, node->stored[axis][field->times]));
}

double described_node_value(const struct described_node *node, unsigned axis,
                            const struct described_field *field, int64_t count)
{
    struct described_field now;

    if (field->times < 0) {
        return described_value(field, count);
    }
    now = described_node_field(node, axis, field);
    return described_value(&now, count);
}

/* Returns the state that an axis reports: its own state, or the fault state while it is off. */
static const struct described_state *described_reported_state(const struct described_node *node,
                                                              const struct described_axis *axis)
{
    const struct described_protocol *protocol = node->protocol;
    const uint32_t faults = axis->faults & DESCRIBED_FATAL;
    int fault = axis->state == protocol->off_state && faults
                    ? protocol->fault_for[__builtin_ctz(faults)]
                    : -1;

    return &protocol->state[fault < 0 ? axis->state : fault];
}

/* Returns the count of a field that has a factor (described_node_count). noinline: the copy of the
 * field costs other fields a tenth of their count. */
__attribute__((noinline)) static int64_t
described_scaled_count(const struct described_node *node, unsigned axis,
                       const struct described_field *field, const struct described_frame *request,
                       const int64_t *values)
{
    struct described_field now = described_node_field(node, axis, field);

    now.times = -1;
    return described_node_count(node, axis, &now, request, values);
}

int64_t described_node_count(const struct described_node *node, unsigned index,
                             const struct described_field *field,
                             const struct described_frame *request, const int64_t *values)
{
    const struct described_protocol *protocol = node->protocol;
    const struct board_axis_config *config = &node->board.config.axis[index];
    const struct described_axis *axis = &node->axis[index];
    const double supply_v = node->board.boards->supply_v;
    const struct described_state *reported;
    const struct described_field *parameter;
    int32_t motor = 0, link = 0;
    int echoed;
    double value;

    if (field->times >= 0 && field->meaning != DESCRIBED_STORED) {
        return described_scaled_count(node, index, field, request, values);
    }
    switch (field->meaning) {
    /* Identity */
    case DESCRIBED_NOTHING:
        return 0;
    case DESCRIBED_CONSTANT:
        return field->constant;
    case DESCRIBED_STORED:
        return node->stored[index][container_of(field, struct described_parameter, field) -
                                   protocol->parameter];
    case DESCRIBED_PARAMETER_VALUE:
        /* in the type of the parameter's own field */
        parameter = described_node_parameter(node, request, values);
        return parameter
                   ? described_node_count(node, index, parameter, request, values) & UINT32_MAX
                   : 0;
    case DESCRIBED_HOST_NUMBER:
        return node->host_number;
    case DESCRIBED_ANSWER_ID:
        return node->answer_id;
    case DESCRIBED_ECHO:
        echoed = request && field->constant >= 0 ? request->echo[field->constant] : -1;
        return echoed < 0 ? (int64_t)field->host : values[echoed];
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
    case DESCRIBED_SERIAL:
        return (uint32_t)hash_bytes(HASH_START, node->board.config.name,
                                    strlen(node->board.config.name));
    /* States, faults and counts */
    case DESCRIBED_STATE:
        return described_reported_state(node, axis)->value;
    case DESCRIBED_RESULT:
        reported = described_reported_state(node, axis);
        return reported == &protocol->state[axis->state] ? axis->result : reported->result;
    case DESCRIBED_LAW:
        return node->kind == DESCRIBED_MOTOR && protocol->nlaw ? protocol->law[axis->law].value : 0;
    case DESCRIBED_FAULTS:
        return described_fault_bits(protocol, axis->faults);
    case DESCRIBED_LATCHED_FAULTS:
        return described_fault_bits(protocol, axis->latched);
    case DESCRIBED_FAULT_BIT:
        return axis->faults >> field->constant & 1;
    case DESCRIBED_FAULTY:
        return (axis->faults & DESCRIBED_FATAL) != 0;
    case DESCRIBED_SATURATED:
        return node->saturated;
    case DESCRIBED_SEQUENCE:
        return described_wrap(field, node->sequence);
    case DESCRIBED_COMMANDS:
        return described_wrap(field, axis->commands);
    /* The board */
    case DESCRIBED_SUPPLY:
        return described_count(field, supply_v);
    case DESCRIBED_UPTIME:
        value = (double)(node->board.boards->now_ns - node->started_ns) * 1e-9;
        return described_count(field, value);
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(field, (double)node->telemetry_ms * 1e-3);
    /* Sensors of an axis */
    case DESCRIBED_MOTOR_POSITION:
        value = axis->base.motor_rad - axis->zero_rad;
        break;
    case DESCRIBED_LINK_POSITION:
        value = axis->base.link_rad - axis->zero_rad;
        break;
    case DESCRIBED_DEFLECTION:
        /* subtract counts, so that a host can compute the link's exact count */
        control_quantize(axis->base.motor_rad / field->scale, &motor);
        control_quantize(axis->base.link_rad / field->scale, &link);
        return (int64_t)motor - link;
    case DESCRIBED_MOTOR_VELOCITY:
        value = axis->base.velocity_rad_s;
        break;
    case DESCRIBED_AXIS_CURRENT:
        value = axis->base.current_a * axis_gain_or_1(config->current_gain);
        break;
    case DESCRIBED_AXIS_TORQUE:
        value =
            axis->base.torque_nm * axis_gain_or_1(config->torque_gain) + config->torque_offset_nm;
        break;
    case DESCRIBED_DRIVE_TORQUE:
        value = axis->base.current_a * config->torque_nm_a * axis_gain_or_1(config->torque_gain) +
                config->torque_offset_nm;
        break;
    case DESCRIBED_PISTON_PRESSURE:
    case DESCRIBED_ROD_PRESSURE:
        value = axis->base.pressure_pa[field->meaning - DESCRIBED_PISTON_PRESSURE] * 1e-5;
        break;
    case DESCRIBED_VALVE_OPENING:
        value = axis->base.valve_opening;
        break;
    /* Targets and outputs of an axis */
    case DESCRIBED_AXIS_VOLTAGE:
        value = axis->base.voltage_v;
        break;
    case DESCRIBED_AXIS_DUTY:
        value = supply_v > 0.0 ? axis->base.voltage_v / supply_v : 0.0;
        break;
    case DESCRIBED_CURRENT_TARGET:
        value = axis_wanted_current(&axis->base) * axis_gain_or_1(config->current_gain);
        break;
    case DESCRIBED_TORQUE_TARGET:
        value = axis_wanted_current(&axis->base) * config->torque_nm_a *
                axis_gain_or_1(config->torque_gain);
        break;
    case DESCRIBED_ELECTRICAL_POWER:
        value = described_axis_runs(axis) ? axis->base.voltage_v * axis->base.current_a : 0.0;
        break;
    case DESCRIBED_MECHANICAL_POWER:
        value = axis->base.current_a * config->torque_nm_a * axis->base.velocity_rad_s;
        break;
    case DESCRIBED_SUPPLY_CURRENT:
        value = supply_v > 0.0 && described_axis_runs(axis)
                    ? axis->base.voltage_v * axis->base.current_a / supply_v
                    : 0.0;
        break;
    /* Settings of an axis */
    /* the value that the host wrote, even above the limit of the drive */
    case DESCRIBED_CURRENT_LIMIT:
        value = axis->setting[DESCRIBED_CURRENT_LIMIT - DESCRIBED_SETTING];
        value = isfinite(value) ? value : described_axis_current_limit(node, index);
        break;
    case DESCRIBED_VELOCITY_LIMIT:
    case DESCRIBED_POSITION_GAIN:
    case DESCRIBED_VELOCITY_GAIN:
    case DESCRIBED_INTEGRAL_GAIN:
    case DESCRIBED_COMMAND_TIMEOUT:
    case DESCRIBED_POSITION_SPEED_LIMIT:
        value = axis->setting[field->meaning - DESCRIBED_SETTING];
        break;
    case DESCRIBED_TEMPERATURE:
        if (node->kind == DESCRIBED_MOTOR) {
            return described_count(field, axis->temperature_c);
        }
        return described_count(field, PLANT_AMBIENT_C);
    case DESCRIBED_AMBIENT:
        return described_count(field, PLANT_AMBIENT_C);
    default:
        if (field->meaning >= DESCRIBED_SET_POINT && field->meaning < DESCRIBED_TARGETS_END) {
            value = axis->target[field->meaning - DESCRIBED_SET_POINT];
            break;
        }
        /* Channels of a sensor */
        return node->kind != DESCRIBED_MOTOR && field->meaning >= DESCRIBED_CHANNEL
                   ? described_count(field, node->channel[field->meaning - DESCRIBED_CHANNEL])
                   : 0;
    }
    if (field->wraps && fabs(value) < 1e6) {
        return llrint((value - field->offset) / field->scale); /* described_node_fill wraps it */
    }
    return node->kind == DESCRIBED_MOTOR ? described_count(field, value) : 0;
}

/* Fills a zeroed frame for one axis, or for all axes if the frame repeats its fields. request: the
 * frame to be answered; NULL = no answer. */
static void described_node_fill(struct described_node *node, unsigned axis, size_t index,
                                const struct described_frame *request, const int64_t *values,
                                struct bus_frame *out)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    unsigned parts = frame->repeats > 1 ? node->axes : 1;
    unsigned number = frame->by == DESCRIBED_BY_ADDRESS ? node->board.address
                      : frame->by == DESCRIBED_BY_SLOT  ? node->first_slot + axis
                                                        : 0;

    out->id = frame->answer_id ? node->answer_id : described_id(frame, number);
    out->flags = frame->flags;
    out->len = described_length(frame, parts);
    for (unsigned part = 0; part < parts; part++) {
        for (size_t i = 0; i < frame->nfield; i++) {
            const struct described_field *field = &frame->field[i];
            /* field->axis selects another axis of the board */
            unsigned of = axis + part + field->axis;
            int64_t count = of < node->axes || of == 0
                                ? described_node_count(node, of, field, request, values)
                                : 0;

            count = field->wraps ? described_signed(field, (uint64_t)count) : count;
            described_put(field, count, part * frame->length, out);
        }
    }
    if (frame->counter >= 0) {
        uint32_t *sent = &node->report[frame->by == DESCRIBED_BY_SLOT ? axis : 0][index].sent;
        const struct described_field *field = &frame->field[frame->counter];

        described_put(field, described_wrap(field, (*sent)++), 0, out);
    }
    described_close(frame, out->data);
}

void described_node_answer(struct described_node *node, unsigned axis, size_t index,
                           const struct described_frame *request, const int64_t *values)
{
    struct bus_frame out = {0};

    described_node_fill(node, axis, index, request, values, &out);
    board_queue_as(&node->board, out.id, out.flags, out.len, out.data);
}

/* Returns how many frames of a row a node sends: one per axis, or one per board. */
static unsigned described_frame_copies(const struct described_node *node,
                                       const struct described_frame *frame)
{
    return frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;
}

void described_node_announce(struct described_node *node)
{
    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        unsigned count =
            frame->on_restart && frame->of & node->kind ? described_frame_copies(node, frame) : 0;

        for (unsigned axis = 0; axis < count; axis++) {
            described_node_answer(node, axis, i, NULL, NULL);
        }
    }
}

/* ---- periodic frames ---- */

/* Sends a periodic frame and stores the state that it reports. */
static void described_node_send(struct described_node *node, unsigned axis, size_t index,
                                struct frame_sink *sink)
{
    struct described_report *report = &node->report[axis][index];
    struct bus_frame lost = {0}, *frame = board_add_frame(&node->board, sink);

    report->state = node->axis[axis].state;
    report->result = node->axis[axis].result;
    report->faults = node->axis[axis].faults;
    described_node_fill(node, axis, index, NULL, NULL, frame ? frame : &lost);
}

/* Returns whether a frame outside the telemetry is due. It is due when state or faults have changed
 * since its last report. It is also due when the span contains a multiple of its period, delayed by
 * its spread. */
static bool described_frame_due(const struct described_node *node, unsigned axis,
                                const struct described_frame *frame,
                                const struct described_report *report, struct ms_span span)
{
    int64_t number = frame->by == DESCRIBED_BY_SLOT ? node->first_slot + axis : node->board.address;
    int64_t period_ms = frame->period_ns / MS, since_ms;

    if (frame->on_change &&
        (report->state != node->axis[axis].state || report->faults != node->axis[axis].faults ||
         report->result != node->axis[axis].result)) {
        return true;
    }
    if (frame->on_fault && node->axis[axis].faults & ~report->faults & DESCRIBED_FATAL) {
        return true;
    }
    if (period_ms == 0 || (frame->optional && !node->board.config.transmit_at_start)) {
        return false;
    }
    since_ms = (span.to - 1 - number * frame->spread_ms) % period_ms;
    return (since_ms < 0 ? since_ms + period_ms : since_ms) < span.to - span.from;
}

void described_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct described_node *node = described_node_of(board);
    const struct described_protocol *protocol = node->protocol;
    const struct described_schedule *telemetry =
        &protocol->telemetry[described_kind_index(node->kind)];
    const struct described_schedule *other = &protocol->other[described_kind_index(node->kind)];
    bool lost = board->lost_in_status, told = false;

    /* Send a frame by slot once per axis, any other frame once per board */
    if (node->telemetry_ms > 0 && board_is_due(board, &node->next_ns, node->telemetry_ms * MS)) {
        for (size_t i = 0; i < telemetry->count; i++) {
            size_t index = telemetry->frame[i];
            unsigned count = described_frame_copies(node, &protocol->frame[index]);

            for (unsigned axis = 0; axis < count; axis++) {
                described_node_send(node, axis, index, sink);
            }
        }
        node->sequence++;
    }
    for (size_t i = 0; i < other->count; i++) {
        size_t index = other->frame[i];
        const struct described_frame *frame = &protocol->frame[index];
        unsigned count = described_frame_copies(node, frame);

        for (unsigned axis = 0; axis < count; axis++) {
            const struct described_report *report = &node->report[axis][index];

            if (!frame->telemetry && described_frame_due(node, axis, frame, report, span)) {
                described_node_send(node, axis, index, sink);
            }
            if (frame->on_change) {
                told = report->faults >> DESCRIBED_OVERFLOW & 1;
                lost = lost && told;
            }
        }
    }
    /* Clear the lost-frames fault when every frame with on_change has reported it */
    if (lost && told) {
        board->lost_in_status = board->lost_in_overflow = false;
    }
}
