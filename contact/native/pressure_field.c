/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two meshes by the pressure field of one of them, the carrier: computes the pressure on the facets
 * of the other mesh, the visitor, inside the carrier. In each cell of the field
 * (contact/mesh/field.h) the penetration depth is linear. So its integrals over the part of a facet
 * in the cell are exact sums over the corners.
 *
 * The elastic force on the visitor is minus the integral of k times the depth times the visitor's
 * outward normal: the gradient of k times the integral of the depth over the common volume. It is
 * added as a whole. The component along the depth's gradient is also put on springs, for
 * dissipation and friction. The elastic force of these springs is already in the whole, so it is
 * subtracted again.
 */
#include "contact/lanes.h"
#include "contact/native/clip2d.h"

#include <float.h>

/* Largest distance between springs, over the radius of the smaller mesh. */
#define SPACING 0.6
/* a facet with more corners is bounded by its circle instead of its corners */
#define FEW_CORNERS 6
#define FACING 0.5      /* cosine; pieces that face the depth's gradient less have three springs */
#define SPACING_PARTS 8 /* maximum number of parts of a polygon along an edge */
/* cells near the visitor in the list; with more, each facet walks the tree */
#define NEAR_MOST 64

/* A carrier and a visitor in an evaluation; in the carrier's frame. */
struct visit {
    const struct field *field;
    const struct solid *carrier, *visitor;
    double R[9], p[3];                       /* pose of the visitor */
    bool turned;                             /* the carrier is the pair's second surface */
    double least;                            /* m; depth counts only beyond this */
    double spacing;                          /* largest distance between springs, m */
    const struct tree_node *near[NEAR_MOST]; /* leaves of a shell's tree near the visitor */
    int nnear;                               /* number of near; NEAR_MOST + 1: there are more */
    const struct native_overlap *pair;
};

/* A facet of the visitor, transformed into the carrier's frame. */
struct visit_facet {
    const struct facet *f;
    double normal[3], center[3], axis[2][3];
    int ncorner; /* 0 for a facet with more than FEW_CORNERS */
    double corner[FEW_CORNERS][3];
};

/* Penetration depth in one cell over the plane of a facet: a linear function from the facet's
 * center along its axes. */
struct visit_depth {
    double at, slope[2];
    double inward[3]; /* unit gradient: direction in which the depth grows most */
    double facing;    /* inward . the facet's normal */
    int sign;         /* sign of the cell's volume: -1 for an inverted cell */
};

/* Moments of area and depth over parts of a facet in one cell. Each of these parts is too small for
 * springs of its own. About an origin (x, y) in the facet's plane. */
struct visit_group {
    double x, y;
    double area, first[2], second[3]; /* x, y; xx, xy, yy */
    double depth, moment[2];
    double inward[3]; /* sum of unit gradient times projected area */
};

/* ---- forces ---- */

/* Adds springs at count points x, y in a facet's plane. All have one rate (N/m); each is as long as
 * the depth there. There must be room. The point of action is from the visitor's surface toward the
 * carrier's by the visitor's share of the depth. */
static void visit_add_springs(const struct visit *v, const struct visit_facet *f,
                              const struct visit_depth *depth, double rate, const double *x,
                              const double *y, int count)
{
    struct native_batch *batch = &v->pair->scratch->batch;
    const double share = v->pair->law->share[v->turned ? 0 : 1];
    const double at = depth->at, sx = depth->slope[0], sy = depth->slope[1];
    const size_t n = batch->n;
    double center[3], axis[2][3], d[3];

    /* Springs push the first surface, so transforms plane and gradient to the first's frame */
    if (v->turned) {
        mat3_apply(v->pair->relative->R, f->center, center);
        vec3_add_scaled(center, 1, v->pair->relative->p, center);
        mat3_apply(v->pair->relative->R, f->axis[0], axis[0]);
        mat3_apply(v->pair->relative->R, f->axis[1], axis[1]);
        mat3_apply(v->pair->relative->R, depth->inward, d);
    } else {
        memcpy(center, f->center, sizeof center);
        memcpy(axis, f->axis, sizeof axis);
        memcpy(d, depth->inward, sizeof d);
    }

    /* The point of action is linear in x and y, like the depth */
    for (int k = 0; k < 3; k++) {
        const double from = center[k] - share * at * d[k], push = v->turned ? -d[k] : d[k];
        const double ax = axis[0][k] - share * sx * d[k], ay = axis[1][k] - share * sy * d[k];
        double *p = batch->p[k] + n, *to = batch->d[k] + n;

        for (int i = 0; i < count; i++) {
            p[i] = from + x[i] * ax + y[i] * ay;
            to[i] = push;
        }
    }
    for (int i = 0; i < count; i++) {
        const double deep = at + sx * x[i] + sy * y[i];

        batch->depth[n + (size_t)i] = deep;
        batch->force[n + (size_t)i] = rate * deep;
        batch->rate[n + (size_t)i] = rate;
    }
    batch->n += (size_t)count;
}

/* ---- force and springs of a polygon of a facet in one cell ---- */

/* Adds the elastic force on the carrier of a linear depth over a polygon with moments m, along a
 * direction. The force is rate (N/m) times the mean depth, and acts at the center of pressure,
 * which the slope moves off the centroid. Does nothing for tangents and sticking friction, which
 * use the springs only. */
static void visit_add_pressure(const struct visit *v, const struct visit_facet *f,
                               const struct visit_depth *depth, const struct moments *m,
                               const double direction[3], double rate)
{
    double mean = depth->at + depth->slope[0] * m->x + depth->slope[1] * m->y, lever[3];
    double x = mean * m->x + m->xx * depth->slope[0] + m->xy * depth->slope[1];
    double y = mean * m->y + m->xy * depth->slope[0] + m->yy * depth->slope[1];

    if (v->pair->sum->tangent || v->pair->sum->sticking) {
        return;
    }
    for (int k = 0; k < 3; k++) {
        lever[k] = rate * (mean * f->center[k] + x * f->axis[0][k] + y * f->axis[1][k]);
    }

    /* Add the elastic force (N) along the direction that acts on the carrier, and its moment */
    double force = rate * mean;
    struct native_sum *sum = v->pair->sum;
    double d[3], at[3], turn[3];

    if (!v->turned) {
        vec3_cross(lever, direction, turn);
        vec3_add_scaled(sum->force, force, direction, sum->force);
        vec3_add_scaled(sum->moment, 1, turn, sum->moment);
        return;
    }

    /* If the carrier is the pair's second surface, add the opposite force to the first, in the
     * first's frame */
    mat3_apply(v->pair->relative->R, direction, d);
    mat3_apply(v->pair->relative->R, lever, at);
    vec3_add_scaled(at, force, v->pair->relative->p, at);
    vec3_cross(at, d, turn);
    vec3_add_scaled(sum->force, -force, d, sum->force);
    vec3_add_scaled(sum->moment, -1, turn, sum->moment);
}

/* Adds the moments of a polygon's area and depth to a group, about the group's origin, the
 * centroid of its first polygon. */
static void group_add(struct visit_group *g, const struct visit_depth *depth,
                      const struct moments *m, double mean)
{
    double area = m->twice / 2;
    double along0 = m->xx * depth->slope[0] + m->xy * depth->slope[1];
    double along1 = m->xy * depth->slope[0] + m->yy * depth->slope[1], x, y;

    /* The first polygon sets the origin, so that little cancels */
    if (g->area <= 0) {
        g->x = m->x;
        g->y = m->y;
    }
    x = m->x - g->x;
    y = m->y - g->y;

    /* Moments of the area, then of the depth: mean depth at the centroid, and its slope */
    g->area += area;
    g->first[0] += area * x;
    g->first[1] += area * y;
    g->second[0] += area * (m->xx + x * x);
    g->second[1] += area * (m->xy + x * y);
    g->second[2] += area * (m->yy + y * y);
    g->depth += area * mean;
    g->moment[0] += area * (mean * x + along0);
    g->moment[1] += area * (mean * y + along1);
    for (int k = 0; k < 3; k++) {
        g->inward[k] += area * depth->facing * depth->inward[k];
    }
}

/* Computes the moments of a group's area, and the linear depth with the same moments as the
 * group's; constant if the area is a line. */
static void group_find_depth(const struct visit_group *g, struct moments *m,
                             struct visit_depth *depth)
{
    double inverse = 1 / g->area, x = g->first[0] * inverse, y = g->first[1] * inverse;
    double mean = g->depth * inverse, room;
    double mx = g->moment[0] * inverse - mean * x, my = g->moment[1] * inverse - mean * y;

    m->twice = 2 * g->area;
    m->x = g->x + x;
    m->y = g->y + y;
    m->xx = g->second[0] * inverse - x * x;
    m->xy = g->second[1] * inverse - x * y;
    m->yy = g->second[2] * inverse - y * y;
    room = m->xx * m->yy - m->xy * m->xy;
    depth->slope[0] = depth->slope[1] = 0;
    if (room > 1e-12 * (m->xx + m->yy) * (m->xx + m->yy)) {
        depth->slope[0] = (m->yy * mx - m->xy * my) / room;
        depth->slope[1] = (m->xx * my - m->xy * mx) / room;
    }
    depth->at = mean - depth->slope[0] * m->x - depth->slope[1] * m->y;
}

/* Adds three springs for a whole group. */
static void group_add_springs(const struct visit *v, const struct visit_facet *f,
                              struct visit_group *g)
{
    const double facing = vec3_norm(g->inward), rate = v->pair->law->stiffness * facing;
    struct visit_depth depth;
    struct moments m;
    double x[3], y[3];

    if (!(facing > 0)) {
        return;
    }
    for (int k = 0; k < 3; k++) {
        depth.inward[k] = g->inward[k] / facing;
    }
    group_find_depth(g, &m, &depth);

    clip2d_three_points(&m, x, y);
    native_make_room(v->pair, 3);
    visit_add_springs(v, f, &depth, rate / 3, x, y, 3);
    visit_add_pressure(v, f, &depth, &m, depth.inward, -rate);
}

/* Clips a polygon to the strip between two lines across an axis (0 x, 1 y); returns the result,
 * g[0] or g[1]. */
static const struct polygon2d *clip2d_between(const struct polygon2d *in, int axis, double low,
                                              double high, struct polygon2d g[2])
{
    const struct polygon2d *now = in;
    double side[POLYGON_MAX];

    for (int end = 0; end < 2; end++) {
        const double *at = axis ? now->y : now->x;
        struct polygon2d *next = &g[end];

        for (int i = 0; i < now->n; i++) {
            side[i] = end ? high - at[i] : at[i] - low;
        }
        clip2d_side(now, side, next);
        now = next;
    }
    return now;
}

/* Finds the smallest and largest coordinate of a polygon along an axis (0 x, 1 y). */
static void flat_find_reach(const struct polygon2d *g, int axis, double *low, double *high)
{
    const double *at = axis ? g->y : g->x;

    *low = DBL_MAX;
    *high = -DBL_MAX;
    for (int i = 0; i < g->n; i++) {
        *low = at[i] < *low ? at[i] : *low;
        *high = at[i] > *high ? at[i] : *high;
    }
}

/* Returns the number of parts of a length (m) so that none exceeds the spacing; at most
 * SPACING_PARTS. */
static int visit_count_parts(const struct visit *v, double length)
{
    const double wanted = length / v->spacing + 1;

    return wanted < SPACING_PARTS ? (int)wanted : SPACING_PARTS;
}

/* Adds springs on a wide polygon. Cuts it into columns, and the columns into rectangles no wider
 * than the spacing, with three springs each. */
static void visit_add_grid(const struct visit *v, const struct visit_facet *f,
                           const struct visit_depth *depth, const struct polygon2d *g)
{
    double left, right, low, high;

    /* Cuts the polygon into columns of equal width along x */
    flat_find_reach(g, 0, &left, &right);

    const int columns = visit_count_parts(v, right - left);

    for (int c = 0; c < columns; c++) {
        const double wide = (right - left) / columns;
        struct polygon2d cut[2][2];
        const struct polygon2d *column =
            clip2d_between(g, 0, left + c * wide, left + (c + 1) * wide, cut[0]);

        /* Cuts each column into rows of equal height along y */
        flat_find_reach(column, 1, &low, &high);
        for (int r = 0, rows = visit_count_parts(v, high - low); column->n >= 3 && r < rows; r++) {
            const double tall = (high - low) / rows;
            const struct polygon2d *part =
                clip2d_between(column, 1, low + r * tall, low + (r + 1) * tall, cut[1]);
            struct visit_group group = {.area = 0};
            struct moments m;

            if (part->n < 3) {
                continue;
            }

            /* A rectangle is a group with one polygon */
            clip2d_moments(part, true, &m);
            if (m.twice > DBL_MIN) {
                group_add(&group, depth, &m,
                          depth->at + depth->slope[0] * m.x + depth->slope[1] * m.y);
                group_add_springs(v, f, &group);
            }
        }
    }
}

/* Adds force and springs of a polygon of a facet in one cell. Adds a small polygon to the group
 * instead, which has three springs for all its polygons. */
static void visit_add_polygon(const struct visit *v, const struct visit_facet *f,
                              const struct visit_depth *depth, const struct polygon2d *g,
                              struct visit_group *group)
{
    const double wide = v->field->planar ? v->spacing / 2 : v->spacing;
    double mean, radius2 = 0;
    struct moments m;

    if (g->n < 3) {
        return;
    }
    clip2d_moments(g, true, &m);
    if (!(m.twice > DBL_MIN)) {
        return;
    }

    /* Adds the elastic force along the visitor's normal; inverted cells subtract it */
    mean = depth->at + depth->slope[0] * m.x + depth->slope[1] * m.y;
    visit_add_pressure(v, f, depth, &m, f->normal,
                       depth->sign * v->pair->law->stiffness * m.twice / 2);
    v->pair->sum->area += DBL_MIN; /* marks contact even without pressure */
    if (depth->sign < 0 || depth->facing <= 0) {
        return;
    }

    /* Area in touch, deepest penetration, and size of the part with pressure */
    v->pair->sum->area += depth->facing * m.twice / 2;
    for (int i = 0; i < g->n; i++) {
        double deep = depth->at + depth->slope[0] * g->x[i] + depth->slope[1] * g->y[i];
        double x = g->x[i] - m.x, y = g->y[i] - m.y, r2 = x * x + y * y;

        v->pair->sum->depth = deep > v->pair->sum->depth ? deep : v->pair->sum->depth;
        radius2 = r2 > radius2 ? r2 : radius2;
    }

    /* A small polygon shares the three springs of its group; a large one has its own */
    if (radius2 <= wide * wide || depth->facing <= FACING) {
        group_add(group, depth, &m, mean);
    } else if (v->field->planar) {
        /* Add springs on a whole polygon, and subtract their elastic force from the sum. The
         * springs integrate force and moment of a linear depth exactly. */
        const double center[2] = {m.x, m.y};

        for (int i = 0; i < g->n; i++) {
            int j = i + 1 < g->n ? i + 1 : 0;
            const double u[2] = {g->x[i] - m.x, g->y[i] - m.y};
            const double w[2] = {g->x[j] - m.x, g->y[j] - m.y};

            /* Add springs on the triangle between a polygon's centroid and an edge, whose ends are
             * u and w relative to the centroid. The triangle is cut into equal triangles no wider
             * than the spacing, with three springs each. */
            const double e[2] = {w[0] - u[0], w[1] - u[1]}, uu = u[0] * u[0] + u[1] * u[1];
            const double ww = w[0] * w[0] + w[1] * w[1], ee = e[0] * e[0] + e[1] * e[1];
            const double longest = sqrt(ee > uu ? ee > ww ? ee : ww : uu > ww ? uu : ww);
            const int wanted = (int)(longest / v->spacing) + 1;
            const int parts = wanted < SPACING_PARTS ? wanted : SPACING_PARTS;
            const double area = (u[0] * w[1] - u[1] * w[0]) / 2;
            const double part = 1.0 / parts,
                         rate = v->pair->law->stiffness * depth->facing * area / 3 * part * part;
            double x[3 * SPACING_PARTS * SPACING_PARTS], y[3 * SPACING_PARTS * SPACING_PARTS];
            int n = 0;

            /* Quadrature points, row by row of the small triangles */
            for (int row = 0; row < parts; row++) {
                for (int at = 0; at < 2 * (parts - row) - 1; at++) {
                    for (int q = 0; q < 3; ++q, ++n) {
                        double s, t;

                        triangle_find_point(part, row, at, q, &s, &t);
                        x[n] = center[0] + s * u[0] + t * w[0];
                        y[n] = center[1] + s * u[1] + t * w[1];
                    }
                }
            }
            native_make_room(v->pair, (size_t)n);
            visit_add_springs(v, f, depth, rate, x, y, n);
        }
        visit_add_pressure(v, f, depth, &m, depth->inward,
                           -v->pair->law->stiffness * depth->facing * m.twice / 2);
    } else {
        visit_add_grid(v, f, depth, g);
    }
}

/* ---- a carrier with few sides ---- */

/* Clips a polygon to the region where the linear function at + x X + y Y is not negative; returns
 * the result, g[0] or g[1]. A polygon on which the function is 0 everywhere is the common wall of
 * two cells. It is kept unless give_away is set, so that only one of the cells has it. */
static struct polygon2d *clip2d_linear(struct polygon2d g[2], struct polygon2d *now, double at,
                                       double x, double y, bool give_away)
{
    double side[POLYGON_MAX];
    struct polygon2d *next = now == &g[0] ? &g[1] : &g[0];
    bool all = true, some = false;

    for (int i = 0; i < now->n; i++) {
        side[i] = at + x * now->x[i] + y * now->y[i];
        all = all && side[i] >= 0;
        some = some || side[i] > 0;
    }
    if (give_away && !some) {
        now->n = 0;
        return now;
    }
    if (all) {
        return now;
    }
    clip2d_side(now, side, next);
    return next;
}

/* A linear function over a facet's plane. */
struct flat_linear {
    double at, x, y;
};

/* Returns whether a linear function is negative (-1) or positive (1) on the whole circle of this
 * radius about the facet's center; else 0. */
static int linear_sign_over(const struct flat_linear *l, double radius)
{
    if (l->at * l->at <= radius * radius * (l->x * l->x + l->y * l->y)) {
        return 0;
    }
    return l->at > 0 ? 1 : -1;
}

/* Clips a facet to the region where one side of a convex carrier gives the depth: the depth is
 * positive and no other side is nearer. depth: linear depth under each of the count sides. Returns
 * the polygon, g[0] or g[1]. */
static const struct polygon2d *planes_clip_facet(const struct visit *v, const struct visit_facet *f,
                                                 const struct flat_linear *depth, int count,
                                                 int side, struct polygon2d g[2])
{
    const struct flat_linear *own = &depth[side];
    struct polygon2d *now = &g[0];

    clip2d_outline(v->visitor, f->f, now);
    if (linear_sign_over(own, f->f->radius) == 0) {
        now = clip2d_linear(g, now, own->at, own->x, own->y, false);
    }
    for (int k = 0; k < count && now->n >= 3; k++) {
        const struct flat_linear over = {depth[k].at - own->at, depth[k].x - own->x,
                                         depth[k].y - own->y};

        if (k != side && linear_sign_over(&over, f->f->radius) <= 0) {
            now = clip2d_linear(g, now, over.at, over.x, over.y, k < side);
        }
    }
    return now;
}

/* Adds a facet in a convex carrier with few sides. For each side, adds the part of the facet that
 * is nearest to the side. */
static void visit_planes(const struct visit *v, const struct visit_facet *f)
{
    const struct solid *s = v->carrier;
    const int n = (int)s->nfacet;
    struct flat_linear over[FIELD_MAX_PLANES];
    int nearest = 0;

    /* Depth under each side over the facet's plane; no contact if the whole facet is outside a
     * side */
    for (int i = 0; i < n; i++) {
        const struct facet *side = &s->facet[i];

        over[i].at = side->offset - vec3_dot(side->normal, f->center) - v->least;
        over[i].x = -vec3_dot(side->normal, f->axis[0]);
        over[i].y = -vec3_dot(side->normal, f->axis[1]);
        if (linear_sign_over(&over[i], f->f->radius) < 0) {
            return;
        }
        nearest = over[i].at < over[nearest].at ? i : nearest;
    }

    for (int i = 0; i < n; i++) {
        const struct flat_linear less = {over[nearest].at - over[i].at, over[nearest].x - over[i].x,
                                         over[nearest].y - over[i].y};
        struct visit_depth depth = {.at = over[i].at, .slope = {over[i].x, over[i].y}, .sign = 1};
        struct visit_group group = {.area = 0};
        struct polygon2d g[2];

        /* Skips a side that is everywhere farther than the side nearest to the center */
        if (linear_sign_over(&less, f->f->radius) < 0) {
            continue;
        }
        for (int k = 0; k < 3; k++) {
            depth.inward[k] = -s->facet[i].normal[k];
        }
        depth.facing = vec3_dot(depth.inward, f->normal);
        visit_add_polygon(v, f, &depth, planes_clip_facet(v, f, over, n, i, g), &group);
        if (group.area > 0) {
            group_add_springs(v, f, &group);
        }
    }
}

/* ---- a carrier with a shell ---- */

/* Computes the intersection of a tetrahedron and the facet's plane. height: heights of the nodes
 * over the plane, m. Returns the number of corners: 0, 3 or 4. */
static int tetrahedron_cut(const double *const node[4], const double height[4],
                           const struct visit_facet *f, struct polygon2d *g)
{
    int above[4], below[4], nabove = 0, nbelow = 0, n;
    const double radius = f->f->radius;
    double twice = 0, low[2] = {DBL_MAX, DBL_MAX}, high[2] = {-DBL_MAX, -DBL_MAX};

    /* Nodes above and below the plane */
    for (int i = 0; i < 4; i++) {
        if (height[i] >= 0) {
            above[nabove++] = i;
        } else {
            below[nbelow++] = i;
        }
    }
    if (nabove == 0 || nbelow == 0) {
        return 0;
    }

    /* Intersections of the edges with the plane, in order around the polygon, and their bounds */
    n = nabove == 2 ? 4 : 3;
    for (int i = 0; i < n; i++) {
        int from = nabove == 2 ? above[i / 2] : nabove == 3 ? above[i] : above[0];
        int to = nabove == 2 ? below[i == 1 || i == 2] : nabove == 3 ? below[0] : below[i];
        const double *a = node[from], *b = node[to];
        double t = height[from] / (height[from] - height[to]), p[3];

        for (int k = 0; k < 3; k++) {
            p[k] = a[k] + t * (b[k] - a[k]) - f->center[k];
        }
        g->x[i] = vec3_dot(f->axis[0], p);
        g->y[i] = vec3_dot(f->axis[1], p);
        low[0] = g->x[i] < low[0] ? g->x[i] : low[0];
        low[1] = g->y[i] < low[1] ? g->y[i] : low[1];
        high[0] = g->x[i] > high[0] ? g->x[i] : high[0];
        high[1] = g->y[i] > high[1] ? g->y[i] : high[1];
    }

    /* Skips a polygon that is not near the facet */
    if (low[0] > radius || low[1] > radius || high[0] < -radius || high[1] < -radius) {
        return 0;
    }

    /* Reverses the corners if the signed area is negative, so that they are counterclockwise */
    g->n = n;
    for (int i = 1; i + 1 < n; i++) {
        twice += (g->x[i] - g->x[0]) * (g->y[i + 1] - g->y[0]) -
                 (g->y[i] - g->y[0]) * (g->x[i + 1] - g->x[0]);
    }
    if (twice < 0) {
        double x = g->x[0], y = g->y[0];

        g->x[0] = g->x[2];
        g->y[0] = g->y[2];
        g->x[2] = x;
        g->y[2] = y;
    }
    return n;
}

/* Computes the linear depth in a tetrahedron over the facet's plane from the depths at its nodes.
 * Returns false if its volume is within rounding. */
static bool tetrahedron_find_depth(const struct visit *v, const double *const node[4], int sign,
                                   const struct visit_facet *f, struct visit_depth *depth)
{
    double e[3][3], across[3][3], gradient[3], volume, whole, length, to[3];

    /* Edges from node 0 and their cross products; volume: six times the tetrahedron's */
    for (int i = 0; i < 3; i++) {
        vec3_sub(node[i + 1], node[0], e[i]);
    }
    for (int i = 0; i < 3; i++) {
        vec3_cross(e[(i + 1) % 3], e[(i + 2) % 3], across[i]);
    }
    volume = vec3_dot(e[0], across[0]);
    whole = vec3_dot(e[0], e[0]) * vec3_dot(e[1], e[1]) * vec3_dot(e[2], e[2]);
    if (volume * volume <= FIELD_NO_VOLUME * whole) {
        return false;
    }

    /* Gradient of the depth by Cramer's rule, and its slope along the axes of the plane */
    for (int k = 0; k < 3; k++) {
        gradient[k] =
            ((node[1][3] - node[0][3]) * across[0][k] + (node[2][3] - node[0][3]) * across[1][k] +
             (node[3][3] - node[0][3]) * across[2][k]) /
            volume;
    }
    vec3_sub(f->center, node[0], to);
    depth->at = node[0][3] + vec3_dot(gradient, to) - v->least;
    depth->slope[0] = vec3_dot(gradient, f->axis[0]);
    depth->slope[1] = vec3_dot(gradient, f->axis[1]);

    /* Direction of the gradient, and whether the cell is inverted */
    length = vec3_norm(gradient);
    for (int k = 0; k < 3; k++) {
        depth->inward[k] = length > 0 ? gradient[k] / length : 0;
    }
    depth->facing = vec3_dot(depth->inward, f->normal);
    depth->sign = volume > 0 ? sign : -sign;
    return true;
}

/* Adds a facet in one tetrahedron. Cuts the tetrahedron with the facet's plane, and clips the
 * result to the facet and to positive depth. height: heights of the nodes over the plane. sign:
 * sign of the volume if the tetrahedron is not inverted. */
static void visit_tetrahedron(const struct visit *v, const struct visit_facet *f,
                              const double *const node[4], const double height[4], int sign,
                              struct visit_group *group)
{
    struct visit_depth depth;
    struct polygon2d g[2];
    const struct polygon2d *left;

    if (tetrahedron_cut(node, height, f, &g[0]) == 0) {
        return;
    }
    left = clip2d_to_facet(v->visitor, f->f, g, 0);
    if (left->n < 3 || !tetrahedron_find_depth(v, node, sign, f, &depth)) {
        return;
    }
    if (v->least > 0) {
        left = clip2d_linear(g, left == &g[0] ? &g[0] : &g[1], depth.at, depth.slope[0],
                             depth.slope[1], false);
    }
    visit_add_polygon(v, f, &depth, left, group);
}

/* Returns the smallest value of d . p over the points p of a facet, or a lower bound if the
 * corners are not transformed. d: unit. */
static double facet_find_least(const struct visit_facet *f, const double d[3])
{
    double along = vec3_dot(d, f->normal), across = 1 - along * along, least = DBL_MAX;

    if (f->ncorner == 0) {
        return vec3_dot(d, f->center) - f->f->radius * sqrt(across > 0 ? across : 0);
    }
    for (int i = 0; i < f->ncorner; i++) {
        double here = vec3_dot(d, f->corner[i]);

        least = here < least ? here : least;
    }
    return least;
}

/* Checks whether a prism is completely farther inside than a facet, along the normal of the prism's
 * triangle. */
static bool prism_is_behind(const struct visit *v, const struct visit_facet *f, int cell,
                            const struct field_prism *prism)
{
    const double *n = v->carrier->normal[cell % (int)v->carrier->nface];
    const double low = facet_find_least(f, n);

    for (int i = 0; i < prism->nnode; i++) {
        if (vec3_dot(n, prism->node[i]) >= low) {
            return false;
        }
    }
    return true;
}

/* Adds a facet in one prism of the shell, for each of its tetrahedra that the facet's plane
 * cuts. */
static void visit_prism(const struct visit *v, const struct visit_facet *f, int cell)
{
    struct field_prism prism;
    struct visit_group group = {.area = 0};
    const double offset = vec3_dot(f->normal, f->center);
    double height[6];
    int above = 0;

    v->pair->scratch->visits++;
    field_find_prism(v->field, cell, &prism);
    for (int i = 0; i < prism.nnode; i++) {
        height[i] = vec3_dot(f->normal, prism.node[i]) - offset;
        above += height[i] >= 0;
    }

    /* Skips the prism if the plane does not cut it or the facet is nearer to the surface */
    if (above == 0 || above == prism.nnode || prism_is_behind(v, f, cell, &prism)) {
        return;
    }

    /* Adds the tetrahedra, with the sign of their volume (field_tetrahedron) */
    for (int i = 0; i + 4 <= prism.nnode; i++) {
        const int *corner = field_tetrahedron[i];
        const double *node[4];
        double over[4];

        for (int k = 0; k < 4; k++) {
            node[k] = prism.node[corner[k]];
            over[k] = height[corner[k]];
        }
        visit_tetrahedron(v, f, node, over, i == 1 ? prism.sign : -prism.sign, &group);
    }
    if (group.area > 0) {
        group_add_springs(v, f, &group);
    }
}

/* Computes the box about a facet, or about its bounding circle if its corners are not
 * transformed. */
static void facet_find_box(const struct visit_facet *f, struct box *box)
{
    if (f->ncorner > 0) {
        *box = box_of_point(f->corner[0]);
        for (int i = 1; i < f->ncorner; i++) {
            box_add(box, f->corner[i]);
        }
        return;
    }
    for (int k = 0; k < 3; k++) {
        double room = 1 - f->normal[k] * f->normal[k];
        double reach = f->f->radius * sqrt(room > 0 ? room : 0);

        box->low[k] = f->center[k] - reach;
        box->high[k] = f->center[k] + reach;
    }
}

/* Bounds of a facet, to test whether it may touch the cells in a box: the box must meet the facet's
 * box and its plane. */
struct visit_probe {
    struct box box;
    double offset, back[3];
};

/* Checks whether a box meets a facet's box and plane. */
static bool probe_meets(const struct visit_probe *probe, const struct visit_facet *f,
                        const struct box *box)
{
    return boxes_meet(box, &probe->box) && box_least(box, f->normal) <= probe->offset &&
           box_least(box, probe->back) <= -probe->offset;
}

/* Adds a facet in all prisms of the shell whose box meets the facet's box and plane. */
static void visit_shell(const struct visit *v, const struct visit_facet *f)
{
    const struct tree *tree = &v->field->tree;
    const struct tree_node *node = tree->node, *end = tree_end(tree);
    struct visit_probe probe = {.offset = vec3_dot(f->normal, f->center),
                                .back = {-f->normal[0], -f->normal[1], -f->normal[2]}};

    facet_find_box(f, &probe.box);

    /* Uses the list of cells near the visitor; if there are too many, walks down the tree */
    for (int i = 0; i < v->nnear && v->nnear <= NEAR_MOST; i++) {
        if (probe_meets(&probe, f, &v->near[i]->box)) {
            visit_prism(v, f, v->field->cell[tree->item[v->near[i]->first]]);
        }
    }
    while (v->nnear > NEAR_MOST && node != end) {
        if (!probe_meets(&probe, f, &node->box)) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            visit_prism(v, f, v->field->cell[tree->item[node->first + i]]);
        }
        ++node;
    }
}

/* ---- two meshes ---- */

/* Lists the cells of a shell that meet a box (each is a leaf), and computes the box about them.
 * Returns false if there are none. */
static bool visit_find_near(struct visit *v, const struct box *where, struct box *about)
{
    const struct tree *tree = &v->field->tree;
    const struct tree_node *node = tree->node, *end = tree_end(tree);

    v->nnear = 0;
    while (node != end) {
        if (!boxes_meet(&node->box, where)) {
            node += node->size;
            continue;
        }
        /* Stops listing after NEAR_MOST cells; the box still covers all of them */
        if (node->count > 0) {
            *about = v->nnear > 0 ? *about : node->box;
            box_add_box(about, &node->box);
            if (v->nnear < NEAR_MOST) {
                v->near[v->nnear] = node;
            }
            v->nnear += v->nnear <= NEAR_MOST;
        }
        ++node;
    }
    return v->nnear > 0;
}

/* Adds the visitor's facets in the carrier's box `in`; for a shell, only near listed cells. where:
 * box about the visitor. Both boxes are in the carrier's frame. R and p: pose of the carrier in the
 * visitor's frame. */
static void visit_near(struct visit *v, const struct box *in, const struct box *where,
                       const double R[9], const double p[3])
{
    struct box about = *in, there;

    if (v->field->planar || visit_find_near(v, where, &about)) {
        box_transform(&about, R, p, &there);

        /* Add all facets of the visitor in a box; the box is in the visitor's frame */
        const struct tree *tree = &v->visitor->facets;
        const struct tree_node *node = tree->node, *end = tree_end(tree);

        while (node != end) {
            if (!boxes_meet(&node->box, &there)) {
                node += node->size;
                continue;
            }
            for (int i = 0; i < node->count; i++) {
                struct visit_facet f;

                /* Transforms the facet into the carrier's frame */
                f.f = &v->visitor->facet[tree->item[node->first + i]];
                mat3_apply(v->R, f.f->normal, f.normal);
                mat3_apply(v->R, f.f->axis[0], f.axis[0]);
                mat3_apply(v->R, f.f->axis[1], f.axis[1]);
                mat3_apply(v->R, f.f->center, f.center);
                vec3_add_scaled(f.center, 1, v->p, f.center);
                if (v->field->planar) {
                    visit_planes(v, &f);
                    continue;
                }

                /* Transforms the corners, for the facet's box in the shell */
                f.ncorner = f.f->count <= FEW_CORNERS ? f.f->count : 0;
                for (int k = 0; k < f.ncorner; k++) {
                    mat3_apply(v->R, v->visitor->ring[f.f->first + k], f.corner[k]);
                    vec3_add_scaled(f.corner[k], 1, v->p, f.corner[k]);
                }
                visit_shell(v, &f);
            }
            ++node;
        }
    }
}

/* Shrinks a box by a depth, m, on all sides. Returns false if it becomes empty. */
static bool box_shrink(const struct box *box, double by, struct box *out)
{
    for (int k = 0; k < 3; k++) {
        out->low[k] = box->low[k] + by;
        out->high[k] = box->high[k] - by;
        if (out->low[k] >= out->high[k]) {
            return false;
        }
    }
    return true;
}

/* Two meshes that interact by a pressure field. */
struct visit_couple {
    const struct field *first, *second; /* the second's field may be NULL */
    /* box of the second mesh in the first's frame; box of the first mesh in the second's frame */
    const struct box *moved, *there;
    const double *back, *origin; /* rotation and origin of the first in the second's frame */
};

/* Adds the second's facets in the part of the first's field that is deeper than least, m. Then adds
 * the first's facets in the part of the second's field that is deeper than both least and the
 * first's largest depth. */
static void visit_couple_from(struct visit *v, const struct visit_couple *c, double least)
{
    const struct visit kept = *v;
    struct box in = c->first->solid->box, moved;

    v->least = least;
    if (least <= 0 || box_shrink(&c->first->solid->box, least, &in)) {
        visit_near(v, &in, c->moved, c->back, c->origin);
    }

    /* The second as carrier: only depth beyond the first's largest depth counts */
    least = fmax(least, c->first->deepest);
    if (c->second && c->second->deepest > least &&
        box_shrink(&c->second->solid->box, least, &moved) && boxes_meet(&moved, c->there)) {
        v->field = c->second;
        v->carrier = c->second->solid;
        v->visitor = c->first->solid;
        v->turned = true;
        v->least = least;
        memcpy(v->R, c->back, sizeof v->R);
        memcpy(v->p, c->origin, sizeof v->p);
        visit_near(v, &moved, c->there, kept.pair->relative->R, kept.pair->relative->p);
    }
    *v = kept;
}

void native_overlap_fields(const struct native_overlap *o)
{
    const struct native_relative *relative = o->relative;
    const struct solid *a = o->field[0]->solid, *b = o->solid[1];
    struct visit v = {.field = o->field[0], .carrier = a, .visitor = b, .pair = o};
    struct box moved, there;
    double back[9], origin[3];
    const struct visit_couple couple = {o->field[0], o->field[1], &moved, &there, back, origin};

    /* Pose of the first in the second's frame, and both boxes; without overlap there is no
     * contact */
    native_invert_pose(relative, back, origin);
    box_transform(&b->box, relative->R, relative->p, &moved);
    box_transform(&a->box, back, origin, &there);
    if (!boxes_meet(&a->box, &moved) || !boxes_meet(&b->box, &there)) {
        return;
    }

    /* The visitor's pose in the carrier's frame */
    v.spacing = SPACING * (a->radius < b->radius ? a->radius : b->radius);
    memcpy(v.R, relative->R, sizeof v.R);
    memcpy(v.p, relative->p, sizeof v.p);

    visit_couple_from(&v, &couple, o->from);
}
