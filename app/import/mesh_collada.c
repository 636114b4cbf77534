/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COLLADA 1.4 and 1.5: the geometries of a scene where its nodes put them. <unit> scales; <up_axis>
 * is not obeyed, as RViz and Gazebo do not either: a URDF's origin is written for what they show.
 * What is no surface (lines, cameras, lights, materials) is passed over. The document is walked
 * twice, the first time to count; parts may stand in a scene many times, so the work is bounded.
 */
#include "app/import/mesh_private.h"

#include "app/import/xml.h"
#include "base/count.h"
#include "base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLLADA_DEPTH_MAX = 64,
    COLLADA_NODES_MAX = 1 << 16, /* visited, each as often as it stands in the scene */
    COLLADA_STRIDE_MAX = 64,
    COLLADA_WORK_MAX = 1 << 29, /* bytes of numbers read, again for each place */
};

struct collada_id {
    const char *id;
    const xmlNode *node;
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

/* Positions of a geometry, and which of them a face means. */
struct collada_positions {
    double *xyz;
    size_t count;
};

static enum error_code collada_refuse(struct collada *c, const xmlNode *node, const char *found)
{
    return import_error(c->to->error, c->file.name, xml_line(node), "found <%.40s> %s",
                        (const char *)node->name, found);
}

/* ---- what has an id ---- */

static const xmlNode *collada_next_element(const xmlNode *at, const xmlNode *root)
{
    if (at->children) {
        return at->children;
    }
    while (at != root && !at->next) {
        at = at->parent;
    }
    return at == root ? NULL : at->next;
}

static int collada_compare_ids(const void *a, const void *b)
{
    const struct collada_id *x = a, *y = b;
    int order = strcmp(x->id, y->id);

    return order ? order : (x->node > y->node) - (x->node < y->node);
}

static enum error_code collada_list_ids(struct collada *c)
{
    size_t count = 0;

    for (const xmlNode *at = c->file.root; at; at = collada_next_element(at, c->file.root)) {
        count += at->type == XML_ELEMENT_NODE && xml_attribute(at, "id");
    }
    c->id = arena_alloc(c->to->arena, count + 1, sizeof *c->id);
    if (!c->id) {
        return mesh_no_memory(c->to);
    }
    for (const xmlNode *at = c->file.root; at; at = collada_next_element(at, c->file.root)) {
        const char *id = at->type == XML_ELEMENT_NODE ? xml_attribute(at, "id") : NULL;

        if (id) {
            c->id[c->nid++] = (struct collada_id){id, at};
        }
    }
    qsort(c->id, c->nid, sizeof *c->id, collada_compare_ids);
    return ERROR_NONE;
}

/* What an attribute of the node refers to: an element of that name in the same document. */
static enum error_code collada_follow(struct collada *c, const xmlNode *node, const char *attribute,
                                      const char *name, const xmlNode **found)
{
    const char *reference;
    enum error_code code = xml_need(&c->file, node, attribute, &reference, c->to->error);
    size_t low = 0, high = c->nid;

    if (code) {
        return code;
    }
    while (reference[0] == '#' && low < high) {
        size_t middle = (low + high) / 2;

        if (strcmp(c->id[middle].id, reference + 1) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    for (; low < c->nid && !strcmp(c->id[low].id, reference + 1); low++) {
        if (reference[0] == '#' && xml_is(c->id[low].node, name)) {
            *found = c->id[low].node;
            return ERROR_NONE;
        }
    }
    return import_error(c->to->error, c->file.name, xml_line(node),
                        "found %s \"%.100s\" of <%.40s>, expected \"#\" and the id of a <%s> of "
                        "this file",
                        attribute, reference, (const char *)node->name, name);
}

/* ---- numbers ---- */

/* The next word of a text; false at its end. A word that is too long ends in "...". */
static bool collada_next_word(const char **at, char word[64])
{
    static const char blanks[] = " \t\r\n";
    size_t length;

    *at += strspn(*at, blanks);
    length = strcspn(*at, blanks);
    if (length < 64) {
        memcpy(word, *at, length);
        word[length] = '\0';
    } else {
        snprintf(word, 64, "%.32s...", *at);
    }
    *at += length;
    return length > 0;
}

static enum error_code collada_refuse_word(struct collada *c, const xmlNode *node, char word[64],
                                           const char *expected)
{
    text_make_printable(word);
    return import_error(c->to->error, c->file.name, xml_line(node),
                        "found \"%s\" in <%.40s>, expected %s", word, (const char *)node->name,
                        expected);
}

static enum error_code collada_account(struct collada *c, const xmlNode *node, const char *text)
{
    c->work += strlen(text);
    return c->work > COLLADA_WORK_MAX
               ? collada_refuse(c, node, "in too many places, expected a simpler scene")
               : ERROR_NONE;
}

/* An attribute that is a whole number, or what stands for it. */
static enum error_code collada_read_whole(struct collada *c, const xmlNode *node, const char *name,
                                          int64_t otherwise, int64_t *value)
{
    const char *text = xml_attribute(node, name);

    *value = otherwise;
    if (text && !text_to_int(text, 0, INT32_MAX, value)) {
        return import_error(c->to->error, c->file.name, xml_line(node),
                            "found %s \"%.40s\" of <%.40s>, expected a whole number", name, text,
                            (const char *)node->name);
    }
    return ERROR_NONE;
}

/* All numbers of a <float_array>, on the heap. */
static enum error_code collada_read_floats(struct collada *c, const xmlNode *node, double **value,
                                           size_t *count)
{
    const char *at = xml_content(node);
    enum error_code code = collada_account(c, node, at);
    size_t room = strlen(at) / 2 + 1;
    char word[64];

    *count = 0;
    *value = NULL;
    if (code) {
        return code;
    }
    *value = malloc(room * sizeof **value);
    if (!*value) {
        return mesh_no_memory(c->to);
    }
    while (collada_next_word(&at, word)) {
        if (!text_to_double(word, &(*value)[*count])) {
            return collada_refuse_word(c, node, word, "finite numbers");
        }
        ++*count;
    }
    return ERROR_NONE;
}

/* ---- positions ---- */

/* The positions that <vertices> names: x, y, z at offset + k stride of its source's array. */
static enum error_code collada_read_positions(struct collada *c, const xmlNode *vertices,
                                              struct collada_positions *positions)
{
    const xmlNode *input = xml_child(vertices, "input"), *source, *accessor, *array;
    int64_t stride = 3, offset = 0, count;
    enum error_code code;
    double *value = NULL;
    size_t values = 0;

    while (input && strcmp(xml_attribute(input, "semantic") ? xml_attribute(input, "semantic") : "",
                           "POSITION")) {
        input = xml_next(input, "input");
    }
    if (!input) {
        return collada_refuse(c, vertices, "without an input of semantic POSITION, expected one");
    }
    code = collada_follow(c, input, "source", "source", &source);
    if (code) {
        return code;
    }
    array = xml_child(source, "float_array");
    if (!array) {
        return collada_refuse(c, source, "without numbers, expected a <float_array>");
    }
    accessor = xml_child(source, "technique_common");
    accessor = accessor ? xml_child(accessor, "accessor") : NULL;
    if (accessor) {
        code = collada_read_whole(c, accessor, "stride", 1, &stride);
        code = code ? code : collada_read_whole(c, accessor, "offset", 0, &offset);
    }
    if (!code && (stride < 3 || stride > COLLADA_STRIDE_MAX)) {
        code = collada_refuse(c, accessor, "of another stride, expected three coordinates");
    }
    code = code ? code : collada_read_floats(c, array, &value, &values);

    /* As many as there are, whatever the file says of their number; moved to the front */
    count = (int64_t)values - offset < 3 ? 0 : ((int64_t)values - offset - 3) / stride + 1;
    for (int64_t k = 0; !code && k < count; k++) {
        memmove(value + 3 * k, value + offset + k * stride, 3 * sizeof *value);
    }
    positions->xyz = value;
    positions->count = code ? 0 : (size_t)count;
    return code;
}

/* ---- faces ---- */

/* Which number of each corner of a primitive is the position, and how many numbers a corner has. */
struct collada_corners {
    int64_t stride, position;
    const xmlNode *vertices;
};

static enum error_code collada_read_inputs(struct collada *c, const xmlNode *primitive,
                                           struct collada_corners *corners)
{
    *corners = (struct collada_corners){.stride = 1};
    for (const xmlNode *input = xml_child(primitive, "input"); input;
         input = xml_next(input, "input")) {
        const char *semantic = xml_attribute(input, "semantic");
        int64_t offset;
        enum error_code code = collada_read_whole(c, input, "offset", 0, &offset);

        if (!code && offset >= COLLADA_STRIDE_MAX) {
            code = collada_refuse(c, input, "of a high offset, expected one below 64");
        }
        if (!code && semantic && !strcmp(semantic, "VERTEX")) {
            code = collada_follow(c, input, "source", "vertices", &corners->vertices);
            corners->position = offset;
        }
        if (code) {
            return code;
        }
        corners->stride = offset + 1 > corners->stride ? offset + 1 : corners->stride;
    }
    return corners->vertices
               ? ERROR_NONE
               : collada_refuse(c, primitive, "without an input of semantic VERTEX, expected one");
}

/* The corners of one face after the other, out of a list of numbers. */
struct collada_list {
    const xmlNode *node;
    const char *at;
    const struct collada_corners *corners;
    size_t positions;
};

/* The position of the next corner; *more false at the end of the list. */
static enum error_code collada_next_corner(struct collada *c, struct collada_list *list,
                                           int64_t *position, bool *more)
{
    char word[64];

    *more = false;
    for (int64_t k = 0; k < list->corners->stride; k++) {
        int64_t value;

        if (!collada_next_word(&list->at, word)) {
            return k == 0 ? ERROR_NONE
                          : collada_refuse(c, list->node,
                                           "that ends within a corner, expected "
                                           "a number for each input");
        }
        if (k == list->corners->position &&
            !text_to_int(word, 0, (int64_t)list->positions - 1, &value)) {
            return collada_refuse_word(c, list->node, word, "the index of a position");
        }
        *position = k == list->corners->position ? value : *position;
    }
    *more = true;
    return ERROR_NONE;
}

/* Adds a face of three positions, which stand at `first` in the mesh. */
static void collada_add_face(struct collada *c, int first, bool mirrored, const int64_t p[3])
{
    if (c->counting) {
        c->faces++;
    } else if (c->to->mesh->nface < c->to->capacity) {
        mesh_add_face(c->to, first + (int)p[0], first + (int)p[mirrored ? 2 : 1],
                      first + (int)p[mirrored ? 1 : 2]);
    }
}

/* How a list of corners makes faces. */
enum collada_shape { COLLADA_TRIANGLES, COLLADA_POLYGONS, COLLADA_STRIP, COLLADA_FAN };

/* One list: triangles; polygons of the numbers of corners in *sizes, or one of all its corners; a
 * strip; a fan. */
static enum error_code collada_read_list(struct collada *c, struct collada_list *list,
                                         enum collada_shape shape, const char *sizes, int first,
                                         bool mirrored)
{
    int64_t p[3] = {0}, corner = 0, size = INT64_MAX, next = 0;
    enum error_code code = collada_account(c, list->node, list->at);
    char word[64];
    bool more;

    for (; !code; corner++) {
        if (sizes && corner == 0) {
            if (!collada_next_word(&sizes, word)) {
                break;
            }
            if (!text_to_int(word, 1, INT32_MAX, &size)) {
                return collada_refuse_word(c, list->node, word, "how many corners a polygon has");
            }
        }
        code = collada_next_corner(c, list, &next, &more);
        if (code || !more) {
            break;
        }

        /* The first two corners wait for a third one */
        if (corner < 2) {
            p[corner] = next;
        } else {
            p[2] = next;
            collada_add_face(c, first, mirrored != (shape == COLLADA_STRIP && corner % 2), p);
            if (shape == COLLADA_STRIP) {
                p[0] = p[1];
            }
            p[1] = p[2];
        }
        if ((shape == COLLADA_TRIANGLES && corner == 2) || corner + 1 == size) {
            corner = -1;
        }
    }
    if (!code && corner > 0 && (shape == COLLADA_TRIANGLES || sizes)) {
        return collada_refuse(c, list->node, "that ends within a face, expected all its corners");
    }
    return code;
}

static enum error_code collada_read_primitive(struct collada *c, const xmlNode *primitive,
                                              enum collada_shape shape,
                                              const struct collada_positions *positions,
                                              const struct collada_corners *corners, int first,
                                              bool mirrored)
{
    const xmlNode *vcount = xml_child(primitive, "vcount");
    const char *sizes = shape == COLLADA_POLYGONS && vcount ? xml_content(vcount) : NULL;
    enum error_code code = sizes ? collada_account(c, vcount, sizes) : ERROR_NONE;

    if (xml_is(primitive, "polylist") && !vcount) {
        return collada_refuse(c, primitive, "without <vcount>, expected one");
    }
    if (xml_child(primitive, "ph")) {
        return collada_refuse(c, primitive, "with holes, expected triangles");
    }
    for (const xmlNode *p = xml_child(primitive, "p"); p && !code; p = xml_next(p, "p")) {
        struct collada_list list = {p, xml_content(p), corners, positions->count};

        code = collada_read_list(c, &list, shape, sizes, first, mirrored);
    }
    return code;
}

/* ---- geometries where they are ---- */

static double collada_determinant(const double R[3][3])
{
    return R[0][0] * (R[1][1] * R[2][2] - R[1][2] * R[2][1]) -
           R[0][1] * (R[1][0] * R[2][2] - R[1][2] * R[2][0]) +
           R[0][2] * (R[1][0] * R[2][1] - R[1][1] * R[2][0]);
}

/* All positions, also those of no face, which the reader drops. */
static enum error_code collada_add_positions(struct collada *c, const struct collada_place *place,
                                             const struct collada_positions *positions)
{
    enum error_code code = ERROR_NONE;

    if (c->counting) {
        c->vertices += positions->count;
        return ERROR_NONE;
    }
    for (size_t k = 0; k < positions->count && !code; k++) {
        const double *p = positions->xyz + 3 * k;
        double xyz[3];

        for (int m = 0; m < 3; m++) {
            xyz[m] =
                place->R[m][0] * p[0] + place->R[m][1] * p[1] + place->R[m][2] * p[2] + place->t[m];
        }
        code = mesh_add_vertex(c->to, xyz);
    }
    return code;
}

static enum error_code collada_read_geometry(struct collada *c, const xmlNode *geometry,
                                             const struct collada_place *place)
{
    static const struct {
        const char *name;
        enum collada_shape shape;
    } kinds[] = {{"triangles", COLLADA_TRIANGLES},
                 {"polylist", COLLADA_POLYGONS},
                 {"polygons", COLLADA_POLYGONS},
                 {"tristrips", COLLADA_STRIP},
                 {"trifans", COLLADA_FAN}};
    const xmlNode *mesh = xml_child(geometry, "mesh");
    bool mirrored = collada_determinant(place->R) < 0.0;

    if (!mesh) {
        return collada_refuse(c, geometry, "without a mesh, expected <mesh>");
    }
    for (const xmlNode *part = xml_child(mesh, NULL); part; part = xml_next(part, NULL)) {
        for (size_t k = 0; k < ARRAY_COUNT(kinds); k++) {
            struct collada_positions positions = {0};
            struct collada_corners corners;
            int first = (int)c->to->mesh->nvertex;
            enum error_code code;

            if (!xml_is(part, kinds[k].name) || !xml_child(part, "p")) {
                continue;
            }
            c->to->line = xml_line(part);
            code = collada_read_inputs(c, part, &corners);
            code = code ? code : collada_read_positions(c, corners.vertices, &positions);
            code = code ? code : collada_add_positions(c, place, &positions);
            code = code ? code
                        : collada_read_primitive(c, part, kinds[k].shape, &positions, &corners,
                                                 first, mirrored);
            free(positions.xyz);
            if (code) {
                return code;
            }
        }
    }
    return ERROR_NONE;
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

/* A rotation about an axis by degrees (Rodrigues). */
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
    R[0][1] -= s * u[2], R[1][0] += s * u[2];
    R[0][2] += s * u[1], R[2][0] -= s * u[1];
    R[1][2] -= s * u[0], R[2][1] += s * u[0];
}

/* Takes a child of a node into account when it is a transformation. */
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

    while (kind < ARRAY_COUNT(kinds) && !xml_is(node, kinds[kind].name)) {
        kind++;
    }
    if (kind == ARRAY_COUNT(kinds)) {
        return xml_is(node, "lookat") || xml_is(node, "skew")
                   ? collada_refuse(c, node, "of a node, expected matrix, translate, rotate, scale")
                   : ERROR_NONE;
    }
    code = xml_parse_reals(&c->file, node, "value", xml_content(node), kinds[kind].count, v,
                           c->to->error);
    if (code) {
        return code;
    }
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

/* The transformations of a node stand before what they move. */
static enum error_code collada_walk(struct collada *c, const xmlNode *node,
                                    struct collada_place place, int depth)
{
    enum error_code code = ERROR_NONE;

    if (depth > COLLADA_DEPTH_MAX || ++c->visited > COLLADA_NODES_MAX) {
        return collada_refuse(c, node, "too deep or too often, expected a simpler scene");
    }
    for (const xmlNode *child = xml_child(node, NULL); child && !code;
         child = xml_next(child, NULL)) {
        const xmlNode *found;

        if (xml_is(child, "node")) {
            code = collada_walk(c, child, place, depth + 1);
        } else if (xml_is(child, "instance_node")) {
            code = collada_follow(c, child, "url", "node", &found);
            code = code ? code : collada_walk(c, found, place, depth + 1);
        } else if (xml_is(child, "instance_geometry")) {
            code = collada_follow(c, child, "url", "geometry", &found);
            code = code ? code : collada_read_geometry(c, found, &place);
        } else if (xml_is(child, "instance_controller")) {
            code = collada_refuse(c, child, "(a skin), expected <instance_geometry>");
        } else {
            code = collada_transform(c, child, &place);
        }
    }
    return code;
}

/* Meters in a unit of the file. */
static enum error_code collada_read_unit(struct collada *c, double *meter)
{
    const xmlNode *asset = xml_child(c->file.root, "asset");
    const xmlNode *unit = asset ? xml_child(asset, "unit") : NULL;
    enum error_code code = ERROR_NONE;

    *meter = 1.0;
    if (unit) {
        code = xml_reals(&c->file, unit, "meter", 1, meter, NULL, c->to->error);
    }
    if (!code && !(*meter >= 1e-6 && *meter <= 1e6)) {
        code = collada_refuse(c, unit, "of another size, expected 1e-6 to 1e6 m");
    }
    return code;
}

/* The scene that the file shows, or its first. */
static enum error_code collada_read_scene(struct collada *c)
{
    const xmlNode *scene = xml_child(c->file.root, "scene"), *library, *shown = NULL;
    struct collada_place place = {0};
    double meter;
    enum error_code code = collada_read_unit(c, &meter);

    if (code) {
        return code;
    }
    for (int m = 0; m < 3; m++) {
        place.R[m][m] = meter;
    }
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
