/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Applies a schema to the nodes of a YAML document and fills structs.
 */

#include "base/input_file.h"
#include "base/text.h"
#include "base/yaml_tree.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    SCRATCH = 64 << 20, /* scratch memory, bytes: 2 * 64 per node, and the text of the file */
    MAX_WORDS = 128,    /* most keys or enum words given to text_nearest */
    MAX_NAMES = 512,    /* most names given to text_nearest */
};

/* ---- messages ---- */

enum error_code yaml_error(struct error *error, const struct yaml_mark *mark, const char *format,
                           ...)
{
    char text[512];

    TEXT_FORMAT(text, format);
    if (!mark->file) {
        return error_set(error, ERROR_INPUT, "%s", text);
    }
    return error_set(error, ERROR_INPUT, "%.200s:%d:%d: %s", mark->file, mark->line, mark->column,
                     text);
}

/* Writes a list of words: "a, b or c". */
static void yaml_join_words(const char *const *words, size_t count, char *out, size_t size)
{
    size_t used = 0;

    out[0] = '\0';
    for (size_t i = 0; i < count; i++) {
        const char *separator = i == 0 ? "" : i + 1 == count ? " or " : ", ";

        /* End a long list after a complete word */
        if (used + strlen(separator) + strlen(words[i]) + sizeof ", ..." > size) {
            snprintf(out + used, size - used, ", ...");
            return;
        }
        used += (size_t)snprintf(out + used, size - used, "%s%s", separator, words[i]);
    }
}

/* ---- schema ---- */

/* Returns the address of a field in a struct. */
static void *yaml_member(void *out, size_t offset)
{
    return (unsigned char *)out + offset;
}

/* Describes the allowed values of a field: "a number from 0 to 100". */
static void yaml_describe_range(const char *what, const struct yaml_field *field, char *out,
                                size_t size)
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

/* Checks whether a number is in the range of a field. min = max = 0 allows any number. */
static bool yaml_in_range(const struct yaml_field *field, double value)
{
    return (field->min == 0 && field->max == 0) || (value >= field->min && value <= field->max);
}

static enum error_code yaml_read_bool(struct yaml_reader *r, const struct yaml_field *field,
                                      const struct yaml_node *node, void *out)
{
    struct yaml_node plain = *node;

    (void)field;
    plain.quoted &= !r->quoted_values;
    if (!yaml_is_bool(&plain)) {
        return yaml_unexpected(r, node, "true or false");
    }
    *(bool *)out = node->text[0] == 't';
    return ERROR_NONE;
}

/* Reads an integer. Refuses leading zeros, because YAML 1.1 and 1.2 interpret them differently. */
static enum error_code yaml_read_int(struct yaml_reader *r, const struct yaml_field *field,
                                     const struct yaml_node *node, void *out)
{
    const char *digits;
    char expected[96];
    int64_t value;

    if (node->kind != YAML_KIND_SCALAR || (node->quoted && !r->quoted_values) ||
        !text_to_int(node->text, INT64_MIN, INT64_MAX, &value)) {
        yaml_describe_range("an integer", field, expected, sizeof expected);
        return yaml_unexpected(r, node, expected);
    }
    /* 010 means 8 in YAML 1.1 and 10 in YAML 1.2 */
    digits = node->text + (*node->text == '-' || *node->text == '+');
    if (digits[0] == '0' && digits[1] >= '0' && digits[1] <= '9') {
        return yaml_unexpected(r, node, "an integer without leading zeros");
    }
    if (!yaml_in_range(field, (double)value)) {
        yaml_describe_range("an integer", field, expected, sizeof expected);
        return yaml_unexpected(r, node, expected);
    }
    if (field->count == sizeof(int)) {
        *(int *)out = (int)value;
    } else {
        *(int64_t *)out = value;
    }
    return ERROR_NONE;
}

/* Reads a finite number, or a hexadecimal integer. */
static enum error_code yaml_read_real(struct yaml_reader *r, const struct yaml_field *field,
                                      struct yaml_node *node, void *out)
{
    char expected[96];
    int64_t whole = 0;
    bool hex = node->kind == YAML_KIND_SCALAR && strncmp(node->text, "0x", 2) == 0 &&
               text_to_int(node->text, INT64_MIN, INT64_MAX, &whole);
    double value = (double)whole;

    if (node->kind != YAML_KIND_SCALAR || (node->quoted && !r->quoted_values) ||
        (!hex && !text_to_double(node->text, &value)) || !yaml_in_range(field, value)) {
        yaml_describe_range("a number", field, expected, sizeof expected);
        return yaml_unexpected(r, node, expected);
    }
    if (field->ns) {
        *(int64_t *)out = llround(value * 1e9);
    } else {
        *(double *)out = value;
    }
    return ERROR_NONE;
}

/* Reads a text into the arena. A text that looks like a number, true or false needs quotes. */
static enum error_code yaml_read_string(struct yaml_reader *r, const struct yaml_field *field,
                                        struct yaml_node *node, void *out)
{
    const char **string = out;
    char expected[96];

    if (yaml_is_number(node) || yaml_is_bool(node)) {
        return yaml_unexpected(r, node, "a text (put it in quotes if it is meant as one)");
    }
    if (node->kind != YAML_KIND_SCALAR || yaml_is_null(node)) {
        return yaml_unexpected(r, node, "a text");
    }
    if (field->max > 0 && !yaml_in_range(field, (double)strlen(node->text))) {
        snprintf(expected, sizeof expected, "a text of %.0f to %.0f bytes", field->min, field->max);
        return yaml_unexpected(r, node, expected);
    }
    *string = arena_strdup(r->arena, node->text);
    return *string ? ERROR_NONE : yaml_no_memory(r);
}

/* Reads a word and stores its enum value. */
static enum error_code yaml_read_enum(struct yaml_reader *r, const struct yaml_field *field,
                                      const struct yaml_node *node, void *out)
{
    const char *words[MAX_WORDS], *nearest;
    char what[YAML_FOUND], list[256];
    size_t count = 0;

    for (const struct word *e = field->names; e->word && count < MAX_WORDS; e++) {
        if (node->kind == YAML_KIND_SCALAR && !strcmp(node->text, e->word)) {
            *(int *)out = e->value;
            return ERROR_NONE;
        }
        words[count++] = e->word;
    }
    yaml_join_words(words, count, list, sizeof list);
    nearest = node->kind == YAML_KIND_SCALAR ? text_nearest(node->text, words, count) : NULL;
    return yaml_error(r->error, &node->mark, "found %s, expected %s%s%s%s", yaml_found(node, what),
                      list, nearest ? " (did you mean \"" : "", nearest ? nearest : "",
                      nearest ? "\"?)" : "");
}

/* Reads a list of numbers, exactly field->count long. */
static enum error_code yaml_read_reals(struct yaml_reader *r, const struct yaml_field *field,
                                       const struct yaml_node *node, void *out)
{
    char expected[96];
    double *value = out;

    if (node->kind != YAML_KIND_LIST || node->count != field->count) {
        snprintf(expected, sizeof expected, "a list of %zu numbers", field->count);
    }
    if (node->kind != YAML_KIND_LIST) {
        return yaml_unexpected(r, node, expected);
    }
    if (node->count != field->count) {
        return yaml_error(r->error, &node->mark, "found a list of %zu, expected %s", node->count,
                          expected);
    }
    for (struct yaml_node *entry = node->first; entry; entry = entry->next) {
        enum error_code code = yaml_read_real(r, field, entry, value++);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

static enum error_code yaml_read_struct(struct yaml_reader *r, const struct yaml_schema *schema,
                                        struct yaml_node *node, void *out);

static enum error_code yaml_read_real_entry(struct yaml_reader *r, const struct yaml_field *field,
                                            struct yaml_node *key, void *out)
{
    struct yaml_real_entry *entry = out;

    entry->mark = key->mark;
    entry->name = arena_strdup(r->arena, key->text);
    return entry->name ? yaml_read_real(r, field, key->next, &entry->value) : yaml_no_memory(r);
}

static enum error_code yaml_read_name_entry(struct yaml_reader *r, const struct yaml_field *field,
                                            struct yaml_node *node, void *out)
{
    struct yaml_name *entry = out;

    entry->mark = node->mark;
    return yaml_read_string(r, field, node, &entry->name);
}

/* Reads an entry of a mapping as a struct. The entry's key becomes the name in the struct. */
static enum error_code yaml_read_dict_entry(struct yaml_reader *r, const struct yaml_field *field,
                                            struct yaml_node *key, void *out)
{
    const char *name = arena_strdup(r->arena, key->text);
    enum error_code code = yaml_read_struct(r, field->schema, key->next, out);

    *(const char **)yaml_member(out, field->schema->name_offset) = name;
    return code ? code : name ? ERROR_NONE : yaml_no_memory(r);
}

static enum error_code yaml_read_list_entry(struct yaml_reader *r, const struct yaml_field *field,
                                            struct yaml_node *node, void *out)
{
    return yaml_read_struct(r, field->schema, node, out);
}

/* Reads an entry of a list that the file gives as a mapping. Inserts the entry's key as the value
 * of field->entry_key. */
static enum error_code yaml_read_keyed_entry(struct yaml_reader *r, const struct yaml_field *field,
                                             struct yaml_node *key, void *out)
{
    struct yaml_node entry = *key->next, value = *key;
    struct yaml_node name = {.mark = key->mark, .text = field->entry_key, .next = &value};

    if (entry.kind != YAML_KIND_MAP) {
        return yaml_unexpected(r, &entry, "a mapping");
    }
    for (const struct yaml_node *own = entry.first; own; own = own->next->next) {
        if (strcmp(own->text, field->entry_key) == 0) {
            return yaml_error(r->error, &own->mark,
                              "found %s in an entry of a mapping, expected it as the entry's key "
                              "alone",
                              field->entry_key);
        }
    }
    value.next = entry.first;
    entry.first = &name;
    entry.count++;
    return yaml_read_struct(r, field->schema, &entry, out);
}

typedef enum error_code read_function(struct yaml_reader *r, const struct yaml_field *field,
                                      struct yaml_node *node, void *out);

/* Reads the entries of a list or of a mapping into an array in the arena. */
static enum error_code yaml_read_many(struct yaml_reader *r, const struct yaml_field *field,
                                      struct yaml_node *node, size_t size, read_function *read,
                                      void *out, size_t *count)
{
    unsigned char *array = arena_alloc(r->arena, node->count, size);
    size_t i = 0;

    if (!array) {
        return yaml_no_memory(r);
    }
    for (struct yaml_node *entry = node->first; entry; i++) {
        enum error_code code = read(r, field, entry, array + i * size);

        if (code) {
            return code;
        }
        entry = node->kind == YAML_KIND_MAP ? entry->next->next : entry->next;
    }
    *(void **)out = array;
    *count = node->count;
    return ERROR_NONE;
}

/* Reads a list or a mapping into an array. */
static enum error_code yaml_read_array(struct yaml_reader *r, const struct yaml_field *field,
                                       struct yaml_node *node, void *out, size_t *count)
{
    /* By type: the expected kind of node, the size of an entry, and the reader of an entry */
    static const struct {
        const char *expected;
        enum yaml_kind kind;
        size_t size; /* 0 = size of the schema's struct */
        read_function *read;
    } form[] = {
        [YAML_REAL_LIST] = {"a list of numbers", YAML_KIND_LIST, sizeof(double), yaml_read_real},
        [YAML_NAME_LIST] = {"a list of names", YAML_KIND_LIST, sizeof(struct yaml_name),
                            yaml_read_name_entry},
        [YAML_LIST] = {"a list of mappings", YAML_KIND_LIST, 0, yaml_read_list_entry},
        [YAML_DICT] = {"a mapping of names to mappings", YAML_KIND_MAP, 0, yaml_read_dict_entry},
        [YAML_REAL_DICT] = {"a mapping of names to numbers", YAML_KIND_MAP,
                            sizeof(struct yaml_real_entry), yaml_read_real_entry},
    };
    enum yaml_type type = field->type;
    size_t size = form[type].size ? form[type].size : field->schema->size;

    if (field->entry_key && node->kind == YAML_KIND_MAP) {
        return yaml_read_many(r, field, node, size, yaml_read_keyed_entry, out, count);
    }
    if (node->kind != form[type].kind) {
        return yaml_unexpected(r, node, form[type].expected);
    }
    return yaml_read_many(r, field, node, size, form[type].read, out, count);
}

/* Reads the value of a field. */
static enum error_code yaml_read_value(struct yaml_reader *r, const struct yaml_field *field,
                                       struct yaml_node *node, void *out)
{
    void *value = yaml_member(out, field->offset);

    switch (field->type) {
    case YAML_BOOL:
        return yaml_read_bool(r, field, node, value);
    case YAML_INT:
        return yaml_read_int(r, field, node, value);
    case YAML_REAL:
        return yaml_read_real(r, field, node, value);
    case YAML_STRING:
        return yaml_read_string(r, field, node, value);
    case YAML_ENUM:
        return yaml_read_enum(r, field, node, value);
    case YAML_REALS:
        return yaml_read_reals(r, field, node, value);
    case YAML_MAP:
        return yaml_read_struct(r, field->schema, node, value);
    default:
        return yaml_read_array(r, field, node, value, yaml_member(out, field->count_offset));
    }
}

/* Refuses an unknown key. The error suggests the nearest key or lists all keys. */
static enum error_code yaml_reject_unknown_key(struct yaml_reader *r,
                                               const struct yaml_schema *schema,
                                               const struct yaml_node *key)
{
    const char *words[MAX_WORDS], *nearest;
    char text[YAML_SHOWN + 4], list[320];
    size_t count = 0;

    for (size_t i = 0; i < schema->field_count && count < MAX_WORDS; i++) {
        words[count++] = schema->fields[i].key;
    }
    nearest = text_nearest(key->text, words, count);
    yaml_join_words(words, count, list, sizeof list);
    return yaml_error(r->error, &key->mark, "found unknown key \"%s\" in %s, expected %s%s%s",
                      yaml_shown(key->text, text), schema->what, nearest ? "\"" : "",
                      nearest ? nearest : list, nearest ? "\"" : "");
}

/* Sets the defaults of a struct and of its nested structs. Gives the nested structs the parent's
 * place, so that messages about an omitted mapping have a place. */
static void yaml_set_defaults(const struct yaml_schema *schema, const struct yaml_mark *mark,
                              void *out)
{
    if (schema->defaults) {
        memcpy(out, schema->defaults, schema->size);
    }
    if (!schema->unmarked) {
        *(struct yaml_mark *)out = *mark;
    }
    for (size_t i = 0; i < schema->field_count; i++) {
        const struct yaml_field *field = &schema->fields[i];

        if (field->type == YAML_MAP) {
            yaml_set_defaults(field->schema, mark, yaml_member(out, field->offset));
        }
    }
}

const struct yaml_field *yaml_find_field(const struct yaml_schema *schema, const char *key)
{
    const int at = schema ? TEXT_FIND(schema->fields, schema->field_count, key, key) : -1;

    return at < 0 ? NULL : &schema->fields[at];
}

/* Reads the values of a mapping and stores the places of its keys. */
static enum error_code yaml_read_keys(struct yaml_reader *r, const struct yaml_schema *schema,
                                      struct yaml_node *node, void *out)
{
    struct yaml_key *at = arena_alloc(r->arena, node->count + 1, sizeof *at);

    if (!at) {
        return yaml_no_memory(r);
    }
    node->mark.keys = at;
    for (struct yaml_node *key = node->first; key; key = key->next->next) {
        const struct yaml_field *field = yaml_find_field(schema, key->text);
        enum error_code code = field ? yaml_read_value(r, field, key->next, out)
                                     : yaml_reject_unknown_key(r, schema, key);

        if (code) {
            return code;
        }
        *at++ = (struct yaml_key){field->key, key->next->mark};
    }
    if (!schema->unmarked) {
        *(struct yaml_mark *)out = node->mark;
    }
    return ERROR_NONE;
}

/* Reads a mapping into a struct that starts with the schema's defaults. */
static enum error_code yaml_read_struct(struct yaml_reader *r, const struct yaml_schema *schema,
                                        struct yaml_node *node, void *out)
{
    enum error_code code;
    char expected[96];

    if (schema->alone && node->kind == YAML_KIND_SCALAR) {
        yaml_set_defaults(schema, &node->mark, out);
        return yaml_read_value(r, yaml_find_field(schema, schema->alone), node, out);
    }
    if (node->kind != YAML_KIND_MAP) {
        snprintf(expected, sizeof expected, "a mapping (%s)", schema->what);
        return yaml_unexpected(r, node, expected);
    }

    /* Set the defaults; the keys of the mapping then replace them */
    yaml_set_defaults(schema, &node->mark, out);
    code = yaml_read_keys(r, schema, node, out);
    if (code) {
        return code;
    }

    /* Check that all required keys are present */
    for (size_t i = 0; i < schema->field_count; i++) {
        if (schema->fields[i].required && !yaml_has(&node->mark, schema->fields[i].key)) {
            return yaml_error(r->error, &node->mark, "found %s without key \"%s\", expected it",
                              schema->what, schema->fields[i].key);
        }
    }
    return ERROR_NONE;
}

/* ---- after reading ---- */

/* Returns the key at a path of keys. If a key is omitted, returns NULL and sets *mark to the
 * mapping without this key. */
static const struct yaml_key *yaml_find_path(const struct yaml_mark **mark, const char *path)
{
    const size_t n = strcspn(path, ".");

    for (const struct yaml_key *at = (*mark)->keys; at && at->key; at++) {
        if (at->key[0] == path[0] && strncmp(at->key, path, n) == 0 && at->key[n] == '\0') {
            *mark = &at->mark;
            return path[n] ? yaml_find_path(mark, path + n + 1) : at;
        }
    }
    return NULL;
}

const struct yaml_mark *yaml_place(const struct yaml_mark *mapping, const char *path)
{
    yaml_find_path(&mapping, path);
    return mapping;
}

bool yaml_has(const struct yaml_mark *mapping, const char *path)
{
    return yaml_find_path(&mapping, path) != NULL;
}

void yaml_override(const struct yaml_schema *schema, const struct yaml_mark *mapping,
                   const void *from, void *to)
{
    for (size_t i = 0; i < schema->field_count; i++) {
        const struct yaml_field *field = &schema->fields[i];
        const size_t size[] = {
            [YAML_BOOL] = sizeof(bool),
            [YAML_INT] = field->count == sizeof(int) ? sizeof(int) : sizeof(int64_t),
            [YAML_REAL] = sizeof(double),
            [YAML_STRING] = sizeof(char *),
            [YAML_ENUM] = sizeof(int),
            [YAML_REALS] = field->count * sizeof(double),
            [YAML_MAP] = field->schema ? field->schema->size : 0,
            [YAML_REAL_LIST... YAML_NAME_LIST] = sizeof(void *),
            [YAML_LIST... YAML_REAL_DICT] = sizeof(void *),
        };

        if (yaml_has(mapping, field->key)) {
            memcpy((char *)to + field->offset, (const char *)from + field->offset,
                   size[field->type]);
            if (field->count_offset) {
                memcpy((char *)to + field->count_offset, (const char *)from + field->count_offset,
                       sizeof(size_t));
            }
        }
    }
}

enum error_code yaml_find_name(struct yaml_names names, const char *what, const char *name,
                               const struct yaml_mark *mark, int *index, struct error *error)
{
    const char *words[MAX_NAMES], *nearest;
    char text[YAML_SHOWN + 4], list[256];
    size_t count = names.count < MAX_NAMES ? names.count : MAX_NAMES;

    *index = text_find(names.array, names.count, names.stride, names.offset, name);
    if (*index >= 0) {
        return ERROR_NONE;
    }
    for (size_t i = 0; i < count; i++) {
        const char *entry = (const char *)names.array + i * names.stride + names.offset;

        words[i] = *(const char *const *)(const void *)entry;
    }
    nearest = text_nearest(name, words, count);
    yaml_join_words(words, count, list, sizeof list);
    return yaml_error(error, mark, "found unknown %s \"%s\", expected %s%.250s%s", what,
                      yaml_shown(name, text), nearest ? "\"" : "",
                      nearest ? nearest
                      : *list ? list
                              : "none",
                      nearest ? "\"" : "");
}

/* ---- entry points ---- */

/* Refuses a file of another kind, without a mapping or without any key of the schema. The error
 * quotes no content, because the file may be private. */
static enum error_code yaml_check_root(struct yaml_reader *r, const struct yaml_schema *schema,
                                       const struct yaml_node *root)
{
    const struct yaml_node *key = root->first;

    while (root->kind == YAML_KIND_MAP && key && !yaml_find_field(schema, key->text)) {
        key = key->next->next;
    }
    return root->kind == YAML_KIND_MAP && (key || !root->first)
               ? ERROR_NONE
               : yaml_error(r->error, &root->mark,
                            "found %s, expected a mapping (%s): the file is of another kind",
                            root->kind == YAML_KIND_MAP    ? "no known key"
                            : root->kind == YAML_KIND_LIST ? "a list"
                            : yaml_is_null(root)           ? "nothing"
                                                           : "a text",
                            schema->what);
}

enum error_code yaml_read_text(const char *name, const char *text, size_t size,
                               const struct yaml_schema *schema, struct arena *arena, void *out,
                               struct error *error)
{
    struct yaml_reader r = {
        .arena = arena, .file = name, .quoted_values = schema->quoted_values, .error = error};
    enum error_code code = arena_init(&r.scratch, SCRATCH, error);
    struct yaml_node *root;

    if (code) {
        return code;
    }
    code = yaml_document_read(&r, name, text, size, schema, NULL, &root);
    code = code ? code : yaml_check_root(&r, schema, root);
    if (!code) {
        memset(out, 0, schema->size);
        code = yaml_read_struct(&r, schema, root, out);
    }
    if (!code && schema->hash_offset) {
        memcpy((unsigned char *)out + schema->hash_offset, &r.hash, sizeof r.hash);
    }
    if (!code && schema->renamed) {
        memcpy((unsigned char *)out + schema->old_offset, &r.old, sizeof r.old);
    }
    arena_fini(&r.scratch);
    return code;
}

enum error_code yaml_read_file(const char *path, const struct yaml_schema *schema,
                               struct arena *arena, void *out, struct error *error)
{
    size_t size = 0;
    char *text;
    enum error_code code = input_file_load(path, YAML_MAX_FILE, &text, &size, error);

    if (!code) {
        code = yaml_read_text(path, text, size, schema, arena, out, error);
    }
    free(text);
    return code;
}

enum error_code yaml_read_key(const char *path, const char *key, struct arena *arena,
                              const char **text, struct error *error)
{
    struct yaml_reader r = {.arena = arena, .file = path, .error = error};
    enum error_code code = arena_init(&r.scratch, SCRATCH, error);
    struct yaml_node *root, *at;
    char *content = NULL;
    size_t size = 0;

    *text = NULL;
    if (code) {
        return code;
    }
    code = input_file_load(path, YAML_MAX_FILE, &content, &size, error);
    if (!code && !(code = yaml_tree_read(&r, content, size, &root))) {
        at = root->kind == YAML_KIND_MAP ? root->first : NULL;
        while (at && strcmp(at->text, key) != 0) {
            at = at->next->next;
        }
        if (at && at->next->kind == YAML_KIND_SCALAR && !yaml_is_null(at->next)) {
            *text = arena_strdup(arena, at->next->text);
            code = *text ? ERROR_NONE : yaml_no_memory(&r);
        }
    }
    free(content);
    arena_fini(&r.scratch);
    return code;
}
