/* SPDX-License-Identifier: Apache-2.0 */
/* Lines and words of OBJ text, and messages that quote them. */
#include "contact/mesh/obj_private.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum error_code obj_refuse(struct obj_reader *r, struct obj_place place, const char *format, ...)
{
    char what[512];
    va_list args;

    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    return error_set(r->error, ERROR_INPUT, "%s:%zu:%zu: %s", r->name, place.line, place.column,
                     what);
}

enum error_code obj_no_memory(struct obj_reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%s: no memory for the mesh", r->name);
}

size_t obj_grown_capacity(size_t capacity)
{
    return capacity ? 2 * capacity : 256;
}

const char *obj_quote_token(const struct obj_token *token, char out[OBJ_QUOTE_SIZE])
{
    size_t length = token->length;

    if (length == 0) {
        return "the end of the line";
    }

    /* Room for two quotes, three dots and the end */
    bool cut = length > OBJ_QUOTE_SIZE - 6;
    size_t shown = cut ? OBJ_QUOTE_SIZE - 6 : length;
    size_t o = 0;

    out[o++] = '\'';
    for (size_t i = 0; i < shown; i++) {
        char c = token->text[i];

        out[o++] = c >= 0x20 && c < 0x7f ? c : '?';
    }
    if (cut) {
        memcpy(out + o, "...", 3);
        o += 3;
    }
    out[o++] = '\'';
    out[o] = '\0';
    return out;
}

size_t obj_line_end(const struct obj_reader *r, size_t at)
{
    if (at < r->size && r->text[at] == '\n') {
        return 1;
    }
    return at + 1 < r->size && r->text[at] == '\r' && r->text[at + 1] == '\n' ? 2 : 0;
}

void obj_begin_line(struct obj_reader *r, size_t at)
{
    r->at = at;
    r->line++;
    r->line_start = at;
}

/* Returns the length of a backslash with the line end that it hides, 0 when there is none. */
static size_t obj_continuation(const struct obj_reader *r)
{
    size_t end = r->text[r->at] == '\\' ? obj_line_end(r, r->at + 1) : 0;

    return end > 0 ? 1 + end : 0;
}

/* Skips spaces, tabs and continued line ends, up to a word or the end of the line. */
static void obj_skip_blanks(struct obj_reader *r)
{
    while (r->at < r->size) {
        char c = r->text[r->at];
        size_t continuation = obj_continuation(r);

        if (continuation > 0) {
            obj_begin_line(r, r->at + continuation);
        } else if (c == ' ' || c == '\t') {
            r->at++;
        } else {
            break;
        }
    }
}

struct obj_token obj_next_token(struct obj_reader *r)
{
    obj_skip_blanks(r);

    struct obj_token token = {.text = r->text + r->at,
                              .place = {r->line, r->at - r->line_start + 1}};

    while (r->at < r->size && obj_line_end(r, r->at) == 0) {
        char c = r->text[r->at];

        if (c == ' ' || c == '\t' || obj_continuation(r) > 0) {
            break;
        }
        r->at++;
    }
    token.length = (size_t)(r->text + r->at - token.text);
    return token;
}

void obj_skip_line(struct obj_reader *r, bool may_continue)
{
    while (r->at < r->size && obj_line_end(r, r->at) == 0) {
        size_t continuation = may_continue ? obj_continuation(r) : 0;

        if (continuation > 0) {
            obj_begin_line(r, r->at + continuation);
        } else {
            r->at++;
        }
    }
}

bool obj_token_is(const struct obj_token *token, const char *word)
{
    return token->length == strlen(word) && memcmp(token->text, word, token->length) == 0;
}
