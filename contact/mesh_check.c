/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Soundness of a triangle surface. Edges and faces are sorted, not hashed: the order of what is
 * found does not depend on chance, and no input makes it slow.
 */
#include "contact/mesh.h"

#include "base/vec3.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Twice the area over the square of the longest edge, below which a face counts as degenerate. */
#define DEGENERATE_RATIO 1e-10

/* One directed side of a face: the half-edge from corner `half % 3` of face `half / 3`. */
struct side {
    int low, high; /* its vertices, sorted */
    size_t half;
    bool forward; /* runs from low to high */
};

/* The three vertices of a face, sorted. */
struct triple {
    int vertex[3];
    size_t face;
};

struct check {
    const struct mesh *mesh;
    struct mesh_finding *finding;
    struct side *side;     /* 3 * nface */
    struct triple *triple; /* nface */
    size_t *twin;          /* 3 * nface: the half-edge on the other side */
    unsigned char *seen;   /* 3 * nface */
    unsigned char *used;   /* nvertex */
};

const char *mesh_fault_text(enum mesh_fault fault)
{
    static const char *const text[] = {
        [MESH_SOUND] = "sound",
        [MESH_EMPTY] = "no faces",
        [MESH_BAD_INDEX] = "vertex that does not exist",
        [MESH_BAD_COORDINATE] = "coordinate out of range",
        [MESH_DEGENERATE_FACE] = "degenerate face",
        [MESH_DUPLICATE_FACE] = "duplicate face",
        [MESH_OPEN_EDGE] = "open edge",
        [MESH_NON_MANIFOLD_EDGE] = "edge with more than two faces",
        [MESH_FLIPPED_FACE] = "neighboring faces of opposite orientation",
        [MESH_PINCHED_VERTEX] = "vertex in which separate surfaces touch",
        [MESH_UNUSED_VERTEX] = "vertex without a face",
        [MESH_INWARD] = "inward orientation",
    };

    return text[fault];
}

/* Keeps the finding whose face comes first, so that a person meets faults in file order. */
static void report(struct check *c, enum mesh_fault fault, size_t half, size_t other_half)
{
    struct mesh_finding *f = c->finding;
    size_t face = half / 3;
    int corner = (int)(half % 3);

    if (f->fault != MESH_SOUND && (f->face < face || (f->face == face && f->corner <= corner))) {
        return;
    }
    *f = (struct mesh_finding){
        .fault = fault,
        .face = face,
        .other_face = other_half / 3,
        .corner = corner,
        .vertex = {c->mesh->face[face][corner], c->mesh->face[face][(corner + 1) % 3]}};
}

static bool indices_and_coordinates(struct check *c)
{
    const struct mesh *m = c->mesh;

    if (m->nface == 0) {
        c->finding->fault = MESH_EMPTY;
        return false;
    }
    for (size_t half = 0; half < 3 * m->nface; ++half) {
        int v = m->face[half / 3][half % 3];

        if (v < 0 || (size_t)v >= m->nvertex) {
            *c->finding = (struct mesh_finding){.fault = MESH_BAD_INDEX,
                                                .face = half / 3,
                                                .corner = (int)(half % 3),
                                                .vertex = {v, v}};
            return false;
        }
        for (int i = 0; i < 3; ++i) {
            if (!(fabs(m->vertex[v][i]) <= MESH_MAX_COORDINATE_M)) {
                report(c, MESH_BAD_COORDINATE, half, half);
                return false;
            }
        }
    }
    return true;
}

static bool faces_have_area(struct check *c)
{
    const struct mesh *m = c->mesh;

    for (size_t f = 0; f < m->nface; ++f) {
        const double *p[3];
        double e[3][3], longest = 0, area[3];

        for (int i = 0; i < 3; ++i) {
            p[i] = m->vertex[m->face[f][i]];
        }
        for (int i = 0; i < 3; ++i) {
            vec3_sub(p[(i + 1) % 3], p[i], e[i]);
            longest = fmax(longest, vec3_dot(e[i], e[i]));
        }
        vec3_cross(e[0], e[1], area);
        if (!(vec3_norm(area) > DEGENERATE_RATIO * longest)) {
            report(c, MESH_DEGENERATE_FACE, 3 * f, 3 * f);
            return false;
        }
    }
    return true;
}

static int compare_triples(const void *a, const void *b)
{
    const struct triple *x = a, *y = b;

    for (int i = 0; i < 3; ++i) {
        if (x->vertex[i] != y->vertex[i]) {
            return x->vertex[i] < y->vertex[i] ? -1 : 1;
        }
    }
    return (x->face > y->face) - (x->face < y->face);
}

static bool faces_are_distinct(struct check *c)
{
    size_t n = c->mesh->nface;

    for (size_t f = 0; f < n; ++f) {
        const int *v = c->mesh->face[f];
        int low = v[0] < v[1] ? v[0] : v[1], high = v[0] < v[1] ? v[1] : v[0];
        int first = low < v[2] ? low : v[2], last = high > v[2] ? high : v[2];

        c->triple[f] = (struct triple){{first, v[0] ^ v[1] ^ v[2] ^ first ^ last, last}, f};
    }
    qsort(c->triple, n, sizeof *c->triple, compare_triples);
    for (size_t i = 1; i < n; ++i) {
        if (memcmp(c->triple[i].vertex, c->triple[i - 1].vertex, sizeof c->triple[i].vertex) == 0) {
            report(c, MESH_DUPLICATE_FACE, 3 * c->triple[i].face, 3 * c->triple[i - 1].face);
        }
    }
    return c->finding->fault == MESH_SOUND;
}

static int compare_sides(const void *a, const void *b)
{
    const struct side *x = a, *y = b;

    if (x->low != y->low) {
        return x->low < y->low ? -1 : 1;
    }
    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return (x->half > y->half) - (x->half < y->half);
}

/* Pairs the sides of each edge. */
static bool edges_join_two_faces(struct check *c)
{
    size_t n = 3 * c->mesh->nface;

    for (size_t half = 0; half < n; ++half) {
        const int *v = c->mesh->face[half / 3];
        int from = v[half % 3], to = v[(half + 1) % 3];

        c->side[half] =
            (struct side){from < to ? from : to, from < to ? to : from, half, from < to};
    }
    qsort(c->side, n, sizeof *c->side, compare_sides);

    for (size_t i = 0, end; i < n; i = end) {
        const struct side *s = c->side + i;

        for (end = i + 1; end < n && c->side[end].low == s->low && c->side[end].high == s->high;) {
            ++end;
        }
        if (end - i == 1) {
            report(c, MESH_OPEN_EDGE, s->half, s->half);
        } else if (end - i > 2) {
            report(c, MESH_NON_MANIFOLD_EDGE, s[2].half, s->half);
        } else if (s[0].forward == s[1].forward) {
            report(c, MESH_FLIPPED_FACE, s[1].half, s[0].half);
        } else {
            c->twin[s[0].half] = s[1].half;
            c->twin[s[1].half] = s[0].half;
        }
    }
    return c->finding->fault == MESH_SOUND;
}

/* Walks the fan of faces around each vertex; a second fan at the same vertex is a pinch. */
static bool vertices_have_one_fan(struct check *c)
{
    for (size_t half = 0; half < 3 * c->mesh->nface; ++half) {
        int v = c->mesh->face[half / 3][half % 3];

        if (c->seen[half]) {
            continue;
        }
        if (c->used[v]) {
            report(c, MESH_PINCHED_VERTEX, half, half);
            return false;
        }
        c->used[v] = 1;
        for (size_t h = half; !c->seen[h];) {
            size_t previous = h - h % 3 + (h % 3 + 2) % 3;

            c->seen[h] = 1;
            h = c->twin[previous];
        }
    }
    for (size_t v = 0; v < c->mesh->nvertex; ++v) {
        if (!c->used[v]) {
            *c->finding =
                (struct mesh_finding){.fault = MESH_UNUSED_VERTEX, .vertex = {(int)v, (int)v}};
            return false;
        }
    }
    return true;
}

enum error_code mesh_check(const struct mesh *mesh, struct mesh_finding *finding,
                           struct error *error)
{
    size_t nhalf = 3 * mesh->nface;
    struct check c = {.mesh = mesh, .finding = finding};
    enum error_code code = ERROR_NONE;

    *finding = (struct mesh_finding){.fault = MESH_SOUND};
    if (!indices_and_coordinates(&c) || !faces_have_area(&c)) {
        return ERROR_NONE;
    }
    c.side = calloc(nhalf, sizeof *c.side);
    c.triple = calloc(mesh->nface, sizeof *c.triple);
    c.twin = calloc(nhalf, sizeof *c.twin);
    c.seen = calloc(nhalf, 1);
    c.used = calloc(mesh->nvertex, 1);
    if (!c.side || !c.triple || !c.twin || !c.seen || !c.used) {
        code = error_set(error, ERROR_MEMORY, "%s: no memory to check %zu faces", mesh->name,
                         mesh->nface);
    } else if (faces_are_distinct(&c) && edges_join_two_faces(&c) && vertices_have_one_fan(&c) &&
               !(mesh_volume(mesh) > 0)) {
        finding->fault = MESH_INWARD;
    }
    free(c.side);
    free(c.triple);
    free(c.twin);
    free(c.seen);
    free(c.used);
    return code;
}
