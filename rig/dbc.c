/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a rig's messages as a DBC database: its nodes and messages. */
#include "rig/dbc.h"

#include "base/array.h"
#include "boards/described/protocol.h"
#include "rig/dbc_private.h"

#include <string.h>

/* ---- messages ---- */

/* Returns the identifier as the format writes it. */
static uint32_t dbc_id(const struct message *message)
{
    return message->id | (message->extended ? DBC_EXTENDED : 0);
}

/* Adds a message without its signals. */
static struct dbc_message *dbc_export_message(struct dbc_exporter *e, const struct message *message)
{
    char name[NAME_SIZE];
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

    dbc_make_message_name(e, message, name);
    e->code = dbc_add_message(e->dbc, &made, &added, e->error);
    return added;
}

/* Adds the signal of byte 0, which selects the others. */
static void dbc_export_multiplexor(struct dbc_exporter *e, struct dbc_message *to,
                                   const struct message *message)
{
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

    e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
}

/* Adds a command to the message of its class, once for each axis. */
static void dbc_export_command(struct dbc_exporter *e, const struct message *message)
{
    int axes = message->axis_bit ? 2 : 1;
    struct dbc_message *to = dbc_find_message(e->dbc, message->id);

    if (!to) {
        to = dbc_export_message(e, message);
        if (!e->code) {
            dbc_export_multiplexor(e, to, message);
        }
    }
    for (int axis = 0; axis < axes && !e->code; axis++) {
        int command = message->code + axis * MESSAGE_AXIS_BIT;
        char text[80];

        snprintf(text, sizeof text, axes > 1 ? "%s_%d" : "%s", message->name, axis);
        e->code = dbc_add_value(e->dbc, dbc_find_signal(to, "command"), command, text, e->error);
        if (!e->code) {
            dbc_export_fields(e, to, message, command);
        }
    }
}

/* Comments a message with what signals cannot say. */
static void dbc_comment_message(struct dbc_exporter *e, struct dbc_message *to,
                                const struct message *message)
{
    char text[DBC_TEXT_MAX + 1] = "";

    if (e->protocol->comment_message) {
        e->protocol->comment_message(message, text, sizeof text);
    }
    if (*text) {
        e->code = dbc_set_comment(e->dbc, &to->comment, text, e->error);
    }
}

/* Returns whether a message is left out: of those with one identifier and no code, which a DBC
 * cannot tell apart, it has the first, and one that carries values rather than one that does
 * not. */
static bool dbc_leaves_out(const struct dbc_exporter *e, const struct message *message)
{
    return message->constant != e->constants ||
           (message->code == MESSAGE_NO_CODE && dbc_find_message(e->dbc, dbc_id(message)));
}

/* Adds a message of the boards, or a command to its class. */
static bool dbc_visit_message(void *context, const struct message *message)
{
    struct dbc_exporter *e = context;

    if (dbc_leaves_out(e, message)) {
        return true;
    }
    if (message->code != MESSAGE_NO_CODE) {
        dbc_export_command(e, message);
    } else {
        struct dbc_message *added = dbc_export_message(e, message);

        if (!e->code) {
            dbc_export_fields(e, added, message, MESSAGE_NO_CODE);
        }
        if (!e->code) {
            dbc_comment_message(e, added, message);
        }
    }
    return !e->code;
}

/* Notes the longest frame of an identifier. */
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

/* Adds STEP on its bus, and DONE on every bus. */
static void dbc_export_lockstep(struct dbc_exporter *e)
{
    const struct loop_lockstep *lockstep = &e->rig->lockstep;

    if (lockstep->bus == (int)e->bus) {
        dbc_export_lockstep_frame(e, "STEP", lockstep->step_id, HOST, SIMULATOR, "ticks");
    }
    if (!e->code) {
        dbc_export_lockstep_frame(e, "DONE", lockstep->done_id, SIMULATOR, HOST, "flags");
    }
}

/* ---- nodes ---- */

/* Writes the comment of a board: its address, kind, and joints or sensor. */
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

/* Adds a node with a comment. */
static void dbc_export_node(struct dbc_exporter *e, const char *name, const char *comment)
{
    e->code = dbc_add_node(e->dbc, name, e->error);
    if (!e->code) {
        e->code =
            dbc_set_comment(e->dbc, &e->dbc->node[e->dbc->nnode - 1].comment, comment, e->error);
    }
}

/* Adds the host, the simulator and the boards of the bus. */
static void dbc_export_nodes(struct dbc_exporter *e)
{
    const struct boards_config *boards = &e->rig->boards;

    dbc_export_node(e, "host", "the controller");
    if (!e->code) {
        dbc_export_node(e, "simulator", "sends DONE with the lockstep clock");
    }
    for (size_t i = 0; i < boards->nboard && !e->code; i++) {
        char name[NAME_SIZE], text[DBC_TEXT_MAX + 1];

        if (boards->board[i].bus == (int)e->bus) {
            dbc_make_node_name(e->dbc, boards->board[i].name, name);
            dbc_describe_board(e, &boards->board[i], text, sizeof text);
            dbc_export_node(e, name, text);
        }
    }
}

/* Sets the bit rates and the comment of the database. */
static void dbc_describe_bus(struct dbc_exporter *e)
{
    const struct rig_bus *bus = &e->rig->bus[e->bus];
    char text[DBC_TEXT_MAX + 1], name[40] = "";

    if (bus->described) {
        snprintf(name, sizeof name, " (%s)", bus->described->name);
    }
    e->dbc->fd = bus->fd;
    e->dbc->bitrate = bus->bitrate;
    e->dbc->data_bitrate = bus->fd ? bus->data_bitrate : 0;
    snprintf(
        text, sizeof text,
        "Rig %.40s, bus %.40s on %.15s: protocol %s%s, supply %.6g V. A number without a unit is "
        "bare or depends on a setting of the board. A command's frame has its FrameLength.",
        e->rig->name, bus->name, bus->interface, e->protocol->name, name, e->rig->supply_v);
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
        dbc_export_nodes(&e);
    }
    if (!e.code) {
        /* Lengths, then messages that carry values, then those that do not */
        boards_messages(&rig->boards, (int)bus, dbc_visit_length, &e);
        boards_messages(&rig->boards, (int)bus, dbc_visit_message, &e);
    }
    if (!e.code) {
        e.constants = true;
        boards_messages(&rig->boards, (int)bus, dbc_visit_message, &e);
    }
    if (!e.code) {
        dbc_export_lockstep(&e);
    }
    *dbc = e.dbc;
    return e.code ? error_prefix(error, "%s: bus %s", rig->file, rig->bus[bus].name) : ERROR_NONE;
}
