/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads XML files from strangers through libxml2 with everything off that reaches beyond the file:
 * network, document types, entities. Bounded in bytes, depth, attributes of an element and
 * namespaces. Text is UTF-8, or else Latin-1, whatever the file says of its encoding. Numbers are
 * read strictly; every error says file:line. Not RT-safe.
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
    struct error *error; /* that it was opened with, where errors of its numbers go */
    size_t size;         /* bytes of text */
};

/* Reads a regular file; xml_file_close frees the document. Messages name the file by path. */
enum error_code xml_file_open(struct xml_file *file, const char *path, struct arena *arena,
                              struct error *error);

/* Reads a document from memory. */
enum error_code xml_text_open(struct xml_file *file, const char *name, const char *text,
                              size_t size, struct error *error);
void xml_file_close(struct xml_file *file);

/* Return the line of a node, and its file: that of the document, or the one that xml_insert_file
 * took it from. */
int xml_line(const xmlNode *node);
const char *xml_name(const struct xml_file *file, const xmlNode *node);

/* Inserts copies of all elements in the root of another document before a node. They keep that
 * document's name. */
enum error_code xml_insert_file(const struct xml_file *file, xmlNode *before,
                                const struct xml_file *other, struct error *error);

/* Removes a node, with all that is in it, from its document. */
void xml_remove(xmlNode *node);

/* Checks whether a node is an element of that name without a foreign prefix. */
bool xml_is(const xmlNode *node, const char *name);

/* Returns the node after one in a walk through all that is in root, parents first; NULL at the
 * end. */
const xmlNode *xml_walk(const xmlNode *at, const xmlNode *root);

/* Refuses a robot file of more elements than any robot needs: some work looks through many of them
 * for each. */
enum error_code xml_check_elements(const struct xml_file *file, struct error *error);

/* Return the first child, or the next sibling, that is an element of that name (NULL: any); NULL =
 * none. */
xmlNode *xml_child(const xmlNode *node, const char *name);
xmlNode *xml_next(const xmlNode *node, const char *name);

/* Return the text of an attribute, NULL when it is missing, and of an element; both belong to the
 * document. */
const char *xml_attribute(const xmlNode *node, const char *name);
const char *xml_content(const xmlNode *node);

/* Finds the text of an attribute that must be there and not empty. */
enum error_code xml_need(const struct xml_file *file, const xmlNode *node, const char *name,
                         const char **text);

/* Parses exactly count numbers, divided by blanks, in text of the node; what names it in
 * messages. */
enum error_code xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                                const char *text, size_t count, double *value);

/* Reads the numbers of an attribute; leaves them alone, and sets *given to false, when it is
 * missing. given may be NULL. */
enum error_code xml_reals(const struct xml_file *file, const xmlNode *node, const char *name,
                          size_t count, double *value, bool *given);

/* Reads a number that must be there. */
enum error_code xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name,
                              double *value);

#endif
