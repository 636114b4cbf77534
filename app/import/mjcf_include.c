/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Expands MJCF <include> elements before other steps. It replaces each one by the content of its
 * file's root. A file name is relative to the including file, else to the main file. Each file is
 * included only once, so a file cannot include itself. The total size is limited.
 */
#include "app/import/readers_private.h"
#include "app/import/path.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { INCLUDES_MAX = 256, INCLUDE_DEPTH_MAX = 16 };

/* A running expansion. */
struct includer {
    const struct import_reader *reader;
    char inside[PATH_MAX]; /* folder of the main file */
    const char *seen[INCLUDES_MAX];
    size_t nseen, bytes;
};

/* Finds the path of an included file: in the folder of the including file, else, like MuJoCo, in
 * the folder of the main file. */
static bool include_find(const struct includer *in, const struct xml_file *file,
                         const xmlNode *node, const char *folder, char path[PATH_MAX])
{
    const struct import_reader *r = in->reader;
    const char *name = xml_need(file, node, "file");
    enum import_path where =
        import_resolve_path(in->inside, folder, name, r->packages->trust, path);

    if (where == IMPORT_PATH_MISSING) {
        where = import_resolve_path(in->inside, in->inside, name, r->packages->trust, path);
    }
    if (where == IMPORT_PATH_OUTSIDE) {
        xml_refuse(file, node,
                   "found the include of \"%.200s\", which is outside the folder of %.200s, "
                   "expected one in it: give --trust if you trust whoever wrote it",
                   name, r->file->name);
    } else if (where == IMPORT_PATH_MISSING) {
        xml_refuse(file, node, "found no file \"%.200s\" to include beside %.200s", name,
                   file->name);
    }
    return where == IMPORT_PATH_FOUND;
}

/* Records a file as read. Refuses a file that was read before, by its path without symbolic
 * links. */
static void include_note(struct includer *in, const struct xml_file *file, const xmlNode *node,
                         const char *path)
{
    char real[PATH_MAX];

    if (!realpath(path, real)) {
        error_set_file(file->error, errno, path, "cannot be read");
        return;
    }
    for (size_t i = 0; i < in->nseen; i++) {
        if (!strcmp(in->seen[i], real)) {
            xml_refuse(file, node,
                       "found the include of \"%.200s\", which was read before, expected each file "
                       "once",
                       path);
        }
    }
    if (in->nseen == INCLUDES_MAX) {
        xml_refuse(file, node, "found more than %d files, expected fewer", INCLUDES_MAX);
        return;
    }
    in->seen[in->nseen++] = reader_copy(in->reader, real);
}

/* Expands the includes among the descendants of an element. */
static void include_expand(struct includer *in, const struct xml_file *file, const char *folder,
                           xmlNode *parent, int depth);

/* Replaces an <include> by the content of its file, after the includes in that file. */
static void include_replace(struct includer *in, const struct xml_file *file, const char *folder,
                            xmlNode *node, int depth)
{
    const struct import_reader *r = in->reader;
    char path[PATH_MAX], beside[PATH_MAX];
    struct xml_file other;

    if (depth >= INCLUDE_DEPTH_MAX) {
        xml_refuse(file, node, "found includes more than %d deep, expected fewer",
                   INCLUDE_DEPTH_MAX);
    }
    if (r->error->code || !include_find(in, file, node, folder, path)) {
        return;
    }
    include_note(in, file, node, path);
    if (r->error->code || xml_file_open(&other, path, r->arena, r->error)) {
        return;
    }

    /* Limit the total size, because many small includes could make a huge document */
    in->bytes += other.size;
    if (in->bytes > XML_FILE_MAX) {
        xml_refuse(file, node, "found %zu bytes in all files, expected at most %d", in->bytes,
                   XML_FILE_MAX);
    } else if (!import_find_folder(path, beside)) {
        error_set_file(r->error, errno, path, "cannot be read");
    } else {
        /* Expand the file's own includes first, so that none is inserted */
        include_expand(in, &other, beside, other.root, depth + 1);
        xml_insert_file(file, node, &other);
    }
    xml_file_close(&other);
    xml_remove(node);
}

static void include_expand(struct includer *in, const struct xml_file *file, const char *folder,
                           xmlNode *parent, int depth)
{
    xmlNode *next;

    for (xmlNode *child = xml_child(parent, NULL); child && !in->reader->error->code;
         child = next) {
        next = xml_next(child, NULL);
        if (xml_is(child, "include")) {
            include_replace(in, file, folder, child, depth);
        } else {
            include_expand(in, file, folder, child, depth);
        }
    }
}

void mjcf_expand_includes(const struct import_reader *r)
{
    const xmlNode *first = r->file->root;
    struct includer *in;

    while (first && !xml_is(first, "include")) {
        first = xml_walk(first, r->file->root);
    }
    if (!first) {
        return;
    }
    in = reader_alloc(r, 1, sizeof *in);
    if (!in || !r->packages || !import_find_folder(r->file->name, in->inside)) {
        xml_refuse(r->file, first,
                   "found <include> in a text without a folder, expected plain bodies");
        return;
    }
    in->reader = r;
    in->bytes = r->file->size;
    include_note(in, r->file, first, r->file->name);
    include_expand(in, r->file, in->inside, r->file->root, 0);
}
