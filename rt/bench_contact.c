/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil bench contact: time of one evaluation of contact forces for the pairs of surfaces that
 * a robot meets and for the paper's five-body scene, the native engine beside Simbody in one
 * interleaved run; how it grows with the size of a mesh; and the slowest of many random poses.
 */
#include "contact/contact.h"
#include "rt/bench_output.h"
#include "rt/commands.h"
#include "rt/options.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define ARENA_BYTES ((size_t)2 << 30) /* of address space */

enum {
    SURFACES = 8,
    PAIRS = 8,
    BODIES = 5,
    POSES = 16,
    ENGINES = 2,
    SCENES = 10,
    QUICK_ROUNDS = 5
};

static const char *const engine_name[ENGINES] = {"native", "simbody"};

/* A scene, and motions in which its bodies touch. */
struct scene {
    const char *name;
    size_t faces; /* triangles in all */
    struct contact_surface surface[SURFACES];
    struct contact_pair pair[PAIRS];
    struct contact_config config;
    double place[BODIES][3];
    struct contact_motion motion[POSES][BODIES];
    struct contact_world *world[ENGINES];
    double *us[ENGINES]; /* of one evaluation, by round */
};

struct bench {
    size_t rounds, nscene;
    int64_t random;
    struct arena arena;
    const struct mesh *foot;
    struct scene scene[SCENES];
};

/* The paper's walking code: foot and ground; its Table 2 for the rest. */
static const struct contact_material foot_material = {1e5, 2e-4, 10, 1.1, 0.9, 0};
static const struct contact_material ground_material = {1e5, 1e-3, 10, 1.1, 0.9, 0};
static const struct contact_material box_material = {1e4, 1e-3, 10, 1.1, 0.9, 0.5};

/* ---- scenes ---- */

static double random_number(uint64_t *seed)
{
    *seed ^= *seed >> 12;
    *seed ^= *seed << 25;
    *seed ^= *seed >> 27;
    return (double)((*seed * 2685821657736338717u) >> 11) / 4503599627370496.0 - 1;
}

static struct scene *add_scene(struct bench *bench, const char *name, size_t nbody)
{
    struct scene *scene = &bench->scene[bench->nscene++];

    scene->name = name;
    scene->config = (struct contact_config){.nbody = nbody,
                                            .surface = scene->surface,
                                            .pair = scene->pair,
                                            .transition_velocity_m_s = 0.1};
    return scene;
}

static struct contact_surface *add_surface(struct scene *scene, int body, enum contact_shape shape,
                                           const struct contact_material *material)
{
    struct contact_surface *s = &scene->surface[scene->config.nsurface++];

    *s = (struct contact_surface){.name = "surface",
                                  .body = body,
                                  .shape = shape,
                                  .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                  .material = *material};
    return s;
}

static void add_mesh(struct scene *scene, int body, const struct mesh *mesh,
                     const struct contact_material *material)
{
    add_surface(scene, body, CONTACT_MESH, material)->mesh = mesh;
    scene->faces += mesh->nface;
}

static struct contact_surface *add_box(struct scene *scene, int body, double x, double y, double z,
                                       int cells, const struct contact_material *material)
{
    struct contact_surface *s = add_surface(scene, body, CONTACT_BOX, material);

    s->half_extent_m[0] = x;
    s->half_extent_m[1] = y;
    s->half_extent_m[2] = z;
    s->cells_per_edge = cells;
    scene->faces += 12 * (size_t)(cells * cells);
    return s;
}

static void add_pair(struct scene *scene, int a, int b)
{
    scene->pair[scene->config.npair++] = (struct contact_pair){a, b};
}

static void place(struct scene *scene, int body, double x, double y, double z)
{
    memcpy(scene->place[body], (double[3]){x, y, z}, sizeof scene->place[body]);
}

/* A motion near the bodies' places: up to 0.3 mm and 3 mrad off, in slow motion. */
static void draw_motion(const struct scene *scene, uint64_t *seed, struct contact_motion *motion)
{
    for (size_t b = 0; b < scene->config.nbody; ++b) {
        struct contact_motion *m = &motion[b];
        double q[4] = {1, 0, 0, 0}, norm;

        for (int i = 0; i < 3; ++i) {
            q[i + 1] = 1.5e-3 * random_number(seed);
            m->p[i] = scene->place[b][i] + (i < 2 ? 1e-2 : 3e-4) * random_number(seed);
            m->w[i] = 0.1 * random_number(seed);
            m->v[i] = 0.02 * random_number(seed);
        }
        norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int i = 0; i < 4; ++i) {
            q[i] /= norm;
        }
        memcpy(m->R,
               (double[9]){1 - 2 * (q[2] * q[2] + q[3] * q[3]), 2 * (q[1] * q[2] - q[0] * q[3]),
                           2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[1] * q[2] + q[0] * q[3]),
                           1 - 2 * (q[1] * q[1] + q[3] * q[3]), 2 * (q[2] * q[3] - q[0] * q[1]),
                           2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                           1 - 2 * (q[1] * q[1] + q[2] * q[2])},
               sizeof m->R);
    }
}

/* A block of ground with bumps of 4 mm every 15 cm and cells of 2.5 cm, or what gives more of them
 * within 10 m. */
static const struct mesh *make_terrain(struct arena *arena, int cells, struct error *error)
{
    const double side = cells * 0.0125, half[3] = {side, side, 0.05};
    const struct mesh *box;
    struct mesh *mesh = arena_alloc(arena, 1, sizeof *mesh);
    double(*vertex)[3];

    if (!mesh || mesh_box(half, cells, arena, &box, error)) {
        return NULL;
    }
    vertex = arena_alloc(arena, box->nvertex, sizeof *vertex);
    if (!vertex) {
        return NULL;
    }
    for (size_t v = 0; v < box->nvertex; ++v) {
        memcpy(vertex[v], box->vertex[v], sizeof vertex[v]);
        if (vertex[v][2] > 0.0499) {
            vertex[v][2] += 0.004 * sin(42 * vertex[v][0]) * cos(42 * vertex[v][1]);
        }
    }
    *mesh = *box;
    mesh->name = "terrain";
    mesh->vertex = (const double(*)[3])vertex;
    return mesh;
}

static void five_bodies(struct bench *bench)
{
    struct scene *s = add_scene(bench, "five bodies of the paper", BODIES);
    const double top = 0.475;

    add_surface(s, -1, CONTACT_HALF_SPACE, &ground_material);
    add_mesh(s, 0, bench->foot, &foot_material);
    add_mesh(s, 1, bench->foot, &foot_material);
    add_box(s, -1, 0.2, 0.3, 0.02, 1, &box_material)->position[2] = top - 0.02;
    add_box(s, 2, 0.075, 0.075, 0.075, 7, &box_material);
    add_surface(s, 3, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_surface(s, 4, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_pair(s, 0, 1);
    add_pair(s, 0, 2);
    add_pair(s, 3, 4);
    add_pair(s, 4, 5);
    add_pair(s, 4, 6);
    place(s, 0, 0, -0.0726, 0.0932 - 5e-4);
    place(s, 1, 0, 0.0726, 0.0932 - 5e-4);
    place(s, 2, 0.013, -0.021, top + 0.075 - 5e-4);
    place(s, 3, 0.02, -0.021 - 0.075 - 0.02 + 1.3e-2, top + 0.09);
    place(s, 4, 0.02, -0.021 + 0.075 + 0.02 - 1.3e-2, top + 0.09);
}

static enum error_code make_scenes(struct bench *bench, struct error *error)
{
    static const int cells[] = {3, 9, 29, 91};
    struct scene *s = add_scene(bench, "foot on half-space", 1);

    add_surface(s, -1, CONTACT_HALF_SPACE, &ground_material);
    add_mesh(s, 0, bench->foot, &foot_material);
    add_pair(s, 0, 1);
    place(s, 0, 0, 0, 0.0932 - 5e-4);

    s = add_scene(bench, "box on half-space", 1);
    add_surface(s, -1, CONTACT_HALF_SPACE, &box_material);
    add_box(s, 0, 0.075, 0.075, 0.075, 7, &box_material);
    add_pair(s, 0, 1);
    place(s, 0, 0, 0, 0.075 - 5e-4);

    s = add_scene(bench, "box on table", 1);
    add_box(s, -1, 0.2, 0.3, 0.02, 1, &box_material);
    add_box(s, 0, 0.075, 0.075, 0.075, 7, &box_material);
    add_pair(s, 0, 1);
    place(s, 0, 0.013, -0.021, 0.095 - 5e-4);

    s = add_scene(bench, "sphere on box", 1);
    add_box(s, -1, 0.075, 0.075, 0.075, 7, &box_material);
    add_surface(s, 0, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_pair(s, 0, 1);
    place(s, 0, 0.01, -0.02, 0.095 - 1e-3);

    five_bodies(bench);

    for (size_t i = 0; i < sizeof cells / sizeof *cells; ++i) {
        const struct mesh *terrain = make_terrain(&bench->arena, cells[i], error);

        if (!terrain) {
            return error_set(error, ERROR_MEMORY, "no memory for a terrain");
        }
        s = add_scene(bench, "foot on terrain", 1);
        add_mesh(s, -1, terrain, &ground_material);
        add_mesh(s, 0, bench->foot, &foot_material);
        add_pair(s, 0, 1);
        place(s, 0, 0, 0, 0.0535 + 0.0932 - 5e-4);
    }
    return ERROR_NONE;
}

static enum error_code prepare(struct bench *bench, struct error *error)
{
    uint64_t seed = 7;

    for (size_t i = 0; i < bench->nscene; ++i) {
        struct scene *s = &bench->scene[i];
        enum error_code code =
            contact_native_create(&s->config, &bench->arena, &s->world[0], error);

        if (!code) {
            code = contact_simbody_create(&s->config, &s->world[1], error);
        }
        if (code) {
            return code;
        }
        for (int e = 0; e < ENGINES; ++e) {
            s->us[e] = arena_alloc(&bench->arena, bench->rounds, sizeof *s->us[e]);
            if (!s->us[e]) {
                return error_set(error, ERROR_MEMORY, "no memory for %zu rounds", bench->rounds);
            }
        }
        for (int pose = 0; pose < POSES; ++pose) {
            draw_motion(s, &seed, s->motion[pose]);
        }
    }
    return ERROR_NONE;
}

/* ---- measuring ---- */

static double now_us(void)
{
    struct timespec now;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

/* Every pose, a few times; the time of one evaluation. */
static double measure(const struct scene *s, int engine)
{
    struct contact_world *world = s->world[engine];
    struct contact_wrench wrench[BODIES];
    const int repeat = engine == 0 ? 20 : 1;
    double start = now_us();

    for (int i = 0; i < repeat * POSES; ++i) {
        if (world->ops->evaluate(world, s->motion[i % POSES], wrench)) {
            return (double)NAN;
        }
    }
    return (now_us() - start) / (repeat * POSES);
}

static void run_rounds(struct bench *bench)
{
    for (size_t round = 0; round < bench->rounds; ++round) {
        for (size_t i = 0; i < bench->nscene; ++i) {
            for (int e = 0; e < ENGINES; ++e) {
                bench->scene[i].us[e][round] = measure(&bench->scene[i], e);
            }
        }
        bench_progress("bench contact", round + 1, bench->rounds);
    }
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double median(double *value, size_t n)
{
    qsort(value, n, sizeof *value, compare);
    return value[n / 2];
}

static void print_rounds(struct bench *bench)
{
    printf("microseconds of CPU an evaluation, median of %zu interleaved rounds of %d poses\n\n",
           bench->rounds, POSES);
    printf("%-26s %9s", "scene", "triangles");
    for (int e = 0; e < ENGINES; ++e) {
        printf(" %10s", engine_name[e]);
    }
    printf(" %8s %8s\n", "ratio", "force N");
    for (size_t i = 0; i < bench->nscene; ++i) {
        struct scene *s = &bench->scene[i];
        struct contact_wrench wrench[BODIES];
        double us[ENGINES], force = 0;

        for (int e = 0; e < ENGINES; ++e) {
            us[e] = median(s->us[e], bench->rounds);
        }
        s->world[0]->ops->evaluate(s->world[0], s->motion[0], wrench);
        for (size_t b = 0; b < s->config.nbody; ++b) {
            force += wrench[b].force[2];
        }
        printf("%-26s %9zu %10.3f %10.2f %8.1f %8.3g\n", s->name, s->faces, us[0], us[1],
               us[1] / us[0], force);
    }
}

/* Times the native engine once a pose, the fastest of three so that an interrupt is not taken for
 * work; us gets them all. */
static void time_random(const struct scene *s, size_t n, double *us)
{
    uint64_t seed = 1000003;

    for (size_t i = 0; i < n; ++i) {
        struct contact_motion motion[BODIES];
        struct contact_wrench wrench[BODIES];

        draw_motion(s, &seed, motion);
        us[i] = HUGE_VAL;
        for (int again = 0; again < 3; ++again) {
            struct timespec start, end;
            double took;

            clock_gettime(CLOCK_MONOTONIC, &start);
            s->world[0]->ops->evaluate(s->world[0], motion, wrench);
            clock_gettime(CLOCK_MONOTONIC, &end);
            took = 1e6 * (double)(end.tv_sec - start.tv_sec) +
                   1e-3 * (double)(end.tv_nsec - start.tv_nsec);
            us[i] = took < us[i] ? took : us[i];
        }
    }
}

static enum error_code run_random(struct bench *bench, struct error *error)
{
    size_t n = (size_t)bench->random;
    double *us = malloc(n * sizeof *us);

    if (!us) {
        return error_set(error, ERROR_MEMORY, "no memory for %zu times", n);
    }
    printf("\nnative, microseconds of %zu random poses, each the fastest of three, clock included\n"
           "\n%-26s %9s %8s %8s %8s %8s %8s\n",
           n, "scene", "triangles", "median", "99 %", "99.9 %", "worst", "ratio");
    for (size_t i = 0; i < bench->nscene; ++i) {
        const struct scene *s = &bench->scene[i];

        time_random(s, n, us);
        qsort(us, n, sizeof *us, compare);
        printf("%-26s %9zu %8.3f %8.3f %8.3f %8.3f %8.1f\n", s->name, s->faces, us[n / 2],
               us[n - 1 - n / 100], us[n - 1 - n / 1000], us[n - 1], us[n - 1] / us[n / 2]);
        bench_progress("bench contact, random poses", i + 1, bench->nscene);
    }
    free(us);
    return ERROR_NONE;
}

static enum error_code run(struct bench *bench, const char *foot, struct error *error)
{
    enum error_code code = mesh_read_obj(foot, &bench->arena, &bench->foot, error);

    if (!code) {
        code = make_scenes(bench, error);
    }
    if (!code) {
        code = prepare(bench, error);
    }
    if (!code) {
        run_rounds(bench);
        print_rounds(bench);
        code = bench->random > 0 ? run_random(bench, error) : ERROR_NONE;
    }
    for (size_t i = 0; i < bench->nscene; ++i) {
        struct contact_world *simbody = bench->scene[i].world[1];

        if (simbody) {
            simbody->ops->destroy(simbody);
        }
    }
    return code;
}

int bench_contact(int argc, char **argv)
{
    static int64_t rounds = 200;
    static bool quick;
    static const char *foot;
    static struct bench bench;
    static const struct option_spec options[] = {
        {"--rounds", OPTION_INT, "N", "interleaved rounds (200)", &rounds, .min = 1, .max = 100000},
        {"--random", OPTION_INT, "N", "also time N random poses, native only (0)", &bench.random,
         .min = 0, .max = 10000000},
        {"--quick", OPTION_FLAG, NULL, "a few rounds, to see that it works", &quick, .min = 0},
    };
    static const struct operand_spec operands[] = {
        {"FOOT", "the foot's mesh (config/meshes/coman-foot-right.obj)", false, &foot},
    };
    static const struct command_spec spec = {
        .name = "bench contact",
        .summary = "Time the contact engines on the pairs of surfaces that a robot meets.",
        .option = options,
        .noption = sizeof options / sizeof *options,
        .operand = operands,
        .noperand = 1,
        .manual =
            "Feet and box are meshes of 504 and 588 triangles, the table is one of 12, wrists "
            "are spheres of 2 cm. The last rows are one foot on bumpy ground of more and more "
            "triangles. Both engines get the same poses, a round of one after a round of the "
            "other; the native one integrates over the true overlap, Simbody over triangles.",
    };
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    bench.rounds = quick ? QUICK_ROUNDS : (size_t)rounds;
    code = arena_init(&bench.arena, ARENA_BYTES, &error);
    if (!code) {
        code = run(&bench, foot ? foot : "config/meshes/coman-foot-right.obj", &error);
        arena_fini(&bench.arena);
    }
    return code ? command_fail("bench contact", &error) : STATUS_OK;
}
