/* SPDX-License-Identifier: Apache-2.0 */
/*
 * DBC files: a text is refused with a line and column inside it, or gives a database in which every
 * signal lies in its message, and whose text reads back as the same text.
 */
#include "canbus/dbc.h"

#include "canbus/dbc_private.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

/* An input whose first byte is this one stands behind the lines that every file begins with. */
enum { SHORT = '~' };

static void put_head(FILE *file)
{
    fputs("VERSION \"\"\nNS_ :\n", file);
    for (size_t i = 0; i < DBC_SYMBOLS; i++) {
        fprintf(file, "%s\n", dbc_symbols[i]);
    }
    fputs("BS_:\n", file);
}

/* In a short input a line of # stands for the attributes' definitions, which never change. */
static void put_body(FILE *file, const char *text, size_t size)
{
    const char *mark = memmem(text, size, "#\n", 2);
    const size_t before = mark ? (size_t)(mark - text) : size;

    fwrite(text, 1, before, file);
    if (mark) {
        fputs(dbc_definitions, file);
        fwrite(mark + 2, 1, size - before - 2, file);
    }
}

static void check_database(const struct dbc *dbc)
{
    fuzz_require(dbc->nnode <= DBC_NODES_MAX && dbc->nmessage <= DBC_MESSAGES_MAX, "too much");
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        fuzz_require(m->id <= 0x7ff && m->length <= 64 && (m->fd || m->length <= 8), "%s", m->name);
        fuzz_require(dbc_is_name(m->name) && m->sender < (int)dbc->nnode, "%s", m->name);
        fuzz_require(dbc_find_message(dbc, m->id) == m, "%s", m->name);
        for (const struct dbc_signal *s = m->signal; s; s = s->next) {
            fuzz_require(s->bits >= 1 && s->bits <= 64, "%s", s->name);
            fuzz_require(isfinite(s->scale) && isfinite(s->offset) && isfinite(s->min) &&
                             isfinite(s->max),
                         "%s", s->name);
            for (unsigned k = 0; k < s->bits; k++) {
                fuzz_require(dbc_bit(s, k) < 8u * m->length, "%s bit %u", s->name, k);
            }
        }
    }
}

static void write_again(const struct dbc *dbc, struct fuzz_text *text)
{
    struct error error;

    fuzz_text_open(text);
    fuzz_require(dbc_write(dbc, text->file, &error) == ERROR_NONE, "%s", error.text);
    fuzz_text_finish(text);
}

static void check_text(const char *text, size_t size)
{
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    struct fuzz_text first, second;
    struct error error = {0};
    struct dbc *dbc;

    if (dbc_read("x.dbc", text, size, arena, &dbc, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_has_place(error.text, "x.dbc", size), "%s",
                     error.text);
        fuzz_tally.refused++;
        return;
    }
    check_database(dbc);
    write_again(dbc, &first);
    arena = fuzz_arena((size_t)64 << 20);
    fuzz_require(dbc_read("x.dbc", first.text, first.size, arena, &dbc, &error) == ERROR_NONE, "%s",
                 error.text);
    write_again(dbc, &second);
    fuzz_require(first.size == second.size && memcmp(first.text, second.text, first.size) == 0,
                 "%s\n%s", first.text, second.text);
    fuzz_text_free(&first);
    fuzz_text_free(&second);
    fuzz_tally.taken++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_text whole;

    if (size == 0 || data[0] != SHORT) {
        check_text((const char *)data, size);
        return 0;
    }
    put_head(fuzz_text_open(&whole));
    put_body(whole.file, (const char *)data + 1, size - 1);
    fuzz_text_finish(&whole);
    check_text(whole.text, whole.size);
    fuzz_text_free(&whole);
    return 0;
}
