/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks whether a triangle surface is sound (closed, oriented, without pinches) by its half-edges:
 * each face has three, and each shared edge pairs two. Edges and faces are sorted, not hashed, so
 * that the order of findings is fixed and the worst-case time is bounded.
 */
#include "contact/mesh/mesh.h"
#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>

/* Minimum ratio of twice the area to the squared longest edge; a face below it is degenerate. */
#define DEGENERATE_RATIO 1e-10

struct mesh_checker {
    const struct mesh *mesh;
    struct mesh_finding *finding;
    struct half_edge *half_edge; /* 3 * nface, sorted */
    int *twin;                   /* 3 * nface: number of the opposite half-edge */
    unsigned char *seen;         /* 3 * nface */
    unsigned char *used;         /* nvertex */
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

/* ---- half-edges in order ---- */

/* Half-edges are sorted into buckets by lower vertex. A bucket has one half-edge per edge of its
 * vertex, about six. It is sorted by insertion; a large bucket is sorted with qsort. Sorting all
 * half-edges with qsort would take 6 % more instructions at a start (walk-bump-9cm). */
enum { FEW = 32 }; /* largest bucket sorted by insertion */

/* Compares half-edges of one low vertex by high vertex, then number, for qsort. */
static int compare_half_edges(const void *a, const void *b)
{
    const struct half_edge *x = a, *y = b;

    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return (x->number > y->number) - (x->number < y->number);
}

/* Sorts n half-edges with the same low vertex, given in the order of their numbers. */
static void bucket_sort_half_edges(struct half_edge *bucket, int n)
{
    if (n > FEW) {
        qsort(bucket, (size_t)n, sizeof *bucket, compare_half_edges);
        return;
    }
    for (int i = 1; i < n; i++) {
        struct half_edge e = bucket[i];
        int at = i;

        while (at > 0 && bucket[at - 1].high > e.high) {
            bucket[at] = bucket[at - 1];
            --at;
        }
        bucket[at] = e;
    }
}

/* Returns the half-edge of a mesh with this number. */
static struct half_edge mesh_half_edge(const struct mesh *mesh, int number)
{
    const int *v = mesh->face[number / 3];
    int from = v[number % 3], to = v[(number + 1) % 3];

    return (struct half_edge){from < to ? from : to, from < to ? to : from, number, from < to};
}

enum error_code mesh_sort_half_edges(const struct mesh *mesh, struct half_edge *sorted,
                                     struct error *error)
{
    const int n = 3 * (int)mesh->nface;
    int *end = calloc(mesh->nvertex + 1, sizeof *end);

    if (!end) {
        return error_set(error, ERROR_MEMORY, "%s: no memory to sort %d edges", mesh->name, n);
    }

    /* Start of each vertex's bucket; after filling, the end of the bucket */
    for (int i = 0; i < n; i++) {
        ++end[mesh_half_edge(mesh, i).low + 1];
    }
    for (size_t v = 0; v < mesh->nvertex; v++) {
        end[v + 1] += end[v];
    }
    for (int i = 0; i < n; i++) {
        struct half_edge e = mesh_half_edge(mesh, i);

        sorted[end[e.low]++] = e;
    }
    for (size_t v = 0; v < mesh->nvertex; v++) {
        int begin = v > 0 ? end[v - 1] : 0;

        bucket_sort_half_edges(sorted + begin, end[v] - begin);
    }
    free(end);
    return ERROR_NONE;
}

/* ---- faults ---- */

/* Stores a finding unless an earlier face already has one, so that findings are reported in file
 * order. half, other: the faulty half-edge and its counterpart. */
static void mesh_report_fault(struct mesh_checker *c, enum mesh_fault fault, size_t half,
                              size_t other)
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
        .other_face = other / 3,
        .corner = corner,
        .vertex = {c->mesh->face[face][corner], c->mesh->face[face][(corner + 1) % 3]}};
}

/* Checks that there are faces, that their indices exist, and that coordinates are in range;
 * reports the first fault. */
static bool mesh_is_in_range(struct mesh_checker *c)
{
    const struct mesh *m = c->mesh;

    if (m->nface == 0) {
        c->finding->fault = MESH_EMPTY;
        return false;
    }
    /* Each corner's index, then its coordinates */
    for (size_t half = 0; half < 3 * m->nface; half++) {
        int v = m->face[half / 3][half % 3];

        if (v < 0 || (size_t)v >= m->nvertex) {
            *c->finding = (struct mesh_finding){.fault = MESH_BAD_INDEX,
                                                .face = half / 3,
                                                .corner = (int)(half % 3),
                                                .vertex = {v, v}};
            return false;
        }
        for (int i = 0; i < 3; i++) {
            if (!(fabs(m->vertex[v][i]) <= MESH_MAX_COORDINATE_M)) {
                mesh_report_fault(c, MESH_BAD_COORDINATE, half, half);
                return false;
            }
        }
    }
    return true;
}

/* Checks that no face is degenerate: twice its area relative to its squared longest edge. */
static bool mesh_faces_have_area(struct mesh_checker *c)
{
    const struct mesh *m = c->mesh;

    for (size_t f = 0; f < m->nface; f++) {
        double edge[3][3], longest = 0, area[3];

        for (int i = 0; i < 3; i++) {
            vec3_sub(m->vertex[m->face[f][(i + 1) % 3]], m->vertex[m->face[f][i]], edge[i]);
            longest = fmax(longest, vec3_dot(edge[i], edge[i]));
        }
        vec3_cross(edge[0], edge[1], area);
        if (!(vec3_norm(area) > DEGENERATE_RATIO * longest)) {
            mesh_report_fault(c, MESH_DEGENERATE_FACE, 3 * f, 3 * f);
            return false;
        }
    }
    return true;
}

/* Reports a face that has the same three vertices as another face of the same edge. half and other:
 * half-edges of both faces on this edge. Returns whether the vertices are the same. */
static bool mesh_report_duplicate(struct mesh_checker *c, int half, int other)
{
    const int(*face)[3] = c->mesh->face;
    bool same = face[half / 3][(half + 2) % 3] == face[other / 3][(other + 2) % 3];

    if (same) {
        mesh_report_fault(c, MESH_DUPLICATE_FACE, (size_t)half - (size_t)half % 3, (size_t)other);
    }
    return same;
}

/* Finds the twin of each half-edge. Reports edges that do not join two faces of the same
 * orientation, and duplicate faces. */
static void mesh_pair_half_edges(struct mesh_checker *c)
{
    size_t n = 3 * c->mesh->nface;
    const struct half_edge *all = c->half_edge;

    /* A sound edge has two half-edges in opposite directions, neighbors after sorting */
    for (size_t i = 0, end; i < n; i = end) {
        const struct half_edge *e = all + i;

        bool duplicate = false;

        for (end = i + 1; end < n && all[end].low == e->low && all[end].high == e->high; ++end) {
            duplicate |= mesh_report_duplicate(c, all[end].number, e->number) ||
                         mesh_report_duplicate(c, all[end].number, all[end - 1].number);
        }
        if (duplicate) {
            continue;
        }
        if (end - i == 1) {
            mesh_report_fault(c, MESH_OPEN_EDGE, (size_t)e->number, (size_t)e->number);
        } else if (end - i > 2) {
            mesh_report_fault(c, MESH_NON_MANIFOLD_EDGE, (size_t)e[2].number, (size_t)e->number);
        } else if (e[0].forward == e[1].forward) {
            mesh_report_fault(c, MESH_FLIPPED_FACE, (size_t)e[1].number, (size_t)e[0].number);
        } else {
            c->twin[e[0].number] = e[1].number;
            c->twin[e[1].number] = e[0].number;
        }
    }
}

/* Checks that the faces around each vertex form one fan (a second fan is a pinch), and that each
 * vertex is in a face. */
static bool mesh_vertices_have_one_fan(struct mesh_checker *c)
{
    for (size_t half = 0; half < 3 * c->mesh->nface; half++) {
        int v = c->mesh->face[half / 3][half % 3];

        /* A half-edge that no earlier walk visited belongs to another fan */
        if (c->seen[half]) {
            continue;
        }
        if (c->used[v]) {
            mesh_report_fault(c, MESH_PINCHED_VERTEX, half, half);
            return false;
        }

        /* Walks once around the vertex, from face to face */
        c->used[v] = 1;
        for (size_t h = half; !c->seen[h];) {
            size_t previous = h - h % 3 + (h % 3 + 2) % 3;

            c->seen[h] = 1;
            h = (size_t)c->twin[previous];
        }
    }
    for (size_t v = 0; v < c->mesh->nvertex; v++) {
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
    struct mesh_checker c = {.mesh = mesh, .finding = finding};
    enum error_code code = ERROR_NONE;

    /* Checks ranges first, since all later steps index with the numbers and divide by them */
    *finding = (struct mesh_finding){.fault = MESH_SOUND};
    if (!mesh_is_in_range(&c) || !mesh_faces_have_area(&c)) {
        return ERROR_NONE;
    }

    c.half_edge = calloc(nhalf, sizeof *c.half_edge);
    c.twin = calloc(nhalf, sizeof *c.twin);
    c.seen = calloc(nhalf, 1);
    c.used = calloc(mesh->nvertex, 1);
    if (!c.half_edge || !c.twin || !c.seen || !c.used) {
        code = error_set(error, ERROR_MEMORY, "%s: no memory to check %zu faces", mesh->name,
                         mesh->nface);
        goto done;
    }

    /* Each step relies on the checks of the earlier steps */
    code = mesh_sort_half_edges(mesh, c.half_edge, error);
    if (!code) {
        mesh_pair_half_edges(&c);
    }
    if (!code && finding->fault == MESH_SOUND && mesh_vertices_have_one_fan(&c) &&
        !(mesh_volume(mesh) > 0)) {
        finding->fault = MESH_INWARD;
    }

done:
    free(c.half_edge);
    free(c.twin);
    free(c.seen);
    free(c.used);
    return code;
}
