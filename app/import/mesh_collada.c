/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COLLADA 1.4 and 1.5: the geometries of a scene, placed by its nodes. <unit> scales. <up_axis> is
 * ignored, as in RViz and Gazebo, because URDF origins are written for their display. Elements that
 * are not surfaces (lines, cameras, lights) are skipped. The document is walked twice, first to
 * count. A part may occur in a scene many times, so the work is limited.
 */
#include "app/import/collada_private.h"

#include "base/array.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLLADA_DEPTH_MAX = 64,
    /* visits of elements, counted for each occurrence in the scene */
    COLLADA_VISITS_MAX = 1 << 22,
};

enum error_code collada_refuse(struct collada *c, const xmlNode *node, const char *found)
{
    return import_error(c->to->error, c->file.name, xml_line(node), "found <%.40s> %s",
                        (const char *)node->name, found);
}

enum error_code collada_visit(struct collada *c, const xmlNode *node, bool all)
{
    for (const xmlNode *at = node; at && c->visited <= COLLADA_VISITS_MAX;
         at = all ? xml_walk(at, node) : NULL) {
        c->visited++;
    }
    return c->visited > COLLADA_VISITS_MAX
               ? collada_refuse(c, node, "too often, expected a simpler scene")
               : ERROR_NONE;
}

/* ---- what has an id ---- */

/* Compares an id's text, then the element that has it: files use one id for several kinds of
 * element. */
static int collada_compare_id(const struct collada_id *id, const char *text, const char *element)
{
    int order = strcmp(id->id, text);

    return order ? order : strcmp((const char *)id->node->name, element);
}

/* Orders ids for qsort; equal ones keep the order of the file. */
static int collada_compare_ids(const void *a, const void *b)
{
    const struct collada_id *x = a, *y = b;
    int order = collada_compare_id(x, y->id, (const char *)y->node->name);

    return order ? order : (x->number > y->number) - (x->number < y->number);
}

/* Lists all elements that have an id, sorted, so that collada_find can search by halves. */
static enum error_code collada_list_ids(struct collada *c)
{
    size_t count = 0;

    for (const xmlNode *at = c->file.root; at; at = xml_walk(at, c->file.root)) {
        count += at->type == XML_ELEMENT_NODE && xml_attribute(at, "id");
    }
    c->id = arena_alloc(c->to->arena, count + 1, sizeof *c->id);
    if (!c->id) {
        return mesh_no_memory(c->to);
    }
    for (const xmlNode *at = c->file.root; at; at = xml_walk(at, c->file.root)) {
        const char *id = at->type == XML_ELEMENT_NODE ? xml_attribute(at, "id") : NULL;

        if (id) {
            c->id[c->nid] = (struct collada_id){id, at, c->nid};
            c->nid++;
        }
    }
    qsort(c->id, c->nid, sizeof *c->id, collada_compare_ids);
    return ERROR_NONE;
}

const xmlNode *collada_find(const struct collada *c, const char *reference, const char *name)
{
    size_t low = 0, high = c->nid;

    /* Find the first entry that is not less than the reference */
    while (reference[0] == '#' && low < high) {
        size_t middle = (low + high) / 2;

        if (collada_compare_id(&c->id[middle], reference + 1, name) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (reference[0] == '#' && low < c->nid &&
        !collada_compare_id(&c->id[low], reference + 1, name) && xml_is(c->id[low].node, name)) {
        return c->id[low].node;
    }
    return NULL;
}

enum error_code collada_follow(struct collada *c, const xmlNode *node, const char *attribute,
                               const char *name, const xmlNode **found)
{
    const char *reference;
    enum error_code code = xml_need(&c->file, node, attribute, &reference);

    if (code) {
        return code;
    }
    *found = collada_find(c, reference, name);
    if (*found) {
        return ERROR_NONE;
    }
    return import_error(c->to->error, c->file.name, xml_line(node),
                        "found %s \"%.100s\" of <%.40s>, expected \"#\" and the id of a <%s> of "
                        "this file",
                        attribute, reference, (const char *)node->name, name);
}

/* ---- nodes ---- */

/* place = place * (R, t). */
static void collada_compose(struct collada_place *place, const double R[3][3], const double t[3])
{
    struct collada_place out;

    for (int i = 0; i < 3; i++) {
        out.t[i] = place->t[i];
        for (int j = 0; j < 3; j++) {
            out.t[i] += place->R[i][j] * t[j];
            out.R[i][j] =
                place->R[i][0] * R[0][j] + place->R[i][1] * R[1][j] + place->R[i][2] * R[2][j];
        }
    }
    *place = out;
}

/* Computes the matrix of a rotation by degrees about an axis of any length (Rodrigues'
 * formula); the identity's scaled cosine for an axis of length 0. */
static void collada_rotation(const double axis[3], double degrees, double R[3][3])
{
    double length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    double s = sin(degrees * (M_PI / 180.0)), c = cos(degrees * (M_PI / 180.0));
    double u[3] = {0};

    for (int m = 0; m < 3; m++) {
        u[m] = length > 0.0 ? axis[m] / length : 0.0;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            R[i][j] = (i == j ? c : 0.0) + (1.0 - c) * u[i] * u[j];
        }
    }
    /* The skew-symmetric part, sin times the cross product matrix of the axis */
    R[0][1] -= s * u[2], R[1][0] += s * u[2];
    R[0][2] += s * u[1], R[2][0] -= s * u[1];
    R[1][2] -= s * u[0], R[2][1] += s * u[0];
}

/* Applies a node's child to its pose if it is a transformation; skips other elements. */
static enum error_code collada_transform(struct collada *c, const xmlNode *node,
                                         struct collada_place *place)
{
    static const struct {
        const char *name;
        size_t count;
    } kinds[] = {{"matrix", 16}, {"translate", 3}, {"rotate", 4}, {"scale", 3}};
    double v[16], R[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, t[3] = {0};
    enum error_code code = ERROR_NONE;
    size_t kind = 0;

    /* Which transformation it is; lookat and skew are refused, anything else is no
     * transformation */
    while (kind < ARRAY_COUNT(kinds) && !xml_is(node, kinds[kind].name)) {
        kind++;
    }
    if (kind == ARRAY_COUNT(kinds)) {
        return xml_is(node, "lookat") || xml_is(node, "skew")
                   ? collada_refuse(c, node, "of a node, expected matrix, translate, rotate, scale")
                   : ERROR_NONE;
    }
    code = xml_parse_reals(&c->file, node, "value", xml_content(node), kinds[kind].count, v);
    if (code) {
        return code;
    }
    /* Its numbers as a matrix and a translation */
    switch (kind) {
    case 0:
        for (int i = 0; i < 3; i++) {
            memcpy(R[i], v + 4 * i, sizeof R[i]);
            t[i] = v[4 * i + 3];
        }
        break;
    case 1:
        memcpy(t, v, sizeof t);
        break;
    case 2:
        collada_rotation(v, v[3], R);
        break;
    default:
        for (int i = 0; i < 3; i++) {
            R[i][i] = v[i];
        }
        break;
    }
    collada_compose(place, R, t);
    return ERROR_NONE;
}

/* Reads all geometries of a node and its subtree; a transformation applies to the elements after
 * it. */
static enum error_code collada_walk(struct collada *c, const xmlNode *node,
                                    struct collada_place place, int depth)
{
    enum error_code code = ERROR_NONE;

    if (depth > COLLADA_DEPTH_MAX) {
        return collada_refuse(c, node, "too deep, expected a simpler scene");
    }
    code = collada_visit(c, node, false);
    for (const xmlNode *child = xml_child(node, NULL); child && !code;
         child = xml_next(child, NULL)) {
        const xmlNode *found;

        code = collada_visit(c, child, false);
        if (code) {
            return code;
        }
        /* Nodes and geometries, here or by reference; anything else may be a transformation */
        if (xml_is(child, "node")) {
            code = collada_walk(c, child, place, depth + 1);
        } else if (xml_is(child, "instance_node")) {
            code = collada_follow(c, child, "url", "node", &found);
            code = code ? code : collada_walk(c, found, place, depth + 1);
        } else if (xml_is(child, "instance_geometry")) {
            code = collada_follow(c, child, "url", "geometry", &found);
            code = code ? code : collada_read_geometry(c, found, child, &place);
        } else if (xml_is(child, "instance_controller")) {
            code = collada_refuse(c, child, "(a skin), expected <instance_geometry>");
        } else {
            code = collada_transform(c, child, &place);
        }
    }
    return code;
}

/* Reads the length of the file's unit, m; 1 when it says nothing. */
static enum error_code collada_read_unit(struct collada *c, double *meter)
{
    const xmlNode *asset = xml_child(c->file.root, "asset");
    const xmlNode *unit = asset ? xml_child(asset, "unit") : NULL;
    enum error_code code = ERROR_NONE;

    *meter = 1.0;
    if (unit) {
        code = xml_reals(&c->file, unit, "meter", 1, meter, NULL);
    }
    if (!code && !(*meter >= 1e-6 && *meter <= 1e6)) {
        code = collada_refuse(c, unit, "of another size, expected 1e-6 to 1e6 m");
    }
    return code;
}

/* Reads the scene that the file shows, or its first one. */
static enum error_code collada_read_scene(struct collada *c)
{
    const xmlNode *scene = xml_child(c->file.root, "scene"), *library, *shown = NULL;
    struct collada_place place = {0};
    double meter;
    enum error_code code = collada_read_unit(c, &meter);

    if (code) {
        return code;
    }

    /* The root's place is the unit's scale alone */
    for (int m = 0; m < 3; m++) {
        place.R[m][m] = meter;
    }

    /* The scene that is instantiated, or the first of the library */
    scene = scene ? xml_child(scene, "instance_visual_scene") : NULL;
    library = xml_child(c->file.root, "library_visual_scenes");
    if (scene) {
        code = collada_follow(c, scene, "url", "visual_scene", &shown);
    } else if (library) {
        shown = xml_child(library, "visual_scene");
    }
    if (!code && !shown) {
        code = collada_refuse(c, c->file.root, "without a scene, expected a <visual_scene>");
    }
    c->visited = 0;
    return code ? code : collada_walk(c, shown, place, 0);
}

enum error_code mesh_read_collada(struct mesh_reader *r)
{
    struct collada c = {.to = r, .counting = true};
    enum error_code code =
        xml_text_open(&c.file, r->name, r->at, (size_t)(r->end - r->at), r->error);

    if (code) {
        return code;
    }
    /* Counts first, allocates, and reads again */
    if (!xml_is(c.file.root, "COLLADA")) {
        code = collada_refuse(&c, c.file.root, "as root, expected <COLLADA>");
    }
    code = code ? code : collada_list_ids(&c);
    code = code ? code : collada_read_scene(&c);
    code = code ? code : mesh_make_room(r, c.vertices, c.faces);
    c.counting = false;
    code = code ? code : collada_read_scene(&c);
    xml_file_close(&c.file);
    return code;
}
