/* SPDX-License-Identifier: Apache-2.0 */
/* Reads faces from STL and OBJ data. Also has the functions common to all formats. */
#include "app/import/mesh_private.h"

#include "base/text.h"
#include "canbus/frame.h"
#include "contact/mesh/obj.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Sizes of the header and of a facet in a binary STL, bytes. */
enum { STL_HEADER = 80, STL_FACE = 50 };

#define COORDINATE_MAX_M 1e6

void mesh_no_memory(const struct mesh_reader *r)
{
    error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this mesh", r->name);
}

bool mesh_make_room(struct mesh_reader *r, size_t vertices, size_t faces)
{
    if (faces > IMPORT_MESH_FACES_MAX || vertices > 3 * (size_t)IMPORT_MESH_FACES_MAX) {
        error_set(r->error, ERROR_INPUT,
                  "%.200s: found %zu faces, expected at most %d: simplify the mesh", r->name, faces,
                  IMPORT_MESH_FACES_MAX);
        return false;
    }
    r->mesh->vertex = arena_alloc(r->arena, vertices + 1, sizeof *r->mesh->vertex);
    r->mesh->face = arena_alloc(r->arena, faces + 1, sizeof *r->mesh->face);
    r->mesh->tint = arena_alloc(r->arena, faces + 1, sizeof *r->mesh->tint);
    r->capacity = faces;
    if (!r->mesh->vertex || !r->mesh->face || !r->mesh->tint) {
        mesh_no_memory(r);
        return false;
    }
    return true;
}

void mesh_add_vertex(struct mesh_reader *r, const double xyz[3])
{
    double *to = r->mesh->vertex[r->mesh->nvertex++];

    for (int m = 0; m < 3; m++) {
        to[m] = xyz[m] * r->scale[m];
        if (!isfinite(to[m]) || fabs(to[m]) > COORDINATE_MAX_M) {
            import_error(r->error, r->name, r->line,
                         "found coordinate %g, expected one within %g m", to[m], COORDINATE_MAX_M);
        }
        /* Write -0 as 0, so that equal places have equal bytes when vertices are joined */
        to[m] = to[m] == 0.0 ? 0.0 : to[m];
    }
}

void mesh_add_face(struct mesh_reader *r, int a, int b, int c)
{
    int *face = r->mesh->face[r->mesh->nface];

    r->mesh->tint[r->mesh->nface++] = (signed char)r->tint;
    face[0] = a;
    face[1] = b;
    face[2] = c;
}

/* ---- binary STL ---- */

/* Reads a binary STL: after the normal, three corners of three floats in each facet. */
static void stl_read_binary(struct mesh_reader *r)
{
    const uint8_t *at = (const uint8_t *)r->at + STL_HEADER + 4;
    const size_t faces = get_u32_le(at - 4);

    if (!mesh_make_room(r, 3 * faces, faces)) {
        return;
    }
    for (size_t f = 0; f < faces && !r->error->code; f++, at += STL_FACE) {
        for (int corner = 0; corner < 3; corner++) {
            double xyz[3];

            for (int m = 0; m < 3; m++) {
                const uint32_t bits = get_u32_le(at + 12 * (corner + 1) + 4 * m);
                float value;

                memcpy(&value, &bits, sizeof value);
                xyz[m] = (double)value;
            }
            mesh_add_vertex(r, xyz);
        }
        mesh_add_face(r, 3 * (int)f, 3 * (int)f + 1, 3 * (int)f + 2);
    }
}

/* ---- text ---- */

static bool mesh_is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

bool mesh_next_word(struct mesh_reader *r, char word[MESH_WORD_MAX])
{
    size_t length = 0;

    while (r->at < r->end && mesh_is_blank(*r->at)) {
        r->at++;
    }
    while (r->at < r->end && !mesh_is_blank(*r->at) && *r->at != '\n') {
        if (length + 1 < MESH_WORD_MAX) {
            word[length++] = *r->at ? *r->at : '?';
        }
        r->at++;
    }
    word[length] = '\0';
    return length > 0;
}

void mesh_skip_line(struct mesh_reader *r)
{
    const char *end = memchr(r->at, '\n', (size_t)(r->end - r->at));

    r->at = end ? end + 1 : r->end;
    r->line++;
}

bool mesh_read_numbers(struct mesh_reader *r, double value[3])
{
    char word[MESH_WORD_MAX];

    for (int m = 0; m < 3; m++) {
        if (!mesh_next_word(r, word) || !text_to_double(word, &value[m])) {
            if (r->error) {
                import_error(r->error, r->name, r->line,
                             "found \"%s\", expected three finite coordinates", word);
            }
            return false;
        }
    }
    return true;
}

/* Reads an ASCII STL. The corners of a facet are the vertices since the last facet. */
static void stl_read_text(struct mesh_reader *r)
{
    struct mesh_reader counting = *r;
    char word[MESH_WORD_MAX];
    size_t vertices = 0;
    double xyz[3];

    while (counting.at < counting.end) {
        vertices += mesh_next_word(&counting, word) && !strcasecmp(word, "vertex");
        mesh_skip_line(&counting);
    }
    if (!mesh_make_room(r, vertices, vertices / 3)) {
        return;
    }
    while (!r->error->code && r->at < r->end) {
        const int first = 3 * (int)r->mesh->nface;

        if (mesh_next_word(r, word) && !strcasecmp(word, "vertex")) {
            if (mesh_read_numbers(r, xyz)) {
                mesh_add_vertex(r, xyz);
            }
        } else if (!strcasecmp(word, "endfacet")) {
            if (r->mesh->nvertex == (size_t)first + 3) {
                mesh_add_face(r, first, first + 1, first + 2);
            } else {
                import_error(r->error, r->name, r->line,
                             "found the end of a facet after %zu corners, expected 3",
                             r->mesh->nvertex - (size_t)first);
            }
        }
        mesh_skip_line(r);
    }
    if (r->mesh->nvertex != 3 * r->mesh->nface) {
        import_error(r->error, r->name, r->line,
                     "found the end of the file within a facet, expected \"endfacet\"");
    }
}

/* ---- the whole ---- */

/* A vertex during sorting: its position, and its original index. */
struct joined_vertex {
    const double *xyz;
    int index;
};

/* Orders vertices for qsort by x, y, z, then by index. */
static int joined_compare(const void *a, const void *b)
{
    const struct joined_vertex *x = a, *y = b;

    for (int m = 0; m < 3; m++) {
        if (x->xyz[m] != y->xyz[m]) {
            return x->xyz[m] < y->xyz[m] ? -1 : 1;
        }
    }
    return x->index < y->index ? -1 : x->index > y->index;
}

/* Joins corners at the same place into one vertex, in the order of their first appearance;
 * drops vertices without a face and faces without area. */
static void mesh_join_vertices(const struct mesh_reader *r)
{
    struct import_mesh *mesh = r->mesh;
    struct joined_vertex *sorted = arena_alloc(r->arena, mesh->nvertex + 1, sizeof *sorted);
    int *same = arena_alloc(r->arena, mesh->nvertex + 1, sizeof *same);
    int *number = arena_alloc(r->arena, mesh->nvertex + 1, sizeof *number);
    size_t nface = 0, nvertex = 0;

    if (!sorted || !same || !number) {
        mesh_no_memory(r);
        return;
    }
    /* Sort by place, then give all vertices of one place the index of the first */
    for (size_t v = 0; v < mesh->nvertex; v++) {
        sorted[v] = (struct joined_vertex){mesh->vertex[v], (int)v};
        number[v] = -1;
    }
    qsort(sorted, mesh->nvertex, sizeof *sorted, joined_compare);
    for (size_t v = 0; v < mesh->nvertex; v++) {
        bool again = v > 0 && !memcmp(sorted[v].xyz, sorted[v - 1].xyz, sizeof *mesh->vertex);

        same[sorted[v].index] = again ? same[sorted[v - 1].index] : sorted[v].index;
    }

    /* Keep faces with three different corners, and mark their vertices as used. The first of equal
     * vertices has the lowest index, so no vertex is overwritten before it is moved */
    for (size_t f = 0; f < mesh->nface; f++) {
        int *face = mesh->face[f], corner[3];

        for (int c = 0; c < 3; c++) {
            corner[c] = same[face[c]];
        }
        if (corner[0] != corner[1] && corner[1] != corner[2] && corner[2] != corner[0]) {
            mesh->tint[nface] = mesh->tint[f];
            memcpy(mesh->face[nface++], corner, sizeof corner);
            number[corner[0]] = number[corner[1]] = number[corner[2]] = 0;
        }
    }
    /* Close the gaps between the used vertices, then renumber the faces' corners */
    for (size_t v = 0; v < mesh->nvertex; v++) {
        if (number[v] == 0) {
            memmove(mesh->vertex[nvertex], mesh->vertex[v], sizeof *mesh->vertex);
            number[v] = (int)nvertex++;
        }
    }
    for (size_t f = 0; f < nface; f++) {
        for (int c = 0; c < 3; c++) {
            mesh->face[f][c] = number[mesh->face[f][c]];
        }
    }
    mesh->nface = nface;
    mesh->nvertex = nvertex;
}

enum error_code import_parse_mesh(const char *name, bool is_file, const char *text, size_t size,
                                  const double scale[3], struct arena *arena,
                                  struct import_mesh *mesh, struct error *error)
{
    struct mesh_reader r = {.name = name,
                            .is_file = is_file,
                            .at = text,
                            .end = text + size,
                            .line = 1,
                            .scale = scale,
                            .tint = -1,
                            .arena = arena,
                            .mesh = mesh,
                            .error = error};

    *mesh = (struct import_mesh){0};
    error->code = ERROR_NONE;

    /* Read the faces as in the file, then join equal vertices */
    const char *ending = strrchr(r.name, '.');

    ending = ending ? ending + 1 : "";
    /* An STL is binary if its size matches the number of facets in its header */
    if (!strcasecmp(ending, "stl") && size >= STL_HEADER + 4 &&
        size ==
            STL_HEADER + 4 + (size_t)get_u32_le((const uint8_t *)text + STL_HEADER) * STL_FACE) {
        stl_read_binary(&r);
    } else if (!strcasecmp(ending, "stl")) {
        stl_read_text(&r);
    } else if (!strcasecmp(ending, "obj")) {
        /* Read an OBJ. Skip statements that are neither shapes nor materials. */
        const struct obj_rules rules = {.max_vertices = 3 * (size_t)IMPORT_MESH_FACES_MAX,
                                        .max_faces = IMPORT_MESH_FACES_MAX,
                                        .handle = mesh_read_material_line,
                                        .context = &r};
        struct obj_surface s;

        if (!obj_read(r.name, r.at, (size_t)(r.end - r.at), &rules, &s, r.error) &&
            mesh_make_room(&r, s.nvertex, s.nface)) {
            for (size_t v = 0; v < s.nvertex && !r.error->code; v++) {
                r.line = (int)s.vertex_place[v].line;
                mesh_add_vertex(&r, s.vertex[v]);
            }
            for (size_t f = 0; f < s.nface; f++) {
                r.tint = s.tag[f];
                mesh_add_face(&r, s.face[f][0], s.face[f][1], s.face[f][2]);
            }
        }
        obj_free(&s);
    } else if (!strcasecmp(ending, "dae")) {
        mesh_read_collada(&r);
    } else {
        error_set(r.error, ERROR_INPUT,
                  "%.200s: found a mesh of type \"%.20s\", expected stl, obj or dae; `assimp "
                  "export FILE.%.20s FILE.stl` (Debian package assimp-utils) converts it",
                  r.name, ending, ending);
    }
    if (!error->code) {
        mesh_join_vertices(&r);
    }
    if (!error->code && mesh->nface == 0) {
        error_set(error, ERROR_INPUT, "%.200s: found no face, expected a surface", name);
    }

    /* Reverse all faces if a mirroring scale has turned the surface inside out */
    for (size_t f = 0; f < mesh->nface && scale[0] * scale[1] * scale[2] < 0.0; f++) {
        int *face = mesh->face[f], second = face[1];

        face[1] = face[2];
        face[2] = second;
    }
    return error->code;
}
