/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds the facets of a solid: coplanar connected faces that tile a convex polygon form one facet;
 * each other face is a facet. Computes their quadrature points and outlines.
 */
#include "base/portable_math.h"
#include "contact/mesh/solid_private.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define COPLANAR 1e-9  /* largest sine of the angle, and relative height, within one plane */
#define FEW 16         /* a large facet with more corners is not cut finer */
#define LARGE 0.15     /* smallest radius of a large facet, relative to the solid's size */
#define MANY_POINTS 24 /* a facet with fewer points needs no moments: springs are as fast */
#define IN_LINE 1e-12  /* largest relative bulge of a corner that counts as straight */

/* ---- planes ---- */

/* Checks whether a face is in the plane of the seed face and has the same outward direction. */
static bool face_is_in_plane(const struct solid_builder *b, int seed, int face)
{
    const double *n = b->normal[seed], *base = mesh_corner(b->mesh, seed, 0);
    double across[3], to[3];

    vec3_cross(n, b->normal[face], across);
    if (vec3_dot(n, b->normal[face]) <= 0 || vec3_norm(across) > COPLANAR) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        vec3_sub(mesh_corner(b->mesh, face, i), base, to);
        if (fabs(vec3_dot(to, n)) > COPLANAR * b->size) {
            return false;
        }
    }
    return true;
}

/* Lists the connected faces in the plane of a seed in b->member. Returns their number. */
static int plane_gather_faces(struct solid_builder *b, int seed)
{
    int n = 0;

    b->member[n++] = seed;
    b->group[seed] = seed;
    for (int i = 0; i < n; i++) {
        for (int e = 0; e < 3; e++) {
            int next = b->neighbor[b->member[i]][e];

            if (b->group[next] < 0 && face_is_in_plane(b, seed, next)) {
                b->group[next] = seed;
                b->member[n++] = next;
            }
        }
    }
    return n;
}

/* Returns the distance of b from the line from a to c, m, seen against the normal: positive on the
 * right, 0 if the points are in line, negative if b is a dent. */
static double corner_bulge(const double a[3], const double b[3], const double c[3],
                           const double n[3])
{
    double ab[3], ac[3], x[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_cross(ab, ac, x);
    return vec3_dot(x, n) / (vec3_norm(ac) + DBL_MIN);
}

/* Links the rim of a plane: the edges between its n faces and other faces. Sets b->next of each
 * vertex on the rim. Returns the number of edges, or -1 if the rim touches itself. start: first
 * vertex of the rim. */
static int plane_link_rim(struct solid_builder *b, int n, int seed, int *start)
{
    const struct mesh *m = b->mesh;
    int rim = 0;

    *start = -1;
    for (int i = 0; i < n; i++) {
        for (int e = 0; e < 3; e++) {
            int face = b->member[i], from = m->face[face][e];

            /* Skips edges inside the plane. If two rim edges leave a vertex, the rim touches
             * itself */
            if (b->group[b->neighbor[face][e]] == seed) {
                continue;
            }
            if (b->next[from] >= 0) {
                return -1;
            }
            b->next[from] = m->face[face][(e + 1) % 3];
            *start = *start < 0 ? from : *start;
            rim++;
        }
    }
    return rim;
}

/* Follows a rim of `rim` edges once around. Lists the corners that are not in line in b->loop.
 * Returns their number, or 0 if the rim has several loops or too many corners. */
static int plane_walk_rim(struct solid_builder *b, int rim, int seed, int start)
{
    const double(*v)[3] = b->mesh->vertex;
    int count = 0, at = start;

    for (int i = 0; i < rim; ++i, at = b->next[at]) {
        int here = b->next[at], after = here >= 0 ? b->next[here] : -1;

        if (after < 0 || (i > 0 && at == start)) {
            return 0;
        }
        if (fabs(corner_bulge(v[at], v[here], v[after], b->normal[seed])) > IN_LINE * b->size) {
            if (count == FACET_MAX_VERTICES) {
                return 0;
            }
            b->loop[count++] = here;
        }
    }
    return at == start ? count : 0;
}

/* Finds the corners of the rim of a plane's n faces, in b->loop. Returns their number, or 0 if the
 * rim is not one loop or has too many corners. */
static int plane_find_loop(struct solid_builder *b, int n, int seed)
{
    int start, rim = plane_link_rim(b, n, seed, &start);
    int count = rim > 0 ? plane_walk_rim(b, rim, seed, start) : 0;

    /* Resets next for the following plane */
    for (int i = 0; i < n; i++) {
        for (int e = 0; e < 3; e++) {
            b->next[b->mesh->face[b->member[i]][e]] = -1;
        }
    }
    return count;
}

/* Checks whether a loop turns left at each corner and once around in total. Four corners, each
 * less than half a turn, cannot turn twice. */
static bool loop_is_convex(const struct solid_builder *b, int count, int seed)
{
    const double(*v)[3] = b->mesh->vertex;
    double turned = 0;

    for (int i = 0; i < count; i++) {
        const double *here = v[b->loop[i]], *next = v[b->loop[(i + 1) % count]];
        const double *after = v[b->loop[(i + 2) % count]];
        double come[3], go[3], x[3];

        if (corner_bulge(here, next, after, b->normal[seed]) < -CONVEX * b->size) {
            return false;
        }
        if (count <= 4) {
            continue;
        }
        vec3_sub(next, here, come);
        vec3_sub(after, next, go);
        vec3_cross(come, go, x);
        turned += portable_atan2(vec3_dot(x, b->normal[seed]), vec3_dot(come, go));
    }
    return count >= 3 && turned < 7; /* one turn (2 pi), not two */
}

/* ---- facets ---- */

/* Computes area (returned, m2) and centroid of a flat polygon as sums over a fan of triangles. */
static double ring_area(const double (*v)[3], int n, const double normal[3], double center[3])
{
    double twice = 0, sum[3] = {0, 0, 0};

    for (int i = 1; i + 1 < n; i++) {
        double a[3], b[3], x[3], part;

        vec3_sub(v[i], v[0], a);
        vec3_sub(v[i + 1], v[0], b);
        vec3_cross(a, b, x);
        part = vec3_dot(x, normal);
        twice += part;
        vec3_add_scaled(sum, part, a, sum);
        vec3_add_scaled(sum, part, b, sum);
    }
    vec3_add_scaled(v[0], 1 / (3 * twice), sum, center);
    return twice / 2;
}

/* Computes two unit vectors that make a right-handed frame with n (Duff et al. 2017). */
static void vec3_make_frame(const double n[3], double e1[3], double e2[3])
{
    double sign = n[2] >= 0 ? 1 : -1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;

    e1[0] = 1 + sign * n[0] * n[0] * a;
    e1[1] = sign * b;
    e1[2] = -sign * n[0];
    e2[0] = b;
    e2[1] = sign + n[1] * n[1] * a;
    e2[2] = -n[1];
}

/* Adds the facet of nface faces in the seed's plane whose corners are in loop. */
static void solid_add_facet(struct solid_builder *b, const int *loop, int count, int seed,
                            int nface)
{
    struct facet *f = &b->facet[b->nfacet++];
    double(*ring)[3] = b->ring + b->nring;

    /* Corners */
    f->first = (int)b->nring;
    f->count = count;
    f->nface = nface;
    memcpy(f->normal, b->normal[seed], sizeof f->normal);
    for (int i = 0; i < count; i++) {
        memcpy(ring[i], b->mesh->vertex[loop[i]], sizeof ring[i]);
        b->ring_vertex[b->nring + (size_t)i] = loop[i];
    }
    b->nring += (size_t)count;

    /* Area, centroid, and the circles about it outside and inside */
    f->area = ring_area((const double(*)[3])ring, count, f->normal, f->center);
    f->offset = vec3_dot(f->normal, f->center);
    f->inradius = b->size;
    for (int i = 0; i < count; i++) {
        double to[3], edge[3], x[3];

        vec3_sub(ring[i], f->center, to);
        vec3_sub(ring[(i + 1) % count], ring[i], edge);
        vec3_cross(to, edge, x);
        f->radius = fmax(f->radius, vec3_norm(to));
        f->inradius = fmin(f->inradius, vec3_dot(x, f->normal) / vec3_norm(edge));
    }
    f->parts = count < FEW && f->radius > LARGE * b->size ? 2 : 1;
    f->npoint = count > 3 ? count * FACET_POINTS * f->parts * f->parts : 0;
    vec3_make_frame(f->normal, f->axis[0], f->axis[1]);
}

enum error_code solid_make_facets(struct solid_builder *b, struct solid *s)
{
    const struct mesh *m = b->mesh;

    b->facet = solid_alloc(b, m->nface, sizeof *b->facet);
    b->ring = solid_alloc(b, 3 * m->nface, sizeof *b->ring);
    if (!b->facet || !b->ring) {
        return ERROR_MEMORY;
    }
    for (size_t f = 0; f < m->nface; f++) {
        b->group[f] = -1;
    }
    for (size_t v = 0; v < m->nvertex; v++) {
        b->next[v] = -1;
    }

    for (int f = 0; f < (int)m->nface; f++) {
        if (b->group[f] >= 0) {
            continue;
        }

        /* All faces of the plane are one facet if they form a convex polygon */
        int n = plane_gather_faces(b, f), count = plane_find_loop(b, n, f);

        if (count >= 3 && loop_is_convex(b, count, f)) {
            solid_add_facet(b, b->loop, count, f, n);
            continue;
        }

        /* Otherwise each face is a facet */
        for (int i = 0; i < n; i++) {
            solid_add_facet(b, m->face[b->member[i]], 3, b->member[i], 1);
        }
    }
    s->facet = b->facet;
    s->nfacet = b->nfacet;
    s->ring = (const double(*)[3])b->ring;
    return ERROR_NONE;
}

/* ---- points and outlines of facets with more than three corners ---- */

/* Writes the quadrature points in the triangle between a facet's centroid and its edge e, from
 * index `at` on; returns the index after them. */
static size_t facet_make_points(const struct solid *s, const struct facet *f, int e,
                                double *const point[3], double *weight, size_t at)
{
    const double *v[3] = {f->center, s->ring[f->first + e], s->ring[f->first + (e + 1) % f->count]};
    const int parts = f->parts;
    double to[3], next[3], x[3];

    vec3_sub(v[1], v[0], to);
    vec3_sub(v[2], v[0], next);
    vec3_cross(to, next, x);
    for (int row = 0; row < parts; row++) {
        for (int i = 0; i < FACET_POINTS * (2 * (parts - row) - 1); ++i, ++at) {
            double a, b;

            triangle_find_point(1.0 / parts, row, i / FACET_POINTS, i % FACET_POINTS, &a, &b);
            weight[at] = vec3_dot(x, f->normal) / (2 * FACET_POINTS * parts * parts);
            for (int k = 0; k < 3; k++) {
                point[k][at] = v[0][k] + a * to[k] + b * next[k];
            }
        }
    }
    return at;
}

enum error_code solid_make_points(struct solid_builder *b, struct solid *s)
{
    double *point[3], *weight;
    size_t n = 0;

    /* Counts the points and sets each facet's first one */
    for (size_t i = 0; i < s->nfacet; i++) {
        b->facet[i].point = (int)n;
        n += (size_t)b->facet[i].npoint;
    }
    s->npoint = n;
    s->weight = weight = solid_alloc(b, n + 1, sizeof *weight);
    for (int k = 0; k < 3; k++) {
        s->point[k] = point[k] = solid_alloc(b, n + 1, sizeof **point);
        if (!point[k] || !weight) {
            return ERROR_MEMORY;
        }
    }

    /* Three points per part of each triangle integrate squares exactly */
    for (size_t i = 0; i < s->nfacet; i++) {
        const struct facet *f = &s->facet[i];
        size_t at = (size_t)f->point;

        for (int e = 0; f->npoint && e < f->count; e++) {
            at = facet_make_points(s, f, e, point, weight, at);
        }
    }
    return ERROR_NONE;
}

enum error_code solid_make_outlines(struct solid_builder *b, struct solid *s)
{
    double *outline[2];
    size_t n = 0;

    /* Sets each facet's first entry */
    for (size_t i = 0; i < s->nfacet; i++) {
        struct facet *f = &b->facet[i];

        f->outline = (int)n;
        n += f->count > 3 ? FACET_OUTLINE((size_t)f->count) : 0;
    }

    /* Corners along the axes of the facet's plane, padded with the first corner */
    for (int axis = 0; axis < 2; axis++) {
        s->outline[axis] = outline[axis] = solid_alloc(b, n + 1, sizeof **outline);
        if (!outline[axis]) {
            return ERROR_MEMORY;
        }
        for (size_t i = 0; i < s->nfacet; i++) {
            const struct facet *f = &s->facet[i];

            for (int e = 0; f->count > 3 && e < FACET_OUTLINE(f->count); e++) {
                double to[3];

                vec3_sub(s->ring[f->first + (e < f->count ? e : 0)], f->center, to);
                outline[axis][f->outline + e] = vec3_dot(f->axis[axis], to);
            }
        }
    }
    return ERROR_NONE;
}

/* Computes the moments of a polygon about the origin; corners counterclockwise, with the first
 * repeated at the end. It sums over the triangles between the origin and each edge. The integral of
 * a product of n coordinates over a triangle is its integral along the edge divided by n + 2. Three
 * Gauss points are exact for it up to the fifth degree. */
static void polygon_find_moments(const double *x, const double *y, int count,
                                 struct facet_moments *moments)
{
    static const double way[3] = {0.11270166537925831, 0.5, 0.88729833462074169};
    static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    static const int degree[FACET_POWERS] = {0, 1, 1, 2, 2, 2};

    for (int e = 0; e < count; e++) {
        const double twice = x[e] * y[e + 1] - x[e + 1] * y[e];

        for (int g = 0; g < 3; g++) {
            const double px = x[e] + way[g] * (x[e + 1] - x[e]);
            const double py = y[e] + way[g] * (y[e + 1] - y[e]);
            const double power[FACET_POWERS] = {1, px, py, px * px, px * py, py * py};

            for (int i = 0; i < FACET_POWERS; i++) {
                for (int k = 0; k < FACET_POWERS; k++) {
                    moments->of[i][k] +=
                        twice * weight[g] * power[i] * power[k] / (2 + degree[i] + degree[k]);
                }
            }
        }
    }
}

enum error_code solid_make_moments(struct solid_builder *b, struct solid *s)
{
    struct facet_moments *moments;
    size_t n = 0;

    for (size_t i = 0; i < s->nfacet; i++) {
        b->facet[i].moments = b->facet[i].npoint >= MANY_POINTS ? (int)n++ : -1;
    }
    s->moments = moments = solid_alloc(b, n + 1, sizeof *moments);
    if (!moments) {
        return ERROR_MEMORY;
    }
    for (size_t i = 0; i < s->nfacet; i++) {
        const struct facet *f = &s->facet[i];

        if (f->moments >= 0) {
            polygon_find_moments(s->outline[0] + f->outline, s->outline[1] + f->outline, f->count,
                                 &moments[f->moments]);
        }
    }
    return ERROR_NONE;
}
