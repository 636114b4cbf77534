/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A mesh on a half-space: one bed of springs on the plane, along its normal, as long as the mesh is
 * below the plane there. Its undamped force is the stiffness times the volume that has sunk in,
 * however the mesh is cut into triangles.
 */
#include "base/vec3.h"
#include "contact/native_pairs.h"
#include "contact/native_polygon.h"

#include <float.h>
#include <string.h>

/* A facet that is all below the plane and keeps its points of quadrature. */
static void sink_facet(struct native_scratch *s, const struct solid *solid, const struct facet *f,
                       const double n[3], double height, double pressure,
                       const struct native_law *law, const struct native_relative *relative,
                       struct native_sum *sum)
{
    const double share = law->share[0];

    for (int done = 0; done < f->npoint;) {
        int room, take = f->npoint - done;
        struct native_batch *b = &s->batch;

        native_law_make_room(&s->batch, 8, law, relative, sum);
        room = (int)(BATCH_MAX - b->n);
        take = take < room ? take : room;
        for (int i = 0; i < take; ++i) {
            size_t from = (size_t)(f->point + done + i), to = b->n + (size_t)i;
            double x = solid->point[0][from], y = solid->point[1][from], z = solid->point[2][from];
            double depth = height - (n[0] * x + n[1] * y + n[2] * z);

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

static void facet_on_half_space(struct native_scratch *s, const struct solid *solid,
                                const struct facet *f, const double n[3], double height,
                                const struct native_law *law,
                                const struct native_relative *relative, struct native_sum *sum)
{
    double facing = -vec3_dot(f->normal, n);
    double lowest = 0, highest = DBL_MAX;
    struct polygon whole, cut, *sunk = &whole;
    double center[4], twice;

    if (facing <= 0 || height - vec3_dot(n, f->center) + f->radius <= 0) {
        return;
    }
    whole.n = f->count;
    for (int i = 0; i < f->count; ++i) {
        const double *v = solid->ring[f->first + i];

        double depth = height - vec3_dot(n, v);

        memcpy(whole.p[i], v, sizeof *solid->ring);
        whole.p[i][DEPTH] = depth;
        lowest = depth > lowest ? depth : lowest;
        highest = depth < highest ? depth : highest;
    }
    if (lowest <= 0) {
        return;
    }
    if (highest >= 0 && f->npoint > 0) {
        sink_facet(s, solid, f, n, height, law->stiffness * facing, law, relative, sum);
        sum->area += f->area * facing;
        sum->depth = lowest > sum->depth ? lowest : sum->depth;
        return;
    }
    if (highest < 0) {
        polygon_clip_depth(&whole, &cut);
        sunk = &cut;
    }
    twice = polygon_center(sunk, f->normal, center);
    if (twice > DBL_MIN) {
        polygon_springs(s, sunk, center, f->normal, n, law->stiffness * facing, law->share[0], law,
                        relative, sum);
        sum->area += facing * twice / 2;
    }
}

void native_overlap_half_space(const struct solid *solid, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum)
{
    const double n[3] = {relative->R[2], relative->R[5], relative->R[8]};
    const double height = vec3_dot(n, relative->p);
    int stack[TREE_DEPTH_MAX], top = 0;

    stack[top++] = 0;
    while (top > 0) {
        int index = stack[--top];
        const struct tree_node *node = &solid->facets.node[index];

        /* all above the plane, or all turned away from it */
        if (box_least(&node->box, n) >= height || box_least(&solid->facing[index], n) >= 0) {
            continue;
        }
        if (node->count == 0) {
            stack[top++] = node->right;
            stack[top++] = index + 1;
            continue;
        }
        for (int i = 0; i < node->count; ++i) {
            facet_on_half_space(scratch, solid, &solid->facet[solid->facets.item[node->first + i]],
                                n, height, law, relative, sum);
        }
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}
