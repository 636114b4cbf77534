/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The kernels of the native engine for each instruction set: the same wrenches as those of the
 * plain ones but for the order of sums, the same bits when asked again, and the machine takes its
 * best.
 */
#include "tests/physics/contact_variants.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "tests/physics/contact_scene.h"

enum { PLAIN, AVX2, AVX512 };
enum { BODIES = 4, POSES = 400 };

static struct arena arena;
static const struct mesh *foot;

static int set_up(void **state)
{
    (void)state;
    return arena_init(&arena, (size_t)64 << 20, NULL) != ERROR_NONE ||
           mesh_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena, &foot,
                         NULL) != ERROR_NONE;
}

static int tear_down(void **state)
{
    (void)state;
    arena_fini(&arena);
    return 0;
}

/* Every kind of pair: a foot, a box and two spheres over the ground and among each other. */
static void everything(struct scene *scene)
{
    scene_init(scene, BODIES);
    scene_add(scene, 0, CONTACT_MESH, &scene_foot)->mesh = foot;
    scene_add_box(scene, 1, 0.05, 0.04, 0.03, 5, &scene_foot);
    scene_add(scene, 2, CONTACT_SPHERE, &scene_foot)->radius_m = 0.05;
    scene_add(scene, 3, CONTACT_SPHERE, &scene_ground)->radius_m = 0.04;
    scene_add(scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    for (int a = 0; a < 5; a++) {
        for (int b = a + 1; b < 5; b++) {
            scene_add_pair(scene, a, b);
        }
    }
}

static void draw(uint64_t *seed, struct body_motion motion[BODIES])
{
    for (int b = 0; b < BODIES; b++) {
        scene_place(&motion[b], 0.04 * random_number(seed), 0.04 * random_number(seed),
                    0.04 * random_number(seed));
        scene_random_rotation(seed, 0.5, motion[b].R);
        for (int k = 0; k < 3; k++) {
            motion[b].v[k] = 0.3 * random_number(seed);
            motion[b].w[k] = random_number(seed);
        }
    }
}

static struct contact_world *make(const struct scene *scene, const struct native_kernels *kernels)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    if (native_create_with_kernels(&scene->config, kernels, &arena, &world, &error)) {
        fail_msg("%s", error.text);
    }
    return world;
}

static double largest(const struct contact_wrench wrench[BODIES])
{
    double most = 0;

    for (int b = 0; b < BODIES; b++) {
        for (int k = 0; k < 3; k++) {
            most = fmax(most, fmax(fabs(wrench[b].force[k]), fabs(wrench[b].moment[k])));
        }
    }
    return most;
}

/* The largest difference of two answers, as a part of the largest number in them. */
static double difference(const struct contact_wrench a[BODIES],
                         const struct contact_wrench b[BODIES])
{
    double most = 0;

    for (int i = 0; i < BODIES; i++) {
        for (int k = 0; k < 3; k++) {
            most = fmax(most, fmax(fabs(a[i].force[k] - b[i].force[k]),
                                   fabs(a[i].moment[k] - b[i].moment[k])));
        }
    }
    return most > 0 ? most / largest(a) : 0;
}

static void agrees(size_t number)
{
    struct contact_variant variant = contact_variant_at(number);
    struct contact_wrench expected[BODIES], found[BODIES], again[BODIES];
    struct contact_world *plain, *other;
    struct body_motion motion[BODIES];
    double worst = 0;
    struct scene scene;
    uint64_t seed = 53;
    int touching = 0;

    if (!variant.runs) {
        print_message("SKIP: this machine has no %s\n", variant.needs);
        skip();
    }
    everything(&scene);
    plain = make(&scene, &native_kernels);
    other = make(&scene, variant.kernels);
    for (int n = 0; n < POSES; n++) {
        draw(&seed, motion);
        assert_int_equal(plain->ops->evaluate(plain, motion, NULL, expected), ERROR_NONE);
        assert_int_equal(other->ops->evaluate(other, motion, NULL, found), ERROR_NONE);
        assert_int_equal(other->ops->evaluate(other, motion, NULL, again), ERROR_NONE);
        assert_memory_equal(found, again, sizeof found);
        worst = fmax(worst, difference(expected, found));
        touching += largest(expected) > 0;
    }
    print_message("# %s: differs from plain by %.2g at most\n", variant.name, worst);
    assert_true(touching > POSES / 2);
    assert_true(worst < 1e-9);
}

static void plain_kernels_repeat_themselves(void **state)
{
    (void)state;
    agrees(PLAIN);
}

static void avx2_kernels_agree_with_plain_ones_and_repeat_themselves(void **state)
{
    (void)state;
    agrees(AVX2);
}

static void avx512_kernels_agree_with_plain_ones_and_repeat_themselves(void **state)
{
    (void)state;
    agrees(AVX512);
}

/* Of a foot on the ground, which has lanes to fill: to the bit. */
static void the_widest_kernels_that_the_machine_runs_are_taken(void **state)
{
    struct contact_variant widest = contact_variant_at(PLAIN);
    struct contact_wrench expected, found;
    struct contact_world *forced, *chosen;
    struct body_motion motion;
    struct scene scene;
    uint64_t seed = 59;

    (void)state;
    for (size_t n = 0; n < CONTACT_VARIANTS; n++) {
        widest = contact_variant_at(n).runs ? contact_variant_at(n) : widest;
    }
    scene_init(&scene, 1);
    scene_add(&scene, 0, CONTACT_MESH, &scene_foot)->mesh = foot;
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_pair(&scene, 0, 1);
    forced = make(&scene, widest.kernels);
    chosen = make(&scene, NULL);
    for (int n = 0; n < POSES; n++) {
        scene_place(&motion, 0, 0, 0.01 * random_number(&seed));
        scene_random_rotation(&seed, 0.2, motion.R);
        assert_int_equal(forced->ops->evaluate(forced, &motion, NULL, &expected), ERROR_NONE);
        assert_int_equal(chosen->ops->evaluate(chosen, &motion, NULL, &found), ERROR_NONE);
        assert_memory_equal(&found, &expected, sizeof found);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plain_kernels_repeat_themselves),
        cmocka_unit_test(avx2_kernels_agree_with_plain_ones_and_repeat_themselves),
        cmocka_unit_test(avx512_kernels_agree_with_plain_ones_and_repeat_themselves),
        cmocka_unit_test(the_widest_kernels_that_the_machine_runs_are_taken),
    };

    return cmocka_run_group_tests(tests, set_up, tear_down);
}
