/* SPDX-License-Identifier: Apache-2.0 */
/* Buses with a described protocol: finds the boards and axes that receive a frame. */
#include "boards/described/private.h"

_Static_assert((int)DESCRIBED_ADDRESS_MAX == (int)BOARD_ADDRESS_MAX, "an address of its bus");

/* A received frame with its row and its values. */
struct described_arrival {
    const struct described_frame *row;
    const struct bus_frame *frame;
    unsigned number;
    enum board_verdict verdict;
    bool refused; /* an axis lacks the requested law */
    struct board *listener;
    struct board_reason reason; /* why it is malformed */
    int64_t values[DESCRIBED_FIELDS_MAX];
};

/* Notes why a frame is malformed. */
static void described_note_reason(const struct described_protocol *protocol,
                                  struct described_arrival *a, enum described_wrong why,
                                  int64_t found, int64_t expected)
{
    a->reason = (struct board_reason){.row = (uint8_t)(a->row - protocol->frame),
                                      .why = (uint8_t)why,
                                      .found = (uint32_t)found,
                                      .expected = (uint32_t)expected};
}

/* Returns the protocol of a bus. */
static const struct described_protocol *bus_protocol(const struct described_bus *bus)
{
    return bus->bus.config.described;
}

/* Returns whether a host may write a value to a parameter. */
static bool described_takes_value(const struct described_protocol *protocol,
                                  const struct described_parameter *parameter, int64_t count)
{
    const struct described_field *field = &parameter->field;

    switch (parameter->writable ? field->meaning : DESCRIBED_NOTHING) {
    case DESCRIBED_NOTHING:
        return false;
    case DESCRIBED_LAW:
        return described_find_state(protocol->law, protocol->nlaw, count, true) >= 0;
    case DESCRIBED_ADDRESS:
        return count >= 1 && count <= protocol->address_max;
    case DESCRIBED_ANSWER_ID:
        return count >= 0 && count <= DESCRIBED_STANDARD_ID_MAX;
    default:
        return !parameter->positive ||
               described_value(field, described_signed(field, (uint64_t)count)) > 0.0;
    }
}

/* Returns whether the states, laws, parameters and periods in the frame are valid. */
static bool described_values_exist(const struct described_protocol *protocol,
                                   struct described_arrival *a)
{
    /* States, laws and parameters must be in their lists, a period in its range */
    for (size_t i = 0; i < a->row->nfield; i++) {
        const struct described_field *field = &a->row->field[i];
        const struct described_parameter *parameter;
        int written;
        bool exists = true;
        double value;

        switch (field->meaning) {
        case DESCRIBED_STATE:
            exists =
                protocol->unknown_state >= 0 ||
                described_find_state(protocol->state, protocol->nstate, a->values[i], true) >= 0;
            break;
        case DESCRIBED_LAW:
            exists = described_find_state(protocol->law, protocol->nlaw, a->values[i], true) >= 0;
            break;
        case DESCRIBED_PARAMETER:
            /* A frame with a value writes it */
            parameter = described_find_parameter(protocol, a->values[i]);
            written = described_find_field(a->row, DESCRIBED_PARAMETER_VALUE);
            exists = parameter && (written < 0 ||
                                   described_takes_value(protocol, parameter, a->values[written]));
            break;
        case DESCRIBED_NEW_ADDRESS:
            exists = a->values[i] >= 1 && a->values[i] <= protocol->address_max;
            break;
        case DESCRIBED_TELEMETRY_PERIOD:
            value = described_value(field, a->values[i]);
            exists = value >= 0.0 && value <= DESCRIBED_PERIOD_MAX_MS * 1e-3;
            break;
        default:
            break;
        }
        if (!exists) {
            described_note_reason(protocol, a, DESCRIBED_WRONG_VALUE, a->values[i], (int64_t)i);
            return false;
        }
    }
    return true;
}

/* Finds the row of a frame and its verdict. Returns false if the protocol does not use the
 * identifier. */
static bool described_identify(const struct described_protocol *protocol,
                               struct described_arrival *a)
{
    bool remote = a->frame->flags & FRAME_REMOTE, extended = a->frame->flags & FRAME_EXTENDED;
    bool empty = !remote && a->frame->len == 0;
    const struct described_frame *wrong = NULL;

    a->row = NULL;
    /* Rows from the host with this identifier, in the order of the file */
    for (uint64_t rows = described_rows(protocol, a->frame, true); rows; rows &= rows - 1) {
        const struct described_frame *row = &protocol->frame[__builtin_ctzll(rows)];
        enum described_match match;
        unsigned number;

        if ((row->remote != remote && !(row->or_empty && empty)) ||
            !described_number(row, a->frame->id, extended, &number)) {
            continue;
        }
        /* Use the first row that matches fully, else the last row with the identifier */
        match = described_match_frame(row, a->frame);
        a->row = row;
        a->number = number;
        a->verdict = match == DESCRIBED_IS             ? BOARD_OBEYED
                     : match == DESCRIBED_BAD_CONSTANT ? BOARD_UNKNOWN
                                                       : BOARD_MALFORMED;
        if (match == DESCRIBED_BAD_LENGTH) {
            bool format = (row->flags ^ a->frame->flags) & FRAME_FD;

            described_note_reason(protocol, a,
                                  format ? DESCRIBED_WRONG_FORMAT : DESCRIBED_WRONG_LENGTH,
                                  a->frame->len, row->length);
        } else if (match == DESCRIBED_BAD_CHECKSUM) {
            described_note_reason(
                protocol, a, DESCRIBED_WRONG_CHECKSUM, a->frame->data[row->checksum_byte],
                described_checksum(row->checksum, a->frame->data, row->length, row->checksum_byte));
        }
        /* The repetitions of a group's frame are decoded later, one by one */
        if (!row->remote && match != DESCRIBED_BAD_LENGTH &&
            (row->by != DESCRIBED_BY_GROUP || match == DESCRIBED_BAD_CONSTANT)) {
            described_decode(row, a->frame, 0, a->values);
        }
        if (match != DESCRIBED_IS) {
            continue;
        }
        if (row->by == DESCRIBED_BY_GROUP || !row->checked || described_values_exist(protocol, a)) {
            return true;
        }
        /* A later row with the same identifier may list these values */
        wrong = row;
    }
    if (wrong) {
        a->row = wrong;
        a->verdict = BOARD_MALFORMED;
        described_number(wrong, a->frame->id, extended, &a->number);
        described_decode(wrong, a->frame, 0, a->values);
        described_values_exist(protocol, a);
    }
    return a->row;
}

/* Returns whether a frame has a field with this meaning whose value differs from `value`. */
static bool described_differs(const struct described_arrival *a, enum described_meaning meaning,
                              int64_t value)
{
    int field = described_find_field(a->row, meaning);

    return field >= 0 && a->values[field] != value;
}

/* Returns whether the fields of the frame select an axis. */
static bool described_is_selected(const struct described_arrival *a,
                                  const struct described_node *node, unsigned axis)
{
    int slots = described_find_field(a->row, DESCRIBED_SLOTS_MASK);
    unsigned slot = node->first_slot + axis;

    /* Only a frame with a wrong value has fields that can be trusted */
    if (a->verdict == BOARD_MALFORMED && a->reason.why != DESCRIBED_WRONG_VALUE) {
        return true;
    }
    if (slots >= 0 &&
        (node->axes == 0 || slot >= DESCRIBED_SLOTS || !(a->values[slots] >> slot & 1))) {
        return false;
    }
    return !described_differs(a, DESCRIBED_ADDRESS, node->board.address) &&
           !described_differs(a, DESCRIBED_AXIS, axis);
}

/* Returns whether the counter repeats its last value. Any other value is valid, because frames may
 * be lost and a host may restart. */
static bool described_is_stuck(struct described_bus *bus, struct described_arrival *a)
{
    uint32_t *heard = &bus->heard[a->row - bus_protocol(bus)->frame][a->number];
    uint32_t before = *heard;

    if (a->row->counter < 0) {
        return false;
    }
    *heard = (uint32_t)a->values[a->row->counter] + 1;
    if (*heard == before) {
        described_note_reason(bus_protocol(bus), a, DESCRIBED_WRONG_COUNTER, *heard - 1,
                              described_wrap(&a->row->field[a->row->counter], *heard));
    }
    return *heard == before;
}

/* Passes a frame to `count` axes of a board, from axis `first` on. A sensor counts as one axis. */
static void described_board_receive(struct described_node *node, unsigned first, unsigned count,
                                    struct described_arrival *a)
{
    int reply = a->row->reply[described_kind_index(node->kind)];
    int period = described_find_field(a->row, DESCRIBED_TELEMETRY_PERIOD);
    bool replied = false, obeyed = false;

    if (!(a->row->of & node->kind)) {
        return;
    }
    /* The selected axes obey the frame */
    for (unsigned axis = first; axis < first + count; axis++) {
        if (a->row->selects && !described_is_selected(a, node, axis)) {
            continue;
        }
        a->listener = &node->board;
        board_hear(&node->board);
        if (a->verdict != BOARD_OBEYED) {
            continue;
        }
        if (a->row->only >= 0 && node->axis[axis].law != a->row->only) {
            a->refused = true;
            described_note_reason(node->protocol, a, DESCRIBED_WRONG_MODE, node->axis[axis].law,
                                  a->row->only);
            continue;
        }
        if (!obeyed && period >= 0) {
            double period_s = described_value(&a->row->field[period], a->values[period]);

            described_node_set_period(node, (int64_t)(period_s * 1e3 + 0.5));
        }
        obeyed = true;
        if (axis < node->axes && !described_axis_obey(node, axis, a->row, a->values)) {
            a->refused = true;
            described_note_reason(node->protocol, a, DESCRIBED_WRONG_LAW, 0, 0);
        }

        /* An answer by slot comes from each axis, others once per board */
        if (reply >= 0 && (!replied || node->protocol->frame[reply].by == DESCRIBED_BY_SLOT)) {
            described_node_answer(node, axis, (size_t)reply, a->row, a->values);
            replied = true;
        }
    }
    /* Restart after all axes have obeyed */
    if (obeyed && a->row->restart) {
        board_enter_bootloader(&node->board, node->board.config.boot_ns);
    }
}

/* Receives a frame of the bus (struct protocol). */
static void described_bus_receive(struct boards *boards, struct board_bus *of,
                                  const struct bus_frame *frame)
{
    struct described_bus *bus = described_bus_of(of);
    struct described_arrival a;

    a.frame = frame;
    a.refused = false;
    a.listener = NULL;
    if (!described_identify(bus_protocol(bus), &a)) {
        boards->counters.foreign++;
        return;
    }
    boards->reply = &a.row->time;
    if (a.verdict == BOARD_OBEYED && described_is_stuck(bus, &a)) {
        a.verdict = BOARD_MALFORMED;
    }
    if (a.row->by == DESCRIBED_BY_GROUP) {
        /* The frame of a group has one repetition per slot. Obey valid repetitions and skip invalid
         * ones. If one repetition is invalid, the frame counts as invalid. */
        const struct described_frame *row = a.row;
        const enum board_verdict whole = a.verdict;
        enum board_verdict verdict = whole;
        struct board *wrong = NULL;
        unsigned first = a.number * row->repeats;
        /* counts an incomplete last repetition of a malformed frame */
        unsigned more = a.verdict == BOARD_OBEYED ? 0u : row->length - 1u;
        unsigned count = (a.frame->len + more) / row->length;

        /* Bytes after the last repetition are CAN FD padding */
        count = count < row->repeats ? count : row->repeats;
        for (unsigned k = 0; k < count && first + k < bus->slots; k++) {
            struct described_node *node = bus->slot[first + k].node;

            if (board_is_deaf(&node->board)) {
                continue;
            }
            if (whole == BOARD_OBEYED) {
                described_decode(row, a.frame, k, a.values);
                a.verdict = row->nconstant > 0 && !described_has_constants(row, a.frame, k)
                                ? BOARD_UNKNOWN
                            : row->checked && !described_values_exist(bus_protocol(bus), &a)
                                ? BOARD_MALFORMED
                                : BOARD_OBEYED;
            }
            described_board_receive(node, bus->slot[first + k].axis, 1, &a);
            if (a.verdict != BOARD_OBEYED) {
                verdict = a.verdict;
                wrong = a.listener;
            }
        }
        a.verdict = verdict;
        a.listener = wrong ? wrong : a.listener;
        if (count == 0 && first < bus->slots) {
            a.listener = &bus->slot[first].node->board;
        }
    } else if (a.row->by == DESCRIBED_BY_SLOT) {
        const struct described_slot *slot = &bus->slot[a.number];

        if (a.number < bus->slots && !board_is_deaf(&slot->node->board)) {
            described_board_receive(slot->node, slot->axis, 1, &a);
        }
    } else {
        /* The board with an address, or all boards */
        bool all = a.row->by == DESCRIBED_BY_NONE;

        for (unsigned address = all ? 1 : a.number;
             address < (all ? bus->bus.address_end : a.number + 1); address++) {
            struct board *board = bus->bus.by_address[address];

            if (board && !board_is_deaf(board)) {
                struct described_node *node = described_node_of(board);

                described_board_receive(node, 0, node->axes ? node->axes : 1, &a);
            }
        }
    }
    /* Keep no reason of the last frame, which may have had no listener */
    boards->reason =
        a.refused || a.verdict == BOARD_MALFORMED ? a.reason : (struct board_reason){0};
    boards_count_frame(boards, a.listener, a.refused ? BOARD_MALFORMED : a.verdict, frame);
}

/* Resets the counters of all frames that have the identifier number `number`. */
static void described_forget_number(struct described_bus *bus, enum described_by by,
                                    unsigned number)
{
    for (size_t i = 0; i < bus_protocol(bus)->nframe; i++) {
        if (bus_protocol(bus)->frame[i].by == by) {
            bus->heard[i][number] = 0;
        }
    }
}

void described_bus_forget_counts(struct described_bus *bus, const struct described_node *node)
{
    described_forget_number(bus, DESCRIBED_BY_ADDRESS, node->board.address);
    for (unsigned axis = 0; axis < node->axes; axis++) {
        described_forget_number(bus, DESCRIBED_BY_SLOT, node->first_slot + axis);
    }
}

/* Adds a board to the bus. The axes of a motor board take the next slots (struct protocol). */
static bool described_bus_add_board(struct board_bus *bus, struct board *board, struct arena *arena)
{
    struct described_bus *described = described_bus_of(bus);

    (void)arena;
    for (unsigned i = 0; i < board_config_axes(&board->config); i++) {
        described->slot[described->slots++] =
            (struct described_slot){.node = described_node_of(board), .axis = i};
    }
    return true;
}

const struct board_bus_ops described_bus_ops = {
    .size = sizeof(struct described_bus),
    .add_board = described_bus_add_board,
    .remote = true,
    .extended = true,
    .receive = described_bus_receive,
};
