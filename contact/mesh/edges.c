/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sorts half-edges. Counted into buckets by their lower vertex they keep the order of their
 * numbers; a bucket has as many as its vertex has edges, some six, and is sorted by insertion. A
 * hub of many edges is sorted by comparison: no input makes it slow.
 */
#include "contact/mesh/edges.h"

#include <stdlib.h>

enum { FEW = 32 }; /* half-edges that insertion sorts faster */

/* Compares half-edges of one low vertex by high vertex, then number, for qsort. */
static int compare_half_edges(const void *a, const void *b)
{
    const struct half_edge *x = a, *y = b;

    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return (x->number > y->number) - (x->number < y->number);
}

/* Sorts n half-edges of one low vertex, which come in the order of their numbers. */
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

    /* Where each vertex's bucket begins; filled, where it ends */
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
