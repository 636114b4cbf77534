/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the OBJ statement `v x y z [1]`. */
#include "base/text.h"
#include "contact/mesh/obj_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NUMBER_SIZE 64 /* longest number that is read, with its end */

/* Makes room for one more vertex, at twice the capacity when full. Returns false without memory. */
static bool obj_reserve_vertex(struct obj_reader *r)
{
    if (r->nvertex < r->vertex_capacity) {
        return true;
    }

    size_t capacity = obj_grown_capacity(r->vertex_capacity);
    double(*vertex)[3] = realloc(r->vertex, capacity * sizeof *vertex);

    if (!vertex) {
        return false;
    }

    /* The array is the reader's already, should the second one fail */
    r->vertex = vertex;

    struct obj_place *place = realloc(r->vertex_place, capacity * sizeof *place);

    if (!place) {
        return false;
    }
    r->vertex_place = place;
    r->vertex_capacity = capacity;
    return true;
}

/* Parses a token as a finite number; otherwise ERROR_INPUT with what was expected. */
static enum error_code obj_read_number(struct obj_reader *r, const struct obj_token *token,
                                       const char *expected, double *value)
{
    char number[NUMBER_SIZE], shown[OBJ_QUOTE_SIZE];
    bool fits = token->length > 0 && token->length < sizeof number &&
                !memchr(token->text, '\0', token->length);

    if (fits) {
        memcpy(number, token->text, token->length);
        number[token->length] = '\0';
    }
    if (!fits || !text_to_double(number, value)) {
        return obj_refuse(r, token->place, "found %s, expected %s", obj_quote_token(token, shown),
                          expected);
    }
    return ERROR_NONE;
}

/* Reads the next word as a vertex's coordinate on an axis, m, and checks its range. */
static enum error_code obj_read_coordinate(struct obj_reader *r, int axis, double *value)
{
    static const char *const expected[] = {"a finite decimal number for x (m)",
                                           "a finite decimal number for y (m)",
                                           "a finite decimal number for z (m)"};
    struct obj_token token = obj_next_token(r);
    enum error_code code = obj_read_number(r, &token, expected[axis], value);
    char shown[OBJ_QUOTE_SIZE];

    if (code != ERROR_NONE) {
        return code;
    }
    if (!(fabs(*value) <= MESH_MAX_COORDINATE_M)) {
        return obj_refuse(r, token.place,
                          "found %s, expected a coordinate within %g m of the origin",
                          obj_quote_token(&token, shown), MESH_MAX_COORDINATE_M);
    }
    return ERROR_NONE;
}

/* Checks the weight that may follow the coordinates: 1, which is all that a polygon mesh knows. */
static enum error_code obj_read_weight(struct obj_reader *r, const struct obj_token *token)
{
    double weight = 1;
    enum error_code code = obj_read_number(r, token, "the end of the line", &weight);
    char shown[OBJ_QUOTE_SIZE];

    if (code == ERROR_NONE && weight != 1) {
        return obj_refuse(r, token->place,
                          "found weight %s, expected 1 (a polygon mesh has no other)",
                          obj_quote_token(token, shown));
    }
    return code;
}

enum error_code obj_read_vertex(struct obj_reader *r, struct obj_place place)
{
    enum error_code code;
    char shown[OBJ_QUOTE_SIZE];

    if (r->nvertex == MESH_MAX_VERTICES) {
        return obj_refuse(r, place, "found one more vertex, expected at most %zu",
                          MESH_MAX_VERTICES);
    }
    if (!obj_reserve_vertex(r)) {
        return obj_no_memory(r);
    }

    /* The three coordinates */
    for (int axis = 0; axis < 3; axis++) {
        code = obj_read_coordinate(r, axis, &r->vertex[r->nvertex][axis]);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    r->vertex_place[r->nvertex++] = place;

    /* Nothing but a weight may follow */
    struct obj_token token = obj_next_token(r);

    if (token.length > 0) {
        code = obj_read_weight(r, &token);
        if (code != ERROR_NONE) {
            return code;
        }
        token = obj_next_token(r);
    }
    if (token.length > 0) {
        return obj_refuse(r, token.place, "found %s, expected the end of the line after x y z [1]",
                          obj_quote_token(&token, shown));
    }
    return ERROR_NONE;
}
