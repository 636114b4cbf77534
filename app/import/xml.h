/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads untrusted XML files with libxml2. All features that reach beyond the file are disabled:
 * network, document types, entities. Bytes, depth, attributes per element and namespaces are
 * limited. Text is UTF-8, else Latin-1; the declared encoding is ignored. Numbers are parsed
 * strictly. Each error has file:line. Not RT-safe.
 */
#ifndef APP_IMPORT_XML_H
#define APP_IMPORT_XML_H

#include "base/arena.h"
#include "base/error.h"

#include <libxml/tree.h>
#include <stdbool.h>
#include <stddef.h>

enum {
    XML_FILE_MAX = 64 << 20,  /* bytes */
    XML_ATTRIBUTES_MAX = 256, /* per element */
    XML_NAMESPACES_MAX = 256, /* per file */
    XML_ELEMENTS_MAX = 65536, /* per robot file, see xml_check_elements */
};

/* An open document. */
struct xml_file {
    const char *name; /* owned by the arena */
    xmlDoc *document;
    xmlNode *root;
    struct error *error; /* given at opening; receives the errors of later reads */
    size_t size;         /* size of the text */
};

/* Opens and parses a regular file. Messages name the file by path. xml_file_close frees the
 * document. */
enum error_code xml_file_open(struct xml_file *file, const char *path, struct arena *arena,
                              struct error *error);

/* Parses a document from memory. */
enum error_code xml_text_open(struct xml_file *file, const char *name, const char *text,
                              size_t size, struct error *error);
void xml_file_close(struct xml_file *file);

/* xml_line returns the line of a node. xml_name returns its file: the document, or the file from
 * which xml_insert_file copied the node. */
int xml_line(const xmlNode *node);
const char *xml_name(const struct xml_file *file, const xmlNode *node);

/* Inserts copies of all elements in the root of another document before a node. The copies keep the
 * name of the other document. */
void xml_insert_file(const struct xml_file *file, xmlNode *before, const struct xml_file *other);

/* Removes a node with its subtree from its document. */
void xml_remove(xmlNode *node);

/* Checks whether a node is an element with this name without a foreign prefix. */
bool xml_is(const xmlNode *node, const char *name);

/* Returns the next node in a walk through root's subtree, parents first; NULL at the end. */
const xmlNode *xml_walk(const xmlNode *at, const xmlNode *root);

/* Counts the elements with this name (NULL: any) in root's subtree. */
size_t xml_count(const xmlNode *root, const char *name);

/* Refuses a robot file with more elements than any robot needs, because the time of some steps
 * grows with the square of their number. */
void xml_check_elements(const struct xml_file *file);

/* Return the first child element, or the next sibling element, with this name (NULL: any). Return
 * NULL if there is none. */
xmlNode *xml_child(const xmlNode *node, const char *name);
xmlNode *xml_next(const xmlNode *node, const char *name);

/* Return the text of an attribute (NULL if it is missing) or of an element. The document owns
 * both. */
const char *xml_attribute(const xmlNode *node, const char *name);
const char *xml_content(const xmlNode *node);

/* ---- values ---- */

/* Sets an error "file:line: ..." at a node. The file keeps its first error: readers may continue,
 * and check file->error->code at the end of a step. */
void xml_refuse(const struct xml_file *file, const xmlNode *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Returns the text of an attribute that must exist and not be empty. On an error returns "". */
const char *xml_need(const struct xml_file *file, const xmlNode *node, const char *name);

/* Parses exactly count numbers, separated by blanks, in a text of the node. `what` names the
 * numbers in messages. On an error the values are 0. */
void xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                     const char *text, size_t count, double *value);

/* Parses numbers as xml_parse_reals does, but returns false without an error if the text is
 * invalid. */
bool xml_try_reals(const char *text, size_t count, double *value);

/* Reads the numbers of an attribute. If it is missing, returns false and leaves the values
 * unchanged. */
bool xml_reals(const struct xml_file *file, const xmlNode *node, const char *name, size_t count,
               double *value);

/* Returns the number in an attribute that must exist. On an error returns 0. */
double xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name);

/* ---- names ---- */

/* The name of an element. */
struct xml_name {
    const char *name, *above; /* for a class: name of the enclosing class, NULL = none */
    const xmlNode *node;
    size_t number; /* order in the file */
};

/* A list of names, sorted by name, then by kind of element, then in file order. */
struct xml_names {
    struct xml_name *entry;
    size_t count, capacity;
};

/* Adds a name. Its text must live as long as the list. */
void xml_names_add(struct xml_names *names, const char *name, const char *above,
                   const xmlNode *node, struct arena *arena, struct error *error);
void xml_names_sort(struct xml_names *names);

/* Returns the first entry with this name and kind of element (NULL: any), or NULL if there is none.
 * The following entries may have the same name. */
const struct xml_name *xml_names_find(const struct xml_names *names, const char *name,
                                      const char *kind);

#endif
