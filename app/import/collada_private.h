/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the parts of the COLLADA reader: mesh_collada.c walks the scene,
 * collada_faces.c reads positions, faces and colors. Not RT-safe. */
#ifndef APP_IMPORT_COLLADA_PRIVATE_H
#define APP_IMPORT_COLLADA_PRIVATE_H

#include "app/import/mesh_private.h"
#include "app/import/xml.h"

/* An element that has an id. */
struct collada_id {
    const char *id;
    const xmlNode *node;
    size_t number; /* order in the file; of equal ids the first one is used */
};

/* The document, read twice: the first pass counts, the second fills the mesh. */
struct collada {
    struct mesh_reader *to;
    struct xml_file file;
    struct collada_id *id; /* sorted by id, then element, then number */
    size_t nid;
    bool counting;          /* in the first pass */
    size_t vertices, faces; /* numbers counted in the first pass */
    size_t visited, work;   /* elements visited in this pass; bytes of numbers read */
};

/* Pose and scale of a node in the scene: p -> R p + t. */
struct collada_place {
    double R[3][3], t[3];
};

/* ---- mesh_collada.c ---- */

/* Reports an error at an element. found: text after the element's name, with the found and the
 * expected content. */
enum error_code collada_refuse(struct collada *c, const xmlNode *node, const char *found);

/* Counts a visit of an element, or of its whole subtree if `all`; refuses a scene with too many
 * visits. */
enum error_code collada_visit(struct collada *c, const xmlNode *node, bool all);
/* Returns the element with this name to which a reference ("#" and an id) points; NULL if there is
 * none. */
const xmlNode *collada_find(const struct collada *c, const char *reference, const char *name);

/* Finds the element with this name to which an attribute of the node refers, in the same document;
 * reports an error if there is none. */
enum error_code collada_follow(struct collada *c, const xmlNode *node, const char *attribute,
                               const char *name, const xmlNode **found);

/* ---- collada_faces.c ---- */

/* Adds all faces of a <geometry> at its place to the mesh, with the colors of the
 * <instance_geometry>; while c->counting, only counts them. */
enum error_code collada_read_geometry(struct collada *c, const xmlNode *geometry,
                                      const xmlNode *instance, const struct collada_place *place);

#endif
