/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads Wavefront OBJ text: words, statements, and a checked triangle mesh. The text is parsed in
 * place, without a line buffer, so lines have no maximum length.
 */
#include "contact/mesh/obj.h"
#include "base/array.h"
#include "base/text.h"
#include "base/vec3.h"
#include "contact/mesh/mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WORD_SIZE 64     /* buffer for the longest number or name, with its terminating 0 */
#define QUOTED_LENGTH 34 /* longest part of the file quoted in a message */
#define FLAT_RATIO 1e-3  /* largest height of a corner over the plane, over the longest edge */

/* A word of the text; its length is 0 at the end of a line. */
struct obj_token {
    const char *text;
    size_t length;
    struct obj_place place;
};

struct obj_reader {
    /* The text and the current position */
    const char *name, *text;
    size_t size, at, line, line_start;

    const struct obj_rules *rules;
    struct obj_surface *surface;
    struct error *error;
    int tag; /* tag of the following faces */

    /* The current polygon */
    int polygon[MESH_MAX_CORNERS];
    struct obj_place polygon_place[MESH_MAX_CORNERS];
    size_t ncorner;
};

/* ---- the text ---- */

/* Sets an ERROR_INPUT with file:line:column. */
__attribute__((format(printf, 3, 4))) static enum error_code
obj_refuse(const struct obj_reader *r, struct obj_place place, const char *format, ...)
{
    char what[512];

    TEXT_FORMAT(what, format);
    return error_set(r->error, ERROR_INPUT, "%s:%zu:%zu: %s", r->name, place.line, place.column,
                     what);
}

/* Refuses a token; the message quotes it, shortened and printable. */
static enum error_code obj_refuse_token(const struct obj_reader *r, const struct obj_token *token,
                                        const char *expected)
{
    char shown[QUOTED_LENGTH + 1];
    bool cut = token->length > QUOTED_LENGTH;
    size_t length = cut ? QUOTED_LENGTH : token->length;

    if (length == 0) {
        return obj_refuse(r, token->place, "found the end of the line, expected %s", expected);
    }
    for (size_t i = 0; i < length; i++) {
        char c = token->text[i];

        shown[i] = c >= 0x20 && c < 0x7f ? c : '?';
    }
    shown[length] = '\0';
    return obj_refuse(r, token->place, "found '%s%s', expected %s", shown, cut ? "..." : "",
                      expected);
}

/* Returns the length of a line end at an offset; 0 if there is none. */
static size_t obj_line_end(const struct obj_reader *r, size_t at)
{
    if (at < r->size && r->text[at] == '\n') {
        return 1;
    }
    return at + 1 < r->size && r->text[at] == '\r' && r->text[at + 1] == '\n' ? 2 : 0;
}

/* Returns the length of a backslash and the line end after it; 0 if there is none. */
static size_t obj_continuation(const struct obj_reader *r)
{
    size_t end = r->text[r->at] == '\\' ? obj_line_end(r, r->at + 1) : 0;

    return end > 0 ? 1 + end : 0;
}

/* Moves behind a line end of this length and counts the line. */
static void obj_begin_line(struct obj_reader *r, size_t length)
{
    r->at += length;
    r->line++;
    r->line_start = r->at;
}

/* Reads the next word of this line; empty at the end of the line. A backslash continues the
 * line. */
static struct obj_token obj_next_token(struct obj_reader *r)
{
    while (r->at < r->size) {
        size_t hidden = obj_continuation(r);

        if (hidden > 0) {
            obj_begin_line(r, hidden);
        } else if (r->text[r->at] == ' ' || r->text[r->at] == '\t') {
            r->at++;
        } else {
            break;
        }
    }

    struct obj_token token = {.text = r->text + r->at,
                              .place = {r->line, r->at - r->line_start + 1}};

    while (r->at < r->size && obj_line_end(r, r->at) == 0 && obj_continuation(r) == 0 &&
           r->text[r->at] != ' ' && r->text[r->at] != '\t') {
        r->at++;
    }
    token.length = (size_t)(r->text + r->at - token.text);
    return token;
}

/* Copies a token as a string; cuts off a token that is too long. */
static void obj_copy_token(const struct obj_token *token, char word[WORD_SIZE])
{
    size_t length = token->length < WORD_SIZE ? token->length : WORD_SIZE - 1;

    memcpy(word, token->text, length);
    word[length] = '\0';
}

/* Parses a token as a finite number; otherwise ERROR_INPUT with what was expected. */
static enum error_code obj_read_number(const struct obj_reader *r, const struct obj_token *token,
                                       const char *expected, double *value)
{
    char word[WORD_SIZE];

    obj_copy_token(token, word);
    return strlen(word) == token->length && text_to_double(word, value)
               ? ERROR_NONE
               : obj_refuse_token(r, token, expected);
}

/* ---- vertices ---- */

/* Reads `x y z [1]`, the rest of a vertex statement. place: position of the keyword in the file. */
static enum error_code obj_read_vertex(struct obj_reader *r, struct obj_place place)
{
    static const char *const expected[] = {"a finite decimal number for x (m)",
                                           "a finite decimal number for y (m)",
                                           "a finite decimal number for z (m)"};
    struct obj_surface *s = r->surface;
    struct obj_token token;
    double weight = 1;

    if (s->nvertex == r->rules->max_vertices) {
        return obj_refuse(r, place, "found one more vertex, expected at most %zu", s->nvertex);
    }
    for (int axis = 0; axis < 3; axis++) {
        double *value = &s->vertex[s->nvertex][axis];
        enum error_code code;

        token = obj_next_token(r);
        code = obj_read_number(r, &token, expected[axis], value);
        if (code) {
            return code;
        }
        if (r->rules->strict && !(fabs(*value) <= MESH_MAX_COORDINATE_M)) {
            return obj_refuse_token(r, &token, "a coordinate within 1e+06 m of the origin");
        }
    }
    s->vertex_place[s->nvertex++] = place;

    /* Strict: the fourth number must be the weight 1; other programs write a color here */
    token = obj_next_token(r);
    if (token.length > 0 && r->rules->strict) {
        enum error_code code = obj_read_number(r, &token, "the end of the line", &weight);

        if (code) {
            return code;
        }
        if (weight != 1) {
            return obj_refuse_token(r, &token, "a weight of 1 (a polygon mesh has no other)");
        }
        token = obj_next_token(r);
        if (token.length > 0) {
            return obj_refuse_token(r, &token, "the end of the line after x y z [1]");
        }
    }
    return ERROR_NONE;
}

/* ---- faces ---- */

/* Parses a nonzero decimal integer of at most ten digits at *text; moves *text behind it. */
static bool obj_parse_index(const char **text, const char *end, int64_t *value)
{
    bool negative = *text < end && **text == '-';
    const char *digit = *text + (negative ? 1 : 0);
    const char *first = digit;
    int64_t number = 0;

    while (digit < end && *digit >= '0' && *digit <= '9' && digit - first < 10) {
        number = 10 * number + (*digit++ - '0');
    }
    *text = digit;
    *value = negative ? -number : number;
    return digit > first && number != 0;
}

/* Parses a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`. Only v is used. Unless strict, the other
 * indices may be wrong. */
static bool obj_parse_corner(const struct obj_token *token, bool strict, int64_t *vertex)
{
    const char *at = token->text, *end = at + token->length;
    int64_t unused;

    if (!obj_parse_index(&at, end, vertex)) {
        return false;
    }
    if (!strict && at < end && *at == '/') {
        return true;
    }
    for (int slash = 0; slash < 2 && at < end && *at == '/'; slash++) {
        ++at;
        /* `v//vn`: empty between the slashes */
        if (slash == 0 && at < end && *at == '/') {
            continue;
        }
        if (!obj_parse_index(&at, end, &unused)) {
            return false;
        }
    }
    return at == end;
}

/* Returns the polygon's i-th corner, modulo their number, m. */
static const double *obj_polygon_corner(const struct obj_reader *r, size_t i)
{
    return r->surface->vertex[r->polygon[i % r->ncorner]];
}

/* Checks that a polygon is flat and convex. Otherwise a fan of triangles would not cover it exactly
 * once. */
static enum error_code obj_check_polygon(const struct obj_reader *r, struct obj_place place)
{
    const double *first = obj_polygon_corner(r, 0);
    double normal[3] = {0}, longest = 0, length, a[3], b[3], turn[3];

    /* Computes the unit normal, from the fan's vector areas, and the longest edge */
    for (size_t i = 0; i < r->ncorner; i++) {
        const double *here = obj_polygon_corner(r, i), *next = obj_polygon_corner(r, i + 1);

        vec3_sub(here, first, a);
        vec3_sub(next, first, b);
        vec3_cross(a, b, turn);
        vec3_add_scaled(normal, 1, turn, normal);
        vec3_sub(next, here, a);
        longest = fmax(longest, vec3_norm(a));
    }
    length = vec3_norm(normal);
    if (!(length > 0)) {
        return obj_refuse(r, place, "found a polygon without area, expected a flat convex one");
    }
    for (int axis = 0; axis < 3; axis++) {
        normal[axis] /= length;
    }

    for (size_t i = 0; i < r->ncorner; i++) {
        const double *here = obj_polygon_corner(r, i), *next = obj_polygon_corner(r, i + 1);
        struct obj_place next_place = r->polygon_place[(i + 1) % r->ncorner];

        /* All corners are in one plane */
        vec3_sub(here, first, a);
        if (fabs(vec3_dot(a, normal)) > FLAT_RATIO * longest) {
            return obj_refuse(r, r->polygon_place[i],
                              "found a corner %g m off its polygon's plane, expected a flat "
                              "polygon; split it into triangles",
                              fabs(vec3_dot(a, normal)));
        }

        /* All triangles of the fan have the same orientation */
        vec3_sub(next, first, b);
        vec3_cross(a, b, turn);
        if (i > 0 && i + 1 < r->ncorner && !(vec3_dot(turn, normal) > 0)) {
            return obj_refuse(r, next_place,
                              "found a polygon that a fan of triangles does not cover exactly "
                              "once, expected a convex one; split it into triangles");
        }

        /* No corner points inward */
        vec3_sub(next, here, a);
        vec3_sub(obj_polygon_corner(r, i + 2), next, b);
        vec3_cross(a, b, turn);
        if (vec3_dot(turn, normal) < 0) {
            return obj_refuse(r, next_place,
                              "found a corner that points inward, expected a convex polygon; split "
                              "it into triangles");
        }
    }
    return ERROR_NONE;
}

/* Reads the corners of a face statement and splits the polygon into a fan of triangles. place:
 * position of the keyword in the file. */
static enum error_code obj_read_face(struct obj_reader *r, struct obj_place place)
{
    struct obj_surface *s = r->surface;
    enum error_code code = ERROR_NONE;
    struct obj_token token;

    r->ncorner = 0;
    for (token = obj_next_token(r); token.length > 0; token = obj_next_token(r)) {
        size_t nvertex = r->surface->nvertex;
        int64_t index;

        /* Check a corner's index and add its vertex to the polygon */
        if (!obj_parse_corner(&token, r->rules->strict, &index)) {
            return obj_refuse_token(r, &token,
                                    "a corner v, v/vt, v//vn or v/vt/vn of indices that are not 0");
        }

        /* Indices count from 1; negative indices count back from the newest vertex */
        int64_t vertex = index > 0 ? index - 1 : (int64_t)nvertex + index;

        if (vertex < 0 || vertex >= (int64_t)nvertex) {
            return obj_refuse(
                r, token.place,
                "found vertex %lld, expected 1 to %zu or -1 to -%zu (the vertices above)",
                (long long)index, nvertex, nvertex);
        }
        if (r->ncorner == MESH_MAX_CORNERS) {
            return obj_refuse(r, token.place,
                              "found one more corner, expected a polygon of at most %zu",
                              MESH_MAX_CORNERS);
        }
        r->polygon[r->ncorner] = (int)vertex;
        r->polygon_place[r->ncorner++] = token.place;
    }
    if (r->ncorner < 3) {
        return obj_refuse(r, token.place, "found a face of %zu corners, expected at least 3",
                          r->ncorner);
    }
    if (r->ncorner > 3 && r->rules->strict) {
        code = obj_check_polygon(r, place);
    }
    for (size_t i = 1; i + 1 < r->ncorner && !code; i++) {
        const size_t corner[3] = {0, i, i + 1};

        if (s->nface == r->rules->max_faces) {
            return obj_refuse(r, r->polygon_place[0],
                              "found one more triangle, expected at most %zu", s->nface);
        }
        for (int c = 0; c < 3; c++) {
            s->face[s->nface][c] = r->polygon[corner[c]];
            s->corner_place[s->nface][c] = r->polygon_place[corner[c]];
        }
        s->tag[s->nface++] = r->tag;
    }
    return code;
}

/* ---- statements ---- */

/* Reads the statement at the current position, at most up to the end of its line. */
static enum error_code obj_read_statement(struct obj_reader *r)
{
    static const char *const known[] = {"vn", "vt", "o", "g", "s", "usemtl", "mtllib"};
    struct obj_token token = obj_next_token(r), next;
    char keyword[WORD_SIZE], word[WORD_SIZE];
    bool accepted = !r->rules->strict;

    if (token.length == 0) {
        return ERROR_NONE;
    }
    if (token.text[0] == '#') {
        /* A comment may end with any character, also a backslash */
        while (r->at < r->size && obj_line_end(r, r->at) == 0) {
            r->at++;
        }
        return ERROR_NONE;
    }
    obj_copy_token(&token, keyword);
    if (token.length == 1 && keyword[0] == 'v') {
        return obj_read_vertex(r, token.place);
    }
    if (token.length == 1 && keyword[0] == 'f') {
        return obj_read_face(r, token.place);
    }

    /* Accepts statements that define no shape */
    for (size_t i = 0; i < ARRAY_COUNT(known) && !accepted; i++) {
        accepted = token.length == strlen(known[i]) && !strcmp(keyword, known[i]);
    }
    if (!accepted) {
        return obj_refuse_token(r, &token, "v, f, a comment, or one of vn vt o g s usemtl mtllib");
    }
    next = obj_next_token(r);
    if (r->rules->handle) {
        obj_copy_token(&next, word);
        r->tag = r->rules->handle(r->rules->context, keyword, word, r->tag);
    }
    return ERROR_NONE;
}

enum error_code obj_read(const char *name, const char *text, size_t size,
                         const struct obj_rules *rules, struct obj_surface *surface,
                         struct error *error)
{
    /* Estimates: the shortest vertex is "v 0 0 0" with its line end, and one more triangle takes "
     * 1" */
    size_t vertices = size / 8 + 1 < rules->max_vertices ? size / 8 + 1 : rules->max_vertices;
    size_t faces = size / 2 + 1 < rules->max_faces ? size / 2 + 1 : rules->max_faces;
    struct obj_reader r = {.name = name,
                           .text = text,
                           .size = size,
                           .line = 1,
                           .rules = rules,
                           .surface = surface,
                           .error = error,
                           .tag = -1};
    enum error_code code = ERROR_NONE;

    *surface = (struct obj_surface){.vertex = malloc(vertices * sizeof *surface->vertex),
                                    .vertex_place = malloc(vertices * sizeof(struct obj_place)),
                                    .face = malloc(faces * sizeof *surface->face),
                                    .corner_place = malloc(faces * sizeof *surface->corner_place),
                                    .tag = malloc(faces * sizeof *surface->tag)};
    if (!surface->vertex || !surface->vertex_place || !surface->face || !surface->corner_place ||
        !surface->tag) {
        return error_set(error, ERROR_MEMORY, "%s: no memory for the mesh", name);
    }
    while (r.at < size && !code) {
        code = obj_read_statement(&r);

        /* Skips the rest of a statement that defines no shape */
        while (!code && obj_next_token(&r).length > 0) {
        }
        if (!code && r.at < size) {
            obj_begin_line(&r, obj_line_end(&r, r.at));
        }
    }
    surface->nline = r.line;
    return code;
}

void obj_free(struct obj_surface *surface)
{
    free(surface->vertex);
    free(surface->vertex_place);
    free(surface->face);
    free(surface->corner_place);
    free(surface->tag);
}

/* ---- a sound mesh ---- */

/* Sets ERROR_INPUT for a finding of mesh_check, at its place in the file. */
static enum error_code obj_refuse_surface(const struct obj_reader *r, const struct mesh_finding *f)
{
    const struct obj_surface *s = r->surface;
    const char *what = mesh_fault_text(f->fault);

    /* Faults that have no face */
    if (f->fault == MESH_EMPTY) {
        return obj_refuse(r, (struct obj_place){s->nline, 1},
                          "found no faces, expected a closed surface");
    }
    if (f->fault == MESH_UNUSED_VERTEX) {
        return obj_refuse(r, s->vertex_place[f->vertex[0]],
                          "found vertex %d in no face, expected every vertex in use",
                          f->vertex[0] + 1);
    }

    /* Faults at a corner of a face, and the line of its counterpart */
    struct obj_place place = s->corner_place[f->face][f->corner];
    size_t other = s->corner_place[f->other_face][0].line;

    switch (f->fault) {
    case MESH_INWARD:
        return obj_refuse(r, s->corner_place[0][0],
                          "found %s (enclosed volume not positive), expected faces that run "
                          "counterclockwise seen from outside",
                          what);
    case MESH_DEGENERATE_FACE:
        return obj_refuse(r, place, "found a %s, expected three corners that span an area", what);
    case MESH_DUPLICATE_FACE:
        return obj_refuse(r, place, "found a %s of the one in line %zu, expected each once", what,
                          other);
    case MESH_PINCHED_VERTEX:
        return obj_refuse(r, place, "found a %s (vertex %d), expected one fan of faces around it",
                          what, f->vertex[0] + 1);
    case MESH_OPEN_EDGE:
        return obj_refuse(r, place,
                          "found an %s from vertex %d to %d, expected a closed surface (two faces "
                          "on every edge, shared vertices written once)",
                          what, f->vertex[0] + 1, f->vertex[1] + 1);
    default:
        return obj_refuse(r, place,
                          "found %s %s at vertices %d and %d (see line %zu), expected two faces "
                          "that run the edge in opposite directions",
                          f->fault == MESH_FLIPPED_FACE ? "two" : "an", what, f->vertex[0] + 1,
                          f->vertex[1] + 1, other);
    }
}

enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error)
{
    const struct obj_rules rules = {
        .max_vertices = MESH_MAX_VERTICES, .max_faces = MESH_MAX_FACES, .strict = true};
    struct obj_surface surface;
    struct mesh_finding finding = {0};
    enum error_code code = obj_read(name, text, size, &rules, &surface, error);
    const struct mesh draft = {name, surface.nvertex, surface.nface,
                               (const double(*)[3])surface.vertex, (const int(*)[3])surface.face};

    /* Checks on the heap, so that a refused mesh leaves nothing in the arena */
    code = code ? code : mesh_check(&draft, &finding, error);
    if (!code && finding.fault != MESH_SOUND) {
        const struct obj_reader r = {.name = name, .surface = &surface, .error = error};

        code = obj_refuse_surface(&r, &finding);
    }
    if (!code) {
        const struct mesh *copy = mesh_copy(&draft, arena, error);

        if (copy) {
            *mesh = copy;
        }
        code = copy ? ERROR_NONE : ERROR_MEMORY;
    }
    obj_free(&surface);
    return code;
}
