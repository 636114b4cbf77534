/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two meshes over their true overlap. Between each two facets that face each other stands a bed of
 * springs along the mean of their normals, where both facets lie on top of one another: so the
 * undamped force is the stiffness times the volume between them, however they are cut into
 * triangles, and it changes continuously with the pose. Facets that stand across each other add
 * nothing, and those a little off it their share.
 *
 * Pairs of facets are found in three steps, each cheaper for every facet than the next: the tree
 * of the first mesh over the box that both have in common; planes and bounding circles, four
 * facets of the second at a time; and the corners of the facet that has fewer of them.
 */
#include "contact/lanes.h"
#include "contact/native_pairs.h"
#include "contact/native_polygon.h"
#include "contact/vec.h"

#include <float.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* Facets whose normals are this close to being square to one another do not face each other; from
 * FACING_FULL on their springs count in full (cosines of the angle between one normal and the
 * other's opposite). */
#define FACING_NONE 0.1
#define FACING_FULL 0.5

struct meshes {
    const struct solid *first, *second;
    const struct native_law *law;
    const struct native_relative *relative;
    struct native_scratch *scratch;
    struct native_sum *sum;
    double reach; /* longer springs are none */
};

/* Two facets that face each other, in the first's frame. */
struct couple {
    const struct facet *a, *b;
    const double (*ring_a)[3], (*ring_b)[3];
    double normal_b[3], center_b[3];
    double facing;
};

/* ---- what lies on top of one another ---- */

#define WINDOW_MAX (FACET_MAX_VERTICES + LANES)

/* A facet seen along the springs: corners and edges, counterclockwise. After the last one comes the
 * first once more, with edges of no length. */
struct window {
    int n;
    _Alignas(64) double x[WINDOW_MAX], y[WINDOW_MAX];
    _Alignas(64) double dx[WINDOW_MAX], dy[WINDOW_MAX];
};

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

/* Seen along the springs. E: two directions across them, and theirs; backward for a facet that is
 * seen from behind, to have its corners counterclockwise. */
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

static void project_window(const double (*corner)[3], int n, const double E[9],
                           const double origin[3], bool backward, struct window *w)
{
    w->n = n;
    for (int i = 0; i < n; ++i) {
        int at = backward ? n - 1 - i : i;
        double to[3];

        vec_sub(corner[i], origin, to);
        w->x[at] = vec_dot(E, to);
        w->y[at] = vec_dot(E + 3, to);
    }
    for (int i = 0; i < LANES; ++i) {
        w->x[n + i] = w->x[0];
        w->y[n + i] = w->y[0];
    }
    for (int i = 0; i < n + LANES - 1; ++i) {
        w->dx[i] = w->x[i + 1] - w->x[i];
        w->dy[i] = w->y[i + 1] - w->y[i];
    }
}

/* The edges of a window that some corner of the polygon is outside of, a bit each. */
FOR_EACH_ISA
static uint64_t cutting_edges(const struct window *w, const struct polygon *g)
{
    uint64_t edges = 0;

    for (int i = 0; i < w->n; i += LANES) {
        lanes x = lanes_load(w->x + i), y = lanes_load(w->y + i);
        lanes dx = lanes_load(w->dx + i), dy = lanes_load(w->dy + i);
        lanes_mask outside = {0};

        for (int k = 0; k < g->n; ++k) {
            outside |= lanes_less(dx * (g->p[k][1] - y), dy * (g->p[k][0] - x));
        }
        edges |= lanes_bits(outside) << i;
    }
    return edges; /* nothing is outside of an edge of no length */
}

/* Keeps what lies to the left of a window's edge. */
static void clip_edge(const struct polygon *in, const struct window *w, int edge,
                      struct polygon *out)
{
    double side[POLYGON_MAX];

    for (int i = 0; i < in->n; ++i) {
        side[i] =
            w->dx[edge] * (in->p[i][1] - w->y[edge]) - w->dy[edge] * (in->p[i][0] - w->x[edge]);
    }
    out->n = 0;
    for (int i = 0; i < in->n && out->n + 2 <= POLYGON_MAX; ++i) {
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

/* The part of two facets where they lie on top of one another, seen along the springs from the
 * center of a: the one with fewer corners, cut to the other if it has to be. */
static struct polygon *common_polygon(const struct couple *c, const double E[9],
                                      struct polygon g[2])
{
    const struct facet *a = c->a, *b = c->b;
    const double *origin = a->center;
    double center[2] = {0, 0}, to[3], cosine = vec_dot(c->normal_b, E + 6);
    struct polygon *now = &g[0];
    struct window window;

    if (a->count < b->count) {
        project(c->ring_a, a->count, E, origin, true, now);
        vec_sub(c->center_b, origin, to);
        center[0] = vec_dot(E, to);
        center[1] = vec_dot(E + 3, to);
        if (well_within(now, center, b->within, cosine)) {
            return now;
        }
        project_window(c->ring_b, b->count, E, origin, false, &window);
    } else {
        project(c->ring_b, b->count, E, origin, false, now);
        if (well_within(now, center, a->within, cosine)) {
            return now;
        }
        project_window(c->ring_a, a->count, E, origin, true, &window);
    }
    for (uint64_t edges = cutting_edges(&window, now); edges != 0 && now->n >= 3;
         edges &= edges - 1) {
        struct polygon *next = now == &g[0] ? &g[1] : &g[0];

        clip_edge(now, &window, __builtin_ctzll(edges), next);
        now = next;
    }
    return now;
}

/* ---- springs between two facets ---- */

/* How much of a spring from this facet counts by the depth of its middle under the surface, in its
 * half lengths (up to DEPTH_FULL; the rest does not matter). middle: in the solid's frame. */
static double middle_depth(const struct solid *solid, const struct facet *facet, double facing,
                           const double middle[3], double half)
{
    /* leans by half of the angle between the facets: of what is nearby nothing can be nearer */
    double c = sqrt((1 + facing) / 2), s = sqrt((1 - facing < 0 ? 0 : 1 - facing) / 2);

    if (half <= facet->room && facet->lean[0] * c - facet->lean[1] * s >= DEPTH_FULL) {
        return DEPTH_FULL;
    }
    /* the surface at the spring's end is half a spring away, so the search always ends at one */
    return solid_depth(solid, middle, (solid->convex ? DEPTH_FULL : 1) * 1.01 * half) / half;
}

/* How much of a spring counts that is this long and has its middle here (first's frame). */
static double spring_counts(const struct meshes *m, const struct couple *c, const double middle[3],
                            double length)
{
    double a = middle_depth(m->first, c->a, c->facing, middle, length / 2), b, to[3], there[3];

    if (a <= DEPTH_NONE) {
        return 0;
    }
    vec_sub(middle, m->relative->p, to);
    mat_apply_t(m->relative->R, to, there);
    b = middle_depth(m->second, c->b, c->facing, there, length / 2);
    return native_ramp(a < b ? a : b, DEPTH_NONE, DEPTH_FULL);
}

/* Gives the corners of the common polygon their place on a and their depth, along E[6..8], under
 * b. */
static void set_depths(const struct couple *c, const double E[9], struct polygon *g)
{
    double n[3], to[3], base[3], slope[2][2];

    for (int side = 0; side < 2; ++side) {
        mat_apply(E, side ? c->normal_b : c->a->normal, n);
        slope[side][0] = -n[0] / n[2];
        slope[side][1] = -n[1] / n[2];
    }
    vec_sub(c->center_b, c->a->center, to);
    mat_apply(E, to, base);
    base[2] -= slope[1][0] * base[0] + slope[1][1] * base[1];
    for (int i = 0; i < g->n; ++i) {
        double *p = g->p[i];

        p[2] = slope[0][0] * p[0] + slope[0][1] * p[1];
        p[DEPTH] = base[2] + slope[1][0] * p[0] + slope[1][1] * p[1] - p[2];
    }
}

/* Whether any corner of the facet with fewer of them is behind the other's plane. */
static bool reaches_behind(const struct couple *c)
{
    bool by_a = c->a->count < c->b->count;
    const double(*corner)[3] = by_a ? c->ring_a : c->ring_b;
    const double *normal = by_a ? c->normal_b : c->a->normal;
    double offset = by_a ? vec_dot(c->normal_b, c->center_b) : c->a->offset;

    for (int i = 0; i < (by_a ? c->a : c->b)->count; ++i) {
        if (vec_dot(corner[i], normal) < offset) {
            return true;
        }
    }
    return false;
}

static void between_facets(const struct meshes *m, const struct couple *c)
{
    const double up[3] = {0, 0, 1};
    double E[9], middle[3], mean[4], center[4], norm, twice, weight, depth_before = m->sum->depth;
    struct polygon g[2], *now, *cut;

    if (!reaches_behind(c)) {
        return;
    }
    vec_sub(c->normal_b, c->a->normal, E + 6);
    norm = 1 / vec_norm(E + 6);
    for (int k = 0; k < 3; ++k) {
        E[6 + k] *= norm;
    }
    frame_about(E + 6, E, E + 3);
    now = common_polygon(c, E, g);
    if (now->n < 3) {
        return;
    }
    set_depths(c, E, now);
    cut = now == &g[0] ? &g[1] : &g[0];
    polygon_clip_depth(now, cut);
    twice = polygon_center(cut, up, mean);
    if (!(twice > DBL_MIN) || mean[DEPTH] > m->reach) {
        return;
    }
    mean[2] += mean[DEPTH] / 2;
    mat_apply_t(E, mean, middle);
    vec_madd(middle, 1, c->a->center, middle);
    weight = spring_counts(m, c, middle, mean[DEPTH]);
    if (weight <= 0) {
        return;
    }
    weight *= c->facing * native_ramp(c->facing, FACING_NONE, FACING_FULL);

    /* back to the first surface's frame */
    for (int i = 0; i < cut->n; ++i) {
        double p[3];

        mat_apply_t(E, cut->p[i], p);
        vec_madd(p, 1, c->a->center, cut->p[i]);
    }
    mean[2] -= mean[DEPTH] / 2;
    mat_apply_t(E, mean, center);
    vec_madd(center, 1, c->a->center, center);
    center[DEPTH] = mean[DEPTH];
    polygon_springs(m->scratch, cut, center, E + 6, E + 6, m->law->stiffness * weight,
                    m->law->share[0], m->law, m->relative, m->sum);
    m->sum->area += weight * twice / 2;
    if (weight < 0.5) {
        m->sum->depth = depth_before;
    }
}

/* ---- which facets ---- */

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

/* Facets of the second mesh in the part where both are (here, there: seen from the first and from
 * the second) and that something of it is behind, seen from the first. Returns their number. */
static size_t view_second(const struct meshes *m, const struct box *here, const struct box *there)
{
    struct native_view *view = &m->scratch->view;
    int *list = m->scratch->list[1];
    size_t n = tree_collect(&m->second->facets, there, list, m->second->nfacet), count = 0;

    for (size_t i = 0; i < n; ++i) {
        const struct facet *f = &m->second->facet[list[i]];
        double normal[3], center[3];

        mat_apply(m->relative->R, f->normal, normal);
        mat_apply(m->relative->R, f->center, center);
        vec_madd(center, 1, m->relative->p, center);
        if (box_least(here, normal) >= vec_dot(normal, center)) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            view->normal[k][count] = normal[k];
            view->center[k][count] = center[k];
        }
        view->radius[count] = f->radius;
        view->ring[count] = -1;
        list[count++] = list[i];
    }
    for (size_t i = count; i % LANES; ++i) {
        for (int k = 0; k < 3; ++k) {
            view->normal[k][i] = view->center[k][i] = 0; /* faces nothing */
        }
        view->radius[i] = 0;
    }
    view->ncorner = 0;
    return count;
}

/* The corners of a facet of the second mesh, brought into the first's frame when they are needed
 * for the first time. */
static const double (*view_ring(const struct meshes *m, int i))[3]
{
    struct native_view *view = &m->scratch->view;
    const struct facet *f = &m->second->facet[m->scratch->list[1][i]];

    if (view->ring[i] < 0) {
        view->ring[i] = view->ncorner;
        for (int v = 0; v < f->count; ++v) {
            double *corner = view->corner[view->ncorner++];

            mat_apply(m->relative->R, m->second->ring[f->first + v], corner);
            vec_madd(corner, 1, m->relative->p, corner);
        }
    }
    return (const double(*)[3])view->corner + view->ring[i];
}

/* Writes which facets of the second face this one and reach behind its plane as it may reach
 * behind theirs; returns how many. */
FOR_EACH_ISA
static size_t find_facing(const struct native_view *view, size_t n, const struct facet *a,
                          double reach, int *found)
{
    const double *normal = a->normal, *center = a->center;
    const lanes zero = {0};
    size_t count = 0;

    for (size_t at = 0; at < n; at += LANES) {
        lanes bx = lanes_load(view->normal[0] + at), by = lanes_load(view->normal[1] + at),
              bz = lanes_load(view->normal[2] + at);
        lanes_mask yes =
            lanes_less(normal[0] * bx + normal[1] * by + normal[2] * bz, zero - FACING_NONE);

        if (lanes_bits(yes) == 0) {
            continue;
        }
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

/* The springs between one facet of the first mesh and all that the second has there. */
static void facet_on_mesh(const struct meshes *m, const struct facet *a, size_t nsecond)
{
    const struct native_view *view = &m->scratch->view;
    const int *found = m->scratch->list[0];
    size_t n = find_facing(view, nsecond, a, m->reach, m->scratch->list[0]);

    for (size_t k = 0; k < n; ++k) {
        int i = found[k];
        struct couple c = {
            .a = a,
            .b = &m->second->facet[m->scratch->list[1][i]],
            .ring_a = m->first->ring + a->first,
            .ring_b = view_ring(m, i),
            .normal_b = {view->normal[0][i], view->normal[1][i], view->normal[2][i]},
            .center_b = {view->center[0][i], view->center[1][i], view->center[2][i]},
        };

        c.facing = -vec_dot(a->normal, c.normal_b);
        between_facets(m, &c);
    }
}

void native_overlap_meshes(const struct solid *first, const struct solid *second,
                           const struct native_law *law, const struct native_relative *relative,
                           struct native_scratch *scratch, struct native_sum *sum)
{
    struct meshes m = {first, second, law, relative, scratch, sum, 0};
    double thin = DBL_MAX, back[9], origin[3];
    struct box moved = moved_box(&second->box, relative->R, relative->p), here, there;
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

    nsecond = view_second(&m, &here, &there);
    stack[top++] = 0;
    while (top > 0 && nsecond > 0) {
        int index = stack[--top];
        const struct tree_node *node = &first->facets.node[index];

        if (!boxes_meet(&node->box, &here)) {
            continue;
        }
        if (node->count == 0) {
            stack[top++] = node->right;
            stack[top++] = index + 1;
            continue;
        }
        for (int i = 0; i < node->count; ++i) {
            const struct facet *f = &first->facet[first->facets.item[node->first + i]];

            /* has something of the overlap behind it */
            if (box_least(&here, f->normal) < f->offset) {
                facet_on_mesh(&m, f, nsecond);
            }
        }
    }
    if (scratch->batch.n > 0) {
        native_law_sum(&scratch->batch, law, relative, sum);
    }
}
