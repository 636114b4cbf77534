/* SPDX-License-Identifier: Apache-2.0 */
/*
 * MJCF: <include>. Before anything is read, each one is replaced by the content of the root of its
 * file. A name is relative to the including file, or else to the main file. Each file is included
 * once, so that none can include itself, and the total size is limited.
 */
#include "app/import/mjcf_private.h"
#include "app/import/path.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { INCLUDES_MAX = 256, INCLUDE_DEPTH_MAX = 16 };

/* Expansion under way. */
struct includer {
    const struct mjcf_reader *reader;
    char inside[PATH_MAX]; /* folder of the main file */
    const char *seen[INCLUDES_MAX];
    size_t nseen, bytes;
};

static enum error_code include_expand(struct includer *in, const struct xml_file *file,
                                      const char *folder, xmlNode *parent, int depth);

/* Finds the path of the file that an <include> names. */
static enum error_code include_find(struct includer *in, const struct xml_file *file,
                                    const xmlNode *node, const char *folder, char path[PATH_MAX])
{
    const struct mjcf_reader *r = in->reader;
    enum import_path where;
    const char *name;
    enum error_code code = xml_need(file, node, "file", &name);

    if (code) {
        return code;
    }
    where = import_resolve_path(in->inside, folder, name, r->packages->trust, path);

    /* Like MuJoCo: in the folder of the including file, else in the folder of the main file */
    if (where == IMPORT_PATH_MISSING) {
        where = import_resolve_path(in->inside, in->inside, name, r->packages->trust, path);
    }
    if (where == IMPORT_PATH_OUTSIDE) {
        return import_error(r->error, xml_name(file, node), xml_line(node),
                            "found the include of \"%.200s\", which is outside the folder of "
                            "%.200s, expected one in it: give --trust if you trust whoever wrote "
                            "it",
                            name, r->file->name);
    }
    return where == IMPORT_PATH_FOUND
               ? ERROR_NONE
               : import_error(r->error, xml_name(file, node), xml_line(node),
                              "found no file \"%.200s\" to include beside %.200s", name,
                              file->name);
}

/* Records a file as read; refuses one that was read before, by its path without symbolic links. */
static enum error_code include_note(struct includer *in, const struct xml_file *file,
                                    const xmlNode *node, const char *path)
{
    const struct mjcf_reader *r = in->reader;
    char real[PATH_MAX];

    if (!realpath(path, real)) {
        return error_set_file(r->error, errno, path, "cannot be read");
    }
    for (size_t i = 0; i < in->nseen; i++) {
        if (!strcmp(in->seen[i], real)) {
            return import_error(r->error, xml_name(file, node), xml_line(node),
                                "found the include of \"%.200s\", which was read before, expected "
                                "each file once",
                                path);
        }
    }
    if (in->nseen == INCLUDES_MAX) {
        return import_error(r->error, xml_name(file, node), xml_line(node),
                            "found more than %d files, expected fewer", INCLUDES_MAX);
    }
    in->seen[in->nseen] = arena_strdup(r->arena, real);
    return in->seen[in->nseen++] ? ERROR_NONE : mjcf_no_memory(r);
}

/* Replaces an <include> by the content of its file, whose own includes are expanded first. */
static enum error_code include_replace(struct includer *in, const struct xml_file *file,
                                       const char *folder, xmlNode *node, int depth)
{
    const struct mjcf_reader *r = in->reader;
    char path[PATH_MAX], beside[PATH_MAX];
    struct xml_file other;
    enum error_code code;

    if (depth >= INCLUDE_DEPTH_MAX) {
        return import_error(r->error, xml_name(file, node), xml_line(node),
                            "found includes more than %d deep, expected fewer", INCLUDE_DEPTH_MAX);
    }
    if ((code = include_find(in, file, node, folder, path)) ||
        (code = include_note(in, file, node, path)) ||
        (code = xml_file_open(&other, path, r->arena, r->error))) {
        return code;
    }

    /* Many small includes could still make a huge document */
    in->bytes += other.size;
    if (in->bytes > XML_FILE_MAX) {
        code = import_error(r->error, xml_name(file, node), xml_line(node),
                            "found %zu bytes in all files, expected at most %d", in->bytes,
                            XML_FILE_MAX);
    } else if (!import_find_folder(path, beside)) {
        code = error_set_file(r->error, errno, path, "cannot be read");
    }

    /* Its own includes first, so that what is inserted has none left */
    code = code ? code : include_expand(in, &other, beside, other.root, depth + 1);
    code = code ? code : xml_insert_file(file, node, &other, r->error);
    xml_file_close(&other);
    xml_remove(node);
    return code;
}

/* Expands the includes among the children of an element and below them. */
static enum error_code include_expand(struct includer *in, const struct xml_file *file,
                                      const char *folder, xmlNode *parent, int depth)
{
    enum error_code code = ERROR_NONE;
    xmlNode *next;

    for (xmlNode *child = xml_child(parent, NULL); child && !code; child = next) {
        next = xml_next(child, NULL);
        code = xml_is(child, "include") ? include_replace(in, file, folder, child, depth)
                                        : include_expand(in, file, folder, child, depth);
    }
    return code;
}

/* Returns the first <include> below an element, or NULL. */
static const xmlNode *include_find_first(const xmlNode *parent)
{
    const xmlNode *found = NULL;

    for (const xmlNode *child = xml_child(parent, NULL); child && !found;
         child = xml_next(child, NULL)) {
        found = xml_is(child, "include") ? child : include_find_first(child);
    }
    return found;
}

enum error_code mjcf_expand_includes(const struct mjcf_reader *r)
{
    const xmlNode *first = include_find_first(r->file->root);
    struct includer *in;
    enum error_code code;

    if (!first) {
        return ERROR_NONE;
    }
    in = arena_alloc(r->arena, 1, sizeof *in);
    if (!in) {
        return mjcf_no_memory(r);
    }
    in->reader = r;
    if (!r->packages || !import_find_folder(r->file->name, in->inside)) {
        return import_error(r->error, r->file->name, xml_line(first),
                            "found <include> in a text without a folder, expected plain bodies");
    }
    in->bytes = r->file->size;
    code = include_note(in, r->file, first, r->file->name);
    return code ? code : include_expand(in, r->file, in->inside, r->file->root, 0);
}
