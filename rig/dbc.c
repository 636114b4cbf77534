/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a rig's messages as a DBC database: nodes, messages, and signals with their units. All
 * names are unique, legal and short. */
#include "rig/dbc.h"

#include "base/array.h"
#include "boards/described/protocol.h"
#include "boards/protocol.h"

#include <string.h>

enum { HOST = 0, SIMULATOR = 1, FIRST_BOARD = 2 }; /* indices of the nodes */
enum { IDS = 0x800, NAME_SIZE = DBC_NAME_MAX + 1 };

struct dbc_exporter {
    const struct rig *rig;
    size_t bus;
    const struct protocol *protocol;
    struct dbc *dbc;
    struct error *error;
    enum error_code code;
    uint8_t longest[IDS]; /* by identifier: length of its longest frame */
    bool constants;       /* this pass adds the messages without values */
};

/* A field that becomes a signal. */
struct dbc_field {
    struct message_field of;
    struct field_subject subject;
    unsigned bit;          /* first bit in the frame */
    const char *joint;     /* joint of the field; NULL = none */
    const char *quantity;  /* the joint's quantity: field name, or "torque" for torque boards */
    const char *component; /* component of a force-torque sensor: "fx" to "mz"; NULL = none */
};

/* ---- names ---- */

enum {
    LONG_SIZE = 128,
    /* longest board name that leaves enough letters for the names of its messages */
    NODE_LETTERS = 15,
};

static const char everyone[] = "ALL"; /* stands for the board in messages for all boards */

/* Makes a name from `before`, the first letters of each word, and `after`. Returns false if the
 * name is too long. */
static bool dbc_try_name(char name[NAME_SIZE], const char *before, const char *words,
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

/* Makes a name that fits. Keeps as many letters of each word as possible. */
static void dbc_fit_name(char name[NAME_SIZE], const char *before, const char *words,
                         const char *after)
{
    int letters = DBC_NAME_MAX;

    while (letters > 0 && !dbc_try_name(name, before, words, after, letters)) {
        letters--;
    }
}

/* Copies a name and keeps only the legal characters: letters, digits and '_'. Inserts '_' before a
 * leading digit. */
static size_t dbc_clean_name(const char *name, char clean[LONG_SIZE])
{
    size_t size = 0;

    if (*name >= '0' && *name <= '9') {
        clean[size++] = '_';
    }
    for (; *name && size < LONG_SIZE - 1; name++) {
        bool legal = (*name >= 'a' && *name <= 'z') || (*name >= 'A' && *name <= 'Z') ||
                     (*name >= '0' && *name <= '9');

        clean[size++] = legal ? *name : '_';
    }
    clean[size] = '\0';
    return size;
}

/* Returns the board that sends or receives a message. NULL = all boards. */
static const struct board_config *dbc_message_board(const struct dbc_exporter *e,
                                                    const struct message *message)
{
    int board = message->from_host ? message->receiver : message->sender;

    return board == MESSAGE_NO_BOARD ? NULL : &e->rig->boards.board[board];
}

/* Returns the index of a board's node. `board` is the index in the rig. */
static int dbc_board_node(const struct dbc_exporter *e, int board)
{
    int node = FIRST_BOARD;

    for (int i = 0; i < board; i++) {
        node += e->rig->boards.board[i].bus == (int)e->bus;
    }
    return node;
}

/* Makes a signal name from the names in the boards' message tables. */
static void dbc_make_table_name(const struct dbc_exporter *e, const struct dbc_field *p,
                                char name[NAME_SIZE])
{
    const struct message *message = p->of.message;
    char after[64] = "";

    if (p->of.code != MESSAGE_NO_CODE) {
        snprintf(after, sizeof after, "_%s", p->of.field->name);
        if (message->axis_bit) {
            snprintf(after + strlen(after), sizeof after - strlen(after), "_%d",
                     p->of.code >= MESSAGE_AXIS_BIT);
        }
        dbc_fit_name(name, "", message->name, after);
        return;
    }
    if (message->list) {
        bool all = !dbc_message_board(e, message);

        snprintf(after, sizeof after, "_%d", p->of.repeat + (all ? message->slot : 0));
    }
    dbc_fit_name(name, "", p->of.field->name, after);
}

/* Makes a signal name that is unique in the message `to`. For a joint's value from a board, or for
 * targets of all boards in one frame, the name is JOINT_QUANTITY. For a force-torque sensor it is
 * the component. All other names come from the boards' message tables. `whole`: the name of a
 * joint's signal before it was shortened. */
static void dbc_make_signal_name(const struct dbc_exporter *e, const struct dbc_message *to,
                                 const struct dbc_field *p, char name[NAME_SIZE],
                                 char whole[LONG_SIZE])
{
    char made[NAME_SIZE];
    bool to_one = p->of.message->from_host && dbc_message_board(e, p->of.message);

    if (p->of.code != MESSAGE_NO_CODE || to_one || (!p->joint && !p->component)) {
        dbc_make_table_name(e, p, name);
        return;
    }
    if (p->component) {
        snprintf(name, NAME_SIZE, "%s", p->component);
    } else {
        size_t size = dbc_clean_name(p->joint, whole);

        /* Make the name JOINT_QUANTITY. A field such as position0 ends with the axis number on
         * its board or bus. Leave this digit out, because the joint already identifies the
         * axis. */
        size += (size_t)snprintf(whole + size, LONG_SIZE - size, "_%s", p->quantity);
        size = size < LONG_SIZE ? size : LONG_SIZE - 1;
        while (whole[size - 1] >= '0' && whole[size - 1] <= '9') {
            whole[--size] = '\0';
        }
        dbc_fit_name(name, "", whole, "");
    }

    /* Number names that are equal after shortening */
    snprintf(made, sizeof made, "%s", name);
    for (unsigned n = 2; dbc_find_signal(to, name); n++) {
        snprintf(name, NAME_SIZE, "%.*s_%u", DBC_NAME_MAX - 5, made, n % 1000);
    }
}

/* ---- signals ---- */

/* Finds the joint or the force-torque component that a field reports or sets. */
static void dbc_find_subject(const struct dbc_exporter *e, struct dbc_field *p)
{
    static const char *const components[] = {"fx", "fy", "fz", "mx", "my", "mz"};
    const struct field_subject *subject = &p->subject;
    const struct board_config *board = dbc_message_board(e, p->of.message);
    int joint;

    boards_describe_field(&e->rig->boards, (int)e->bus, &p->of, &p->subject);
    joint = subject->axis ? subject->axis->joint : -1;
    p->quantity = p->of.field->name;
    if (subject->channel >= 0 && board->kind == BOARD_TORQUE) {
        joint = board->torque_joint[subject->channel];
        p->quantity = "torque";
    }
    p->joint = joint >= 0 ? e->rig->robot->joint[joint].name : NULL;
    p->component =
        subject->channel >= 0 && board->kind == BOARD_FT ? components[subject->channel] : NULL;
}

/* Returns the nodes that receive a message, as a bit mask. */
static uint64_t dbc_message_receivers(const struct dbc_exporter *e, const struct message *message)
{
    uint64_t nodes = 0;

    if (!message->from_host) {
        return UINT64_C(1) << HOST;
    }
    if (message->receiver != MESSAGE_NO_BOARD) {
        return UINT64_C(1) << dbc_board_node(e, message->receiver);
    }
    for (size_t i = FIRST_BOARD; i < e->dbc->nnode; i++) {
        nodes |= UINT64_C(1) << i;
    }
    return nodes;
}

/* Adds a field as a signal with its range, its named values and its comment. */
static void dbc_export_signal(struct dbc_exporter *e, struct dbc_message *to,
                              const struct dbc_field *p)
{
    const struct field *field = p->of.field;
    bool limited = field->min || field->max, big = field->type & FIELD_BIG_ENDIAN;
    const struct field_subject *measure = &p->subject;
    char name[NAME_SIZE], whole[LONG_SIZE] = "";
    struct dbc_signal *added,
        signal = {
            .name = name,
            .role = p->of.code == MESSAGE_NO_CODE ? DBC_PLAIN : DBC_MULTIPLEXED,
            .selector = p->of.code == MESSAGE_NO_CODE ? 0 : (uint32_t)p->of.code,
            .start = (uint16_t)(big ? p->bit ^ 7 : p->bit),
            .bits = (uint8_t)(field->type & FIELD_BITS_MASK),
            .big_endian = big,
            .type = field->type & FIELD_FLOAT    ? DBC_FLOAT
                    : field->type & FIELD_SIGNED ? DBC_SIGNED
                                                 : DBC_UNSIGNED,
            .scale = measure->scale,
            .offset = measure->offset,
            .unit = measure->unit,
            .receivers = dbc_message_receivers(e, p->of.message),
            .frame_length = p->of.message->length == to->length ? 0 : p->of.message->length,
        };

    /* Set the range in the signal's unit; a float has no range */
    if (signal.type != DBC_FLOAT) {
        double low = (double)(limited ? field->min : field_lowest(field));
        double high = (double)(limited ? field->max : field_highest(field));

        signal.min = low * measure->scale + measure->offset;
        signal.max = high * measure->scale + measure->offset;
    }

    dbc_make_signal_name(e, to, p, name, whole);
    e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
    if (!e->code && strlen(whole) > DBC_NAME_MAX) {
        e->code = dbc_set_comment(e->dbc, &added->long_name, whole, e->error);
    }
    for (const struct field_value *v = field->values; !e->code && v && v->name; v++) {
        e->code = dbc_add_value(e->dbc, added, v->value, v->name, e->error);
    }
    if (!e->code) {
        const struct board_config *board = dbc_message_board(e, p->of.message);

        /* Write a signal's comment: its joint or force-torque sensor */
        if (p->joint) {
            e->code = dbc_set_comment(e->dbc, &added->comment, p->joint, e->error);
        } else if (p->component) {
            e->code = dbc_set_comment(e->dbc, &added->comment, e->rig->robot->ft[board->ft].name,
                                      e->error);
        }
    }
}

/* Adds the fields of a message as signals. `command`: the value of byte 0 that selects these
 * signals, or MESSAGE_NO_CODE. */
static void dbc_export_fields(struct dbc_exporter *e, struct dbc_message *to,
                              const struct message *message, int command)
{
    struct dbc_field p = {.of = {.message = message, .code = command},
                          .bit = 8u * message->first_byte};

    for (p.of.repeat = 0; p.of.repeat < message->repeats; p.of.repeat++) {
        const struct field *field = message->fields;

        for (; !e->code && field && field->type != FIELD_END; field++) {
            if (!(field->type & FIELD_PADDING)) {
                p.of.field = field;
                dbc_find_subject(e, &p);
                dbc_export_signal(e, to, &p);
                p.of.index++;
            }
            p.bit += field->type & FIELD_BITS_MASK;
        }
    }
}

/* ---- messages ---- */

/* Returns the identifier of a message as the DBC format encodes it. */
static uint32_t dbc_id(const struct message *message)
{
    return message->id | (message->extended ? DBC_EXTENDED : 0);
}

/* Adds a message without its signals. */
static struct dbc_message *dbc_export_message(struct dbc_exporter *e, const struct message *message)
{
    char name[NAME_SIZE], whole[LONG_SIZE];
    struct dbc_message *added = NULL,
                       made = {
                           .name = name,
                           .id = dbc_id(message),
                           .id_mask = message->id_mask,
                           .fd = message->fd,
                           .length = message->extended ? message->length : e->longest[message->id],
                           .sender = message->from_host ? HOST : dbc_board_node(e, message->sender),
                           .cycle_ms = (uint32_t)((message->cycle_ns + 500000) / 1000000),
                       };
    const struct board_config *board = dbc_message_board(e, message);
    const char *words = message->code != MESSAGE_NO_CODE ? message->family : message->name;
    char before[LONG_SIZE + 1] = "ALL_", after[16] = "";

    /* Make the name of a message: board, words, number. `whole`: the long name if the board's
     * name is cut, else "". */
    if (board) {
        dbc_clean_name(board->name, before);
        strcat(before, "_");
    }
    if (message->code == MESSAGE_NO_CODE && message->list && !board) {
        snprintf(after, sizeof after, "_%u", message->number);
    } else if (message->code == MESSAGE_NO_CODE && message->slot >= 0 && !message->list && board) {
        unsigned first = boards_first_slot(&e->rig->boards, (int)(board - e->rig->boards.board));

        snprintf(after, sizeof after, "_%u", (unsigned)message->slot - first);
    }

    /* If the board's name is too long, keep the whole name and make a shorter one */
    snprintf(whole, LONG_SIZE, "%.80s%.30s%s", before, words, after);
    if (board && strlen(before) > NODE_LETTERS + 1 && strlen(whole) > DBC_NAME_MAX) {
        snprintf(before, sizeof before, "%.11s_%u_", whole, (unsigned)board->address % 10000);
    } else {
        whole[0] = '\0';
        snprintf(before, sizeof before, "%s_",
                 board ? e->dbc->node[dbc_board_node(e, (int)(board - e->rig->boards.board))].name
                       : everyone);
    }
    dbc_fit_name(name, before, words, after);
    e->code = dbc_add_message(e->dbc, &made, &added, e->error);
    if (!e->code && whole[0]) {
        e->code = dbc_set_comment(e->dbc, &added->long_name, whole, e->error);
    }
    return added;
}

/* Adds a message of the boards. Adds a command to the message of its class. */
static bool dbc_visit_message(void *context, const struct message *message)
{
    struct dbc_exporter *e = context;

    /* The first pass adds messages with values, the second pass adds the others. If two messages
     * have one identifier and no command code, a DBC cannot distinguish them, so only the first is
     * added. */
    if (message->constant != e->constants ||
        (message->code == MESSAGE_NO_CODE && dbc_find_message(e->dbc, dbc_id(message)))) {
        return true;
    }
    if (message->code != MESSAGE_NO_CODE) {
        /* Add a command to the message of its class; once for each axis */
        int axes = message->axis_bit ? 2 : 1;
        struct dbc_message *to = dbc_find_message(e->dbc, message->id);

        if (!to) {
            to = dbc_export_message(e, message);
            if (!e->code) {
                const struct dbc_signal signal = {
                    .name = "command",
                    .role = DBC_MULTIPLEXOR,
                    .bits = 8,
                    .scale = 1.0,
                    .max = 255.0,
                    .unit = "",
                    .receivers = dbc_message_receivers(e, message),
                };
                struct dbc_signal *added;

                /* Add the signal of byte 0. Its value selects the other signals. */
                e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
            }
        }
        for (int axis = 0; axis < axes && !e->code; axis++) {
            int command = message->code + axis * MESSAGE_AXIS_BIT;
            char text[80];

            snprintf(text, sizeof text, axes > 1 ? "%s_%d" : "%s", message->name, axis);
            e->code =
                dbc_add_value(e->dbc, dbc_find_signal(to, "command"), command, text, e->error);
            if (!e->code) {
                dbc_export_fields(e, to, message, command);
            }
        }
    } else {
        struct dbc_message *added = dbc_export_message(e, message);

        if (!e->code) {
            dbc_export_fields(e, added, message, MESSAGE_NO_CODE);
        }
        if (!e->code) {
            char text[DBC_TEXT_MAX + 1] = "";

            /* Write a message's comment, with information that signals cannot express */
            if (e->protocol->comment_message) {
                e->protocol->comment_message(message, text, sizeof text);
            }
            if (*text) {
                e->code = dbc_set_comment(e->dbc, &added->comment, text, e->error);
            }
        }
    }
    return !e->code;
}

/* Records the length of the longest frame for each identifier. */
static bool dbc_visit_length(void *context, const struct message *message)
{
    struct dbc_exporter *e = context;

    if (!message->extended && message->length > e->longest[message->id]) {
        e->longest[message->id] = message->length;
    }
    return true;
}

/* Adds a frame of the lockstep clock. */
static void dbc_export_lockstep_frame(struct dbc_exporter *e, const char *name, uint32_t id,
                                      int sender, int receiver, const char *second)
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
    for (size_t i = 0; i < ARRAY_COUNT(fields) && !e->code; i++) {
        fields[i].scale = 1.0;
        fields[i].unit = "";
        fields[i].receivers = UINT64_C(1) << receiver;
        e->code = dbc_add_signal(e->dbc, added, &fields[i], &signal, e->error);
    }
}

/* ---- nodes ---- */

/* Writes the comment of a board: its address, its kind, and its joints or its sensor. */
static void dbc_describe_board(const struct dbc_exporter *e, const struct board_config *board,
                               char *text, size_t size)
{
    static const char *const kinds[] = {[BOARD_MOTOR] = "motors",
                                        [BOARD_FT] = "F/T",
                                        [BOARD_TORQUE] = "torques of",
                                        [BOARD_INERTIAL] = "inertial sensor"};
    const struct robot *robot = e->rig->robot;
    size_t used =
        (size_t)snprintf(text, size, "address %d, %s", board->address, kinds[board->kind]);

    if (board->kind == BOARD_FT) {
        snprintf(text + used, size - used, " %.60s", robot->ft[board->ft].name);
        return;
    }
    if (board->kind == BOARD_INERTIAL) {
        return;
    }
    for (int k = 0; k < (board->kind == BOARD_MOTOR ? BOARD_AXES_MAX : BOARD_CHANNELS); k++) {
        int joint = board->kind == BOARD_MOTOR ? board->axis[k].joint : board->torque_joint[k];

        if (joint >= 0 && used < size) {
            used += (size_t)snprintf(text + used, size - used, " %s", robot->joint[joint].name);
        }
    }
}

/* Adds a node with a comment. `whole`: its long name if the node has a shorter one. */
static void dbc_export_node(struct dbc_exporter *e, const char *name, const char *whole,
                            const char *comment)
{
    e->code = dbc_add_node(e->dbc, name, e->error);
    if (!e->code) {
        struct dbc_node *node = &e->dbc->node[e->dbc->nnode - 1];

        e->code = dbc_set_comment(e->dbc, &node->comment, comment, e->error);
        if (!e->code && strlen(whole) > DBC_NAME_MAX) {
            e->code = dbc_set_comment(e->dbc, &node->long_name, whole, e->error);
        }
    }
}

/* Sets the bit rates and the comment of the database. */
static void dbc_describe_bus(struct dbc_exporter *e)
{
    const struct rig_bus *bus = &e->rig->bus[e->bus];
    char text[DBC_TEXT_MAX + 1];

    e->dbc->fd = bus->fd;
    e->dbc->bitrate = bus->bitrate;
    e->dbc->data_bitrate = bus->fd ? bus->data_bitrate : 0;
    snprintf(
        text, sizeof text,
        "Rig %.40s, bus %.40s on %.15s: protocol %s, supply %.6g V. A number without a unit is "
        "bare or depends on a setting of the board. A command's frame has its FrameLength.",
        e->rig->name, bus->name, bus->interface,
        bus->protocol->needs_file ? bus->described->name : bus->protocol->name, e->rig->supply_v);
    e->code = dbc_set_comment(e->dbc, &e->dbc->comment, text, e->error);
}

enum error_code rig_dbc(const struct rig *rig, size_t bus, struct arena *arena, struct dbc **dbc,
                        struct error *error)
{
    struct dbc_exporter e = {
        .rig = rig,
        .bus = bus,
        .protocol = rig->bus[bus].protocol,
        .dbc = dbc_create(arena, rig->bus[bus].name),
        .error = error,
    };

    if (!e.dbc) {
        return error_set(error, ERROR_MEMORY, "no memory left for the DBC database");
    }
    dbc_describe_bus(&e);
    if (!e.code) {
        /* Add the host, the simulator and the boards of the bus */
        const struct boards_config *boards = &e.rig->boards;

        dbc_export_node(&e, "host", "", "the controller");
        if (!e.code) {
            dbc_export_node(&e, "simulator", "", "sends DONE with the lockstep clock");
        }
        for (size_t i = 0; i < boards->nboard && !e.code; i++) {
            char name[NAME_SIZE], whole[LONG_SIZE], text[DBC_TEXT_MAX + 1];
            unsigned number = (unsigned)boards->board[i].address;

            if (boards->board[i].bus == (int)e.bus) {
                /* Cut a name that is too long or not unique, and append the board's address */
                dbc_clean_name(boards->board[i].name, whole);
                snprintf(name, sizeof name, "%.32s", strlen(whole) > DBC_NAME_MAX ? "" : whole);
                while (!dbc_is_name(name) || !strcmp(name, everyone) ||
                       dbc_find_node(e.dbc, name) != DBC_NO_NODE) {
                    snprintf(name, sizeof name, "%.26s_%u", whole, number++ % 10000);
                }
                dbc_describe_board(&e, &boards->board[i], text, sizeof text);
                dbc_export_node(&e, name, whole, text);
            }
        }
    }
    if (!e.code) {
        /* Find the frame lengths, then add the messages with values, then the messages without
         * values */
        boards_messages(&rig->boards, (int)bus, dbc_visit_length, &e);
        boards_messages(&rig->boards, (int)bus, dbc_visit_message, &e);
    }
    if (!e.code) {
        e.constants = true;
        boards_messages(&rig->boards, (int)bus, dbc_visit_message, &e);
    }
    if (!e.code) {
        const struct loop_lockstep *lockstep = &e.rig->lockstep;

        /* Add the frame STEP on its bus, and the frame DONE of each bus */
        if (lockstep->bus == (int)e.bus) {
            dbc_export_lockstep_frame(&e, "STEP", lockstep->step_id, HOST, SIMULATOR, "ticks");
        }
        if (!e.code) {
            dbc_export_lockstep_frame(&e, "DONE", lockstep->done_id, SIMULATOR, HOST, "flags");
        }
    }
    *dbc = e.dbc;
    return e.code ? error_prefix(error, "%s: bus %s", rig->file, rig->bus[bus].name) : ERROR_NONE;
}
