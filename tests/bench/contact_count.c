/* SPDX-License-Identifier: Apache-2.0 */
/* Evaluates contact at N random poses with the native engine, each in a call of one_pose, for an
 * instruction counter: foot|box|sphere N. */
#include "contact/contact.h"

#include <stdio.h>
#include <stdlib.h>

#include "tests/physics/contact_scene.h"

void one_pose(struct contact_world *world, const struct contact_motion *motion);

__attribute__((noinline)) void one_pose(struct contact_world *world,
                                        const struct contact_motion *motion)
{
    struct contact_wrench wrench[2];

    if (world->ops->evaluate(world, motion, wrench) != ERROR_NONE) {
        exit(EXIT_FAILURE);
    }
}

/* The second body's height over the first where they touch, or 0 for an unknown name. */
static double make_scene(struct scene *scene, const char *name, const struct mesh *foot)
{
    scene_init(scene, 2);
    scene_add_pair(scene, 0, 1);
    if (strcmp(name, "foot") == 0) {
        scene_add(scene, 0, CONTACT_HALF_SPACE, &scene_ground);
        scene_add(scene, 1, CONTACT_MESH, &scene_foot)->mesh = foot;
        return 0.0932 - 5e-4;
    }
    if (strcmp(name, "box") == 0) {
        scene_add_box(scene, 0, 0.2, 0.3, 0.02, 1, &scene_ground);
        scene_add_box(scene, 1, 0.075, 0.075, 0.075, 7, &scene_foot);
        return 0.095 - 5e-4;
    }
    if (strcmp(name, "sphere") == 0) {
        scene_add_box(scene, 0, 0.075, 0.075, 0.075, 7, &scene_ground);
        scene_add(scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        return 0.095 - 1e-3;
    }
    return 0;
}

int main(int argc, char **argv)
{
    struct arena arena;
    struct contact_world *world;
    const struct mesh *foot;
    struct scene scene;
    uint64_t seed = 1000003;
    double height;

    if (argc != 3 || arena_init(&arena, (size_t)16 << 20, NULL) ||
        mesh_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena, &foot, NULL)) {
        return EXIT_FAILURE;
    }
    height = make_scene(&scene, argv[1], foot);
    if (height == 0 || contact_native_create(&scene.config, &arena, &world, NULL)) {
        return EXIT_FAILURE;
    }
    for (long i = strtol(argv[2], NULL, 10); i > 0; --i) {
        struct contact_motion motion[2];

        for (int b = 0; b < 2; ++b) {
            scene_place(&motion[b], 0.01 * scene_random(&seed), 0.01 * scene_random(&seed),
                        b * (height + 3e-4 * scene_random(&seed)));
            scene_random_rotation(&seed, 3e-3, motion[b].R);
            for (int k = 0; k < 3; ++k) {
                motion[b].v[k] = 0.02 * scene_random(&seed);
                motion[b].w[k] = 0.1 * scene_random(&seed);
            }
        }
        one_pose(world, motion);
    }
    arena_fini(&arena);
    return EXIT_SUCCESS;
}
