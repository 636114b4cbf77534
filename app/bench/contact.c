/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench contact: measures one evaluation of contact forces by the native engine and by
 * Simbody, in one interleaved run. The scenes are pairs of surfaces that robots have, the paper's
 * five bodies, and meshes of increasing size.
 */

#include "app/bench/bench.h"
#include "base/options.h"
#include "contact/mesh/solid_store.h"
#include "manual/contact.h"

#include <math.h>
#include <stdlib.h>

#define ARENA_BYTES ((size_t)2 << 30) /* reserved address space */

/* Number of motions per scene and of engines; index of the native engine. */
enum { POSES = 16, ENGINES = 2, NATIVE = 0 };

/* A measured scene: its motions and its results. */
struct result {
    struct body_motion motion[POSES][BENCH_BODIES];
    struct contact_world *world[ENGINES];
    double *us[ENGINES]; /* time of one evaluation in each round */
};

/* A running benchmark. */
struct bench {
    size_t rounds, nscene;
    struct arena arena;
    struct bench_scene scene[BENCH_SCENES];
    struct result result[BENCH_SCENES];
};

/* Creates both engines for each scene, and draws the motions. */
static enum error_code contact_bench_create_worlds(struct bench *bench, struct error *error)
{
    uint64_t seed = 7;

    for (size_t i = 0; i < bench->nscene; i++) {
        const struct bench_scene *s = &bench->scene[i];
        struct result *r = &bench->result[i];
        enum error_code code =
            contact_native_create(&s->config, &bench->arena, &r->world[NATIVE], error);

        code = code ? code : contact_simbody_create(&s->config, &r->world[1], error);
        if (code) {
            return code;
        }
        for (int e = 0; e < ENGINES; e++) {
            r->us[e] = arena_alloc(&bench->arena, bench->rounds, sizeof *r->us[e]);
            if (!r->us[e]) {
                return error_set(error, ERROR_MEMORY, "no memory for %zu rounds", bench->rounds);
            }
        }

        /* Both engines evaluate the same motions */
        for (int pose = 0; pose < POSES; pose++) {
            bench_scene_draw(s, &seed, r->motion[pose]);
        }
    }
    return ERROR_NONE;
}

/* ---- measuring ---- */

/* Evaluates every motion several times. Returns the CPU time of one evaluation, us. */
static double contact_bench_time_engine(struct result *r, int engine)
{
    struct contact_world *world = r->world[engine];
    struct contact_wrench wrench[BENCH_BODIES];
    /* Repeat the native engine, because one evaluation is shorter than the clock's resolution */
    const int repeat = engine == NATIVE ? 20 : 1;
    double start = bench_cpu_s();

    for (int i = 0; i < repeat * POSES; i++) {
        if (world->ops->evaluate(world, r->motion[i % POSES], NULL, wrench)) {
            return (double)NAN;
        }
    }
    return 1e6 * (bench_cpu_s() - start) / (repeat * POSES);
}

/* Prints a table of medians, with the ratio of the engines and the target of the native engine. */
static void contact_bench_print_rounds(struct bench *bench)
{
    printf("microseconds of CPU an evaluation, median of %zu interleaved rounds of %d poses;\n"
           "target: of native, where one is set\n\n%-26s %9s %9s %9s %8s %8s %8s\n",
           bench->rounds, POSES, "scene", "triangles", "native", "simbody", "ratio", "target",
           "force N");

    /* One row per scene: both engines, their ratio, and the force, which shows that the bodies
     * touch */
    for (size_t i = 0; i < bench->nscene; i++) {
        const struct bench_scene *s = &bench->scene[i];
        struct result *r = &bench->result[i];
        struct contact_wrench wrench[BENCH_BODIES];
        double us[ENGINES], force = 0;

        printf("%-26s %9zu", s->name, s->faces);
        for (int e = 0; e < ENGINES; e++) {
            us[e] = bench_median(r->us[e], bench->rounds);
            printf(" %9.3f", us[e]);
        }
        r->world[NATIVE]->ops->evaluate(r->world[NATIVE], r->motion[0], NULL, wrench);
        for (size_t b = 0; b < s->config.nbody; b++) {
            force += wrench[b].force[2];
        }
        printf(" %8.1f", us[1] / us[NATIVE]);
        printf(s->target_us > 0 ? " %8.1f" : "         ", s->target_us);
        printf(" %8.3g\n", force);
    }
}

/* Makes the scenes and measures them. */
static enum error_code contact_bench_run(struct bench *bench, const char *foot, struct error *error)
{
    const struct mesh *mesh;
    enum error_code code = solid_store_read_obj(foot, &bench->arena, &mesh, error);

    code =
        code ? code : bench_scenes_make(bench->scene, &bench->nscene, mesh, &bench->arena, error);
    code = code ? code : contact_bench_create_worlds(bench, error);
    if (!code) {
        for (size_t round = 0; round < bench->rounds; round++) {
            for (size_t i = 0; i < bench->nscene; i++) {
                for (int e = 0; e < ENGINES; e++) {
                    bench->result[i].us[e][round] = contact_bench_time_engine(&bench->result[i], e);
                }
            }
            bench_progress("contact", round + 1, bench->rounds);
        }
        contact_bench_print_rounds(bench);
    }

    /* Simbody allocates its worlds itself; the native worlds are in the arena */
    for (size_t i = 0; i < bench->nscene; i++) {
        struct contact_world *simbody = bench->result[i].world[1];

        if (simbody) {
            simbody->ops->destroy(simbody);
        }
    }
    return code;
}

int bench_contact(int argc, char **argv)
{
    static int64_t rounds = 200;
    static const char *foot = "config/meshes/coman-foot-right.obj";
    static struct bench bench;
    static const struct option_spec options[] = {
        {"--rounds", OPTION_INT, "N", "interleaved rounds, 200 by default", &rounds, .min = 1,
         .max = 100000},
    };
    static const struct operand_spec operands[] = {
        {"FOOT", "the foot's mesh, config/meshes/coman-foot-right.obj by default", false,
         .value = &foot},
    };
    static const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "contact",
        .summary = "Time the contact engines on the pairs of surfaces that a robot meets.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_CONTACT,
    };
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    /* The scenes allocate further meshes in the same arena as the foot */
    bench.rounds = (size_t)rounds;
    code = arena_init(&bench.arena, ARENA_BYTES, &error);
    code = code ? code : contact_bench_run(&bench, foot, &error);
    arena_fini(&bench.arena);
    return options_end(&spec, code, &error);
}
