/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Wavefront OBJ text to a checked triangle mesh, and back. The text is walked in place: no line
 * buffer to overflow, no length of line that matters.
 */
#include "contact/mesh.h"

#include "base/text.h"
#include "base/vec3.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define NUMBER_ROOM 64  /* longest number that is read, with its end */
#define QUOTE_ROOM 40   /* longest piece of the file that a message repeats, with its end */
#define FLAT_RATIO 1e-3 /* of a polygon's largest edge */

/* Where in the file, counted from 1. */
struct place {
    size_t line, column;
};

struct token {
    const char *text;
    size_t length; /* 0 at the end of a line */
    struct place place;
};

struct reader {
    const char *name;
    const char *text;
    size_t size, at;
    size_t line, line_start;
    struct error *error;

    double (*vertex)[3];
    struct place *vertex_place;
    size_t nvertex, vertex_room;

    int (*face)[3];
    struct place (*corner_place)[3];
    size_t nface, face_room;

    /* the polygon being read */
    int polygon[MESH_MAX_CORNERS];
    struct place polygon_place[MESH_MAX_CORNERS];
    size_t ncorner;
};

__attribute__((format(printf, 3, 4))) static enum error_code
refuse(struct reader *r, struct place place, const char *format, ...)
{
    char what[512];
    va_list args;

    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    return error_set(r->error, ERROR_INPUT, "%s:%zu:%zu: %s", r->name, place.line, place.column,
                     what);
}

/* The token as a message may show it: printable and short. */
static const char *quote(const struct token *t, char out[QUOTE_ROOM])
{
    size_t length = t->length;

    if (length == 0) {
        return "the end of the line";
    }

    bool cut = length > QUOTE_ROOM - 6;
    size_t shown = cut ? QUOTE_ROOM - 6 : length;
    size_t o = 0;

    out[o++] = '\'';
    for (size_t i = 0; i < shown; ++i) {
        char c = t->text[i];

        out[o++] = c >= 0x20 && c < 0x7f ? c : '?';
    }
    if (cut) {
        memcpy(out + o, "...", 3);
        o += 3;
    }
    out[o++] = '\'';
    out[o] = '\0';
    return out;
}

/* ---- walking the text ---- */

/* The length of a line end at offset, 0 when there is none. */
static size_t line_end(const struct reader *r, size_t at)
{
    if (at < r->size && r->text[at] == '\n') {
        return 1;
    }
    return at + 1 < r->size && r->text[at] == '\r' && r->text[at + 1] == '\n' ? 2 : 0;
}

static void begin_line(struct reader *r, size_t at)
{
    r->at = at;
    r->line++;
    r->line_start = at;
}

static void skip_blanks(struct reader *r)
{
    while (r->at < r->size) {
        char c = r->text[r->at];
        size_t end = c == '\\' ? line_end(r, r->at + 1) : 0;

        if (end > 0) {
            begin_line(r, r->at + 1 + end);
        } else if (c == ' ' || c == '\t') {
            r->at++;
        } else {
            break;
        }
    }
}

/* The next word of this line; empty at its end. */
static struct token next_token(struct reader *r)
{
    skip_blanks(r);

    struct token t = {.text = r->text + r->at, .place = {r->line, r->at - r->line_start + 1}};

    while (r->at < r->size && line_end(r, r->at) == 0) {
        char c = r->text[r->at];

        if (c == ' ' || c == '\t' || (c == '\\' && line_end(r, r->at + 1) > 0)) {
            break;
        }
        r->at++;
    }
    t.length = (size_t)(r->text + r->at - t.text);
    return t;
}

/* To the end of a line whose content does not matter. */
static void skip_line(struct reader *r, bool may_continue)
{
    while (r->at < r->size && line_end(r, r->at) == 0) {
        size_t end = may_continue && r->text[r->at] == '\\' ? line_end(r, r->at + 1) : 0;

        if (end > 0) {
            begin_line(r, r->at + 1 + end);
        } else {
            r->at++;
        }
    }
}

static bool token_is(const struct token *t, const char *word)
{
    return t->length == strlen(word) && memcmp(t->text, word, t->length) == 0;
}

static size_t more_room(size_t room)
{
    return room ? 2 * room : 256;
}

static bool room_for_vertex(struct reader *r)
{
    if (r->nvertex < r->vertex_room) {
        return true;
    }

    size_t room = more_room(r->vertex_room);
    double(*vertex)[3] = realloc(r->vertex, room * sizeof *vertex);
    struct place *place = NULL;

    if (vertex) {
        r->vertex = vertex;
        place = realloc(r->vertex_place, room * sizeof *place);
    }
    if (!place) {
        return false;
    }
    r->vertex_place = place;
    r->vertex_room = room;
    return true;
}

static bool room_for_face(struct reader *r)
{
    if (r->nface < r->face_room) {
        return true;
    }

    size_t room = more_room(r->face_room);
    int(*face)[3] = realloc(r->face, room * sizeof *face);
    struct place(*place)[3] = NULL;

    if (face) {
        r->face = face;
        place = realloc(r->corner_place, room * sizeof *place);
    }
    if (!place) {
        return false;
    }
    r->corner_place = place;
    r->face_room = room;
    return true;
}

static enum error_code no_memory(struct reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%s: no memory for the mesh", r->name);
}

/* ---- vertices ---- */

static enum error_code read_number(struct reader *r, const struct token *t, const char *expected,
                                   double *value)
{
    char number[NUMBER_ROOM], shown[QUOTE_ROOM];
    bool fits = t->length > 0 && t->length < sizeof number && !memchr(t->text, '\0', t->length);

    if (fits) {
        memcpy(number, t->text, t->length);
        number[t->length] = '\0';
    }
    if (!fits || !text_to_double(number, value)) {
        return refuse(r, t->place, "found %s, expected %s", quote(t, shown), expected);
    }
    return ERROR_NONE;
}

static enum error_code read_coordinate(struct reader *r, int axis, double *value)
{
    static const char *const expected[] = {"a finite decimal number for x (m)",
                                           "a finite decimal number for y (m)",
                                           "a finite decimal number for z (m)"};
    struct token t = next_token(r);
    enum error_code code = read_number(r, &t, expected[axis], value);
    char shown[QUOTE_ROOM];

    if (code == ERROR_NONE && !(fabs(*value) <= MESH_MAX_COORDINATE_M)) {
        return refuse(r, t.place, "found %s, expected a coordinate within %g m of the origin",
                      quote(&t, shown), MESH_MAX_COORDINATE_M);
    }
    return code;
}

static enum error_code read_vertex(struct reader *r, struct place place)
{
    enum error_code code;
    char shown[QUOTE_ROOM];

    if (r->nvertex == MESH_MAX_VERTICES) {
        return refuse(r, place, "found one more vertex, expected at most %zu", MESH_MAX_VERTICES);
    }
    if (!room_for_vertex(r)) {
        return no_memory(r);
    }
    for (int axis = 0; axis < 3; ++axis) {
        code = read_coordinate(r, axis, &r->vertex[r->nvertex][axis]);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    r->vertex_place[r->nvertex++] = place;

    struct token t = next_token(r);
    double weight = 1;

    if (t.length > 0) {
        code = read_number(r, &t, "the end of the line", &weight);
        if (code == ERROR_NONE && weight != 1) {
            code = refuse(r, t.place, "found weight %s, expected 1 (a polygon mesh has no other)",
                          quote(&t, shown));
        }
        if (code != ERROR_NONE) {
            return code;
        }
        t = next_token(r);
    }
    if (t.length > 0) {
        return refuse(r, t.place, "found %s, expected the end of the line after x y z [1]",
                      quote(&t, shown));
    }
    return ERROR_NONE;
}

/* ---- faces ---- */

/* A decimal integer at *text, not zero, of at most ten digits; moves *text behind it. */
static bool read_index(const char **text, const char *end, int64_t *value)
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

/* `v`, `v/vt`, `v//vn` or `v/vt/vn`; only v is kept. */
static bool split_corner(const struct token *t, int64_t *vertex)
{
    const char *at = t->text, *end = t->text + t->length;
    int64_t unused;

    if (!read_index(&at, end, vertex)) {
        return false;
    }
    if (at < end && *at == '/' && at + 1 < end && at[1] != '/') {
        ++at;
        if (!read_index(&at, end, &unused)) {
            return false;
        }
    } else if (at < end && *at == '/') {
        ++at;
        if (at == end) {
            return false;
        }
    }
    if (at < end && *at == '/') {
        ++at;
        if (!read_index(&at, end, &unused)) {
            return false;
        }
    }
    return at == end;
}

static enum error_code read_corner(struct reader *r, const struct token *t)
{
    char shown[QUOTE_ROOM];
    int64_t index;

    if (!split_corner(t, &index)) {
        return refuse(r, t->place,
                      "found %s, expected a corner v, v/vt, v//vn or v/vt/vn of indices that are "
                      "not 0",
                      quote(t, shown));
    }

    int64_t vertex = index > 0 ? index - 1 : (int64_t)r->nvertex + index;

    if (vertex < 0 || vertex >= (int64_t)r->nvertex) {
        return refuse(r, t->place,
                      "found vertex %lld, expected 1 to %zu or -1 to -%zu (the vertices above)",
                      (long long)index, r->nvertex, r->nvertex);
    }
    if (r->ncorner == MESH_MAX_CORNERS) {
        return refuse(r, t->place, "found one more corner, expected a polygon of at most %zu",
                      MESH_MAX_CORNERS);
    }
    r->polygon[r->ncorner] = (int)vertex;
    r->polygon_place[r->ncorner++] = t->place;
    return ERROR_NONE;
}

/* The polygon's unit normal (sum over the fan) and its largest edge. False without area. */
static bool polygon_frame(const struct reader *r, double normal[3], double *longest)
{
    const double *first = r->vertex[r->polygon[0]];
    double length;

    memset(normal, 0, 3 * sizeof *normal);
    *longest = 0;
    for (size_t i = 0; i < r->ncorner; ++i) {
        const double *here = r->vertex[r->polygon[i]];
        const double *next = r->vertex[r->polygon[(i + 1) % r->ncorner]];
        double a[3], b[3], part[3];

        vec3_sub(here, first, a);
        vec3_sub(next, first, b);
        vec3_cross(a, b, part);
        for (int axis = 0; axis < 3; ++axis) {
            normal[axis] += part[axis];
        }
        vec3_sub(next, here, a);
        *longest = fmax(*longest, vec3_norm(a));
    }
    length = vec3_norm(normal);
    if (!(length > 0)) {
        return false;
    }
    for (int axis = 0; axis < 3; ++axis) {
        normal[axis] /= length;
    }
    return true;
}

/* A fan covers a polygon once only when it is flat and convex. */
static enum error_code check_polygon(struct reader *r, struct place place)
{
    const double *first = r->vertex[r->polygon[0]];
    double normal[3], longest;

    if (!polygon_frame(r, normal, &longest)) {
        return refuse(r, place, "found a polygon without area, expected a flat convex one");
    }
    for (size_t i = 0; i < r->ncorner; ++i) {
        const double *here = r->vertex[r->polygon[i]];
        const double *next = r->vertex[r->polygon[(i + 1) % r->ncorner]];
        const double *after = r->vertex[r->polygon[(i + 2) % r->ncorner]];
        double a[3], b[3], turn[3];
        struct place next_place = r->polygon_place[(i + 1) % r->ncorner];

        vec3_sub(here, first, a);
        if (fabs(vec3_dot(a, normal)) > FLAT_RATIO * longest) {
            return refuse(r, r->polygon_place[i],
                          "found a corner %g m off its polygon's plane, expected a flat polygon; "
                          "split it into triangles",
                          fabs(vec3_dot(a, normal)));
        }
        vec3_sub(next, first, b);
        vec3_cross(a, b, turn);
        if (i > 0 && i + 1 < r->ncorner && !(vec3_dot(turn, normal) > 0)) {
            return refuse(r, next_place,
                          "found a polygon that its fan does not cover once, expected a convex "
                          "one; split it into triangles");
        }
        vec3_sub(next, here, a);
        vec3_sub(after, next, b);
        vec3_cross(a, b, turn);
        if (vec3_dot(turn, normal) < 0) {
            return refuse(r, next_place,
                          "found a corner that points inward, expected a convex "
                          "polygon; split it into triangles");
        }
    }
    return ERROR_NONE;
}

static enum error_code add_triangle(struct reader *r, size_t second)
{
    const size_t corner[3] = {0, second, second + 1};

    if (r->nface == MESH_MAX_FACES) {
        return refuse(r, r->polygon_place[0], "found one more triangle, expected at most %zu",
                      MESH_MAX_FACES);
    }
    if (!room_for_face(r)) {
        return no_memory(r);
    }
    for (int i = 0; i < 3; ++i) {
        r->face[r->nface][i] = r->polygon[corner[i]];
        r->corner_place[r->nface][i] = r->polygon_place[corner[i]];
    }
    r->nface++;
    return ERROR_NONE;
}

static enum error_code read_face(struct reader *r, struct place place)
{
    enum error_code code = ERROR_NONE;
    struct token t;

    r->ncorner = 0;
    for (t = next_token(r); t.length > 0; t = next_token(r)) {
        code = read_corner(r, &t);
        if (code != ERROR_NONE) {
            return code;
        }
    }
    if (r->ncorner < 3) {
        return refuse(r, t.place, "found a face of %zu corners, expected at least 3", r->ncorner);
    }
    if (r->ncorner > 3) {
        code = check_polygon(r, place);
    }
    for (size_t i = 1; code == ERROR_NONE && i + 1 < r->ncorner; ++i) {
        code = add_triangle(r, i);
    }
    return code;
}

/* ---- the whole file ---- */

static enum error_code read_statement(struct reader *r)
{
    static const char *const passed_over[] = {"vn", "vt", "o", "g", "s", "usemtl", "mtllib"};
    struct token t = next_token(r);
    char shown[QUOTE_ROOM];

    if (t.length == 0) {
        return ERROR_NONE;
    }
    if (t.text[0] == '#') {
        /* a comment may end in anything, a backslash too */
        r->at = (size_t)(t.text - r->text);
        skip_line(r, false);
        return ERROR_NONE;
    }
    if (token_is(&t, "v")) {
        return read_vertex(r, t.place);
    }
    if (token_is(&t, "f")) {
        return read_face(r, t.place);
    }
    for (size_t i = 0; i < sizeof passed_over / sizeof *passed_over; ++i) {
        if (token_is(&t, passed_over[i])) {
            skip_line(r, true);
            return ERROR_NONE;
        }
    }
    return refuse(r, t.place,
                  "found %s, expected v, f, a comment, or one of vn vt o g s usemtl mtllib",
                  quote(&t, shown));
}

static enum error_code read_statements(struct reader *r)
{
    enum error_code code = ERROR_NONE;

    while (code == ERROR_NONE && r->at < r->size) {
        code = read_statement(r);
        if (code == ERROR_NONE && r->at < r->size) {
            begin_line(r, r->at + line_end(r, r->at));
        }
    }
    return code;
}

/* Puts a finding of mesh_check at its place in the file. */
static enum error_code refuse_surface(struct reader *r, const struct mesh_finding *f)
{
    const char *what = mesh_fault_text(f->fault);

    if (f->fault == MESH_EMPTY) {
        return refuse(r, (struct place){r->line, 1}, "found no faces, expected a closed surface");
    }
    if (f->fault == MESH_UNUSED_VERTEX) {
        return refuse(r, r->vertex_place[f->vertex[0]],
                      "found vertex %d in no face, expected every vertex in use", f->vertex[0] + 1);
    }

    struct place place = r->corner_place[f->face][f->corner];
    size_t other = r->corner_place[f->other_face][0].line;

    switch (f->fault) {
    case MESH_INWARD:
        return refuse(r, r->corner_place[0][0],
                      "found %s (enclosed volume not positive), expected faces that run "
                      "counterclockwise seen from outside",
                      what);
    case MESH_DEGENERATE_FACE:
        return refuse(r, place, "found a %s, expected three corners that span an area", what);
    case MESH_DUPLICATE_FACE:
        return refuse(r, place, "found a %s of the one in line %zu, expected each once", what,
                      other);
    case MESH_PINCHED_VERTEX:
        return refuse(r, place, "found a %s (vertex %d), expected one fan of faces around it", what,
                      f->vertex[0] + 1);
    case MESH_OPEN_EDGE:
        return refuse(r, place,
                      "found an %s from vertex %d to %d, expected a closed surface (two faces on "
                      "every edge, shared vertices written once)",
                      what, f->vertex[0] + 1, f->vertex[1] + 1);
    default:
        return refuse(r, place,
                      "found %s %s at vertices %d and %d (see line %zu), expected two faces that "
                      "run the edge in opposite directions",
                      f->fault == MESH_FLIPPED_FACE ? "two" : "an", what, f->vertex[0] + 1,
                      f->vertex[1] + 1, other);
    }
}

/* Copies what was read into the arena. */
static enum error_code keep(struct reader *r, struct arena *arena, const struct mesh **mesh)
{
    struct mesh *m = arena_alloc(arena, 1, sizeof *m);
    double(*vertex)[3] = arena_alloc(arena, r->nvertex, sizeof *vertex);
    int(*face)[3] = arena_alloc(arena, r->nface, sizeof *face);
    const char *name = arena_strdup(arena, r->name);

    if (!m || !vertex || !face || !name) {
        return no_memory(r);
    }
    memcpy(vertex, r->vertex, r->nvertex * sizeof *vertex);
    memcpy(face, r->face, r->nface * sizeof *face);
    *m = (struct mesh){.name = name,
                       .nvertex = r->nvertex,
                       .nface = r->nface,
                       .vertex = (const double(*)[3])vertex,
                       .face = (const int(*)[3])face};
    *mesh = m;
    return ERROR_NONE;
}

enum error_code mesh_read_obj_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, const struct mesh **mesh,
                                   struct error *error)
{
    struct reader r = {.name = name, .text = text, .size = size, .line = 1, .error = error};
    enum error_code code = read_statements(&r);

    if (code == ERROR_NONE) {
        const struct mesh draft = {.name = name,
                                   .nvertex = r.nvertex,
                                   .nface = r.nface,
                                   .vertex = (const double(*)[3])r.vertex,
                                   .face = (const int(*)[3])r.face};
        struct mesh_finding finding;

        code = mesh_check(&draft, &finding, error);
        if (code == ERROR_NONE) {
            code =
                finding.fault == MESH_SOUND ? keep(&r, arena, mesh) : refuse_surface(&r, &finding);
        }
    }
    free(r.vertex);
    free(r.vertex_place);
    free(r.face);
    free(r.corner_place);
    return code;
}

/* Reads all of a regular file; the caller frees *text. */
static enum error_code slurp(const char *path, int fd, char **text, size_t *size,
                             struct error *error)
{
    struct stat about;

    if (fstat(fd, &about) != 0) {
        return error_set_file(error, errno, path, "cannot be examined");
    }
    if (!S_ISREG(about.st_mode)) {
        return error_set(error, ERROR_INPUT, "%s: found something else, expected a regular file",
                         path);
    }
    if ((uintmax_t)about.st_size > MESH_MAX_FILE_BYTES) {
        return error_set(error, ERROR_INPUT, "%s: found %jd bytes, expected at most %zu", path,
                         (intmax_t)about.st_size, MESH_MAX_FILE_BYTES);
    }
    *text = malloc((size_t)about.st_size + 1);
    if (!*text) {
        return error_set(error, ERROR_MEMORY, "%s: no memory for its %jd bytes", path,
                         (intmax_t)about.st_size);
    }
    while (*size < (size_t)about.st_size) {
        ssize_t got = read(fd, *text + *size, (size_t)about.st_size - *size);

        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            return error_set_errno(error, errno, "%s: cannot be read", path);
        }
        if (got == 0) {
            break; /* it became shorter meanwhile */
        }
        *size += (size_t)got;
    }
    return ERROR_NONE;
}

enum error_code mesh_read_obj(const char *path, struct arena *arena, const struct mesh **mesh,
                              struct error *error)
{
    /* a FIFO must not hold us up */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    char *text = NULL;
    size_t size = 0;
    enum error_code code;

    if (fd < 0) {
        return error_set_file(error, errno, path, "cannot be opened");
    }
    code = slurp(path, fd, &text, &size, error);
    if (code == ERROR_NONE) {
        code = mesh_read_obj_text(path, text, size, arena, mesh, error);
    }
    free(text);
    close(fd);
    return code;
}

/* The shortest decimal that reads back as value. */
static void print_exact(FILE *file, double value)
{
    char text[32];

    for (int digits = 1; digits <= 17; ++digits) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    fprintf(file, " %s", text);
}

enum error_code mesh_write_obj(const struct mesh *mesh, FILE *file, struct error *error)
{
    for (size_t v = 0; v < mesh->nvertex; ++v) {
        fputc('v', file);
        for (int i = 0; i < 3; ++i) {
            print_exact(file, mesh->vertex[v][i]);
        }
        fputc('\n', file);
    }
    for (size_t f = 0; f < mesh->nface; ++f) {
        fprintf(file, "f %d %d %d\n", mesh->face[f][0] + 1, mesh->face[f][1] + 1,
                mesh->face[f][2] + 1);
    }
    if (fflush(file) != 0 || ferror(file)) {
        return error_set_errno(error, errno, "%s: cannot be written", mesh->name);
    }
    return ERROR_NONE;
}
