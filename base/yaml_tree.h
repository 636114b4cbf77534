/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to base: a YAML document as a tree of nodes with marks, before a schema is applied to it,
 * and how messages describe a node. Not RT-safe.
 */
#ifndef BASE_YAML_TREE_H
#define BASE_YAML_TREE_H

#include "base/yaml.h"

#include <stdint.h>

enum {
    YAML_MAX_FILE = 4 << 20,      /* bytes */
    YAML_MAX_NODES = 200000,      /* values in a file and all that it extends */
    YAML_SHOWN = 48,              /* bytes of a value shown in a message */
    YAML_FOUND = YAML_SHOWN + 32, /* of what yaml_found writes */
};

enum yaml_kind { YAML_KIND_SCALAR, YAML_KIND_LIST, YAML_KIND_MAP };

/* A value of the document. The children of a mapping are key, value, key, value... */
struct yaml_node {
    enum yaml_kind kind;
    bool quoted; /* of a scalar: text whatever it looks like */
    struct yaml_mark mark;
    const char *text;
    size_t count; /* entries of a list, keys of a mapping */
    struct yaml_node *first, *next;
};

struct yaml_reader {
    struct arena *arena;  /* the caller's: what the structs point to */
    struct arena scratch; /* the nodes: gone after the read */
    const char *file;
    bool store; /* takes from the store, and adds to it, what is parsed */
    size_t nodes;
    uint64_t hash; /* of all that was read */
    void *parser;  /* libyaml's, while the document is read */
    struct error *error;
};

/* Reads the document of size bytes into nodes in reader->scratch. Refuses what is no UTF-8 text and
 * what a configuration does not need: anchors, aliases, tags, further documents, duplicate keys,
 * depth and numbers of values without bounds. */
enum error_code yaml_tree_read(struct yaml_reader *reader, const char *text, size_t size,
                               struct yaml_node **root);

/* The same for a file of that name (kept in reader->arena) and, when the schema is of an extendable
 * one, all files that it extends, merged: see yaml_read_file. */
enum error_code yaml_document_read(struct yaml_reader *reader, const char *name, const char *text,
                                   size_t size, const struct yaml_schema *schema,
                                   struct yaml_node **root);

/* Find a text's tree in the store, as copied nodes in reader->scratch, and add one. False: it is
 * not there, or does not fit. count: of the tree's nodes. */
bool yaml_store_find(struct yaml_reader *reader, const char *text, size_t size,
                     struct yaml_node **root);
void yaml_store_add(const char *text, size_t size, const struct yaml_node *root, size_t count);

/* Finds the field of a key; NULL = there is none, or no schema. */
const struct yaml_field *yaml_find_field(const struct yaml_schema *schema, const char *key);

/* Check what a plain scalar is. Quoted ones are text, whatever they look like. */
bool yaml_is_null(const struct yaml_node *node);
bool yaml_is_bool(const struct yaml_node *node);
bool yaml_is_number(const struct yaml_node *node);

/* Writes text on one line and of bounded length; returns out. */
const char *yaml_shown(const char *text, char out[YAML_SHOWN + 4]);

/* Writes what a node is, as the subject of "found ..."; returns out. */
const char *yaml_found(const struct yaml_node *node, char out[YAML_FOUND]);

/* Sets "found <node>, expected <expected>" with the node's place. */
enum error_code yaml_unexpected(struct yaml_reader *reader, const struct yaml_node *node,
                                const char *expected);

enum error_code yaml_no_memory(struct yaml_reader *reader);

#endif
