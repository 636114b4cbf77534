/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The YAML reader. Three stages, each of which ends at the first fault: the bytes (size, UTF-8), the
 * document (libyaml's events into a small tree of nodes, refusing what a configuration does not
 * need), the schema (the tree into the caller's structs).
 */
#include "base/yaml.h"

#include "base/text.h"

#include <errno.h>
#include <fcntl.h>
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml.h>

enum {
    MAX_FILE = 4 << 20, /* bytes */
    MAX_DEPTH = 16,     /* nested lists and mappings */
    MAX_NODES = 200000, /* values in a file */
    MAX_KEYS = 4096,    /* keys in a mapping; bounds the search for duplicates */
    SCRATCH = 64 << 20, /* nodes and their text: 2 * 64 bytes a node and the file's text */
    MAX_WORDS = 128,    /* keys or enum words offered to text_nearest */
    SHOWN = 48,         /* bytes of a value shown in a message */
};

enum node_kind { NODE_SCALAR, NODE_LIST, NODE_MAP };

/* A value of the document. The children of a mapping are key, value, key, value... */
struct node {
    enum node_kind kind;
    bool quoted; /* of a scalar: text whatever it looks like */
    struct yaml_mark mark;
    const char *text;
    size_t count; /* entries of a list, keys of a mapping */
    struct node *first, *next;
};

struct reader {
    struct arena *arena;  /* the caller's: what the structs point to */
    struct arena scratch; /* the nodes: gone after the read */
    const char *file;
    size_t nodes;
    yaml_parser_t parser;
    struct error *error;
};

/* ---- messages ---- */

enum error_code yaml_error(struct error *error, const struct yaml_mark *mark, const char *format,
                           ...)
{
    char text[512];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (!mark->file) {
        return error_set(error, ERROR_INPUT, "%s", text);
    }
    return error_set(error, ERROR_INPUT, "%.200s:%d:%d: %s", mark->file, mark->line, mark->column,
                     text);
}

static enum error_code out_of_memory(struct reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this file", r->file);
}

/* text on one line and of bounded length */
static const char *shown(const char *text, char out[SHOWN + 4])
{
    size_t n = strlen(text);

    if (n > SHOWN) {
        n = SHOWN;
        while (n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80) {
            n--; /* do not cut a character in two */
        }
    }
    for (size_t i = 0; i < n; i++) {
        out[i] = (unsigned char)text[i] < 0x20 || text[i] == 0x7f ? '?' : text[i];
    }
    strcpy(out + n, text[n] ? "..." : "");
    return out;
}

static bool is_null(const struct node *node)
{
    return node->kind == NODE_SCALAR && !node->quoted &&
           (*node->text == '\0' || !strcmp(node->text, "~") || !strcmp(node->text, "null"));
}

static bool is_bool(const struct node *node)
{
    return node->kind == NODE_SCALAR && !node->quoted &&
           (!strcmp(node->text, "true") || !strcmp(node->text, "false"));
}

static bool is_number(const struct node *node)
{
    double real;
    int64_t integer;

    return node->kind == NODE_SCALAR && !node->quoted &&
           (text_to_double(node->text, &real) ||
            text_to_int(node->text, INT64_MIN, INT64_MAX, &integer));
}

enum { FOUND_SIZE = SHOWN + 32 };

/* what a node is, as the subject of "found ..." */
static const char *found(const struct node *node, char out[FOUND_SIZE])
{
    char text[SHOWN + 4];

    if (node->kind == NODE_LIST) {
        snprintf(out, FOUND_SIZE, "a list");
    } else if (node->kind == NODE_MAP) {
        snprintf(out, FOUND_SIZE, "a mapping");
    } else if (is_null(node)) {
        snprintf(out, FOUND_SIZE, "nothing");
    } else if (is_number(node) || is_bool(node)) {
        snprintf(out, FOUND_SIZE, "%s", shown(node->text, text));
    } else {
        snprintf(out, FOUND_SIZE, "%s\"%s\"", node->quoted ? "quoted text " : "",
                 shown(node->text, text));
    }
    return out;
}

static enum error_code unexpected(struct reader *r, const struct node *node, const char *expected)
{
    char what[FOUND_SIZE];

    return yaml_error(r->error, &node->mark, "found %s, expected %s", found(node, what), expected);
}

/* "a, b or c" */
static void join_words(const char *const *words, size_t count, char *out, size_t size)
{
    size_t used = 0;

    out[0] = '\0';
    for (size_t i = 0; i < count && used < size; i++) {
        const char *separator = i == 0 ? "" : i + 1 == count ? " or " : ", ";

        used += (size_t)snprintf(out + used, size - used, "%s%s", separator, words[i]);
    }
}

/* ---- bytes ---- */

/* Length of the valid UTF-8 sequence at p (of n bytes), 0 when there is none. */
static size_t utf8_length(const unsigned char *p, size_t n)
{
    static const struct {
        unsigned char mask, lead;
        uint32_t min;
    } form[] = {{0x80, 0x00, 0}, {0xe0, 0xc0, 0x80}, {0xf0, 0xe0, 0x800}, {0xf8, 0xf0, 0x10000}};

    for (size_t k = 0; k < 4 && k < n; k++) {
        uint32_t code = p[0] & (unsigned char)~form[k].mask;

        if ((p[0] & form[k].mask) != form[k].lead) {
            continue;
        }
        for (size_t i = 1; i <= k; i++) {
            if ((p[i] & 0xc0) != 0x80) {
                return 0;
            }
            code = code << 6 | (p[i] & 0x3f);
        }
        return code < form[k].min || code > 0x10ffff || (code >= 0xd800 && code < 0xe000) ? 0
                                                                                          : k + 1;
    }
    return 0;
}

/* Plain text: UTF-8 without control characters. libyaml would say less about where it is not. */
static enum error_code check_bytes(struct reader *r, const char *text, size_t size)
{
    const unsigned char *p = (const unsigned char *)text;
    struct yaml_mark mark = {r->file, 1, 1};

    for (size_t i = 0; i < size;) {
        size_t n = utf8_length(p + i, size - i);

        if (p[i] == '\0') {
            return yaml_error(r->error, &mark, "found a zero byte, expected text");
        }
        if (n == 0) {
            return yaml_error(r->error, &mark, "found byte 0x%02x, expected UTF-8 text", p[i]);
        }
        if ((p[i] < 0x20 && !strchr("\t\n\r", p[i])) || p[i] == 0x7f) {
            return yaml_error(r->error, &mark, "found control character 0x%02x, expected text",
                              p[i]);
        }
        mark.column = p[i] == '\n' ? 1 : mark.column + 1;
        mark.line += p[i] == '\n';
        i += n;
    }
    return ERROR_NONE;
}

/* ---- document ---- */

static struct yaml_mark mark_at(const struct reader *r, yaml_mark_t at)
{
    return (struct yaml_mark){r->file, (int)at.line + 1, (int)at.column + 1};
}

static enum error_code next_event(struct reader *r, yaml_event_t *event)
{
    const yaml_parser_t *p = &r->parser;
    struct yaml_mark mark;

    if (yaml_parser_parse(&r->parser, event)) {
        return ERROR_NONE;
    }
    if (p->error == YAML_MEMORY_ERROR) {
        return out_of_memory(r);
    }
    mark = mark_at(r, p->error == YAML_READER_ERROR ? p->mark : p->problem_mark);
    return yaml_error(r->error, &mark, "found malformed YAML (%s%s%s), expected %s",
                      p->context ? p->context : "", p->context ? ": " : "",
                      p->problem ? p->problem : "unreadable", "a well-formed document");
}

/* Anchors and tags may stand at any value; a configuration has no use for either. */
static enum error_code check_plain(struct reader *r, const struct yaml_mark *mark,
                                   const yaml_char_t *anchor, const yaml_char_t *tag)
{
    char text[SHOWN + 4];

    if (anchor) {
        return yaml_error(r->error, mark, "found anchor \"&%s\", expected a value without anchor",
                          shown((const char *)anchor, text));
    }
    if (tag) {
        return yaml_error(r->error, mark, "found tag \"%s\", expected a value without tag",
                          shown((const char *)tag, text));
    }
    return ERROR_NONE;
}

static enum error_code check_event(struct reader *r, const yaml_event_t *event,
                                   const struct yaml_mark *mark, int depth)
{
    char text[SHOWN + 4];

    if (++r->nodes > MAX_NODES) {
        return yaml_error(r->error, mark, "found more than %d values, expected fewer", MAX_NODES);
    }
    if (depth > MAX_DEPTH) {
        return yaml_error(r->error, mark,
                          "found values nested deeper than %d, expected fewer levels", MAX_DEPTH);
    }
    switch (event->type) {
    case YAML_SCALAR_EVENT:
        return check_plain(r, mark, event->data.scalar.anchor, event->data.scalar.tag);
    case YAML_SEQUENCE_START_EVENT:
        return check_plain(r, mark, event->data.sequence_start.anchor,
                           event->data.sequence_start.tag);
    case YAML_MAPPING_START_EVENT:
        return check_plain(r, mark, event->data.mapping_start.anchor,
                           event->data.mapping_start.tag);
    case YAML_ALIAS_EVENT:
        return yaml_error(r->error, mark, "found alias \"*%s\", expected the value itself",
                          shown((const char *)event->data.alias.anchor, text));
    default:
        return yaml_error(r->error, mark, "found the end of the document, expected a value");
    }
}

static enum error_code check_keys(struct reader *r, const struct node *map)
{
    char text[SHOWN + 4];

    if (map->count > MAX_KEYS) {
        return yaml_error(r->error, &map->mark, "found %zu keys in a mapping, expected at most %d",
                          map->count, MAX_KEYS);
    }
    for (const struct node *key = map->first; key; key = key->next->next) {
        if (key->kind != NODE_SCALAR || *key->text == '\0') {
            return unexpected(r, key, "the name of a key");
        }
        for (const struct node *other = map->first; other != key; other = other->next->next) {
            if (!strcmp(other->text, key->text)) {
                return yaml_error(r->error, &key->mark,
                                  "found key \"%s\" again, expected it once (it stands in line %d)",
                                  shown(key->text, text), other->mark.line);
            }
        }
    }
    return ERROR_NONE;
}

static enum error_code build(struct reader *r, const yaml_event_t *event, int depth,
                             struct node **out);

/* The entries of a list or mapping until its end event; recursion is bounded by MAX_DEPTH. */
static enum error_code build_children(struct reader *r, struct node *parent, int depth)
{
    yaml_event_type_t end =
        parent->kind == NODE_LIST ? YAML_SEQUENCE_END_EVENT : YAML_MAPPING_END_EVENT;
    struct node **link = &parent->first;
    size_t count = 0;

    for (;;) {
        yaml_event_t event;
        enum error_code code = next_event(r, &event);
        bool done;

        if (code) {
            return code;
        }
        done = event.type == end;
        if (!done) {
            code = build(r, &event, depth + 1, link);
        }
        yaml_event_delete(&event);
        if (code) {
            return code;
        }
        if (done) {
            parent->count = parent->kind == NODE_LIST ? count : count / 2;
            return parent->kind == NODE_LIST ? ERROR_NONE : check_keys(r, parent);
        }
        link = &(*link)->next;
        count++;
    }
}

/* The node that event begins. */
static enum error_code build(struct reader *r, const yaml_event_t *event, int depth,
                             struct node **out)
{
    struct yaml_mark mark = mark_at(r, event->start_mark);
    enum error_code code = check_event(r, event, &mark, depth);
    struct node *node;

    if (code) {
        return code;
    }
    node = arena_alloc(&r->scratch, 1, sizeof *node);
    if (!node) {
        return out_of_memory(r);
    }
    node->mark = mark;
    *out = node;
    if (event->type == YAML_SCALAR_EVENT) {
        const char *text = (const char *)event->data.scalar.value;

        /* an escape can still bring a zero into the text */
        if (strlen(text) != event->data.scalar.length) {
            return yaml_error(r->error, &mark, "found a zero byte in a text, expected none");
        }
        node->kind = NODE_SCALAR;
        node->quoted = event->data.scalar.style != YAML_PLAIN_SCALAR_STYLE;
        node->text = arena_strdup(&r->scratch, text);
        return node->text ? ERROR_NONE : out_of_memory(r);
    }
    node->kind = event->type == YAML_SEQUENCE_START_EVENT ? NODE_LIST : NODE_MAP;
    return build_children(r, node, depth);
}

/* One event of the frame around the root value. */
static enum error_code expect_event(struct reader *r, yaml_event_type_t type, const char *message)
{
    yaml_event_t event;
    enum error_code code = next_event(r, &event);

    if (!code && event.type != type) {
        struct yaml_mark mark = mark_at(r, event.start_mark);

        code = yaml_error(r->error, &mark, "%s", message);
    }
    if (code != ERROR_NONE) {
        return code;
    }
    yaml_event_delete(&event);
    return ERROR_NONE;
}

static enum error_code build_document(struct reader *r, struct node **root)
{
    yaml_event_t event;
    enum error_code code;

    code = expect_event(r, YAML_STREAM_START_EVENT, "found no stream, expected a document");
    if (!code) {
        code =
            expect_event(r, YAML_DOCUMENT_START_EVENT, "found an empty file, expected a mapping");
    }
    if (!code) {
        code = next_event(r, &event);
    }
    if (code) {
        return code;
    }
    code = build(r, &event, 0, root);
    yaml_event_delete(&event);
    if (!code) {
        code = expect_event(r, YAML_DOCUMENT_END_EVENT, "found more, expected the document's end");
    }
    if (!code) {
        code = expect_event(r, YAML_STREAM_END_EVENT,
                            "found a second document, expected one document in a file");
    }
    return code;
}

/* ---- schema ---- */

static void *at(void *out, size_t offset)
{
    return (unsigned char *)out + offset;
}

/* "a number from 0 to 100" */
static void describe_range(const char *what, const struct yaml_field *field, char *out, size_t size)
{
    bool low = field->min > -DBL_MAX, high = field->max < DBL_MAX;

    if ((field->min == 0 && field->max == 0) || (!low && !high)) {
        snprintf(out, size, "%s", what);
    } else if (field->min == DBL_MIN && high) {
        snprintf(out, size, "%s above 0, at most %.15g", what, field->max);
    } else if (field->min == DBL_MIN) {
        snprintf(out, size, "%s above 0", what);
    } else if (low && high) {
        snprintf(out, size, "%s from %.15g to %.15g", what, field->min, field->max);
    } else if (low) {
        snprintf(out, size, "%s of at least %.15g", what, field->min);
    } else {
        snprintf(out, size, "%s of at most %.15g", what, field->max);
    }
}

static bool in_range(const struct yaml_field *field, double value)
{
    return (field->min == 0 && field->max == 0) || (value >= field->min && value <= field->max);
}

static enum error_code read_bool(struct reader *r, const struct yaml_field *field,
                                 const struct node *node, void *out)
{
    (void)field;
    if (!is_bool(node)) {
        return unexpected(r, node, "true or false");
    }
    *(bool *)out = node->text[0] == 't';
    return ERROR_NONE;
}

static enum error_code read_int(struct reader *r, const struct yaml_field *field,
                                const struct node *node, void *out)
{
    const char *digits;
    char expected[96];
    int64_t value;

    describe_range("an integer", field, expected, sizeof expected);
    if (node->kind != NODE_SCALAR || node->quoted ||
        !text_to_int(node->text, INT64_MIN, INT64_MAX, &value)) {
        return unexpected(r, node, expected);
    }
    /* 010 is eight to YAML 1.1 and ten to YAML 1.2 */
    digits = node->text + (*node->text == '-' || *node->text == '+');
    if (digits[0] == '0' && digits[1] >= '0' && digits[1] <= '9') {
        return unexpected(r, node, "an integer without leading zeros");
    }
    if (!in_range(field, (double)value)) {
        return unexpected(r, node, expected);
    }
    *(int64_t *)out = value;
    return ERROR_NONE;
}

static enum error_code read_real(struct reader *r, const struct yaml_field *field,
                                 const struct node *node, void *out)
{
    char expected[96];
    double value;

    if (node->kind != NODE_SCALAR || node->quoted || !text_to_double(node->text, &value) ||
        !in_range(field, value)) {
        describe_range("a number", field, expected, sizeof expected);
        return unexpected(r, node, expected);
    }
    *(double *)out = value;
    return ERROR_NONE;
}

static enum error_code read_string(struct reader *r, const struct yaml_field *field,
                                   const struct node *node, void *out)
{
    const char **string = out;
    char expected[96];

    if (is_number(node) || is_bool(node)) {
        return unexpected(r, node, "a text (put it in quotes if it is meant as one)");
    }
    if (node->kind != NODE_SCALAR || is_null(node)) {
        return unexpected(r, node, "a text");
    }
    if (field->max > 0 && !in_range(field, (double)strlen(node->text))) {
        snprintf(expected, sizeof expected, "a text of %.0f to %.0f bytes", field->min, field->max);
        return unexpected(r, node, expected);
    }
    *string = arena_strdup(r->arena, node->text);
    return *string ? ERROR_NONE : out_of_memory(r);
}

static enum error_code read_enum(struct reader *r, const struct yaml_field *field,
                                 const struct node *node, void *out)
{
    const char *words[MAX_WORDS], *nearest;
    char what[FOUND_SIZE], list[256];
    size_t count = 0;

    for (const struct yaml_enum *e = field->names; e->word && count < MAX_WORDS; e++) {
        if (node->kind == NODE_SCALAR && !strcmp(node->text, e->word)) {
            *(int *)out = e->value;
            return ERROR_NONE;
        }
        words[count++] = e->word;
    }
    join_words(words, count, list, sizeof list);
    nearest = node->kind == NODE_SCALAR ? text_nearest(node->text, words, count) : NULL;
    return yaml_error(r->error, &node->mark, "found %s, expected %s%s%s%s", found(node, what), list,
                      nearest ? " (did you mean \"" : "", nearest ? nearest : "",
                      nearest ? "\"?)" : "");
}

static enum error_code read_reals(struct reader *r, const struct yaml_field *field,
                                  const struct node *node, void *out)
{
    char expected[96];
    double *value = out;

    snprintf(expected, sizeof expected, "a list of %zu numbers", field->count);
    if (node->kind != NODE_LIST) {
        return unexpected(r, node, expected);
    }
    if (node->count != field->count) {
        return yaml_error(r->error, &node->mark, "found a list of %zu, expected %s", node->count,
                          expected);
    }
    for (const struct node *entry = node->first; entry; entry = entry->next) {
        enum error_code code = read_real(r, field, entry, value++);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

static enum error_code read_struct(struct reader *r, const struct yaml_schema *schema,
                                   const struct node *node, void *out);

static enum error_code read_real_entry(struct reader *r, const struct yaml_field *field,
                                       const struct node *key, void *out)
{
    struct yaml_real_entry *entry = out;

    entry->mark = key->mark;
    entry->name = arena_strdup(r->arena, key->text);
    return entry->name ? read_real(r, field, key->next, &entry->value) : out_of_memory(r);
}

static enum error_code read_name_entry(struct reader *r, const struct yaml_field *field,
                                       const struct node *node, void *out)
{
    struct yaml_name *entry = out;

    entry->mark = node->mark;
    return read_string(r, field, node, &entry->name);
}

static enum error_code read_dict_entry(struct reader *r, const struct yaml_field *field,
                                       const struct node *key, void *out)
{
    const char *name = arena_strdup(r->arena, key->text);
    enum error_code code = read_struct(r, field->schema, key->next, out);

    *(const char **)at(out, field->schema->name_offset) = name;
    return code ? code : name ? ERROR_NONE : out_of_memory(r);
}

static enum error_code read_list_entry(struct reader *r, const struct yaml_field *field,
                                       const struct node *node, void *out)
{
    return read_struct(r, field->schema, node, out);
}

typedef enum error_code read_function(struct reader *r, const struct yaml_field *field,
                                      const struct node *node, void *out);

/* The entries of a list, or the keys of a mapping, into an array of its own. */
static enum error_code read_many(struct reader *r, const struct yaml_field *field,
                                 const struct node *node, size_t size, read_function *read,
                                 void *out, size_t *count)
{
    unsigned char *array = arena_alloc(r->arena, node->count, size);
    size_t i = 0;

    if (!array) {
        return out_of_memory(r);
    }
    for (const struct node *entry = node->first; entry; i++) {
        enum error_code code = read(r, field, entry, array + i * size);

        if (code) {
            return code;
        }
        entry = node->kind == NODE_MAP ? entry->next->next : entry->next;
    }
    *(void **)out = array;
    *count = node->count;
    return ERROR_NONE;
}

/* Values that become an array: which node they need, how long an entry is and how it is read. */
static enum error_code read_array(struct reader *r, const struct yaml_field *field,
                                  const struct node *node, void *out, size_t *count)
{
    static const struct {
        const char *expected;
        enum node_kind kind;
        size_t size; /* 0 = the schema's */
        read_function *read;
    } form[] = {
        [YAML_REAL_LIST] = {"a list of numbers", NODE_LIST, sizeof(double), read_real},
        [YAML_STRING_LIST] = {"a list of texts", NODE_LIST, sizeof(char *), read_string},
        [YAML_NAME_LIST] = {"a list of names", NODE_LIST, sizeof(struct yaml_name),
                            read_name_entry},
        [YAML_LIST] = {"a list of mappings", NODE_LIST, 0, read_list_entry},
        [YAML_DICT] = {"a mapping of names to mappings", NODE_MAP, 0, read_dict_entry},
        [YAML_REAL_DICT] = {"a mapping of names to numbers", NODE_MAP,
                            sizeof(struct yaml_real_entry), read_real_entry},
    };
    enum yaml_type type = field->type;
    size_t size = form[type].size ? form[type].size : field->schema->size;

    if (node->kind != form[type].kind) {
        return unexpected(r, node, form[type].expected);
    }
    return read_many(r, field, node, size, form[type].read, out, count);
}

static enum error_code read_value(struct reader *r, const struct yaml_field *field,
                                  const struct node *node, void *out)
{
    void *value = at(out, field->offset);

    if (field->mark_offset) {
        *(struct yaml_mark *)at(out, field->mark_offset) = node->mark;
    }
    if (field->given_offset) {
        *(bool *)at(out, field->given_offset) = true;
    }
    switch (field->type) {
    case YAML_BOOL:
        return read_bool(r, field, node, value);
    case YAML_INT:
        return read_int(r, field, node, value);
    case YAML_REAL:
        return read_real(r, field, node, value);
    case YAML_STRING:
        return read_string(r, field, node, value);
    case YAML_ENUM:
        return read_enum(r, field, node, value);
    case YAML_REALS:
        return read_reals(r, field, node, value);
    case YAML_MAP:
        return read_struct(r, field->schema, node, value);
    default:
        return read_array(r, field, node, value, at(out, field->count_offset));
    }
}

static enum error_code unknown_key(struct reader *r, const struct yaml_schema *schema,
                                   const struct node *key)
{
    const char *words[MAX_WORDS], *nearest;
    char text[SHOWN + 4], list[320];
    size_t count = 0;

    for (size_t i = 0; i < schema->field_count && count < MAX_WORDS; i++) {
        words[count++] = schema->fields[i].key;
    }
    nearest = text_nearest(key->text, words, count);
    join_words(words, count, list, sizeof list);
    return yaml_error(r->error, &key->mark, "found unknown key \"%s\" in %s, expected %s%s%s",
                      shown(key->text, text), schema->what, nearest ? "\"" : "",
                      nearest ? nearest : list, nearest ? "\"" : "");
}

/* The defaults of a struct and of the structs in it. What is left out stands where its parent
 * stands, so that messages about it have a place. */
static void set_defaults(const struct yaml_schema *schema, const struct yaml_mark *mark, void *out)
{
    if (schema->defaults) {
        memcpy(out, schema->defaults, schema->size);
    }
    *(struct yaml_mark *)out = *mark;
    for (size_t i = 0; i < schema->field_count; i++) {
        const struct yaml_field *field = &schema->fields[i];

        if (field->type == YAML_MAP) {
            set_defaults(field->schema, mark, at(out, field->offset));
        }
        if (field->mark_offset) {
            *(struct yaml_mark *)at(out, field->mark_offset) = *mark;
        }
    }
}

static enum error_code read_struct(struct reader *r, const struct yaml_schema *schema,
                                   const struct node *node, void *out)
{
    char expected[96];

    if (node->kind != NODE_MAP) {
        snprintf(expected, sizeof expected, "a mapping (%s)", schema->what);
        return unexpected(r, node, expected);
    }
    set_defaults(schema, &node->mark, out);
    for (const struct node *key = node->first; key; key = key->next->next) {
        const struct yaml_field *field = schema->fields;
        const struct yaml_field *end = field + schema->field_count;
        enum error_code code;

        while (field < end && strcmp(field->key, key->text) != 0) {
            field++;
        }
        code = field < end ? read_value(r, field, key->next, out) : unknown_key(r, schema, key);
        if (code) {
            return code;
        }
    }
    for (size_t i = 0; i < schema->field_count; i++) {
        const struct node *key = node->first;

        while (key && strcmp(schema->fields[i].key, key->text) != 0) {
            key = key->next->next;
        }
        if (schema->fields[i].required && !key) {
            return yaml_error(r->error, &node->mark, "found %s without key \"%s\", expected it",
                              schema->what, schema->fields[i].key);
        }
    }
    return ERROR_NONE;
}

/* ---- entry points ---- */

static enum error_code read_tree(struct reader *r, const char *text, size_t size,
                                 const struct yaml_schema *schema, void *out)
{
    static const char bom[] = "\xef\xbb\xbf";
    struct node *root = NULL;
    enum error_code code;

    if (size >= 3 && !memcmp(text, bom, 3)) {
        text += 3;
        size -= 3;
    }
    code = check_bytes(r, text, size);
    if (code) {
        return code;
    }
    if (!yaml_parser_initialize(&r->parser)) {
        return out_of_memory(r);
    }
    yaml_parser_set_encoding(&r->parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&r->parser, (const unsigned char *)text, size);
    code = build_document(r, &root);
    yaml_parser_delete(&r->parser);
    if (code) {
        return code;
    }
    memset(out, 0, schema->size);
    return read_struct(r, schema, root, out);
}

enum error_code yaml_read_text(const char *name, const char *text, size_t size,
                               const struct yaml_schema *schema, struct arena *arena, void *out,
                               struct error *error)
{
    struct reader r = {.arena = arena, .file = name, .error = error};
    enum error_code code;

    if (size > MAX_FILE) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found more than %d bytes, expected at most that", name, MAX_FILE);
    }
    r.file = arena_strdup(arena, name);
    if (!r.file) {
        r.file = name;
        return out_of_memory(&r);
    }
    code = arena_init(&r.scratch, SCRATCH, error);
    if (code) {
        return code;
    }
    code = read_tree(&r, text, size, schema, out);
    arena_fini(&r.scratch);
    return code;
}

/* A wrong path is the user's to mend; anything else is the system's. */
static enum error_code file_error(struct error *error, const char *path, int errno_value)
{
    enum error_code code = errno_value == ENOENT || errno_value == ENOTDIR ||
                                   errno_value == EACCES || errno_value == ENAMETOOLONG ||
                                   errno_value == ELOOP
                               ? ERROR_INPUT
                               : ERROR_SYSTEM;

    return error_set(error, code, "%.200s: cannot be read: %s", path, strerror(errno_value));
}

static enum error_code read_bytes(int fd, const char *path, char *buffer, size_t capacity,
                                  size_t *size, struct error *error)
{
    *size = 0;
    while (*size < capacity) {
        ssize_t n = read(fd, buffer + *size, capacity - *size);

        if (n == 0) {
            return ERROR_NONE;
        }
        if (n < 0 && errno != EINTR) {
            return file_error(error, path, errno);
        }
        *size += n > 0 ? (size_t)n : 0;
    }
    return ERROR_NONE;
}

enum error_code yaml_read_file(const char *path, const struct yaml_schema *schema,
                               struct arena *arena, void *out, struct error *error)
{
    /* O_NONBLOCK: a pipe must not hang the open; it is refused below */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    enum error_code code;
    struct stat status;
    char *text = NULL;
    size_t size = 0;

    if (fd < 0) {
        return file_error(error, path, errno);
    }
    if (fstat(fd, &status)) {
        code = file_error(error, path, errno);
    } else if (!S_ISREG(status.st_mode)) {
        code = error_set(error, ERROR_INPUT, "%.200s: found %s, expected a file", path,
                         S_ISDIR(status.st_mode) ? "a directory" : "no regular file");
    } else if (!(text = malloc(MAX_FILE + 1))) {
        code = error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", path);
    } else {
        code = read_bytes(fd, path, text, MAX_FILE + 1, &size, error);
    }
    close(fd);
    if (!code) {
        code = yaml_read_text(path, text, size, schema, arena, out, error);
    }
    free(text);
    return code;
}

/* Levels below (positive) or above the starting directory at which the reference ends up, lowest
 * on the way in *lowest. */
static void walk(const char *reference, int *lowest)
{
    int level = 0;

    *lowest = 0;
    for (const char *part = reference; *part;) {
        size_t n = strcspn(part, "/");

        if (n == 2 && part[0] == '.' && part[1] == '.') {
            level--;
        } else if (n > 1 || (n == 1 && part[0] != '.')) {
            level++;
        }
        *lowest = level < *lowest ? level : *lowest;
        part += n + (part[n] == '/');
    }
}

/* Takes "." and "name/.." out of a path, by its letters alone, so that messages read well. */
static void normalize(char *path)
{
    char *out = path;

    for (const char *part = path; *part;) {
        size_t n = strcspn(part, "/"), slash = part[n] == '/';
        char *last = out > path ? out - 1 : out; /* of the component before, without its slash */
        bool up = n == 2 && part[0] == '.' && part[1] == '.';

        while (last > path && last[-1] != '/') {
            last--;
        }
        if (up && out > path && *last != '/' && strncmp(last, "../", 3) != 0) {
            out = last;
        } else if (!(n == 1 && part[0] == '.') && (n > 0 || out == path)) {
            memmove(out, part, n + slash);
            out += n + slash;
        }
        part += n + slash;
    }
    *out = '\0';
}

enum error_code yaml_resolve_path(const struct yaml_mark *mark, const char *reference,
                                  struct arena *arena, const char **path, struct error *error)
{
    const char *slash = strrchr(mark->file, '/');
    size_t directory = slash ? (size_t)(slash - mark->file) + 1 : 0;
    size_t size = directory + strlen(reference) + 1;
    char text[SHOWN + 4], *joined;
    int lowest;

    if (*reference == '\0') {
        return yaml_error(error, mark,
                          "found an empty text, expected a path relative to this file");
    }
    if (*reference == '/') {
        return yaml_error(error, mark, "found absolute path \"%s\", expected one relative to %s",
                          shown(reference, text), "this file");
    }
    walk(reference, &lowest);
    if (lowest < -1) {
        return yaml_error(error, mark,
                          "found path \"%s\", which leaves the configuration tree, expected one "
                          "at or below \"..\"",
                          shown(reference, text));
    }
    joined = arena_alloc(arena, size, 1);
    if (!joined) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory left", mark->file);
    }
    snprintf(joined, size, "%.*s%s", (int)directory, mark->file, reference);
    normalize(joined);
    *path = joined;
    return ERROR_NONE;
}
