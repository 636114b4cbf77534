/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The scenes of coman-hil-bench contact, for a count of instructions. A pose is named by the seed
 * that it is drawn from. Built twice:
 *
 * contact_count SCENE ENGINE SEED... evaluates the poses with the engine native or simbody, each in
 * a call of one_pose, for an instruction counter.
 *
 * contact_work SCENE N EACH has the native engine built with a call at every basic block. It
 * evaluates N random poses and prints the number of blocks that ran and the seed: of EACH poses
 * spread evenly over all in the order of their work, then of the EACH with the most.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bench/bench.h"
#include "contact/mesh/solid_store.h"

static struct bench_scene scene[BENCH_SCENES];

void one_pose(struct contact_world *world, const struct body_motion *motion);

__attribute__((noinline)) void one_pose(struct contact_world *world,
                                        const struct body_motion *motion)
{
    struct contact_wrench wrench[BENCH_BODIES];

    if (world->ops->evaluate(world, motion, NULL, wrench) != ERROR_NONE) {
        exit(EXIT_FAILURE);
    }
}

static void draw_and_evaluate(size_t index, struct contact_world *world, uint64_t *seed)
{
    struct body_motion motion[BENCH_BODIES];

    bench_scene_draw(&scene[index], seed, motion);
    one_pose(world, motion);
}

#ifdef COUNT_BLOCKS

static uint64_t blocks;

/* The compiler calls this at every basic block. */
void __sanitizer_cov_trace_pc(void);
void __sanitizer_cov_trace_pc(void)
{
    blocks++;
}

struct work {
    uint64_t blocks, seed;
};

static int by_blocks(const void *a, const void *b)
{
    const struct work *x = a, *y = b;

    return (x->blocks > y->blocks) - (x->blocks < y->blocks);
}

static int run(size_t index, struct contact_world *world, int argc, char **argv)
{
    size_t n = argc == 2 ? strtoull(argv[0], NULL, 10) : 0,
           each = n ? strtoull(argv[1], NULL, 10) : 0;
    struct work *work = calloc(n + 1, sizeof *work);
    uint64_t seed = 1000003;

    if (!work || each < 1 || n < 2 * each) {
        free(work);
        return EXIT_FAILURE;
    }
    for (size_t i = 0; i < n; i++) {
        work[i].seed = seed;
        blocks = 0;
        draw_and_evaluate(index, world, &seed);
        work[i].blocks = blocks;
    }
    qsort(work, n, sizeof *work, by_blocks);
    for (size_t i = 0; i < 2 * each; i++) {
        const struct work *w = &work[i < each ? (2 * i + 1) * n / (2 * each) : n - 1 - (i - each)];

        printf("%llu %llu\n", (unsigned long long)w->blocks, (unsigned long long)w->seed);
    }
    free(work);
    return EXIT_SUCCESS;
}

static enum error_code create(const char *engine, const struct contact_config *config,
                              struct arena *arena, struct contact_world **world)
{
    (void)engine;
    return contact_native_create(config, arena, world, NULL);
}

enum { SKIP = 2 };

#else

static int run(size_t index, struct contact_world *world, int argc, char **argv)
{
    for (int i = 0; i < argc; i++) {
        uint64_t seed = strtoull(argv[i], NULL, 10);

        draw_and_evaluate(index, world, &seed);
    }
    return EXIT_SUCCESS;
}

static enum error_code create(const char *engine, const struct contact_config *config,
                              struct arena *arena, struct contact_world **world)
{
    return strcmp(engine, "simbody") == 0 ? contact_simbody_create(config, world, NULL)
                                          : contact_native_create(config, arena, world, NULL);
}

enum { SKIP = 3 };

#endif

int main(int argc, char **argv)
{
    struct contact_world *world;
    const struct mesh *foot;
    struct arena arena;
    size_t nscene, index;
    int status;

    if (argc <= SKIP || arena_init(&arena, (size_t)2 << 30, NULL) ||
        solid_store_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena, &foot,
                             NULL) ||
        bench_scenes_make(scene, &nscene, foot, &arena, NULL)) {
        return EXIT_FAILURE;
    }
    index = strtoull(argv[1], NULL, 10);
    if (index >= nscene || create(argv[2], &scene[index].config, &arena, &world)) {
        return EXIT_FAILURE;
    }
    status = run(index, world, argc - SKIP, argv + SKIP);
    world->ops->destroy(world);
    arena_fini(&arena);
    return status;
}
