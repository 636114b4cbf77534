/* SPDX-License-Identifier: Apache-2.0 */
/* Functions common to all readers of robot files. */
#include "app/import/readers_private.h"

#include "base/text.h"

#include <string.h>

/* Limit in both directions for a prismatic joint without limits, m. */
#define SLIDE_MAX_M 100.0

void reader_note(const struct import_reader *r, enum import_fate fate, const xmlNode *node,
                 const char *format, ...)
{
    char text[512];

    TEXT_FORMAT(text, format);
    import_note_add(r->notes, fate, xml_name(r->file, node), xml_line(node), "%s", text);
}

void *reader_alloc(const struct import_reader *r, size_t count, size_t size)
{
    void *memory = arena_alloc(r->arena, count, size);

    if (!memory) {
        error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this robot", r->file->name);
    }
    return memory;
}

const char *reader_copy(const struct import_reader *r, const char *text)
{
    char *copy = reader_alloc(r, strlen(text) + 1, 1);

    return copy ? strcpy(copy, text) : "";
}

const char *reader_format(const struct import_reader *r, const char *format, ...)
{
    char text[512];

    TEXT_FORMAT(text, format);
    return reader_copy(r, text);
}

const char *reader_text(const xmlNode *node, const char *name)
{
    const char *text = xml_attribute(node, name);

    return text ? text : "";
}

bool reader_is_one_of(const xmlNode *node, const char *const name[])
{
    while (*name && !xml_is(node, *name)) {
        name++;
    }
    return *name;
}

void reader_make_room(const struct import_reader *r, size_t links, size_t joints, size_t shapes,
                      size_t sensors)
{
    struct import_model *model = r->model;

    model->link = reader_alloc(r, links + 1, sizeof *model->link);
    model->joint = reader_alloc(r, joints + 1, sizeof *model->joint);
    model->geometry = reader_alloc(r, shapes + 1, sizeof *model->geometry);
    model->sensor = reader_alloc(r, sensors + 1, sizeof *model->sensor);
}

void reader_check_names(const struct import_reader *r, const char *what)
{
    const struct import_model *model = r->model;

    /* The search finds the first entry with a name, so another index means a duplicate */
    for (size_t i = 0; i < model->nlink; i++) {
        const struct import_link *link = &model->link[i];
        const int first = import_find_link(model, link->name);

        if ((size_t)first != i) {
            import_error(r->error, link->file, link->line,
                         "found %s \"%.63s\" again, expected it once (line %d)", what, link->name,
                         model->link[first].line);
        }
    }
    for (size_t i = 0; i < model->njoint; i++) {
        const struct import_joint *joint = &model->joint[i];
        const int first = import_find_joint(model, joint->name);

        if ((size_t)first != i) {
            import_error(r->error, joint->file, joint->line,
                         "found joint \"%.63s\" again, expected it once (line %d)", joint->name,
                         model->joint[first].line);
        }
    }
}

void reader_free_limits(const struct import_reader *r, const xmlNode *node,
                        struct import_joint *joint)
{
    if (joint->has_limit) {
        return;
    }
    if (joint->type == IMPORT_REVOLUTE) {
        joint->type = IMPORT_CONTINUOUS;
    } else if (joint->type == IMPORT_PRISMATIC) {
        joint->has_limit = true;
        joint->lower = -SLIDE_MAX_M;
        joint->upper = SLIDE_MAX_M;
        reader_note(r, IMPORT_CHANGED, node,
                    "joint \"%.63s\" slides without limits: it has the range of %g m either way",
                    joint->name, SLIDE_MAX_M);
    }
}

/* ---- the report ---- */

void reader_skip(const struct import_reader *r, const xmlNode *node, const char *attribute)
{
    struct reader_unread *unread = r->unread;
    const char *element = (const char *)node->name;
    size_t i = 0;

    while (i < unread->count &&
           (strcmp(unread->kind[i].element, element) != 0 ||
            !unread->kind[i].attribute != !attribute ||
            (attribute && strcmp(unread->kind[i].attribute, attribute) != 0))) {
        i++;
    }
    if (i == READER_UNREAD_MAX) {
        i--;
    } else if (i == unread->count) {
        unread->kind[i].element = element;
        unread->kind[i].attribute = attribute;
        unread->kind[i].first = node;
        unread->count++;
    }
    unread->kind[i].places++;
}

void reader_report(const struct import_reader *r, const struct reader_row *rows)
{
    const xmlNode *root = r->file->root, *node = root;

    while (node && !r->error->code) {
        const struct reader_row *row = rows;
        const xmlNode *next = NULL;

        while (row->element && !xml_is(node, row->element)) {
            row++;
        }
        if (!row->element && node != root) {
            reader_skip(r, node, NULL);
        }
        for (const xmlAttr *at = node->properties; at && row->element && row->attributes;
             at = at->next) {
            const char *name = (const char *)at->name;

            if (!import_has_word("name class", ' ', name) &&
                !import_has_word(row->attributes, ' ', name)) {
                reader_skip(r, node, name);
            }
        }

        /* Go on below an element whose parts are read, else behind it */
        if (row->element && row->attributes) {
            next = xml_child(node, NULL);
        }
        for (; node != root && !next; node = node->parent) {
            next = xml_next(node, NULL);
        }
        node = next;
    }
    for (size_t i = 0; i < r->unread->count; i++) {
        const char *attribute = r->unread->kind[i].attribute;

        reader_note(r, IMPORT_DROPPED, r->unread->kind[i].first, "%s%.63s%s<%.63s>: not used (%zu)",
                    attribute ? "\"" : "", attribute ? attribute : "", attribute ? "\" of " : "",
                    r->unread->kind[i].element, r->unread->kind[i].places);
    }
}
