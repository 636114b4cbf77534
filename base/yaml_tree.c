/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks the text of a document, then builds a small tree of nodes from libyaml's events. Stops at
 * the first error.
 */
#include "base/yaml_tree.h"

#include "base/text.h"

#include <string.h>
#include <yaml.h>

enum {
    MAX_DEPTH = 16,  /* depth of nested lists and mappings */
    MAX_KEYS = 4096, /* keys of a mapping; it limits the search for duplicates */
};

/* ---- messages ---- */

enum error_code yaml_no_memory(struct yaml_reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this file", r->file);
}

const char *yaml_shown(const char *text, char out[YAML_SHOWN + 4])
{
    size_t n = strlen(text);

    if (n > YAML_SHOWN) {
        n = YAML_SHOWN;
        while (n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80) {
            n--; /* keep whole UTF-8 characters */
        }
    }
    for (size_t i = 0; i < n; i++) {
        out[i] = (unsigned char)text[i] < 0x20 || text[i] == 0x7f ? '?' : text[i];
    }
    strcpy(out + n, text[n] ? "..." : "");
    return out;
}

bool yaml_is_null(const struct yaml_node *node)
{
    return node->kind == YAML_KIND_SCALAR && !node->quoted &&
           (*node->text == '\0' || !strcmp(node->text, "~") || !strcmp(node->text, "null"));
}

bool yaml_is_bool(const struct yaml_node *node)
{
    return node->kind == YAML_KIND_SCALAR && !node->quoted &&
           (!strcmp(node->text, "true") || !strcmp(node->text, "false"));
}

bool yaml_is_number(const struct yaml_node *node)
{
    double real;
    int64_t integer;

    return node->kind == YAML_KIND_SCALAR && !node->quoted &&
           (text_to_double(node->text, &real) ||
            text_to_int(node->text, INT64_MIN, INT64_MAX, &integer));
}

const char *yaml_found(const struct yaml_node *node, char out[YAML_FOUND])
{
    char text[YAML_SHOWN + 4];

    if (node->kind == YAML_KIND_LIST) {
        snprintf(out, YAML_FOUND, "a list");
    } else if (node->kind == YAML_KIND_MAP) {
        snprintf(out, YAML_FOUND, "a mapping");
    } else if (yaml_is_null(node)) {
        snprintf(out, YAML_FOUND, "nothing");
    } else if (yaml_is_number(node) || yaml_is_bool(node)) {
        snprintf(out, YAML_FOUND, "%s", yaml_shown(node->text, text));
    } else {
        snprintf(out, YAML_FOUND, "%s\"%s\"", node->quoted ? "quoted text " : "",
                 yaml_shown(node->text, text));
    }
    return out;
}

enum error_code yaml_unexpected(struct yaml_reader *r, const struct yaml_node *node,
                                const char *expected)
{
    char what[YAML_FOUND];

    return yaml_error(r->error, &node->mark, "found %s, expected %s", yaml_found(node, what),
                      expected);
}

/* ---- document ---- */

/* Converts a mark of libyaml. Its lines and columns count from 0. */
static struct yaml_mark yaml_mark_at(const struct yaml_reader *r, yaml_mark_t at)
{
    return (struct yaml_mark){
        .file = r->file, .line = (int)at.line + 1, .column = (int)at.column + 1};
}

/* Gets the next event of libyaml. Explains the error if the text is malformed. */
static enum error_code yaml_next_event(struct yaml_reader *r, yaml_event_t *event)
{
    yaml_parser_t *p = r->parser;
    struct yaml_mark mark;

    if (yaml_parser_parse(p, event)) {
        return ERROR_NONE;
    }
    if (p->error == YAML_MEMORY_ERROR) {
        return yaml_no_memory(r);
    }
    mark = yaml_mark_at(r, p->error == YAML_READER_ERROR ? p->mark : p->problem_mark);
    return yaml_error(r->error, &mark, "found malformed YAML (%s%s%s), expected %s",
                      p->context ? p->context : "", p->context ? ": " : "",
                      p->problem ? p->problem : "unreadable", "a well-formed document");
}

/* Refuses anchors and tags. YAML allows them at any value, but a configuration needs none. */
static enum error_code yaml_check_plain(struct yaml_reader *r, const struct yaml_mark *mark,
                                        const yaml_char_t *anchor, const yaml_char_t *tag)
{
    char text[YAML_SHOWN + 4];

    if (anchor) {
        return yaml_error(r->error, mark, "found anchor \"&%s\", expected a value without anchor",
                          yaml_shown((const char *)anchor, text));
    }
    if (tag) {
        return yaml_error(r->error, mark, "found tag \"%s\", expected a value without tag",
                          yaml_shown((const char *)tag, text));
    }
    return ERROR_NONE;
}

/* Checks an event that begins a value. Limits the number and the depth of values. Refuses anchors,
 * tags and aliases. */
static enum error_code yaml_check_event(struct yaml_reader *r, const yaml_event_t *event,
                                        const struct yaml_mark *mark, int depth)
{
    char text[YAML_SHOWN + 4];

    if (++r->nodes > YAML_MAX_NODES) {
        return yaml_error(r->error, mark, "found more than %d values, expected fewer",
                          YAML_MAX_NODES);
    }
    if (depth > MAX_DEPTH) {
        return yaml_error(r->error, mark,
                          "found values nested deeper than %d, expected fewer levels", MAX_DEPTH);
    }
    switch (event->type) {
    case YAML_SCALAR_EVENT:
        return yaml_check_plain(r, mark, event->data.scalar.anchor, event->data.scalar.tag);
    case YAML_SEQUENCE_START_EVENT:
        return yaml_check_plain(r, mark, event->data.sequence_start.anchor,
                                event->data.sequence_start.tag);
    case YAML_MAPPING_START_EVENT:
        return yaml_check_plain(r, mark, event->data.mapping_start.anchor,
                                event->data.mapping_start.tag);
    case YAML_ALIAS_EVENT:
        return yaml_error(r->error, mark, "found alias \"*%s\", expected the value itself",
                          yaml_shown((const char *)event->data.alias.anchor, text));
    default:
        return yaml_error(r->error, mark, "found the end of the document, expected a value");
    }
}

/* Checks that the keys of a mapping are non-empty scalars, each present once. */
static enum error_code yaml_check_keys(struct yaml_reader *r, const struct yaml_node *map)
{
    char text[YAML_SHOWN + 4];

    if (map->count > MAX_KEYS) {
        return yaml_error(r->error, &map->mark, "found %zu keys in a mapping, expected at most %d",
                          map->count, MAX_KEYS);
    }
    for (const struct yaml_node *key = map->first; key; key = key->next->next) {
        if (key->kind != YAML_KIND_SCALAR || *key->text == '\0') {
            return yaml_unexpected(r, key, "the name of a key");
        }
        for (const struct yaml_node *other = map->first; other != key; other = other->next->next) {
            if (!strcmp(other->text, key->text)) {
                return yaml_error(r->error, &key->mark,
                                  "found key \"%s\" again, expected it once (it stands in line %d)",
                                  yaml_shown(key->text, text), other->mark.line);
            }
        }
    }
    return ERROR_NONE;
}

static enum error_code yaml_build_node(struct yaml_reader *r, const yaml_event_t *event, int depth,
                                       struct yaml_node **out);

/* Builds the entries of a list or mapping up to its end event. MAX_DEPTH limits the recursion. */
static enum error_code yaml_build_children(struct yaml_reader *r, struct yaml_node *parent,
                                           int depth)
{
    yaml_event_type_t end =
        parent->kind == YAML_KIND_LIST ? YAML_SEQUENCE_END_EVENT : YAML_MAPPING_END_EVENT;
    struct yaml_node **link = &parent->first;
    size_t count = 0;

    for (;;) {
        yaml_event_t event;
        enum error_code code = yaml_next_event(r, &event);
        bool done;

        if (code) {
            return code;
        }

        /* Get the next child, or the end of the list or mapping */
        done = event.type == end;
        if (!done) {
            code = yaml_build_node(r, &event, depth + 1, link);
        }
        yaml_event_delete(&event);
        if (code) {
            return code;
        }

        /* Keys and values alternate as the children of a mapping */
        if (done) {
            parent->count = parent->kind == YAML_KIND_LIST ? count : count / 2;
            return parent->kind == YAML_KIND_LIST ? ERROR_NONE : yaml_check_keys(r, parent);
        }
        link = &(*link)->next;
        count++;
    }
}

/* Builds the node that an event begins, with all nodes below it. */
static enum error_code yaml_build_node(struct yaml_reader *r, const yaml_event_t *event, int depth,
                                       struct yaml_node **out)
{
    struct yaml_mark mark = yaml_mark_at(r, event->start_mark);
    enum error_code code = yaml_check_event(r, event, &mark, depth);
    struct yaml_node *node;

    if (code) {
        return code;
    }
    node = arena_alloc(&r->scratch, 1, sizeof *node);
    if (!node) {
        return yaml_no_memory(r);
    }
    node->mark = mark;
    *out = node;
    if (event->type == YAML_SCALAR_EVENT) {
        const char *text = (const char *)event->data.scalar.value;

        /* Refuse a zero byte, which an escape sequence can produce */
        if (strlen(text) != event->data.scalar.length) {
            return yaml_error(r->error, &mark, "found a zero byte in a text, expected none");
        }
        node->kind = YAML_KIND_SCALAR;
        node->quoted = event->data.scalar.style != YAML_PLAIN_SCALAR_STYLE;
        node->text = arena_strdup(&r->scratch, text);
        return node->text ? ERROR_NONE : yaml_no_memory(r);
    }
    node->kind = event->type == YAML_SEQUENCE_START_EVENT ? YAML_KIND_LIST : YAML_KIND_MAP;
    return yaml_build_children(r, node, depth);
}

/* Reads an event outside the root value. Refuses an event of another type. */
static enum error_code yaml_expect_event(struct yaml_reader *r, yaml_event_type_t type,
                                         const char *message)
{
    yaml_event_t event;
    enum error_code code = yaml_next_event(r, &event);

    if (code) {
        return code;
    }
    if (event.type != type) {
        struct yaml_mark mark = yaml_mark_at(r, event.start_mark);

        code = yaml_error(r->error, &mark, "%s", message);
    }
    yaml_event_delete(&event);
    return code;
}

/* Builds the tree of a file, which must contain one document. */
static enum error_code yaml_build_document(struct yaml_reader *r, struct yaml_node **root)
{
    yaml_event_t event;
    enum error_code code;

    if ((code = yaml_expect_event(r, YAML_STREAM_START_EVENT,
                                  "found no stream, expected a document")) ||
        (code = yaml_expect_event(r, YAML_DOCUMENT_START_EVENT,
                                  "found an empty file, expected a mapping")) ||
        (code = yaml_next_event(r, &event))) {
        return code;
    }
    code = yaml_build_node(r, &event, 0, root);
    yaml_event_delete(&event);
    code = code ? code
                : yaml_expect_event(r, YAML_DOCUMENT_END_EVENT,
                                    "found more, expected the document's end");
    return code ? code
                : yaml_expect_event(r, YAML_STREAM_END_EVENT,
                                    "found a second document, expected one document in a file");
}

enum error_code yaml_tree_read(struct yaml_reader *r, const char *text, size_t size,
                               struct yaml_node **root)
{
    static const char bom[] = "\xef\xbb\xbf";
    yaml_parser_t parser;
    enum error_code code;

    if (size >= 3 && !memcmp(text, bom, 3)) {
        text += 3;
        size -= 3;
    }

    /* Check that the text is UTF-8 without control characters. libyaml's own error has a less
     * exact place. */
    const unsigned char *p = (const unsigned char *)text;
    struct yaml_mark mark = {.file = r->file, .line = 1, .column = 1};

    for (size_t i = 0; i < size;) {
        size_t n = text_utf8_length(text + i, size - i);

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
    if (!yaml_parser_initialize(&parser)) {
        return yaml_no_memory(r);
    }
    yaml_parser_set_encoding(&parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
    r->parser = &parser;
    code = yaml_build_document(r, root);
    r->parser = NULL;
    yaml_parser_delete(&parser);
    return code;
}
