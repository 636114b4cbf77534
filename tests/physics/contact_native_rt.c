/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native engine in the loop: no allocation while it evaluates, none of its memory outside the
 * arena, errors as values.
 */

#include "tests/physics/contact_scene.h"
#include "tests/physics/counting_malloc.h"
#include "tests/test.h"

/* Every kind of pair at once: ground, foot, box, table, sphere, another sphere. */
static void everything(struct scene *scene, const struct mesh *foot)
{
    scene_init(scene, 4);
    scene_add(scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add(scene, 0, CONTACT_MESH, &scene_foot)->mesh = foot;
    scene_add_box(scene, -1, 0.2, 0.3, 0.02, 1, &scene_ground);
    scene_add_box(scene, 1, 0.075, 0.075, 0.075, 7, &scene_foot);
    scene_add(scene, 2, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
    scene_add(scene, 3, CONTACT_SPHERE, &scene_foot)->radius_m = 0.03;
    scene_add(scene, 3, CONTACT_CAPSULE, &scene_foot)->radius_m = 0.03;
    scene->surface[6].length_m = 0.05;
    scene_add_pair(scene, 0, 6);
    scene_add_pair(scene, 3, 6);
    scene_add_pair(scene, 4, 6);
    scene_add_pair(scene, 0, 1);
    scene_add_pair(scene, 2, 3);
    scene_add_pair(scene, 4, 3);
    scene_add_pair(scene, 4, 5);
    scene_add_pair(scene, 0, 5);
}

static const struct mesh *read_foot(struct arena *arena)
{
    const struct mesh *foot;

    assert_ok(solid_store_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", arena,
                                   &foot, NULL));
    return foot;
}

TEST(evaluations_and_tangents_allocate_nothing)
{
    struct arena arena CLOSED_BY(arena_fini);
    struct scene scene;
    uint64_t seed = 3;

    assert_ok(arena_init(&arena, (size_t)64 << 20, NULL));
    everything(&scene, read_foot(&arena));

    struct contact_world *world[2];

    for (int e = 0; e < 2; e++) {
        scene.config.mesh_law = e > 0 ? CONTACT_ELASTIC_FOUNDATION : CONTACT_PRESSURE_FIELD;
        assert_ok(contact_native_create(&scene.config, &arena, &world[e], NULL));
    }
    arena_seal(&arena);
    for (int i = 0; i < 1000; i++) {
        struct body_motion motion[4];
        struct contact_wrench wrench[4];
        struct contact_patch patch[8];
        struct contact_tangent tangent[8];
        size_t used = arena.used, before = counted_calls();

        for (int b = 0; b < 4; b++) {
            static const double height[] = {0.0925, 0.094, 0.188, 0.028};

            scene_place(&motion[b], 0.01 * b, 0.01 * random_number(&seed),
                        height[b] + 0.001 * random_number(&seed));
            scene_random_rotation(&seed, 0.05, motion[b].R);
            motion[b].v[0] = 0.1 * random_number(&seed);
        }
        motion[3].p[0] = 0.03;
        for (int e = 0; e < 2; e++) {
            assert_ok(world[e]->ops->evaluate(world[e], motion, NULL, wrench));
            assert_true(world[e]->ops->patches(world[e], patch, 8) >= 1);
            assert_true(world[e]->ops->tangents(world[e], tangent, 8) >= 1);
        }
        assert_int_equal(counted_calls(), before);
        assert_int_equal(arena.used, used);
    }
}

TEST(an_invalid_motion_is_an_error)
{
    struct arena arena CLOSED_BY(arena_fini);
    struct scene scene;
    struct body_motion motion[4];
    struct contact_wrench wrench[4];
    struct contact_world *world;

    assert_ok(arena_init(&arena, (size_t)16 << 20, NULL));
    everything(&scene, read_foot(&arena));
    assert_ok(contact_native_create(&scene.config, &arena, &world, NULL));
    for (int b = 0; b < 4; b++) {
        scene_place(&motion[b], b, 0, 1);
    }
    motion[2].v[1] = NAN;
    assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench), ERROR_INPUT);
    assert_non_null(strstr(world->ops->failure(world), "body 2"));
    motion[2].v[1] = 0;
    assert_ok(world->ops->evaluate(world, motion, NULL, wrench));
    assert_int_equal(world->ops->patches(world, NULL, 0), 0);
}

TEST(an_arena_that_is_too_small_is_an_error)
{
    struct arena meshes CLOSED_BY(arena_fini);
    struct scene scene;
    bool made = false;

    assert_ok(arena_init(&meshes, (size_t)1 << 20, NULL));
    everything(&scene, read_foot(&meshes));
    for (size_t size = 4096; !made; size += 8192) {
        struct contact_world *world;
        struct arena arena CLOSED_BY(arena_fini);
        struct error error = {0};
        enum error_code code;

        assert_true(size < (size_t)8 << 20);
        assert_ok(arena_init(&arena, size, NULL));
        code = contact_native_create(&scene.config, &arena, &world, &error);
        made = code == ERROR_NONE;
        assert_true(made || (code == ERROR_MEMORY && error.text[0]));
    }
}
