/* SPDX-License-Identifier: Apache-2.0 */
/* A rig's messages as a DBC database; see the header. */
#include "rig/dbc.h"

#include "boards/compact/protocol.h"
#include "boards/foc/protocol.h"
#include "boards/messages.h"

#include <math.h>
#include <string.h>

enum { HOST = 0, SIMULATOR = 1, FIRST_BOARD = 2 }; /* nodes */
enum { IDS = 0x800, NAME_SIZE = DBC_NAME_MAX + 1, NODE_LETTERS = 14, AXIS_BIT = 0x80 };
enum { NO_AXIS = -1 };

static const char everyone[] = "ALL"; /* in the place of the board, when all are meant */

struct exporter {
    const struct rig *rig;
    size_t bus;
    enum board_personality personality;
    struct dbc *dbc;
    struct error *error;
    enum error_code code;
    uint8_t longest[IDS]; /* frame of an identifier */
};

/* A field on its way to be a signal. */
struct place {
    const struct message *message;
    const struct field *field;
    unsigned bit; /* where it starts in the frame */
    int repeat;   /* of message->repeats */
    int command;  /* value of byte 0, MESSAGE_NO_CODE: none */
    int index;    /* of the field in its list, padding aside */
};

/* ---- names ---- */

/* before, the words with so many letters of each, after; false when that is too long */
static bool build_name(char name[NAME_SIZE], const char *before, const char *words,
                       const char *after, int letters)
{
    char cut[256];
    size_t size = 0;
    int of_word = 0;

    for (; *words && size < sizeof cut - 1; words++) {
        of_word = *words == '_' ? 0 : of_word + 1;
        if (of_word <= letters) {
            cut[size++] = *words;
        }
    }
    cut[size] = '\0';
    return snprintf(name, NAME_SIZE, "%s%s%s", before, cut, after) < NAME_SIZE;
}

static void fit_name(char name[NAME_SIZE], const char *before, const char *words, const char *after)
{
    int letters = DBC_NAME_MAX;

    while (letters > 0 && !build_name(name, before, words, after, letters)) {
        letters--;
    }
}

/* A board's name as an identifier that no other node has. */
static void make_node_name(const struct dbc *dbc, const char *board, char name[NAME_SIZE])
{
    char clean[NODE_LETTERS + 2];
    size_t size = 0;

    if (*board >= '0' && *board <= '9') {
        clean[size++] = '_';
    }
    for (; *board && size <= NODE_LETTERS; board++) {
        bool legal = (*board >= 'a' && *board <= 'z') || (*board >= 'A' && *board <= 'Z') ||
                     (*board >= '0' && *board <= '9');

        clean[size++] = legal ? *board : '_';
    }
    clean[size] = '\0';
    snprintf(name, NAME_SIZE, "%s", clean);
    for (unsigned n = 2;
         !dbc_is_name(name) || !strcmp(name, everyone) || dbc_find_node(dbc, name) != DBC_NO_NODE;
         n++) {
        snprintf(name, NAME_SIZE, "%.11s_%u", clean, n);
    }
}

static const struct board_config *board_of(const struct exporter *e, const struct message *message)
{
    int board = message->from_host ? message->receiver : message->sender;

    return board == MESSAGE_NO_BOARD ? NULL : &e->rig->boards.board[board];
}

static int node_of(const struct exporter *e, int board)
{
    int node = FIRST_BOARD;

    for (int i = 0; i < board; i++) {
        node += e->rig->boards.board[i].bus == (int)e->bus;
    }
    return node;
}

static const char *node_name(const struct exporter *e, const struct board_config *board)
{
    return board ? e->dbc->node[node_of(e, (int)(board - e->rig->boards.board))].name : everyone;
}

static unsigned compact_function(const struct message *message)
{
    return message->id >> 5;
}

/* Fields that are there once for each axis or slot. */
static bool is_list(const struct exporter *e, const struct message *message)
{
    return e->personality == BOARD_COMPACT && (compact_function(message) == COMPACT_COMMAND ||
                                               compact_function(message) == COMPACT_TELEMETRY_FD);
}

/* Slot of a board's first axis. */
static int first_slot(const struct exporter *e, const struct board_config *board)
{
    int slot = 0;

    for (const struct board_config *b = e->rig->boards.board; b < board; b++) {
        for (int k = 0; k < BOARD_AXES_MAX && b->kind == BOARD_MOTOR && b->bus == board->bus; k++) {
            slot += b->axis[k].joint >= 0;
        }
    }
    return slot;
}

static void make_message_name(const struct exporter *e, const struct message *message,
                              char name[NAME_SIZE])
{
    const struct board_config *board = board_of(e, message);
    char before[NAME_SIZE + 1], after[16] = "";

    snprintf(before, sizeof before, "%.*s_", DBC_NAME_MAX, node_name(e, board));
    if (message->code != MESSAGE_NO_CODE) {
        bool management = message->id >> 8 == ICUB_MANAGEMENT;

        fit_name(name, before,
                 management           ? message->from_host ? "MANAGEMENT" : "MANAGEMENT_REPLY"
                 : message->from_host ? "COMMAND"
                                      : "REPLY",
                 after);
        return;
    }
    if (message->slot >= 0 && board) {
        snprintf(after, sizeof after, "_%d", message->slot - first_slot(e, board));
    } else if (is_list(e, message) && !board) {
        snprintf(after, sizeof after, "_%u", (unsigned)(message->id & 0x1f));
    }
    fit_name(name, before, message->name, after);
}

/* ---- which axis a field is about ---- */

static bool is_icub_motor(const struct exporter *e, const struct message *message)
{
    const struct board_config *board = board_of(e, message);

    return e->personality == BOARD_ICUB && board && board->kind == BOARD_MOTOR &&
           message->id >> 8 != ICUB_MANAGEMENT;
}

/* The axis of icub telemetry is the digit that ends its name; characters of a text are c and a digit. */
static int icub_axis(const struct place *p)
{
    size_t size = strlen(p->field->name);
    char last = p->field->name[size - 1];

    if (p->command != MESSAGE_NO_CODE) {
        return p->command >= AXIS_BIT;
    }
    return size > 2 && (last == '0' || last == '1') ? last - '0' : NO_AXIS;
}

/* The axis of a slot of the bus; NULL = none. */
static const struct board_axis_config *slot_axis(const struct exporter *e, int slot)
{
    const struct boards_config *boards = &e->rig->boards;

    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board_config *board = &boards->board[i];
        int k = slot - first_slot(e, board);

        if (board->bus == (int)e->bus && board->kind == BOARD_MOTOR && k >= 0 &&
            k < BOARD_AXES_MAX && board->axis[k].joint >= 0) {
            return &board->axis[k];
        }
    }
    return NULL;
}

/* The axis of a foc board by address; NULL = none. */
static const struct board_axis_config *address_axis(const struct exporter *e, int address)
{
    const struct boards_config *boards = &e->rig->boards;

    for (size_t i = 0; i < boards->nboard; i++) {
        if (boards->board[i].bus == (int)e->bus && boards->board[i].kind == BOARD_MOTOR &&
            boards->board[i].address == address) {
            return &boards->board[i].axis[0];
        }
    }
    return NULL;
}

/* The axis that a field is about; NULL = none. */
static const struct board_axis_config *axis_of(const struct exporter *e, const struct place *p)
{
    const struct message *message = p->message;
    const struct board_config *board = board_of(e, message);
    int slot = message->slot, axis;

    switch (e->personality) {
    case BOARD_ICUB:
        axis = is_icub_motor(e, message) ? icub_axis(p) : NO_AXIS;
        return axis == NO_AXIS ? NULL : &board->axis[axis];
    case BOARD_FOC:
        return !board ? address_axis(e, p->index + 1)
               : board->kind == BOARD_MOTOR && message->id >> 8 != ICUB_MANAGEMENT ? &board->axis[0]
                                                                                   : NULL;
    default:
        if (is_list(e, message)) {
            slot = p->repeat +
                   (board ? first_slot(e, board) : (int)(message->id & 0x1f) * COMPACT_GROUP);
        }
        return slot < 0 ? NULL : slot_axis(e, slot);
    }
}

/* ---- what a count is worth ---- */

struct measure {
    double scale, offset;
    const char *unit;
};

/* Channel of a calibrated STRAIN frame; -1 = it is none. */
static int strain_channel(const struct exporter *e, const struct place *p)
{
    const struct board_config *board = board_of(e, p->message);
    unsigned type = p->message->id & 0xf;

    return e->personality != BOARD_COMPACT && board && board->kind != BOARD_MOTOR &&
                   p->message->id >> 8 == ICUB_PERIODIC_ANALOG &&
                   (type == ICUB_FORCE || type == ICUB_TORQUE)
               ? p->index + (type == ICUB_TORQUE ? 3 : 0)
               : -1;
}

static struct measure measure_of(const struct exporter *e, const struct place *p)
{
    const struct board_axis_config *axis = axis_of(e, p);
    const struct board_config *board = board_of(e, p->message);
    const char *unit = p->field->unit ? p->field->unit : "";
    double rotor = axis && axis->gear > 0.0 ? 2.0 * M_PI / FOC_ICUBDEG_PER_REV / axis->gear : 0.0;
    double ticks = !axis || axis->joint < 0 ? 0.0
                   : p->message->id >> 8 == ICUB_PERIODIC_MOTOR &&
                           (p->message->id & 0xf) == ICUB_MOTOR_POSITION
                       ? axis->motor_ticks_per_rad
                       : axis->joint_ticks_per_rad;
    int channel = strain_channel(e, p);

    if (channel >= 0 && board->full_scale[channel] > 0.0) {
        return (struct measure){board->full_scale[channel] / ICUB_STRAIN_ZERO,
                                -board->full_scale[channel],
                                board->kind == BOARD_FT && channel < 3 ? "N" : "Nm"};
    }
    if (e->personality == BOARD_ICUB && !strcmp(unit, "pwm")) {
        return (struct measure){100.0 / ICUB_PWM_FULL_SCALE, 0.0, "%"};
    }
    if (e->personality == BOARD_ICUB && !strcmp(unit, "tick") && ticks > 0.0) {
        return (struct measure){1.0 / ticks, 0.0, "rad"};
    }
    if (rotor > 0.0 && !strcmp(unit, "icubdeg")) {
        return (struct measure){rotor, 0.0, "rad"};
    }
    if (rotor > 0.0 && !strcmp(unit, "icubdeg/ms")) {
        return (struct measure){1e3 * rotor, 0.0, "rad/s"};
    }
    return (struct measure){p->field->scale != 0.0 ? p->field->scale : 1.0, 0.0, unit};
}

/* ---- signals ---- */

static void make_signal_name(const struct exporter *e, const struct place *p, char name[NAME_SIZE])
{
    char after[64] = "";

    if (p->command != MESSAGE_NO_CODE) {
        snprintf(after, sizeof after, "_%s", p->field->name);
        if (is_icub_motor(e, p->message)) {
            snprintf(after + strlen(after), sizeof after - strlen(after), "_%d",
                     p->command >= AXIS_BIT);
        }
        fit_name(name, "", p->message->name, after);
        return;
    }
    if (is_list(e, p->message)) {
        bool all = !board_of(e, p->message);

        snprintf(after, sizeof after, "_%d",
                 p->repeat + (all ? (int)(p->message->id & 0x1f) * COMPACT_GROUP : 0));
    }
    fit_name(name, "", p->field->name, after);
}

/* The joint that a signal is about. */
static void comment_signal(struct exporter *e, const struct place *p, struct dbc_signal *signal)
{
    const struct board_axis_config *axis = axis_of(e, p);
    const struct board_config *board = board_of(e, p->message);
    int channel = strain_channel(e, p);
    int joint = axis ? axis->joint : -1;

    if (channel >= 0 && board->kind == BOARD_TORQUE) {
        joint = board->torque_joint[channel];
    }
    if (joint >= 0) {
        e->code =
            dbc_set_comment(e->dbc, &signal->comment, e->rig->robot->joint[joint].name, e->error);
    } else if (channel >= 0 && board->kind == BOARD_FT) {
        static const char *const components[] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};

        e->code = dbc_set_comment(e->dbc, &signal->comment, components[channel], e->error);
    }
}

/* Whom a message is for, as a set of nodes. */
static uint64_t receivers(const struct exporter *e, const struct message *message)
{
    uint64_t nodes = 0;

    if (!message->from_host) {
        return UINT64_C(1) << HOST;
    }
    if (message->receiver != MESSAGE_NO_BOARD) {
        return UINT64_C(1) << node_of(e, message->receiver);
    }
    for (size_t i = FIRST_BOARD; i < e->dbc->nnode; i++) {
        nodes |= UINT64_C(1) << i;
    }
    return nodes;
}

static void add_signal(struct exporter *e, struct dbc_message *to, const struct place *p)
{
    const struct field *field = p->field;
    bool limited = field->min || field->max, big = field->type & FIELD_BIG_ENDIAN;
    struct measure measure = measure_of(e, p);
    char name[NAME_SIZE];
    struct dbc_signal *added,
        signal = {
            .name = name,
            .role = p->command == MESSAGE_NO_CODE ? DBC_PLAIN : DBC_MULTIPLEXED,
            .selector = p->command == MESSAGE_NO_CODE ? 0 : (uint32_t)p->command,
            .start = (uint16_t)(p->bit + (big ? 7 : 0)),
            .bits = (uint8_t)(field->type & FIELD_BITS_MASK),
            .big_endian = big,
            .type = field->type & FIELD_FLOAT    ? DBC_FLOAT
                    : field->type & FIELD_SIGNED ? DBC_SIGNED
                                                 : DBC_UNSIGNED,
            .scale = measure.scale,
            .offset = measure.offset,
            .unit = measure.unit,
            .receivers = receivers(e, p->message),
            .frame_length = p->message->length == to->length ? 0 : p->message->length,
        };

    if (signal.type != DBC_FLOAT) {
        double low = (double)(limited ? field->min : field_lowest(field));
        double high = (double)(limited ? field->max : field_highest(field));

        signal.min = low * measure.scale + measure.offset;
        signal.max = high * measure.scale + measure.offset;
    }
    make_signal_name(e, p, name);
    e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
    for (const struct field_value *v = field->values; !e->code && v && v->name; v++) {
        e->code = dbc_add_value(e->dbc, added, v->value, v->name, e->error);
    }
    if (!e->code) {
        comment_signal(e, p, added);
    }
}

static void add_fields(struct exporter *e, struct dbc_message *to, const struct message *message,
                       int command)
{
    struct place p = {.message = message, .bit = 8u * message->first_byte, .command = command};

    for (p.repeat = 0; p.repeat < message->repeats; p.repeat++) {
        for (p.field = message->fields; !e->code && p.field && p.field->type != FIELD_END;
             p.field++) {
            if (!(p.field->type & FIELD_PADDING)) {
                add_signal(e, to, &p);
                p.index++;
            }
            p.bit += p.field->type & FIELD_BITS_MASK;
        }
    }
}

/* ---- messages ---- */

static struct dbc_message *add_message(struct exporter *e, const struct message *message)
{
    char name[NAME_SIZE];
    struct dbc_message *added = NULL,
                       made = {
                           .name = name,
                           .id = message->id,
                           .fd = message->fd,
                           .length = e->longest[message->id],
                           .sender = message->from_host ? HOST : node_of(e, message->sender),
                           .cycle_ms = (uint32_t)((message->cycle_ns + 500000) / 1000000),
                       };

    make_message_name(e, message, name);
    e->code = dbc_add_message(e->dbc, &made, &added, e->error);
    return added;
}

/* Byte 0, which says what the rest is. */
static void add_multiplexor(struct exporter *e, struct dbc_message *to,
                            const struct message *message)
{
    const struct dbc_signal signal = {
        .name = "command",
        .role = DBC_MULTIPLEXOR,
        .bits = 8,
        .scale = 1.0,
        .max = 255.0,
        .unit = "",
        .receivers = receivers(e, message),
    };
    struct dbc_signal *added;

    e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
}

static void add_command(struct exporter *e, const struct message *message)
{
    int axes = is_icub_motor(e, message) ? 2 : 1;
    struct dbc_message *to = dbc_find_message(e->dbc, message->id);

    if (!to) {
        to = add_message(e, message);
        if (!e->code) {
            add_multiplexor(e, to, message);
        }
    }
    for (int axis = 0; axis < axes && !e->code; axis++) {
        int command = message->code + axis * AXIS_BIT;
        char text[80];

        snprintf(text, sizeof text, axes > 1 ? "%s_%d" : "%s", message->name, axis);
        e->code = dbc_add_value(e->dbc, dbc_find_signal(to, "command"), command, text, e->error);
        if (!e->code) {
            add_fields(e, to, message, command);
        }
    }
}

static bool visit(void *context, const struct message *message)
{
    struct exporter *e = context;

    if (message->code != MESSAGE_NO_CODE) {
        add_command(e, message);
    } else {
        struct dbc_message *added = add_message(e, message);

        if (!e->code) {
            add_fields(e, added, message, MESSAGE_NO_CODE);
        }
    }
    return !e->code;
}

static bool measure_length(void *context, const struct message *message)
{
    struct exporter *e = context;

    if (message->length > e->longest[message->id]) {
        e->longest[message->id] = message->length;
    }
    return true;
}

static void add_lockstep_frame(struct exporter *e, const char *name, uint32_t id, int sender,
                               int receiver, const char *second)
{
    const struct dbc_message message = {.name = name, .id = id, .length = 6, .sender = sender};
    struct dbc_signal *signal, fields[] = {
                                   {.name = "tick", .bits = 32, .max = UINT32_MAX},
                                   {.name = second, .start = 32, .bits = 16, .max = UINT16_MAX},
                               };
    struct dbc_message *added;

    e->code = dbc_add_message(e->dbc, &message, &added, e->error);
    if (!e->code) {
        e->code =
            dbc_set_comment(e->dbc, &added->comment, "only with the lockstep clock", e->error);
    }
    for (size_t i = 0; i < sizeof fields / sizeof *fields && !e->code; i++) {
        fields[i].scale = 1.0;
        fields[i].unit = "";
        fields[i].receivers = UINT64_C(1) << receiver;
        e->code = dbc_add_signal(e->dbc, added, &fields[i], &signal, e->error);
    }
}

static void add_lockstep(struct exporter *e)
{
    const struct loop_lockstep *lockstep = &e->rig->lockstep;

    if (lockstep->bus == (int)e->bus) {
        add_lockstep_frame(e, "STEP", lockstep->step_id, HOST, SIMULATOR, "ticks");
    }
    if (!e->code) {
        add_lockstep_frame(e, "DONE", lockstep->done_id, SIMULATOR, HOST, "flags");
    }
}

/* ---- nodes ---- */

static void describe_board(const struct exporter *e, const struct board_config *board, char *text,
                           size_t size)
{
    static const char *const kinds[] = {
        [BOARD_MOTOR] = "motors", [BOARD_FT] = "F/T", [BOARD_TORQUE] = "torques of"};
    const struct robot *robot = e->rig->robot;
    size_t used =
        (size_t)snprintf(text, size, "address %d, %s", board->address, kinds[board->kind]);

    if (board->kind == BOARD_FT) {
        snprintf(text + used, size - used, " %.60s", robot->ft[board->ft].name);
        return;
    }
    for (int k = 0; k < (board->kind == BOARD_MOTOR ? BOARD_AXES_MAX : BOARD_CHANNELS); k++) {
        int joint = board->kind == BOARD_MOTOR ? board->axis[k].joint : board->torque_joint[k];

        if (joint >= 0 && used < size) {
            used += (size_t)snprintf(text + used, size - used, " %s", robot->joint[joint].name);
        }
    }
}

static void add_node(struct exporter *e, const char *name, const char *comment)
{
    e->code = dbc_add_node(e->dbc, name, e->error);
    if (!e->code) {
        e->code =
            dbc_set_comment(e->dbc, &e->dbc->node[e->dbc->nnode - 1].comment, comment, e->error);
    }
}

static void add_nodes(struct exporter *e)
{
    const struct boards_config *boards = &e->rig->boards;

    add_node(e, "host", "the controller");
    if (!e->code) {
        add_node(e, "simulator", "sends DONE with the lockstep clock");
    }
    for (size_t i = 0; i < boards->nboard && !e->code; i++) {
        char name[NAME_SIZE], text[DBC_TEXT_MAX + 1];

        if (boards->board[i].bus == (int)e->bus) {
            make_node_name(e->dbc, boards->board[i].name, name);
            describe_board(e, &boards->board[i], text, sizeof text);
            add_node(e, name, text);
        }
    }
}

static void describe_bus(struct exporter *e)
{
    static const char *const speaks[] = {
        [BOARD_ICUB] = "icub", [BOARD_FOC] = "foc", [BOARD_COMPACT] = "compact"};
    const struct rig_bus *bus = &e->rig->bus[e->bus];
    char text[DBC_TEXT_MAX + 1];

    e->dbc->fd = bus->fd;
    e->dbc->bitrate = bus->bitrate;
    e->dbc->data_bitrate = bus->fd ? bus->data_bitrate : 0;
    snprintf(text, sizeof text,
             "Rig %.40s, bus %.40s on %.15s: protocol %s. A number without a unit is bare or "
             "depends on a "
             "setting of the board. A command's frame has its FrameLength, not more.",
             e->rig->name, bus->name, bus->interface, speaks[e->personality]);
    e->code = dbc_set_comment(e->dbc, &e->dbc->comment, text, e->error);
}

enum error_code rig_dbc(const struct rig *rig, size_t bus, struct arena *arena, struct dbc **dbc,
                        struct error *error)
{
    struct exporter e = {
        .rig = rig,
        .bus = bus,
        .personality = rig->bus[bus].personality,
        .dbc = dbc_create(arena, rig->bus[bus].name),
        .error = error,
    };

    if (!e.dbc) {
        return error_set(error, ERROR_MEMORY, "no memory left for the DBC database");
    }
    describe_bus(&e);
    if (!e.code) {
        add_nodes(&e);
    }
    if (!e.code) {
        boards_messages(&rig->boards, (int)bus, measure_length, &e);
        boards_messages(&rig->boards, (int)bus, visit, &e);
    }
    if (!e.code) {
        add_lockstep(&e);
    }
    *dbc = e.dbc;
    return e.code ? error_prefix(error, "%s: bus %s", rig->file, rig->bus[bus].name) : ERROR_NONE;
}
