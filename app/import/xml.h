/* SPDX-License-Identifier: Apache-2.0 */
/*
 * XML files that strangers wrote, read through libxml2 with everything off that reaches beyond the
 * file: network, document types, entities. Bounded in bytes and depth. Numbers are read strictly;
 * every error says file:line. Not RT-safe.
 */
#ifndef APP_IMPORT_XML_H
#define APP_IMPORT_XML_H

#include "base/arena.h"
#include "base/error.h"

#include <libxml/tree.h>
#include <stdbool.h>
#include <stddef.h>

enum { XML_FILE_MAX = 64 << 20 }; /* bytes */

struct xml_file {
    const char *name; /* in the arena */
    xmlDoc *document;
    xmlNode *root;
};

/* Reads a regular file; the document is given back by xml_file_close. name in messages is path. */
enum error_code xml_file_open(struct xml_file *file, const char *path, struct arena *arena,
                              struct error *error);

/* The same from memory. */
enum error_code xml_text_open(struct xml_file *file, const char *name, const char *text,
                              size_t size, struct error *error);
void xml_file_close(struct xml_file *file);

/* The line that a node stands in. */
int xml_line(const xmlNode *node);

/* Whether a node is an element of that name without a foreign prefix. */
bool xml_is(const xmlNode *node, const char *name);

/* The first child, or the next sibling, that is an element (of that name; NULL: any). */
xmlNode *xml_child(const xmlNode *node, const char *name);
xmlNode *xml_next(const xmlNode *node, const char *name);

/* Text of an attribute, NULL when it is not there; of an element. The document's. */
const char *xml_attribute(const xmlNode *node, const char *name);
const char *xml_content(const xmlNode *node);

/* Text of an attribute that must be there and not empty. */
enum error_code xml_need(const struct xml_file *file, const xmlNode *node, const char *name,
                         const char **text, struct error *error);

/* Exactly count numbers divided by blanks, in text of the node; what stands in messages. */
enum error_code xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                                const char *text, size_t count, double *value, struct error *error);

/* The numbers of an attribute; left alone, and *given false, when it is not there. given may be
 * NULL. */
enum error_code xml_reals(const struct xml_file *file, const xmlNode *node, const char *name,
                          size_t count, double *value, bool *given, struct error *error);

/* A number that must be there. */
enum error_code xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name,
                              double *value, struct error *error);

#endif
