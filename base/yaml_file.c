/* SPDX-License-Identifier: Apache-2.0 */
/* Reads YAML files: loads their bytes, resolves paths in them, and merges base files. */
#include "base/hash.h"
#include "base/input_file.h"
#include "base/text.h"
#include "base/yaml_tree.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_CHAIN = 256 /* longest chain of base files; it limits the stack */ };

/* ---- files that extend others ---- */

/* A file that is being read. `by` is the file that extends it; NULL for the first file. */
struct yaml_chain {
    const struct yaml_chain *by;
    int depth;
    /* identity of the file under any name; 0 and 0 for a text in memory */
    dev_t device;
    ino_t inode;
};

/* Returns the link to a key of a mapping. If the key is missing, returns the link at the list's
 * end. */
static struct yaml_node **yaml_find_key(struct yaml_node *map, const char *name)
{
    struct yaml_node **at = &map->first;

    while (*at && strcmp((*at)->text, name) != 0) {
        at = &(*at)->next->next;
    }
    return at;
}

/* Converts a list of mappings into one mapping. Its keys are the entries' values of `key`. If an
 * entry lacks this value, the list does not change. */
static void yaml_list_to_map(struct yaml_node *list, const char *key)
{
    struct yaml_node **link = &list->first, **at, *next;

    for (struct yaml_node *entry = list->first; entry; entry = entry->next) {
        if (entry->kind != YAML_KIND_MAP || !*(at = yaml_find_key(entry, key)) ||
            (*at)->next->kind != YAML_KIND_SCALAR) {
            return;
        }
    }
    for (struct yaml_node *entry = list->first; entry; entry = next) {
        struct yaml_node *name;

        next = entry->next;
        at = yaml_find_key(entry, key);
        name = (*at)->next;
        *at = name->next;
        entry->count--;
        name->next = entry;
        *link = name;
        link = &entry->next;
    }
    list->kind = YAML_KIND_MAP;
}

/* Checks whether two keys are the same text or the same number. */
static bool yaml_same_key(const struct yaml_node *a, const struct yaml_node *b)
{
    int64_t x, y;

    return strcmp(a->text, b->text) == 0 ||
           (text_to_int(a->text, INT64_MIN, INT64_MAX, &x) &&
            text_to_int(b->text, INT64_MIN, INT64_MAX, &y) && x == y);
}

static void yaml_merge_maps(const struct yaml_schema *schema, struct yaml_node *map,
                            struct yaml_node *base);

/* Merges the entries of a mapping into the base's entries. The base's entries come first, in their
 * order; new entries follow. */
static void yaml_merge_entries(const struct yaml_schema *schema, struct yaml_node *map,
                               struct yaml_node *base)
{
    struct yaml_node *after;

    for (struct yaml_node *key = map->first; key; key = after) {
        struct yaml_node *value = key->next, *there = base->first;

        after = value->next;
        while (there && !yaml_same_key(there, key)) {
            there = there->next->next;
        }
        /* Append an entry that the base lacks */
        if (!there) {
            struct yaml_node **end = &base->first;

            while (*end) {
                end = &(*end)->next;
            }
            *end = key;
            value->next = NULL;
            base->count++;
            continue;
        }
        /* Replace the base's entry, merged key by key */
        if (value->kind == YAML_KIND_MAP && there->next->kind == YAML_KIND_MAP) {
            yaml_merge_maps(schema, value, there->next);
        }
        value->next = there->next->next;
        there->next = value;
    }
    map->first = base->first;
    map->count = base->count;
}

/* Adds the keys that only the base has to a mapping. Merges the values of a key if both files give
 * a mapping. A mapping in place of a list of the base changes single entries of this list. */
static void yaml_merge_maps(const struct yaml_schema *schema, struct yaml_node *map,
                            struct yaml_node *base)
{
    struct yaml_node *after;

    for (struct yaml_node *key = base->first; key; key = after) {
        struct yaml_node *value = key->next, **own = yaml_find_key(map, key->text);
        const struct yaml_field *field = yaml_find_field(schema, key->text);

        after = value->next;
        if (!*own) {
            value->next = NULL;
            *own = key;
            map->count++;
            continue;
        }
        if ((*own)->next->kind != YAML_KIND_MAP) {
            continue;
        }
        if (field && field->entry_key && value->kind == YAML_KIND_LIST) {
            yaml_list_to_map(value, field->entry_key);
        }
        if (value->kind == YAML_KIND_MAP && field && field->entry_key) {
            yaml_merge_entries(field->schema, (*own)->next, value);
        } else if (value->kind == YAML_KIND_MAP) {
            yaml_merge_maps(field ? field->schema : NULL, (*own)->next, value);
        }
    }
}

/* Removes the key format_version from a document. Refuses a version that is newer than this
 * program. */
static enum error_code yaml_check_format(struct yaml_reader *r, const struct yaml_schema *schema,
                                         struct yaml_node *root)
{
    struct yaml_node **at, *value;
    int64_t version;

    if (root->kind != YAML_KIND_MAP || !*(at = yaml_find_key(root, "format_version"))) {
        return ERROR_NONE;
    }
    value = (*at)->next;
    *at = value->next;
    root->count--;
    if (value->kind != YAML_KIND_SCALAR || !yaml_is_number(value) ||
        !text_to_int(value->text, 1, INT32_MAX, &version)) {
        return yaml_unexpected(r, value, "a whole number of 1 or more");
    }
    if (version > schema->format_version) {
        return yaml_error(r->error, &value->mark,
                          "found format_version %d, expected %d at most: the file is for a newer "
                          "coman-hil",
                          (int)version, schema->format_version);
    }
    return ERROR_NONE;
}

/* Renames old keys in a mapping, or in all entries of a list or dictionary, to their new names.
 * Records their places. */
static enum error_code yaml_rename_keys(struct yaml_reader *r, const struct yaml_renamed *renamed,
                                        const struct yaml_schema *schema, bool entries,
                                        struct yaml_node *node)
{
    enum error_code code = ERROR_NONE;
    struct yaml_old_key **note = &r->old;
    struct yaml_node **old;

    if (!entries && node->kind != YAML_KIND_MAP) {
        return ERROR_NONE;
    }
    if (!entries && yaml_find_field(schema, renamed->now) &&
        *(old = yaml_find_key(node, renamed->was))) {
        while (*note) {
            note = &(*note)->next;
        }
        *note = arena_alloc(r->arena, 1, sizeof **note);
        if (!*note) {
            return yaml_no_memory(r);
        }
        (*note)->mark = (*old)->mark;
        if (!*yaml_find_key(node, renamed->now)) {
            (*old)->text = renamed->now;
        } else if ((*old)->next->kind == YAML_KIND_SCALAR &&
                   strcmp((*old)->next->text, renamed->only) == 0) {
            *old = (*old)->next->next;
            node->count--;
        }
    }
    for (struct yaml_node *at = node->first, *value; at && !code; at = value->next) {
        const struct yaml_field *field = entries ? NULL : yaml_find_field(schema, at->text);

        value = node->kind == YAML_KIND_MAP ? at->next : at;
        if (entries || (field && field->schema)) {
            code = yaml_rename_keys(r, renamed, entries ? schema : field->schema,
                                    !entries && field->type != YAML_MAP, value);
        }
    }
    return code;
}

/* Finds the path of the base file that a document extends. */
static enum error_code yaml_find_extended(struct yaml_reader *r, const struct yaml_schema *schema,
                                          const struct yaml_node *reference, const char **path)
{
    enum error_code code;

    if (!schema->locate || !*reference->text || strpbrk(reference->text, "/.")) {
        return yaml_resolve_path(&reference->mark, reference->text, r->arena, path, r->error);
    }
    code = schema->locate(reference->text, reference->mark.file, r->arena, path, r->error);
    return code ? error_prefix(r->error, "%s:%d:%d", reference->mark.file, reference->mark.line,
                               reference->mark.column)
                : ERROR_NONE;
}

/* Refuses a file that extends itself through other files. The error has the line of the
 * reference. */
static enum error_code yaml_check_chain(struct yaml_reader *r, const struct yaml_chain *chain,
                                        const struct yaml_node *reference, const char *path)
{
    struct stat status;

    for (const struct yaml_chain *file = chain; file && !stat(path, &status); file = file->by) {
        if (file->inode == status.st_ino && file->device == status.st_dev) {
            return yaml_error(r->error, &reference->mark,
                              "found %.200s, which extends this file itself: expected no circle of "
                              "files that extend one another",
                              path);
        }
    }
    return chain->depth < MAX_CHAIN
               ? ERROR_NONE
               : yaml_error(r->error, &reference->mark,
                            "found a chain of more than %d files that extend one another, expected "
                            "fewer",
                            MAX_CHAIN);
}

/* Merges the base file into the document if the document has the key `extends`. */
static enum error_code yaml_follow_extends(struct yaml_reader *r, const struct yaml_schema *schema,
                                           const struct yaml_chain *chain, struct yaml_node *root)
{
    struct yaml_node **at, *reference, *base;
    enum error_code code;
    const char *path;
    char *text;
    size_t size;

    /* Remove the key from the document */
    if (root->kind != YAML_KIND_MAP || !*(at = yaml_find_key(root, "extends"))) {
        return ERROR_NONE;
    }
    reference = (*at)->next;
    *at = reference->next;
    root->count--;
    if (reference->kind != YAML_KIND_SCALAR) {
        return yaml_unexpected(r, reference, "the file that this one extends");
    }
    if ((code = yaml_find_extended(r, schema, reference, &path)) ||
        (code = yaml_check_chain(r, chain, reference, path))) {
        return code;
    }

    /* Load the base file; the place of a failure is the line of the reference */
    code = input_file_load(path, YAML_MAX_FILE, &text, &size, r->error);
    if (code) {
        error_prefix(r->error, "%s:%d:%d", reference->mark.file, reference->mark.line,
                     reference->mark.column);
        goto done;
    }

    /* Read the base, which may extend other files, and add values that this document omits */
    code = yaml_document_read(r, path, text, size, schema, chain, &base);
    if (!code && base->kind == YAML_KIND_MAP) {
        yaml_merge_maps(schema, root, base);
    }
done:
    free(text);
    return code;
}

enum error_code yaml_document_read(struct yaml_reader *r, const char *name, const char *text,
                                   size_t size, const struct yaml_schema *schema,
                                   const struct yaml_chain *by, struct yaml_node **root)
{
    struct yaml_chain chain = {.by = by, .depth = by ? by->depth + 1 : 1};
    struct stat status;
    enum error_code code;

    if (!stat(name, &status)) {
        chain.device = status.st_dev;
        chain.inode = status.st_ino;
    }

    if (size > YAML_MAX_FILE) {
        return error_set(r->error, ERROR_INPUT,
                         "%.200s: found more than %d bytes, expected at most that", name,
                         YAML_MAX_FILE);
    }
    r->file = arena_strdup(r->arena, name);
    if (!r->file) {
        r->file = name;
        return yaml_no_memory(r);
    }
    r->hash += hash_bytes(HASH_START, text, size);
    code = yaml_tree_read(r, text, size, root);
    if (!code && schema->format_version > 0) {
        code = yaml_check_format(r, schema, *root);
    }
    if (!code && schema->renamed &&
        memmem(text, size, schema->renamed->was, strlen(schema->renamed->was))) {
        code = yaml_rename_keys(r, schema->renamed, schema, false, *root);
    }
    return code || !schema->extendable ? code : yaml_follow_extends(r, schema, &chain, *root);
}

/* ---- references ---- */

/* Returns the lowest level that a relative path reaches: 0 = the starting directory, -1 = its
 * parent. */
static int path_lowest_level(const char *reference)
{
    int level = 0, lowest = 0;

    for (const char *part = reference; *part;) {
        size_t n = strcspn(part, "/");

        if (n == 2 && part[0] == '.' && part[1] == '.') {
            level--;
        } else if (n > 1 || (n == 1 && part[0] != '.')) {
            level++;
        }
        lowest = level < lowest ? level : lowest;
        part += n + (part[n] == '/');
    }
    return lowest;
}

enum error_code yaml_resolve_path(const struct yaml_mark *mark, const char *reference,
                                  struct arena *arena, const char **path, struct error *error)
{
    const char *slash = strrchr(mark->file, '/');
    size_t directory = slash ? (size_t)(slash - mark->file) + 1 : 0;
    size_t size = directory + strlen(reference) + 1;
    char text[YAML_SHOWN + 4], *joined;

    /* The reference must be relative, and at most one directory up */
    if (*reference == '\0') {
        return yaml_error(error, mark,
                          "found an empty text, expected a path relative to this file");
    }
    if (*reference == '/') {
        return yaml_error(error, mark, "found absolute path \"%s\", expected one relative to %s",
                          yaml_shown(reference, text), "this file");
    }
    if (path_lowest_level(reference) < -1) {
        return yaml_error(error, mark,
                          "found path \"%s\", which leaves the configuration tree, expected one "
                          "at or below \"..\"",
                          yaml_shown(reference, text));
    }

    /* Append it to the directory of the referring file */
    joined = arena_alloc(arena, size, 1);
    if (!joined) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory left", mark->file);
    }
    snprintf(joined, size, "%.*s%s", (int)directory, mark->file, reference);

    /* Remove "." and "name/.." from the path, for readable messages. Do not access the file
     * system. */
    char *out = joined;

    for (const char *part = joined; *part;) {
        size_t n = strcspn(part, "/"), more = part[n] == '/';
        /* start of the last component, without the slash before it */
        char *last = out > joined ? out - 1 : out;
        bool up = n == 2 && part[0] == '.' && part[1] == '.';

        while (last > joined && last[-1] != '/') {
            last--;
        }
        if (up && out > joined && *last != '/' && strncmp(last, "../", 3) != 0) {
            out = last;
        } else if (!(n == 1 && part[0] == '.') && (n > 0 || out == joined)) {
            memmove(out, part, n + more);
            out += n + more;
        }
        part += n + more;
    }
    *out = '\0';
    *path = joined;
    return ERROR_NONE;
}
