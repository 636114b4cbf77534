/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to base: a YAML document as a tree of nodes with places, before a schema is applied. Also
 * describes nodes in messages. Not RT-safe.
 */
#ifndef BASE_YAML_TREE_H
#define BASE_YAML_TREE_H

#include "base/yaml.h"

#include <stdint.h>

enum {
    YAML_MAX_FILE = 4 << 20,      /* largest file, bytes */
    YAML_MAX_NODES = 200000,      /* most values in a file and its base files together */
    YAML_SHOWN = 48,              /* most bytes of a value in a message */
    YAML_FOUND = YAML_SHOWN + 32, /* size of the buffer for yaml_found, bytes */
};

enum yaml_kind { YAML_KIND_SCALAR, YAML_KIND_LIST, YAML_KIND_MAP };

/* A value of the document. Children of a mapping alternate: key, value, key, value, and so on. */
struct yaml_node {
    enum yaml_kind kind;
    bool quoted; /* a scalar in quotes is always a text */
    struct yaml_mark mark;
    const char *text;
    size_t count; /* number of entries of a list or mapping */
    struct yaml_node *first, *next;
};

struct yaml_reader {
    struct arena *arena;  /* the caller's arena for results */
    struct arena scratch; /* arena of the nodes, freed after the read */
    const char *file;
    bool quoted_values; /* copy of schema->quoted_values */
    size_t nodes;
    uint64_t hash;            /* hash of all texts that were read */
    struct yaml_old_key *old; /* keys that have an old name */
    void *parser;             /* libyaml's parser during the read */
    struct error *error;
};

/* Builds the nodes of a document of `size` bytes in reader->scratch. Refuses text that is not
 * UTF-8, anchors, aliases, tags, several documents and duplicate keys. Also limits the number and
 * the depth of values. */
enum error_code yaml_tree_read(struct yaml_reader *reader, const char *text, size_t size,
                               struct yaml_node **root);

/* Does the same as yaml_tree_read for the file `name`, and keeps this name in reader->arena. If the
 * schema is extendable, merges all base files (yaml_read_file). Callers pass NULL for `by`. */
struct yaml_chain;
enum error_code yaml_document_read(struct yaml_reader *reader, const char *name, const char *text,
                                   size_t size, const struct yaml_schema *schema,
                                   const struct yaml_chain *by, struct yaml_node **root);

/* Finds the field of a key. Returns NULL for an unknown key, or without a schema. */
const struct yaml_field *yaml_find_field(const struct yaml_schema *schema, const char *key);

/* Check the type of a plain scalar. A quoted scalar is always a text. */
bool yaml_is_null(const struct yaml_node *node);
bool yaml_is_bool(const struct yaml_node *node);
bool yaml_is_number(const struct yaml_node *node);

/* Writes text on one line with a limited length. Returns `out`. */
const char *yaml_shown(const char *text, char out[YAML_SHOWN + 4]);

/* Writes the description of a node for "found ...". Returns `out`. */
const char *yaml_found(const struct yaml_node *node, char out[YAML_FOUND]);

/* Sets the error "found NODE, expected EXPECTED" with the place of the node. */
enum error_code yaml_unexpected(struct yaml_reader *reader, const struct yaml_node *node,
                                const char *expected);

enum error_code yaml_no_memory(struct yaml_reader *reader);

#endif
