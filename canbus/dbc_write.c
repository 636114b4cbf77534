/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a DBC database as text, its sections in their usual order. */
#include "canbus/dbc.h"

#include "canbus/dbc_private.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>

/* Attributes that tools know, and FrameLength and IdentifierMask, which are ours (canbus/dbc.h) */
#define DBC_NAME "DBName"
#define DBC_BUS_TYPE "BusType"
#define DBC_BITRATE "Baudrate"
#define DBC_DATA_BITRATE "BaudrateCANFD"
#define DBC_CYCLE "GenMsgCycleTime"
#define DBC_FORMAT "VFrameFormat"
#define DBC_LENGTH "FrameLength"
#define DBC_MASK "IdentifierMask"

/* Values of BusType and VFrameFormat */
#define DBC_BUS_CLASSIC "CAN"
#define DBC_BUS_FD "CAN FD"
enum { DBC_FORMAT_EXTENDED = 1, DBC_FORMAT_FD = 14 }; /* both: 15 */

/* The lines that define the attributes and their defaults, the same in every file. */
/* clang-format off */
static const char dbc_definitions[] =
    "BA_DEF_ \"" DBC_NAME "\" STRING ;\n"
    "BA_DEF_ \"" DBC_BUS_TYPE "\" STRING ;\n"
    "BA_DEF_ \"" DBC_BITRATE "\" INT 0 1000000000;\n"
    "BA_DEF_ \"" DBC_DATA_BITRATE "\" INT 0 1000000000;\n"
    "BA_DEF_ BO_ \"" DBC_CYCLE "\" INT 0 3600000;\n"
    "BA_DEF_ BO_ \"" DBC_FORMAT "\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"reserved\","
    "\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\","
    "\"reserved\",\"reserved\",\"reserved\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n"
    "BA_DEF_ BO_ \"" DBC_MASK "\" INT 0 536870911;\n"
    "BA_DEF_ SG_ \"" DBC_LENGTH "\" INT 0 64;\n"
    "BA_DEF_DEF_ \"" DBC_NAME "\" \"\";\n"
    "BA_DEF_DEF_ \"" DBC_BUS_TYPE "\" \"" DBC_BUS_CLASSIC "\";\n"
    "BA_DEF_DEF_ \"" DBC_BITRATE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_DATA_BITRATE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_CYCLE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_FORMAT "\" \"StandardCAN\";\n"
    "BA_DEF_DEF_ \"" DBC_MASK "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_LENGTH "\" 0;\n";
/* clang-format on */

/* Writes a number in the shortest notation (15 to 17 digits) that reads back as the same double. */
static void dbc_put_number(FILE *file, double value)
{
    char text[32];
    int digits = 15;

    do {
        snprintf(text, sizeof text, "%.*g", digits, value);
    } while (strtod(text, NULL) != value && digits++ < 17);
    fputs(text, file);
}

/* Returns the name of a node, or the format's word for none. */
static const char *dbc_sender_name(const struct dbc *dbc, int node)
{
    return node == DBC_NO_NODE ? DBC_NOBODY : dbc->node[node].name;
}

/* Writes the version, the symbols of the format, and the nodes (BU_). */
static void dbc_put_head(const struct dbc *dbc, FILE *file)
{
    fputs("VERSION \"\"\n\nNS_ :\n", file);
    for (size_t i = 0; i < DBC_SYMBOLS; i++) {
        fprintf(file, "\t%s\n", dbc_symbols[i]);
    }
    fputs("\nBS_:\n\nBU_:", file);
    for (size_t i = 0; i < dbc->nnode; i++) {
        fprintf(file, " %s", dbc->node[i].name);
    }
    fputc('\n', file);
}

/* Writes the nodes that receive a signal, comma-separated, and ends the line. */
static void dbc_put_receivers(const struct dbc *dbc, const struct dbc_signal *signal, FILE *file)
{
    const char *separator = "";

    for (size_t i = 0; i < dbc->nnode; i++) {
        if (signal->receivers >> i & 1) {
            fprintf(file, "%s%s", separator, dbc->node[i].name);
            separator = ",";
        }
    }
    fputs(signal->receivers ? "\n" : DBC_NOBODY "\n", file);
}

/* Writes a signal (SG_): multiplexing, place, byte order, sign, scale, range, unit, receivers. */
static void dbc_put_signal(const struct dbc *dbc, const struct dbc_signal *signal, FILE *file)
{
    fprintf(file, " SG_ %s ", signal->name);
    if (signal->role == DBC_MULTIPLEXOR) {
        fputs("M ", file);
    } else if (signal->role == DBC_MULTIPLEXED) {
        fprintf(file, "m%" PRIu32 " ", signal->selector);
    }
    fprintf(file, ": %d|%d@%d%c (", signal->start, signal->bits, !signal->big_endian,
            signal->type == DBC_UNSIGNED ? '+' : '-');
    dbc_put_number(file, signal->scale);
    fputc(',', file);
    dbc_put_number(file, signal->offset);
    fputs(") [", file);
    dbc_put_number(file, signal->min);
    fputc('|', file);
    dbc_put_number(file, signal->max);
    fprintf(file, "] \"%s\" ", signal->unit);
    dbc_put_receivers(dbc, signal, file);
}

/* Writes the messages (BO_) with their signals. */
static void dbc_put_messages(const struct dbc *dbc, FILE *file)
{
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        fprintf(file, "\nBO_ %" PRIu32 " %s: %d %s\n", m->id, m->name, m->length,
                dbc_sender_name(dbc, m->sender));
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            dbc_put_signal(dbc, s, file);
        }
    }
    fputc('\n', file);
}

/* Writes the comments (CM_) of the network, nodes, messages and signals. */
static void dbc_put_comments(const struct dbc *dbc, FILE *file)
{
    if (dbc->comment) {
        fprintf(file, "CM_ \"%s\";\n", dbc->comment);
    }
    for (size_t i = 0; i < dbc->nnode; i++) {
        if (dbc->node[i].comment) {
            fprintf(file, "CM_ BU_ %s \"%s\";\n", dbc->node[i].name, dbc->node[i].comment);
        }
    }
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        if (m->comment) {
            fprintf(file, "CM_ BO_ %" PRIu32 " \"%s\";\n", m->id, m->comment);
        }
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->comment) {
                fprintf(file, "CM_ SG_ %" PRIu32 " %s \"%s\";\n", m->id, s->name, s->comment);
            }
        }
    }
}

/* Writes the attributes (BA_): of the network, then of each message and its signals. */
static void dbc_put_attributes(const struct dbc *dbc, FILE *file)
{
    /* Definitions and defaults come before the values */
    fputs(dbc_definitions, file);
    fprintf(file, "BA_ \"" DBC_NAME "\" \"%s\";\n", dbc->name);
    fprintf(file, "BA_ \"" DBC_BUS_TYPE "\" \"%s\";\n", dbc->fd ? DBC_BUS_FD : DBC_BUS_CLASSIC);
    fprintf(file, "BA_ \"" DBC_BITRATE "\" %" PRId64 ";\n", dbc->bitrate);
    fprintf(file, "BA_ \"" DBC_DATA_BITRATE "\" %" PRId64 ";\n", dbc->data_bitrate);
    /* An attribute is written only where it differs from its default */
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        if (m->cycle_ms) {
            fprintf(file, "BA_ \"" DBC_CYCLE "\" BO_ %" PRIu32 " %" PRIu32 ";\n", m->id,
                    m->cycle_ms);
        }
        if (m->fd || m->id & DBC_EXTENDED) {
            fprintf(file, "BA_ \"" DBC_FORMAT "\" BO_ %" PRIu32 " %d;\n", m->id,
                    (m->fd ? DBC_FORMAT_FD : 0) + (m->id & DBC_EXTENDED ? DBC_FORMAT_EXTENDED : 0));
        }
        if (m->id_mask) {
            fprintf(file, "BA_ \"" DBC_MASK "\" BO_ %" PRIu32 " %" PRIu32 ";\n", m->id, m->id_mask);
        }
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->frame_length) {
                fprintf(file, "BA_ \"" DBC_LENGTH "\" SG_ %" PRIu32 " %s %d;\n", m->id, s->name,
                        s->frame_length);
            }
        }
    }
}

/* Writes the names of values (VAL_). */
static void dbc_put_values(const struct dbc *dbc, FILE *file)
{
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->value) {
                fprintf(file, "VAL_ %" PRIu32 " %s", m->id, s->name);
                for (const struct dbc_value *v = s->value; v; v = v->next) {
                    fprintf(file, " %" PRId64 " \"%s\"", v->number, v->text);
                }
                fputs(" ;\n", file);
            }
        }
    }
}

/* Writes the value type of signals that are IEEE floats (SIG_VALTYPE_ 1). */
static void dbc_put_floats(const struct dbc *dbc, FILE *file)
{
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->type == DBC_FLOAT) {
                fprintf(file, "SIG_VALTYPE_ %" PRIu32 " %s : 1;\n", m->id, s->name);
            }
        }
    }
}

enum error_code dbc_write(const struct dbc *dbc, FILE *file, struct error *error)
{
    dbc_put_head(dbc, file);
    dbc_put_messages(dbc, file);
    dbc_put_comments(dbc, file);
    dbc_put_attributes(dbc, file);
    dbc_put_values(dbc, file);
    dbc_put_floats(dbc, file);
    if (fflush(file) || ferror(file)) {
        return error_set_errno(error, errno, "the DBC database could not be written");
    }
    return ERROR_NONE;
}
