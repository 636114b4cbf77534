/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tangents: put together from elements they are what differences of the elements' forces say, and
 * those of an engine are what differences of its wrenches say, as far as they promise it.
 */
#include "contact/tangent.h"

#include "tests/physics/contact_scene.h"
#include "tests/physics/near.h"
#include "tests/test.h"

static struct error error;

enum { ELEMENTS = 5 };

static void full(const double S[21], double A[6][6])
{
    for (int row = 0, at = 0; row < 6; row++) {
        for (int column = row; column < 6; column++) {
            A[row][column] = A[column][row] = S[at++];
        }
    }
}

/* The wrench about the center that elements of these resistances set against a twist (linear,
 * angular): straight from the definition. */
static void resist(const struct contact_element *element, const double center[3], bool rates,
                   const double twist[6], double wrench[6])
{
    memset(wrench, 0, 6 * sizeof *wrench);
    for (int e = 0; e < ELEMENTS; e++) {
        const double *n = element[e].normal;
        double along = rates ? element[e].damping : element[e].stiffness;
        double across = rates ? element[e].friction : 0.0;
        double arm[3], u[3], normal = 0.0, f[3], moment[3];

        for (int i = 0; i < 3; i++) {
            arm[i] = element[e].point[i] - center[i];
        }
        vec3_cross(twist + 3, arm, u);
        for (int i = 0; i < 3; i++) {
            u[i] += twist[i];
            normal += u[i] * n[i];
        }
        for (int i = 0; i < 3; i++) {
            f[i] = along * normal * n[i] + across * (u[i] - normal * n[i]);
        }
        vec3_cross(arm, f, moment);
        for (int i = 0; i < 3; i++) {
            wrench[i] += f[i];
            wrench[3 + i] += moment[i];
        }
    }
}

TEST(elements_add_up_to_what_they_resist_with)
{
    struct contact_element element[ELEMENTS];
    struct contact_tangent tangent = {.center = {0.1, -0.2, 0.3}};
    uint64_t seed = 5;
    double K[6][6], D[6][6];

    for (int e = 0; e < ELEMENTS; e++) {
        double length;

        for (int i = 0; i < 3; i++) {
            element[e].point[i] = random_number(&seed);
            element[e].normal[i] = random_number(&seed);
        }
        length = vec3_norm(element[e].normal);
        for (int i = 0; i < 3; i++) {
            element[e].normal[i] /= length;
        }
        element[e].stiffness = 2.0 + random_number(&seed);
        element[e].damping = 2.0 + random_number(&seed);
        element[e].friction = 2.0 + random_number(&seed);
        contact_tangent_add(&tangent, &element[e]);
    }
    full(tangent.K, K);
    full(tangent.D, D);
    for (int k = 0; k < 6; k++) {
        double twist[6] = {0.0}, elastic[6], damped[6];

        twist[k] = 1.0;
        resist(element, tangent.center, false, twist, elastic);
        resist(element, tangent.center, true, twist, damped);
        for (int i = 0; i < 6; i++) {
            assert_near(K[i][k], elastic[i], 1e-13);
            assert_near(D[i][k], damped[i], 1e-13);
        }
    }
}

static void differ(struct contact_world *world, struct body_motion *motion, double *number,
                   double step, double change[6])
{
    struct contact_wrench plus, minus;
    double before = *number;

    *number = before + step;
    assert_ok(world->ops->evaluate(world, motion, NULL, &plus));
    *number = before - step;
    assert_ok(world->ops->evaluate(world, motion, NULL, &minus));
    *number = before;
    for (int i = 0; i < 3; i++) {
        change[i] = (plus.force[i] - minus.force[i]) / (2.0 * step);
        change[3 + i] = (plus.moment[i] - minus.moment[i]) / (2.0 * step);
    }
}

/* A box flat on a half-space that moves down, and slides slower than the transition velocity. */
TEST(simbody_says_how_a_flat_box_resists)
{
    struct scene scene;
    struct contact_world *world;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_tangent tangent;
    double change[6], K[6][6], D[6][6];

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_box(&scene, 0, 0.1, 0.06, 0.05, 6, &scene_foot);
    scene_add_pair(&scene, 0, 1);
    assert_ok(contact_simbody_create(&scene.config, &world, &error));
    scene_place(&motion, 0.0, 0.0, 0.05 - 2e-4);
    motion.v[0] = 0.5 * SCENE_TRANSITION_M_S; /* where friction is steepest */
    motion.v[2] = -0.05;
    assert_ok(world->ops->evaluate(world, &motion, NULL, &wrench));
    assert_int_equal(world->ops->tangents(world, &tangent, 1), 1);
    assert_int_equal(tangent.body_a, -1);
    assert_int_equal(tangent.body_b, 0);
    full(tangent.K, K);
    full(tangent.D, D);

    differ(world, &motion, &motion.p[2], 1e-7, change);
    assert_near(K[2][2] / -change[2], 1.0, 1e-4);
    differ(world, &motion, &motion.v[2], 1e-4, change);
    assert_near(D[2][2] / -change[2], 1.0, 1e-4);
    differ(world, &motion, &motion.v[0], 1e-5, change);
    assert_near(D[0][0] / -change[0], 1.0, 1e-2); /* with the viscous part */
    /* Pitch about the middle of the sole: the bed's second moment, as cells of 3 cm have it */
    assert_near(K[4][4] / (K[2][2] * 0.2 * 0.2 / 12.0), 1.0, 0.05);
    assert_near(K[3][3] / (K[2][2] * 0.12 * 0.12 / 12.0), 1.0, 0.05);
    world->ops->destroy(world);
}

/* A sphere on a half-space: Hertz. */
TEST(simbody_says_how_a_sphere_resists)
{
    struct scene scene;
    struct contact_world *world;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_tangent tangent;
    double change[6], K[6][6], D[6][6];

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add(&scene, 0, CONTACT_SPHERE, &scene_foot)->radius_m = 0.05;
    scene_add_pair(&scene, 0, 1);
    assert_ok(contact_simbody_create(&scene.config, &world, &error));
    scene_place(&motion, 0.0, 0.0, 0.048);
    motion.v[2] = -0.05;
    assert_ok(world->ops->evaluate(world, &motion, NULL, &wrench));
    assert_int_equal(world->ops->tangents(world, &tangent, 1), 1);
    full(tangent.K, K);
    full(tangent.D, D);
    differ(world, &motion, &motion.p[2], 1e-7, change);
    assert_near(K[2][2] / -change[2], 1.0, 1e-4);
    differ(world, &motion, &motion.v[2], 1e-4, change);
    assert_near(D[2][2] / -change[2], 1.0, 1e-4);
    world->ops->destroy(world);
}
