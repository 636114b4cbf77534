/* SPDX-License-Identifier: Apache-2.0 */
/* What the reader of COLLADA shares: mesh_collada.c walks the scene, collada_faces.c reads what
 * stands in it. */
#ifndef APP_IMPORT_COLLADA_PRIVATE_H
#define APP_IMPORT_COLLADA_PRIVATE_H

#include "app/import/mesh_private.h"
#include "app/import/xml.h"

struct collada_id {
    const char *id;
    const xmlNode *node;
    size_t number; /* in the file */
};

struct collada {
    struct mesh_reader *to;
    struct xml_file file;
    struct collada_id *id; /* sorted */
    size_t nid;
    bool counting;
    size_t vertices, faces; /* counted */
    size_t visited, work;
};

/* Where a node is: p -> R p + t. */
struct collada_place {
    double R[3][3], t[3];
};

/* ---- mesh_collada.c ---- */

/* Found an element that is something; found says what, and what was expected. */
enum error_code collada_refuse(struct collada *c, const xmlNode *node, const char *found);

/* Counts a visit of an element, or of all that is in it; refuses a scene that wants too many. */
enum error_code collada_visit(struct collada *c, const xmlNode *node, bool all);
/* The element of that name that a reference, "#" and an id, means; NULL = there is none. */
const xmlNode *collada_find(const struct collada *c, const char *reference, const char *name);

/* What an attribute of the node refers to: an element of that name in the same document. */
enum error_code collada_follow(struct collada *c, const xmlNode *node, const char *attribute,
                               const char *name, const xmlNode **found);

/* ---- collada_faces.c ---- */

/* All faces of a <geometry> at its place, in the colors that the <instance_geometry> binds; only
 * counts them while c->counting. */
enum error_code collada_read_geometry(struct collada *c, const xmlNode *geometry,
                                      const xmlNode *instance, const struct collada_place *place);

/* ---- collada_colors.c ---- */

/* The tint of a primitive's material as the <instance_geometry> binds it, -1 = none. */
int collada_find_tint(struct collada *c, const xmlNode *instance, const xmlNode *primitive);

#endif
