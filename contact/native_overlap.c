/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact over the true overlap. Everywhere the springs are a bed: side by side on a plane, along
 * one direction, as long as the overlap is deep there. So the undamped force of a bed is the
 * stiffness times the volume of the overlap that it stands in, however the surfaces are cut into
 * triangles, and it changes continuously with the pose. Facets that stand across the direction add
 * nothing, and those a little off it their share.
 */
#include "contact/native_pairs.h"
#include "contact/vec.h"

#include <float.h>
#include <stdbool.h>
#include <string.h>

#define POLYGON_MAX (2 * FACET_MAX_VERTICES + 8)

/* Facets whose normals are this close to being square to one another do not face each other; from
 * FACING_FULL on their springs count in full (cosines of the angle between one normal and the
 * other's opposite). */
#define FACING_NONE 0.1
#define FACING_FULL 0.5

/* The middle of a spring lies half its length deep in both bodies. Where it lies less than
 * DEPTH_NONE of that deep, the spring runs along the overlap, not across it, and is none. */
#define DEPTH_NONE 0.25
#define DEPTH_FULL 0.5

/* 0 up to a, 1 from b on, smooth between them. */
static double ramp(double x, double a, double b)
{
    double t = (x - a) / (b - a);

    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}

static void make_room(struct native_scratch *s, size_t n, const struct native_law *law,
                      const struct native_relative *relative, struct native_sum *sum)
{
    if (s->batch.n + n > BATCH_MAX) {
        native_law_sum(&s->batch, law, relative, sum);
    }
}

static void put(struct native_batch *b, const double p[3], const double d[3], double rate,
                double depth)
{
    for (int k = 0; k < 3; ++k) {
        b->p[k][b->n] = p[k];
        b->d[k][b->n] = d[k];
    }
    b->force[b->n] = rate * depth;
    b->depth[b->n] = depth;
    b->rate[b->n] = rate;
    b->n++;
}

/* ---- flat polygons with a depth at each corner ---- */

enum { DEPTH = 3 }; /* the fourth coordinate of a corner; it is linear over the polygon */

struct polygon {
    int n;
    double p[POLYGON_MAX][4];
};

/* Cuts away what has a negative depth. */
static void clip_depth(const struct polygon *in, struct polygon *out)
{
    out->n = 0;
    for (int i = 0; i < in->n; ++i) {
        const double *a = in->p[i], *b = in->p[i + 1 < in->n ? i + 1 : 0];

        if (a[DEPTH] >= 0) {
            memcpy(out->p[out->n++], a, sizeof in->p[i]);
        }
        if ((a[DEPTH] >= 0) != (b[DEPTH] >= 0)) {
            double t = a[DEPTH] / (a[DEPTH] - b[DEPTH]);

            for (int k = 0; k < 3; ++k) {
                out->p[out->n][k] = a[k] + t * (b[k] - a[k]);
            }
            out->p[out->n++][DEPTH] = 0;
        }
    }
}

/* Twice the area as seen along a normal, of the triangle between a corner and an edge. */
static double twice_area(const double a[3], const double b[3], const double c[3],
                         const double normal[3])
{
    double ab[3], ac[3], x[3];

    vec_sub(b, a, ab);
    vec_sub(c, a, ac);
    vec_cross(ab, ac, x);
    return vec_dot(x, normal);
}

/* Twice the area as seen along a normal, and the centroid with its depth. */
static double polygon_center(const struct polygon *g, const double normal[3], double center[4])
{
    double twice = 0, sum[4] = {0, 0, 0, 0};

    for (int i = 1; i + 1 < g->n; ++i) {
        double part = twice_area(g->p[0], g->p[i], g->p[i + 1], normal);

        twice += part;
        for (int k = 0; k < 4; ++k) {
            sum[k] += part * ((g->p[i][k] - g->p[0][k]) + (g->p[i + 1][k] - g->p[0][k]));
        }
    }
    for (int k = 0; k < 4 && twice > DBL_MIN; ++k) {
        center[k] = g->p[0][k] + sum[k] / (3 * twice);
    }
    return twice;
}

/* The springs on a polygon: three in each triangle between the centroid and an edge, which
 * integrates force and moment of a linear depth exactly. pressure is the elastic force per depth
 * and area as seen along the normal, share how far along d from the polygon a spring acts. Returns
 * the area. */
static double put_springs(struct native_scratch *s, const struct polygon *g, const double normal[3],
                          const double d[3], double pressure, double share,
                          const struct native_law *law, const struct native_relative *relative,
                          struct native_sum *sum)
{
    double center[4], twice;

    if (g->n < 3 || !((twice = polygon_center(g, normal, center)) > DBL_MIN)) {
        return 0;
    }
    for (int i = 0; i < g->n; ++i) {
        const double *v[3] = {center, g->p[i], g->p[i + 1 < g->n ? i + 1 : 0]};
        double rate = pressure * twice_area(v[0], v[1], v[2], normal) / 6;

        make_room(s, FACET_POINTS, law, relative, sum);
        for (int q = 0; q < FACET_POINTS; ++q) {
            double p[4];

            for (int k = 0; k < 4; ++k) {
                p[k] = (v[0][k] + v[1][k] + v[2][k] + 3 * v[q][k]) * (1.0 / 6);
            }
            for (int k = 0; k < 3; ++k) {
                p[k] += share * p[DEPTH] * d[k];
            }
            put(&s->batch, p, d, rate, p[DEPTH]);
        }
        sum->depth = v[1][DEPTH] > sum->depth ? v[1][DEPTH] : sum->depth;
    }
    return twice / 2;
}

/* ---- mesh on half-space ---- */

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

        make_room(s, 8, law, relative, sum);
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
    double facing = -vec_dot(f->normal, n);
    double lowest = 0, highest = DBL_MAX;
    struct polygon whole, cut;

    if (facing <= 0 || height - vec_dot(n, f->center) + f->radius <= 0) {
        return;
    }
    whole.n = f->count;
    for (int i = 0; i < f->count; ++i) {
        const double *v = solid->ring[f->first + i];

        double depth = height - vec_dot(n, v);

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
        clip_depth(&whole, &cut);
    }
    sum->area += facing * put_springs(s, highest < 0 ? &cut : &whole, f->normal, n,
                                      law->stiffness * facing, law->share[0], law, relative, sum);
}

void native_overlap_half_space(const struct solid *solid, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum)
{
    const double n[3] = {relative->R[2], relative->R[5], relative->R[8]};
    const double height = vec_dot(n, relative->p);
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
    if (scratch->batch.n > 0) {
        native_law_sum(&scratch->batch, law, relative, sum);
    }
}

/* ---- two meshes ---- */

/* Two directions that make a right-handed frame with n (Duff et al. 2017). */
static void frame_about(const double n[3], double e1[3], double e2[3])
{
    double sign = n[2] >= 0 ? 1 : -1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;

    e1[0] = 1 + sign * n[0] * n[0] * a;
    e1[1] = sign * b;
    e1[2] = -sign * n[0];
    e2[0] = b;
    e2[1] = sign + n[1] * n[1] * a;
    e2[2] = -n[1];
}

/* Keeps what lies to the left of the way from a to b, in x and y. False, and nothing written, when
 * that is everything. */
static bool clip_edge(const struct polygon *in, const double a[3], const double b[3],
                      struct polygon *out)
{
    double ex = b[0] - a[0], ey = b[1] - a[1], side[POLYGON_MAX], least = 0;

    for (int i = 0; i < in->n; ++i) {
        side[i] = ex * (in->p[i][1] - a[1]) - ey * (in->p[i][0] - a[0]);
        least = side[i] < least ? side[i] : least;
    }
    if (least >= 0) {
        return false;
    }
    out->n = 0;
    for (int i = 0; i < in->n; ++i) {
        int j = i + 1 < in->n ? i + 1 : 0;

        if (side[i] >= 0) {
            memcpy(out->p[out->n++], in->p[i], sizeof in->p[i]);
        }
        if ((side[i] >= 0) != (side[j] >= 0)) {
            double t = side[i] / (side[i] - side[j]);

            out->p[out->n][0] = in->p[i][0] + t * (in->p[j][0] - in->p[i][0]);
            out->p[out->n++][1] = in->p[i][1] + t * (in->p[j][1] - in->p[i][1]);
        }
    }
    return true;
}

struct meshes {
    const struct solid *first, *second;
    const struct native_law *law;
    const struct native_relative *relative;
    struct native_scratch *scratch;
    struct native_sum *sum;
    double reach; /* longer springs are none */
};

/* How much of a spring counts that is this long and has its middle here (first's frame). */
static double spring_counts(const struct meshes *m, const double middle[3], double length)
{
    double half = length / 2, limit = DEPTH_FULL * 1.01 * half, there[3], to[3], a, b;

    /* the surfaces at its ends are half a spring away, so the search always ends at one */
    a = solid_depth(m->first, middle, m->first->convex ? limit : 1.01 * half);
    if (a <= DEPTH_NONE * half) {
        return 0;
    }
    vec_sub(middle, m->relative->p, to);
    mat_apply_t(m->relative->R, to, there);
    b = solid_depth(m->second, there, m->second->convex ? limit : 1.01 * half);
    return ramp((a < b ? a : b) / half, DEPTH_NONE, DEPTH_FULL);
}

/* A facet seen along the springs, counterclockwise; E: two directions across them, and theirs. */
static void project(const double (*corner)[3], int n, const double E[9], const double origin[3],
                    bool backward, struct polygon *out)
{
    out->n = n;
    for (int i = 0; i < n; ++i) {
        double to[3], *p = out->p[backward ? n - 1 - i : i];

        vec_sub(corner[i], origin, to);
        p[0] = vec_dot(E, to);
        p[1] = vec_dot(E + 3, to);
    }
}

/* Whether the polygon is in the circle that a facet holds, turned by up to some angle. */
static bool well_within(const struct polygon *g, const double center[2], double within,
                        double cosine)
{
    double reach = within * cosine;

    for (int i = 0; i < g->n; ++i) {
        double x = g->p[i][0] - center[0], y = g->p[i][1] - center[1];

        if (x * x + y * y > reach * reach) {
            return false;
        }
    }
    return true;
}

/* The part of two facets where they lie on top of one another, seen along the springs. */
static struct polygon *common_polygon(const struct meshes *m, const struct facet *a,
                                      const struct facet *b, const double (*corner)[3],
                                      const struct native_view *view, const double E[9],
                                      struct polygon g[2])
{
    const double(*ring)[3] = m->first->ring + a->first;
    const double *origin = a->center;
    double center[2] = {0, 0}, to[3], cosine = vec_dot(view->normal, E + 6);
    bool first_is_cut = a->count < b->count;
    struct polygon window, *now = &g[0];

    /* the one with fewer corners is cut to the other, if it has to be */
    vec_sub(view->center, origin, to);
    if (first_is_cut) {
        project(ring, a->count, E, origin, true, now);
        center[0] = vec_dot(E, to);
        center[1] = vec_dot(E + 3, to);
    } else {
        project(corner, b->count, E, origin, false, now);
    }
    if (well_within(now, center, first_is_cut ? b->within : a->within, cosine)) {
        return now;
    }
    if (first_is_cut) {
        project(corner, b->count, E, origin, false, &window);
    } else {
        project(ring, a->count, E, origin, true, &window);
    }
    for (int i = 0; i < window.n && now->n >= 3; ++i) {
        struct polygon *next = now == &g[0] ? &g[1] : &g[0];

        if (clip_edge(now, window.p[i], window.p[i + 1 < window.n ? i + 1 : 0], next)) {
            now = next;
        }
    }
    return now;
}

/* The springs between two facets that face each other. */
static void between_facets(const struct meshes *m, const struct facet *a,
                           const struct native_view *view, double facing)
{
    const struct facet *b = &m->second->facet[view->facet];
    const double up[3] = {0, 0, 1};
    double E[9], to[3], corner[FACET_MAX_VERTICES][3], slope[2][2], base[2], middle[3], length;
    double mean[4], square, weight, depth_before = m->sum->depth;
    struct polygon g[2], *now, *cut;
    bool behind = false;

    for (int i = 0; i < b->count; ++i) {
        mat_apply(m->relative->R, m->second->ring[b->first + i], corner[i]);
        vec_madd(corner[i], 1, m->relative->p, corner[i]);
        behind = behind || vec_dot(corner[i], a->normal) < a->offset;
    }
    if (!behind) {
        return;
    }
    vec_sub(view->normal, a->normal, E + 6);
    square = 1 / vec_norm(E + 6);
    for (int k = 0; k < 3; ++k) {
        E[6 + k] *= square;
    }
    frame_about(E + 6, E, E + 3);
    now = common_polygon(m, a, b, (const double(*)[3])corner, view, E, g);
    if (now->n < 3) {
        return;
    }

    /* the heights of both planes over the one across the springs */
    for (int side = 0; side < 2; ++side) {
        double n[3];

        mat_apply(E, side ? view->normal : a->normal, n);
        slope[side][0] = -n[0] / n[2];
        slope[side][1] = -n[1] / n[2];
    }
    vec_sub(view->center, a->center, to);
    mat_apply(E, to, mean);
    base[0] = 0;
    base[1] = mean[2] - slope[1][0] * mean[0] - slope[1][1] * mean[1];
    for (int i = 0; i < now->n; ++i) {
        double *p = now->p[i];

        p[2] = base[0] + slope[0][0] * p[0] + slope[0][1] * p[1];
        p[DEPTH] = base[1] + slope[1][0] * p[0] + slope[1][1] * p[1] - p[2];
    }
    cut = now == &g[0] ? &g[1] : &g[0];
    clip_depth(now, cut);
    if (cut->n < 3 || !(polygon_center(cut, up, mean) > DBL_MIN)) {
        return;
    }
    length = mean[DEPTH];
    mean[2] += length / 2;
    mat_apply_t(E, mean, middle);
    vec_madd(middle, 1, a->center, middle);
    if (length > m->reach) {
        return;
    }
    weight = spring_counts(m, middle, length);
    if (weight <= 0) {
        return;
    }
    weight *= facing * ramp(facing, FACING_NONE, FACING_FULL);

    /* back to the first surface's frame */
    for (int i = 0; i < cut->n; ++i) {
        double p[3];

        mat_apply_t(E, cut->p[i], p);
        vec_madd(p, 1, a->center, cut->p[i]);
    }
    m->sum->area += weight * put_springs(m->scratch, cut, E + 6, E + 6, m->law->stiffness * weight,
                                         m->law->share[0], m->law, m->relative, m->sum);
    if (weight < 0.5) {
        m->sum->depth = depth_before;
    }
}

/* The box of a box that is turned and moved. */
static struct box moved_box(const struct box *box, const double R[9], const double p[3])
{
    struct box out;
    double center[3], half[3], to[3];

    for (int k = 0; k < 3; ++k) {
        center[k] = (box->low[k] + box->high[k]) / 2;
        half[k] = (box->high[k] - box->low[k]) / 2;
    }
    mat_apply(R, center, to);
    for (int k = 0; k < 3; ++k) {
        double reach =
            fabs(R[3 * k]) * half[0] + fabs(R[3 * k + 1]) * half[1] + fabs(R[3 * k + 2]) * half[2];

        out.low[k] = to[k] + p[k] - reach;
        out.high[k] = to[k] + p[k] + reach;
    }
    return out;
}

/* What two boxes have in common; false when nothing. thin: its least extent. */
static bool common_box(const struct box *a, const struct box *b, struct box *out, double *thin)
{
    for (int k = 0; k < 3; ++k) {
        out->low[k] = a->low[k] > b->low[k] ? a->low[k] : b->low[k];
        out->high[k] = a->high[k] < b->high[k] ? a->high[k] : b->high[k];
        if (out->high[k] <= out->low[k]) {
            return false;
        }
        *thin = out->high[k] - out->low[k] < *thin ? out->high[k] - out->low[k] : *thin;
    }
    return true;
}

/* Facets of the second mesh in the part where both are and that something of the first is behind,
 * seen from the first; facing covers their normals. */
static size_t view_second(const struct meshes *m, const struct box *there, struct box *facing)
{
    struct native_scratch *s = m->scratch;
    size_t n = tree_collect(&m->second->facets, there, s->list[1]), count = 0;

    for (size_t i = 0; i < n; ++i) {
        const struct facet *f = &m->second->facet[s->list[1][i]];
        struct native_view *view = &s->view[count];

        mat_apply(m->relative->R, f->normal, view->normal);
        mat_apply(m->relative->R, f->center, view->center);
        vec_madd(view->center, 1, m->relative->p, view->center);
        if (box_least(&m->first->box, view->normal) >= vec_dot(view->normal, view->center)) {
            continue;
        }
        view->radius = f->radius;
        view->facet = s->list[1][i];
        if (count++ == 0) {
            memcpy(facing->low, view->normal, sizeof facing->low);
            memcpy(facing->high, view->normal, sizeof facing->high);
        }
        box_add(facing, view->normal);
    }
    return count;
}

/* Whether any two directions from the boxes face each other. */
static bool may_face(const struct box *a, const struct box *b)
{
    double least = 0;

    for (int k = 0; k < 3; ++k) {
        double p[4] = {a->low[k] * b->low[k], a->low[k] * b->high[k], a->high[k] * b->low[k],
                       a->high[k] * b->high[k]};

        p[0] = p[1] < p[0] ? p[1] : p[0];
        p[2] = p[3] < p[2] ? p[3] : p[2];
        least += p[2] < p[0] ? p[2] : p[0];
    }
    return least < -FACING_NONE;
}

/* The springs between one facet of the first mesh and all that the second has there. */
static void facet_on_mesh(const struct meshes *m, const struct facet *a, size_t nsecond)
{
    for (size_t i = 0; i < nsecond; ++i) {
        const struct native_view *b = &m->scratch->view[i];
        double facing = -vec_dot(a->normal, b->normal);
        double to[3], near = a->radius + b->radius + m->reach;

        if (facing <= FACING_NONE) {
            continue;
        }
        /* each has to reach behind the other's plane */
        vec_sub(b->center, a->center, to);
        if (vec_dot(to, a->normal) < b->radius && vec_dot(to, b->normal) > -a->radius &&
            vec_dot(to, to) < near * near) {
            between_facets(m, a, b, facing);
        }
    }
}

void native_overlap_meshes(const struct solid *first, const struct solid *second,
                           const struct native_law *law, const struct native_relative *relative,
                           struct native_scratch *scratch, struct native_sum *sum)
{
    struct meshes m = {first, second, law, relative, scratch, sum, 0};
    double thin = DBL_MAX, back[9], origin[3];
    struct box moved = moved_box(&second->box, relative->R, relative->p), here, there, facing;
    int stack[TREE_DEPTH_MAX], top = 0;
    size_t nsecond;

    for (int i = 0; i < 9; ++i) {
        back[i] = relative->R[i % 3 * 3 + i / 3];
    }
    mat_apply(back, relative->p, origin);
    for (int k = 0; k < 3; ++k) {
        origin[k] = -origin[k];
    }
    if (!common_box(&first->box, &moved, &here, &thin)) {
        return;
    }
    moved = moved_box(&first->box, back, origin);
    if (!common_box(&second->box, &moved, &there, &thin)) {
        return;
    }
    /* a ball in the overlap has no room for a larger diameter than thin */
    m.reach = thin / DEPTH_NONE;

    nsecond = view_second(&m, &there, &facing);
    stack[top++] = 0;
    while (top > 0 && nsecond > 0) {
        int index = stack[--top];
        const struct tree_node *node = &first->facets.node[index];

        if (!boxes_meet(&node->box, &here) || !may_face(&first->facing[index], &facing)) {
            continue;
        }
        if (node->count == 0) {
            stack[top++] = node->right;
            stack[top++] = index + 1;
            continue;
        }
        for (int i = 0; i < node->count; ++i) {
            facet_on_mesh(&m, &first->facet[first->facets.item[node->first + i]], nsecond);
        }
    }
    if (scratch->batch.n > 0) {
        native_law_sum(&scratch->batch, law, relative, sum);
    }
}
