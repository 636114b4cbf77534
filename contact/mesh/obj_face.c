/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the OBJ statement `f corner corner corner ...`: flat convex polygons, split into
 * triangles. */
#include "contact/mesh/obj_private.h"
#include "base/vec3.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define FLAT_RATIO 1e-3 /* height of a corner over the plane, of the polygon's longest edge */

/* Makes room for one more face, at twice the capacity when full. Returns false without memory. */
static bool obj_reserve_face(struct obj_reader *r)
{
    if (r->nface < r->face_capacity) {
        return true;
    }

    size_t capacity = obj_grown_capacity(r->face_capacity);
    int(*face)[3] = realloc(r->face, capacity * sizeof *face);

    if (!face) {
        return false;
    }

    /* The array is the reader's already, should the second one fail */
    r->face = face;

    struct obj_place(*place)[3] = realloc(r->corner_place, capacity * sizeof *place);

    if (!place) {
        return false;
    }
    r->corner_place = place;
    r->face_capacity = capacity;
    return true;
}

/* ---- corners ---- */

/* Parses a decimal integer at *text, not zero, of at most ten digits; moves *text behind it. */
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

/* Parses a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`; only v is kept. */
static bool obj_parse_corner(const struct obj_token *token, int64_t *vertex)
{
    const char *at = token->text, *end = token->text + token->length;
    int64_t unused;

    if (!obj_parse_index(&at, end, vertex)) {
        return false;
    }

    /* /vt, or / alone before the / of a normal */
    if (at < end && *at == '/' && at + 1 < end && at[1] != '/') {
        ++at;
        if (!obj_parse_index(&at, end, &unused)) {
            return false;
        }
    } else if (at < end && *at == '/') {
        ++at;
        if (at == end) {
            return false;
        }
    }

    /* /vn */
    if (at < end && *at == '/') {
        ++at;
        if (!obj_parse_index(&at, end, &unused)) {
            return false;
        }
    }
    return at == end;
}

/* Checks a corner's index and adds its vertex to the polygon. */
static enum error_code obj_read_corner(struct obj_reader *r, const struct obj_token *token)
{
    char shown[OBJ_QUOTE_SIZE];
    int64_t index;

    if (!obj_parse_corner(token, &index)) {
        return obj_refuse(r, token->place,
                          "found %s, expected a corner v, v/vt, v//vn or v/vt/vn of indices that "
                          "are not 0",
                          obj_quote_token(token, shown));
    }

    /* Indices count from 1, negative ones back from the newest vertex */
    int64_t vertex = index > 0 ? index - 1 : (int64_t)r->nvertex + index;

    if (vertex < 0 || vertex >= (int64_t)r->nvertex) {
        return obj_refuse(r, token->place,
                          "found vertex %lld, expected 1 to %zu or -1 to -%zu (the vertices above)",
                          (long long)index, r->nvertex, r->nvertex);
    }
    if (r->ncorner == MESH_MAX_CORNERS) {
        return obj_refuse(r, token->place,
                          "found one more corner, expected a polygon of at most %zu",
                          MESH_MAX_CORNERS);
    }
    r->polygon[r->ncorner] = (int)vertex;
    r->polygon_place[r->ncorner++] = token->place;
    return ERROR_NONE;
}

/* ---- polygons ---- */

/* Returns the polygon's i-th corner, counted around and around, m. */
static const double *obj_polygon_corner(const struct obj_reader *r, size_t i)
{
    return r->vertex[r->polygon[i % r->ncorner]];
}

/* Computes the polygon's unit normal (sum over the fan) and the length of its longest edge, m.
 * Returns false when it has no area. */
static bool obj_find_polygon_frame(const struct obj_reader *r, double normal[3], double *longest)
{
    const double *first = obj_polygon_corner(r, 0);
    double length;

    memset(normal, 0, 3 * sizeof *normal);
    *longest = 0;
    for (size_t i = 0; i < r->ncorner; i++) {
        const double *here = obj_polygon_corner(r, i), *next = obj_polygon_corner(r, i + 1);
        double a[3], b[3], part[3];

        /* Twice the vector area of the fan's triangle; the longest edge */
        vec3_sub(here, first, a);
        vec3_sub(next, first, b);
        vec3_cross(a, b, part);
        vec3_add_scaled(normal, 1, part, normal);
        vec3_sub(next, here, a);
        *longest = fmax(*longest, vec3_norm(a));
    }
    length = vec3_norm(normal);
    if (!(length > 0)) {
        return false;
    }
    for (int axis = 0; axis < 3; axis++) {
        normal[axis] /= length;
    }
    return true;
}

/* Checks that a polygon is flat and convex: only then a fan of triangles covers it exactly once. */
static enum error_code obj_check_polygon(struct obj_reader *r, struct obj_place place)
{
    const double *first = obj_polygon_corner(r, 0);
    double normal[3], longest;

    if (!obj_find_polygon_frame(r, normal, &longest)) {
        return obj_refuse(r, place, "found a polygon without area, expected a flat convex one");
    }
    for (size_t i = 0; i < r->ncorner; i++) {
        const double *here = obj_polygon_corner(r, i), *next = obj_polygon_corner(r, i + 1);
        const double *after = obj_polygon_corner(r, i + 2);
        struct obj_place next_place = r->polygon_place[(i + 1) % r->ncorner];
        double a[3], b[3], turn[3];

        /* All corners in one plane */
        vec3_sub(here, first, a);
        if (fabs(vec3_dot(a, normal)) > FLAT_RATIO * longest) {
            return obj_refuse(r, r->polygon_place[i],
                              "found a corner %g m off its polygon's plane, expected a flat "
                              "polygon; split it into triangles",
                              fabs(vec3_dot(a, normal)));
        }

        /* All triangles of the fan turn the same way */
        vec3_sub(next, first, b);
        vec3_cross(a, b, turn);
        if (i > 0 && i + 1 < r->ncorner && !(vec3_dot(turn, normal) > 0)) {
            return obj_refuse(r, next_place,
                              "found a polygon that a fan of triangles does not cover exactly "
                              "once, expected a convex one; split it into triangles");
        }

        /* No corner points inward */
        vec3_sub(next, here, a);
        vec3_sub(after, next, b);
        vec3_cross(a, b, turn);
        if (vec3_dot(turn, normal) < 0) {
            return obj_refuse(r, next_place,
                              "found a corner that points inward, expected a convex polygon; "
                              "split it into triangles");
        }
    }
    return ERROR_NONE;
}

/* Adds the fan's triangle from the first corner to the edge that begins at second. */
static enum error_code obj_add_triangle(struct obj_reader *r, size_t second)
{
    const size_t corner[3] = {0, second, second + 1};

    if (r->nface == MESH_MAX_FACES) {
        return obj_refuse(r, r->polygon_place[0], "found one more triangle, expected at most %zu",
                          MESH_MAX_FACES);
    }
    if (!obj_reserve_face(r)) {
        return obj_no_memory(r);
    }
    for (int i = 0; i < 3; i++) {
        r->face[r->nface][i] = r->polygon[corner[i]];
        r->corner_place[r->nface][i] = r->polygon_place[corner[i]];
    }
    r->nface++;
    return ERROR_NONE;
}

enum error_code obj_read_face(struct obj_reader *r, struct obj_place place)
{
    enum error_code code;
    struct obj_token token;

    /* The corners */
    r->ncorner = 0;
    for (token = obj_next_token(r); token.length > 0; token = obj_next_token(r)) {
        code = obj_read_corner(r, &token);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    if (r->ncorner < 3) {
        return obj_refuse(r, token.place, "found a face of %zu corners, expected at least 3",
                          r->ncorner);
    }

    /* Split into a fan of triangles */
    if (r->ncorner > 3) {
        code = obj_check_polygon(r, place);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    for (size_t i = 1; i + 1 < r->ncorner; i++) {
        code = obj_add_triangle(r, i);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    return ERROR_NONE;
}
