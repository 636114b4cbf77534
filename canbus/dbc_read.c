/* SPDX-License-Identifier: Apache-2.0 */
/* The strict reader of DBC text: tokens, then one section after the other. */
#include "canbus/dbc.h"

#include "base/text.h"
#include "canbus/dbc_private.h"

#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

enum token_kind {
    TOKEN_END,
    TOKEN_WORD,   /* letters, digits, _ */
    TOKEN_NUMBER, /* digits and what a decimal number may hold beside them */
    TOKEN_STRING, /* text without the quotes */
    TOKEN_SIGN,   /* any other character, alone */
};

enum { TOKEN_MAX = DBC_TEXT_MAX };

struct token {
    enum token_kind kind;
    char text[TOKEN_MAX + 1];
    unsigned line, column;
};

struct reader {
    const char *file;
    const char *at, *end;
    unsigned line, column;
    struct token token; /* the next one */
    struct dbc *dbc;
    struct error *error;
};

/* ---- tokens ---- */

static enum error_code fail_at(struct reader *r, unsigned line, unsigned column, const char *format,
                               ...) __attribute__((format(printf, 4, 5)));

static enum error_code fail_at(struct reader *r, unsigned line, unsigned column, const char *format,
                               ...)
{
    char text[256];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return error_set(r->error, ERROR_INPUT, "%.200s:%u:%u: %s", r->file, line, column, text);
}

/* The next token is not what it should be. */
static enum error_code unexpected(struct reader *r, const char *expected)
{
    const struct token *t = &r->token;

    return t->kind == TOKEN_END
               ? fail_at(r, t->line, t->column, "found the end, expected %s", expected)
               : fail_at(r, t->line, t->column, "found \"%.40s\", expected %s", t->text, expected);
}

static void step(struct reader *r)
{
    if (*r->at++ == '\n') {
        r->line++;
        r->column = 1;
    } else {
        r->column++;
    }
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static bool is_word(char c)
{
    return is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

/* Whether the character at r->at goes on with a token of the kind that has begun; last is the one
 * before. */
static bool goes_on(const struct reader *r, enum token_kind kind, char last)
{
    const char c = *r->at;

    return kind == TOKEN_WORD ? is_word(c)
                              : is_digit(c) || c == '.' || c == 'e' || c == 'E' ||
                                    ((c == '-' || c == '+') && (last == 'e' || last == 'E'));
}

static enum error_code read_run(struct reader *r, enum token_kind kind)
{
    size_t size = 0;

    r->token.kind = kind;
    do {
        if (size == TOKEN_MAX) {
            return fail_at(r, r->token.line, r->token.column,
                           "found a word of more than %d letters, expected a shorter one",
                           TOKEN_MAX);
        }
        r->token.text[size++] = *r->at;
        step(r);
    } while (r->at < r->end && goes_on(r, kind, r->token.text[size - 1]));
    r->token.text[size] = '\0';
    return ERROR_NONE;
}

static enum error_code read_string(struct reader *r)
{
    size_t size = 0;

    r->token.kind = TOKEN_STRING;
    step(r);
    while (r->at < r->end && *r->at != '"') {
        if (*r->at < ' ' || *r->at > '~') {
            return fail_at(r, r->line, r->column,
                           "found the byte 0x%02x, expected printable ASCII in a string",
                           (unsigned)(unsigned char)*r->at);
        }
        if (size == TOKEN_MAX) {
            return fail_at(r, r->line, r->column, "found a longer string, expected at most %d",
                           TOKEN_MAX);
        }
        r->token.text[size++] = *r->at;
        step(r);
    }
    r->token.text[size] = '\0';
    if (r->at == r->end) {
        return fail_at(r, r->line, r->column, "found the end, expected \" to close the string");
    }
    step(r);
    return ERROR_NONE;
}

/* Moves on to the next token. */
static enum error_code next(struct reader *r)
{
    while (r->at < r->end &&
           (*r->at == ' ' || *r->at == '\t' || *r->at == '\n' || *r->at == '\r')) {
        step(r);
    }
    r->token.line = r->line;
    r->token.column = r->column;
    r->token.kind = TOKEN_END;
    r->token.text[0] = '\0';
    if (r->at == r->end) {
        return ERROR_NONE;
    }
    if (*r->at == '"') {
        return read_string(r);
    }
    if (is_digit(*r->at) || (*r->at == '-' && r->at + 1 < r->end && is_digit(r->at[1]))) {
        return read_run(r, TOKEN_NUMBER);
    }
    if (is_word(*r->at)) {
        return read_run(r, TOKEN_WORD);
    }
    if (*r->at < ' ' || *r->at > '~') {
        return fail_at(r, r->line, r->column, "found the byte 0x%02x, expected printable ASCII",
                       (unsigned)(unsigned char)*r->at);
    }
    r->token.kind = TOKEN_SIGN;
    r->token.text[0] = *r->at;
    r->token.text[1] = '\0';
    step(r);
    return ERROR_NONE;
}

static bool is_next(const struct reader *r, enum token_kind kind, const char *text)
{
    return r->token.kind == kind && !strcmp(r->token.text, text);
}

static bool is_next_word(const struct reader *r, const char *word)
{
    return is_next(r, TOKEN_WORD, word);
}

/* What the text says comes next, token by token. */
static enum error_code expect(struct reader *r, const char *text)
{
    struct error error;
    struct reader of = {.file = "", .at = text, .end = text + strlen(text), .error = &error};
    enum error_code code = next(&of);

    while (!code && of.token.kind != TOKEN_END) {
        if (!is_next(r, of.token.kind, of.token.text)) {
            char wanted[64];

            snprintf(wanted, sizeof wanted, "\"%.40s\"", of.token.text);
            return unexpected(r, wanted);
        }
        code = next(r);
        if (!code) {
            code = next(&of);
        }
    }
    return code;
}

/* Takes the next token, which is to be of the kind; text holds TOKEN_MAX + 1. */
static enum error_code take(struct reader *r, enum token_kind kind, const char *expected,
                            char *text)
{
    if (r->token.kind != kind) {
        return unexpected(r, expected);
    }
    memcpy(text, r->token.text, sizeof r->token.text);
    return next(r);
}

static enum error_code take_int(struct reader *r, int64_t min, int64_t max, int64_t *value)
{
    char expected[80];

    snprintf(expected, sizeof expected, "a whole number from %" PRId64 " to %" PRId64, min, max);
    if (r->token.kind != TOKEN_NUMBER || !text_to_int(r->token.text, min, max, value)) {
        return unexpected(r, expected);
    }
    return next(r);
}

static enum error_code take_double(struct reader *r, double *value)
{
    if (r->token.kind != TOKEN_NUMBER || !text_to_double(r->token.text, value)) {
        return unexpected(r, "a number");
    }
    return next(r);
}

/* Gives an error of what was read from line and column on its place. */
static enum error_code placed(struct reader *r, enum error_code code, unsigned line,
                              unsigned column)
{
    return code == ERROR_INPUT ? error_prefix(r->error, "%.200s:%u:%u", r->file, line, column)
                               : code;
}

/* ---- nodes, messages, signals ---- */

static enum error_code read_head(struct reader *r)
{
    enum error_code code = expect(r, "VERSION \"\" NS_ :");

    for (size_t i = 0; i < DBC_SYMBOLS && !code; i++) {
        code = expect(r, dbc_symbols[i]);
    }
    return code ? code : expect(r, "BS_: BU_:");
}

static enum error_code read_nodes(struct reader *r)
{
    enum error_code code = ERROR_NONE;

    while (!code && r->token.kind == TOKEN_WORD && dbc_is_name(r->token.text)) {
        const unsigned line = r->token.line, column = r->token.column;

        code = placed(r, dbc_add_node(r->dbc, r->token.text, r->error), line, column);
        if (!code) {
            code = next(r);
        }
    }
    return code;
}

/* A node, or DBC_NO_NODE for DBC_NOBODY. */
static enum error_code take_node(struct reader *r, int *node)
{
    if (is_next_word(r, DBC_NOBODY)) {
        *node = DBC_NO_NODE;
        return next(r);
    }
    *node = r->token.kind == TOKEN_WORD ? dbc_find_node(r->dbc, r->token.text) : DBC_NO_NODE;
    return *node == DBC_NO_NODE ? unexpected(r, "a node or " DBC_NOBODY) : next(r);
}

/* M, m and a number, or neither */
static enum error_code read_role(struct reader *r, struct dbc_signal *signal)
{
    int64_t selector;

    if (r->token.kind != TOKEN_WORD) {
        return ERROR_NONE;
    }
    if (is_next_word(r, "M")) {
        signal->role = DBC_MULTIPLEXOR;
    } else if (r->token.text[0] == 'm' && is_digit(r->token.text[1]) &&
               text_to_int(r->token.text + 1, 0, UINT32_MAX, &selector)) {
        signal->role = DBC_MULTIPLEXED;
        signal->selector = (uint32_t)selector;
    } else {
        return unexpected(r, "M, m and a number, or :");
    }
    return next(r);
}

static enum error_code read_place(struct reader *r, struct dbc_signal *signal)
{
    int64_t start = 0, bits = 0, order = 0;
    enum error_code code = expect(r, ":");

    if (code || (code = take_int(r, 0, 511, &start)) || (code = expect(r, "|")) ||
        (code = take_int(r, 1, 64, &bits)) || (code = expect(r, "@")) ||
        (code = take_int(r, 0, 1, &order))) {
        return code;
    }
    signal->start = (uint16_t)start;
    signal->bits = (uint8_t)bits;
    signal->big_endian = !order;
    if (!is_next(r, TOKEN_SIGN, "+") && !is_next(r, TOKEN_SIGN, "-")) {
        return unexpected(r, "+ or -");
    }
    signal->type = r->token.text[0] == '-' ? DBC_SIGNED : DBC_UNSIGNED;
    return next(r);
}

static enum error_code read_numbers(struct reader *r, struct dbc_signal *signal)
{
    enum error_code code = expect(r, "(");

    if (code || (code = take_double(r, &signal->scale)) || (code = expect(r, ",")) ||
        (code = take_double(r, &signal->offset)) || (code = expect(r, ") [")) ||
        (code = take_double(r, &signal->min)) || (code = expect(r, "|")) ||
        (code = take_double(r, &signal->max))) {
        return code;
    }
    return expect(r, "]");
}

static enum error_code read_receivers(struct reader *r, struct dbc_signal *signal)
{
    enum error_code code;
    int node;

    if (is_next_word(r, DBC_NOBODY)) {
        return next(r);
    }
    for (;;) {
        const int last = signal->receivers ? 63 - __builtin_clzll(signal->receivers) : -1;

        if (r->token.kind != TOKEN_WORD || (node = dbc_find_node(r->dbc, r->token.text)) <= last) {
            return unexpected(r, "a node, in the order of BU_");
        }
        signal->receivers |= UINT64_C(1) << node;
        code = next(r);
        if (code || !is_next(r, TOKEN_SIGN, ",")) {
            return code;
        }
        code = next(r);
        if (code) {
            return code;
        }
    }
}

static enum error_code read_signal(struct reader *r, struct dbc_message *message)
{
    const unsigned line = r->token.line, column = r->token.column;
    char name[TOKEN_MAX + 1], unit[TOKEN_MAX + 1];
    struct dbc_signal signal = {.name = name, .unit = unit}, *added;
    enum error_code code = expect(r, "SG_");

    if (code || (code = take(r, TOKEN_WORD, "the name of a signal", name)) ||
        (code = read_role(r, &signal)) || (code = read_place(r, &signal)) ||
        (code = read_numbers(r, &signal)) || (code = take(r, TOKEN_STRING, "a unit", unit)) ||
        (code = read_receivers(r, &signal))) {
        return code;
    }
    return placed(r, dbc_add_signal(r->dbc, message, &signal, &added, r->error), line, column);
}

static enum error_code read_message(struct reader *r)
{
    const unsigned line = r->token.line, column = r->token.column;
    char name[TOKEN_MAX + 1];
    struct dbc_message message = {.name = name}, *added;
    int64_t id = 0, length = 0;
    enum error_code code = expect(r, "BO_");

    if (code || (code = take_int(r, 0, 2047, &id)) ||
        (code = take(r, TOKEN_WORD, "the name of a message", name)) || (code = expect(r, ":")) ||
        (code = take_int(r, 0, 64, &length)) || (code = take_node(r, &message.sender))) {
        return code;
    }
    message.id = (uint32_t)id;
    message.length = (uint8_t)length;
    message.fd = length > 8; /* VFrameFormat has to say so too */
    code = placed(r, dbc_add_message(r->dbc, &message, &added, r->error), line, column);
    while (!code && is_next_word(r, "SG_")) {
        code = read_signal(r, added);
    }
    if (!code) {
        added->fd = false;
    }
    return code;
}

/* ---- what is said about them later ---- */

static enum error_code take_message(struct reader *r, struct dbc_message **message)
{
    int64_t id = 0;

    if (r->token.kind != TOKEN_NUMBER || !text_to_int(r->token.text, 0, 2047, &id) ||
        !(*message = dbc_find_message(r->dbc, (uint32_t)id))) {
        return unexpected(r, "the identifier of a message");
    }
    return next(r);
}

static enum error_code take_signal(struct reader *r, struct dbc_message **message,
                                   struct dbc_signal **signal)
{
    enum error_code code = take_message(r, message);

    if (code) {
        return code;
    }
    if (r->token.kind != TOKEN_WORD || !(*signal = dbc_find_signal(*message, r->token.text))) {
        return unexpected(r, "a signal of this message");
    }
    return next(r);
}

/* after BU_, BO_, SG_ or nothing: where the comment belongs */
static enum error_code take_commented(struct reader *r, const char ***comment)
{
    struct dbc_message *message;
    struct dbc_signal *signal;
    enum error_code code = ERROR_NONE;
    int node = 0;

    *comment = &r->dbc->comment;
    if (is_next_word(r, "BU_")) {
        code = next(r);
        if (!code) {
            code = take_node(r, &node);
        }
        if (code || node == DBC_NO_NODE) {
            return code ? code : unexpected(r, "a node before it");
        }
        *comment = &r->dbc->node[node].comment;
    } else if (is_next_word(r, "BO_")) {
        code = next(r);
        if (!code && !(code = take_message(r, &message))) {
            *comment = &message->comment;
        }
    } else if (is_next_word(r, "SG_")) {
        code = next(r);
        if (!code && !(code = take_signal(r, &message, &signal))) {
            *comment = &signal->comment;
        }
    }
    return code;
}

static enum error_code read_comment(struct reader *r)
{
    const unsigned line = r->token.line, column = r->token.column;
    char text[TOKEN_MAX + 1];
    const char **comment;
    enum error_code code = expect(r, "CM_");

    if (code || (code = take_commented(r, &comment)) ||
        (code = take(r, TOKEN_STRING, "a comment", text)) ||
        (code = placed(r, dbc_set_comment(r->dbc, comment, text, r->error), line, column))) {
        return code;
    }
    return expect(r, ";");
}

/* The attributes of the database: each once, in this order. */
static enum error_code read_database(struct reader *r)
{
    char text[TOKEN_MAX + 1];
    enum error_code code = expect(r, "BA_ \"" DBC_NAME "\"");

    if (code || (code = take(r, TOKEN_STRING, "a name", text))) {
        return code;
    }
    r->dbc->name = arena_strdup(r->dbc->arena, text);
    if (!r->dbc->name) {
        return error_set(r->error, ERROR_MEMORY, "no memory left for the DBC database");
    }
    code = expect(r, "; BA_ \"" DBC_BUS_TYPE "\"");
    if (code) {
        return code;
    }
    r->dbc->fd = is_next(r, TOKEN_STRING, DBC_BUS_FD);
    code = expect(r, r->dbc->fd ? "\"" DBC_BUS_FD "\";" : "\"" DBC_BUS_CLASSIC "\";");
    if (code || (code = expect(r, "BA_ \"" DBC_BITRATE "\"")) ||
        (code = take_int(r, 0, 1000000000, &r->dbc->bitrate)) ||
        (code = expect(r, "; BA_ \"" DBC_DATA_BITRATE "\"")) ||
        (code = take_int(r, 0, 1000000000, &r->dbc->data_bitrate))) {
        return code;
    }
    return expect(r, ";");
}

static enum error_code read_message_attribute(struct reader *r, bool cycle)
{
    struct dbc_message *message;
    int64_t value = 0;
    enum error_code code = expect(r, "BO_");

    if (code || (code = take_message(r, &message))) {
        return code;
    }
    if (cycle ? message->cycle_ms > 0 : message->fd) {
        return unexpected(r, "the attribute once");
    }
    code = cycle ? take_int(r, 1, DBC_CYCLE_MAX_MS, &value)
                 : take_int(r, DBC_FORMAT_FD, DBC_FORMAT_FD, &value);
    if (cycle) {
        message->cycle_ms = (uint32_t)value;
    } else {
        message->fd = true;
    }
    return code;
}

static enum error_code read_signal_attribute(struct reader *r)
{
    struct dbc_message *message;
    struct dbc_signal *signal;
    int64_t value = 0;
    enum error_code code = expect(r, "SG_");

    if (code || (code = take_signal(r, &message, &signal))) {
        return code;
    }
    if (signal->frame_length > 0) {
        return unexpected(r, "the attribute once");
    }
    code = take_int(r, 1, message->length, &value);
    signal->frame_length = (uint8_t)value;
    return code;
}

static enum error_code read_attribute(struct reader *r)
{
    enum error_code code = expect(r, "BA_");

    if (code) {
        return code;
    }
    if (is_next(r, TOKEN_STRING, DBC_CYCLE) || is_next(r, TOKEN_STRING, DBC_FORMAT)) {
        const bool cycle = is_next(r, TOKEN_STRING, DBC_CYCLE);

        code = next(r);
        code = code ? code : read_message_attribute(r, cycle);
    } else if (is_next(r, TOKEN_STRING, DBC_LENGTH)) {
        code = next(r);
        code = code ? code : read_signal_attribute(r);
    } else {
        return unexpected(r, "\"" DBC_CYCLE "\", \"" DBC_FORMAT "\" or \"" DBC_LENGTH "\"");
    }
    return code ? code : expect(r, ";");
}

static enum error_code read_values(struct reader *r)
{
    struct dbc_message *message;
    struct dbc_signal *signal;
    enum error_code code = expect(r, "VAL_");

    if (code || (code = take_signal(r, &message, &signal))) {
        return code;
    }
    if (signal->value) {
        return unexpected(r, "the values of a signal once");
    }
    do {
        const unsigned line = r->token.line, column = r->token.column;
        char text[TOKEN_MAX + 1];
        int64_t number = 0;

        if ((code = take_int(r, -(INT64_C(1) << 53), INT64_C(1) << 53, &number)) ||
            (code = take(r, TOKEN_STRING, "the name of a value", text)) ||
            (code =
                 placed(r, dbc_add_value(r->dbc, signal, number, text, r->error), line, column))) {
            return code;
        }
    } while (!is_next(r, TOKEN_SIGN, ";"));
    return next(r);
}

static enum error_code read_float(struct reader *r)
{
    const unsigned line = r->token.line, column = r->token.column;
    struct dbc_message *message;
    struct dbc_signal *signal;
    enum error_code code = expect(r, "SIG_VALTYPE_");

    if (code || (code = take_signal(r, &message, &signal)) || (code = expect(r, ": 1;"))) {
        return code;
    }
    if (signal->bits != 32 || signal->type != DBC_SIGNED || signal->value) {
        return fail_at(r, line, column,
                       "found a float of %d bits, expected 32 signed ones without value names",
                       signal->bits);
    }
    signal->type = DBC_FLOAT;
    return ERROR_NONE;
}

/* One section: all that begins with the word. */
static enum error_code read_all(struct reader *r, const char *word,
                                enum error_code (*read)(struct reader *r))
{
    enum error_code code = ERROR_NONE;

    while (!code && is_next_word(r, word)) {
        code = read(r);
    }
    return code;
}

static enum error_code check_formats(struct reader *r)
{
    for (const struct dbc_message *m = r->dbc->message; m; m = m->next) {
        if (m->length > 8 && !m->fd) {
            return fail_at(r, r->line, r->column,
                           "found message %s of %d bytes without " DBC_FORMAT
                           ", expected it to be CAN FD",
                           m->name, m->length);
        }
    }
    return ERROR_NONE;
}

static enum error_code read_sections(struct reader *r)
{
    enum error_code code = next(r);

    if (code || (code = read_head(r)) || (code = read_nodes(r)) ||
        (code = read_all(r, "BO_", read_message)) || (code = read_all(r, "CM_", read_comment)) ||
        (code = expect(r, dbc_definitions)) || (code = read_database(r)) ||
        (code = read_all(r, "BA_", read_attribute)) || (code = read_all(r, "VAL_", read_values)) ||
        (code = read_all(r, "SIG_VALTYPE_", read_float))) {
        return code;
    }
    return r->token.kind == TOKEN_END
               ? check_formats(r)
               : unexpected(r, "BO_, CM_, BA_, VAL_ and SIG_VALTYPE_ in this order, or the end");
}

enum error_code dbc_read(const char *file, const char *text, size_t size, struct arena *arena,
                         struct dbc **dbc, struct error *error)
{
    struct error ignored;
    struct reader r = {.file = file,
                       .at = text,
                       .end = text + size,
                       .line = 1,
                       .column = 1,
                       .dbc = dbc_create(arena, ""),
                       .error = error ? error : &ignored};
    enum error_code code =
        r.dbc ? read_sections(&r)
              : error_set(r.error, ERROR_MEMORY, "no memory left for the DBC database");

    *dbc = code ? NULL : r.dbc;
    return code;
}
