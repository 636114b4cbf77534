/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads COLLADA 1.4 and 1.5: the geometries of a scene, placed by its nodes. <unit> scales.
 * <up_axis> is ignored, as in RViz and Gazebo, because URDF origins are written for them. Elements
 * without surfaces (lines, cameras, lights) are skipped.
 *
 * The document is read twice, first to count. A part may occur many times in a scene, so the work
 * is limited. The reader keeps its first error, and then reads nothing more.
 */
#include "app/import/mesh_private.h"
#include "app/import/xml.h"

#include "base/array.h"
#include "base/text.h"
#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    COLLADA_DEPTH_MAX = 64,
    /* visits of elements, counted at each occurrence in the scene */
    COLLADA_VISITS_MAX = 1 << 22,
    COLLADA_STRIDE_MAX = 64, /* largest number of values per corner */
    /* bytes of numbers read, counted at each occurrence in the scene */
    COLLADA_WORK_MAX = 1 << 29,
    COLLADA_STEP_WORK = 64, /* work counted for binding a material, in bytes */
    COLLADA_WORD_MAX = 64,
};

/* A document during reading. The first pass counts, the second fills the mesh. */
struct collada {
    struct mesh_reader *to;
    struct xml_file file;
    struct xml_names ids;
    bool counting;          /* true in the first pass */
    size_t vertices, faces; /* numbers counted in the first pass */
    size_t visited, work;   /* elements visited in this pass; bytes of numbers read */
};

/* Sets an error at an element. found is the text after the element's name: what was found and
 * expected. */
static void collada_refuse(const struct collada *c, const xmlNode *node, const char *found)
{
    xml_refuse(&c->file, node, "found <%.40s> %s", (const char *)node->name, found);
}

static bool collada_failed(const struct collada *c)
{
    return c->to->error->code != ERROR_NONE;
}

/* Counts a visit of an element or, if `all`, of its whole subtree. Refuses a scene with too many
 * visits. */
static void collada_visit(struct collada *c, const xmlNode *node, bool all)
{
    for (const xmlNode *at = node; at && c->visited <= COLLADA_VISITS_MAX;
         at = all ? xml_walk(at, node) : NULL) {
        c->visited++;
    }
    if (c->visited > COLLADA_VISITS_MAX) {
        collada_refuse(c, node, "too often, expected a simpler scene");
    }
}

/* Adds the length of a text to the reader's work. Refuses a scene with too much work. */
static void collada_account(struct collada *c, const xmlNode *node, const char *text)
{
    c->work += strlen(text);
    if (c->work > COLLADA_WORK_MAX) {
        collada_refuse(c, node, "in too many places, expected a simpler scene");
    }
}

/* ---- references ---- */

/* Returns the element with this name to which an attribute of the node refers ("#" and an id in the
 * same document); NULL if there is none. */
static const xmlNode *collada_refer(const struct collada *c, const xmlNode *node,
                                    const char *attribute, const char *name)
{
    const char *reference = node ? xml_attribute(node, attribute) : NULL;
    const struct xml_name *found =
        reference && reference[0] == '#' ? xml_names_find(&c->ids, reference + 1, name) : NULL;

    return found && xml_is(found->node, name) ? found->node : NULL;
}

/* Returns the element to which an attribute of the node must refer; refuses a wrong reference. */
static const xmlNode *collada_follow(const struct collada *c, const xmlNode *node,
                                     const char *attribute, const char *name)
{
    const char *reference = xml_need(&c->file, node, attribute);
    const xmlNode *found = collada_refer(c, node, attribute, name);

    if (!found) {
        xml_refuse(&c->file, node,
                   "found %s \"%.100s\" of <%.40s>, expected \"#\" and the id of a <%s> of this "
                   "file",
                   attribute, reference, (const char *)node->name, name);
    }
    return found;
}

/* Returns the first descendant along a path of names that ends with NULL. */
static const xmlNode *collada_descend(const xmlNode *node, const char *const path[])
{
    for (size_t i = 0; path[i] && node; i++) {
        node = xml_child(node, path[i]);
    }
    return node;
}

/* ---- colors ---- */

/*
 * Colors of COLLADA. A primitive names its material by a symbol. The instance of its geometry binds
 * the symbol to a <material>, which has an <effect> with a shader and its diffuse color. Colors are
 * opaque, because exporters disagree on transparency. A broken link is not an error; it gives no
 * color.
 */

/* Finds the material that an instance binds to a symbol. Returns NULL if there is none. Counts the
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

/* Finds the element with the diffuse color of an effect, or with the emission of a constant shader.
 * Returns NULL if there is none. */
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

/* Returns the index, in the mesh's colors, of the color of a primitive's material, as bound by the
 * <instance_geometry>. Returns -1 if it has no color. */
static int collada_find_tint(struct collada *c, const xmlNode *instance, const xmlNode *primitive)
{
    const char *symbol = xml_attribute(primitive, "material");
    const xmlNode *material, *effect, *diffuse, *color;
    double rgba[4];

    if (c->counting || !symbol) {
        return -1;
    }
    /* Follow symbol, material, effect and shader to the color; without one of them there is no
     * color */
    material = collada_bound_material(c, instance, symbol);
    effect =
        collada_refer(c, material ? xml_child(material, "instance_effect") : NULL, "url", "effect");
    diffuse = effect ? collada_find_diffuse(effect) : NULL;
    if (diffuse && xml_child(diffuse, "texture")) {
        c->to->mesh->remark = "without its texture";
    }
    color = diffuse ? xml_child(diffuse, "color") : NULL;
    if (!color || !xml_try_reals(xml_content(color), 4, rgba)) {
        return -1;
    }
    rgba[3] = 1.0;
    return mesh_find_tint(c->to->mesh, rgba);
}

/* ---- numbers ---- */

/* Reads the next word of a text. Returns false at the end. Truncates a long word to 32 characters
 * and "...". */
static bool collada_next_word(const char **at, char word[COLLADA_WORD_MAX])
{
    static const char blanks[] = " \t\r\n";
    size_t length;

    *at += strspn(*at, blanks);
    length = strcspn(*at, blanks);
    if (length < COLLADA_WORD_MAX) {
        memcpy(word, *at, length);
        word[length] = '\0';
    } else {
        snprintf(word, COLLADA_WORD_MAX, "%.32s...", *at);
    }
    *at += length;
    return length > 0;
}

/* Refuses a word among an element's numbers. expected is a text for the message. */
static void collada_refuse_word(const struct collada *c, const xmlNode *node, const char *word,
                                const char *expected)
{
    xml_refuse(&c->file, node, "found \"%s\" in <%.40s>, expected %s", word,
               (const char *)node->name, expected);
}

/* Reads an integer attribute, at least 0. `otherwise` is the default. */
static int64_t collada_read_whole(const struct collada *c, const xmlNode *node, const char *name,
                                  int64_t otherwise)
{
    const char *text = xml_attribute(node, name);
    int64_t value = otherwise;

    if (text && !text_to_int(text, 0, INT32_MAX, &value)) {
        xml_refuse(&c->file, node, "found %s \"%.40s\" of <%.40s>, expected a whole number", name,
                   text, (const char *)node->name);
    }
    return value;
}

/* Reads all numbers of a <float_array> into the heap. The caller frees them, even after an
 * error. */
static double *collada_read_floats(struct collada *c, const xmlNode *node, size_t *count)
{
    const char *at = xml_content(node);
    /* Each number needs at least a digit and a blank, so half of the text's length is enough */
    double *value = malloc((strlen(at) / 2 + 1) * sizeof *value);
    char word[COLLADA_WORD_MAX];

    *count = 0;
    collada_account(c, node, at);
    if (!value) {
        mesh_no_memory(c->to);
    }
    while (!collada_failed(c) && collada_next_word(&at, word)) {
        if (text_to_double(word, &value[*count])) {
            ++*count;
        } else {
            collada_refuse_word(c, node, word, "finite numbers");
        }
    }
    return value;
}

/* ---- positions ---- */

/* Reads the positions that <vertices> refers to: x, y, z at offset + k stride in the array of its
 * source. Returns them on the heap. The caller frees them, even after an error. */
static double *collada_read_positions(struct collada *c, const xmlNode *vertices, size_t *npoint)
{
    static const char *const path[] = {"technique_common", "accessor", NULL};
    const xmlNode *input = xml_child(vertices, "input"), *source, *accessor, *array;
    int64_t stride, offset, count;
    double *value;
    size_t values = 0;

    /* Find the input with semantic POSITION, its source, and the array of numbers in the source */
    *npoint = 0;
    collada_visit(c, vertices, true);
    while (input && strcmp(xml_attribute(input, "semantic") ? xml_attribute(input, "semantic") : "",
                           "POSITION")) {
        input = xml_next(input, "input");
    }
    if (!input) {
        collada_refuse(c, vertices, "without an input of semantic POSITION, expected one");
        return NULL;
    }
    source = collada_follow(c, input, "source", "source");
    if (!source) {
        return NULL;
    }
    collada_visit(c, source, true);
    array = xml_child(source, "float_array");
    if (!array) {
        collada_refuse(c, source, "without numbers, expected a <float_array>");
        return NULL;
    }

    /* The accessor gives the coordinates' position in the array; without one they are packed */
    accessor = collada_descend(source, path);
    stride = accessor ? collada_read_whole(c, accessor, "stride", 1) : 3;
    offset = accessor ? collada_read_whole(c, accessor, "offset", 0) : 0;
    if (stride < 3 || stride > COLLADA_STRIDE_MAX) {
        collada_refuse(c, accessor, "of another stride, expected three coordinates");
    }
    if (collada_failed(c)) {
        return NULL;
    }

    /* Use as many positions as the array has, for any count in the file; move them to the front */
    value = collada_read_floats(c, array, &values);
    count = (int64_t)values - offset < 3 ? 0 : ((int64_t)values - offset - 3) / stride + 1;
    for (int64_t k = 0; k < count; k++) {
        memmove(value + 3 * k, value + offset + k * stride, 3 * sizeof *value);
    }
    *npoint = (size_t)count;
    return value;
}

/* Adds all positions of a geometry, at its place, to the mesh, or counts them. mesh_join_vertices
 * later drops positions that no face uses. */
static void collada_add_positions(struct collada *c, const struct import_place *place,
                                  const double *position, size_t count)
{
    /* The first pass only counts, and refuses a mesh that exceeds the limits */
    if (c->counting) {
        c->vertices += count;
        if (c->vertices > 3 * (size_t)IMPORT_MESH_FACES_MAX || c->faces > IMPORT_MESH_FACES_MAX) {
            mesh_make_room(c->to, c->vertices, c->faces);
        }
        return;
    }
    for (size_t k = 0; k < count && !collada_failed(c); k++) {
        double xyz[3];

        mat3_apply(place->R, position + 3 * k, xyz);
        vec3_add_scaled(xyz, 1.0, place->xyz, xyz);
        mesh_add_vertex(c->to, xyz);
    }
}

/* ---- faces ---- */

/* The division of a list of corners into triangles. */
enum collada_shape { COLLADA_TRIANGLES, COLLADA_POLYGONS, COLLADA_STRIP, COLLADA_FAN };

/* The corners of a primitive: the number of values per corner, and the index of the position among
 * them. */
struct collada_corners {
    enum collada_shape shape;
    int64_t stride, position;
    const xmlNode *vertices;
    size_t positions; /* number of positions, the limit of the indices */
    int first;        /* index of position 0 in the mesh */
    bool mirrored;    /* a mirroring pose swaps two corners, so that normals point outward */
};

/* Reads the index of the next corner's position; returns false at the end of the list. */
static bool collada_next_corner(const struct collada *c, const struct collada_corners *corners,
                                const xmlNode *list, const char **at, int64_t *position)
{
    char word[COLLADA_WORD_MAX];

    for (int64_t k = 0; k < corners->stride; k++) {
        if (!collada_next_word(at, word)) {
            if (k > 0) {
                collada_refuse(c, list,
                               "that ends within a corner, expected a number for each input");
            }
            return false;
        }
        if (k == corners->position &&
            !text_to_int(word, 0, (int64_t)corners->positions - 1, position)) {
            collada_refuse_word(c, list, word, "the index of a position");
            return false;
        }
    }
    return true;
}

/* Adds a triangle of three positions, or counts it. */
static void collada_add_face(struct collada *c, const struct collada_corners *corners,
                             bool mirrored, const int64_t p[3])
{
    const int first = corners->first;

    if (c->counting) {
        c->faces++;
    } else if (c->to->mesh->nface < c->to->capacity) {
        mesh_add_face(c->to, first + (int)p[0], first + (int)p[mirrored ? 2 : 1],
                      first + (int)p[mirrored ? 1 : 2]);
    }
}

/* Reads one list of corners. The shape is triangles, polygons, a strip or a fan. For polygons,
 * sizes has the numbers of corners; NULL means one polygon. */
static void collada_read_list(struct collada *c, const struct collada_corners *corners,
                              const xmlNode *list, const char *sizes)
{
    const enum collada_shape shape = corners->shape;
    const char *at = xml_content(list);
    int64_t p[3] = {0}, corner = 0, size = INT64_MAX, next = 0;
    char word[COLLADA_WORD_MAX];

    collada_account(c, list, at);
    for (; !collada_failed(c); corner++) {
        /* Start of a polygon: read its number of corners */
        if (sizes && corner == 0) {
            if (!collada_next_word(&sizes, word)) {
                break;
            }
            if (!text_to_int(word, 1, INT32_MAX, &size)) {
                collada_refuse_word(c, list, word, "how many corners a polygon has");
            }
        }
        if (!collada_next_corner(c, corners, list, &at, &next)) {
            break;
        }

        /* Keep the first two corners of a face until the third. Fans and polygons keep their first
         * corner. Strips advance by one, and reverse every second triangle */
        if (corner < 2) {
            p[corner] = next;
        } else {
            p[2] = next;
            collada_add_face(c, corners,
                             corners->mirrored != (shape == COLLADA_STRIP && corner % 2), p);
            if (shape == COLLADA_STRIP) {
                p[0] = p[1];
            }
            p[1] = p[2];
        }
        /* The triangle or polygon is complete: start the next one */
        if ((shape == COLLADA_TRIANGLES && corner == 2) || corner + 1 == size) {
            corner = -1;
        }
    }
    if (corner > 0 && (shape == COLLADA_TRIANGLES || sizes)) {
        collada_refuse(c, list, "that ends within a face, expected all its corners");
    }
}

/* Reads a primitive: its positions, then all <p> as faces. */
static void collada_read_primitive(struct collada *c, const xmlNode *primitive,
                                   const struct import_place *place,
                                   struct collada_corners *corners)
{
    const xmlNode *vcount = xml_child(primitive, "vcount");
    const char *sizes = NULL;
    double *position;

    /* Read the inputs of a primitive: the offset of its vertices, and the stride, which is the
     * highest offset plus one */
    for (const xmlNode *input = xml_child(primitive, "input"); input;
         input = xml_next(input, "input")) {
        const char *semantic = xml_attribute(input, "semantic");
        const int64_t offset = collada_read_whole(c, input, "offset", 0);

        if (offset >= COLLADA_STRIDE_MAX) {
            collada_refuse(c, input, "of a high offset, expected one below 64");
        }

        /* Vertices are one of several inputs (normals, texture); each input has one value per
         * corner */
        if (semantic && !strcmp(semantic, "VERTEX")) {
            corners->vertices = collada_follow(c, input, "source", "vertices");
            corners->position = offset;
        }
        corners->stride = offset + 1 > corners->stride ? offset + 1 : corners->stride;
    }
    if (!corners->vertices) {
        collada_refuse(c, primitive, "without an input of semantic VERTEX, expected one");
    }
    if (collada_failed(c)) {
        return;
    }
    position = collada_read_positions(c, corners->vertices, &corners->positions);
    collada_add_positions(c, place, position, corners->positions);
    free(position);
    if (corners->shape == COLLADA_POLYGONS && vcount) {
        sizes = xml_content(vcount);
        collada_account(c, vcount, sizes);
    }
    if (xml_is(primitive, "polylist") && !vcount) {
        collada_refuse(c, primitive, "without <vcount>, expected one");
    }
    if (xml_child(primitive, "ph")) {
        collada_refuse(c, primitive, "with holes, expected triangles");
    }
    for (const xmlNode *p = xml_child(primitive, "p"); p && !collada_failed(c);
         p = xml_next(p, "p")) {
        collada_read_list(c, corners, p, sizes);
    }
}

/* Adds all faces of a <geometry>, at its place, to the mesh, with the colors of the
 * <instance_geometry>. Only counts them if c->counting. */
static void collada_read_geometry(struct collada *c, const xmlNode *geometry,
                                  const xmlNode *instance, const struct import_place *place)
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
    double normal[3];

    collada_visit(c, geometry, true);
    if (!mesh) {
        collada_refuse(c, geometry, "without a mesh, expected <mesh>");
        return;
    }

    /* The positions of each primitive are added at the end of the mesh. A pose with a negative
     * determinant mirrors */
    vec3_cross(place->R, place->R + 3, normal);
    for (const xmlNode *part = xml_child(mesh, NULL); part; part = xml_next(part, NULL)) {
        for (size_t k = 0; k < ARRAY_COUNT(kinds) && !collada_failed(c); k++) {
            struct collada_corners corners = {.shape = kinds[k].shape,
                                              .stride = 1,
                                              .first = (int)c->to->mesh->nvertex,
                                              .mirrored = vec3_dot(normal, place->R + 6) < 0.0};

            if (xml_is(part, kinds[k].name) && xml_child(part, "p")) {
                c->to->line = xml_line(part);
                c->to->tint = collada_find_tint(c, instance, part);
                collada_read_primitive(c, part, place, &corners);
            }
        }
    }
}

/* ---- nodes ---- */

/* Applies a node's child to the node's pose if the child is a transformation. Ignores other
 * elements. */
static void collada_transform(const struct collada *c, const xmlNode *node,
                              struct import_place *place)
{
    static const struct {
        const char *name;
        size_t count;
    } kinds[] = {{"matrix", 16}, {"translate", 3}, {"rotate", 4}, {"scale", 3}};
    const struct import_place before = *place;
    struct import_place own;
    double v[16], length;
    size_t kind = 0;

    /* Find the kind of transformation; refuse lookat and skew, ignore other elements */
    while (kind < ARRAY_COUNT(kinds) && !xml_is(node, kinds[kind].name)) {
        kind++;
    }
    if (kind == ARRAY_COUNT(kinds)) {
        if (xml_is(node, "lookat") || xml_is(node, "skew")) {
            collada_refuse(c, node, "of a node, expected matrix, translate, rotate, scale");
        }
        return;
    }
    xml_parse_reals(&c->file, node, "value", xml_content(node), kinds[kind].count, v);

    /* Read its numbers, and convert them to a matrix and a translation */
    import_place_identity(&own);
    switch (kind) {
    case 0:
        for (int i = 0; i < 3; i++) {
            memcpy(own.R + 3 * i, v + 4 * i, 3 * sizeof *v);
            own.xyz[i] = v[4 * i + 3];
        }
        break;
    case 1:
        memcpy(own.xyz, v, sizeof own.xyz);
        break;
    case 2:
        length = vec3_norm(v);
        for (int m = 0; m < 3; m++) {
            v[m] = length > 0.0 ? v[m] / length : 0.0;
        }
        mat3_about_axis(v, v[3] * (M_PI / 180.0), own.R);
        break;
    default:
        for (int i = 0; i < 3; i++) {
            own.R[4 * i] = v[i];
        }
        break;
    }
    import_place_compose(&before, &own, place);
}

/* Reads all geometries of a node and its subtree; a transformation applies to the elements after
 * it. */
static void collada_walk(struct collada *c, const xmlNode *node, struct import_place place,
                         int depth)
{
    if (depth > COLLADA_DEPTH_MAX) {
        collada_refuse(c, node, "too deep, expected a simpler scene");
    }
    collada_visit(c, node, false);
    for (const xmlNode *child = xml_child(node, NULL); child && !collada_failed(c);
         child = xml_next(child, NULL)) {
        const xmlNode *found;

        /* Read nodes and geometries, directly or by reference; another element may be a
         * transformation */
        collada_visit(c, child, false);
        if (xml_is(child, "node")) {
            collada_walk(c, child, place, depth + 1);
        } else if (xml_is(child, "instance_node")) {
            found = collada_follow(c, child, "url", "node");
            if (found) {
                collada_walk(c, found, place, depth + 1);
            }
        } else if (xml_is(child, "instance_geometry")) {
            found = collada_follow(c, child, "url", "geometry");
            if (found) {
                collada_read_geometry(c, found, child, &place);
            }
        } else if (xml_is(child, "instance_controller")) {
            collada_refuse(c, child, "(a skin), expected <instance_geometry>");
        } else {
            collada_transform(c, child, &place);
        }
    }
}

/* Reads the scene that the file shows, or its first one. */
static void collada_read_scene(struct collada *c)
{
    static const char *const to_unit[] = {"asset", "unit", NULL};
    static const char *const to_shown[] = {"scene", "instance_visual_scene", NULL};
    static const char *const to_first[] = {"library_visual_scenes", "visual_scene", NULL};
    const xmlNode *root = c->file.root, *unit = collada_descend(root, to_unit);
    const xmlNode *scene = collada_descend(root, to_shown);
    struct import_place place = {0};
    double meter = 1.0;

    /* The root's place only has the scale of the file's unit */
    if (unit) {
        xml_reals(&c->file, unit, "meter", 1, &meter);
    }
    if (!(meter >= 1e-6 && meter <= 1e6)) {
        collada_refuse(c, unit, "of another size, expected 1e-6 to 1e6 m");
    }
    for (int m = 0; m < 3; m++) {
        place.R[4 * m] = meter;
    }

    /* Read the instantiated scene, or the first one in the library */
    scene =
        scene ? collada_follow(c, scene, "url", "visual_scene") : collada_descend(root, to_first);
    if (!scene) {
        collada_refuse(c, root, "without a scene, expected a <visual_scene>");
    }
    c->visited = 0;
    if (!collada_failed(c)) {
        collada_walk(c, scene, place, 0);
    }
}

void mesh_read_collada(struct mesh_reader *r)
{
    struct collada c = {.to = r, .counting = true};

    if (xml_text_open(&c.file, r->name, r->at, (size_t)(r->end - r->at), r->error)) {
        return;
    }
    if (!xml_is(c.file.root, "COLLADA")) {
        collada_refuse(&c, c.file.root, "as root, expected <COLLADA>");
    }
    for (const xmlNode *at = c.file.root; at && !collada_failed(&c);
         at = xml_walk(at, c.file.root)) {
        const char *id = at->type == XML_ELEMENT_NODE ? xml_attribute(at, "id") : NULL;

        if (id) {
            xml_names_add(&c.ids, id, NULL, at, r->arena, r->error);
        }
    }
    xml_names_sort(&c.ids);

    /* Count, allocate, and read again */
    if (!collada_failed(&c)) {
        collada_read_scene(&c);
    }
    if (!collada_failed(&c) && mesh_make_room(r, c.vertices, c.faces)) {
        c.counting = false;
        collada_read_scene(&c);
    }
    xml_file_close(&c.file);
}
