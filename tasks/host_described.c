/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's side of a protocol that a file describes. The file's section `host` lists the frames
 * that discover, configure, switch and command the boards. The host converts the task's voltage to
 * the set point of the frame. A set point may be the current that the voltage drives through the
 * winding against the back-EMF, or the torque of this current. For an impedance, it is this torque
 * minus the torque that the drive adds with kp and kd (from the file) at the reference.
 */
#include "tasks/host_private.h"

#include "boards/described/protocol.h"

_Static_assert((int)DESCRIBED_FRAMES_MAX <= HOST_ROWS && (int)DESCRIBED_SLOTS <= HOST_SLOTS,
               "counters of every row and number");

/* Returns the protocol of a bus. */
static const struct described_protocol *described_line_protocol(const struct host *host, size_t bus)
{
    return host->config.bus[bus].described;
}

/* Returns the kind of a board (enum described_kind); 0 = no kind of a described protocol. */
static unsigned described_node_kind(const struct host_node *node)
{
    return node->kind == HOST_MOTOR_BOARD      ? DESCRIBED_MOTOR
           : node->kind == HOST_FT_BOARD       ? DESCRIBED_FT
           : node->kind == HOST_INERTIAL_BOARD ? DESCRIBED_INERTIAL
                                               : 0;
}

/* ---- sending ---- */

/* A frame to fill, and the data for its fields. */
struct described_letter {
    const struct described_frame *row;
    const struct host_node *node;
    unsigned address;
    int axis; /* axis of the host; -1 = no particular axis */
    int state;
    uint32_t slots;
    int64_t period_ns;
};

/* Largest ratio kp / kd of a light motor, 1/s. Its kd is limited to the damping of the winding. */
#define GAIN_PER_S 20.0

/* Returns kp or kd for an axis; 0 if the frame has no such field. It is the file's value, at most
 * the end of the field's range. A light rotor behind a small winding does not bear the gains of a
 * large drive at the period of the bus. So kd is at most the damping of the shorted winding,
 * Kt Kw / R, and kp is at most GAIN_PER_S times that. */
static double described_gain(const struct host *host, const struct described_protocol *protocol,
                             size_t axis, const struct described_frame *row,
                             enum described_meaning meaning)
{
    const struct host_drive *drive = &host->config.axis[axis].drive;
    int index = described_find_field(row, meaning);
    struct described_field field;
    double most, damping;

    if (index < 0) {
        return 0.0;
    }
    field = described_model_field(protocol, host->config.axis[axis].model, &row->field[index]);
    most = field.real ? HUGE_VAL : field.offset + field.scale * (double)field.high;
    damping = drive->winding_ohm > 0.0
                  ? drive->torque_nm_a * drive->bemf_v_s_rad / drive->winding_ohm
                  : HUGE_VAL;
    return fmin(fmin(field.host, most),
                meaning == DESCRIBED_TO_KP ? GAIN_PER_S * damping : damping);
}

/* Returns the reference of a motor, rad; before the first reference, the motor's present angle. */
static double described_wanted_rad(const struct host *host, size_t axis)
{
    return host->want[axis].referred ? host->want[axis].rad : host->joint[axis].motor_rad;
}

/* Returns the steady-state current (A) that the voltage drives through the winding, against the
 * back-EMF. */
static double described_wanted_a(const struct host *host, size_t axis)
{
    const struct host_drive *drive = &host->config.axis[axis].drive;
    double back_v = drive->bemf_v_s_rad * host->want[axis].motor_rad_s;

    return drive->winding_ohm > 0.0 ? (host->volts[axis] - back_v) / drive->winding_ohm : 0.0;
}

/* Returns the torque of this current (N m), minus the torque that the board adds for the frame's kp
 * and kd. */
static double described_wanted_nm(const struct host *host,
                                  const struct described_protocol *protocol, size_t axis,
                                  const struct described_frame *row)
{
    double kp = described_gain(host, protocol, axis, row, DESCRIBED_TO_KP);
    double kd = described_gain(host, protocol, axis, row, DESCRIBED_TO_KD);

    return host->config.axis[axis].drive.torque_nm_a * described_wanted_a(host, axis) -
           kp * (described_wanted_rad(host, axis) - host->joint[axis].motor_rad) -
           kd * (host->want[axis].rad_s - host->want[axis].motor_rad_s);
}

/* Returns a set point in SI units. otherwise: the file's value, for meanings without a set point of
 * the task. Drives that close a speed or position loop compute the torque themselves. */
static double described_target(const struct host *host, const struct described_protocol *protocol,
                               size_t axis, const struct described_frame *row,
                               enum described_meaning meaning, double otherwise)
{
    enum described_law law = protocol->host.law;

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
                   : described_wanted_nm(host, protocol, axis, row);
    case DESCRIBED_TO_KP:
    case DESCRIBED_TO_KD:
        return described_gain(host, protocol, axis, row, meaning);
    case DESCRIBED_TO_VELOCITY:
        return host->want[axis].rad_s;
    case DESCRIBED_TO_POSITION:
        return described_wanted_rad(host, axis);
    default:
        return otherwise;
    }
}

/* Returns the raw value (count) of field i of a frame to send. */
static int64_t described_letter_count(const struct host *host,
                                      const struct described_protocol *protocol,
                                      const struct described_letter *letter, size_t i)
{
    const struct described_field *field = &letter->row->field[i];
    struct described_field scaled;
    /* Use the axis of the frame; in a frame for a whole board, the axis of the field */
    int axis =
        letter->row->of_one || !letter->node ? letter->axis : letter->node->axis[field->axis];
    const struct described_state *state = &protocol->state[protocol->host.on_state];

    if (field->times >= 0) {
        scaled =
            described_model_field(protocol, axis < 0 ? 0 : host->config.axis[axis].model, field);
        field = &scaled;
    }
    switch (field->meaning) {
    /* Fields that identify the frame: constants, selections, addresses, states */
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
    /* Physical values. The scale is given by the state's control law, or by the field */
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(field, (double)letter->period_ns * 1e-9);
    case DESCRIBED_SET_POINT:
        return axis < 0 ? 0
                        : llrint(described_target(host, protocol, (size_t)axis, letter->row,
                                                  described_law_target(state->law), field->host) /
                                 state->set_point_scale);
    default:
        return described_count(field, axis < 0 ? field->host
                                               : described_target(host, protocol, (size_t)axis,
                                                                  letter->row, field->meaning,
                                                                  field->host));
    }
}

/* Writes identifier and data of a frame, or the data of one repetition, and advances its
 * counter. */
static void described_fill(const struct host *host, size_t bus,
                           const struct described_letter *letter, unsigned number, unsigned part,
                           struct bus_frame *frame)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct described_frame *row = letter->row;

    frame->id = described_id(row, number);
    for (size_t i = 0; i < row->nfield; i++) {
        const struct described_field *field = &row->field[i];
        int64_t count =
            field->meaning == DESCRIBED_COUNTER
                ? described_wrap(field, host->line[bus].sent[row - protocol->frame][number]++)
                : described_letter_count(host, protocol, letter, i);

        described_put(field, count, part * row->length, frame);
    }
    described_close(row, frame->data);
}

/* Makes a frame; remote frames have no data. */
static struct bus_frame described_write(const struct host *host, size_t bus,
                                        const struct described_letter *letter, unsigned number)
{
    struct bus_frame frame = {.id = described_id(letter->row, number),
                              .flags = letter->row->flags,
                              .len = letter->row->length};

    if (!letter->row->remote) {
        described_fill(host, bus, letter, number, 0, &frame);
    }
    return frame;
}

/* Queues a frame that does not belong to one axis: once per bus, or once per board of its kinds. */
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

/* Queues the discovery frames. */
static void host_described_discover(struct host *host, size_t bus)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);

    for (size_t i = 0; i < protocol->host.discover.count; i++) {
        described_send_to_boards(host, bus, &protocol->frame[protocol->host.discover.frame[i]]);
    }
}

/* Makes configuring frame `number` of a board (struct host_ops). */
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

/* Stores the slot of a switched motor. Its frames are queued at the end of the period. */
static void host_described_set_motor(struct host *host, size_t axis, bool on)
{
    struct host_line *line = &host->line[host->config.axis[axis].bus];

    host->want[axis].on = on;
    for (unsigned slot = 0; slot < line->slots; slot++) {
        if (line->slot[slot] == (int)axis) {
            *(on ? &line->slots_on : &line->slots_off) |= UINT32_C(1) << slot;
            *(on ? &line->slots_off : &line->slots_on) &= ~(UINT32_C(1) << slot);
        }
    }
}

/* Queues a frame for one axis. A frame for a whole board is queued once, with the first axis. */
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
        return; /* queued with the first axis */
    }
    frame = described_write(host, bus, &letter,
                            row->by == DESCRIBED_BY_ADDRESS ? of->address
                            : row->by == DESCRIBED_BY_SLOT  ? slot
                                                            : 0);
    host_queue(host, bus, &frame);
}

/* Queues the frames that switch a set of slots on or off, and clears the set. Queues one frame if a
 * field selects axes, otherwise one frame per axis. */
static void described_send_switches(struct host *host, size_t bus, bool on, uint32_t *slots)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct described_list *list = on ? &protocol->host.on : &protocol->host.off;
    int state = on ? protocol->host.on_state : protocol->host.off_state;

    for (size_t i = 0; i < list->count && *slots; i++) {
        const struct described_letter letter = {
            .row = &protocol->frame[list->frame[i]], .axis = -1, .state = state, .slots = *slots};

        if (described_find_field(letter.row, DESCRIBED_SLOTS_MASK) >= 0) {
            struct bus_frame frame = described_write(host, bus, &letter, 0);

            host_queue(host, bus, &frame);
            continue;
        }
        for (unsigned slot = 0; slot < host->line[bus].slots; slot++) {
            if (*slots >> slot & 1) {
                described_send_to_axis(host, bus, letter.row, slot, state);
            }
        }
    }
    *slots = 0;
}

/* Queues the frames of a period: first switched motors, then set points. */
static void host_described_end_period(struct host *host, size_t bus)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    struct host_line *line = &host->line[bus];

    described_send_switches(host, bus, false, &line->slots_off);
    described_send_switches(host, bus, true, &line->slots_on);

    /* Queue set points by group or by axis, as in the file */
    for (size_t i = 0; i < protocol->host.command.count && line->driving; i++) {
        const struct described_frame *row = &protocol->frame[protocol->host.command.frame[i]];

        for (unsigned slot = 0; slot < line->slots;
             slot += row->by == DESCRIBED_BY_GROUP ? row->repeats : 1) {
            if (row->by == DESCRIBED_BY_GROUP) {
                struct bus_frame frame = {.id = described_id(row, slot / row->repeats),
                                          .flags = row->flags};
                unsigned parts = 0;

                /* Queue the set points of a group of axes in one frame */
                for (unsigned k = 0; k < row->repeats && slot + k < host->line[bus].slots; k++) {
                    const struct described_letter letter = {.row = row,
                                                            .axis = host->line[bus].slot[slot + k],
                                                            .state = protocol->host.on_state};

                    described_fill(host, bus, &letter, slot / row->repeats, k, &frame);
                    parts = k + 1;
                }
                frame.len = described_length(row, parts);
                if (frame.len > 0) {
                    host_queue(host, bus, &frame);
                }
            } else {
                described_send_to_axis(host, bus, row, slot, protocol->host.on_state);
            }
        }
    }
}

/* ---- receiving ---- */

/* A received frame: its row in the file, its board and its axis. */
struct described_news {
    const struct bus_frame *frame;
    const struct described_frame *row;
    struct host_node *node;
    int axis;      /* axis of the board, 0 to HOST_AXES - 1 */
    unsigned part; /* number of the repetition */
};

/* Returns the raw value (count) of the field with a meaning; `otherwise` if there is none. */
static inline int64_t described_news_count(const struct described_news *news,
                                           enum described_meaning meaning, int64_t otherwise)
{
    int field = described_find_field(news->row, meaning);

    return field < 0 ? otherwise
                     : described_get(&news->row->field[field], news->frame,
                                     news->part * news->row->length);
}

/* Finds the board and axis of a frame from the number in the identifier, or from a field. Returns
 * false if the host does not use this board or axis. */
static bool described_find_node(const struct host *host, struct host_line *line, unsigned number,
                                struct described_news *news)
{
    int slot = news->row->by == DESCRIBED_BY_SLOT ? line->slot[number] : 0;
    int64_t address = number, axis = 0;

    /* The identifier or a field contains the number of the axis on the bus, or the address */
    if (slot < 0) {
        return false;
    }
    if (news->row->by == DESCRIBED_BY_SLOT) {
        address = host->config.axis[slot].address;
        axis = host->config.axis[slot].axis;
    } else if (news->row->by != DESCRIBED_BY_ADDRESS) {
        address = described_news_count(news, DESCRIBED_ADDRESS, 0);
    }
    /* A field may contain the axis of the board */
    axis = described_news_count(news, DESCRIBED_AXIS, axis);
    if (address < 1 || address >= HOST_ADDRESSES) {
        return false;
    }
    news->node = &line->node[address];
    news->axis = axis < HOST_AXES ? (int)axis : 0;
    return described_node_kind(news->node) & news->row->of;
}

/* Finds the row of the file that matches a frame, and the frame's board. Returns false if no row
 * matches. */
static bool host_described_identify(const struct host *host, size_t bus,
                                    struct described_news *news)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    const struct bus_frame *frame = news->frame;

    for (uint64_t rows = described_rows(protocol, frame, false); rows; rows &= rows - 1) {
        unsigned number;

        news->row = &protocol->frame[__builtin_ctzll(rows)];
        if (described_number(news->row, frame->id, frame->flags & FRAME_EXTENDED, &number) &&
            described_match_frame(news->row, frame) == DESCRIBED_IS &&
            described_find_node(host, &host->line[bus], number, news)) {
            return true;
        }
    }
    return false;
}

/* Returns whether a frame is an answer to a frame in a list, for boards of this kind. */
static bool described_is_answer(const struct described_protocol *protocol,
                                const struct described_list *list, unsigned kind,
                                const struct described_frame *row)
{
    for (size_t i = 0; i < list->count; i++) {
        int reply = protocol->frame[list->frame[i]].reply[kind >> 1];

        if (reply >= 0 && &protocol->frame[reply] == row) {
            return true;
        }
    }
    return false;
}

/* Sets the state of a motor from the reported state and faults. If the protocol has no fault state,
 * a motor that is off with a fault gets the state "fault". */
static void described_read_state(const struct described_protocol *protocol,
                                 struct host_joint *joint, int64_t value)
{
    int state = described_find_state(protocol->state, protocol->nstate, value, false);
    enum described_law law = state < 0 ? DESCRIBED_SELECTED : protocol->state[state].law;
    bool told = protocol->fault_state != protocol->off_state;

    joint->motor = law == DESCRIBED_FAULT ? HOST_MOTOR_FAULT
                   : law == DESCRIBED_OFF
                       ? !told && joint->fault & DESCRIBED_FATAL ? HOST_MOTOR_FAULT : HOST_MOTOR_OFF
                   : state == protocol->host.on_state ? HOST_MOTOR_ON
                                                      : HOST_MOTOR_OTHER;
}

/* Stores the rotor's angle. If no frame reports the link's angle, computes it from the spring's
 * torque. If no frame reports the rate, computes it from the difference of two angles. */
static void described_read_position(struct host *host, const struct described_protocol *protocol,
                                    size_t axis, double rad)
{
    struct host_joint *joint = &host->joint[axis];
    bool tells_speed = protocol->tells[DESCRIBED_MOTOR_VELOCITY];
    const struct host_drive *drive = &host->config.axis[axis].drive;
    double span_s = (double)(host->now_ns - joint->motor_time_ns) * 1e-9;

    if (!tells_speed && joint->motor_time_ns >= 0 && span_s > 0.0) {
        host->want[axis].motor_rad_s = (rad - joint->motor_rad) / span_s;
    }
    joint->motor_rad = rad;
    joint->motor_time_ns = host->now_ns;
    if (!protocol->tells[DESCRIBED_LINK_POSITION] && !protocol->tells[DESCRIBED_DEFLECTION]) {
        joint->joint_rad =
            rad - (drive->spring_nm_rad > 0.0 ? joint->torque_nm / drive->spring_nm_rad : 0.0);
        joint->joint_time_ns = host->now_ns;
    }
    if (!protocol->tells[DESCRIBED_STATE]) {
        joint->motor = host->want[axis].on ? HOST_MOTOR_ON : HOST_MOTOR_OFF;
    }
}

/* Stores one field of a motor board's frame, converted from its raw value. */
static void described_read_motor_field(struct host *host, const struct described_protocol *protocol,
                                       const struct described_news *news,
                                       const struct described_field *of, int64_t count)
{
    unsigned k = (unsigned)news->axis + of->axis;
    int axis = k < HOST_AXES ? news->node->axis[k] : -1;
    struct host_joint *joint;
    struct described_field scaled;
    double value;

    if (axis < 0) {
        return;
    }
    if (of->times >= 0) {
        scaled = described_model_field(protocol, host->config.axis[axis].model, of);
        of = &scaled;
    }
    value = described_value(of, count);
    joint = &host->joint[axis];
    /* Angles: of the rotor, of the link, or the deflection between both */
    switch (of->meaning) {
    case DESCRIBED_MOTOR_POSITION:
        described_read_position(host, protocol, (size_t)axis, value);
        break;
    case DESCRIBED_LINK_POSITION:
        joint->joint_rad = value;
        joint->joint_time_ns = host->now_ns;
        if (!protocol->tells[DESCRIBED_MOTOR_POSITION]) {
            described_read_position(host, protocol, (size_t)axis, value);
        }
        break;
    case DESCRIBED_DEFLECTION:
        joint->joint_rad = described_value(
            &news->row->field[described_find_field(news->row, DESCRIBED_MOTOR_POSITION)],
            described_news_count(news, DESCRIBED_MOTOR_POSITION, 0) - count);
        joint->joint_time_ns = host->now_ns;
        break;
    /* Rate, current and torque */
    case DESCRIBED_MOTOR_VELOCITY:
        host->want[axis].motor_rad_s = value;
        break;
    case DESCRIBED_AXIS_CURRENT:
        joint->current_a = value;
        break;
    case DESCRIBED_AXIS_TORQUE:
    case DESCRIBED_DRIVE_TORQUE:
        joint->torque_nm = value;
        joint->torque_time_ns = host->now_ns;
        break;
    /* States and faults, which depend on each other */
    case DESCRIBED_STATE:
        described_read_state(protocol, joint, count);
        break;
    case DESCRIBED_FAULTS:
        joint->fault = described_known_faults(protocol, count);
        if (joint->motor == HOST_MOTOR_OFF && protocol->fault_state == protocol->off_state &&
            joint->fault & DESCRIBED_FATAL) {
            joint->motor = HOST_MOTOR_FAULT;
        }
        break;
    default:
        break;
    }
}

/* Reads a received frame (struct host_ops). */
static void host_described_read(struct host *host, size_t bus, const struct bus_frame *frame)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    struct described_news news = {.frame = frame};

    if (!host_described_identify(host, bus, &news)) {
        return;
    }

    /* Record an answer for the start-up */
    struct host_node *node = news.node;
    unsigned kind = described_node_kind(node);

    if (!node->found && (protocol->host.discover.count == 0 ||
                         described_is_answer(protocol, &protocol->host.discover, kind, news.row))) {
        node->found = true;
    }
    if (node->answered < node->requested &&
        described_is_answer(protocol, &protocol->host.configure, kind, news.row)) {
        node->answered = node->requested;
    }
    /* Read the repetitions, one for each axis of the board, in order */
    do {
        for (size_t i = 0; i < news.row->nread; i++) {
            const struct described_field *field = &news.row->field[news.row->read[i]];
            int64_t count = described_get(field, frame, news.part * news.row->length);

            if (news.node->kind == HOST_MOTOR_BOARD) {
                described_read_motor_field(host, protocol, &news, field, count);
            } else if (news.node->kind == HOST_FT_BOARD) {
                struct host_force *force = &host->force[news.node->ft];
                unsigned channel = field->meaning - DESCRIBED_FT_CHANNEL;

                /* Store one field of a force-torque board's frame: a channel, N or N m, or its
                 * overflow */
                if (field->meaning == DESCRIBED_SATURATED) {
                    force->overflow = count != 0;
                } else if (channel < HOST_CHANNELS) {
                    *(channel < 3 ? &force->force_n[channel] : &force->torque_nm[channel - 3]) =
                        described_value(field, count);
                    *(channel < 3 ? &force->force_time_ns : &force->torque_time_ns) = host->now_ns;
                }
            } else {
                /* Store one field of an inertial board's frame */
                struct host_motion *motion = &host->motion;
                const unsigned channel = field->meaning - DESCRIBED_ACCELERATION;
                const double value = described_value(field, count);

                if (channel < 3) {
                    motion->acceleration_m_s2[channel] = value;
                    motion->acceleration_time_ns = host->now_ns;
                } else if (channel < 6) {
                    motion->rate_rad_s[channel - 3] = value;
                    motion->rate_time_ns = host->now_ns;
                } else if (channel < 10) {
                    motion->quaternion[channel - 6] = value;
                    motion->quaternion_time_ns = host->now_ns;
                }
            }
        }
        news.part++;
        news.axis++;
    } while (news.part < news.row->repeats && (news.part + 1) * news.row->length <= frame->len);
}

#define HOST_DESCRIBED                                                                             \
    .extended = true, .discover = host_described_discover, .request = host_described_request,      \
    .read = host_described_read, .set_motor = host_described_set_motor,                            \
    .end_period = host_described_end_period

const struct host_ops host_described = {HOST_DESCRIBED};
const struct host_ops host_compact = {HOST_DESCRIBED};
