/* SPDX-License-Identifier: Apache-2.0 */
/* Springs at the centroids of triangles. Compiled once for each variant of the native engine's
 * kernels, as those are (contact/variant.h). */
#include "tests/physics/contact_centroids.h"

#include "base/vec3.h"
#include "contact/native/private.h"

#include <assert.h>
#include <float.h>
#include <stdbool.h>
#include <string.h>

#ifdef NATIVE_VARIANT
#define contact_centroids NATIVE_NAME(contact_centroids)
#endif

enum { FACES = 4096 }; /* most that a mesh of the tests has */

static void face_centroid(const struct solid *s, int face, double out[3])
{
    const int *v = s->face[face];

    for (int k = 0; k < 3; k++) {
        out[k] = (s->vertex[v[0]][k] + s->vertex[v[1]][k] + s->vertex[v[2]][k]) / 3;
    }
}

static double face_area(const struct solid *s, int face)
{
    const int *v = s->face[face];
    double a[3], b[3], x[3];

    vec3_sub(s->vertex[v[1]], s->vertex[v[0]], a);
    vec3_sub(s->vertex[v[2]], s->vertex[v[0]], b);
    vec3_cross(a, b, x);
    return vec3_norm(x) / 2;
}

/* Adds a spring at point q of a surface that pushes the first body along d. */
static void add_spring(struct native_scratch *s, const double q[3], const double d[3], double share,
                       double pressure, double depth, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum)
{
    double p[3];

    native_law_make_room(&s->batch, 1, law, relative, sum);
    vec3_add_scaled(q, share * depth, d, p);
    batch_add_spring(&s->batch, p, d, pressure, depth);
    sum->depth = depth > sum->depth ? depth : sum->depth;
}

static void centroids_on_half_space(const struct solid *solid, const struct native_law *law,
                                    const struct native_relative *relative,
                                    struct native_scratch *scratch, struct native_sum *sum)
{
    const double n[3] = {relative->R[2], relative->R[5], relative->R[8]};
    const double height = vec3_dot(n, relative->p);

    for (int f = 0; f < (int)solid->nface; f++) {
        double q[3], depth;

        face_centroid(solid, f, q);
        depth = height - vec3_dot(n, q);
        if (depth > 0) {
            add_spring(scratch, q, n, law->share[0], law->stiffness * face_area(solid, f), depth,
                       law, relative, sum);
            sum->area += face_area(solid, f);
        }
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}

static void centroids_and_sphere(const struct solid *solid, double radius,
                                 const struct native_law *law,
                                 const struct native_relative *relative,
                                 struct native_scratch *scratch, struct native_sum *sum)
{
    struct box box;
    size_t n;

    for (int k = 0; k < 3; k++) {
        box.low[k] = relative->p[k] - radius;
        box.high[k] = relative->p[k] + radius;
    }
    n = tree_collect(&solid->faces, &box, scratch->list[0], solid->nface);
    for (size_t i = 0; i < n; i++) {
        int f = scratch->list[0][i];
        double q[3], d[3], apart;

        face_centroid(solid, f, q);
        vec3_sub(q, relative->p, d);
        apart = vec3_norm(d);
        if (apart < radius && apart > 0) {
            for (int k = 0; k < 3; k++) {
                d[k] /= apart;
            }
            add_spring(scratch, q, d, law->share[0], law->stiffness * face_area(solid, f),
                       radius - apart, law, relative, sum);
            sum->area += face_area(solid, f);
        }
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}

/* ---- two meshes: which triangles overlap ---- */

struct triangle {
    double v[3][3];
};

/* Six times the volume of a tetrahedron. */
static double tetrahedron_volume(const double a[3], const double b[3], const double c[3],
                                 const double d[3])
{
    double ab[3], ac[3], ad[3], x[3];

    vec3_sub(b, a, ab);
    vec3_sub(c, a, ac);
    vec3_sub(d, a, ad);
    vec3_cross(ab, ac, x);
    return vec3_dot(x, ad);
}

/* Whether a triangle's edge passes through another triangle. */
static bool edge_pierces(const double a[3], const double b[3], const struct triangle *t)
{
    double above = tetrahedron_volume(t->v[0], t->v[1], t->v[2], a),
           below = tetrahedron_volume(t->v[0], t->v[1], t->v[2], b);
    double side[3];

    if ((above > 0) == (below > 0)) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        side[i] = tetrahedron_volume(a, b, t->v[i], t->v[(i + 1) % 3]);
    }
    return (side[0] >= 0 && side[1] >= 0 && side[2] >= 0) ||
           (side[0] <= 0 && side[1] <= 0 && side[2] <= 0);
}

static bool triangles_cross(const struct triangle *s, const struct triangle *t)
{
    for (int i = 0; i < 3; i++) {
        if (edge_pierces(s->v[i], s->v[(i + 1) % 3], t) ||
            edge_pierces(t->v[i], t->v[(i + 1) % 3], s)) {
            return true;
        }
    }
    return false;
}

/* Marks the triangles of both meshes that cut one of the other; false when there are none. */
static bool mark_crossing(const struct solid *first, const struct solid *second,
                          const struct native_relative *relative, struct native_scratch *s,
                          unsigned char mark[2][FACES])
{
    bool any = false;

    memset(mark[0], 0, first->nface);
    memset(mark[1], 0, second->nface);
    for (size_t g = 0; g < second->nface; g++) {
        struct triangle t, u;
        struct box box;
        size_t n;

        for (int i = 0; i < 3; i++) {
            mat3_apply(relative->R, second->vertex[second->face[g][i]], t.v[i]);
            vec3_add_scaled(t.v[i], 1, relative->p, t.v[i]);
            if (i == 0) {
                memcpy(box.low, t.v[0], sizeof box.low);
                memcpy(box.high, t.v[0], sizeof box.high);
            }
            box_add(&box, t.v[i]);
        }
        n = tree_collect(&first->faces, &box, s->list[0], first->nface);
        for (size_t i = 0; i < n; i++) {
            int f = s->list[0][i];

            for (int k = 0; k < 3; k++) {
                memcpy(u.v[k], first->vertex[first->face[f][k]], sizeof u.v[k]);
            }
            if (triangles_cross(&u, &t)) {
                mark[0][f] = mark[1][g] = 1;
                any = true;
            }
        }
    }
    return any;
}

/* Marks the triangles that are all inside the other mesh too; returns the area of all marked. R, p:
 * frame of the mesh in the other's. */
static double mark_buried(const struct solid *mesh, const struct solid *other, const double R[9],
                          const double p[3], unsigned char *mark)
{
    double area = 0;

    for (int f = 0; f < (int)mesh->nface; f++) {
        double q[3], there[3];

        if (!mark[f]) {
            face_centroid(mesh, f, q);
            mat3_apply(R, q, there);
            vec3_add_scaled(there, 1, p, there);
            mark[f] = box_distance2(&other->box, there) == 0 &&
                      solid_depth(other, there, sqrt(DBL_MAX) / 2) > 0;
        }
        if (mark[f]) {
            area += face_area(mesh, f);
        }
    }
    return area;
}

static void centroids_of_meshes(const struct solid *first, const struct solid *second,
                                const struct native_law *law,
                                const struct native_relative *relative,
                                struct native_scratch *scratch, struct native_sum *sum)
{
    static unsigned char mark[2][FACES]; /* the triangles that overlap */
    const struct solid *solid[2] = {first, second};
    double R[2][9], p[2][3], area[2]; /* of each mesh's frame in the other's */

    assert(first->nface <= FACES && second->nface <= FACES);
    if (!mark_crossing(first, second, relative, scratch, mark)) {
        return;
    }
    memcpy(R[1], relative->R, sizeof R[1]);
    memcpy(p[1], relative->p, sizeof p[1]);
    for (int i = 0; i < 9; i++) {
        R[0][i] = relative->R[i % 3 * 3 + i / 3];
    }
    mat3_apply(R[0], p[1], p[0]);
    for (int k = 0; k < 3; k++) {
        p[0][k] = -p[0][k];
    }
    for (int m = 0; m < 2; m++) {
        area[m] = mark_buried(solid[m], solid[!m], R[m], p[m], mark[m]);
    }
    for (int m = 0; m < 2; m++) {
        double scale = (area[0] + area[1]) / 4 / area[m];

        for (int f = 0; f < (int)solid[m]->nface; f++) {
            struct solid_nearest nearest;
            double q[3], there[3], d[3], depth, turned[3];

            if (!mark[m][f]) {
                continue;
            }
            face_centroid(solid[m], f, q);
            mat3_apply(R[m], q, there);
            vec3_add_scaled(there, 1, p[m], there);
            if (!solid_find_nearest(solid[!m], there, DBL_MAX / 4, &nearest) || !nearest.inside ||
                nearest.distance2 == 0) {
                continue;
            }
            depth = sqrt(nearest.distance2);
            for (int k = 0; k < 3; k++) {
                d[k] = (nearest.point[k] - there[k]) / depth;
            }
            if (m == 0) {
                /* The spring's direction is in the second's frame, its place in the first's */
                mat3_apply(R[1], d, turned);
            } else {
                /* The other way round, and what pushes the second pulls at the first */
                for (int k = 0; k < 3; k++) {
                    turned[k] = -d[k];
                    q[k] = there[k];
                }
            }
            add_spring(scratch, q, turned, m == 0 ? law->share[0] : -law->share[1],
                       law->stiffness * scale * face_area(solid[m], f), depth, law, relative, sum);
            sum->area += scale * face_area(solid[m], f);
        }
    }
    native_law_sum(&scratch->batch, law, relative, sum);
}

const struct native_kernels contact_centroids = {
    .ops = &native_ops,
    .name = "centroids",
    .half_space = centroids_on_half_space,
    .sphere = centroids_and_sphere,
    .meshes = centroids_of_meshes,
    .hertz = native_hertz,
    .capsule_half_space = native_capsule_half_space,
    .capsules = native_capsules,
    .sum = native_law_sum,
    .find_near = broad_phase_find,
};
