/* SPDX-License-Identifier: Apache-2.0 */
/* The store of parsed files: a linked list, because a rig has only a few files. */
#include "base/yaml_tree.h"

#include <string.h>

#define STORE_MEMORY ((size_t)256 << 20) /* bytes of address space */

/* A file and the tree that it was parsed into, all in the store's arena. */
struct stored_file {
    struct stored_file *next;
    const char *text;
    size_t size, count; /* bytes; nodes */
    struct yaml_node *root;
};

static struct {
    int users; /* open while there are any */
    struct arena arena;
    struct stored_file *first;
} yaml_store;

enum error_code yaml_store_open(struct error *error)
{
    if (yaml_store.users++ > 0) {
        return ERROR_NONE;
    }
    yaml_store.first = NULL;
    return arena_init(&yaml_store.arena, STORE_MEMORY, error);
}

void yaml_store_close(void)
{
    if (yaml_store.users > 0 && --yaml_store.users == 0) {
        arena_fini(&yaml_store.arena);
    }
}

/* Copies a node, its children and its successors to *to, which advances; marks get the name of the
 * file. Does not copy texts. */
static struct yaml_node *yaml_copy_nodes(const struct yaml_node *from, const char *file,
                                         struct yaml_node **to)
{
    struct yaml_node *first = NULL, **link = &first;

    for (; from; from = from->next) {
        struct yaml_node *copy = (*to)++;

        *copy = *from;
        copy->mark.file = file;
        copy->first = yaml_copy_nodes(from->first, file, to);
        *link = copy;
        link = &copy->next;
    }
    return first;
}

bool yaml_store_find(struct yaml_reader *r, const char *text, size_t size, struct yaml_node **root)
{
    const struct stored_file *at = yaml_store.users > 0 ? yaml_store.first : NULL;
    struct yaml_node *nodes;

    while (at && (at->size != size || memcmp(at->text, text, size) != 0)) {
        at = at->next;
    }
    if (!at || r->nodes + at->count > YAML_MAX_NODES) {
        return false;
    }
    nodes = arena_alloc(&r->scratch, at->count, sizeof *nodes);
    if (!nodes) {
        return false;
    }
    r->nodes += at->count;
    *root = yaml_copy_nodes(at->root, r->file, &nodes);
    return true;
}

void yaml_store_add(const char *text, size_t size, const struct yaml_node *root, size_t count)
{
    struct stored_file *file;
    struct yaml_node *nodes, *end;
    char *copy;

    if (yaml_store.users == 0) {
        return;
    }
    file = arena_alloc(&yaml_store.arena, 1, sizeof *file);
    copy = arena_alloc(&yaml_store.arena, size, 1);
    end = nodes = arena_alloc(&yaml_store.arena, count, sizeof *nodes);
    if (!file || !copy || !nodes) {
        return; /* if the store is full, the file is parsed again next time */
    }
    memcpy(copy, text, size);
    *file = (struct stored_file){.next = yaml_store.first,
                                 .text = copy,
                                 .size = size,
                                 .count = count,
                                 .root = yaml_copy_nodes(root, NULL, &end)};

    /* Copy the texts of scalars, which belong to the reader */
    for (struct yaml_node *node = nodes; node < end; node++) {
        if (node->text && !(node->text = arena_strdup(&yaml_store.arena, node->text))) {
            return;
        }
    }
    yaml_store.first = file;
}
