/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The engine "simbody" and memory: an evaluation gives back what it allocates, and one that gets
 * none fails without harm. Along the way a report of what an evaluation costs, microseconds and
 * allocations, for a foot, two feet and the paper's box on a table; no condition on those.
 */
extern "C" {
#include "contact/contact.h"
#include "tests/physics/contact_scene.h"
#include "tests/test.h"
}

#include <algorithm>
#include <atomic>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <new>
#include <vector>

extern "C" {
}

namespace
{

std::atomic<long> allocations, live;
std::atomic<long> until_failure{-1}; /* allocations that still succeed; -1: all do */

void *counted(std::size_t size)
{
    if (until_failure >= 0 && until_failure-- == 0) {
        throw std::bad_alloc();
    }

    void *memory = std::malloc(size ? size : 1);

    if (!memory) {
        throw std::bad_alloc();
    }
    ++allocations;
    ++live;
    return memory;
}

void uncounted(void *memory)
{
    live -= memory != nullptr;
    std::free(memory);
}

} // namespace

/* Every allocation of C++ in this process, Simbody's too */
void *operator new(std::size_t size)
{
    return counted(size);
}

void *operator new[](std::size_t size)
{
    return counted(size);
}

void operator delete(void *memory) noexcept
{
    uncounted(memory);
}

void operator delete[](void *memory) noexcept
{
    uncounted(memory);
}

void operator delete(void *memory, std::size_t) noexcept
{
    uncounted(memory);
}

void operator delete[](void *memory, std::size_t) noexcept
{
    uncounted(memory);
}

namespace
{

const int rounds = 300;

double now_us()
{
    timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

void profile(const char *what, const scene &scene, body_motion *motion)
{
    contact_world *world = nullptr;
    struct error error = {};
    std::vector<contact_wrench> wrench(scene.config.nbody);
    std::vector<double> time(rounds);

    if (contact_simbody_create(&scene.config, &world, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    /* The first ones fill caches */
    for (int i = 0; i < 10; ++i) {
        assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench.data()), ERROR_NONE);
    }

    const long before = allocations, held = live;

    for (int i = 0; i < rounds; ++i) {
        const double start = now_us();

        motion[0].p[2] -= 1e-6;
        assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench.data()), ERROR_NONE);
        time[static_cast<size_t>(i)] = now_us() - start;
    }
    std::sort(time.begin(), time.end());
    print_message("%s: median %.1f us, fastest %.1f us, %.0f allocations an evaluation, %.0f N\n",
                  what, time[rounds / 2], time[0],
                  static_cast<double>(allocations - before) / rounds, wrench[0].force[2]);

    /* Contacts may come and go by a few faces, but nothing piles up */
    assert_true(labs(live - held) < rounds);
    world->ops->destroy(world);
}

const mesh *foot(struct arena *arena, const char *path)
{
    const mesh *mesh = nullptr;
    struct error error = {};

    if (mesh_read_obj(path, arena, &mesh, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    return mesh;
}

void feet(int count)
{
    static const char *const path[2] = {HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj",
                                        HIL_SOURCE_DIR "/config/meshes/coman-foot-left.obj"};
    struct arena arena = {};
    scene scene;
    body_motion motion[2];

    assert_int_equal(arena_init(&arena, 1 << 20, nullptr), ERROR_NONE);
    scene_init(&scene, static_cast<size_t>(count));
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    for (int b = 0; b < count; ++b) {
        scene_add(&scene, b, CONTACT_MESH, &scene_foot)->mesh = foot(&arena, path[b]);
        scene_add_pair(&scene, 0, b + 1);
        scene_place(&motion[b], 0, b ? 0.0726 : -0.0726, 0.0932 - 2e-4);
    }
    profile(count == 1 ? "foot (504) on half-space" : "two feet (504 each) on half-space", scene,
            motion);
    arena_fini(&arena);
}

TEST(evaluations_of_one_foot_give_back_their_memory)
{
    feet(1);
}

TEST(evaluations_of_two_feet_give_back_their_memory)
{
    feet(2);
}

TEST(evaluations_of_a_box_on_a_table_give_back_their_memory)
{
    scene scene;
    body_motion motion[1];

    scene_init(&scene, 1);
    scene_add_box(&scene, -1, 0.2, 0.3, 0.02, 1, &scene_ground);
    scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &scene_foot);
    scene_add_pair(&scene, 0, 1);
    scene_place(&motion[0], 0.013, -0.021, 0.02 + 0.075 - 5e-4);
    profile("box (588) on table (12)", scene, motion);
}

/* Every allocation of an evaluation fails once, in turn; after each the world still gives the same
 * bits. Creating a world is left out: Simbody's own clean-up asserts there. */
TEST(an_evaluation_without_memory_is_an_error_and_harms_nothing)
{
    contact_world *world = nullptr;
    struct error error = {};
    scene scene;
    body_motion motion[2];
    contact_wrench reference[2], wrench[2];
    long failures = 0;

    scene_init(&scene, 2);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_box(&scene, 0, 0.1, 0.1, 0.1, 8, &scene_foot);
    scene_add(&scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
    scene_add_pair(&scene, 0, 1);
    scene_add_pair(&scene, 1, 2);
    assert_int_equal(contact_simbody_create(&scene.config, &world, &error), ERROR_NONE);
    scene_place(&motion[0], 0, 0, 0.099);
    scene_place(&motion[1], 0, 0, 0.29);

    const long before = allocations;

    assert_int_equal(world->ops->evaluate(world, motion, NULL, reference), ERROR_NONE);
    assert_true(reference[1].force[2] > 0);
    if (allocations == before) {
        world->ops->destroy(world);
        print_message("SKIP: Simbody's operator new is not ours but valgrind's\n");
        skip();
    }
    for (enum error_code code = ERROR_MEMORY; code != ERROR_NONE; ++failures) {
        until_failure = failures;
        code = world->ops->evaluate(world, motion, NULL, wrench);
        until_failure = -1;
        if (code != ERROR_NONE) {
            assert_int_equal(code, ERROR_MEMORY);
            assert_string_equal(world->ops->failure(world), "contact: no memory for an evaluation");
            assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench), ERROR_NONE);
        }
        assert_memory_equal(wrench, reference, sizeof wrench);
    }
    assert_true(failures > 10);
    world->ops->destroy(world);
}

} // namespace
