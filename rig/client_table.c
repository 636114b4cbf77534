/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the client table of a rig. The frames that configure boards come from the tasks' host,
 * reported values of protocols without a file from the DBC. */
#include "rig/client_table.h"

#include "base/array.h"
#include "boards/cia402/protocol.h"
#include "boards/described/protocol.h"
#include "boards/foc/protocol.h"
#include "boards/icub/protocol.h"
#include "boards/moteus/protocol.h"
#include "boards/protocol.h"
#include "rig/dbc.h"
#include "tasks/host.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define NO_FIELD "0|0@1+"

enum {
    ARENA_SIZE = 64 << 20,
    PERIOD_MS = 1,     /* telemetry period that clients ask for */
    STAGE_TICKS = 2,   /* ticks between two stages of clients */
    RESTART_TICKS = 5, /* longer than a restart takes */
};

struct client_table {
    const struct rig *rig;
    size_t bus;
    const struct dbc *dbc;
    FILE *out;
    int frames, reports; /* numbers of the next ones on the bus */
    /* described: number of the frame that axes share, by law, row and number; -1 = not written */
    int shared[DESCRIBED_POSITION + 1][DESCRIBED_FRAMES_MAX][DESCRIBED_SLOTS];
};

static const char *table_joint(const struct client_table *t, const struct board_axis_config *axis)
{
    return t->rig->robot->joint[axis->joint].name;
}

/* ---- frames ---- */

/* Writes the identifier and the format of a frame, after a word. */
static void table_put_head(const struct client_table *t, const char *word, uint32_t id,
                           unsigned flags)
{
    fprintf(t->out, "%s %0*" PRIX32 " %c", word, flags & FRAME_EXTENDED ? 8 : 3, id,
            flags & FRAME_FD       ? 'f'
            : flags & FRAME_REMOTE ? 'r'
                                   : 'c');
}

static void table_put_data(const struct client_table *t, const uint8_t *data, unsigned length)
{
    fputs(length ? " " : " -", t->out);
    for (unsigned i = 0; i < length; i++) {
        fprintf(t->out, "%02x", data[i]);
    }
}

/* Writes a frame without checksum and counter. Returns its number. */
static int table_put_frame(struct client_table *t, const struct bus_frame *frame)
{
    table_put_head(t, "frame", frame->id, frame->flags);
    table_put_data(t, frame->data, frame->len);
    fputs(" 0 0 -1 " NO_FIELD "\n", t->out);
    return t->frames++;
}

static void table_put_switch(struct client_table *t, const char *joint, const char *quantity,
                             int stage, int frame)
{
    fprintf(t->out, "switch %s %s %d %d " NO_FIELD " 0\n", joint, quantity, stage, frame);
}

/* Writes a frame of the host's start-up. */
static void table_visit_start_up(void *context, unsigned stage, const struct bus_frame *frame)
{
    struct client_table *t = context;

    const int number = table_put_frame(t, frame);

    fprintf(t->out, "setup %u %d\n", stage, number);
}

/* ---- signals of the DBC ---- */

static const char *dbc_whole_name(const char *name, const char *long_name)
{
    return long_name ? long_name : name;
}

static bool text_ends(const char *text, const char *end)
{
    const size_t length = strlen(text), size = strlen(end);

    return length >= size && !strcmp(text + length - size, end);
}

/* Returns the value of a signal's unit in SI units. */
static double signal_si(const struct dbc_signal *signal)
{
    return !strcmp(signal->unit, "mA")                                        ? 1e-3
           : !strcmp(signal->unit, "turn") || !strcmp(signal->unit, "turn/s") ? 2.0 * M_PI
                                                                              : 1.0;
}

/* Writes the place of a signal. */
static void signal_put_place(const struct dbc_signal *signal, FILE *out)
{
    fprintf(out, " %u|%u@%d%c", signal->start, signal->bits, !signal->big_endian,
            signal->type == DBC_FLOAT    ? 'f'
            : signal->type == DBC_SIGNED ? '-'
                                         : '+');
}

/* Returns the board of a node of the DBC; the host and the simulator come first. */
static const struct board_config *table_find_board(const struct client_table *t, int node)
{
    for (size_t i = 0; i < t->rig->boards.nboard; i++) {
        if (t->rig->boards.board[i].bus == (int)t->bus && node-- == 2) {
            return &t->rig->boards.board[i];
        }
    }
    return NULL;
}

static const char *const components[] = {"fx", "fy", "fz", "mx", "my", "mz"};

/* Returns the quantity of a client that a board's signal reports, NULL = none. The names begin with
 * those of the board and the joint, and the message's may end with the number of the axis. */
static const char *table_find_quantity(const struct dbc_message *message,
                                       const struct dbc_signal *signal)
{
    static const struct {
        const char *message, *signal, *quantity;
    } rows[] = {
        {"_MOTOR_POSITION", "_position", "motor_position"},
        {"_POSITION", "_position", "position"},
        {"_CURRENT", "_current", "current"},
        {"_STATUS", "_mode", "mode"},
        {"_STATUS", "_statusword", "mode"},
        {"_STATUS", "_fault", "faults"},
        {"_STATUS", "_faults", "faults"},
        {"_FORCE", "_torque", "torque"},
        {"_TORQUE", "_torque", "torque"},
        {"_FOC", "_position", "motor_position"},
        {"_FOC", "_velocity", "motor_velocity"},
        {"_FOC", "_current", "current"},
        {"_TELEMETRY", "_motor_encoder", "motor_position"},
        {"_TELEMETRY", "_deflection", "deflection"},
        {"_TELEMETRY", "_spring_torque", "torque"},
        {"_REPLY", "_abs_position", "position_in_turn"},
        {"_REPLY", "_mode", "mode"},
        {"_REPLY", "_position", "motor_position"},
        {"_REPLY", "_velocity", "motor_velocity"},
        {"_REPLY", "_torque", "torque"},
        {"_REPLY", "_fault", "faults"},
    };
    char kind[128];
    size_t size = (size_t)snprintf(kind, sizeof kind, "%s",
                                   dbc_whole_name(message->name, message->long_name));

    if (size > 2 && kind[size - 2] == '_' && kind[size - 1] <= '9') {
        kind[size - 2] = '\0';
    }
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        if (text_ends(kind, rows[i].message) &&
            text_ends(dbc_whole_name(signal->name, signal->long_name), rows[i].signal)) {
            return rows[i].quantity;
        }
    }
    return NULL;
}

/* Writes the values that the boards report by the signals of the DBC, and the names of modes. */
static void table_put_signals(struct client_table *t)
{
    const struct dbc_value *modes = NULL;

    for (const struct dbc_message *m = t->dbc->message; m; m = m->next) {
        const struct board_config *board = table_find_board(t, m->sender);
        bool written = false;

        for (const struct dbc_signal *s = m->signal; board && s; s = s->next) {
            const char *name = s->comment, *quantity = NULL;

            if (board->kind == BOARD_FT && s->role == DBC_PLAIN) {
                name = t->rig->robot->ft[board->ft].name;
                for (size_t i = 0; i < ARRAY_COUNT(components); i++) {
                    quantity = !strcmp(s->name, components[i]) ? s->name : quantity;
                }
            } else if (s->comment && s->role == DBC_PLAIN) {
                quantity = table_find_quantity(m, s);
            }
            if (!quantity) {
                continue;
            }
            if (!written) {
                table_put_head(t, "report", m->id & ~DBC_EXTENDED,
                               (m->id & DBC_EXTENDED ? FRAME_EXTENDED : 0) |
                                   (m->fd ? FRAME_FD : 0));
                fprintf(t->out, " 0 %" PRIX32 " - -\n", ~m->id_mask & 0x1fffffff);
                t->reports++;
                written = true;
            }
            fprintf(t->out, "value %s %s %d", name, quantity, t->reports - 1);
            /* A statusword has the state in its lower bits */
            if (!strcmp(quantity, "mode") && s->bits == 16) {
                fprintf(t->out, " %u|7@1+", s->start);
            } else {
                signal_put_place(s, t->out);
            }
            fprintf(t->out, " %.17g %.17g\n", s->scale * signal_si(s), s->offset * signal_si(s));
            modes = strcmp(quantity, "mode") != 0 || modes ? modes : s->value;
        }
    }
    for (; modes; modes = modes->next) {
        fprintf(t->out, "name %" PRId64 " %s\n", modes->number, modes->text);
    }
}

/* ---- icub and foc ---- */

/* Writes how an axis of an icub board, or of a foc board, is switched and commanded, and how its
 * gains are read. foc: number of the frame that has the targets of all foc boards; -1 = icub. */
static void icub_put_axis(struct client_table *t, const struct board_config *board, unsigned k,
                          int foc)
{
    const char *joint = table_joint(t, &board->axis[k]);
    const double supply_v = t->rig->supply_v;
    const uint8_t bit = k ? ICUB_AXIS_BIT : 0;
    const struct {
        const char *quantity, *mode;
        uint8_t value, command, gains, bits;
        double scale, most;
    } rows[] = {
        {"off", "", ICUB_MODE_FORCE_IDLE, 0, 0, 0, 0.0, 0.0},
        {"voltage", "open_loop", ICUB_MODE_OPEN_LOOP, ICUB_SET_OPEN_LOOP, 0, 16,
         supply_v / (foc < 0 ? ICUB_PWM_FULL_SCALE : FOC_PWM_FULL_SCALE), supply_v},
        {"current", "current", ICUB_MODE_CURRENT, ICUB_SET_DESIRED_TORQUE, ICUB_GET_CURRENT_PID, 32,
         1e-3, 1e300},
        {"position", "direct", ICUB_MODE_DIRECT, ICUB_SET_COMMAND_POSITION, ICUB_GET_POSITION_PID,
         32, 1.0 / board->axis[k].joint_ticks_per_rad, 1e300},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows) - (foc < 0 ? 0 : 1); i++) {
        struct bus_frame frame = {.id = icub_id(ICUB_POLLING_MOTOR, ICUB_HOST, board->address),
                                  .len = 2,
                                  .data = {ICUB_SET_CONTROL_MODE | bit, rows[i].value}};
        int number = table_put_frame(t, &frame);

        table_put_switch(t, joint, rows[i].quantity, 0, number);
        if (i == 0) {
            continue;
        }
        frame.data[0] = rows[i].command | bit;
        frame.data[1] = 0;
        frame.len = (uint8_t)(1 + rows[i].bits / 8);
        number = foc < 0 ? table_put_frame(t, &frame) : foc;
        fprintf(t->out, "set %s %s %d %u|%d@1- %.17g 0 %.17g %.17g %s\n", joint, rows[i].quantity,
                number, foc < 0 ? 8 : 16u * (board->address - 1u), foc < 0 ? rows[i].bits : 16,
                rows[i].scale, -rows[i].most, rows[i].most, rows[i].mode);
        if (foc >= 0 || !rows[i].gains) {
            continue;
        }
        frame.data[0] = rows[i].gains | bit;
        frame.len = 1;
        number = table_put_frame(t, &frame);
        fprintf(t->out, "ask %s %s %d\n", joint, rows[i].quantity, number);
        table_put_head(t, "report", icub_id(ICUB_POLLING_MOTOR, board->address, ICUB_HOST), 0);
        fprintf(t->out, " 0 1FFFFFFF ff %02x\n", frame.data[0]);
        for (int gain = 0; gain < 3; gain++) {
            fprintf(t->out, "value %s %s_gain %d %d|16@1- 1 0\n", joint, rows[i].quantity,
                    t->reports, 8 + 16 * gain);
        }
        t->reports++;
    }
}

/* ---- moteus ---- */

/* Writes the frames of a controller. Each of them also reads what the controller reports. */
static void moteus_put_axis(struct client_table *t, const char *joint, unsigned address)
{
    /* position, velocity, feed-forward torque, scale of kp, scale of kd */
    static const struct {
        const char *quantity;
        float value[5];
        int set;
    } rows[] = {
        {"torque", {NAN, 0.0f, 0.0f, 0.0f, 0.0f}, 2},
        {"velocity", {NAN, 0.0f, 0.0f, 0.0f, 1.0f}, 1},
        {"position", {0.0f, 0.0f, 0.0f, 1.0f, 1.0f}, 0},
        {"off", {0.0f}, -1},
        {"", {0.0f}, -1},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        uint8_t command[32] = {MOTEUS_WRITE | MOTEUS_INT8 | 1,
                               MOTEUS_R_MODE,
                               MOTEUS_STOPPED,
                               MOTEUS_WRITE | MOTEUS_FLOAT,
                               5,
                               MOTEUS_R_POSITION_COMMAND};
        unsigned length = rows[i].set >= 0 ? 26 : *rows[i].quantity ? 3 : 0;
        struct bus_frame frame;
        int number;

        command[2] = rows[i].set >= 0 ? MOTEUS_POSITION : MOTEUS_STOPPED;
        for (int k = 0; k < 5; k++) {
            uint32_t bits;

            memcpy(&bits, &rows[i].value[k], sizeof bits);
            put_u32_le(command + 6 + 4 * k, bits);
        }
        frame = moteus_query(address, command, length);
        number = table_put_frame(t, &frame);
        if (rows[i].set >= 0) {
            fprintf(t->out, "set %s %s %d %d|32@1f %.17g 0 -1e300 1e300 position\n", joint,
                    rows[i].quantity, number, 8 * (6 + 4 * rows[i].set),
                    rows[i].set < 2 ? 2.0 * M_PI : 1.0);
        } else if (length) {
            table_put_switch(t, joint, rows[i].quantity, 0, number);
        } else {
            fprintf(t->out, "cycle %d %s\n", number, joint);
        }
    }
}

/* ---- cia402 ---- */

/* Writes a frame that writes 0, or a value, to an object. Returns its number. */
static int cia402_put_write(struct client_table *t, unsigned node, unsigned index, unsigned bytes,
                            int value)
{
    struct bus_frame frame = {.id = CIA402_SDO_REQUEST + node, .len = CIA402_SDO_LENGTH};

    frame.data[0] = (uint8_t)(CIA402_DOWNLOAD | (4 - bytes) << 2 | CIA402_EXPEDITED | CIA402_SIZED);
    put_u16_le(frame.data + 1, (uint16_t)index);
    frame.data[4] = (uint8_t)value;
    return table_put_frame(t, &frame);
}

/* Writes the questions for the two gains of a loop, objects 0xIIIISS, and the answers' fields. */
static void cia402_put_gains(struct client_table *t, const char *joint, const char *quantity,
                             unsigned node, unsigned step, const unsigned gain[2])
{
    for (int i = 0; i < 2 && gain[i]; i++) {
        const unsigned index = (gain[i] >> 8) + step, sub = gain[i] & 0xff;
        struct bus_frame ask = {
            .id = CIA402_SDO_REQUEST + node,
            .len = CIA402_SDO_LENGTH,
            .data = {CIA402_UPLOAD, (uint8_t)index, (uint8_t)(index >> 8), (uint8_t)sub}};
        const int frame = table_put_frame(t, &ask);

        fprintf(t->out, "ask %s %s %d\n", joint, quantity, frame);
        table_put_head(t, "report", CIA402_SDO_REPLY + node, 0);
        fprintf(t->out, " 8 1FFFFFFF 00ffffff 00%02x%02x%02x\n", index & 0xff, index >> 8, sub);
        fprintf(t->out, "value %s %s_gain %d 32|32@1- 1 0\n", joint, quantity, t->reports++);
    }
}

/* Writes the set points of an axis. The voltages of a node share a frame; other set points are
 * objects. */
static void cia402_put_axis(struct client_table *t, const struct board_config *board, unsigned k,
                            int voltages, int controls)
{
    const struct board_axis_config *axis = &board->axis[k];
    const struct {
        const char *quantity;
        unsigned index, bytes;
        int mode;
        double scale, most;
        unsigned gain[2];
    } rows[] = {
        {"voltage", 0, 2, CIA402_VOLTAGE_MODE, CIA402_VOLTAGE_V, t->rig->supply_v, {0}},
        /* in thousandths of the rated torque, which is whole N mm */
        {"torque",
         0x6071,
         2,
         10,
         1e-6 * rint(1e3 * axis->current_limit_a * axis->bemf_v_s_rad),
         1e300,
         {0}},
        {"velocity", 0x60ff, 4, 9, CIA402_POSITION_RAD, 1e300, {0x401501, 0x401502}},
        {"position", 0x607a, 4, 8, CIA402_POSITION_RAD, 1e300, {0x401600, 0x401503}},
    };
    static const unsigned off[] = {0, CIA402_CW_FAULT_RESET, 0};
    static const unsigned on[] = {CIA402_CW_SHUTDOWN, CIA402_CW_SWITCH_ON_ONLY, CIA402_CW_ENABLE};
    const char *joint = table_joint(t, axis);

    for (int stage = 0; stage < 3; stage++) {
        fprintf(t->out, "switch %s off %d %d %u|16@1+ %u\n", joint, stage, controls, 16 * k,
                off[stage]);
    }
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        const unsigned step = CIA402_AXIS_STEP * k;
        int frame = voltages;

        if (axis->valve && i == 1) {
            continue;
        }
        table_put_switch(
            t, joint, rows[i].quantity, 0,
            cia402_put_write(t, board->address, CIA402_O_MODE + step, 1, rows[i].mode));
        for (int stage = 0; stage < 3; stage++) {
            fprintf(t->out, "switch %s %s %d %d %u|16@1+ %u\n", joint, rows[i].quantity, stage + 1,
                    controls, 16 * k, on[stage]);
        }
        if (rows[i].index) {
            frame = cia402_put_write(t, board->address, rows[i].index + step, rows[i].bytes, 0);
        }
        fprintf(t->out, "set %s %s %d %u|%u@1- %.17g 0 %.17g %.17g enabled\n", joint,
                rows[i].quantity, frame, rows[i].index ? 32 : 16 * k, 8 * rows[i].bytes,
                rows[i].scale, -rows[i].most, rows[i].most);
        cia402_put_gains(t, joint, rows[i].quantity, board->address, step, rows[i].gain);
    }
    /* EMCY has the faults of one axis, or the end of all faults */
    for (int gone = 0; gone < 2; gone++) {
        table_put_head(t, "report", CIA402_EMCY + board->address, 0);
        fprintf(t->out, " 8 1FFFFFFF %s 0000%02x%02x\n", gone ? "ffff0000" : "000000ff", 0,
                gone ? 0 : k);
        fprintf(t->out, "value %s faults %d 32|32@1+ 1 0\n", joint, t->reports++);
    }
}

/* Writes the axes of a node. */
static void cia402_put_board(struct client_table *t, const struct board_config *board,
                             unsigned axes)
{
    struct bus_frame frame = {.id = CIA402_RPDO + board->address, .len = (uint8_t)(2 * axes)};
    const int voltages = table_put_frame(t, &frame);

    frame.id += 0x100;
    table_put_frame(t, &frame);
    for (unsigned k = 0; k < axes; k++) {
        if (board->axis[k].joint >= 0) {
            cia402_put_axis(t, board, k, voltages, voltages + 1);
        }
    }
}

/* ---- described protocols ---- */

/* A frame of a protocol file to write for an axis. law: that of the set point, DESCRIBED_OFF =
 * none. selected: the law to select; NULL = the file's. */
struct described_letter {
    const struct described_protocol *protocol;
    const struct described_frame *row;
    unsigned model; /* of the board, which scales fields */
    unsigned number, parts, address, axis, slot;
    enum described_law law;
    const struct described_state *state, *selected;
    bool blank; /* only the constants, for a message of the DBC */
};

/* Returns the count of a field with a set point of 0. */
static int64_t letter_count(const struct described_letter *letter, const struct described_field *of)
{
    const struct described_field scaled =
        described_model_field(letter->protocol, letter->model, of);
    const struct described_field *field = &scaled;
    const bool set = letter->law != DESCRIBED_OFF;

    switch (letter->blank && field->meaning != DESCRIBED_CONSTANT ? DESCRIBED_COUNTER
                                                                  : field->meaning) {
    case DESCRIBED_CONSTANT:
        return field->constant;
    case DESCRIBED_SLOTS_MASK:
        return INT64_C(1) << letter->slot;
    case DESCRIBED_ADDRESS:
        return letter->address;
    case DESCRIBED_AXIS:
        return letter->axis;
    case DESCRIBED_STATE:
        return letter->state->value;
    case DESCRIBED_LAW:
        return letter->selected ? letter->selected->value : described_count(field, field->host);
    case DESCRIBED_TELEMETRY_PERIOD:
        return described_count(field, 1e-3 * PERIOD_MS);
    case DESCRIBED_TO_KP:
        return described_count(field, !set || letter->law == DESCRIBED_POSITION ? field->host : 0);
    case DESCRIBED_TO_KD:
        return described_count(field, letter->law != DESCRIBED_TORQUE ? field->host : 0);
    case DESCRIBED_COUNTER:
    case DESCRIBED_SET_POINT:
        return 0;
    case DESCRIBED_TO_VOLTAGE:
    case DESCRIBED_TO_CURRENT:
    case DESCRIBED_TO_TORQUE:
    case DESCRIBED_TO_VELOCITY:
    case DESCRIBED_TO_POSITION:
        return described_count(field, 0.0);
    default:
        return described_count(field, field->host);
    }
}

/* Writes the place of a field in the repetition that begins at a byte. */
static void described_put_place(const struct described_field *field, unsigned after, FILE *out)
{
    const unsigned bits = 64 - (unsigned)__builtin_clzll(field->mask);
    const bool big = field->big_endian && !field->in_id;
    /* from the most significant bit of byte 0 on */
    const unsigned first = 8 * (field->byte + after) + 64 - field->shift - bits;

    fprintf(out, " %u|%u@%d%c",
            field->in_id ? 512u + field->shift
            : big        ? first ^ 7
                         : 8 * (field->byte + after) + field->shift,
            bits, !big,
            field->real   ? 'f'
            : field->sign ? '-'
                          : '+');
}

/* Writes a frame with its checksum and its counter. Returns its number. */
static int described_put_frame(struct client_table *t, const struct described_letter *letter)
{
    const struct described_frame *row = letter->row;
    struct bus_frame frame = {.id = described_id(row, letter->number), .flags = row->flags};
    const int counter = (int)(row - t->rig->bus[t->bus].described->frame) * DESCRIBED_SLOTS;

    for (unsigned part = 0; part < letter->parts; part++) {
        for (size_t i = 0; i < row->nfield; i++) {
            described_put(&row->field[i], letter_count(letter, &row->field[i]), part * row->length,
                          &frame);
        }
    }
    frame.len = row->remote ? 0 : described_length(row, letter->parts);
    table_put_head(t, "frame", frame.id, frame.flags);
    table_put_data(t, frame.data, frame.len);
    fprintf(t->out, " %d %u %d", row->checksum, row->checksum_byte,
            row->counter < 0 ? -1 : counter + (int)letter->number);
    if (row->counter < 0) {
        fputs(" " NO_FIELD, t->out);
    } else {
        described_put_place(&row->field[row->counter], 0, t->out);
    }
    fputc('\n', t->out);
    return t->frames++;
}

/* Returns the number of a frame's identifier for an axis. */
static unsigned letter_number(const struct described_letter *letter)
{
    const struct described_frame *row = letter->row;

    return row->by == DESCRIBED_BY_ADDRESS ? letter->address
           : row->by == DESCRIBED_BY_SLOT  ? letter->slot
           : row->by == DESCRIBED_BY_GROUP ? letter->slot / row->repeats
                                           : 0;
}

/* Writes a frame for an axis, or finds the one that it shares with other axes: of a group, or of
 * the board. slots: axes of the bus. */
static int described_share_frame(struct client_table *t, struct described_letter *letter,
                                 unsigned slots)
{
    const struct described_protocol *p = t->rig->bus[t->bus].described;
    const struct described_frame *row = letter->row;
    const bool grouped = row->by == DESCRIBED_BY_GROUP;
    int *shared;

    letter->number = letter_number(letter);
    letter->parts = 1;
    if (!grouped && (row->of_one || p->axes == 1)) {
        return described_put_frame(t, letter);
    }
    shared = &t->shared[grouped ? DESCRIBED_OFF : letter->law][row - p->frame][letter->number];
    if (*shared < 0) {
        if (grouped) {
            const unsigned left = slots - letter->number * row->repeats;

            letter->parts = left < row->repeats ? left : row->repeats;
        }
        *shared = described_put_frame(t, letter);
    }
    return *shared;
}

/* Returns the field with the set point of a law for an axis of a board; NULL = none. */
static const struct described_field *described_find_target(const struct described_frame *row,
                                                           enum described_law law, unsigned axis)
{
    for (size_t i = 0; row->from_host && i < row->nfield; i++) {
        const struct described_field *field = &row->field[i];

        if ((field->meaning == DESCRIBED_SET_POINT ||
             field->meaning == described_law_target(law)) &&
            (row->of_one || row->by == DESCRIBED_BY_GROUP || field->axis == axis)) {
            return field;
        }
    }
    return NULL;
}

/* Returns whether boards obey a frame under a law, which the frame itself or the host's start-up
 * selects. selected: index of the law, -1 = the state has a law of its own. */
static bool described_obeys(const struct described_protocol *p, const struct described_frame *row,
                            int selected)
{
    bool selects = false;

    if (selected < 0 || row->select >= 0) {
        return selected < 0 || row->select == selected;
    }
    for (size_t i = 0; i < p->host.on.count; i++) {
        selects =
            selects || described_find_field(&p->frame[p->host.on.frame[i]], DESCRIBED_LAW) >= 0;
    }
    return (row->only < 0 || row->only == selected) &&
           (selects || (p->host.law == DESCRIBED_SELECTED ? selected == 0
                                                          : p->law[selected].law == p->host.law));
}

/* Returns the frame that commands a set point of a law: one of the host's, or else any. An
 * impedance moves nothing by a position or a velocity whose gain is 0. selected: as in
 * described_obeys. */
static const struct described_frame *described_find_command(const struct described_protocol *p,
                                                            enum described_law law, unsigned axis,
                                                            bool impedance, int selected)
{
    const enum described_meaning gain = law == DESCRIBED_POSITION   ? DESCRIBED_TO_KP
                                        : law == DESCRIBED_VELOCITY ? DESCRIBED_TO_KD
                                                                    : DESCRIBED_NOTHING;

    for (size_t i = 0; i < p->host.command.count + p->nframe; i++) {
        const struct described_frame *row = i < p->host.command.count
                                                ? &p->frame[p->host.command.frame[i]]
                                                : &p->frame[i - p->host.command.count];
        const int field = gain ? described_find_field(row, gain) : -1;

        if (described_find_target(row, law, axis) && described_obeys(p, row, selected) &&
            !(impedance && field >= 0 && !(fabs(row->field[field].host) > 0.0))) {
            return row;
        }
    }
    return NULL;
}

/* Finds the state, and the law to select in it, in which an axis takes set points of a law. Returns
 * the frame that commands them; NULL = none. */
static const struct described_frame *described_find_state_of(const struct described_protocol *p,
                                                             struct described_letter *letter)
{
    bool told = false;

    for (size_t i = 0; i < p->host.on.count; i++) {
        told = told || described_find_field(&p->frame[p->host.on.frame[i]], DESCRIBED_STATE) >= 0;
    }
    for (size_t i = 0; i < p->nstate; i++) {
        const struct described_state *state = &p->state[i];
        const bool selects = state->law == DESCRIBED_SELECTED;

        for (size_t k = 0; k < (selects ? p->nlaw : 1) && (told || (int)i == p->host.on_state);
             k++) {
            const enum described_law law = selects ? p->law[k].law : state->law;
            const bool impedance = law == DESCRIBED_IMPEDANCE && letter->law >= DESCRIBED_TORQUE;

            if (law == letter->law || impedance) {
                letter->state = state;
                letter->selected = selects ? &p->law[k] : NULL;
                letter->row = described_find_command(p, letter->law, letter->axis, impedance,
                                                     selects ? (int)k : -1);
                if (letter->row) {
                    return letter->row;
                }
            }
        }
    }
    return NULL;
}

/* Writes the frames that switch an axis for set points of a law, or off. */
static void described_put_switch(struct client_table *t, const char *joint,
                                 struct described_letter letter, unsigned slots)
{
    const struct described_protocol *p = t->rig->bus[t->bus].described;
    const bool on = letter.law != DESCRIBED_OFF;
    const struct described_list *list = on ? &p->host.on : &p->host.off;

    for (size_t i = 0; i < list->count; i++) {
        int frame, field;

        letter.row = &p->frame[list->frame[i]];
        if (on && letter.row->commands) {
            continue; /* the set point itself switches the axis on */
        }
        frame = described_share_frame(t, &letter, slots);
        field = described_find_field(letter.row, DESCRIBED_STATE);
        /* In a frame for the axes of a board, only the state of this axis changes */
        while (field >= 0 && !letter.row->of_one && (size_t)field < letter.row->nfield &&
               (letter.row->field[field].meaning != DESCRIBED_STATE ||
                letter.row->field[field].axis != letter.axis)) {
            field++;
        }
        if (field >= 0 && (size_t)field < letter.row->nfield) {
            fprintf(t->out, "switch %s %s 0 %d", joint, on ? described_law_word(letter.law) : "off",
                    frame);
            described_put_place(&letter.row->field[field], 0, t->out);
            fprintf(t->out, " %" PRId64 "\n", letter.state->value);
        } else {
            table_put_switch(t, joint, on ? described_law_word(letter.law) : "off", 0, frame);
        }
    }
}

/* Writes how an axis is switched and commanded. */
static void described_put_axis(struct client_table *t, const char *joint,
                               const struct board_config *board, unsigned axis, unsigned slot,
                               unsigned slots)
{
    const struct described_protocol *p = t->rig->bus[t->bus].described;
    const enum described_law usual = p->state[p->host.on_state].law;
    struct described_letter letter = {.protocol = p,
                                      .model = board->model,
                                      .address = board->address,
                                      .axis = axis,
                                      .slot = slot,
                                      .state = &p->state[p->host.off_state]};

    described_put_switch(t, joint, letter, slots);
    for (int i = 0; i <= DESCRIBED_POSITION; i++) {
        const struct described_field *field;
        struct described_field scaled;
        unsigned after;
        double scale, most;
        int frame;

        /* The usual law first */
        letter.law = i == 0 ? usual : (enum described_law)i;
        if ((i > 0 && letter.law == usual) || letter.law < DESCRIBED_VOLTAGE ||
            letter.law > DESCRIBED_POSITION || !described_find_state_of(p, &letter)) {
            continue;
        }
        field = described_find_target(letter.row, letter.law, axis);
        after = letter.row->by == DESCRIBED_BY_GROUP
                    ? slot % letter.row->repeats * letter.row->length
                    : 0;
        scaled = described_model_field(p, board->model, field);
        scale =
            field->meaning == DESCRIBED_SET_POINT ? letter.state->set_point_scale : scaled.scale;
        most = letter.law == DESCRIBED_VOLTAGE ? t->rig->supply_v : 1e300;
        frame = described_share_frame(t, &letter, slots);
        fprintf(t->out, "set %s %s %d", joint, described_law_word(letter.law), frame);
        described_put_place(field, after, t->out);
        fprintf(t->out, " %.17g %.17g %.17g %.17g %s\n", scale,
                field->meaning == DESCRIBED_SET_POINT ? 0.0 : scaled.offset, -most, most,
                letter.state->name);
        described_put_switch(t, joint, letter, slots);
    }
}

/* Returns the quantity of a client that a field reports; NULL = none. */
static const char *described_find_quantity(const struct described_protocol *p,
                                           enum described_meaning meaning)
{
    switch (meaning) {
    case DESCRIBED_MOTOR_POSITION:
    case DESCRIBED_DEFLECTION:
    case DESCRIBED_MOTOR_VELOCITY:
    case DESCRIBED_AXIS_CURRENT:
    case DESCRIBED_AXIS_TORQUE:
    case DESCRIBED_FAULTS:
        return described_meaning_name(meaning, false);
    case DESCRIBED_LINK_POSITION:
        return "position";
    case DESCRIBED_DRIVE_TORQUE:
        return p->tells[DESCRIBED_AXIS_TORQUE] ? NULL : "torque";
    case DESCRIBED_STATE:
        return "mode";
    default:
        return NULL;
    }
}

/* Writes a report of a board, or of an axis: the parts of data that identify it. */
static void described_put_report(struct client_table *t, const struct described_letter *letter)
{
    const struct described_frame *row = letter->row;
    struct bus_frame value = {.len = row->length}, mask = {.len = row->length};

    value.id = described_id(row, letter->number);
    for (size_t i = 0; i < row->nfield; i++) {
        struct described_field field = row->field[i];

        if (field.meaning == DESCRIBED_CONSTANT || field.meaning == DESCRIBED_ADDRESS ||
            field.meaning == DESCRIBED_AXIS) {
            described_put(&field, letter_count(letter, &field), 0, &value);
            field.low = INT64_MIN;
            field.high = INT64_MAX;
            described_put(&field, -1, 0, &mask);
        }
    }
    table_put_head(t, "report", value.id, row->flags);
    fprintf(t->out, " %u %" PRIX32, row->length, (~row->mask & 0x1fffffff) | mask.id);
    table_put_data(t, mask.data, mask.len);
    table_put_data(t, value.data, value.len);
    fputc('\n', t->out);
    t->reports++;
}

/* The axes of a described bus, by slot. */
struct described_axes {
    unsigned count;
    const struct board_config *board[DESCRIBED_SLOTS];
    unsigned axis[DESCRIBED_SLOTS];
};

/* Writes a frame that an axis reports, in its first part or in a later one. */
static void described_put_values(struct client_table *t, const struct described_axes *axes,
                                 const struct described_frame *row, unsigned slot)
{
    const struct board_config *board = axes->board[slot];
    const struct described_protocol *p = t->rig->bus[t->bus].described;
    const struct described_letter letter = {.protocol = p,
                                            .row = row,
                                            .model = board->model,
                                            .address = board->address,
                                            .axis = axes->axis[slot],
                                            .slot = slot};
    const bool grouped = row->by == DESCRIBED_BY_GROUP;
    const bool of_axis =
        row->by == DESCRIBED_BY_SLOT || described_find_field(row, DESCRIBED_AXIS) >= 0;
    const unsigned first = grouped ? slot % row->repeats : of_axis ? 0 : axes->axis[slot];
    struct described_letter named = letter;

    named.number = letter_number(&letter);
    /* One report for all axes of a group or of a board */
    if (of_axis || first == 0) {
        described_put_report(t, &named);
    }
    for (size_t i = 0; i < row->nfield; i++) {
        const struct described_field scaled =
            described_model_field(p, board->model, &row->field[i]);
        const struct described_field *field = &scaled;
        const char *quantity = described_find_quantity(p, field->meaning);
        const bool repeated = row->repeats > 1;

        if (quantity && board->axis[axes->axis[slot]].joint >= 0 &&
            (of_axis || repeated || field->axis == first)) {
            fprintf(t->out, "value %s %s %d", table_joint(t, &board->axis[axes->axis[slot]]),
                    quantity, t->reports - 1);
            described_put_place(field, repeated ? first * row->length : 0, t->out);
            fprintf(t->out, " %.17g %.17g\n",
                    field->meaning == DESCRIBED_FAULTS || field->meaning == DESCRIBED_STATE
                        ? 1.0
                        : field->scale,
                    field->offset);
        }
    }
}

/* Writes the frames that a force-torque board reports. */
static void described_put_sensor(struct client_table *t, const struct board_config *board)
{
    const struct described_protocol *p = t->rig->bus[t->bus].described;

    for (const struct described_frame *row = p->frame; row < p->frame + p->nframe; row++) {
        struct described_letter letter = {
            .protocol = p, .row = row, .model = board->model, .address = board->address};
        bool written = false;

        letter.number = letter_number(&letter);
        for (size_t i = 0; !row->from_host && row->of & DESCRIBED_FT && i < row->nfield; i++) {
            const struct described_field *field = &row->field[i];
            const unsigned channel = field->meaning - DESCRIBED_FT_CHANNEL;

            if (channel >= ARRAY_COUNT(components)) {
                continue;
            }
            if (!written) {
                described_put_report(t, &letter);
                written = true;
            }
            fprintf(t->out, "value %s %s %d", t->rig->robot->ft[board->ft].name,
                    components[channel], t->reports - 1);
            described_put_place(field, 0, t->out);
            fprintf(t->out, " %.17g %.17g\n", field->scale, field->offset);
        }
    }
}

/* Writes the axes of a bus whose protocol a file describes. */
static void described_put_bus(struct client_table *t)
{
    const struct described_protocol *p = t->rig->bus[t->bus].described;
    struct described_axes axes = {.count = 0};

    memset(t->shared, -1, sizeof t->shared);
    for (size_t i = 0; i < t->rig->boards.nboard; i++) {
        const struct board_config *board = &t->rig->boards.board[i];

        if (board->bus == (int)t->bus && board->kind == BOARD_FT) {
            described_put_sensor(t, board);
        }
        for (unsigned k = 0; board->bus == (int)t->bus && board->kind == BOARD_MOTOR &&
                             k < p->axes && board->axis[k].joint >= 0;
             k++) {
            axes.board[axes.count] = board;
            axes.axis[axes.count++] = k;
        }
    }
    for (size_t i = 0; i < p->nstate; i++) {
        if (p->state[i].law != DESCRIBED_REFUSED) {
            fprintf(t->out, "name %" PRId64 " %s\n", p->state[i].value, p->state[i].name);
        }
    }
    for (size_t i = 0; i < p->nframe; i++) {
        if (p->frame[i].from_host && !p->frame[i].remote && p->frame[i].repeats <= 1) {
            /* Write the constants, the checksum and the counter of each message of the DBC that has
             * them */
            const struct described_frame *row = &p->frame[i];
            uint32_t written = 0;

            for (unsigned slot = 0; slot < axes.count && row->nconstant < row->nfield; slot++) {
                struct described_letter letter = {.protocol = t->rig->bus[t->bus].described,
                                                  .row = row,
                                                  .model = axes.board[slot]->model,
                                                  .parts = 1,
                                                  .address = axes.board[slot]->address,
                                                  .slot = slot,
                                                  .blank = true};

                letter.number = letter_number(&letter);
                if ((row->checksum || row->counter >= 0 || row->nconstant > 0) &&
                    !(written >> letter.number & 1)) {
                    written |= UINT32_C(1) << letter.number;
                    described_put_frame(t, &letter);
                }
            }
        }
    }
    for (unsigned slot = 0; slot < axes.count; slot++) {
        described_put_axis(t, table_joint(t, &axes.board[slot]->axis[axes.axis[slot]]),
                           axes.board[slot], axes.axis[slot], slot, axes.count);
    }
    for (size_t i = 0; i < p->nframe; i++) {
        for (unsigned slot = 0; !p->frame[i].from_host && p->frame[i].of & DESCRIBED_MOTOR &&
                                p->frame[i].nread > 0 && slot < axes.count;
             slot++) {
            described_put_values(t, &axes, &p->frame[i], slot);
        }
    }
}

/* ---- the rig ---- */

/* Writes how the joints of a bus are commanded. */
static void table_put_joints(struct client_table *t)
{
    const struct protocol *protocol = t->rig->bus[t->bus].protocol;
    int targets = -1;

    if (!strcmp(protocol->name, "foc")) {
        const struct bus_frame frame = {.id = FOC_DESIRED_TARGETS_ID, .len = FOC_TARGETS_LENGTH};

        targets = table_put_frame(t, &frame);
    }
    for (size_t i = 0; i < t->rig->boards.nboard; i++) {
        const struct board_config *board = &t->rig->boards.board[i];
        unsigned axes = BOARD_AXES_MAX;

        while (axes > 0 && board->axis[axes - 1].joint < 0) {
            axes--;
        }
        if (board->bus != (int)t->bus || board->kind != BOARD_MOTOR) {
            continue;
        }
        if (!strcmp(protocol->name, "cia402")) {
            cia402_put_board(t, board, axes);
        }
        for (unsigned k = 0; k < axes; k++) {
            if (board->axis[k].joint < 0) {
                continue;
            }
            if (!strcmp(protocol->name, "moteus")) {
                moteus_put_axis(t, table_joint(t, &board->axis[k]), board->address);
            } else if (!t->rig->bus[t->bus].described && strcmp(protocol->name, "cia402") != 0) {
                icub_put_axis(t, board, k, targets);
            }
        }
    }
    if (!strcmp(protocol->name, "cia402")) {
        const struct bus_frame sync = {.id = CIA402_SYNC};

        /* Write the name of each state of a drive, for its bits of the statusword */
        static const struct {
            unsigned mask, bits;
            const char *name;
        } states[] = {
            {0x4f, 0x00, "not_ready"},      {0x4f, 0x40, "switch_on_disabled"},
            {0x6f, 0x21, "ready"},          {0x6f, 0x23, "switched_on"},
            {0x6f, 0x27, "enabled"},        {0x6f, 0x07, "quick_stop"},
            {0x4f, 0x0f, "fault_reaction"}, {0x4f, 0x08, "fault"},
        };

        for (unsigned word = 0; word < 0x80; word++) {
            for (size_t i = 0; i < ARRAY_COUNT(states); i++) {
                if ((word & states[i].mask) == states[i].bits) {
                    fprintf(t->out, "name %u %s\n", word, states[i].name);
                }
            }
        }
        fprintf(t->out, "cycle %d -\n", table_put_frame(t, &sync));
    }
}

/* Writes the rows of a bus. */
static enum error_code table_put_bus(struct client_table *t, struct host *host, struct arena *arena,
                                     struct error *error)
{
    const struct rig_bus *bus = &t->rig->bus[t->bus];
    const struct loop_lockstep *lockstep = &t->rig->lockstep;
    struct dbc *dbc;
    enum error_code code = rig_dbc(t->rig, t->bus, arena, &dbc, error);
    int64_t restart_ns = 0;

    if (code) {
        return code;
    }
    t->dbc = dbc;
    t->frames = t->reports = 0;
    for (size_t i = 0; i < t->rig->boards.nboard; i++) {
        const struct board_config *board = &t->rig->boards.board[i];

        if (board->bus == (int)t->bus && board->restart_ns > restart_ns) {
            restart_ns = board->restart_ns;
        }
    }
    fprintf(t->out, "bus %s %s %s %" PRIx32 " %" PRIx32 " %d\n", bus->name, bus->interface,
            bus->protocol->needs_file ? bus->described->name : bus->protocol->name,
            lockstep->bus == (int)t->bus ? lockstep->step_id : UINT32_MAX, lockstep->done_id,
            !bus->described && strcmp(bus->protocol->name, "icub") != 0);
    host_visit_start_up(host, t->bus,
                        (unsigned)(restart_ns / t->rig->tick_ns + RESTART_TICKS) / STAGE_TICKS,
                        table_visit_start_up, t);
    table_put_joints(t);
    if (bus->described) {
        described_put_bus(t);
    } else {
        table_put_signals(t);
    }

    /* Write the messages of a bus with their signals */
    fprintf(t->out, "messages %s\n", t->rig->bus[t->bus].name);
    for (const struct dbc_message *m = t->dbc->message; m; m = m->next) {
        table_put_head(t, "message", m->id & ~DBC_EXTENDED,
                       (m->id & DBC_EXTENDED ? FRAME_EXTENDED : 0) | (m->fd ? FRAME_FD : 0));
        fprintf(t->out, " %u %s\n", m->length, dbc_whole_name(m->name, m->long_name));
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            fprintf(t->out, "signal");
            signal_put_place(s, t->out);
            fprintf(t->out, " %.17g %.17g %d %u %s\n", s->scale, s->offset,
                    s->role == DBC_PLAIN         ? -1
                    : s->role == DBC_MULTIPLEXOR ? -2
                                                 : (int)s->selector,
                    s->frame_length ? s->frame_length : m->length,
                    dbc_whole_name(s->name, s->long_name));
        }
    }
    return ERROR_NONE;
}

enum error_code rig_client_table(const struct rig *rig, FILE *out, struct error *error)
{
    struct host_config config = rig_host_config(rig, NULL, false);
    struct client_table t = {.rig = rig, .out = out};
    struct arena arena;
    struct host *host = NULL;
    enum error_code code = arena_init(&arena, ARENA_SIZE, error);

    config.period_ns = INT64_C(1000000) * PERIOD_MS;
    code = code ? code : host_create(&config, &arena, &host, error);
    fprintf(out, "rig %s\n", rig->name);
    for (size_t i = 0; i < rig->naxis; i++) {
        fprintf(out, "joint %s %s\n", rig->axis[i].joint, rig->bus[rig->axis[i].bus].name);
    }
    for (size_t i = 0; i < rig->nft; i++) {
        fprintf(out, "sensor %s %s\n", rig->ft[i].name, rig->bus[rig->ft[i].bus].name);
    }
    for (; t.bus < rig->nbus && !code; t.bus++) {
        code = table_put_bus(&t, host, &arena, error);
    }
    arena_fini(&arena);
    return code;
}
