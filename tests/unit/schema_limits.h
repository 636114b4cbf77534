/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Both sides of every limit that a schema has: the least and the greatest value of each key are
 * taken, what is just beyond is refused. A test has its table of the limits, so that one that moves
 * is noticed; a key that is missing there, or there alone, is an error. Each test runs between
 * open_arena and close_arena.
 */
#ifndef TESTS_UNIT_SCHEMA_LIMITS_H
#define TESTS_UNIT_SCHEMA_LIMITS_H

#include "base/array.h"
#include "base/yaml.h"

#include <float.h>

#include "tests/unit/arena_fixture.h"

enum { PATH = 160, TEXT = 8192 };

/* Of a number the least and the greatest value, least DBL_MIN: anything above zero; of a text its
 * length. Lists and dictionaries of mappings are [] in the path; "*" begins that of a key which
 * has the same limits wherever it stands. */
struct limit {
    const char *path;
    double min, max;
};

struct walk {
    const struct yaml_schema *schema;
    const struct limit *limit;
    size_t nlimit;
    bool seen[256];
    size_t wrong;
};

/* ---- a document with one key ---- */

/* "a.b[].c" and V become {a: {b: [{c: V}]}}. */
static void write_document(const struct yaml_schema *schema, const char *path, const char *value,
                           char *text)
{
    char closing[64] = "";
    size_t used = 0, nclosing = 0;

    for (const char *at = path; *at; at += *at == '.') {
        size_t length = strcspn(at, ".["), f = 0;
        const struct yaml_field *field;
        const char *open = "", *close = "}";

        while (strncmp(schema->fields[f].key, at, length) != 0 ||
               schema->fields[f].key[length] != '\0') {
            f++;
            assert_true(f < schema->field_count);
        }
        field = &schema->fields[f];
        if (field->type == YAML_LIST) {
            open = "[";
            close = "]}";
        } else if (field->type == YAML_DICT) {
            open = "{entry: ";
            close = "}}";
        }
        used += (size_t)snprintf(text + used, TEXT - used, "{%.*s: %s", (int)length, at, open);
        for (size_t i = strlen(close); i > 0; i--) {
            closing[nclosing++] = close[i - 1];
        }
        schema = field->schema;
        at += length + (at[length] == '[' ? 2 : 0);
    }
    used += (size_t)snprintf(text + used, TEXT - used, "%s", value);
    while (nclosing > 0) {
        text[used++] = closing[--nclosing];
    }
    text[used] = '\0';
}

/* Whether the value is refused. Other keys are missing, which is refused, too, but later. */
static bool value_is_refused(const struct walk *walk, const char *path, const char *value)
{
    static char text[TEXT];
    static struct {
        max_align_t align;
        char room[65536];
    } out;
    struct error error = {0};
    enum error_code code;

    assert_true(walk->schema->size <= sizeof out);
    write_document(walk->schema, path, value, text);
    code = yaml_read_text("x", text, strlen(text), walk->schema, &arena, &out, &error);
    assert_true(code == ERROR_NONE || code == ERROR_INPUT);
    if (code && strstr(error.text, "found unknown")) {
        fail_msg("%s: %s", text, error.text);
    }
    return code && strstr(error.text, "without key") == NULL;
}

/* ---- values ---- */

static void write_value(const struct yaml_field *field, double value, char *text)
{
    size_t used = 0;

    switch (field->type) {
    case YAML_STRING:
        memset(text, 'x', (size_t)value);
        text[(size_t)value] = '\0';
        if (value == 0.0) {
            strcpy(text, "\"\"");
        }
        break;
    case YAML_INT:
        sprintf(text, "%.0f", value);
        break;
    case YAML_REALS: /* the last is the one that counts */
        text[used++] = '[';
        for (size_t i = 0; i + 1 < field->count; i++) {
            used += (size_t)sprintf(text + used, "%.17g, ", field->max);
        }
        sprintf(text + used, "%.17g]", value);
        break;
    case YAML_REAL_DICT:
        sprintf(text, "{entry: %.17g}", value);
        break;
    default:
        sprintf(text, "%.17g", value);
        break;
    }
}

static void judge_value(struct walk *walk, const struct yaml_field *field, const char *path,
                        double value, bool refused)
{
    static char text[TEXT];

    write_value(field, value, text);
    if (value_is_refused(walk, path, text) != refused) {
        print_error("%s: %.20s should be %s\n", path, text, refused ? "refused" : "taken");
        walk->wrong++;
    }
}

static void check_limit(struct walk *walk, const struct yaml_field *field, const char *path,
                        const struct limit *limit)
{
    bool real = field->type != YAML_INT && field->type != YAML_STRING;
    double below = limit->min == DBL_MIN ? 0.0
                   : real                ? nextafter(limit->min, -(double)INFINITY)
                                         : limit->min - 1.0;
    double above = real ? nextafter(limit->max, (double)INFINITY) : limit->max + 1.0;

    judge_value(walk, field, path, limit->min, false);
    judge_value(walk, field, path, limit->max, false);
    judge_value(walk, field, path, below, true);
    judge_value(walk, field, path, above, true);
}

/* ---- the walk over a schema ---- */

static bool path_is_listed(const char *listed, const char *path)
{
    size_t length = strlen(path), tail = strlen(listed + 1);

    if (listed[0] != '*') {
        return strcmp(listed, path) == 0;
    }
    return length >= tail && strcmp(path + length - tail, listed + 1) == 0;
}

static void visit_field(struct walk *walk, const struct yaml_field *field, const char *path)
{
    for (size_t i = 0; i < walk->nlimit; i++) {
        if (path_is_listed(walk->limit[i].path, path)) {
            walk->seen[i] = true;
            check_limit(walk, field, path, &walk->limit[i]);
            return;
        }
    }
    print_error("not listed here: {\"%s\", %.17g, %.17g},\n", path, field->min, field->max);
    walk->wrong++;
}

static void walk_schema(struct walk *walk, const struct yaml_schema *schema, const char *prefix)
{
    for (size_t f = 0; f < schema->field_count; f++) {
        const struct yaml_field *field = &schema->fields[f];
        bool list = field->type == YAML_LIST || field->type == YAML_DICT;
        char path[PATH];

        snprintf(path, sizeof path, "%s%s%s", prefix, field->key, list ? "[]." : "");
        if (field->schema) {
            snprintf(path, sizeof path, "%s%s%s.", prefix, field->key, list ? "[]" : "");
            walk_schema(walk, field->schema, path);
        } else if (field->min != 0.0 || field->max != 0.0) {
            visit_field(walk, field, path);
        }
    }
}

static void check_schema(const struct yaml_schema *schema, const struct limit *limit, size_t nlimit)
{
    struct walk walk = {.schema = schema, .limit = limit, .nlimit = nlimit};

    assert_true(nlimit <= ARRAY_COUNT(walk.seen));
    walk_schema(&walk, schema, "");
    for (size_t i = 0; i < nlimit; i++) {
        if (!walk.seen[i]) {
            print_error("%s has no limits any more\n", limit[i].path);
            walk.wrong++;
        }
    }
    assert_int_equal(walk.wrong, 0);
}

#endif
