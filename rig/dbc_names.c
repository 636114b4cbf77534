/* SPDX-License-Identifier: Apache-2.0 */
/* Names of nodes, messages and signals in a rig's DBC database: unique, legal and short enough. */
#include "boards/cia402/protocol.h"
#include "boards/compact/protocol.h"
#include "boards/icub/protocol.h"
#include "rig/dbc_private.h"

#include <string.h>

enum { NODE_LETTERS = 14 };

static const char everyone[] = "ALL"; /* in the place of the board, when all are meant */

/* Joins before, so many letters of each of the words, and after; false when that is too long. */
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

static void dbc_fit_name(char name[NAME_SIZE], const char *before, const char *words,
                         const char *after)
{
    int letters = DBC_NAME_MAX;

    while (letters > 0 && !dbc_try_name(name, before, words, after, letters)) {
        letters--;
    }
}

void dbc_make_node_name(const struct dbc *dbc, const char *board, char name[NAME_SIZE])
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

const struct board_config *dbc_message_board(const struct dbc_exporter *e,
                                             const struct message *message)
{
    int board = message->from_host ? message->receiver : message->sender;

    return board == MESSAGE_NO_BOARD ? NULL : &e->rig->boards.board[board];
}

int dbc_board_node(const struct dbc_exporter *e, int board)
{
    int node = FIRST_BOARD;

    for (int i = 0; i < board; i++) {
        node += e->rig->boards.board[i].bus == (int)e->bus;
    }
    return node;
}

static const char *dbc_board_name(const struct dbc_exporter *e, const struct board_config *board)
{
    return board ? e->dbc->node[dbc_board_node(e, (int)(board - e->rig->boards.board))].name
                 : everyone;
}

static unsigned compact_message_function(const struct message *message)
{
    return message->id >> 5;
}

bool dbc_is_list(const struct dbc_exporter *e, const struct message *message)
{
    if (e->personality == BOARD_CIA402) {
        const struct board_config *board = dbc_message_board(e, message);

        return board && board->kind == BOARD_MOTOR && fields_count(message->fields) == 1 &&
               message->slot < 0 && message->id < CIA402_SDO_REPLY;
    }
    if (e->personality == BOARD_DESCRIBED) {
        return message->from_host && message->receiver == MESSAGE_NO_BOARD && message->slot >= 0;
    }
    return e->personality == BOARD_COMPACT &&
           (compact_message_function(message) == COMPACT_COMMAND ||
            compact_message_function(message) == COMPACT_TELEMETRY_FD);
}

int dbc_first_slot(const struct dbc_exporter *e, const struct board_config *board)
{
    int slot = 0;

    for (const struct board_config *b = e->rig->boards.board; b < board; b++) {
        for (int k = 0; k < BOARD_AXES_MAX && b->kind == BOARD_MOTOR && b->bus == board->bus; k++) {
            slot += b->axis[k].joint >= 0;
        }
    }
    return slot;
}

void dbc_make_message_name(const struct dbc_exporter *e, const struct message *message,
                           char name[NAME_SIZE])
{
    const struct board_config *board = dbc_message_board(e, message);
    char before[NAME_SIZE + 1], after[16] = "";

    snprintf(before, sizeof before, "%.*s_", DBC_NAME_MAX, dbc_board_name(e, board));
    if (message->code != MESSAGE_NO_CODE) {
        bool management = message->id >> 8 == ICUB_MANAGEMENT;

        dbc_fit_name(name, before,
                     management           ? message->from_host ? "MANAGEMENT" : "MANAGEMENT_REPLY"
                     : message->from_host ? "COMMAND"
                                          : "REPLY",
                     after);
        return;
    }
    if (message->slot >= 0 && board) {
        snprintf(after, sizeof after, "_%d", message->slot - dbc_first_slot(e, board));
    } else if (dbc_is_list(e, message) && !board) {
        snprintf(after, sizeof after, "_%u", (unsigned)(message->id & 0x1f));
    }
    dbc_fit_name(name, before, message->name, after);
}

bool dbc_is_icub_motor(const struct dbc_exporter *e, const struct message *message)
{
    const struct board_config *board = dbc_message_board(e, message);

    return e->personality == BOARD_ICUB && board && board->kind == BOARD_MOTOR &&
           message->id >> 8 != ICUB_MANAGEMENT;
}

/* JOINT_QUANTITY. The digit that ends a field's name, as in position0 or target1, says which axis
 * of the board or the bus it is: the joint says that better. */
static void dbc_make_joint_name(const struct dbc_field *p, char name[NAME_SIZE])
{
    char words[256];
    size_t size = 0;

    if (p->joint[0] >= '0' && p->joint[0] <= '9') {
        words[size++] = '_';
    }
    for (const char *c = p->joint; *c && size < sizeof words / 2; c++) {
        bool legal =
            (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9');

        words[size++] = legal ? *c : '_';
    }
    size += (size_t)snprintf(words + size, sizeof words - size, "_%s", p->quantity);
    size = size < sizeof words ? size : sizeof words - 1;
    while (words[size - 1] >= '0' && words[size - 1] <= '9') {
        words[--size] = '\0';
    }
    dbc_fit_name(name, "", words, "");
}

/* A name as the boards' tables have it. */
static void dbc_make_table_name(const struct dbc_exporter *e, const struct dbc_field *p,
                                char name[NAME_SIZE])
{
    char after[64] = "";

    if (p->command != MESSAGE_NO_CODE) {
        snprintf(after, sizeof after, "_%s", p->field->name);
        if (dbc_is_icub_motor(e, p->message)) {
            snprintf(after + strlen(after), sizeof after - strlen(after), "_%d",
                     p->command >= AXIS_BIT);
        }
        dbc_fit_name(name, "", p->message->name, after);
        return;
    }
    if (dbc_is_list(e, p->message)) {
        bool all = !dbc_message_board(e, p->message);

        snprintf(after, sizeof after, "_%d",
                 p->repeat + (all ? (int)(p->message->id & 0x1f) * COMPACT_GROUP : 0));
    }
    dbc_fit_name(name, "", p->field->name, after);
}

void dbc_make_signal_name(const struct dbc_exporter *e, const struct dbc_message *to,
                          const struct dbc_field *p, char name[NAME_SIZE])
{
    char made[NAME_SIZE];

    bool to_one = p->message->from_host && dbc_message_board(e, p->message);

    if (p->command != MESSAGE_NO_CODE || to_one || (!p->joint && !p->component)) {
        dbc_make_table_name(e, p, name);
        return;
    }
    if (p->component) {
        snprintf(name, NAME_SIZE, "%s", p->component);
    } else {
        dbc_make_joint_name(p, name);
    }

    /* Long names that were cut alike */
    snprintf(made, sizeof made, "%s", name);
    for (unsigned n = 2; dbc_find_signal(to, name); n++) {
        snprintf(name, NAME_SIZE, "%.*s_%u", DBC_NAME_MAX - 5, made, n % 1000);
    }
}
