/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two meshes over their true overlap: finds which of their facets face each other there. The
 * springs between two such facets are contact/native/facets.h's.
 *
 * Pairs of facets are found in three steps, each cheaper for every facet than the next: the tree
 * of the first mesh over the box that both have in common; planes and bounding circles, as many
 * facets of the second at a time as there are lanes; and the corners of the facet that has fewer of
 * them.
 */
#include "contact/lanes.h"
#include "contact/native/facets.h"
#include "base/vec3.h"

#include <float.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* Facets this small against the smaller mesh need no more springs than three: a side of four
 * corners has them no closer to each other. */
#define FINE 0.25

/* Computes the intersection of two boxes; false when it is empty. thin: lowered to its least
 * extent, m. */
static bool box_intersect(const struct box *a, const struct box *b, struct box *out, double *thin)
{
    for (int k = 0; k < 3; k++) {
        out->low[k] = a->low[k] > b->low[k] ? a->low[k] : b->low[k];
        out->high[k] = a->high[k] < b->high[k] ? a->high[k] : b->high[k];
        if (out->high[k] <= out->low[k]) {
            return false;
        }
        *thin = out->high[k] - out->low[k] < *thin ? out->high[k] - out->low[k] : *thin;
    }
    return true;
}

/* Transforms the facets of the second mesh into the first's frame that are in the box where both
 * meshes are (here and there: in the frame of the first and of the second) and have some of that
 * box behind them. Returns their number. */
static size_t meshes_view_second(const struct facets_between *m, const struct box *here,
                                 const struct box *there)
{
    struct native_view *view = &m->scratch->view;
    int *list = m->scratch->list[1];
    size_t n = tree_collect(&m->second->facets, there, list, m->second->nfacet), count = 0;

    for (size_t i = 0; i < n; i++) {
        const struct facet *f = &m->second->facet[list[i]];
        double normal[3], center[3];

        /* Is some of the box behind it? */
        mat3_apply(m->relative->R, f->normal, normal);
        mat3_apply(m->relative->R, f->center, center);
        vec3_add_scaled(center, 1, m->relative->p, center);
        if (box_least(here, normal) >= vec3_dot(normal, center)) {
            continue;
        }

        /* Then it is kept, in the first's frame */
        for (int k = 0; k < 3; k++) {
            view->normal[k][count] = normal[k];
            view->center[k][count] = center[k];
        }
        view->radius[count] = f->radius;
        view->ring[count] = -1;
        list[count++] = list[i];
    }

    /* Without a normal, the padding faces nothing */
    for (size_t i = count; i % LANES; i++) {
        for (int k = 0; k < 3; k++) {
            view->normal[k][i] = view->center[k][i] = 0;
        }
        view->radius[i] = 0;
    }
    view->ncorner = 0;
    return count;
}

/* Returns the corners of a facet of the second mesh in the first's frame; they are transformed when
 * they are needed for the first time. */
static const double (*view_facet_ring(const struct facets_between *m, int i))[3]
{
    struct native_view *view = &m->scratch->view;
    const struct facet *f = &m->second->facet[m->scratch->list[1][i]];

    if (view->ring[i] < 0) {
        view->ring[i] = view->ncorner;
        for (int v = 0; v < f->count; v++) {
            double *corner = view->corner[view->ncorner++];

            mat3_apply(m->relative->R, m->second->ring[f->first + v], corner);
            vec3_add_scaled(corner, 1, m->relative->p, corner);
        }
    }
    return (const double(*)[3])view->corner + view->ring[i];
}

/* Finds the facets of the second mesh that face this one of the first, as far as each reaches
 * behind the other's plane; returns how many. reach: longest spring, m. */
static size_t view_find_facing(const struct native_view *view, size_t n, const struct facet *a,
                               double reach, int *found)
{
    const double *normal = a->normal, *center = a->center;
    const lanes zero = {0};
    size_t count = 0;

    for (size_t at = 0; at < n; at += LANES) {
        lanes bx = lanes_load(view->normal[0] + at), by = lanes_load(view->normal[1] + at),
              bz = lanes_load(view->normal[2] + at);

        /* Normals against each other */
        lanes_mask yes =
            lanes_less(normal[0] * bx + normal[1] * by + normal[2] * bz, zero - FACING_NONE);

        if (lanes_bits(yes) == 0) {
            continue;
        }

        /* Bounding circles near each other and each behind the other's plane */
        lanes radius = lanes_load(view->radius + at), near = a->radius + radius + reach;
        lanes x = lanes_load(view->center[0] + at) - center[0],
              y = lanes_load(view->center[1] + at) - center[1],
              z = lanes_load(view->center[2] + at) - center[2];

        yes &= lanes_less(normal[0] * x + normal[1] * y + normal[2] * z, radius);
        yes &= lanes_less(zero - a->radius, bx * x + by * y + bz * z);
        yes &= lanes_less(x * x + y * y + z * z, near * near);
        for (uint64_t bits = lanes_bits(yes); bits != 0; bits &= bits - 1) {
            found[count++] = (int)at + __builtin_ctzll(bits);
        }
    }
    return count;
}

/* Adds the springs between one facet of the first mesh and the nsecond that are viewed of the
 * second. */
static void meshes_add_facet(const struct facets_between *m, const struct facet *a, size_t nsecond)
{
    struct native_scratch *scratch = m->scratch;
    const struct native_view *view = &scratch->view;
    size_t n = view_find_facing(view, nsecond, a, m->reach, scratch->list[0]);

    for (size_t k = 0; k < n; k++) {
        int i = scratch->list[0][k];
        const struct facet *b = &m->second->facet[scratch->list[1][i]];
        struct facets_couple c = {
            .a = a,
            .b = b,
            .ring = a->count < b->count ? m->first->ring + a->first : view_facet_ring(m, i),
            .normal_b = {view->normal[0][i], view->normal[1][i], view->normal[2][i]},
            .center_b = {view->center[0][i], view->center[1][i], view->center[2][i]},
        };

        c.facing = -vec3_dot(a->normal, c.normal_b);
        facets_add_springs(m, &c);
    }
}

/* Checks whether any facet of the first mesh is in the box where both are and has some of it
 * behind: when not, there is nothing to view the second's for. */
static bool meshes_reach_first(const struct solid *first, const struct box *here)
{
    const struct tree *tree = &first->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);

    while (node != end) {
        if (!boxes_meet(&node->box, here)) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            const struct facet *f = &first->facet[tree->item[node->first + i]];

            if (box_least(here, f->normal) < f->offset) {
                return true;
            }
        }
        ++node;
    }
    return false;
}

void native_overlap_meshes(const struct solid *first, const struct solid *second,
                           const struct native_law *law, const struct native_relative *relative,
                           struct native_scratch *scratch, struct native_sum *sum)
{
    struct facets_between m = {first, second, law, relative, scratch, sum, 0, 0};
    double thin = DBL_MAX, back[9], origin[3];
    struct box moved = box_transform(&second->box, relative->R, relative->p), here, there;
    const struct tree *tree = &first->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);
    size_t nsecond;

    /* The box where both meshes are, in the frame of the first (here) and of the second (there) */
    for (int i = 0; i < 9; i++) {
        back[i] = relative->R[i % 3 * 3 + i / 3];
    }
    mat3_apply(back, relative->p, origin);
    for (int k = 0; k < 3; k++) {
        origin[k] = -origin[k];
    }
    if (!box_intersect(&first->box, &moved, &here, &thin)) {
        return;
    }
    moved = box_transform(&first->box, back, origin);
    if (!box_intersect(&second->box, &moved, &there, &thin)) {
        return;
    }

    if (!meshes_reach_first(first, &here)) {
        return;
    }

    /* A ball in the overlap has no room for a larger diameter than thin */
    m.reach = thin / DEPTH_NONE;
    m.fine = FINE * (first->radius < second->radius ? first->radius : second->radius);

    /* Each facet of the first there against those of the second */
    nsecond = meshes_view_second(&m, &here, &there);
    while (nsecond > 0 && node != end) {
        if (!boxes_meet(&node->box, &here)) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            const struct facet *f = &first->facet[tree->item[node->first + i]];

            /* Is some of the box behind it? */
            if (box_least(&here, f->normal) < f->offset) {
                meshes_add_facet(&m, f, nsecond);
            }
        }
        ++node;
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}
