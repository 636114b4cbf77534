/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native engine against the engine "simbody", where both integrate exactly: spheres by Hertz's
 * law in any pose, and a box that lies level and slides. Dissipation, friction, energies and the
 * way from springs to wrenches have to be the same; closed forms judge what overlaps.
 */

#include "tests/physics/contact_fixture.h"

/* How the two engines are compared: a pose about which the second body wobbles. */
struct sweep {
    double height, turn; /* of the second body over the first, its tilt */
    double up, across;   /* how far it strays */
    double speed, spin;
    int count, touching; /* poses, and how many of them have to touch */
};

static void draw(uint64_t *seed, const struct sweep *sweep, struct body_motion motion[2])
{
    for (int b = 0; b < 2; b++) {
        scene_place(&motion[b], sweep->across * random_number(seed),
                    sweep->across * random_number(seed),
                    b * (sweep->height + sweep->up * random_number(seed)));
        scene_random_rotation(seed, sweep->turn, motion[b].R);
        for (int i = 0; i < 3; i++) {
            motion[b].w[i] = sweep->spin * random_number(seed);
            motion[b].v[i] = sweep->speed * random_number(seed);
        }
    }
}

static double largest(double a, const double v[3], const double w[3])
{
    for (int i = 0; i < 3; i++) {
        a = fmax(a, fabs(v[i] - w[i]));
    }
    return a;
}

static void compare(const struct scene *scene, const struct sweep *sweep)
{
    struct contact_world *simbody = fixture_simbody(scene), *native = fixture_native(scene);
    uint64_t seed = 2021;
    int touching = 0;
    double worst = 0;

    for (int i = 0; i < sweep->count; i++) {
        struct body_motion motion[2];
        struct contact_wrench expected[2], wrench[2];
        struct contact_patch theirs = {0}, ours = {0};

        draw(&seed, sweep, motion);
        assert_ok(simbody->ops->evaluate(simbody, motion, NULL, expected));
        assert_ok(native->ops->evaluate(native, motion, NULL, wrench));
        simbody->ops->patches(simbody, &theirs, 1);
        native->ops->patches(native, &ours, 1);

        double force = vec3_norm(expected[1].force);
        double moment = vec3_norm(expected[1].moment) + 0.05 * force;

        touching += force > 0;
        for (int b = 0; b < 2 && force > 0; b++) {
            worst = fmax(worst, largest(0, wrench[b].force, expected[b].force) / force);
            worst = fmax(worst, largest(0, wrench[b].moment, expected[b].moment) / moment);
            worst = fmax(worst, fabs(ours.potential_j - theirs.potential_j) / theirs.potential_j);
            worst =
                fmax(worst, fabs(ours.dissipation_w - theirs.dissipation_w) / theirs.dissipation_w);
        }
        if (force == 0) {
            assert_true(vec3_norm(wrench[1].force) == 0);
        }
    }
    print_message("%d of %d poses touch, largest difference %.1e of the wrench\n", touching,
                  sweep->count, worst);
    assert_true(touching >= sweep->touching);
    assert_true(worst < 1e-9);
    simbody->ops->destroy(simbody);
    native->ops->destroy(native);
}

/* The same scene creeping and rushing, from sticking to far above the transition velocity. */
static void compare_speeds(const struct scene *scene, struct sweep sweep)
{
    const double speed[] = {1e-4, 5e-3, 0.1};

    for (int i = 0; i < 3; i++) {
        sweep.speed = speed[i];
        sweep.spin = sweep.turn > 0 ? 10 * speed[i] : 0;
        compare(scene, &sweep);
    }
}

TEST(level_box_slides_on_half_space)
{
    struct scene scene;

    scene_init(&scene, 2);
    scene_add_box(&scene, 1, 0.075, 0.075, 0.075, 7, &scene_foot);
    scene_add(&scene, 0, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_pair(&scene, 0, 1);
    compare_speeds(
        &scene, (struct sweep){
                    .height = 0.0745, .up = 0.0004, .across = 0.03, .count = 200, .touching = 150});
}

TEST(spheres_on_each_other_and_on_a_half_space)
{
    struct scene scene;

    for (int half_space = 0; half_space < 2; half_space++) {
        scene_init(&scene, 2);
        if (half_space) {
            scene_add(&scene, 0, CONTACT_HALF_SPACE, &scene_ground);
        } else {
            scene_add(&scene, 0, CONTACT_SPHERE, &scene_ground)->radius_m = 0.05;
        }
        scene_add(&scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(&scene, 1, 0);
        compare_speeds(&scene, (struct sweep){.height = half_space ? 0.018 : 0.068,
                                              .turn = 0.1,
                                              .up = 0.001,
                                              .across = 0.001,
                                              .count = 200,
                                              .touching = 150});
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
