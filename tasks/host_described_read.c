/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the frames of the boards of a described protocol; tasks/host_described.c writes the
 * host's. */
#include "tasks/host_described.h"

/* A frame from a board: its row in the description, its board and axis, its fields. */
struct described_news {
    const struct described_frame *row;
    struct host_node *node;
    int axis; /* axis of the board, 0 to HOST_AXES - 1 */
    int64_t values[DESCRIBED_FIELDS_MAX];
};

/* Finds the board and axis that a frame is from, by the number in its identifier or by a field.
 * Returns false when they are none of ours. */
static bool described_find_node(const struct host *host, struct host_line *line, size_t bus,
                                unsigned number, struct described_news *news)
{
    int field;

    news->axis = 0;
    /* The identifier tells the address, or the axis of the bus; otherwise a field does */
    switch (news->row->by) {
    case DESCRIBED_BY_ADDRESS:
        news->node = &line->node[number];
        break;
    case DESCRIBED_BY_SLOT:
        if (line->slot[number] < 0) {
            return false;
        }
        news->node = &line->node[host->config.axis[line->slot[number]].address];
        news->axis = host->config.axis[line->slot[number]].axis;
        break;
    default:
        field = described_find_field(news->row, DESCRIBED_ADDRESS);
        if (field < 0 || news->values[field] < 1 || news->values[field] >= HOST_ADDRESSES) {
            return false;
        }
        news->node = &line->node[news->values[field]];
        break;
    }
    /* A field may say which axis of the board it is */
    (void)bus;
    field = described_find_field(news->row, DESCRIBED_AXIS);
    if (field >= 0) {
        news->axis = news->values[field] < HOST_AXES ? (int)news->values[field] : 0;
    }
    return described_node_kind(news->node) & news->row->of;
}

/* Finds the row of the description that a frame matches, with its board. Returns false when
 * there is none. */
static bool host_described_identify(const struct host *host, struct host_line *line, size_t bus,
                                    const struct bus_frame *frame, struct described_news *news)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);

    for (size_t i = 0; i < protocol->nframe; i++) {
        unsigned number;

        news->row = &protocol->frame[i];
        if (!news->row->from_host &&
            described_number(news->row, frame->id, frame->flags & FRAME_EXTENDED, &number) &&
            described_match_frame(news->row, frame, news->values) == DESCRIBED_IS &&
            described_find_node(host, line, bus, number, news)) {
            return true;
        }
    }
    return false;
}

/* Returns whether a frame answers one of a list, as sent to boards of that kind. */
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

/* Translates a state of the protocol into the state of a motor. */
static void described_read_state(const struct described_protocol *protocol,
                                 struct host_joint *joint, int64_t value)
{
    int state = described_find_state(protocol->state, protocol->nstate, value, false);
    enum described_law law = state < 0 ? DESCRIBED_SELECTED : protocol->state[state].law;

    joint->motor = law == DESCRIBED_OFF               ? HOST_MOTOR_OFF
                   : law == DESCRIBED_FAULT           ? HOST_MOTOR_FAULT
                   : state == protocol->host.on_state ? HOST_MOTOR_ON
                                                      : HOST_MOTOR_OTHER;
}

/* Sets a motor to fault that is off and tells of a fault, where the protocol has no state of its
 * own for that. */
static void described_judge_fault(const struct described_protocol *protocol,
                                  struct host_joint *joint)
{
    if (joint->motor == HOST_MOTOR_OFF && protocol->fault_state == protocol->off_state &&
        joint->fault & DESCRIBED_FATAL) {
        joint->motor = HOST_MOTOR_FAULT;
    }
}

/* Takes the rotor's angle. Computes the link's from the torque of the spring and the rate by
 * difference where no frame tells them. */
static void described_read_position(struct host *host, const struct described_protocol *protocol,
                                    size_t axis, double rad, bool tells_speed)
{
    struct host_joint *joint = &host->joint[axis];
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

/* Takes one field of a frame from a motor board. */
static void described_read_motor_field(struct host *host, const struct described_protocol *protocol,
                                       const struct described_news *news, size_t field)
{
    const struct described_field *of = &news->row->field[field];
    const struct field *layout = described_layout(news->row, field);
    unsigned k = (unsigned)news->axis + of->axis;
    struct host_joint *joint = k < HOST_AXES ? host_node_joint(host, news->node, (int)k) : NULL;
    double value = described_value(layout, of, news->values[field]);
    int motor;

    if (!joint) {
        return;
    }
    /* Angles: of the rotor, of the link, or the deflection between them */
    switch (of->meaning) {
    case DESCRIBED_MOTOR_POSITION:
        described_read_position(host, protocol, (size_t)news->node->axis[k], value,
                                protocol->tells[DESCRIBED_MOTOR_VELOCITY]);
        break;
    case DESCRIBED_LINK_POSITION:
        joint->joint_rad = value;
        joint->joint_time_ns = host->now_ns;
        if (!protocol->tells[DESCRIBED_MOTOR_POSITION]) {
            described_read_position(host, protocol, (size_t)news->node->axis[k], value,
                                    protocol->tells[DESCRIBED_MOTOR_VELOCITY]);
        }
        break;
    case DESCRIBED_DEFLECTION:
        motor = described_find_field(news->row, DESCRIBED_MOTOR_POSITION);
        joint->joint_rad = described_value(layout, &news->row->field[motor],
                                           news->values[motor] - news->values[field]);
        joint->joint_time_ns = host->now_ns;
        break;
    /* Rate, current and torque */
    case DESCRIBED_MOTOR_VELOCITY:
        host->want[news->node->axis[k]].motor_rad_s = value;
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
        described_read_state(protocol, joint, news->values[field]);
        described_judge_fault(protocol, joint);
        break;
    case DESCRIBED_FAULTS:
        joint->fault = described_known_faults(protocol, news->values[field]);
        described_judge_fault(protocol, joint);
        break;
    default:
        break;
    }
}

/* Takes one field of a frame from a force-torque board: a channel, N or N m, or its overflow. */
static void described_read_force(struct host *host, const struct described_news *news, size_t field)
{
    struct host_force *force = &host->force[news->node->ft];
    const struct described_field *of = &news->row->field[field];
    double value = described_value(described_layout(news->row, field), of, news->values[field]);
    int channel = (int)of->meaning - DESCRIBED_FT_CHANNEL;

    if (of->meaning == DESCRIBED_SATURATED) {
        force->overflow = news->values[field] != 0;
    } else if (channel >= 0 && channel < 3) {
        force->force_n[channel] = value;
        force->force_time_ns = host->now_ns;
    } else if (channel >= 3 && channel < HOST_CHANNELS) {
        force->torque_nm[channel - 3] = value;
        force->torque_time_ns = host->now_ns;
    }
}

/* Takes one field of a frame from an inertial board. */
static void described_read_motion(struct host *host, const struct described_news *news,
                                  size_t field)
{
    const struct described_field *of = &news->row->field[field];
    double value = described_value(described_layout(news->row, field), of, news->values[field]);
    struct host_motion *motion = &host->motion;

    if (of->meaning >= DESCRIBED_ACCELERATION && of->meaning < DESCRIBED_RATE) {
        motion->acceleration_m_s2[of->meaning - DESCRIBED_ACCELERATION] = value;
        motion->acceleration_time_ns = host->now_ns;
    } else if (of->meaning >= DESCRIBED_RATE && of->meaning < DESCRIBED_QUATERNION) {
        motion->rate_rad_s[of->meaning - DESCRIBED_RATE] = value;
        motion->rate_time_ns = host->now_ns;
    } else if (of->meaning >= DESCRIBED_QUATERNION && of->meaning < DESCRIBED_MAGNETIC) {
        motion->quaternion[of->meaning - DESCRIBED_QUATERNION] = value;
        motion->quaternion_time_ns = host->now_ns;
    }
}

void host_described_read(struct host *host, size_t bus, const struct bus_frame *frame)
{
    const struct described_protocol *protocol = described_line_protocol(host, bus);
    struct host_line *line = &host->line[bus];
    struct described_news news;

    if (!host_described_identify(host, line, bus, frame, &news)) {
        return;
    }

    /* The start-up */
    if (protocol->host.discover.count == 0 ||
        described_is_answer(protocol, &protocol->host.discover, described_node_kind(news.node),
                            news.row)) {
        news.node->found = true;
    }
    if (news.node->answered < news.node->requested &&
        described_is_answer(protocol, &protocol->host.configure, described_node_kind(news.node),
                            news.row)) {
        news.node->answered = news.node->requested;
    }

    /* What it tells; torques and rates come before the angles that are computed with them */
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < news.row->nfield; i++) {
            bool torque = news.row->field[i].meaning == DESCRIBED_AXIS_TORQUE ||
                          news.row->field[i].meaning == DESCRIBED_DRIVE_TORQUE ||
                          news.row->field[i].meaning == DESCRIBED_MOTOR_VELOCITY;

            if (torque != (pass == 0)) {
                continue;
            }
            if (news.node->kind == HOST_MOTOR_BOARD) {
                described_read_motor_field(host, protocol, &news, i);
            } else if (news.node->kind == HOST_FT_BOARD) {
                described_read_force(host, &news, i);
            } else {
                described_read_motion(host, &news, i);
            }
        }
    }
}
