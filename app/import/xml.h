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
enum error_code xml_insert_file(const struct xml_file *file, xmlNode *before,
                                const struct xml_file *other, struct error *error);

/* Removes a node with its subtree from its document. */
void xml_remove(xmlNode *node);

/* Checks whether a node is an element with this name without a foreign prefix. */
bool xml_is(const xmlNode *node, const char *name);

/* Returns the next node in a walk through root's subtree, parents first; NULL at the end. */
const xmlNode *xml_walk(const xmlNode *at, const xmlNode *root);

/* Refuses a robot file with more elements than any robot needs, because some work grows with the
 * square of their number. */
enum error_code xml_check_elements(const struct xml_file *file, struct error *error);

/* Return the first child element, or the next sibling element, with this name (NULL: any); NULL =
 * none. */
xmlNode *xml_child(const xmlNode *node, const char *name);
xmlNode *xml_next(const xmlNode *node, const char *name);

/* Return the text of an attribute (NULL if it is missing) or of an element; the document owns
 * both. */
const char *xml_attribute(const xmlNode *node, const char *name);
const char *xml_content(const xmlNode *node);

/* Finds the text of an attribute that must exist and not be empty. */
enum error_code xml_need(const struct xml_file *file, const xmlNode *node, const char *name,
                         const char **text);

/* Parses exactly count numbers, separated by blanks, in a text of the node; `what` names them in
 * messages. */
enum error_code xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                                const char *text, size_t count, double *value);

/* Reads the numbers of an attribute. If it is missing, leaves them unchanged and sets *given to
 * false. given may be NULL. */
enum error_code xml_reals(const struct xml_file *file, const xmlNode *node, const char *name,
                          size_t count, double *value, bool *given);

/* Reads a number that must exist. */
enum error_code xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name,
                              double *value);

#endif
