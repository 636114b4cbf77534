/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads untrusted XML files through libxml2, with all features disabled that reach beyond the file:
 * network, document types, entities. Limited in bytes, depth, attributes per element and
 * namespaces. Text is UTF-8, or else Latin-1, independent of the declared encoding. Numbers are
 * parsed strictly; each error has file:line. Not RT-safe.
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
    XML_ATTRIBUTES_MAX = 256, /* of one element */
    XML_NAMESPACES_MAX = 256, /* declared in the file */
    XML_ELEMENTS_MAX = 65536, /* of a robot file, see xml_check_elements */
};

/* An open document. */
struct xml_file {
    const char *name; /* in the arena */
    xmlDoc *document;
    xmlNode *root;
    struct error *error; /* error given at opening, for errors of its numbers */
    size_t size;         /* bytes of text */
};

/* Reads a regular file; xml_file_close frees the document. Messages name the file by path. */
enum error_code xml_file_open(struct xml_file *file, const char *path, struct arena *arena,
                              struct error *error);

/* Reads a document from memory. */
enum error_code xml_text_open(struct xml_file *file, const char *name, const char *text,
                              size_t size, struct error *error);
void xml_file_close(struct xml_file *file);

/* xml_line returns the line of a node; xml_name returns its file: the document's, or the one from
 * which xml_insert_file took it. */
int xml_line(const xmlNode *node);
const char *xml_name(const struct xml_file *file, const xmlNode *node);

/* Inserts copies of all elements in the root of another document before a node. The copies keep
 * the other document's name. */
void xml_insert_file(const struct xml_file *file, xmlNode *before, const struct xml_file *other);

/* Removes a node with its subtree from its document. */
void xml_remove(xmlNode *node);

/* Checks whether a node is an element with this name without a foreign prefix. */
bool xml_is(const xmlNode *node, const char *name);

/* Returns the next node in a walk through root's subtree, parents first; NULL at the end. */
const xmlNode *xml_walk(const xmlNode *at, const xmlNode *root);

/* Counts the elements with this name (NULL: any) in root's subtree. */
size_t xml_count(const xmlNode *root, const char *name);

/* Refuses a robot file with more elements than any robot needs, because some work grows with the
 * square of their number. */
void xml_check_elements(const struct xml_file *file);

/* Return the first child element, or the next sibling element, with this name (NULL: any); NULL =
 * none. */
xmlNode *xml_child(const xmlNode *node, const char *name);
xmlNode *xml_next(const xmlNode *node, const char *name);

/* Return the text of an attribute (NULL if it is missing) or of an element; the document owns
 * both. */
const char *xml_attribute(const xmlNode *node, const char *name);
const char *xml_content(const xmlNode *node);

/* ---- values ---- */

/* Reports an error "file:line: ..." at a node. The first error of a file stays: readers may go on
 * and are asked for file->error->code at the end of a step. */
void xml_refuse(const struct xml_file *file, const xmlNode *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Returns the text of an attribute that must exist and not be empty; "" with an error. */
const char *xml_need(const struct xml_file *file, const xmlNode *node, const char *name);

/* Parses exactly count numbers, separated by blanks, in a text of the node; `what` names them in
 * messages. With an error the values are 0. */
void xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                     const char *text, size_t count, double *value);

/* Parses numbers in the same way; returns false without an error if there are others. */
bool xml_try_reals(const char *text, size_t count, double *value);

/* Reads the numbers of an attribute. Returns false if it is missing, which leaves them
 * unchanged. */
bool xml_reals(const struct xml_file *file, const xmlNode *node, const char *name, size_t count,
               double *value);

/* Returns a number that must exist; 0 with an error. */
double xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name);

/* ---- names ---- */

/* A name of an element. */
struct xml_name {
    const char *name, *above; /* for a class: above is the enclosing class, NULL = none */
    const xmlNode *node;
    size_t number; /* order in the file */
};

/* Names, after sorting by name, then by the kind of element, then as in the file. */
struct xml_names {
    struct xml_name *entry;
    size_t count, capacity;
};

/* Adds a name, which must live as long as the list. */
void xml_names_add(struct xml_names *names, const char *name, const char *above,
                   const xmlNode *node, struct arena *arena, struct error *error);
void xml_names_sort(struct xml_names *names);

/* Returns the first entry with a name, of a kind of element (NULL: any); the following entries may
 * have the same name. NULL = none. */
const struct xml_name *xml_names_find(const struct xml_names *names, const char *name,
                                      const char *kind);

#endif
