/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads Wavefront OBJ text into a checked triangle mesh: bytes of a file, statements, surface. The
 * text is walked in place (obj_text.c): no line buffer to overflow, no limit to a line.
 */
#include "base/array.h"
#include "base/input_file.h"
#include "contact/mesh/obj_private.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Reads the statement at the current place, up to the end of its line: a vertex, a face, or one
 * that is ignored; any other is ERROR_INPUT. */
static enum error_code obj_read_statement(struct obj_reader *r)
{
    static const char *const ignored[] = {"vn", "vt", "o", "g", "s", "usemtl", "mtllib"};
    struct obj_token token = obj_next_token(r);
    char shown[OBJ_QUOTE_SIZE];

    if (token.length == 0) {
        return ERROR_NONE;
    }
    if (token.text[0] == '#') {
        /* A comment may end in anything, a backslash too */
        r->at = (size_t)(token.text - r->text);
        obj_skip_line(r, false);
        return ERROR_NONE;
    }
    if (obj_token_is(&token, "v")) {
        return obj_read_vertex(r, token.place);
    }
    if (obj_token_is(&token, "f")) {
        return obj_read_face(r, token.place);
    }

    /* Statements that add no shape are skipped */
    for (size_t i = 0; i < ARRAY_COUNT(ignored); i++) {
        if (obj_token_is(&token, ignored[i])) {
            obj_skip_line(r, true);
            return ERROR_NONE;
        }
    }
    return obj_refuse(r, token.place,
                      "found %s, expected v, f, a comment, or one of vn vt o g s usemtl mtllib",
                      obj_quote_token(&token, shown));
}

/* Reads all statements of the text, line by line. */
static enum error_code obj_read_statements(struct obj_reader *r)
{
    while (r->at < r->size) {
        enum error_code code = obj_read_statement(r);

        if (code != ERROR_NONE) {
            return code;
        }
        if (r->at < r->size) {
            obj_begin_line(r, r->at + obj_line_end(r, r->at));
        }
    }
    return ERROR_NONE;
}

/* Sets ERROR_INPUT for a finding of mesh_check, at its place in the file. */
static enum error_code obj_refuse_surface(struct obj_reader *r, const struct mesh_finding *f)
{
    const char *what = mesh_fault_text(f->fault);

    /* Faults without a face */
    if (f->fault == MESH_EMPTY) {
        return obj_refuse(r, (struct obj_place){r->line, 1},
                          "found no faces, expected a closed surface");
    }
    if (f->fault == MESH_UNUSED_VERTEX) {
        return obj_refuse(r, r->vertex_place[f->vertex[0]],
                          "found vertex %d in no face, expected every vertex in use",
                          f->vertex[0] + 1);
    }

    /* Faults at a corner of a face, and the line of the face that it collides with */
    struct obj_place place = r->corner_place[f->face][f->corner];
    size_t other = r->corner_place[f->other_face][0].line;

    switch (f->fault) {
    case MESH_INWARD:
        return obj_refuse(r, r->corner_place[0][0],
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
        return obj_refuse(
            r, place,
            "found an %s from vertex %d to %d, expected a closed surface (two faces on "
            "every edge, shared vertices written once)",
            what, f->vertex[0] + 1, f->vertex[1] + 1);
    default:
        return obj_refuse(
            r, place,
            "found %s %s at vertices %d and %d (see line %zu), expected two faces that "
            "run the edge in opposite directions",
            f->fault == MESH_FLIPPED_FACE ? "two" : "an", what, f->vertex[0] + 1, f->vertex[1] + 1,
            other);
    }
}

/* Copies the vertices and faces that were read into the arena. */
static enum error_code obj_keep_mesh(struct obj_reader *r, struct arena *arena,
                                     const struct mesh **mesh)
{
    struct mesh *m = arena_alloc(arena, 1, sizeof *m);
    double(*vertex)[3] = arena_alloc(arena, r->nvertex, sizeof *vertex);
    int(*face)[3] = arena_alloc(arena, r->nface, sizeof *face);
    const char *name = arena_strdup(arena, r->name);

    if (!m || !vertex || !face || !name) {
        return obj_no_memory(r);
    }
    memcpy(vertex, r->vertex, r->nvertex * sizeof *vertex);
    memcpy(face, r->face, r->nface * sizeof *face);
    *m = (struct mesh){.name = name,
                       .nvertex = r->nvertex,
                       .nface = r->nface,
                       .vertex = (const double(*)[3])vertex,
                       .face = (const int(*)[3])face,
                       .sound = true};
    *mesh = m;
    return ERROR_NONE;
}

/* Reads the statements, checks the surface, and makes the mesh in the arena. */
static enum error_code obj_read_mesh(struct obj_reader *r, struct arena *arena,
                                     const struct mesh **mesh)
{
    struct mesh_finding finding;
    enum error_code code = obj_read_statements(r);

    if (code != ERROR_NONE) {
        return code;
    }

    const struct mesh draft = {.name = r->name,
                               .nvertex = r->nvertex,
                               .nface = r->nface,
                               .vertex = (const double(*)[3])r->vertex,
                               .face = (const int(*)[3])r->face};

    /* Checked on the heap: a mesh that is refused leaves nothing in the arena */
    code = mesh_check(&draft, &finding, r->error);
    if (code != ERROR_NONE) {
        return code;
    }
    if (finding.fault != MESH_SOUND) {
        return obj_refuse_surface(r, &finding);
    }
    return obj_keep_mesh(r, arena, mesh);
}

enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error)
{
    struct obj_reader r = {.name = name, .text = text, .size = size, .line = 1, .error = error};
    enum error_code code = obj_read_mesh(&r, arena, mesh);

    free(r.vertex);
    free(r.vertex_place);
    free(r.face);
    free(r.corner_place);
    return code;
}

enum error_code mesh_read_obj(const char *path, struct arena *arena, const struct mesh **mesh,
                              struct error *error)
{
    char *text;
    size_t size;
    enum error_code code = input_file_load(path, MESH_MAX_FILE_BYTES, &text, &size, error);

    code = code ? code : mesh_read_obj_text(path, text, size, arena, mesh, error);
    free(text);
    return code;
}
