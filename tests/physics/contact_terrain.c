/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN's foot on the rough bump: dropped onto its facets and across their edges it comes to rest
 * on what carries it, the forces balance, and the energy only falls.
 */
#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define G 9.81
#define MASS 14.0   /* kg, half of COMAN */
#define MIDDLE 0.03 /* m above the sole: low, so that it stays on its facet */
#define SOLE 0.0932 /* m below the foot's origin */

/* The layers of the rigs but ten times as soft, for longer steps: 8.3e6 Pa/m. Friction holds on the
 * steepest facet, 15 degrees. */
static const struct contact_material ground = {1e4, 1e-3, 10, 1.1, 0.9, 0, 0};
static const struct contact_material sole = {1e4, 2e-4, 10, 1.1, 0.9, 0, 0};

static const struct mesh *read_mesh(const char *name)
{
    const struct mesh *mesh = NULL;
    struct error error = {0};
    char path[512];

    snprintf(path, sizeof path, "%s/config/meshes/%s.obj", HIL_SOURCE_DIR, name);
    assert_no_error(solid_store_read_obj(path, &arena, &mesh, &error), error.text);
    return mesh;
}

/* Over a place on the bump, just clear of it. */
static struct bodies foot_over(struct scene *scene, double x, double y, double height)
{
    struct bodies b;

    scene_init(scene, 1);
    scene_add(scene, -1, CONTACT_MESH, &ground)->mesh = read_mesh("bump-9cm");
    scene_add(scene, 0, CONTACT_MESH, &sole)->mesh = read_mesh("coman-foot-right");
    scene->surface[1].position[2] = SOLE - MIDDLE;
    scene_add_pair(scene, 0, 1);
    scene->config.friction = CONTACT_FRICTION_STICKING;
    b = make(scene, MASS);
    b.inertia[0] = 0.06; /* a block of the foot's size */
    b.gravity[2] = -G;
    scene_place(&b.motion[0], x, y, height + MIDDLE);
    return b;
}

static double energy(const struct bodies *b)
{
    return kinetic(b) + stored(b) + MASS * G * b->motion[0].p[2];
}

TEST_WITH(a_foot_on_the_bump_comes_to_rest_and_loses_energy_only, set_up, tear_down)
{
    /* At the top, on the way up, on the flank: over three to nine facets each */
    static const double place[][3] = {
        {0.83, 0.03, 0.096}, {0.33, -0.02, 0.062}, {0.8, 0.45, 0.072}};

    for (size_t i = 0; i < sizeof place / sizeof place[0]; i++) {
        struct contact_wrench wrench;
        struct contact_patch patch;
        struct scene scene;
        struct bodies b = foot_over(&scene, place[i][0], place[i][1], place[i][2]);
        double last = energy(&b), most = 0;
        int pair[1] = {0};
        struct contact_bristles bristles = {.y = b.bristle, .pair = pair, .npair = 1};

        for (int k = 0; k < 300; k++) {
            double now;

            run(&b, 0.01, 2.5e-4);
            now = energy(&b);
            most = fmax(most, now - last);
            last = now;
        }
        b.world->ops->evaluate(b.world, b.motion, &bristles, &wrench);
        assert_int_equal(b.world->ops->patches(b.world, &patch, 1), 1);
        print_message("# off by %.1e %.1e %.1e N, %.1e N m; %.2f mm deep; energy grew by %.1e J at "
                      "most; %.1e m/s\n",
                      wrench.force[0], wrench.force[1], wrench.force[2] - MASS * G,
                      vec3_norm(wrench.moment), 1e3 * patch.penetration_m, most,
                      vec3_norm(b.motion[0].v));
        assert_near(wrench.force[0], 0, 1e-3 * MASS * G);
        assert_near(wrench.force[1], 0, 1e-3 * MASS * G);
        assert_near(wrench.force[2], MASS * G, 1e-3 * MASS * G);
        assert_near(vec3_norm(wrench.moment), 0, 0.02);
        assert_near(vec3_norm(b.motion[0].v), 0, 1e-3);
        assert_true(patch.penetration_m < 5e-3);
        assert_true(most < 1e-5);
    }
}
