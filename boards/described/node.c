/* SPDX-License-Identifier: Apache-2.0 */
/* Services of every board of a described protocol: its telemetry period, its frames, its
 * answers. */
#include "boards/described/private.h"

#include "base/hash.h"

#include <string.h>

/* ---- power-up ---- */

/* Finds the first slot of a node; sensors have 0. */
static void described_node_find_slot(struct described_node *node)
{
    const struct described_bus *bus = described_bus_of(node->board.bus);
    unsigned slot = 0;

    while (slot < bus->slots && &bus->slot[slot].motor->node != node) {
        slot++;
    }
    node->first_slot = slot < bus->slots ? slot : 0;
}

bool described_node_power_up(struct described_node *node)
{
    const struct board_config *config = &node->board.config;
    int64_t period_ms = config->period_ns > 0 ? config->period_ns / MS : 1;
    bool first = !node->powered;

    /* A period that the host sets is 0 before, unless the rig gives another */
    node->protocol = node->board.bus->config.described;
    node->axes = board_config_axes(config);
    node->powered = true;
    node->started_ns = node->board.boards->now_ns;
    node->sequence = 0;
    for (unsigned axis = 0; axis < DESCRIBED_AXES; axis++) {
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

/* Returns whether telemetry is due, and moves on to the next time. */
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

/* Returns the faults of an axis or a sensor. */
static uint32_t described_node_faults(const struct described_node *node, unsigned axis)
{
    return node->ops->faults(node, axis);
}

/* Returns the value of a field of a request. */
static int64_t described_echo(const struct described_frame *request, const int64_t *values,
                              int64_t field)
{
    return request && field >= 0 && (size_t)field < request->nfield ? values[field] : 0;
}

static int64_t described_node_count(const struct described_node *node, unsigned axis,
                                    const struct field *layout, const struct described_field *field,
                                    const struct described_frame *request, const int64_t *values);

/* Returns the bits of the parameter that a request asks for. */
static int64_t described_node_parameter(const struct described_node *node, unsigned axis,
                                        const struct described_frame *request,
                                        const int64_t *values)
{
    int number = request ? described_find_field(request, DESCRIBED_PARAMETER) : -1;
    const struct described_parameter *parameter =
        number < 0 ? NULL : described_find_parameter(node->protocol, values[number]);

    return parameter ? described_node_count(node, axis, &parameter->layout, &parameter->field, NULL,
                                            NULL) &
                           UINT32_MAX
                     : 0;
}

/* Returns the count of a field of a frame about an axis; request: the frame that it answers, if
 * any. */
static int64_t described_node_count(const struct described_node *node, unsigned axis,
                                    const struct field *layout, const struct described_field *field,
                                    const struct described_frame *request, const int64_t *values)
{
    const struct described_protocol *protocol = node->protocol;
    double value = 0.0;
    int64_t count = 0;

    /* Fields that every kind of node has */
    switch (field->meaning) {
    case DESCRIBED_NOTHING:
        return 0;
    case DESCRIBED_CONSTANT:
        return field->constant;
    case DESCRIBED_ECHO:
        return described_echo(request, values, field->constant);
    case DESCRIBED_ADDRESS:
        return node->board.address;
    case DESCRIBED_AXIS:
        return axis;
    case DESCRIBED_SLOT:
        return node->first_slot + axis;
    case DESCRIBED_FIRST_SLOT:
        return node->first_slot;
    case DESCRIBED_AXES_COUNT:
        return node->axes;
    case DESCRIBED_STATE:
        return protocol->state[node->ops->state(node, axis)].value;
    case DESCRIBED_RESULT:
        return protocol->state[node->ops->state(node, axis)].result;
    case DESCRIBED_PARAMETER_VALUE:
        return described_node_parameter(node, axis, request, values);
    case DESCRIBED_SERIAL:
        return (uint32_t)hash_bytes(HASH_START, node->board.config.name,
                                    strlen(node->board.config.name));
    case DESCRIBED_FAULTS:
        return described_fault_bits(protocol, described_node_faults(node, axis));
    case DESCRIBED_FAULTY:
        return (described_node_faults(node, axis) & DESCRIBED_FATAL) != 0;
    case DESCRIBED_SEQUENCE:
        return described_wrap(layout, node->sequence);
    case DESCRIBED_SUPPLY:
        return described_count(layout, field, node->supply_v);
    case DESCRIBED_UPTIME:
        return described_count(layout, field,
                               (double)(node->board.boards->now_ns - node->started_ns) * 1e-9);
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(layout, field, (double)node->telemetry_ms * 1e-3);
    default:
        break;
    }
    /* Fields of this kind of node */
    if (!node->ops->source(node, axis, field, &value, &count)) {
        return described_count(layout, field, value);
    }
    return field->meaning == DESCRIBED_COMMANDS ? described_wrap(layout, (uint32_t)count) : count;
}

/* Fills the counts of the fields of one layout, which begin at the index first. */
static void described_node_count_fields(const struct described_node *node, unsigned axis,
                                        const struct described_frame *frame,
                                        const struct field *layout, size_t first, size_t end,
                                        const struct described_frame *request,
                                        const int64_t *values, int64_t *counts)
{
    /* A frame that tells of several axes says with each field which */
    for (size_t i = first; i < end; layout++) {
        if (!(layout->type & FIELD_PADDING)) {
            unsigned of = axis + frame->field[i].axis;

            counts[i] =
                of < node->axes || of == 0
                    ? described_node_count(node, of, layout, &frame->field[i], request, values)
                    : 0;
            i++;
        }
    }
}

/* Writes a frame about an axis, as an answer if there is a request; returns the identifier. */
static uint32_t described_node_fill(struct described_node *node, unsigned axis, size_t index,
                                    const struct described_frame *request, const int64_t *values,
                                    uint8_t *data)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    unsigned number = frame->by == DESCRIBED_BY_ADDRESS ? node->board.address
                      : frame->by == DESCRIBED_BY_SLOT  ? node->first_slot + axis
                                                        : 0;
    int64_t counts[DESCRIBED_FIELDS_MAX];

    described_node_count_fields(node, axis, frame, frame->layout, 0, frame->ndata, request, values,
                                counts);
    described_node_count_fields(node, axis, frame, frame->id_layout, frame->ndata, frame->nfield,
                                request, values, counts);
    if (frame->counter >= 0) {
        counts[frame->counter] =
            described_wrap(described_layout(frame, (size_t)frame->counter),
                           node->report[frame->by == DESCRIBED_BY_SLOT ? axis : 0][index].sent++);
    }
    return described_encode(frame, number, counts, data);
}

/* Queues a frame as an answer. */
static void described_node_queue(struct described_node *node, unsigned axis, size_t index,
                                 const struct described_frame *request, const int64_t *values)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    uint8_t data[DESCRIBED_LENGTH_MAX];
    uint32_t id;

    memset(data, 0, frame->length);
    id = described_node_fill(node, axis, index, request, values, data);
    board_queue_as(&node->board, id, frame->flags, frame->length, data);
}

void described_node_reply(struct described_node *node, unsigned axis,
                          const struct described_frame *request, const int64_t *values)
{
    unsigned kind = node->ops->kind >> 1; /* 0, 1, 2 */

    if (request->reply[kind] >= 0) {
        described_node_queue(node, axis, (size_t)request->reply[kind], request, values);
    }
}

void described_node_announce(struct described_node *node)
{
    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        unsigned count = frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;

        for (unsigned axis = 0; frame->on_restart && frame->of & node->ops->kind && axis < count;
             axis++) {
            described_node_queue(node, axis, i, NULL, NULL);
        }
    }
}

/* ---- periodic frames ---- */

/* Returns whether a time on the grid of a period, so many milliseconds later, is in the span. */
static bool described_grid_due(struct ms_span span, int64_t period_ms, int64_t after_ms)
{
    int64_t shift = 2 * period_ms - 1 - after_ms % period_ms;

    return (span.to + shift) / period_ms > (span.from + shift) / period_ms;
}

/* Sends a periodic frame and notes the state that it tells. */
static void described_node_send(struct described_node *node, unsigned axis, size_t index,
                                struct frame_sink *sink)
{
    const struct described_frame *frame = &node->protocol->frame[index];
    struct described_report *report = &node->report[axis][index];
    uint8_t data[DESCRIBED_LENGTH_MAX];
    uint32_t id;

    report->state = node->ops->state(node, axis);
    report->faults = described_node_faults(node, axis);
    memset(data, 0, frame->length);
    id = described_node_fill(node, axis, index, NULL, NULL, data);
    board_send_as(&node->board, sink, id, frame->flags, frame->length, data);
}

/* Returns whether state or faults have changed since a frame last told them. */
static bool described_node_has_changed(const struct described_node *node, unsigned axis,
                                       size_t index)
{
    const struct described_report *report = &node->report[axis][index];

    return report->state != node->ops->state(node, axis) ||
           report->faults != described_node_faults(node, axis);
}

/* Sends the telemetry, or all other frames that are due. */
static void described_node_send_due(struct described_node *node, struct ms_span span,
                                    bool telemetry, struct frame_sink *sink)
{
    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        unsigned count = frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;

        if (frame->from_host || !(frame->of & node->ops->kind) || frame->telemetry != telemetry) {
            continue;
        }
        /* Frames by slot come once an axis, each at its own time */
        for (unsigned axis = 0; axis < count; axis++) {
            int64_t number =
                frame->by == DESCRIBED_BY_SLOT ? node->first_slot + axis : node->board.address;
            bool due = telemetry ||
                       (frame->period_ns > 0 && described_grid_due(span, frame->period_ns / MS,
                                                                   number * frame->spread_ms)) ||
                       (frame->on_change && described_node_has_changed(node, axis, i));

            if (due) {
                described_node_send(node, axis, i, sink);
            }
        }
    }
}

/* Returns whether frames that tell changes have told of lost frames, for each axis. */
static bool described_node_has_told_overflow(const struct described_node *node)
{
    bool told = false;

    for (size_t i = 0; i < node->protocol->nframe; i++) {
        const struct described_frame *frame = &node->protocol->frame[i];
        unsigned count = frame->by == DESCRIBED_BY_SLOT ? node->axes : 1;

        if (!frame->on_change || !(frame->of & node->ops->kind)) {
            continue;
        }
        for (unsigned axis = 0; axis < count; axis++) {
            told = node->report[axis][i].faults >> DESCRIBED_OVERFLOW & 1;
            if (!told) {
                return false;
            }
        }
    }
    return told;
}

void described_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct described_node *node = described_node_of(board);
    bool lost = board->lost_in_status;

    if (described_node_due(node)) {
        described_node_send_due(node, span, true, sink);
        node->sequence++;
    }
    described_node_send_due(node, span, false, sink);
    if (lost && described_node_has_told_overflow(node)) {
        board->lost_in_status = board->lost_in_overflow = false;
    }
}
