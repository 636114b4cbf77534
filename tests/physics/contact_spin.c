/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A disc of uniform pressure that slides and spins at once on the native engine, by either law of
 * friction, against the closed form of Coulomb's friction (Contensou), from pure spin on.
 */
#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define H 1e-3 /* of prescribed motions, s */
#define RADIUS 0.05
#define MU 0.5

enum { CORNERS = 96, STEPS = 100 };

static const double pi = 3.14159265358979323846;

/* Complete elliptic integrals of the modulus k < 1, by the arithmetic-geometric mean (Abramowitz,
 * Stegun 17.6). */
static void find_elliptic(double k, double *first, double *second)
{
    double a = 1, b = sqrt(1 - k * k), c = k, sum = c * c / 2;

    for (double power = 1; fabs(c) > 1e-12; power *= 2) {
        double mean = (a + b) / 2;

        c = (a - b) / 2;
        b = sqrt(a * b);
        a = mean;
        sum += power * c * c;
    }
    *first = pi / (2 * a);
    *second = *first * (1 - sum);
}

/* What brakes the disc, over mu N and mu N R, when it slides at e times the speed of its rim. */
static void find_brake(double e, double *force, double *moment)
{
    double K, E;

    find_elliptic(e, &K, &E);
    *force = e > 0 ? 4 / (3 * pi * e) * ((1 + e * e) * E - (1 - e * e) * K) : 0;
    *moment = 4 / (9 * pi) * ((4 - 2 * e * e) * E - (1 - e * e) * K);
}

/* A prism of that many corners. */
static const struct mesh *disc_mesh(void)
{
    static double vertex[2 * CORNERS + 2][3] = {[2 * CORNERS] = {0, 0, -0.02},
                                                [2 * CORNERS + 1] = {0, 0, 0.02}};
    static int face[4 * CORNERS][3];
    static const struct mesh mesh = {.name = "disc",
                                     .nvertex = 2 * CORNERS + 2,
                                     .nface = 4 * CORNERS,
                                     .vertex = (const double(*)[3])vertex,
                                     .face = (const int(*)[3])face};

    for (int i = 0; i < CORNERS; i++) {
        const int next = (i + 1) % CORNERS;
        const int sides[4][3] = {{i, next, CORNERS + next},
                                 {i, CORNERS + next, CORNERS + i},
                                 {next, i, 2 * CORNERS},
                                 {CORNERS + i, CORNERS + next, 2 * CORNERS + 1}};

        for (int z = 0; z < 2; z++) {
            vertex[z * CORNERS + i][0] = RADIUS * cos(2 * pi * i / CORNERS);
            vertex[z * CORNERS + i][1] = RADIUS * sin(2 * pi * i / CORNERS);
            vertex[z * CORNERS + i][2] = z ? 0.02 : -0.02;
        }
        memcpy(face[4 * i], sides, sizeof sides);
    }
    return &mesh;
}

static struct contact_world *make_world(enum contact_friction friction)
{
    const struct contact_material rough = {1e6, 1, 0, MU, MU, 0, 0};
    struct contact_world *world;
    struct scene scene;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &rough);
    scene_add(&scene, 0, CONTACT_MESH, &rough)->mesh = disc_mesh();
    scene_add_pair(&scene, 0, 1);
    scene.config.transition_velocity_m_s = 1e-7;
    scene.config.friction = friction;
    assert_ok(contact_native_create(&scene.config, &arena, &world, NULL));
    return world;
}

/* The wrench while the disc slides and spins, once its bristles, if any, have followed. */
static void brake_disc(struct contact_world *world, double e, struct contact_wrench *wrench)
{
    double y[CONTACT_BRISTLE] = {0}, rate[CONTACT_BRISTLE] = {0};
    struct body_motion motion;
    int pair[1];

    scene_place(&motion, 0.001, 0.002, 0.0199);
    motion.w[2] = 1;
    motion.v[0] = e * RADIUS;
    for (int step = 0; step < (world->nbristle > 0 ? STEPS : 1); step++) {
        struct contact_bristles bristles = {y, H, rate, pair, 0};

        pair[0] = 0;
        bristles.npair = 1;
        assert_ok(
            world->ops->evaluate(world, &motion, world->nbristle > 0 ? &bristles : NULL, wrench));
        for (int k = 0; k < CONTACT_BRISTLE; k++) {
            y[k] += H * rate[k];
        }
    }
}

TEST(a_disc_that_slides_and_spins_is_braked_as_contensou_says)
{
    const double slide[] = {0, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 0.95};
    const char *const name[] = {"regularized", "sticking"};
    const double wedge = 2 * pi / CORNERS, radius = RADIUS * sqrt(sin(wedge) / wedge);

    for (int law = 0; law < 2; law++) {
        struct contact_world *world =
            make_world(law ? CONTACT_FRICTION_STICKING : CONTACT_FRICTION_REGULARIZED);

        for (size_t i = 0; i < sizeof slide / sizeof slide[0]; i++) {
            struct contact_wrench wrench;
            double force, moment, most;

            brake_disc(world, slide[i], &wrench);
            find_brake(slide[i] * RADIUS / radius, &force, &moment);
            most = MU * wrench.force[2];
            print_message(
                "# %s, %g of the rim: force off by %+.5f, moment by %+.5f, across %+.5f\n",
                name[law], slide[i], -wrench.force[0] / most - force,
                -wrench.moment[2] / (most * radius) - moment, wrench.force[1] / most);
            assert_near(-wrench.force[0] / most, force, 5e-3);
            assert_near(-wrench.moment[2] / (most * radius), moment, 5e-3);
            assert_near(wrench.force[1] / most, 0, 1e-4);
            /* Slow sliding meets e of it, not all */
            assert_near(-wrench.force[0] / most, force, 0.06 * force + 1e-9);
        }
    }
}

TEST_GROUP(set_up, tear_down)
