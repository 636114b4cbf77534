/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Meshes made ready for contact: facets, distances, inside and outside, against brute force and the
 * solid angle.
 */
#include "contact/mesh/solid_store.h"

#include "base/vec3.h"

#include <float.h>

#include "tests/unit/arena_fixture.h"
#include "tests/unit/contact/random_number.h"
#include "tests/physics/near.h"

static struct solid make(const struct mesh *mesh)
{
    struct error error = {0};
    struct solid solid;

    assert_no_error(solid_make(mesh, &arena, &solid, &error), error.text);
    return solid;
}

static const struct mesh *box(double x, double y, double z, int cells)
{
    const double half[3] = {x, y, z};
    const struct mesh *mesh;

    assert_ok(mesh_box(half, cells, &arena, &mesh, NULL));
    return mesh;
}

static const struct mesh *foot(void)
{
    const struct mesh *mesh;

    assert_ok(solid_store_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena,
                                   &mesh, NULL));
    return mesh;
}

/* A bowl: a box whose top has been pressed in far below the middle. */
static const struct mesh *bowl(void)
{
    const struct mesh *flat = box(0.1, 0.1, 0.05, 12);
    struct mesh *mesh = arena_alloc(&arena, 1, sizeof *mesh);
    double(*vertex)[3] = arena_alloc(&arena, flat->nvertex, sizeof *vertex);
    struct mesh_finding finding;

    assert_true(mesh && vertex);
    for (size_t v = 0; v < flat->nvertex; v++) {
        double r;

        memcpy(vertex[v], flat->vertex[v], sizeof vertex[v]);
        r = hypot(vertex[v][0], vertex[v][1]);
        if (vertex[v][2] > 0.049 && r < 0.09) {
            vertex[v][2] = -0.04 + 0.09 * (r / 0.09) * (r / 0.09);
        }
    }
    *mesh = *flat;
    mesh->vertex = (const double(*)[3])vertex;
    assert_ok(mesh_check(mesh, &finding, NULL));
    assert_int_equal(finding.fault, MESH_SOUND);
    return mesh;
}

/* How often the surface goes around p: the sum of the solid angles of its triangles over 4 pi (Van
 * Oosterom, Strackee 1983). */
static double winding(const struct mesh *mesh, const double p[3])
{
    double sum = 0;

    for (size_t f = 0; f < mesh->nface; f++) {
        double r[3][3], l[3], x[3];

        for (int i = 0; i < 3; i++) {
            vec3_sub(mesh->vertex[mesh->face[f][i]], p, r[i]);
            l[i] = vec3_norm(r[i]);
        }
        vec3_cross(r[1], r[2], x);
        sum += 2 * atan2(vec3_dot(r[0], x), l[0] * l[1] * l[2] + vec3_dot(r[0], r[1]) * l[2] +
                                                vec3_dot(r[1], r[2]) * l[0] +
                                                vec3_dot(r[2], r[0]) * l[1]);
    }
    return sum / (4 * 3.14159265358979323846);
}

/* The distance to a triangle by sampling nothing: the plane, the edges, the corners. */
static double triangle_distance(const double v[3][3], const double p[3])
{
    double best = DBL_MAX, e[3][3], n[3], to[3], inside = 1, height;

    for (int i = 0; i < 3; i++) {
        vec3_sub(v[(i + 1) % 3], v[i], e[i]);
    }
    vec3_cross(e[0], e[1], n);
    for (int i = 0; i < 3; i++) {
        double t, near[3], out[3];

        vec3_sub(p, v[i], to);
        t = vec3_dot(to, e[i]) / vec3_dot(e[i], e[i]);
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        vec3_add_scaled(v[i], t, e[i], near);
        vec3_sub(p, near, near);
        best = fmin(best, vec3_norm(near));
        vec3_cross(e[i], n, out);
        inside = vec3_dot(to, out) > 0 ? 0 : inside;
    }
    height = fabs(vec3_dot(to, n)) / vec3_norm(n);
    return inside > 0 ? fmin(best, height) : best;
}

static double brute_distance(const struct mesh *mesh, const double p[3])
{
    double best = DBL_MAX;

    for (size_t f = 0; f < mesh->nface; f++) {
        double v[3][3];

        for (int i = 0; i < 3; i++) {
            memcpy(v[i], mesh->vertex[mesh->face[f][i]], sizeof v[i]);
        }
        best = fmin(best, triangle_distance((const double(*)[3])v, p));
    }
    return best;
}

TEST(a_box_has_six_facets_however_it_is_cut)
{
    for (int cells = 1; cells <= 16; cells *= 2) {
        struct solid solid = make(box(0.1, 0.2, 0.3, cells));
        double area = 0;

        assert_int_equal(solid.nfacet, 6);
        assert_true(solid.convex);
        for (size_t i = 0; i < 6; i++) {
            const struct facet *f = &solid.facet[i];
            double weight = 0, moment[3] = {0};

            assert_int_equal(f->count, 4);
            area += f->area;
            for (int p = f->point; p < f->point + f->npoint; p++) {
                weight += solid.weight[p];
                for (int k = 0; k < 3; k++) {
                    moment[k] += solid.weight[p] * solid.point[k][p];
                }
            }
            assert_near(weight, f->area, 1e-15);
            for (int k = 0; k < 3; k++) {
                assert_near(moment[k], f->area * f->center[k], 1e-15);
            }
        }
        assert_near(area, 2 * 4 * (0.02 + 0.06 + 0.03), 1e-14);
    }
}

TEST(the_sole_of_the_foot_is_one_facet)
{
    struct solid solid = make(foot());
    size_t soles = 0;

    for (size_t i = 0; i < solid.nfacet; i++) {
        const struct facet *f = &solid.facet[i];

        if (f->normal[2] < -0.99) {
            soles++;
            assert_near(f->area, 0.015662135, 1e-7);
        }
    }
    assert_int_equal(soles, 1);
}

TEST(facets_have_the_volume_of_the_mesh)
{
    const struct mesh *mesh[] = {box(0.1, 0.2, 0.3, 5), foot(), bowl()};

    for (int m = 0; m < 3; m++) {
        struct solid solid = make(mesh[m]);
        double volume = 0;

        for (size_t i = 0; i < solid.nfacet; i++) {
            volume += solid.facet[i].area * solid.facet[i].offset / 3;
        }
        assert_near(volume, mesh_volume(mesh[m]), 1e-12);
        assert_true(solid.convex == (m < 2));
    }
}

TEST(depth_has_the_distance_of_brute_force_and_the_sign_of_the_solid_angle)
{
    const struct mesh *mesh = bowl();
    struct solid solid = make(mesh);
    uint64_t seed = 11;
    int inside = 0, in_the_bowl = 0;

    for (int i = 0; i < 4000; i++) {
        double p[3] = {0.11 * random_number(&seed), 0.11 * random_number(&seed),
                       0.06 * random_number(&seed)};
        double depth = solid_depth(&solid, p, 10);
        bool in = winding(mesh, p) > 0.5;

        assert_near(fabs(depth), brute_distance(mesh, p), 1e-12);
        assert_true((depth > 0) == in);
        inside += in;
        in_the_bowl += !in && fabs(p[0]) < 0.05 && fabs(p[1]) < 0.05 && fabs(p[2]) < 0.03;
    }
    assert_true(inside > 500 && in_the_bowl > 200);
}

TEST(depth_in_a_convex_solid_is_the_distance)
{
    const struct mesh *mesh = box(0.1, 0.05, 0.07, 3);
    struct solid solid = make(mesh);
    uint64_t seed = 5;

    for (int i = 0; i < 2000; i++) {
        double p[3] = {0.12 * random_number(&seed), 0.07 * random_number(&seed),
                       0.09 * random_number(&seed)};
        double depth = solid_depth(&solid, p, 10);

        assert_true((depth > 0) == (winding(mesh, p) > 0.5));
        if (depth > 0) {
            assert_near(depth, brute_distance(mesh, p), 1e-15);
        }
    }
}

TEST(nearest_keeps_to_its_limit)
{
    struct solid solid = make(bowl());
    const double p[3] = {0, 0, 0.03};
    struct solid_nearest nearest;

    assert_true(solid_find_nearest(&solid, p, 1, &nearest));

    double d2 = nearest.distance2;

    assert_true(solid_find_nearest(&solid, p, d2 * 1.001, &nearest));
    assert_near(nearest.distance2, d2, 0);
    assert_false(solid_find_nearest(&solid, p, d2 * 0.999, &nearest));
}

TEST(boxes_and_capsules_are_found_convex)
{
    const double half[3] = {0.1, 0.2, 0.3};
    const struct mesh *mesh[2];

    assert_ok(mesh_box(half, 4, &arena, &mesh[0], NULL));
    assert_ok(mesh_capsule(0.05, 0.2, false, &arena, &mesh[1], NULL));
    assert_true(make(mesh[0]).convex && make(mesh[1]).convex);
}

TEST_GROUP(open_arena, close_arena)
