/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The closed forms of a facet below a plane against the springs of contact.h, integrated by a rule
 * that is exact for what they are: seven points in each triangle, of the fifth degree (Radon 1948).
 */
#include "contact/native/facet_below_plane.h"

#include "base/vec3.h"
#include "contact/native/friction_sums.h"
#include "tests/physics/near.h"
#include "tests/unit/contact/random_number.h"
#include "tests/test.h"

enum { CORNERS = 11, CASES = 200 };

#define ARENA_BYTES ((size_t)1 << 20)
#define HIGH 0.4 /* m, of the prism */

/* A prism over an irregular polygon that looks down. */
struct prism {
    double vertex[2 * CORNERS][3];
    int face[4 * CORNERS][3];
    struct mesh mesh;
    struct solid solid;
    const struct facet *sole;
};

/* What the springs of a facet add up to. */
struct springs {
    double normal, lever[3], force[3], moment[3], potential, power, elastic;
    struct moments area, stiffness, damping, pressure;
};

static void make_prism(struct prism *prism, struct arena *arena, uint64_t *seed)
{
    static const int side[2] = {0, CORNERS};
    int n = 0;

    /* Corners on an ellipse that is off the origin, at angles apart */
    for (int i = 0; i < CORNERS; i++) {
        const double angle = 2 * M_PI * (i + 0.4 * random_number(seed)) / CORNERS;

        for (int s = 0; s < 2; s++) {
            double *v = prism->vertex[side[s] + i];

            v[0] = 0.3 + 0.12 * cos(angle);
            v[1] = -0.2 + 0.05 * sin(angle);
            v[2] = s ? HIGH : 0;
        }
    }
    for (int i = 0; i < CORNERS; i++) {
        const int j = (i + 1) % CORNERS;
        const int quad[2][3] = {{i, j, CORNERS + j}, {i, CORNERS + j, CORNERS + i}};

        memcpy(prism->face[n], quad, sizeof quad);
        n += 2;
        if (i > 0 && j > 0) {
            const int ends[2][3] = {{0, j, i}, {CORNERS, CORNERS + i, CORNERS + j}};

            memcpy(prism->face[n], ends, sizeof ends);
            n += 2;
        }
    }
    prism->mesh = (struct mesh){
        .name = "prism",
        .nvertex = 2 * CORNERS,
        .nface = (size_t)n,
        .vertex = (const double(*)[3])prism->vertex,
        .face = (const int(*)[3])prism->face,
    };
    assert_ok(solid_make(&prism->mesh, arena, &prism->solid, &(struct error){0}));
    for (size_t f = 0; f < prism->solid.nfacet; f++) {
        if (prism->solid.facet[f].normal[2] < -0.5) {
            prism->sole = &prism->solid.facet[f];
        }
    }
    assert_int_equal(prism->sole->count, CORNERS);
}

static void add_moment(double w, const double p[3], struct moments *m)
{
    const double second[6] = {p[0] * p[0], p[0] * p[1], p[0] * p[2],
                              p[1] * p[1], p[1] * p[2], p[2] * p[2]};

    m->zeroth += w;
    vec3_add_scaled(m->first, w, p, m->first);
    for (int k = 0; k < 6; k++) {
        m->second[k] += w * second[k];
    }
}

/* Adds the spring under a point of the facet that stands for so much of its area, by the law of
 * contact.h. */
static void add_spring(const double x[3], double area, const double n[3], double height,
                       double pressure, const struct native_law *law,
                       const struct native_relative *relative, struct springs *sum)
{
    const double depth = height - vec3_dot(n, x), rate = pressure * area;
    double p[3], velocity[3], leaving, share, f[3], turn[3];

    vec3_add_scaled(x, law->share[0] * depth, n, p);
    vec3_cross(relative->w, p, velocity);
    vec3_add_scaled(velocity, 1, relative->v, velocity);
    leaving = vec3_dot(velocity, n);
    share = 1 - law->dissipation * leaving;
    assert_true(share > 0 && depth > 0);

    for (int k = 0; k < 3; k++) {
        f[k] = rate * depth * share * n[k];
    }
    vec3_cross(p, f, turn);
    vec3_add_scaled(sum->force, 1, f, sum->force);
    vec3_add_scaled(sum->moment, 1, turn, sum->moment);
    vec3_add_scaled(sum->lever, rate * depth * share, p, sum->lever);
    sum->normal += rate * depth * share;
    sum->elastic += rate * depth;
    sum->potential += rate * depth * depth / 2;
    sum->power += rate * depth * (1 - share) * leaving;
    add_moment(rate, p, &sum->area);
    add_moment(rate * share, p, &sum->stiffness);
    add_moment(rate * depth * law->dissipation, p, &sum->damping);
    add_moment(rate * depth * share, p, &sum->pressure);
}

/* Adds the springs under the sole, a triangle after the other. */
static void add_springs(const struct prism *prism, const double n[3], double height,
                        double pressure, const struct native_law *law,
                        const struct native_relative *relative, struct springs *sum)
{
    const double root = sqrt(15), a[2] = {(6 - root) / 21, (6 + root) / 21};
    const double weight[2] = {(155 - root) / 1200, (155 + root) / 1200};

    for (int i = 1; i + 1 < CORNERS; i++) {
        const double *v[3] = {prism->vertex[0], prism->vertex[i], prism->vertex[i + 1]};
        const double area = ((v[1][0] - v[0][0]) * (v[2][1] - v[0][1]) -
                             (v[1][1] - v[0][1]) * (v[2][0] - v[0][0])) /
                            2;

        for (int q = 0; q < 7; q++) {
            const double near = q == 6 ? 1.0 / 3 : a[q / 3], far = 1 - 2 * near;
            double x[3];

            for (int k = 0; k < 3; k++) {
                x[k] = near * (v[0][k] + v[1][k] + v[2][k]) + (far - near) * v[q % 3][k];
            }
            add_spring(x, area * (q == 6 ? 0.225 : weight[q / 3]), n, height, pressure, law,
                       relative, sum);
        }
    }
}

static void assert_same_moments(const struct moments *is, const struct moments *wanted,
                                double scale)
{
    assert_near(is->zeroth, wanted->zeroth, scale);
    for (int k = 0; k < 3; k++) {
        assert_near(is->first[k], wanted->first[k], scale);
    }
    for (int k = 0; k < 6; k++) {
        assert_near(is->second[k], wanted->second[k], scale);
    }
}

static void assert_same_sums(const struct native_sum *is, const struct springs *wanted)
{
    const double least = 1e-12 * wanted->elastic;
    const struct native_gather *gather = is->gather;
    const struct moments pressure = {is->normal,
                                     {is->lever[0], is->lever[1], is->lever[2]},
                                     {gather->second[0], gather->second[1], gather->second[2],
                                      gather->second[3], gather->second[4], gather->second[5]}};

    assert_same_moments(&pressure, &wanted->pressure, least);
    assert_same_moments(&gather->area, &wanted->area, 1e-12 * wanted->area.zeroth);
    assert_same_moments(&gather->stiffness, &wanted->stiffness, 1e-12 * wanted->area.zeroth);
    assert_same_moments(&gather->damping, &wanted->damping, least);
    for (int k = 0; k < 3; k++) {
        assert_near(is->force[k], wanted->force[k], least);
        assert_near(is->moment[k], wanted->moment[k], least);
        assert_near(gather->along[k], wanted->force[k], least);
    }
    assert_near(gather->elastic, wanted->elastic, least);
    assert_near(is->potential, wanted->potential, least);
    assert_near(is->power, wanted->power, least);
}

/* Chooses a plane that is tilted a little, and a motion. */
static void choose_case(uint64_t *seed, double n[3], struct native_relative *relative)
{
    n[0] = 0.05 * random_number(seed);
    n[1] = 0.05 * random_number(seed);
    n[2] = sqrt(1 - n[0] * n[0] - n[1] * n[1]);
    *relative = (struct native_relative){.p = {0, 0, 0}};
    for (int k = 0; k < 3; k++) {
        relative->v[k] = random_number(seed);
        relative->w[k] = 3 * random_number(seed);
    }
}

TEST(a_sunk_facet_is_what_its_springs_add_up_to)
{
    uint64_t seed = 36;

    for (int c = 0; c < CASES; c++) {
        struct native_law law = {.dissipation = 0.2, .share = {0.3, 0.7}};
        struct native_gather gather = {.elastic = 0};
        struct native_sum sum = {.gather = &gather, .one_way = true};
        struct springs wanted = {.normal = 0};
        struct native_relative relative;
        struct facet_linear depth;
        double n[3], deepest, shallowest, height = 0.1;
        struct prism prism;
        struct arena arena CLOSED_BY(arena_fini);

        assert_ok(arena_init(&arena, ARENA_BYTES, &(struct error){0}));
        make_prism(&prism, &arena, &seed);
        choose_case(&seed, n, &relative);
        depth = facet_below_plane_depth(&prism.solid, prism.sole, n, height, &deepest, &shallowest);
        assert_true(shallowest > 0);
        for (int i = 0; i < CORNERS; i++) {
            const double at = height - vec3_dot(n, prism.vertex[i]);

            assert_true(at < deepest + 1e-15 && at > shallowest - 1e-15);
        }
        assert_true(facet_below_plane_gather(&prism.solid, prism.sole, &depth, n, 1e7, &law,
                                             &relative, &sum));
        add_springs(&prism, n, height, 1e7, &law, &relative, &wanted);
        assert_same_sums(&sum, &wanted);
    }
}

TEST(a_facet_of_which_a_part_leaves_fast_is_left_to_its_springs)
{
    const struct native_law law = {.dissipation = 1, .share = {0.5, 0.5}};
    const struct native_relative relative = {.v = {0, 0, 0.95}, .w = {0, 1, 0}};
    const double n[3] = {0, 0, 1};
    struct native_gather gather = {.elastic = 0};
    struct native_sum sum = {.gather = &gather, .one_way = true};
    double deepest, shallowest;
    struct facet_linear depth;
    struct prism prism;
    struct arena arena CLOSED_BY(arena_fini);
    uint64_t seed = 7;

    assert_ok(arena_init(&arena, ARENA_BYTES, &(struct error){0}));
    make_prism(&prism, &arena, &seed);
    depth = facet_below_plane_depth(&prism.solid, prism.sole, n, 0.01, &deepest, &shallowest);

    /* It parts at 0.95 m/s less x rad/s: from 0.53 to 0.77 m/s, where 1 m/s would be too fast; and
     * 0.3 m/s faster all of it does */
    assert_true(
        facet_below_plane_gather(&prism.solid, prism.sole, &depth, n, 1e7, &law, &relative, &sum));
    sum.normal = 0;
    assert_false(facet_below_plane_gather(
        &prism.solid, prism.sole, &depth, n, 1e7, &law,
        &(struct native_relative){.v = {0, 0, 1.25}, .w = {0, 1, 0}}, &sum));
    assert_true(sum.normal == 0);
}
