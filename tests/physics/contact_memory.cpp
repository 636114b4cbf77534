/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The engine "simbody" and memory: an evaluation gives back what it allocates, and one that gets
 * none fails without harm.
 */
extern "C" {
#include "tests/physics/contact_scene.h"
#include "tests/test.h"
}

#include <atomic>
#include <cstdlib>
#include <new>

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

/* A box of 768 faces on a half-space, and a sphere on the box. */
void make_scene(scene *scene, body_motion motion[2])
{
    scene_init(scene, 2);
    scene_add(scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_box(scene, 0, 0.1, 0.1, 0.1, 8, &scene_foot);
    scene_add(scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
    scene_add_pair(scene, 0, 1);
    scene_add_pair(scene, 1, 2);
    scene_place(&motion[0], 0, 0, 0.099);
    scene_place(&motion[1], 0, 0, 0.29);
}

TEST(evaluations_give_back_their_memory)
{
    const int rounds = 300;
    contact_world *world = nullptr;
    struct error error = {};
    scene scene;
    body_motion motion[2];
    contact_wrench wrench[2];
    long held = 0;

    make_scene(&scene, motion);
    assert_int_equal(contact_simbody_create(&scene.config, &world, &error), ERROR_NONE);
    for (int i = 0; i < 10 + rounds; ++i) {
        /* The first ones fill caches */
        held = i == 10 ? live.load() : held;
        motion[0].p[2] -= 1e-6;
        assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench), ERROR_NONE);
    }

    /* Contacts may come and go by a few faces, but nothing piles up */
    assert_true(labs(live - held) < rounds);
    world->ops->destroy(world);
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

    make_scene(&scene, motion);
    assert_int_equal(contact_simbody_create(&scene.config, &world, &error), ERROR_NONE);

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
