/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of a protocol that a file describes: its section `host` says which frames ask who
 * is there, configure, switch and command. Set-points are what the task wants as a voltage, in the
 * quantities that the frame has: the current that the voltage drives through the winding against
 * the back-EMF, its torque, and of an impedance what kp and kd, which the file gives, leave of that
 * torque at the reference.
 */
#include "tasks/host_described.h"

#include <math.h>
#include <string.h>

_Static_assert((int)DESCRIBED_FRAMES_MAX <= HOST_ROWS && (int)DESCRIBED_SLOTS <= HOST_SLOTS,
               "counters of every row and number");

/* A frame to be filled, and what its fields may need. */
struct described_letter {
    const struct described_frame *row;
    const struct host_node *node;
    unsigned address;
    int axis; /* axis of the host, -1: none in particular */
    int state;
    uint32_t slots;
    int64_t period_ns;
};

/* Returns the value that the file gives the host for a field of that meaning; 0 when the frame
 * has none. */
static double host_value_of(const struct described_frame *row, enum described_meaning meaning)
{
    int field = described_find_field(row, meaning);

    return field < 0 ? 0.0 : row->field[field].host;
}

/* Returns the reference of a motor, rad; its present angle while there is none. */
static double described_wanted_rad(const struct host *host, size_t axis)
{
    return host->want[axis].referred ? host->want[axis].rad : host->joint[axis].motor_rad;
}

/* Returns the rate of the reference, rad/s; 0 while there is none. */
static double described_wanted_rad_s(const struct host *host, size_t axis)
{
    return host->want[axis].referred ? host->want[axis].rad_s : 0.0;
}

/* Returns the current (A) that the voltage drives through the winding in the steady state,
 * against the back-EMF. */
static double described_wanted_a(const struct host *host, size_t axis)
{
    const struct host_drive *drive = &host->config.axis[axis].drive;
    double back_v = drive->bemf_v_s_rad * host->want[axis].motor_rad_s;

    return drive->winding_ohm > 0.0 ? (host->volts[axis] - back_v) / drive->winding_ohm : 0.0;
}

/* Returns the torque of that current (N m), less what the board adds by itself for the frame's
 * kp and kd. */
static double described_wanted_nm(const struct host *host, size_t axis,
                                  const struct described_frame *row)
{
    double kp = host_value_of(row, DESCRIBED_TO_KP), kd = host_value_of(row, DESCRIBED_TO_KD);

    return host->config.axis[axis].drive.torque_nm_a * described_wanted_a(host, axis) -
           kp * (described_wanted_rad(host, axis) - host->joint[axis].motor_rad) -
           kd * (described_wanted_rad_s(host, axis) - host->want[axis].motor_rad_s);
}

/* Returns the law in which the host drives: that of its state, or the one that a frame selects. */
static enum described_law described_host_law(const struct described_protocol *protocol)
{
    enum described_law law = protocol->state[protocol->host.on_state].law;

    for (size_t i = 0; i < protocol->host.on.count && law == DESCRIBED_SELECTED; i++) {
        const struct described_frame *row = &protocol->frame[protocol->host.on.frame[i]];
        int field = described_find_field(row, DESCRIBED_LAW);
        int found = field < 0 ? -1
                              : described_find_state(protocol->law, protocol->nlaw,
                                                     llround(row->field[field].host), true);

        law = found < 0 ? law : protocol->law[found].law;
    }
    return law;
}

/* Returns a set-point in SI units; the file's value (otherwise) where the task has none. Drives
 * that close a loop of speed or position make the torque themselves. */
static double described_target(const struct host *host, const struct described_protocol *protocol,
                               size_t axis, const struct described_frame *row,
                               enum described_meaning meaning, double otherwise)
{
    enum described_law law = described_host_law(protocol);

    switch (meaning) {
    case DESCRIBED_TO_VOLTAGE:
        return host->volts[axis];
    case DESCRIBED_TO_DUTY:
        return host_duty(host, axis);
    case DESCRIBED_TO_CURRENT:
        return described_wanted_a(host, axis);
    case DESCRIBED_TO_TORQUE:
        return law == DESCRIBED_POSITION || law == DESCRIBED_VELOCITY
                   ? otherwise
                   : described_wanted_nm(host, axis, row);
    case DESCRIBED_TO_VELOCITY:
        return described_wanted_rad_s(host, axis);
    case DESCRIBED_TO_POSITION:
        return described_wanted_rad(host, axis);
    default:
        return otherwise;
    }
}

/* Returns the set-point of the state that the host commands, in counts of its field. */
static int64_t described_set_point(const struct host *host, size_t axis,
                                   const struct described_protocol *protocol,
                                   const struct described_frame *row, const struct field *layout,
                                   const struct described_field *field)
{
    static const enum described_meaning of_law[] = {
        [DESCRIBED_VOLTAGE] = DESCRIBED_TO_VOLTAGE,   [DESCRIBED_CURRENT] = DESCRIBED_TO_CURRENT,
        [DESCRIBED_TORQUE] = DESCRIBED_TO_TORQUE,     [DESCRIBED_VELOCITY] = DESCRIBED_TO_VELOCITY,
        [DESCRIBED_POSITION] = DESCRIBED_TO_POSITION, [DESCRIBED_IMPEDANCE] = DESCRIBED_TO_POSITION,
        [DESCRIBED_FAULT] = DESCRIBED_NOTHING,        [DESCRIBED_SELECTED] = DESCRIBED_NOTHING,
    };
    const struct described_state *state = &protocol->state[protocol->host.on_state];
    const struct described_field scaled = {.scale = state->set_point_scale};

    return described_count(
        layout, &scaled,
        described_target(host, protocol, axis, row, of_law[state->law], field->host));
}

/* Returns the value of the i-th field of a frame to be sent, in counts. */
static int64_t described_letter_count(const struct host *host,
                                      const struct described_protocol *protocol,
                                      const struct described_letter *letter, size_t i)
{
    const struct described_field *field = &letter->row->field[i];
    const struct field *layout = described_layout(letter->row, i);
    /* Whose axis: the one the frame is about, or the field's own in a frame about a whole board */
    int axis =
        letter->row->of_one || !letter->node ? letter->axis : letter->node->axis[field->axis];

    switch (field->meaning) {
    /* What the frame says of itself: constants, selections, addresses, states */
    case DESCRIBED_CONSTANT:
        return field->constant;
    case DESCRIBED_SLOTS_MASK:
        return letter->slots;
    case DESCRIBED_ADDRESS:
        return letter->address;
    case DESCRIBED_AXIS:
        return letter->axis < 0 ? 0 : host->config.axis[letter->axis].axis;
    case DESCRIBED_STATE:
        return protocol->state[letter->state].value;
    /* Physical values, with the field's scale */
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(layout, field, (double)letter->period_ns * 1e-9);
    case DESCRIBED_SET_POINT:
        return axis < 0
                   ? 0
                   : described_set_point(host, (size_t)axis, protocol, letter->row, layout, field);
    case DESCRIBED_TO_VOLTAGE:
    case DESCRIBED_TO_DUTY:
    case DESCRIBED_TO_CURRENT:
    case DESCRIBED_TO_TORQUE:
    case DESCRIBED_TO_VELOCITY:
    case DESCRIBED_TO_POSITION:
        return described_count(layout, field,
                               axis < 0
                                   ? field->host
                                   : described_target(host, protocol, (size_t)axis, letter->row,
                                                      field->meaning, field->host));
    /* Anything else is what the file says */
    default:
        return described_count(layout, field, field->host);
    }
}

/* Writes the data of a frame, or of one repetition in it, with its counter advanced. Returns the
 * identifier. */
static uint32_t described_fill(const struct host *host, size_t bus,
                               const struct described_letter *letter, unsigned number,
                               uint8_t *data)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct described_frame *row = letter->row;
    int64_t values[DESCRIBED_FIELDS_MAX];

    for (size_t i = 0; i < row->nfield; i++) {
        values[i] = described_letter_count(host, protocol, letter, i);
    }
    if (row->counter >= 0) {
        values[row->counter] =
            described_wrap(described_layout(row, (size_t)row->counter),
                           host->line[bus].sent[row - protocol->frame][number]++);
    }
    return described_encode(row, number, values, data);
}

/* Makes a frame; remote frames have no data. */
static struct bus_frame described_write(const struct host *host, size_t bus,
                                        const struct described_letter *letter, unsigned number)
{
    struct bus_frame frame = {.id = described_id(letter->row, number),
                              .flags = letter->row->flags,
                              .len = letter->row->length};

    if (!letter->row->remote) {
        frame.id = described_fill(host, bus, letter, number, frame.data);
    }
    return frame;
}

/* Queues a frame that is not about one axis: once a bus, or once for every board of the kinds
 * that take it. */
static void described_send_to_boards(struct host *host, size_t bus,
                                     const struct described_frame *row)
{
    struct described_letter letter = {
        .row = row, .axis = -1, .state = described_line_protocol(host, bus)->host.off_state};

    for (unsigned address = 1; address < HOST_ADDRESSES; address++) {
        const struct host_node *node = &host->line[bus].node[address];
        struct bus_frame frame;

        if (!(described_node_kind(node) & row->of)) {
            continue;
        }
        letter.address = address;
        letter.node = node;
        frame = described_write(host, bus, &letter, row->by == DESCRIBED_BY_ADDRESS ? address : 0);
        host_queue(host, bus, &frame);
        if (row->by == DESCRIBED_BY_NONE && described_find_field(row, DESCRIBED_ADDRESS) < 0) {
            return;
        }
    }
}

/* Numbers the axes of a bus in the order of the rig and queues what asks who is there. */
static void host_described_discover(struct host *host, size_t bus)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    struct host_line *line = &host->line[bus];
    unsigned slot = 0;

    for (size_t i = 0; i < host->config.naxis && slot < HOST_SLOTS; i++) {
        if (host->config.axis[i].bus == (int)bus) {
            line->slot[slot++] = (int)i;
        }
    }
    for (size_t i = 0; i < protocol->host.discover.count; i++) {
        described_send_to_boards(host, bus, &protocol->frame[protocol->host.discover.frame[i]]);
    }
}

/* Makes the number-th configuring frame of a board (struct host_ops). */
static bool host_described_request(const struct host *host, size_t bus, unsigned address,
                                   int number, struct host_request *request)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct host_node *node = &host->line[bus].node[address];
    int64_t period_ns = node->period_ns > 0 ? node->period_ns : host->config.period_ns;

    for (size_t i = 0; i < protocol->host.configure.count; i++) {
        const struct described_letter letter = {
            .row = &protocol->frame[protocol->host.configure.frame[i]],
            .node = node,
            .address = address,
            .axis = -1,
            .state = protocol->host.off_state,
            .period_ns = period_ns > HOST_MS ? period_ns / HOST_MS * HOST_MS : HOST_MS,
        };

        if (described_node_kind(node) & letter.row->of && number-- == 0) {
            request->frame = described_write(host, bus, &letter, address);
            request->reply = letter.row->reply[described_node_kind(node) >> 1] >= 0;
            return true;
        }
    }
    return false;
}

/* Notes that a motor is switched; its frames are queued at the end of the period. */
static void host_described_set_motor(struct host *host, size_t axis, bool on)
{
    host->want[axis].on = on;
    host->want[axis].switch_on = on;
    host->want[axis].switch_off = !on;
}

/* Returns whether an axis was switched on (or off) in this period. */
static bool described_is_switched(const struct host *host, int axis, bool on)
{
    return axis >= 0 && (on ? host->want[axis].switch_on : host->want[axis].switch_off);
}

/* Queues a frame about one axis, or about its board, which gets it with its first axis. */
static void described_send_to_axis(struct host *host, size_t bus, const struct described_frame *row,
                                   unsigned slot, int state)
{
    int axis = host->line[bus].slot[slot];
    const struct host_axis *of = &host->config.axis[axis];
    const struct described_letter letter = {.row = row,
                                            .node = &host->line[bus].node[of->address],
                                            .address = of->address,
                                            .axis = axis,
                                            .state = state,
                                            .slots = UINT32_C(1) << slot};
    struct bus_frame frame;

    if (!row->of_one && of->axis > 0) {
        return; /* the first axis has had it */
    }
    frame = described_write(host, bus, &letter,
                            row->by == DESCRIBED_BY_ADDRESS ? of->address
                            : row->by == DESCRIBED_BY_SLOT  ? slot
                                                            : 0);
    host_queue(host, bus, &frame);
}

/* Queues what switches motors in this period: one frame where a field selects axes, else one for
 * each. */
static void described_send_switches(struct host *host, size_t bus, bool on)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct described_list *list = on ? &protocol->host.on : &protocol->host.off;
    const struct host_line *line = &host->line[bus];
    int state = on ? protocol->host.on_state : protocol->host.off_state;
    uint32_t slots = 0;

    for (unsigned slot = 0; slot < HOST_SLOTS; slot++) {
        slots |= (uint32_t)described_is_switched(host, line->slot[slot], on) << slot;
    }
    for (size_t i = 0; i < list->count && slots; i++) {
        const struct described_letter letter = {
            .row = &protocol->frame[list->frame[i]], .axis = -1, .state = state, .slots = slots};

        if (described_find_field(letter.row, DESCRIBED_SLOTS_MASK) >= 0) {
            struct bus_frame frame = described_write(host, bus, &letter, 0);

            host_queue(host, bus, &frame);
            continue;
        }
        for (unsigned slot = 0; slot < HOST_SLOTS; slot++) {
            if (slots >> slot & 1) {
                described_send_to_axis(host, bus, letter.row, slot, state);
            }
        }
    }
}

/* Queues the set-points of a group of axes in one frame, as far as there are axes. */
static void described_send_group(struct host *host, size_t bus, const struct described_frame *row,
                                 unsigned first)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    struct bus_frame frame = {.id = described_id(row, first / row->repeats), .flags = row->flags};
    unsigned bytes = 0;

    for (unsigned k = 0; k < row->repeats && first + k < HOST_SLOTS; k++) {
        const struct described_letter letter = {
            .row = row, .axis = host->line[bus].slot[first + k], .state = protocol->host.on_state};

        if (letter.axis >= 0) {
            described_fill(host, bus, &letter, first / row->repeats, frame.data + k * row->length);
            bytes = (k + 1) * row->length;
        }
    }
    frame.len = row->flags & FRAME_FD ? frame_fd_length(bytes) : (uint8_t)bytes;
    if (frame.len > 0) {
        host_queue(host, bus, &frame);
    }
}

/* Queues the frames of a period: motors that are switched, then set-points. */
static void host_described_end_period(struct host *host, size_t bus)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct host_line *line = &host->line[bus];

    described_send_switches(host, bus, false);
    described_send_switches(host, bus, true);
    /* Each switch is sent once */
    for (unsigned slot = 0; slot < HOST_SLOTS; slot++) {
        if (line->slot[slot] >= 0) {
            host->want[line->slot[slot]].switch_on = host->want[line->slot[slot]].switch_off =
                false;
        }
    }
    /* Set-points, by group or by axis as the file says */
    for (size_t i = 0; i < protocol->host.command.count && line->driving; i++) {
        const struct described_frame *row = &protocol->frame[protocol->host.command.frame[i]];

        for (unsigned slot = 0; slot < HOST_SLOTS;
             slot += row->by == DESCRIBED_BY_GROUP ? row->repeats : 1) {
            if (row->by == DESCRIBED_BY_GROUP) {
                described_send_group(host, bus, row, slot);
            } else if (line->slot[slot] >= 0) {
                described_send_to_axis(host, bus, row, slot, protocol->host.on_state);
            }
        }
    }
}

const struct host_ops host_described = {
    .name = "described",
    .motor_address_max = DESCRIBED_ADDRESS_MAX,
    .address_max = DESCRIBED_ADDRESS_MAX,
    .axes = DESCRIBED_AXES,
    .extended = true,
    .discover = host_described_discover,
    .request = host_described_request,
    .read = host_described_read,
    .set_motor = host_described_set_motor,
    .end_period = host_described_end_period,
    .fault_name = described_fault_names,
};
