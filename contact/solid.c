/* SPDX-License-Identifier: Apache-2.0 */
/* Making a mesh ready for contact. */
#include "contact/solid.h"

#include "base/vec3.h"

#include <float.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define COPLANAR 1e-9     /* sine of the angle, and height over the size, of one plane */
#define CONVEX 1e-5       /* height over the size by which a corner may dent its neighborhood */
#define CONVEX_FACETS 256 /* solids with more are not tried for convexity */

/* What only the making of a solid needs. */
struct work {
    const struct mesh *mesh;
    struct arena *arena;
    struct error *error;
    double size; /* diagonal of the box */
    double (*normal)[3];
    int (*neighbor)[3];
    int *group;  /* facet-to-be of each face, or -1 */
    int *member; /* faces of the group that is being made */
    int *next;   /* of each vertex on the group's rim */
    int loop[FACET_MAX_VERTICES];
    struct facet *facet;
    double (*ring)[3];
    int *ring_vertex; /* of each corner in ring */
    size_t nfacet, nring;
};

/* A directed edge of a face, to be paired with its twin. */
struct edge {
    int low, high, half;
};

static void *take(struct work *w, size_t count, size_t size)
{
    void *memory = arena_alloc(w->arena, count, size);

    if (!memory) {
        error_set(w->error, ERROR_MEMORY, "contact: no memory for the %zu faces of '%s'",
                  w->mesh->nface, w->mesh->name);
    }
    return memory;
}

static const double *corner(const struct mesh *mesh, int face, int i)
{
    return mesh->vertex[mesh->face[face][i]];
}

/* ---- faces ---- */

static enum error_code make_faces(struct work *w, struct solid *s)
{
    const struct mesh *m = w->mesh;
    double *centroid[3], *area = take(w, m->nface, sizeof *area);
    double(*vertex_normal)[3] = take(w, m->nvertex, sizeof *vertex_normal);

    w->normal = take(w, m->nface, sizeof *w->normal);
    for (int k = 0; k < 3; ++k) {
        s->centroid[k] = centroid[k] = take(w, m->nface, sizeof **centroid);
    }
    if (!area || !vertex_normal || !w->normal || !centroid[0] || !centroid[1] || !centroid[2]) {
        return ERROR_MEMORY;
    }
    for (int f = 0; f < (int)m->nface; ++f) {
        double e[3][3], n[3], length;

        for (int i = 0; i < 3; ++i) {
            vec3_sub(corner(m, f, (i + 1) % 3), corner(m, f, i), e[i]);
        }
        vec3_cross(e[0], e[1], n);
        length = vec3_norm(n);
        area[f] = length / 2;
        for (int k = 0; k < 3; ++k) {
            w->normal[f][k] = n[k] / length;
            centroid[k][f] = (corner(m, f, 0)[k] + corner(m, f, 1)[k] + corner(m, f, 2)[k]) / 3;
        }
        for (int i = 0; i < 3; ++i) {
            double *sum = vertex_normal[m->face[f][i]], side[3];

            vec3_cross(e[(i + 2) % 3], e[i], side);
            vec3_add_scaled(sum, atan2(vec3_norm(side), -vec3_dot(e[(i + 2) % 3], e[i])),
                            w->normal[f], sum);
        }
    }
    s->area = area;
    s->normal = (const double(*)[3])w->normal;
    s->vertex_normal = (const double(*)[3])vertex_normal;
    return ERROR_NONE;
}

static int compare_edges(const void *a, const void *b)
{
    const struct edge *x = a, *y = b;

    if (x->low != y->low) {
        return x->low < y->low ? -1 : 1;
    }
    return (x->high > y->high) - (x->high < y->high);
}

static enum error_code make_neighbors(struct work *w, struct solid *s)
{
    const struct mesh *m = w->mesh;
    size_t n = 3 * m->nface;
    struct edge *edge = malloc(n * sizeof *edge);

    w->neighbor = take(w, m->nface, sizeof *w->neighbor);
    if (!w->neighbor || !edge) {
        free(edge);
        return error_set(w->error, ERROR_MEMORY, "contact: no memory for the edges of '%s'",
                         m->name);
    }
    for (size_t half = 0; half < n; ++half) {
        int from = m->face[half / 3][half % 3], to = m->face[half / 3][(half + 1) % 3];

        edge[half] = (struct edge){from < to ? from : to, from < to ? to : from, (int)half};
    }
    qsort(edge, n, sizeof *edge, compare_edges);
    /* a sound mesh: each edge twice */
    for (size_t i = 0; i + 1 < n; i += 2) {
        int x = edge[i].half, y = edge[i + 1].half;

        w->neighbor[x / 3][x % 3] = y / 3;
        w->neighbor[y / 3][y % 3] = x / 3;
    }
    free(edge);
    s->neighbor = (const int(*)[3])w->neighbor;
    return ERROR_NONE;
}

/* ---- facets ---- */

static bool in_plane(const struct work *w, int seed, int face)
{
    const double *n = w->normal[seed], *base = corner(w->mesh, seed, 0);
    double across[3], to[3];

    vec3_cross(n, w->normal[face], across);
    if (vec3_dot(n, w->normal[face]) <= 0 || vec3_norm(across) > COPLANAR) {
        return false;
    }
    for (int i = 0; i < 3; ++i) {
        vec3_sub(corner(w->mesh, face, i), base, to);
        if (fabs(vec3_dot(to, n)) > COPLANAR * w->size) {
            return false;
        }
    }
    return true;
}

/* The faces that hang together with a seed in its plane; returns their number. */
static int gather_plane(struct work *w, int seed)
{
    int n = 0;

    w->member[n++] = seed;
    w->group[seed] = seed;
    for (int i = 0; i < n; ++i) {
        for (int e = 0; e < 3; ++e) {
            int next = w->neighbor[w->member[i]][e];

            if (w->group[next] < 0 && in_plane(w, seed, next)) {
                w->group[next] = seed;
                w->member[n++] = next;
            }
        }
    }
    return n;
}

/* How far b is to the right of the way from a to c seen against the normal, in meters: 0 when
 * the three are in line, negative when b is a dent. */
static double bulge(const double a[3], const double b[3], const double c[3], const double n[3])
{
    double ab[3], ac[3], x[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_cross(ab, ac, x);
    return vec3_dot(x, n) / (vec3_norm(ac) + DBL_MIN);
}

/* Follows the rim of n faces once around, leaving out corners in line. Returns the number of
 * corners, or 0 when the rim is not one loop or has too many of them. */
static int walk_rim(struct work *w, int n, int seed)
{
    const struct mesh *m = w->mesh;
    int rim = 0, start = -1, count = 0, at;

    for (int i = 0; i < n; ++i) {
        for (int e = 0; e < 3; ++e) {
            int face = w->member[i], from = m->face[face][e];

            if (w->group[w->neighbor[face][e]] != seed) {
                if (w->next[from] >= 0) {
                    rim = -1; /* the rim touches itself */
                    break;
                }
                w->next[from] = m->face[face][(e + 1) % 3];
                start = start < 0 ? from : start;
                rim++;
            }
        }
        if (rim < 0) {
            break;
        }
    }
    at = start;
    for (int i = 0; i < rim; ++i, at = w->next[at]) {
        int b = w->next[at], c = b >= 0 ? w->next[b] : -1;

        if (c < 0 || (i > 0 && at == start)) {
            count = 0; /* more than one loop */
            break;
        }
        if (fabs(bulge(m->vertex[at], m->vertex[b], m->vertex[c], w->normal[seed])) >
            1e-12 * w->size) {
            if (count == FACET_MAX_VERTICES) {
                count = 0;
                break;
            }
            w->loop[count++] = b;
        }
    }
    for (int i = 0; i < n; ++i) {
        for (int e = 0; e < 3; ++e) {
            w->next[m->face[w->member[i]][e]] = -1;
        }
    }
    return at == start && rim > 0 ? count : 0;
}

/* Turns left at each corner, and once around in all. */
static bool loop_is_convex(const struct work *w, int count, int seed)
{
    const double(*v)[3] = w->mesh->vertex;
    double turned = 0;

    for (int i = 0; i < count; ++i) {
        const double *a = v[w->loop[i]], *b = v[w->loop[(i + 1) % count]];
        const double *c = v[w->loop[(i + 2) % count]];
        double ab[3], bc[3], x[3];

        if (bulge(a, b, c, w->normal[seed]) < -CONVEX * w->size) {
            return false;
        }
        vec3_sub(b, a, ab);
        vec3_sub(c, b, bc);
        vec3_cross(ab, bc, x);
        turned += atan2(vec3_dot(x, w->normal[seed]), vec3_dot(ab, bc));
    }
    return count >= 3 && turned < 7; /* 2 pi, not 4 pi */
}

/* Area and centroid of a flat polygon. */
static double polygon_area(const double (*v)[3], int n, const double normal[3], double center[3])
{
    double twice = 0, sum[3] = {0, 0, 0};

    for (int i = 1; i + 1 < n; ++i) {
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

/* tiles: how many faces make it up */
static void add_facet(struct work *w, const int *loop, int count, int seed, int tiles)
{
    struct facet *f = &w->facet[w->nfacet++];
    double(*ring)[3] = w->ring + w->nring;

    f->first = (int)w->nring;
    f->count = count;
    f->tiles = tiles;
    memcpy(f->normal, w->normal[seed], sizeof f->normal);
    for (int i = 0; i < count; ++i) {
        memcpy(ring[i], w->mesh->vertex[loop[i]], sizeof ring[i]);
        w->ring_vertex[w->nring + (size_t)i] = loop[i];
    }
    w->nring += (size_t)count;
    f->area = polygon_area((const double(*)[3])ring, count, f->normal, f->center);
    f->offset = vec3_dot(f->normal, f->center);
    f->within = w->size;
    for (int i = 0; i < count; ++i) {
        double to[3], edge[3], x[3];

        vec3_sub(ring[i], f->center, to);
        vec3_sub(ring[(i + 1) % count], ring[i], edge);
        vec3_cross(to, edge, x);
        f->radius = fmax(f->radius, vec3_norm(to));
        f->within = fmin(f->within, vec3_dot(x, f->normal) / vec3_norm(edge));
    }
    f->npoint = count > 3 ? count * FACET_POINTS : 0;
    frame_about(f->normal, f->across[0], f->across[1]);
}

static enum error_code make_facets(struct work *w, struct solid *s)
{
    const struct mesh *m = w->mesh;

    w->facet = take(w, m->nface, sizeof *w->facet);
    w->ring = take(w, 3 * m->nface, sizeof *w->ring);
    if (!w->facet || !w->ring) {
        return ERROR_MEMORY;
    }
    for (size_t f = 0; f < m->nface; ++f) {
        w->group[f] = -1;
    }
    for (size_t v = 0; v < m->nvertex; ++v) {
        w->next[v] = -1;
    }
    for (int f = 0; f < (int)m->nface; ++f) {
        if (w->group[f] >= 0) {
            continue;
        }
        int n = gather_plane(w, f), count = walk_rim(w, n, f);

        if (count >= 3 && loop_is_convex(w, count, f)) {
            add_facet(w, w->loop, count, f, n);
            continue;
        }
        for (int i = 0; i < n; ++i) {
            add_facet(w, m->face[w->member[i]], 3, w->member[i], 1);
        }
    }
    s->facet = w->facet;
    s->nfacet = w->nfacet;
    s->ring = (const double(*)[3])w->ring;
    return ERROR_NONE;
}

/* Points of quadrature: a facet is cut into triangles between its centroid and its edges, with
 * three points each that integrate squares exactly. Those of single triangles are quickly made when
 * they are needed, and would fill the memory of a large terrain. */
static enum error_code make_points(struct work *w, struct solid *s)
{
    double *point[3], *weight;
    size_t n = 0;

    for (size_t i = 0; i < s->nfacet; ++i) {
        w->facet[i].point = (int)n;
        n += (size_t)w->facet[i].npoint;
    }
    s->npoint = n;
    s->weight = weight = take(w, n + 1, sizeof *weight);
    for (int k = 0; k < 3; ++k) {
        s->point[k] = point[k] = take(w, n + 1, sizeof **point);
        if (!point[k] || !weight) {
            return ERROR_MEMORY;
        }
    }
    for (size_t i = 0; i < s->nfacet; ++i) {
        const struct facet *f = &s->facet[i];
        size_t at = (size_t)f->point;

        for (int e = 0; f->npoint && e < f->count; ++e) {
            const double *v[3] = {f->center, s->ring[f->first + e],
                                  s->ring[f->first + (e + 1) % f->count]};
            double a[3], b[3], x[3];

            vec3_sub(v[1], v[0], a);
            vec3_sub(v[2], v[0], b);
            vec3_cross(a, b, x);
            for (int q = 0; q < FACET_POINTS; ++q, ++at) {
                weight[at] = vec3_dot(x, f->normal) / 6;
                for (int k = 0; k < 3; ++k) {
                    point[k][at] = (v[0][k] + v[1][k] + v[2][k] + 3 * v[q][k]) / 6;
                }
            }
        }
    }
    return ERROR_NONE;
}

static enum error_code make_outlines(struct work *w, struct solid *s)
{
    double *outline[2];
    size_t n = 0;

    for (size_t i = 0; i < s->nfacet; ++i) {
        struct facet *f = &w->facet[i];

        f->outline = (int)n;
        n += f->count > 3 ? FACET_OUTLINE((size_t)f->count) : 0;
    }
    for (int side = 0; side < 2; ++side) {
        s->outline[side] = outline[side] = take(w, n + 1, sizeof **outline);
        if (!outline[side]) {
            return ERROR_MEMORY;
        }
        for (size_t i = 0; i < s->nfacet; ++i) {
            const struct facet *f = &s->facet[i];

            for (int e = 0; f->count > 3 && e < FACET_OUTLINE(f->count); ++e) {
                double to[3];

                vec3_sub(s->ring[f->first + (e < f->count ? e : 0)], f->center, to);
                outline[side][f->outline + e] = vec3_dot(f->across[side], to);
            }
        }
    }
    return ERROR_NONE;
}

static bool is_convex(const struct work *w, const struct solid *s)
{
    if (s->nfacet > CONVEX_FACETS) {
        return false;
    }
    for (size_t i = 0; i < s->nfacet; ++i) {
        const struct facet *f = &s->facet[i];

        for (size_t v = 0; v < w->mesh->nvertex; ++v) {
            if (vec3_dot(f->normal, w->mesh->vertex[v]) - f->offset > CONVEX * w->size) {
                return false;
            }
        }
    }
    return true;
}

static enum error_code make_planes(struct work *w, struct solid *s)
{
    double *plane[4];

    s->convex = is_convex(w, s);
    if (!s->convex) {
        return ERROR_NONE;
    }
    s->nplane = (s->nfacet + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES;
    for (int k = 0; k < 4; ++k) {
        s->plane[k] = plane[k] = take(w, s->nplane, sizeof **plane);
        if (!plane[k]) {
            return ERROR_MEMORY;
        }
        for (size_t i = 0; i < s->nplane; ++i) {
            const struct facet *f = &s->facet[i < s->nfacet ? i : s->nfacet - 1];

            plane[k][i] = k < 3 ? f->normal[k] : f->offset;
        }
    }
    return ERROR_NONE;
}

/* ---- trees ---- */

static enum error_code make_trees(struct work *w, struct solid *s)
{
    const struct mesh *m = w->mesh;
    struct box *box = malloc(m->nface * sizeof *box);
    enum error_code code;

    if (!box) {
        return error_set(w->error, ERROR_MEMORY, "contact: no memory for the trees of '%s'",
                         m->name);
    }
    for (int f = 0; f < (int)m->nface; ++f) {
        memcpy(box[f].low, corner(m, f, 0), sizeof box[f].low);
        memcpy(box[f].high, corner(m, f, 0), sizeof box[f].high);
        box_add(&box[f], corner(m, f, 1));
        box_add(&box[f], corner(m, f, 2));
    }
    code = tree_build(box, m->nface, 2, w->arena, &s->faces, w->error);
    for (size_t i = 0; i < s->nfacet; ++i) {
        const struct facet *f = &s->facet[i];

        memcpy(box[i].low, s->ring[f->first], sizeof box[i].low);
        memcpy(box[i].high, s->ring[f->first], sizeof box[i].high);
        for (int k = 1; k < f->count; ++k) {
            box_add(&box[i], s->ring[f->first + k]);
        }
    }
    if (!code) {
        code = tree_build(box, s->nfacet, 2, w->arena, &s->facets, w->error);
    }
    if (!code) {
        struct box *facing = take(w, s->facets.nnode, sizeof *facing);

        code = facing ? ERROR_NONE : ERROR_MEMORY;
        for (size_t i = 0; i < s->nfacet; ++i) {
            memcpy(box[i].low, s->facet[i].normal, sizeof box[i].low);
            memcpy(box[i].high, s->facet[i].normal, sizeof box[i].high);
        }
        if (facing) {
            tree_cover(&s->facets, box, facing);
        }
        s->facing = facing;
    }
    free(box);
    return code;
}

static enum error_code make_all(struct work *w, struct solid *s)
{
    enum error_code code = make_faces(w, s);
    double diagonal[3];

    s->box = (struct box){.low = {0}, .high = {0}};
    memcpy(s->box.low, w->mesh->vertex[0], sizeof s->box.low);
    memcpy(s->box.high, w->mesh->vertex[0], sizeof s->box.high);
    for (size_t v = 1; v < w->mesh->nvertex; ++v) {
        box_add(&s->box, w->mesh->vertex[v]);
    }
    vec3_sub(s->box.high, s->box.low, diagonal);
    w->size = vec3_norm(diagonal);
    s->radius = w->size / 2;
    if (!code) {
        code = make_neighbors(w, s);
    }
    if (!code) {
        code = make_facets(w, s);
    }
    if (!code) {
        code = make_points(w, s);
    }
    if (!code) {
        code = make_outlines(w, s);
    }
    if (!code) {
        code = make_planes(w, s);
    }
    if (!code) {
        code = make_trees(w, s);
    }
    if (!code) {
        solid_look_around(s, w->ring_vertex, w->facet);
    }
    return code;
}

enum error_code solid_make(const struct mesh *mesh, struct arena *arena, struct solid *solid,
                           struct error *error)
{
    struct work w = {.mesh = mesh, .arena = arena, .error = error};
    enum error_code code;

    *solid = (struct solid){
        .name = mesh->name, .nface = mesh->nface, .vertex = mesh->vertex, .face = mesh->face};
    w.group = malloc(mesh->nface * sizeof *w.group);
    w.member = malloc(mesh->nface * sizeof *w.member);
    w.next = malloc(mesh->nvertex * sizeof *w.next);
    w.ring_vertex = malloc(3 * mesh->nface * sizeof *w.ring_vertex);
    if (!w.group || !w.member || !w.next || !w.ring_vertex) {
        code = error_set(error, ERROR_MEMORY, "contact: no memory to take up '%s'", mesh->name);
    } else {
        code = make_all(&w, solid);
    }
    free(w.group);
    free(w.member);
    free(w.next);
    free(w.ring_vertex);
    return code;
}
