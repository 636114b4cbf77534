/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Computes the springs between two facets. All is done in the plane of the facet with more corners,
 * the base, whose outline there is known beforehand: the other one's corners are projected along
 * the springs into that plane, what is not deep is clipped away first as it mostly leaves nothing,
 * and the rest is clipped to the outline.
 *
 * With e the unit vector along the difference of the normals, which have the same angle to it, the
 * way from a height h over one facet's plane back to it along e is h over that angle's cosine; so
 * the other one's corners, and the depth anywhere in the base's plane, follow without a division.
 */
#include "contact/lanes.h"
#include "contact/native/facets.h"
#include "contact/native/flat.h"
#include "contact/native/polygon.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* The springs between two facets: all along one direction, ending on both. */
struct bed {
    const struct facet *base, *other;
    const double *base_normal, *other_normal, *origin; /* first's frame; the base's center */
    bool on_second;                                    /* the base is the second mesh's facet */
    double axis[2][3];                                 /* directions of the base's outline */
    double along[3];        /* unit, of the springs: the way they push the first */
    double cosine;          /* of the angle between springs and normals */
    double depth, slope[2]; /* at the origin, and how it grows in the base's plane */
};

/* Returns the length of the spring through a place in the base's plane, its penetration depth,
 * m. */
static double bed_depth(const struct bed *bed, double x, double y)
{
    return bed->depth + bed->slope[0] * x + bed->slope[1] * y;
}

/* ---- where both lie on top of one another ---- */

/* Computes direction and depth of the bed, and projects the other facet's corners along it into the
 * base's plane, in reverse order to have them counterclockwise there. Returns false when no corner
 * is behind that plane. */
static bool bed_lay(const struct facets_between *m, const struct facets_couple *c, struct bed *bed,
                    struct flat *flat)
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

    /* How high the other one's corners are over its plane */
    offset = vec3_dot(bed->base_normal, bed->origin);
    flat->n = bed->other->count;
    for (int i = 0; i < flat->n; i++) {
        height[i] = vec3_dot(bed->base_normal, c->ring[i]) - offset;
        behind = behind || height[i] < 0;
    }
    if (!behind) {
        return false;
    }

    /* The springs' direction, along the difference of the normals, and their length in the plane */
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
            mat3_apply(m->relative->R, bed->base->axis[side], bed->axis[side]);
        } else {
            memcpy(bed->axis[side], bed->base->axis[side], sizeof bed->axis[side]);
        }
        /* Against the springs from the first mesh's facet to the second's, or with them */
        lean[side] = vec3_dot(bed->axis[side], bed->along) * (bed->on_second ? 2 : -2) * inverse;
        bed->slope[side] = -2 * inverse * vec3_dot(bed->other_normal, bed->axis[side]);
    }

    /* The other one's corners along the springs in the plane */
    for (int i = 0; i < flat->n; i++) {
        int at = flat->n - 1 - i;

        vec3_sub(c->ring[i], bed->origin, to);
        flat->x[at] = vec3_dot(bed->axis[0], to) - lean[0] * height[i];
        flat->y[at] = vec3_dot(bed->axis[1], to) - lean[1] * height[i];
    }
    return true;
}

/* Clips the polygon g[0] to where it is deep and on the base; returns the clipped one, one of the
 * two. */
static const struct flat *bed_clip(const struct solid *solid, const struct bed *bed,
                                   struct flat g[2])
{
    double side[POLYGON_MAX];
    bool all = true;

    for (int i = 0; i < g[0].n; i++) {
        side[i] = bed_depth(bed, g[0].x[i], g[0].y[i]);
        all = all && side[i] >= 0;
    }
    if (!all) {
        flat_clip(&g[0], side, &g[1]);
    }
    return flat_clip_to_facet(solid, bed->base, g, all ? 0 : 1);
}

/* ---- springs ---- */

/* Returns the root of x, or 0 where rounding has left x below 0. */
static double positive_root(double x)
{
    return sqrt(x > 0 ? x : 0);
}

/* Computes a point of the spring through a place in the base's plane: part 0 is at the first mesh's
 * facet, part 1 at the second's, a depth apart. */
static void bed_place_on_spring(const struct bed *bed, double x, double y, double depth,
                                double part, double out[3])
{
    double step = (bed->on_second ? part - 1 : part) * depth;

    for (int k = 0; k < 3; k++) {
        out[k] = bed->origin[k] + x * bed->axis[0][k] + y * bed->axis[1][k] + step * bed->along[k];
    }
}

/* Adds the spring through a place in the base's plane, with the force at the point that the law's
 * shares give. */
static void bed_add_spring(const struct facets_between *m, const struct bed *bed, double x,
                           double y, double rate)
{
    double depth = bed_depth(bed, x, y), p[3];

    bed_place_on_spring(bed, x, y, depth, m->law->share[0], p);
    batch_add_spring(&m->scratch->batch, p, bed->along, rate, depth);
}

/* Adds three springs for all of a polygon. They stand at L times the corners of an equilateral
 * triangle about the centroid, L L' being twice the matrix of the mean squares off the centroid. So
 * they have the polygon's moments up to the second, which integrates force and moment of a linear
 * depth exactly. None is off the polygon: the ellipse through them is inside every convex figure
 * (Kannan, Lovasz, Simonovits 1995); in a triangle it touches the middles of the sides. */
static void bed_add_three(const struct facets_between *m, const struct bed *bed,
                          const struct moments *at, double rate)
{
    double lx = positive_root(2 * at->xx), ly = lx > 0 ? 2 * at->xy / lx : 0;
    double lyy = positive_root(2 * at->yy - ly * ly);
    const double h = 0.86602540378443865; /* sqrt(3)/2 */

    native_law_make_room(&m->scratch->batch, 3, m->law, m->relative, m->sum);
    bed_add_spring(m, bed, at->x, at->y + lyy, rate / 3);
    bed_add_spring(m, bed, at->x - h * lx, at->y - h * ly - lyy / 2, rate / 3);
    bed_add_spring(m, bed, at->x + h * lx, at->y + h * ly - lyy / 2, rate / 3);
}

/* Adds three springs for each triangle between the centroid and an edge. */
static void bed_add_around(const struct facets_between *m, const struct bed *bed,
                           const struct flat *g, const struct moments *at, double rate)
{
    for (int i = 0; i < g->n; i++) {
        int j = i + 1 < g->n ? i + 1 : 0;
        double ux = g->x[i] - at->x, uy = g->y[i] - at->y;
        double vx = g->x[j] - at->x, vy = g->y[j] - at->y;
        double part = rate * (ux * vy - uy * vx) / (3 * at->twice);

        native_law_make_room(&m->scratch->batch, FACET_POINTS, m->law, m->relative, m->sum);
        bed_add_spring(m, bed, at->x + (ux + vx) / 6, at->y + (uy + vy) / 6, part);
        bed_add_spring(m, bed, at->x + (4 * ux + vx) / 6, at->y + (4 * uy + vy) / 6, part);
        bed_add_spring(m, bed, at->x + (ux + 4 * vx) / 6, at->y + (uy + 4 * vy) / 6, part);
    }
}

/* ---- how much they count ---- */

/* Returns the depth of a spring's middle under the surface of a solid, in half lengths of the
 * spring (up to DEPTH_FULL; the rest does not matter). middle: in the solid's frame; cosine: of the
 * angle between spring and normal. */
static double spring_middle_depth(const struct solid *solid, const struct facet *facet,
                                  double cosine, const double middle[3], double half)
{
    /* Within the clearance only faces that touch the facet can be nearest. When none is bent so far
     * that the middle is nearer to it than DEPTH_FULL, no search is needed */
    if (half <= facet->clearance &&
        facet->bend_cosine * cosine - facet->bend_sine * positive_root(1 - cosine * cosine) >=
            DEPTH_FULL) {
        return DEPTH_FULL;
    }
    /* The surface at the spring's end is half a spring away, so the search always ends at one */
    return solid_depth(solid, middle, (solid->convex ? DEPTH_FULL : 1) * 1.01 * half) / half;
}

/* Returns how much a spring counts, 0 to 1, that is this long (m) and has its middle here (first's
 * frame). */
static double spring_weight(const struct facets_between *m, const struct facets_couple *c,
                            double cosine, const double middle[3], double length)
{
    double a = spring_middle_depth(m->first, c->a, cosine, middle, length / 2), b, to[3], there[3];

    if (a <= DEPTH_NONE) {
        return 0;
    }
    vec3_sub(middle, m->relative->p, to);
    mat3_apply_transposed(m->relative->R, to, there);
    b = spring_middle_depth(m->second, c->b, cosine, there, length / 2);
    return native_ramp(a < b ? a : b, DEPTH_NONE, DEPTH_FULL);
}

/* Adds springs for what backs the layers, where a polygon is deeper than these. area: of the
 * polygon, weighted, m2. */
static void bed_add_backing(const struct facets_between *m, const struct bed *bed,
                            const struct flat *common, double area)
{
    struct bed deeper = *bed;
    struct moments whole, at;
    struct flat g;
    double side[POLYGON_MAX], rate;

    deeper.depth -= m->law->layers;
    for (int i = 0; i < common->n; i++) {
        side[i] = bed_depth(&deeper, common->x[i], common->y[i]);
    }
    flat_clip(common, side, &g);
    if (g.n < 3) {
        return;
    }
    flat_find_moments(common, false, &whole);
    flat_find_moments(&g, false, &at);
    rate = m->law->backing * area / whole.twice;
    if (at.twice > DBL_MIN) {
        bed_add_around(m, &deeper, &g, &at, rate * at.twice);
    }
}

void facets_add_springs(const struct facets_between *m, const struct facets_couple *c)
{
    const bool fine = (c->a->radius < c->b->radius ? c->a : c->b)->radius <= m->fine;
    struct flat g[2];
    const struct flat *common;
    struct bed bed;
    struct moments at;
    double depth, area, weight, middle[3];

    /* Where both facets lie on top of one another along the springs */
    if (!bed_lay(m, c, &bed, &g[0])) {
        return;
    }
    common = bed_clip(bed.on_second ? m->second : m->first, &bed, g);
    if (common->n < 3) {
        return;
    }

    /* Springs longer than fit in the overlap do not count, nor do those that run along it */
    flat_find_moments(common, fine, &at);
    depth = bed_depth(&bed, at.x, at.y);
    if (!(at.twice > DBL_MIN) || depth > m->reach) {
        return;
    }
    bed_place_on_spring(&bed, at.x, at.y, depth, 0.5, middle);
    weight = spring_weight(m, c, bed.cosine, middle, depth);
    if (weight <= 0) {
        return;
    }

    /* Springs on the area seen along them; they fade out as the normals get perpendicular */
    weight *= c->facing * native_ramp(c->facing, FACING_NONE, FACING_FULL);
    area = weight * bed.cosine * at.twice / 2;
    if (fine) {
        bed_add_three(m, &bed, &at, m->law->stiffness * area);
    } else {
        bed_add_around(m, &bed, common, &at, m->law->stiffness * area);
    }

    /* Deepest corner: what backs the layers, and the patch's depth where the springs count */
    depth = 0;
    for (int i = 0; i < common->n; i++) {
        depth = fmax(depth, bed_depth(&bed, common->x[i], common->y[i]));
    }
    if (native_law_is_backed(m->law, depth)) {
        bed_add_backing(m, &bed, common, area);
    }

    m->sum->area += area;
    for (int i = 0; i < common->n && weight >= 0.5; i++) {
        depth = bed_depth(&bed, common->x[i], common->y[i]);
        m->sum->depth = depth > m->sum->depth ? depth : m->sum->depth;
    }
}
