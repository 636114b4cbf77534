/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A mesh on a half-space: one bed of springs on the plane, along its normal, as long as the
 * penetration of the mesh is deep there. Its undamped force is the stiffness times the penetration
 * volume, however the mesh is cut into triangles.
 */
#include "contact/native/pairs.h"
#include "contact/native/polygon.h"
#include "contact/native/sunk.h"
#include "base/vec3.h"

#include <float.h>
#include <string.h>

#define FACING 0.5 /* cosine; facets that face the plane less have few springs, however large */

/* Adds a facet that is all below the plane: in closed form where that is enough, else a spring at
 * each point of quadrature that it keeps. */
static void half_space_add_sunk_facet(struct native_scratch *s, const struct solid *solid,
                                      const struct facet *f, const struct sunk_linear *bed,
                                      const double n[3], double height, double pressure,
                                      const struct native_law *law,
                                      const struct native_relative *relative,
                                      struct native_sum *sum)
{
    const double share = law->share[0];

    if (f->moments >= 0 && sum->gather && sum->one_way &&
        sunk_gather(solid, f, bed, n, pressure, law, relative, sum)) {
        sum->closed = true;
        return;
    }
    for (int done = 0; done < f->npoint;) {
        int room, take = f->npoint - done;
        struct native_batch *b = &s->batch;

        /* As many at a time as there is room for */
        native_law_make_room(&s->batch, 8, law, relative, sum);
        room = (int)(BATCH_MAX - b->n);
        take = take < room ? take : room;
        for (int i = 0; i < take; i++) {
            size_t from = (size_t)(f->point + done + i), to = b->n + (size_t)i;
            double x = solid->point[0][from], y = solid->point[1][from], z = solid->point[2][from];
            double depth = height - (n[0] * x + n[1] * y + n[2] * z);

            /* From the facet toward the plane by its share of the depth */
            b->p[0][to] = x + share * depth * n[0];
            b->p[1][to] = y + share * depth * n[1];
            b->p[2][to] = z + share * depth * n[2];
            b->d[0][to] = n[0];
            b->d[1][to] = n[1];
            b->d[2][to] = n[2];
            b->rate[to] = pressure * solid->weight[from];
            b->force[to] = b->rate[to] * depth;
            b->depth[to] = depth;
        }
        b->n += (size_t)take;
        done += take;
    }
}

/* Adds a facet's springs. n: the plane's normal; height: n . any of the plane's points, m. */
static void half_space_add_facet(struct native_scratch *s, const struct solid *solid,
                                 const struct facet *f, const double n[3], double height,
                                 const struct native_law *law,
                                 const struct native_relative *relative, struct native_sum *sum)
{
    double facing = -vec3_dot(f->normal, n);
    double deepest = 0, shallowest = DBL_MAX;
    struct polygon whole, cut, *sunk = &whole;
    double center[4], twice;

    if (facing <= 0 || height - vec3_dot(n, f->center) + f->radius <= 0) {
        return;
    }

    /* One of more than three corners may be all below: the rule of a foot that stands */
    if (f->npoint > 0) {
        const struct sunk_linear depth =
            sunk_find_depth(solid, f, n, height, &deepest, &shallowest);

        if (deepest > 0 && shallowest >= 0) {
            half_space_add_sunk_facet(s, solid, f, &depth, n, height, law->stiffness * facing, law,
                                      relative, sum);
            sum->area += f->area * facing;
            sum->depth = deepest > sum->depth ? deepest : sum->depth;
        }
        if (deepest <= 0 || shallowest >= 0) {
            return;
        }
    }

    /* Penetration depth at its corners */
    whole.n = f->count;
    for (int i = 0; i < f->count; i++) {
        const double *v = solid->ring[f->first + i];
        double depth = height - vec3_dot(n, v);

        memcpy(whole.p[i], v, sizeof *solid->ring);
        whole.p[i][DEPTH] = depth;
        deepest = depth > deepest ? depth : deepest;
        shallowest = depth < shallowest ? depth : shallowest;
    }
    if (deepest <= 0) {
        return;
    }

    /* Some of it is below: springs on the clipped part */
    if (shallowest < 0) {
        polygon_clip_depth(&whole, &cut);
        sunk = &cut;
    }
    twice = polygon_center(sunk, f->normal, center);
    if (twice > DBL_MIN) {
        polygon_add_springs(s, sunk, center, f->normal, n, facing > FACING ? f->parts : 1,
                            law->stiffness * facing, law->share[0], law, relative, sum);
        sum->area += facing * twice / 2;
    }
}

/* Adds the springs of all facets that are below the plane and face it. */
static void half_space_add_bed(struct native_scratch *s, const struct solid *solid,
                               const double n[3], double height, const struct native_law *law,
                               const struct native_relative *relative, struct native_sum *sum)
{
    const struct tree *tree = &solid->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);

    while (node != end) {
        /* Skips facets that are all above the plane or all turned away from it */
        if (box_least(&node->box, n) >= height ||
            box_least(&solid->normal_bounds[node - tree->node], n) >= 0) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            half_space_add_facet(s, solid, &solid->facet[tree->item[node->first + i]], n, height,
                                 law, relative, sum);
        }
        ++node;
    }
}

void native_overlap_half_space(const struct solid *solid, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum)
{
    const double n[3] = {relative->R[2], relative->R[5], relative->R[8]};
    const double height = vec3_dot(n, relative->p);

    half_space_add_bed(scratch, solid, n, height, law, relative, sum);

    /* What backs the layers is a lower plane */
    if (native_law_is_backed(law, sum->depth)) {
        const struct native_law backing = native_law_of_backing(law);
        const double area = sum->area;

        half_space_add_bed(scratch, solid, n, height - law->layers, &backing, relative, sum);
        sum->area = area;
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}
