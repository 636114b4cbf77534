/* SPDX-License-Identifier: Apache-2.0 */
/* Positions and faces of a COLLADA geometry. */
#include "app/import/collada_private.h"

#include "base/array.h"
#include "base/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLLADA_STRIDE_MAX = 64, /* numbers of one corner, at most */
    COLLADA_WORK_MAX =
        1 << 29, /* bytes of numbers read, counted again for each occurrence in the scene */
};

/* ---- colors ---- */

/*
 * Colors of COLLADA. The material of a primitive is a symbol; the instance of its geometry binds
 * the symbol to a <material>. That has an <effect>, whose shader has a diffuse color. Colors are
 * opaque, because exporters disagree on transparency. A broken link is not an error; it gives no
 * color.
 */

enum { COLLADA_STEP_WORK = 64 }; /* charged for each binding looked at, in bytes */

/* Returns the first descendant along a path of names that ends with NULL. */
static const xmlNode *collada_descend(const xmlNode *node, const char *const path[])
{
    for (size_t i = 0; path[i] && node; i++) {
        node = xml_child(node, path[i]);
    }
    return node;
}

/* Returns the element to which an attribute of the node refers; NULL if there is none. */
static const xmlNode *collada_refer(const struct collada *c, const xmlNode *node,
                                    const char *attribute, const char *name)
{
    const char *reference = node ? xml_attribute(node, attribute) : NULL;

    return reference ? collada_find(c, reference, name) : NULL;
}

/* Finds the material that an instance binds to a symbol; NULL when it binds none. Charges the
 * work. */
static const xmlNode *collada_bound_material(struct collada *c, const xmlNode *instance,
                                             const char *symbol)
{
    static const char *const path[] = {"bind_material", "technique_common", "instance_material",
                                       NULL};

    for (const xmlNode *bound = collada_descend(instance, path); bound;
         bound = xml_next(bound, "instance_material")) {
        const char *name = xml_attribute(bound, "symbol");

        c->work += COLLADA_STEP_WORK;
        if (name && !strcmp(name, symbol)) {
            return collada_refer(c, bound, "target", "material");
        }
    }
    return NULL;
}

/* Finds the element with the color by which an effect scatters light (diffuse), or for a
 * constant shader emits it; NULL when there is none. */
static const xmlNode *collada_find_diffuse(const xmlNode *effect)
{
    static const char *const technique[] = {"profile_COMMON", "technique", NULL};
    static const char *const shader[] = {"phong", "lambert", "blinn", "constant"};
    const xmlNode *found = collada_descend(effect, technique);

    for (size_t i = 0; found && i < ARRAY_COUNT(shader); i++) {
        const xmlNode *node = xml_child(found, shader[i]);

        if (node) {
            return xml_child(node, i == 3 ? "emission" : "diffuse");
        }
    }
    return NULL;
}

/* Returns the index in the mesh's colors of a primitive's material, as the <instance_geometry>
 * binds it; -1 when it has no color. */
static int collada_find_tint(struct collada *c, const xmlNode *instance, const xmlNode *primitive)
{
    const char *symbol = xml_attribute(primitive, "material");
    const xmlNode *material, *effect, *diffuse, *color;
    double rgba[4];

    if (c->counting || !symbol) {
        return -1;
    }
    /* Follows symbol, material, effect and shader to the color; a missing link means no color */
    material = collada_bound_material(c, instance, symbol);
    effect =
        collada_refer(c, material ? xml_child(material, "instance_effect") : NULL, "url", "effect");
    diffuse = effect ? collada_find_diffuse(effect) : NULL;
    if (diffuse && xml_child(diffuse, "texture")) {
        c->to->mesh->remark = "without its texture";
    }
    color = diffuse ? xml_child(diffuse, "color") : NULL;
    if (!color || xml_parse_reals(&c->file, color, "value", xml_content(color), 4, rgba)) {
        return -1;
    }
    rgba[3] = 1.0;
    return mesh_find_tint(c->to->mesh, rgba);
}

/* ---- numbers ---- */

/* Reads the next word of a text; false at its end. A word of 64 characters and more is cut to
 * 32 and "...". */
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

/* Refuses a word among an element's numbers; expected: text for the message. */
static enum error_code collada_refuse_word(struct collada *c, const xmlNode *node, char word[64],
                                           const char *expected)
{
    text_make_printable(word);
    return import_error(c->to->error, c->file.name, xml_line(node),
                        "found \"%s\" in <%.40s>, expected %s", word, (const char *)node->name,
                        expected);
}

/* Charges the length of a text to the reader's work; refuses a scene that needs too much of it. */
static enum error_code collada_account(struct collada *c, const xmlNode *node, const char *text)
{
    c->work += strlen(text);
    return c->work > COLLADA_WORK_MAX
               ? collada_refuse(c, node, "in too many places, expected a simpler scene")
               : ERROR_NONE;
}

/* Reads an attribute that is an integer >= 0; otherwise: the default. */
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

/* Reads all numbers of a <float_array> into the heap; the caller frees *value, after errors too. */
static enum error_code collada_read_floats(struct collada *c, const xmlNode *node, double **value,
                                           size_t *count)
{
    const char *at = xml_content(node);
    enum error_code code = collada_account(c, node, at);
    /* Each number takes at least a digit and a blank, so half of the text's length is enough */
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

/* Vertex positions of a geometry, x, y, z of each; on the heap. */
struct collada_positions {
    double *xyz;
    size_t count;
};

/* Reads the positions that <vertices> refers to: x, y, z at offset + k stride of its source's
 * array. The caller frees positions->xyz, after errors too. */
static enum error_code collada_read_positions(struct collada *c, const xmlNode *vertices,
                                              struct collada_positions *positions)
{
    const xmlNode *input = xml_child(vertices, "input"), *source, *accessor, *array;
    int64_t stride = 3, offset = 0, count;
    enum error_code code = collada_visit(c, vertices, true);
    double *value = NULL;
    size_t values = 0;

    if (code) {
        return code;
    }
    /* The input of semantic POSITION, its source, and the array of numbers in that */
    while (input && strcmp(xml_attribute(input, "semantic") ? xml_attribute(input, "semantic") : "",
                           "POSITION")) {
        input = xml_next(input, "input");
    }
    if (!input) {
        return collada_refuse(c, vertices, "without an input of semantic POSITION, expected one");
    }
    if ((code = collada_follow(c, input, "source", "source", &source)) ||
        (code = collada_visit(c, source, true))) {
        return code;
    }
    array = xml_child(source, "float_array");
    if (!array) {
        return collada_refuse(c, source, "without numbers, expected a <float_array>");
    }
    /* The accessor gives the coordinates' position in the array; without one they are packed */
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

    /* Uses as many positions as the array holds, for any count in the file; packs them to the
     * front */
    count = (int64_t)values - offset < 3 ? 0 : ((int64_t)values - offset - 3) / stride + 1;
    for (int64_t k = 0; !code && k < count; k++) {
        memmove(value + 3 * k, value + offset + k * stride, 3 * sizeof *value);
    }
    positions->xyz = value;
    positions->count = code ? 0 : (size_t)count;
    return code;
}

/* ---- faces ---- */

/* Layout of a primitive's corners: how many numbers each has, and which of them is the position. */
struct collada_corners {
    int64_t stride, position;
    const xmlNode *vertices;
};

/* Reads the inputs of a primitive: the offset of its vertices, and the stride, which is the
 * highest offset plus one. */
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

        /* Vertices are one input of several (normals, texture); each input takes a number of a
         * corner */
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

/* A list of corners during reading, corner by corner, from the numbers of a <p>. */
struct collada_list {
    const xmlNode *node;
    const char *at;
    const struct collada_corners *corners;
    size_t positions; /* number of positions; limit of the indices */
};

/* Reads the index of the next corner's position; *more is false at the end of the list. */
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

/* Adds a triangle of three positions, or counts it; first is the mesh's index of position 0. A
 * mirroring pose swaps two corners, so that normals still point outward. */
static void collada_add_face(struct collada *c, int first, bool mirrored, const int64_t p[3])
{
    if (c->counting) {
        c->faces++;
    } else if (c->to->mesh->nface < c->to->capacity) {
        mesh_add_face(c->to, first + (int)p[0], first + (int)p[mirrored ? 2 : 1],
                      first + (int)p[mirrored ? 1 : 2]);
    }
}

/* How a list of corners is divided into triangles. */
enum collada_shape { COLLADA_TRIANGLES, COLLADA_POLYGONS, COLLADA_STRIP, COLLADA_FAN };

/* Reads one list of corners. Shapes: triangles; polygons with their numbers of corners in sizes,
 * or one polygon if sizes is NULL; a strip; or a fan. */
static enum error_code collada_read_list(struct collada *c, struct collada_list *list,
                                         enum collada_shape shape, const char *sizes, int first,
                                         bool mirrored)
{
    int64_t p[3] = {0}, corner = 0, size = INT64_MAX, next = 0;
    enum error_code code = collada_account(c, list->node, list->at);
    char word[64];
    bool more;

    for (; !code; corner++) {
        /* A polygon begins: read how many corners it has */
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

        /* The first two corners of a face wait for the third. Fans and polygons keep their first
         * corner. Strips advance by one and reverse each second triangle */
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
        /* The triangle or polygon is complete: begin the next one */
        if ((shape == COLLADA_TRIANGLES && corner == 2) || corner + 1 == size) {
            corner = -1;
        }
    }
    if (!code && corner > 0 && (shape == COLLADA_TRIANGLES || sizes)) {
        return collada_refuse(c, list->node, "that ends within a face, expected all its corners");
    }
    return code;
}

/* Reads all <p> of a primitive as faces, from the mesh's vertex first on. */
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

/* Computes the determinant of a 3 x 3 matrix; negative for a mirroring pose. */
static double collada_determinant(const double R[3][3])
{
    return R[0][0] * (R[1][1] * R[2][2] - R[1][2] * R[2][1]) -
           R[0][1] * (R[1][0] * R[2][2] - R[1][2] * R[2][0]) +
           R[0][2] * (R[1][0] * R[2][1] - R[1][1] * R[2][0]);
}

/* Adds all positions of a geometry at its place to the mesh, or counts them. Those that no face
 * uses are dropped later, by mesh_join_vertices. */
static enum error_code collada_add_positions(struct collada *c, const struct collada_place *place,
                                             const struct collada_positions *positions)
{
    enum error_code code = ERROR_NONE;

    /* The first pass only counts, and refuses a mesh that exceeds the limits */
    if (c->counting) {
        c->vertices += positions->count;
        return c->vertices > 3 * (size_t)IMPORT_MESH_FACES_MAX || c->faces > IMPORT_MESH_FACES_MAX
                   ? mesh_make_room(c->to, c->vertices, c->faces)
                   : ERROR_NONE;
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

enum error_code collada_read_geometry(struct collada *c, const xmlNode *geometry,
                                      const xmlNode *instance, const struct collada_place *place)
{
    static const struct {
        const char *name;
        enum collada_shape shape;
    } kinds[] = {{"triangles", COLLADA_TRIANGLES},
                 {"polylist", COLLADA_POLYGONS},
                 {"polygons", COLLADA_POLYGONS},
                 {"tristrips", COLLADA_STRIP},
                 {"trifans", COLLADA_FAN}};
    enum error_code code = collada_visit(c, geometry, true);
    const xmlNode *mesh = xml_child(geometry, "mesh");
    bool mirrored = collada_determinant(place->R) < 0.0;

    if (code) {
        return code;
    }
    if (!mesh) {
        return collada_refuse(c, geometry, "without a mesh, expected <mesh>");
    }
    /* Each primitive has its own positions; their indices start at the mesh's present end */
    for (const xmlNode *part = xml_child(mesh, NULL); part; part = xml_next(part, NULL)) {
        for (size_t k = 0; k < ARRAY_COUNT(kinds); k++) {
            struct collada_positions positions = {0};
            struct collada_corners corners;
            int first = (int)c->to->mesh->nvertex;

            if (!xml_is(part, kinds[k].name) || !xml_child(part, "p")) {
                continue;
            }
            c->to->line = xml_line(part);
            c->to->tint = collada_find_tint(c, instance, part);
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
