/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two meshes over their true overlap, by an elastic foundation. Between facets that face each
 * other, springs stand along the mean of the normals where the facets overlap. So the undamped
 * force is the stiffness times the volume between the facets for any triangulation, and it is
 * continuous in the pose. Facets that are perpendicular add nothing; facets near that fade out.
 *
 * Pairs of facets are found in three steps, each cheaper per facet than the next. First, the tree
 * of the first mesh over the common box. Second, planes and bounding circles, LANES facets of the
 * second mesh at a time. Third, the corners of the facet that has fewer corners.
 *
 * The springs between two facets are found in the plane of the facet with more corners, the base,
 * whose outline there is precomputed. The other facet's corners are projected along the springs
 * into that plane. The part without depth is clipped away first, since that often leaves nothing.
 * The rest is clipped to the outline.
 *
 * Let e be the unit vector along the difference of the normals; both normals have the same angle to
 * e. From a height h over one facet's plane, the distance back to the plane along e is h over the
 * cosine of that angle. So the projected corners and the depth in the base's plane need no
 * division.
 */
#include "contact/lanes.h"
#include "contact/native/clip2d.h"

#include <float.h>

/* A facet up to this size, relative to the smaller mesh, has only three springs. A side with four
 * corners has springs that are no closer to each other. */
#define FINE 0.25

/* Cosines of the angle between one normal and the opposite of the other. Facets with a cosine
 * below FACING_NONE do not face each other; from FACING_FULL on, springs count fully. */
#define FACING_NONE 0.1
#define FACING_FULL 0.5

/* Two meshes in an evaluation, and the numbers common to all their facets. */
struct foundation_between {
    const struct solid *first, *second;
    const struct native_overlap *pair;
    double reach; /* length of the longest spring */
    /* m; a facet up to this radius has three springs with each facet of the other mesh */
    double fine;
};

/* Two facets that face each other: a of the first mesh, b of the second; in the first's frame. */
struct foundation_couple {
    const struct facet *a, *b;
    const double (*ring)[3]; /* corners of the facet with fewer corners; if equal, of b */
    double normal_b[3], center_b[3];
    double facing; /* -normal_a . normal_b, over FACING_NONE */
};

/* The springs between two facets: all have one direction and end on both facets. */
struct foundation {
    const struct facet *base, *other;
    /* in the first's frame; origin is the base's center */
    const double *base_normal, *other_normal, *origin;
    bool on_second;    /* the base is a facet of the second mesh */
    double axis[2][3]; /* axes of the base's outline */
    /* unit direction of the springs, in which they push the first surface */
    double along[3];
    double cosine;          /* cosine of the angle between springs and normals */
    double depth, slope[2]; /* depth at the origin, and its slopes in the base's plane */
};

/* Returns the length of the spring through a point in the base's plane: its penetration depth,
 * m. */
static double foundation_depth(const struct foundation *bed, double x, double y)
{
    return bed->depth + bed->slope[0] * x + bed->slope[1] * y;
}

/* ---- where the facets overlap ---- */

/* Computes direction and depth of the springs. Projects the other facet's corners along them into
 * the base's plane, in reverse order so that they are counterclockwise there. Returns false if no
 * corner is behind that plane. */
static bool foundation_find(const struct foundation_between *m, const struct foundation_couple *c,
                            struct foundation *bed, struct polygon2d *flat)
{
    double length, inverse, height[FACET_MAX_VERTICES], lean[2], offset, to[3];
    bool behind = false;

    /* The base is the facet with more corners */
    bed->on_second = c->a->count < c->b->count;
    bed->base = bed->on_second ? c->b : c->a;
    bed->other = bed->on_second ? c->a : c->b;
    bed->base_normal = bed->on_second ? c->normal_b : c->a->normal;
    bed->other_normal = bed->on_second ? c->a->normal : c->normal_b;
    bed->origin = bed->on_second ? c->center_b : c->a->center;

    /* Heights of the other facet's corners over the base's plane */
    offset = vec3_dot(bed->base_normal, bed->origin);
    flat->n = bed->other->count;
    for (int i = 0; i < flat->n; i++) {
        height[i] = vec3_dot(bed->base_normal, c->ring[i]) - offset;
        behind = behind || height[i] < 0;
    }
    if (!behind) {
        return false;
    }

    /* Direction of the springs, along the difference of the normals, and the slope of their length
     * in the plane */
    length = sqrt(2 + 2 * c->facing);
    inverse = 1 / length;
    bed->cosine = length / 2;
    for (int k = 0; k < 3; k++) {
        bed->along[k] = (c->normal_b[k] - c->a->normal[k]) * inverse;
    }
    vec3_sub(bed->origin, bed->on_second ? c->a->center : c->center_b, to);
    bed->depth = -2 * inverse * vec3_dot(bed->other_normal, to);
    for (int side = 0; side < 2; side++) {
        if (bed->on_second) {
            mat3_apply(m->pair->relative->R, bed->base->axis[side], bed->axis[side]);
        } else {
            memcpy(bed->axis[side], bed->base->axis[side], sizeof bed->axis[side]);
        }
        /* Springs point from the first mesh's facet to the second's; the sign depends on which one
         * is the base */
        lean[side] = vec3_dot(bed->axis[side], bed->along) * (bed->on_second ? 2 : -2) * inverse;
        bed->slope[side] = -2 * inverse * vec3_dot(bed->other_normal, bed->axis[side]);
    }

    /* Projects the other facet's corners along the springs */
    for (int i = 0; i < flat->n; i++) {
        int at = flat->n - 1 - i;

        vec3_sub(c->ring[i], bed->origin, to);
        flat->x[at] = vec3_dot(bed->axis[0], to) - lean[0] * height[i];
        flat->y[at] = vec3_dot(bed->axis[1], to) - lean[1] * height[i];
    }
    return true;
}

/* ---- springs ---- */

/* Computes a point of the spring through a point in the base's plane. part 0 is at the first
 * mesh's facet, part 1 at the second's. */
static void foundation_place_on_spring(const struct foundation *bed, double x, double y,
                                       double depth, double part, double out[3])
{
    double step = (bed->on_second ? part - 1 : part) * depth;

    for (int k = 0; k < 3; k++) {
        out[k] = bed->origin[k] + x * bed->axis[0][k] + y * bed->axis[1][k] + step * bed->along[k];
    }
}

/* Adds the spring through a point in the base's plane; its force acts at the point given by the
 * law's shares. */
static void foundation_add_spring(const struct foundation_between *m, const struct foundation *bed,
                                  double x, double y, double rate)
{
    double depth = foundation_depth(bed, x, y), p[3];

    foundation_place_on_spring(bed, x, y, depth, m->pair->law->share[0], p);
    batch_add_spring(&m->pair->scratch->batch, p, bed->along, rate, depth);
}

/* Adds three springs for each triangle between the centroid and an edge. */
static void foundation_add_around(const struct foundation_between *m, const struct foundation *bed,
                                  const struct polygon2d *g, const struct moments *at, double rate)
{
    for (int i = 0; i < g->n; i++) {
        int j = i + 1 < g->n ? i + 1 : 0;
        double ux = g->x[i] - at->x, uy = g->y[i] - at->y;
        double vx = g->x[j] - at->x, vy = g->y[j] - at->y;
        double part = rate * (ux * vy - uy * vx) / (3 * at->twice);

        native_make_room(m->pair, FACET_POINTS);
        foundation_add_spring(m, bed, at->x + (ux + vx) / 6, at->y + (uy + vy) / 6, part);
        foundation_add_spring(m, bed, at->x + (4 * ux + vx) / 6, at->y + (4 * uy + vy) / 6, part);
        foundation_add_spring(m, bed, at->x + (ux + 4 * vx) / 6, at->y + (uy + 4 * vy) / 6, part);
    }
}

/* ---- weights of springs ---- */

/* Returns the depth of a spring's middle below the surface of a solid, in half lengths of the
 * spring, at most DEPTH_FULL. middle: in the solid's frame. */
static double spring_middle_depth(const struct solid *solid, const double middle[3], double half)
{
    /* The surface at the spring's end is half a length away, so the search always finds a point */
    return solid_depth(solid, middle, (solid->convex ? DEPTH_FULL : 1) * 1.01 * half) / half;
}

/* Returns the weight of a spring, 0 to 1. length in m; middle in the first's frame. */
static double spring_weight(const struct foundation_between *m, const double middle[3],
                            double length)
{
    double a = spring_middle_depth(m->first, middle, length / 2), b, to[3], there[3];

    if (a <= DEPTH_NONE) {
        return 0;
    }
    vec3_sub(middle, m->pair->relative->p, to);
    mat3_apply_transposed(m->pair->relative->R, to, there);
    b = spring_middle_depth(m->second, there, length / 2);
    return native_ramp(a < b ? a : b, DEPTH_NONE, DEPTH_FULL);
}

/* Adds springs for the backing of the layers where a polygon is deeper than the layers. area:
 * weighted area of the polygon, m2. */
static void foundation_add_backing(const struct foundation_between *m, const struct foundation *bed,
                                   const struct polygon2d *common, double area)
{
    struct foundation deeper = *bed;
    struct moments whole, at;
    struct polygon2d g;
    double side[POLYGON_MAX], rate;

    deeper.depth -= m->pair->law->layers;
    for (int i = 0; i < common->n; i++) {
        side[i] = foundation_depth(&deeper, common->x[i], common->y[i]);
    }
    clip2d_side(common, side, &g);
    if (g.n < 3) {
        return;
    }
    clip2d_moments(common, false, &whole);
    clip2d_moments(&g, false, &at);
    rate = m->pair->law->backing * area / whole.twice;
    if (at.twice > DBL_MIN) {
        foundation_add_around(m, &deeper, &g, &at, rate * at.twice);
    }
}

/* Adds the springs between two facets. */
static void foundation_add_couple(const struct foundation_between *m,
                                  const struct foundation_couple *c)
{
    const bool fine = (c->a->radius < c->b->radius ? c->a : c->b)->radius <= m->fine;
    struct polygon2d g[2];
    const struct polygon2d *common;
    struct foundation bed;
    struct moments at;
    double depth, area, weight, middle[3];

    /* The overlap of both facets along the springs */
    if (!foundation_find(m, c, &bed, &g[0])) {
        return;
    }

    /* Clip the polygon to the part with depth and to the base */
    double side[POLYGON_MAX];
    bool all = true;

    for (int i = 0; i < g[0].n; i++) {
        side[i] = foundation_depth(&bed, g[0].x[i], g[0].y[i]);
        all = all && side[i] >= 0;
    }
    if (!all) {
        clip2d_side(&g[0], side, &g[1]);
    }
    common = clip2d_to_facet(bed.on_second ? m->second : m->first, bed.base, g, all ? 0 : 1);

    if (common->n < 3) {
        return;
    }

    /* Springs that are too long for the overlap or run along it do not count */
    clip2d_moments(common, fine, &at);
    depth = foundation_depth(&bed, at.x, at.y);
    if (!(at.twice > DBL_MIN) || depth > m->reach) {
        return;
    }
    foundation_place_on_spring(&bed, at.x, at.y, depth, 0.5, middle);
    weight = spring_weight(m, middle, depth);
    if (weight <= 0) {
        return;
    }

    /* The area is seen along the springs; they fade out as the normals become perpendicular */
    weight *= c->facing * native_ramp(c->facing, FACING_NONE, FACING_FULL);
    area = weight * bed.cosine * at.twice / 2;
    if (fine) {
        double x[3], y[3];

        clip2d_three_points(&at, x, y);
        native_make_room(m->pair, 3);
        for (int i = 0; i < 3; i++) {
            foundation_add_spring(m, &bed, x[i], y[i], m->pair->law->stiffness * area / 3);
        }
    } else {
        foundation_add_around(m, &bed, common, &at, m->pair->law->stiffness * area);
    }

    /* Finds the deepest corner, for the backing, and for the patch's depth where springs have
     * weight */
    depth = 0;
    for (int i = 0; i < common->n; i++) {
        depth = fmax(depth, foundation_depth(&bed, common->x[i], common->y[i]));
    }
    if (m->pair->law->backing > 0 && depth > m->pair->law->layers) {
        foundation_add_backing(m, &bed, common, area);
    }

    m->pair->sum->area += area;
    for (int i = 0; i < common->n && weight >= 0.5; i++) {
        depth = foundation_depth(&bed, common->x[i], common->y[i]);
        m->pair->sum->depth = depth > m->pair->sum->depth ? depth : m->pair->sum->depth;
    }
}

/* ---- facets that face each other ---- */

/* Computes the intersection of two boxes; returns false if it is empty. Reduces *thin to the
 * smallest extent of the intersection, m. */
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

/* Returns the corners of a facet of the second mesh in the first's frame. Transforms them on first
 * use. */
static const double (*view_facet_ring(const struct foundation_between *m, int i))[3]
{
    struct native_view *view = &m->pair->scratch->view;
    const struct facet *f = &m->second->facet[m->pair->scratch->list[1][i]];

    if (view->ring[i] < 0) {
        view->ring[i] = view->ncorner;
        for (int v = 0; v < f->count; v++) {
            double *corner = view->corner[view->ncorner++];

            mat3_apply(m->pair->relative->R, m->second->ring[f->first + v], corner);
            vec3_add_scaled(corner, 1, m->pair->relative->p, corner);
        }
    }
    return (const double(*)[3])view->corner + view->ring[i];
}

/* Adds the springs between one facet of the first mesh and the nsecond facets in the view of the
 * second. */
static void meshes_add_facet(const struct foundation_between *m, const struct facet *a,
                             size_t nsecond)
{
    struct native_scratch *scratch = m->pair->scratch;
    const struct native_view *view = &scratch->view;

    /* Find the facets of the second mesh that face a facet of the first. Each of the two facets
     * must reach behind the plane of the other. */
    const double *normal = a->normal, *center = a->center;
    const lanes zero = {0};
    size_t n = 0;

    for (size_t at = 0; at < nsecond; at += LANES) {
        lanes bx = lanes_load(view->normal[0] + at), by = lanes_load(view->normal[1] + at),
              bz = lanes_load(view->normal[2] + at);

        /* Normals that point against each other */
        lanes_mask yes =
            lanes_less(normal[0] * bx + normal[1] * by + normal[2] * bz, zero - FACING_NONE);

        if (lanes_bits(yes) == 0) {
            continue;
        }

        /* Bounding circles near each other that both reach behind the other facet's plane */
        lanes radius = lanes_load(view->radius + at), near = a->radius + radius + m->reach;
        lanes x = lanes_load(view->center[0] + at) - center[0],
              y = lanes_load(view->center[1] + at) - center[1],
              z = lanes_load(view->center[2] + at) - center[2];

        yes &= lanes_less(normal[0] * x + normal[1] * y + normal[2] * z, radius);
        yes &= lanes_less(zero - a->radius, bx * x + by * y + bz * z);
        yes &= lanes_less(x * x + y * y + z * z, near * near);
        for (uint64_t bits = lanes_bits(yes); bits != 0; bits &= bits - 1) {
            scratch->list[0][n++] = (int)at + __builtin_ctzll(bits);
        }
    }

    for (size_t k = 0; k < n; k++) {
        int i = scratch->list[0][k];
        const struct facet *b = &m->second->facet[scratch->list[1][i]];
        struct foundation_couple c = {
            .a = a,
            .b = b,
            .ring = a->count < b->count ? m->first->ring + a->first : view_facet_ring(m, i),
            .normal_b = {view->normal[0][i], view->normal[1][i], view->normal[2][i]},
            .center_b = {view->center[0][i], view->center[1][i], view->center[2][i]},
        };

        c.facing = -vec3_dot(a->normal, c.normal_b);
        foundation_add_couple(m, &c);
    }
}

/* Checks whether a facet of the first mesh is in the common box and has a part of the box behind
 * it. If none has, the second mesh needs no view. */
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

void native_overlap_meshes(const struct native_overlap *o)
{
    const struct solid *first = o->solid[0], *second = o->solid[1];
    const struct native_relative *relative = o->relative;
    struct foundation_between m = {first, second, o, 0, 0};
    double thin = DBL_MAX, back[9], origin[3];
    struct box moved, here, there;
    const struct tree *tree = &first->facets;
    const struct tree_node *node = tree->node, *end = tree_end(tree);
    size_t nsecond;

    /* The common box in the frame of the first (here) and of the second (there) */
    native_invert_pose(relative, back, origin);
    box_transform(&second->box, relative->R, relative->p, &moved);
    if (!box_intersect(&first->box, &moved, &here, &thin)) {
        return;
    }
    box_transform(&first->box, back, origin, &moved);
    if (!box_intersect(&second->box, &moved, &there, &thin)) {
        return;
    }

    if (!meshes_reach_first(first, &here)) {
        return;
    }

    /* No ball inside the overlap is wider than thin, which limits the length of springs */
    m.reach = thin / DEPTH_NONE;
    m.fine = FINE * (first->radius < second->radius ? first->radius : second->radius);

    /* Each facet of the first mesh in the box against the view of the second */
    struct native_view *view = &m.pair->scratch->view;
    int *list = m.pair->scratch->list[1];
    size_t n = tree_collect(&m.second->facets, &there, list, m.second->nfacet), count = 0;

    for (size_t i = 0; i < n; i++) {
        const struct facet *f = &m.second->facet[list[i]];
        double normal[3], center[3];

        /* Skips a facet with no part of the box behind it */
        mat3_apply(m.pair->relative->R, f->normal, normal);
        mat3_apply(m.pair->relative->R, f->center, center);
        vec3_add_scaled(center, 1, m.pair->relative->p, center);
        if (box_least(&here, normal) >= vec3_dot(normal, center)) {
            continue;
        }

        /* Stores the facet in the first's frame */
        for (int k = 0; k < 3; k++) {
            view->normal[k][count] = normal[k];
            view->center[k][count] = center[k];
        }
        view->radius[count] = f->radius;
        view->ring[count] = -1;
        list[count++] = list[i];
    }

    /* Padding has zero normals, which face nothing */
    for (size_t i = count; i % LANES; i++) {
        for (int k = 0; k < 3; k++) {
            view->normal[k][i] = view->center[k][i] = 0;
        }
        view->radius[i] = 0;
    }
    view->ncorner = 0;
    nsecond = count;

    while (nsecond > 0 && node != end) {
        if (!boxes_meet(&node->box, &here)) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            const struct facet *f = &first->facet[tree->item[node->first + i]];

            /* Skips a facet with no part of the box behind it */
            if (box_least(&here, f->normal) < f->offset) {
                meshes_add_facet(&m, f, nsecond);
            }
        }
        ++node;
    }
}
