/* SPDX-License-Identifier: Apache-2.0 */
/* Builds a DBC database in memory, checks every entry against the limits of the format, and writes
 * it as text. */
#include "canbus/dbc.h"

#include "base/array.h"
#include "base/text.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DBC_NOBODY "Vector__XXX" /* the format's name for "no node" */

/* Symbols of the format, listed in its head (NS_). */
enum { DBC_SYMBOLS = 27 };

enum { ID_MAX = 0x7ff, EXTENDED_ID_MAX = 0x1fffffff };
enum { CLASSIC_LENGTH = 8, FD_LENGTH = 64, FRAME_BITS = 8 * FD_LENGTH };

/* 2^53: largest range of whole numbers that a double holds exactly */
static const double EXACT = 9007199254740992.0;

static const char *const dbc_symbols[DBC_SYMBOLS] = {
    "NS_DESC_",     "CM_",
    "BA_DEF_",      "BA_",
    "VAL_",         "CAT_DEF_",
    "CAT_",         "FILTER",
    "BA_DEF_DEF_",  "EV_DATA_",
    "ENVVAR_DATA_", "SGTYPE_",
    "SGTYPE_VAL_",  "BA_DEF_SGTYPE_",
    "BA_SGTYPE_",   "SIG_TYPE_REF_",
    "VAL_TABLE_",   "SIG_GROUP_",
    "SIG_VALTYPE_", "SIGTYPE_VALTYPE_",
    "BO_TX_BU_",    "BA_DEF_REL_",
    "BA_REL_",      "BA_DEF_DEF_REL_",
    "BU_SG_REL_",   "BU_EV_REL_",
    "BU_BO_REL_",
};

/* ---- names and texts ---- */

#define DBC_LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"

/* Checks whether a name is a keyword of the DBC format. */
static bool dbc_is_reserved(const char *name)
{
    static const char *const words[] = {"VERSION", "NS_", "BS_", "BU_",
                                        "BO_",     "SG_", "EV_", DBC_NOBODY};

    return TEXT_INDEX(dbc_symbols, DBC_SYMBOLS, name) >= 0 ||
           TEXT_INDEX(words, ARRAY_COUNT(words), name) >= 0;
}

bool dbc_is_name(const char *name)
{
    const size_t size = strspn(name, DBC_LETTERS "0123456789");

    return size > 0 && size <= DBC_NAME_MAX && !name[size] && strspn(name, DBC_LETTERS) > 0 &&
           !dbc_is_reserved(name);
}

static enum error_code dbc_check_name(const char *what, const char *name, struct error *error)
{
    return dbc_is_name(name) ? ERROR_NONE
                             : error_set(error, ERROR_INPUT,
                                         "found %s \"%.40s\", expected at most %d letters, digits "
                                         "and _ that are no word of the format",
                                         what, name, DBC_NAME_MAX);
}

static enum error_code dbc_check_text(const char *what, const char *text, struct error *error)
{
    size_t size = 0;

    while (text[size] >= ' ' && text[size] <= '~' && text[size] != '"' && text[size] != '\\') {
        size++;
    }
    return !text[size] && size <= DBC_TEXT_MAX
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "found %s \"%.40s\", expected at most %d printable ASCII characters "
                           "without \" and \\",
                           what, text, DBC_TEXT_MAX);
}

static enum error_code dbc_no_memory(struct error *error)
{
    return error_set(error, ERROR_MEMORY, "no memory left for the DBC database");
}

static enum error_code dbc_reject_number(const char *what, int most, struct error *error)
{
    return error_set(error, ERROR_INPUT, "found more than %d %s", most, what);
}

struct dbc *dbc_create(struct arena *arena, const char *name)
{
    struct dbc *dbc = arena_alloc(arena, 1, sizeof *dbc);

    if (!dbc) {
        return NULL;
    }
    dbc->arena = arena;
    dbc->name = arena_strdup(arena, name);
    return dbc->name ? dbc : NULL;
}

enum error_code dbc_set_comment(struct dbc *dbc, const char **comment, const char *text,
                                struct error *error)
{
    if (*comment) {
        return error_set(error, ERROR_INPUT, "found a second comment, expected one");
    }
    if (dbc_check_text("comment", text, error)) {
        return ERROR_INPUT;
    }
    *comment = arena_strdup(dbc->arena, text);
    return *comment ? ERROR_NONE : dbc_no_memory(error);
}

/* ---- nodes and messages ---- */

int dbc_find_node(const struct dbc *dbc, const char *name)
{
    return TEXT_FIND(dbc->node, dbc->nnode, name, name);
}

enum error_code dbc_add_node(struct dbc *dbc, const char *name, struct error *error)
{
    if (dbc_check_name("node", name, error)) {
        return ERROR_INPUT;
    }
    if (dbc_find_node(dbc, name) != DBC_NO_NODE) {
        return error_set(error, ERROR_INPUT, "found node %s again, expected another name", name);
    }
    if (dbc->nnode == DBC_NODES_MAX) {
        return dbc_reject_number("nodes", DBC_NODES_MAX, error);
    }
    dbc->node[dbc->nnode].name = arena_strdup(dbc->arena, name);
    if (!dbc->node[dbc->nnode].name) {
        return dbc_no_memory(error);
    }
    dbc->nnode++;
    return ERROR_NONE;
}

struct dbc_message *dbc_find_message(const struct dbc *dbc, uint32_t id)
{
    struct dbc_message *message = dbc->message;

    while (message && message->id != id) {
        message = message->next;
    }
    return message;
}

/* Checks name, length, identifier, mask, cycle and sender of a message, and that its name and
 * identifier are new. */
static enum error_code dbc_check_message(const struct dbc *dbc, const struct dbc_message *message,
                                         struct error *error)
{
    const uint32_t most = message->id & DBC_EXTENDED ? EXTENDED_ID_MAX : ID_MAX;
    const unsigned longest = message->fd ? FD_LENGTH : CLASSIC_LENGTH, length = message->length;

    if (dbc_check_name("message", message->name, error)) {
        return ERROR_INPUT;
    }
    /* The length must be valid for the format; identifier and mask must fit in 11 or 29 bits */
    if (length > longest || frame_fd_length(length) != length ||
        (message->id & ~DBC_EXTENDED) > most || message->id_mask > most ||
        message->id & message->id_mask || message->cycle_ms > DBC_CYCLE_MAX_MS ||
        message->sender < DBC_NO_NODE || message->sender >= (int)dbc->nnode) {
        return error_set(error, ERROR_INPUT,
                         "found message %s of %u bytes with identifier 0x%" PRIx32
                         ", mask 0x%" PRIx32 ", cycle %" PRIu32
                         " ms and sender %d, expected at most %u bytes, 0x%" PRIx32
                         ", mask bits that are 0 in it, %d ms and a node",
                         message->name, length, message->id & ~DBC_EXTENDED, message->id_mask,
                         message->cycle_ms, message->sender, longest, most, DBC_CYCLE_MAX_MS);
    }
    /* Names and identifiers are unique in a database */
    for (const struct dbc_message *other = dbc->message; other; other = other->next) {
        if (other->id == message->id || !strcmp(other->name, message->name)) {
            return error_set(error, ERROR_INPUT,
                             "found message %s with identifier %" PRIu32
                             ", expected another name and identifier than %s with %" PRIu32,
                             message->name, message->id, other->name, other->id);
        }
    }
    return dbc->nmessage == DBC_MESSAGES_MAX
               ? dbc_reject_number("messages", DBC_MESSAGES_MAX, error)
               : ERROR_NONE;
}

enum error_code dbc_add_message(struct dbc *dbc, const struct dbc_message *message,
                                struct dbc_message **added, struct error *error)
{
    enum error_code code = dbc_check_message(dbc, message, error);
    struct dbc_message *made;

    if (code) {
        return code;
    }
    made = arena_alloc(dbc->arena, 1, sizeof *made);
    if (!made) {
        return dbc_no_memory(error);
    }
    /* Copy only the caller's fields; signals and comments are added later */
    made->id = message->id;
    made->id_mask = message->id_mask;
    made->fd = message->fd;
    made->length = message->length;
    made->sender = message->sender;
    made->cycle_ms = message->cycle_ms;
    made->name = arena_strdup(dbc->arena, message->name);
    if (!made->name) {
        return dbc_no_memory(error);
    }
    /* Messages keep the order in which they were added */
    *(dbc->last_message ? &dbc->last_message->next : &dbc->message) = made;
    dbc->last_message = made;
    dbc->nmessage++;
    *added = made;
    return ERROR_NONE;
}

/* ---- signals ---- */

struct dbc_signal *dbc_find_signal(const struct dbc_message *message, const char *name)
{
    struct dbc_signal *signal = message->signal;

    while (signal && strcmp(signal->name, name)) {
        signal = signal->next;
    }
    return signal;
}

/* In a big-endian signal, the least significant bit of a byte is followed by the most significant
 * bit of the byte before. Count bits from the most significant bit of byte 0: the bits of the
 * signal are then consecutive. */
unsigned dbc_bit(const struct dbc_signal *signal, unsigned k)
{
    unsigned line = (signal->start ^ 7u) + signal->bits - 1u - k;

    return signal->big_endian ? line ^ 7u : signal->start + k;
}

/* Checks whether a signal lies within a message of `length` bytes. */
static bool dbc_signal_fits(const struct dbc_signal *signal, unsigned length)
{
    /* The last bit: the least significant of a big-endian signal, else the most significant */
    return signal->bits >= 1 && signal->bits <= 64 && signal->start < FRAME_BITS &&
           dbc_bit(signal, signal->big_endian ? 0 : signal->bits - 1u) < 8 * length;
}

/* Returns the largest raw value of a signal of whole numbers (not DBC_FLOAT). */
static double dbc_highest_raw(const struct dbc_signal *signal)
{
    return ldexp(1.0, signal->bits - (signal->type == DBC_SIGNED)) - 1.0;
}

/* Returns the first signal that shares a bit or the name with this one; NULL = none. */
static const struct dbc_signal *dbc_find_overlap(const struct dbc_message *message,
                                                 const struct dbc_signal *signal)
{
    bool used[FRAME_BITS] = {false};

    for (unsigned k = 0; k < signal->bits; k++) {
        used[dbc_bit(signal, k)] = true;
    }
    for (const struct dbc_signal *other = message->signal; other; other = other->next) {
        /* Multiplexed signals are in the same frame only if they have the same selector */
        const bool can_meet = signal->role != DBC_MULTIPLEXED || other->role != DBC_MULTIPLEXED ||
                              signal->selector == other->selector;

        for (unsigned k = 0; k < other->bits && can_meet; k++) {
            if (used[dbc_bit(other, k)]) {
                return other;
            }
        }
        if (!strcmp(other->name, signal->name)) {
            return other;
        }
    }
    return NULL;
}

/* Checks a signal before it is added to a message. */
static enum error_code dbc_check_signal(const struct dbc *dbc, const struct dbc_message *message,
                                        const struct dbc_signal *signal, struct error *error)
{
    const struct dbc_signal *by = message->multiplexor, *clash;

    /* Check the signal alone: names, numbers, and 32 bits for a float */
    if (dbc_check_name("signal", signal->name, error) ||
        dbc_check_text("unit", signal->unit, error)) {
        return ERROR_INPUT;
    }
    if (!isfinite(signal->scale) || signal->scale == 0.0 || !isfinite(signal->offset) ||
        !isfinite(signal->min) || !isfinite(signal->max) || signal->min > signal->max ||
        (signal->type == DBC_FLOAT && signal->bits != 32)) {
        return error_set(
            error, ERROR_INPUT,
            "found signal %s of %d bits with factor %g, offset %g and range %g to %g, expected "
            "finite numbers, a factor other than 0, a range that ascends, and 32 bits of a float",
            signal->name, signal->bits, signal->scale, signal->offset, signal->min, signal->max);
    }
    /* A message has at most one multiplexor; a multiplexed signal has one of its values as
     * selector */
    if ((signal->role == DBC_MULTIPLEXOR && (by || signal->type != DBC_UNSIGNED)) ||
        (signal->role == DBC_MULTIPLEXED && (!by || signal->selector > dbc_highest_raw(by)))) {
        return error_set(error, ERROR_INPUT,
                         "found signal %s of multiplexor value %" PRIu32
                         ", expected one unsigned multiplexor before it that can have this value",
                         signal->name, signal->selector);
    }

    /* Check its place in the message, and its receivers */
    if (!dbc_signal_fits(signal, message->length)) {
        return error_set(
            error, ERROR_INPUT,
            "found signal %s of %d bits from bit %d on, expected it within the %d bytes of %s",
            signal->name, signal->bits, signal->start, message->length, message->name);
    }
    if (signal->frame_length > message->length ||
        (dbc->nnode < DBC_NODES_MAX && signal->receivers >> dbc->nnode)) {
        return error_set(error, ERROR_INPUT,
                         "found frame length %d and receivers 0x%" PRIx64
                         ", expected at most %d and only nodes",
                         signal->frame_length, signal->receivers, message->length);
    }

    /* Compare it with the other signals */
    clash = dbc_find_overlap(message, signal);
    if (clash) {
        return error_set(error, ERROR_INPUT,
                         "found signal %s, expected other bits and another name than %s in %s",
                         signal->name, clash->name, message->name);
    }
    return message->nsignal == DBC_SIGNALS_MAX
               ? dbc_reject_number("signals in a message", DBC_SIGNALS_MAX, error)
               : ERROR_NONE;
}

enum error_code dbc_add_signal(struct dbc *dbc, struct dbc_message *message,
                               const struct dbc_signal *signal, struct dbc_signal **added,
                               struct error *error)
{
    enum error_code code = dbc_check_signal(dbc, message, signal, error);
    struct dbc_signal *made;

    if (code) {
        return code;
    }
    made = arena_alloc(dbc->arena, 1, sizeof *made);
    if (!made) {
        return dbc_no_memory(error);
    }
    /* The copy has its own strings and starts without comment and value names */
    *made = *signal;
    made->next = NULL;
    made->comment = made->long_name = NULL;
    made->value = made->last_value = NULL;
    made->nvalue = 0;
    made->name = arena_strdup(dbc->arena, signal->name);
    made->unit = arena_strdup(dbc->arena, signal->unit);
    if (!made->name || !made->unit) {
        return dbc_no_memory(error);
    }
    *(message->last_signal ? &message->last_signal->next : &message->signal) = made;
    message->last_signal = made;
    message->nsignal++;
    if (made->role == DBC_MULTIPLEXOR) {
        message->multiplexor = made;
    }
    *added = made;
    return ERROR_NONE;
}

/* Checks a value name: the signal can have the value, and the value has no name yet. */
static enum error_code dbc_check_value(const struct dbc_signal *signal, int64_t number,
                                       const char *text, struct error *error)
{
    if (dbc_check_text("value name", text, error)) {
        return ERROR_INPUT;
    }
    if (signal->type == DBC_FLOAT || fabs((double)number) > EXACT ||
        (double)number < (signal->type == DBC_SIGNED ? -ldexp(1.0, signal->bits - 1) : 0.0) ||
        (double)number > dbc_highest_raw(signal)) {
        return error_set(error, ERROR_INPUT,
                         "found value %" PRId64 ", expected one that signal %s can have", number,
                         signal->name);
    }
    for (const struct dbc_value *other = signal->value; other; other = other->next) {
        if (other->number == number) {
            return error_set(error, ERROR_INPUT,
                             "found value %" PRId64 " of signal %s again, expected it once", number,
                             signal->name);
        }
    }
    return signal->nvalue == DBC_VALUES_MAX
               ? dbc_reject_number("values of a signal", DBC_VALUES_MAX, error)
               : ERROR_NONE;
}

enum error_code dbc_add_value(struct dbc *dbc, struct dbc_signal *signal, int64_t number,
                              const char *text, struct error *error)
{
    enum error_code code = dbc_check_value(signal, number, text, error);
    struct dbc_value *made;

    if (code) {
        return code;
    }
    made = arena_alloc(dbc->arena, 1, sizeof *made);
    if (!made) {
        return dbc_no_memory(error);
    }
    made->number = number;
    made->text = arena_strdup(dbc->arena, text);
    if (!made->text) {
        return dbc_no_memory(error);
    }
    *(signal->last_value ? &signal->last_value->next : &signal->value) = made;
    signal->last_value = made;
    signal->nvalue++;
    return ERROR_NONE;
}

/* ---- frames ---- */

const struct dbc_message *dbc_find_frame(const struct dbc *dbc, const struct bus_frame *frame)
{
    const bool extended = frame->flags & FRAME_EXTENDED;

    if (frame->flags & (FRAME_ERROR | FRAME_REMOTE)) {
        return NULL;
    }
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        if (extended == ((m->id & DBC_EXTENDED) != 0) &&
            (frame->id & ~m->id_mask) == (m->id & ~DBC_EXTENDED)) {
            return m;
        }
    }
    return NULL;
}

/* Returns the bits of a signal in a frame that holds them. */
static uint64_t dbc_raw_bits(const struct dbc_signal *signal, const struct bus_frame *frame)
{
    uint64_t raw = 0;

    for (unsigned k = 0; k < signal->bits; k++) {
        const unsigned bit = dbc_bit(signal, k);

        raw |= (uint64_t)(frame->data[bit / 8] >> bit % 8 & 1) << k;
    }
    return raw;
}

bool dbc_read_signal(const struct dbc_message *message, const struct dbc_signal *signal,
                     const struct bus_frame *frame, double *value)
{
    const struct dbc_signal *by = message->multiplexor;
    uint64_t raw;
    double number;

    /* Return if the signal is not in this frame */
    if (!dbc_signal_fits(signal, frame->len) ||
        (signal->role == DBC_MULTIPLEXED && (!by || !dbc_signal_fits(by, frame->len) ||
                                             dbc_raw_bits(by, frame) != signal->selector))) {
        return false;
    }

    /* Convert its bits to a value */
    raw = dbc_raw_bits(signal, frame);
    if (signal->type == DBC_FLOAT) {
        const uint32_t bits = (uint32_t)raw;
        float real;

        memcpy(&real, &bits, sizeof real);
        number = (double)real;
    } else if (signal->type == DBC_SIGNED && raw >> (signal->bits - 1) & 1) {
        number = -(double)((~raw & (~UINT64_C(0) >> (64 - signal->bits))) + 1);
    } else {
        number = (double)raw;
    }
    *value = number * signal->scale + signal->offset;
    return isfinite(*value);
}

/* ---- writing ---- */

/* Attributes known to tools; FrameLength and IdentifierMask are ours (canbus/dbc.h) */
#define DBC_NAME "DBName"
#define DBC_BUS_TYPE "BusType"
#define DBC_BITRATE "Baudrate"
#define DBC_DATA_BITRATE "BaudrateCANFD"
#define DBC_CYCLE "GenMsgCycleTime"
#define DBC_FORMAT "VFrameFormat"
#define DBC_LENGTH "FrameLength"
#define DBC_MASK "IdentifierMask"
#define DBC_LONG_NODE "SystemNodeLongSymbol"
#define DBC_LONG_MESSAGE "SystemMessageLongSymbol"
#define DBC_LONG_SIGNAL "SystemSignalLongSymbol"

/* Values of BusType and VFrameFormat */
#define DBC_BUS_CLASSIC "CAN"
#define DBC_BUS_FD "CAN FD"
enum { DBC_FORMAT_EXTENDED = 1, DBC_FORMAT_FD = 14 }; /* VFrameFormat is their sum */

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
    "BA_DEF_ BU_ \"" DBC_LONG_NODE "\" STRING ;\n"
    "BA_DEF_ BO_ \"" DBC_LONG_MESSAGE "\" STRING ;\n"
    "BA_DEF_ SG_ \"" DBC_LONG_SIGNAL "\" STRING ;\n"
    "BA_DEF_DEF_ \"" DBC_NAME "\" \"\";\n"
    "BA_DEF_DEF_ \"" DBC_BUS_TYPE "\" \"" DBC_BUS_CLASSIC "\";\n"
    "BA_DEF_DEF_ \"" DBC_BITRATE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_DATA_BITRATE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_CYCLE "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_FORMAT "\" \"StandardCAN\";\n"
    "BA_DEF_DEF_ \"" DBC_MASK "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_LENGTH "\" 0;\n"
    "BA_DEF_DEF_ \"" DBC_LONG_NODE "\" \"\";\n"
    "BA_DEF_DEF_ \"" DBC_LONG_MESSAGE "\" \"\";\n"
    "BA_DEF_DEF_ \"" DBC_LONG_SIGNAL "\" \"\";\n";
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

    /* Write the nodes that receive a signal, comma-separated, and end the line */
    const char *separator = "";

    for (size_t i = 0; i < dbc->nnode; i++) {
        if (signal->receivers >> i & 1) {
            fprintf(file, "%s%s", separator, dbc->node[i].name);
            separator = ",";
        }
    }
    fputs(signal->receivers ? "\n" : DBC_NOBODY "\n", file);
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
    for (size_t i = 0; i < dbc->nnode; i++) {
        if (dbc->node[i].long_name) {
            fprintf(file, "BA_ \"" DBC_LONG_NODE "\" BU_ %s \"%s\";\n", dbc->node[i].name,
                    dbc->node[i].long_name);
        }
    }
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
        if (m->long_name) {
            fprintf(file, "BA_ \"" DBC_LONG_MESSAGE "\" BO_ %" PRIu32 " \"%s\";\n", m->id,
                    m->long_name);
        }
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->frame_length) {
                fprintf(file, "BA_ \"" DBC_LENGTH "\" SG_ %" PRIu32 " %s %d;\n", m->id, s->name,
                        s->frame_length);
            }
            if (s->long_name) {
                fprintf(file, "BA_ \"" DBC_LONG_SIGNAL "\" SG_ %" PRIu32 " %s \"%s\";\n", m->id,
                        s->name, s->long_name);
            }
        }
    }
}

enum error_code dbc_write(const struct dbc *dbc, FILE *file, struct error *error)
{
    /* Write the version, the symbols of the format, and the nodes (BU_) */
    fputs("VERSION \"\"\n\nNS_ :\n", file);
    for (size_t i = 0; i < DBC_SYMBOLS; i++) {
        fprintf(file, "\t%s\n", dbc_symbols[i]);
    }
    fputs("\nBS_:\n\nBU_:", file);
    for (size_t i = 0; i < dbc->nnode; i++) {
        fprintf(file, " %s", dbc->node[i].name);
    }
    fputc('\n', file);

    /* Write the messages (BO_) with their signals */
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        fprintf(file, "\nBO_ %" PRIu32 " %s: %d %s\n", m->id, m->name, m->length,
                m->sender == DBC_NO_NODE ? DBC_NOBODY : dbc->node[m->sender].name);
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            dbc_put_signal(dbc, s, file);
        }
    }
    fputc('\n', file);

    /* Write the comments (CM_) of the network, nodes, messages and signals */
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

    dbc_put_attributes(dbc, file);

    /* Write the names of values (VAL_) */
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

    /* Write the value type of signals that are IEEE floats (SIG_VALTYPE_ 1) */
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            if (s->type == DBC_FLOAT) {
                fprintf(file, "SIG_VALTYPE_ %" PRIu32 " %s : 1;\n", m->id, s->name);
            }
        }
    }
    if (fflush(file) || ferror(file)) {
        return error_set_errno(error, errno, "the DBC database could not be written");
    }
    return ERROR_NONE;
}
