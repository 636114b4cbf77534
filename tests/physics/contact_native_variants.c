/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The kernels of the native engine for each instruction set: the same bits as those of the plain
 * ones, also when asked again.
 */
#include "base/instruction_set.h"

#include "tests/physics/contact_scene.h"
#include "tests/test.h"

enum { BODIES = 4, POSES = 400 };

static struct arena arena;
static const struct mesh *foot;

FIXTURE(set_up)
{
    return arena_init(&arena, (size_t)64 << 20, NULL) != ERROR_NONE ||
           solid_store_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena, &foot,
                                NULL) != ERROR_NONE;
}

FIXTURE(tear_down)
{
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

/* The world with the kernels of an instruction set. */
static struct contact_world *make(const struct scene *scene, enum instruction_set set)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    assert_no_error(instruction_set_hold(instruction_set_names[set], &error), error.text);
    assert_no_error(contact_native_create(&scene->config, &arena, &world, &error), error.text);
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

static void agrees(enum instruction_set set)
{
    struct contact_wrench expected[BODIES], found[BODIES], again[BODIES];
    struct contact_world *plain, *other;
    struct body_motion motion[BODIES];
    struct scene scene;
    uint64_t seed = 53;
    int touching = 0;

    if (set > instruction_set_of_machine()) {
        print_message("SKIP: this machine has no %s\n", instruction_set_names[set]);
        skip();
    }
    everything(&scene);
    plain = make(&scene, INSTRUCTIONS_PLAIN);
    other = make(&scene, set);
    assert_true(set == INSTRUCTIONS_PLAIN || plain->ops != other->ops);
    for (int n = 0; n < POSES; n++) {
        draw(&seed, motion);
        assert_ok(plain->ops->evaluate(plain, motion, NULL, expected));
        assert_ok(other->ops->evaluate(other, motion, NULL, found));
        assert_ok(other->ops->evaluate(other, motion, NULL, again));
        assert_memory_equal(found, again, sizeof found);
        assert_memory_equal(expected, found, sizeof found);
        touching += largest(expected) > 0;
    }
    assert_true(touching > POSES / 2);
}

TEST(plain_kernels_repeat_themselves)
{
    agrees(INSTRUCTIONS_PLAIN);
}

TEST(avx2_kernels_have_the_bits_of_plain_ones_and_repeat_themselves)
{
    agrees(INSTRUCTIONS_AVX2);
}

TEST(avx512_kernels_have_the_bits_of_plain_ones_and_repeat_themselves)
{
    agrees(INSTRUCTIONS_AVX512);
}

TEST_GROUP(set_up, tear_down)
