/* SPDX-License-Identifier: Apache-2.0 */
/* Names of nodes, messages and signals in a rig's DBC database: unique, legal and short enough. */
#include "rig/dbc_private.h"

#include <string.h>

enum { NODE_LETTERS = 14 };

static const char everyone[] = "ALL"; /* instead of the board, when all are meant */

/* Joins before, so many letters of each of the words, and after; returns false when the name is
 * too long. */
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

/* Makes a name with as many letters of each word as fit. */
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

    /* Only letters, digits and _ are legal */
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
    /* A number makes it unique */
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

/* Returns the node of a board; without one, the word for all. */
static const char *dbc_board_name(const struct dbc_exporter *e, const struct board_config *board)
{
    return board ? e->dbc->node[dbc_board_node(e, (int)(board - e->rig->boards.board))].name
                 : everyone;
}

void dbc_make_message_name(const struct dbc_exporter *e, const struct message *message,
                           char name[NAME_SIZE])
{
    const struct board_config *board = dbc_message_board(e, message);
    char before[NAME_SIZE + 1], after[16] = "";

    snprintf(before, sizeof before, "%.*s_", DBC_NAME_MAX, dbc_board_name(e, board));
    if (message->code != MESSAGE_NO_CODE) {
        dbc_fit_name(name, before, message->family, after);
        return;
    }
    if (message->list && !board) {
        snprintf(after, sizeof after, "_%u", message->number);
    } else if (message->slot >= 0 && !message->list && board) {
        unsigned first = boards_first_slot(&e->rig->boards, (int)(board - e->rig->boards.board));

        snprintf(after, sizeof after, "_%u", (unsigned)message->slot - first);
    }
    dbc_fit_name(name, before, message->name, after);
}

/* Makes the name JOINT_QUANTITY. The digit that ends a field's name, as in position0 or target1,
 * is the axis of the board or the bus; it is left out, for the joint is clearer. */
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

/* Makes a name as the boards' tables have it. */
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

void dbc_make_signal_name(const struct dbc_exporter *e, const struct dbc_message *to,
                          const struct dbc_field *p, char name[NAME_SIZE])
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
        dbc_make_joint_name(p, name);
    }

    /* Long names that became equal get a number */
    snprintf(made, sizeof made, "%s", name);
    for (unsigned n = 2; dbc_find_signal(to, name); n++) {
        snprintf(name, NAME_SIZE, "%.*s_%u", DBC_NAME_MAX - 5, made, n % 1000);
    }
}
