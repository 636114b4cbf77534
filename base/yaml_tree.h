/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to base: a YAML document as a tree of nodes with places, before a schema is applied, and
 * the description of a node in messages. Not RT-safe.
 */
#ifndef BASE_YAML_TREE_H
#define BASE_YAML_TREE_H

#include "base/yaml.h"

#include <stdint.h>

enum {
    YAML_MAX_FILE = 4 << 20,      /* bytes */
    YAML_MAX_NODES = 200000,      /* values in a file and all files that it extends */
    YAML_SHOWN = 48,              /* bytes of a value shown in a message */
    YAML_FOUND = YAML_SHOWN + 32, /* buffer of yaml_found */
};

enum yaml_kind { YAML_KIND_SCALAR, YAML_KIND_LIST, YAML_KIND_MAP };

/* A value of the document. The children of a mapping alternate: key, value, key, value... */
struct yaml_node {
    enum yaml_kind kind;
    bool quoted; /* of a scalar: always a text */
    struct yaml_mark mark;
    const char *text;
    size_t count; /* number of entries of a list, or of keys of a mapping */
    struct yaml_node *first, *next;
};

struct yaml_reader {
    struct arena *arena;  /* the caller's arena, for the results */
    struct arena scratch; /* nodes, freed after the read */
    const char *file;
    bool quoted_values; /* as in the schema */
    size_t nodes;
    uint64_t hash;            /* hash of all texts read */
    struct yaml_old_key *old; /* keys with an old name */
    void *parser;             /* parser of libyaml during the read */
    struct error *error;
};

/* Reads the document of size bytes into nodes in reader->scratch. Refuses text that is not UTF-8,
 * anchors, aliases, tags, further documents, duplicate keys, and too many or too deep values. */
enum error_code yaml_tree_read(struct yaml_reader *reader, const char *text, size_t size,
                               struct yaml_node **root);

/* Does the same for a file of this name (kept in reader->arena). If the schema is extendable,
 * merges all files that it extends: see yaml_read_file. by: NULL. */
struct yaml_chain;
enum error_code yaml_document_read(struct yaml_reader *reader, const char *name, const char *text,
                                   size_t size, const struct yaml_schema *schema,
                                   const struct yaml_chain *by, struct yaml_node **root);

/* Finds the field of a key; NULL = unknown key, or no schema. */
const struct yaml_field *yaml_find_field(const struct yaml_schema *schema, const char *key);

/* Check the type of a plain scalar. Quoted scalars are always texts. */
bool yaml_is_null(const struct yaml_node *node);
bool yaml_is_bool(const struct yaml_node *node);
bool yaml_is_number(const struct yaml_node *node);

/* Writes text on one line with a limited length; returns out. */
const char *yaml_shown(const char *text, char out[YAML_SHOWN + 4]);

/* Writes a description of a node for "found ..."; returns out. */
const char *yaml_found(const struct yaml_node *node, char out[YAML_FOUND]);

/* Sets "found <node>, expected <expected>" with the node's place. */
enum error_code yaml_unexpected(struct yaml_reader *reader, const struct yaml_node *node,
                                const char *expected);

enum error_code yaml_no_memory(struct yaml_reader *reader);

#endif
