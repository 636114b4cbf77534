/* SPDX-License-Identifier: Apache-2.0 */
/* Reads XML safely, see xml.h. */
#include "app/import/xml.h"

#include "app/import/model.h"
#include "base/input_file.h"
#include "base/text.h"

#include <dlfcn.h>
#include <libxml/parser.h>
#include <libxml/parserInternals.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NUMBER_MAX = 64 }; /* largest number of characters in a number */

/* ---- libxml2 ---- */

/* The functions of libxml2 that are used. The library is loaded when a file is read, not at the
 * start of the program: it brings 40 MB of other libraries, which a program that only runs a rig
 * would have to load. */
#define XML_FUNCTIONS(DO)                                                                          \
    DO(xmlAddPrevSibling)                                                                          \
    DO(xmlCtxtReadMemory)                                                                          \
    DO(xmlDocCopyNode)                                                                             \
    DO(xmlDocGetRootElement)                                                                       \
    DO(xmlFreeDoc)                                                                                 \
    DO(xmlFreeNode)                                                                                \
    DO(xmlFreeParserCtxt)                                                                          \
    DO(xmlGetLineNo)                                                                               \
    DO(xmlHasProp)                                                                                 \
    DO(xmlInitParser)                                                                              \
    DO(xmlNewParserCtxt)                                                                           \
    DO(xmlSetGenericErrorFunc)                                                                     \
    DO(xmlStopParser)                                                                              \
    DO(xmlUnlinkNode)

#define XML_MEMBER(name) __typeof__(name) *name;
#define XML_FIND(name)                                                                             \
    *(void **)&library.name = dlsym(handle, #name);                                                \
    whole = whole && library.name;

static struct {
    XML_FUNCTIONS(XML_MEMBER)
} library;

/* Loads libxml2 once, and never unloads it. */
static enum error_code xml_load_library(struct error *error)
{
    void *handle;
    bool whole = true;

    if (library.xmlInitParser) {
        return ERROR_NONE;
    }
    handle = dlopen(XML_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        return error_set(error, ERROR_UNSUPPORTED, "XML: %.300s", dlerror());
    }
    XML_FUNCTIONS(XML_FIND)
    if (!whole) {
        memset(&library, 0, sizeof library);
        dlclose(handle);
        return error_set(error, ERROR_UNSUPPORTED, "XML: found another %s, expected libxml2",
                         XML_LIBRARY);
    }
    library.xmlInitParser();
    return ERROR_NONE;
}

/* ---- documents ---- */

/* Stops the parser at the start of a document type, before reading it. A document type could define
 * entities that grow without bounds, or name other files. */
static void xml_refuse_doctype(void *context, const xmlChar *name, const xmlChar *external,
                               const xmlChar *system)
{
    xmlParserCtxt *parser = context;

    (void)name;
    (void)external;
    (void)system;
    *(bool *)parser->_private = true;
    library.xmlStopParser(parser);
}

/* Discards libxml2's messages, which would go to stderr. */
static void xml_ignore_message(void *context, const char *format, ...)
{
    (void)context;
    (void)format;
}

/* Checks whether an '=' before text assigns a value to an attribute: a quote follows, after
 * blanks. */
static bool xml_begins_value(const char *text, const char *end)
{
    while (text < end && strchr(" \t\r\n", *text) && *text) {
        text++;
    }
    return text < end && (*text == '"' || *text == '\'');
}

/* Limits attributes and namespaces, because libxml2 needs quadratic time for them: it compares each
 * attribute of an element with all others, and each prefix with all namespaces in scope. It
 * examines bytes and ignores the grammar, so malformed text cannot hide a tag: each tag ends before
 * the next '<'. */
static enum error_code xml_check_bounds(const char *name, const char *text, size_t size,
                                        struct error *error)
{
    const char *end = text + size;
    size_t attributes = 0, namespaces = 0;
    int line = 1;

    for (const char *at = text; at < end; at++) {
        switch (*at) {
        /* Refuse a zero byte: some functions would end the text there and ignore the rest */
        case '\0':
            return import_error(error, name, line,
                                "found a byte 0, expected text in UTF-8: `iconv -t UTF-8` makes it "
                                "of UTF-16");
        case '\n':
            line++;
            break;
        /* A new tag: count its attributes from 0; namespaces add up */
        case '<':
            attributes = 0;
            break;
        case '=':
            attributes += xml_begins_value(at + 1, end);
            break;
        case 'x':
            namespaces += end - at >= 5 && !memcmp(at, "xmlns", 5);
            break;
        default:
            break;
        }
        if (attributes > XML_ATTRIBUTES_MAX || namespaces > XML_NAMESPACES_MAX) {
            return import_error(
                error, name, line, "found more than %d %s, expected fewer: no robot needs them",
                attributes > XML_ATTRIBUTES_MAX ? XML_ATTRIBUTES_MAX : XML_NAMESPACES_MAX,
                attributes > XML_ATTRIBUTES_MAX ? "attributes of one element"
                                                : "namespaces (xmlns)");
        }
    }
    return ERROR_NONE;
}

/* Chooses the encoding for a text: UTF-8 if it is valid, else Latin-1, and ignores the declaration.
 * Both represent ASCII as bytes, as xml_check_bounds assumes. */
static const char *xml_find_encoding(const char *text, size_t size)
{
    for (size_t at = 0, length; at < size; at += length) {
        length = (unsigned char)text[at] < 0x80 ? 1 : text_utf8_length(text + at, size - at);
        if (length == 0) {
            return "ISO-8859-1";
        }
    }
    return "UTF-8";
}

enum error_code xml_text_open(struct xml_file *file, const char *name, const char *text,
                              size_t size, struct error *error)
{
    const int options = XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING |
                        XML_PARSE_BIG_LINES | XML_PARSE_COMPACT | XML_PARSE_IGNORE_ENC;
    xmlParserCtxt *parser;
    bool doctype = false;
    enum error_code code;

    *file = (struct xml_file){.name = name, .error = error, .size = size};
    error->code = ERROR_NONE;
    if (size > XML_FILE_MAX) {
        return error_set(error, ERROR_INPUT, "%.200s: found %zu bytes, expected at most %d", name,
                         size, XML_FILE_MAX);
    }
    code = xml_check_bounds(name, text, size, error);
    code = code ? code : xml_load_library(error);
    if (code) {
        return code;
    }

    /* Parse without features that reach beyond the text; a document type stops the parser */
    library.xmlSetGenericErrorFunc(NULL, xml_ignore_message);
    parser = library.xmlNewParserCtxt();
    if (!parser) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", name);
    }
    parser->_private = &doctype;
    parser->sax->internalSubset = xml_refuse_doctype;
    file->document = library.xmlCtxtReadMemory(parser, text, (int)size, NULL,
                                               xml_find_encoding(text, size), options);
    file->root = file->document ? library.xmlDocGetRootElement(file->document) : NULL;
    if (doctype) {
        code = import_error(error, name, parser->input ? parser->input->line : 1,
                            "found a document type (DOCTYPE), expected none: it can define "
                            "entities and name other files");
    } else if (!file->root) {
        const xmlError *last = &parser->lastError;
        const char *reason = last->message ? last->message : "no element in it";

        code = import_error(error, name, last->line > 0 ? last->line : 1,
                            "found what is no well-formed XML (%.*s), expected an XML document",
                            (int)strcspn(reason, "\n"), reason);
    }
    library.xmlFreeParserCtxt(parser);
    if (code) {
        xml_file_close(file);
    }
    return code;
}

enum error_code xml_file_open(struct xml_file *file, const char *path, struct arena *arena,
                              struct error *error)
{
    char *text, *name = arena_strdup(arena, path);
    size_t size;
    enum error_code code = input_file_load(path, XML_FILE_MAX, &text, &size, error);

    *file = (struct xml_file){0};
    if (!code) {
        code = name ? xml_text_open(file, name, text, size, error)
                    : error_set(error, ERROR_MEMORY, "%.200s: no memory to read it", path);
    }
    free(text);
    return code;
}

void xml_file_close(struct xml_file *file)
{
    if (file->document) {
        library.xmlFreeDoc(file->document);
    }
    file->document = NULL;
    file->root = NULL;
}

/* ---- nodes ---- */

int xml_line(const xmlNode *node)
{
    return (int)library.xmlGetLineNo(node);
}

const char *xml_name(const struct xml_file *file, const xmlNode *node)
{
    return node->_private ? node->_private : file->name;
}

/* Marks a copy of an element, and all elements in it, with the file of the original. */
static void xml_mark_copy(const struct xml_file *file, const xmlNode *from, xmlNode *copy)
{
    const xmlNode *child = xml_child(from, NULL);
    xmlNode *own = xml_child(copy, NULL);

    copy->_private = from->_private ? from->_private : (void *)(uintptr_t)file->name;
    for (; child && own; child = xml_next(child, NULL), own = xml_next(own, NULL)) {
        xml_mark_copy(file, child, own);
    }
}

void xml_insert_file(const struct xml_file *file, xmlNode *before, const struct xml_file *other)
{
    for (xmlNode *node = xml_child(other->root, NULL); node; node = xml_next(node, NULL)) {
        xmlNode *copy = library.xmlDocCopyNode(node, file->document, 1);

        if (!copy || !library.xmlAddPrevSibling(before, copy)) {
            library.xmlFreeNode(copy);
            error_set(file->error, ERROR_MEMORY, "%.200s: no memory to read it", other->name);
            return;
        }
        xml_mark_copy(other, node, copy);
    }
}

void xml_remove(xmlNode *node)
{
    library.xmlUnlinkNode(node);
    library.xmlFreeNode(node);
}

bool xml_is(const xmlNode *node, const char *name)
{
    return node->type == XML_ELEMENT_NODE && !(node->ns && node->ns->prefix) &&
           strcmp((const char *)node->name, name) == 0;
}

const xmlNode *xml_walk(const xmlNode *at, const xmlNode *root)
{
    if (at->children) {
        return at->children;
    }
    while (at != root && !at->next) {
        at = at->parent;
    }
    return at == root ? NULL : at->next;
}

size_t xml_count(const xmlNode *root, const char *name)
{
    size_t count = 0;

    for (const xmlNode *at = root; at; at = xml_walk(at, root)) {
        count += name ? xml_is(at, name) : at->type == XML_ELEMENT_NODE;
    }
    return count;
}

void xml_check_elements(const struct xml_file *file)
{
    if (xml_count(file->root, NULL) > XML_ELEMENTS_MAX) {
        xml_refuse(file, file->root,
                   "found more than %d elements, expected fewer: leave out what is no robot",
                   XML_ELEMENTS_MAX);
    }
}

/* Returns the first element with this name (NULL: any) from a sibling on, or NULL. */
static xmlNode *xml_first_from(xmlNode *node, const char *name)
{
    while (node && (node->type != XML_ELEMENT_NODE || (name && !xml_is(node, name)))) {
        node = node->next;
    }
    return node;
}

xmlNode *xml_child(const xmlNode *node, const char *name)
{
    return xml_first_from(node->children, name);
}

xmlNode *xml_next(const xmlNode *node, const char *name)
{
    return xml_first_from(node->next, name);
}

/* Returns the first text among the nodes of a list; "" if there is none. */
static const char *xml_text_of(const xmlNode *first)
{
    while (first && first->type != XML_TEXT_NODE && first->type != XML_CDATA_SECTION_NODE) {
        first = first->next;
    }
    return first && first->content ? (const char *)first->content : "";
}

const char *xml_attribute(const xmlNode *node, const char *name)
{
    const xmlAttr *attribute = library.xmlHasProp(node, (const xmlChar *)name);

    return attribute ? xml_text_of(attribute->children) : NULL;
}

const char *xml_content(const xmlNode *node)
{
    return xml_text_of(node->children);
}

void xml_refuse(const struct xml_file *file, const xmlNode *node, const char *format, ...)
{
    char text[600];

    TEXT_FORMAT(text, format);
    import_error(file->error, xml_name(file, node), xml_line(node), "%s", text);
}

const char *xml_need(const struct xml_file *file, const xmlNode *node, const char *name)
{
    const char *text = xml_attribute(node, name);

    if (!text || !*text) {
        xml_refuse(file, node, "found <%.40s> without %s, expected the attribute \"%s\"",
                   (const char *)node->name, text ? "a text" : "it", name);
    }
    return text ? text : "";
}

/* ---- numbers ---- */

bool xml_try_reals(const char *text, size_t count, double *value)
{
    static const char blanks[] = " \t\r\n";
    char word[NUMBER_MAX];
    bool sound = true;

    for (size_t i = 0; i < count && sound; i++) {
        size_t length;

        text += strspn(text, blanks);
        length = strcspn(text, blanks);
        snprintf(word, sizeof word, "%.*s", (int)length, text);
        sound = length > 0 && length < sizeof word && text_to_double(word, &value[i]);
        text += length;
    }

    /* Refuse further numbers after the expected ones */
    return sound && text[strspn(text, blanks)] == '\0';
}

void xml_parse_reals(const struct xml_file *file, const xmlNode *node, const char *what,
                     const char *text, size_t count, double *value)
{
    if (xml_try_reals(text, count, value)) {
        return;
    }
    memset(value, 0, count * sizeof *value);

    /* "$" suggests an xacro file that has not been expanded */
    if (strchr(text, '$')) {
        xml_refuse(file, node,
                   "found %s \"%.48s\" of <%.40s>, which xacro has yet to compute: run `xacro FILE "
                   ">robot.urdf` and import that",
                   what, text, (const char *)node->name);
    } else {
        xml_refuse(file, node, "found %s \"%.48s\" of <%.40s>, expected %zu finite number%s", what,
                   text, (const char *)node->name, count, count == 1 ? "" : "s");
    }
}

bool xml_reals(const struct xml_file *file, const xmlNode *node, const char *name, size_t count,
               double *value)
{
    const char *text = xml_attribute(node, name);

    if (text) {
        xml_parse_reals(file, node, name, text, count, value);
    }
    return text != NULL;
}

double xml_need_real(const struct xml_file *file, const xmlNode *node, const char *name)
{
    const char *text = xml_need(file, node, name);
    double value = 0.0;

    xml_parse_reals(file, node, name, text, 1, &value);
    return value;
}

/* ---- names ---- */

void xml_names_add(struct xml_names *names, const char *name, const char *above,
                   const xmlNode *node, struct arena *arena, struct error *error)
{
    struct xml_name *entry =
        import_grow(arena, names->entry, names->count, &names->capacity, sizeof *names->entry);

    if (!entry) {
        error_set(error, ERROR_MEMORY, "no memory left for the names of a file");
        return;
    }
    entry[names->count] = (struct xml_name){name, above, node, names->count};
    names->entry = entry;
    names->count++;
}

/* Compares a name with a text, then its element with a kind. kind NULL = any. */
static int xml_compare_name(const struct xml_name *name, const char *text, const char *kind)
{
    int order = strcmp(name->name, text);

    return order || !kind ? order : strcmp((const char *)name->node->name, kind);
}

/* Orders names for qsort; equal names keep the order of the file. */
static int xml_compare_names(const void *a, const void *b)
{
    const struct xml_name *x = a, *y = b;
    int order = xml_compare_name(x, y->name, (const char *)y->node->name);

    return order ? order : (x->number > y->number) - (x->number < y->number);
}

void xml_names_sort(struct xml_names *names)
{
    if (names->count) {
        qsort(names->entry, names->count, sizeof *names->entry, xml_compare_names);
    }
}

const struct xml_name *xml_names_find(const struct xml_names *names, const char *name,
                                      const char *kind)
{
    size_t low = 0, high = names->count;

    while (low < high) {
        size_t middle = (low + high) / 2;

        if (xml_compare_name(&names->entry[middle], name, kind) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < names->count && !xml_compare_name(&names->entry[low], name, kind)
               ? &names->entry[low]
               : NULL;
}
