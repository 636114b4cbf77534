/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench dynamics: measures the CPU time of a robot's generalized accelerations by number
 * of degrees of freedom. Our implementations and other simulators run interleaved (the paper's
 * section 3.2 and Fig. 4).
 */
#include "app/bench/bench.h"

#include "base/options.h"
#include "manual/dynamics.h"
#include "manual/peers.h"
#include "model/symbolic/symbolic.h"
#include "base/config.h"

#include <stdlib.h>
#include <string.h>

#define BATCH_NS 200000.0 /* duration of one measurement, much longer than reading the clock */

enum { ROUNDS_MAX = 100000 };

/* Number of joints of parts of COMAN: waist and one leg; both legs; both legs and torso. The last
 * size is the whole robot. */
static const size_t part_joints[DYNAMICS_SIZES - 1] = {6, 12, 15};

/* Measures the CPU time of one evaluation, ns. */
static double dynamics_bench_time_cell(const struct peer_dynamics *peer,
                                       const struct dynamics_cell *cell)
{
    double start = bench_cpu_s();

    for (size_t n = 0; n < cell->repeat; n++) {
        for (size_t slot = 0; slot < PEER_SLOTS; slot++) {
            peer->run(cell->engine, slot);
        }
    }
    return 1e9 * (bench_cpu_s() - start) / (double)(cell->repeat * PEER_SLOTS);
}

/* Makes a robot of each size: the parts of the robot, then the whole. */
static enum error_code take_sizes(struct dynamics_bench *bench, const struct robot *whole,
                                  struct arena *arena, struct error *error)
{
    const size_t parts = bench->whole_only ? 0 : DYNAMICS_SIZES - 1;
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; !code && i < parts && part_joints[i] < whole->njoint; i++) {
        code = bench_part(whole, part_joints[i], arena, &bench->robot[bench->nsize++], error);
    }
    bench->robot[bench->nsize++] = whole;
    return code;
}

/* Creates an engine for a size and stores the states in it. Compares it with the first engine, and
 * finds how many times a measurement must repeat all states. */
static enum error_code create_cell(struct dynamics_bench *bench, size_t e, size_t s,
                                   struct arena *arena, struct error *error)
{
    struct dynamics_cell *cell = &bench->cell[e][s];
    const struct peer_dynamics *peer = bench->peer[e];
    char message[512];

    cell->ns = arena_alloc(arena, bench->rounds, sizeof *cell->ns);
    if (!cell->ns) {
        return error_set(error, ERROR_MEMORY, "no memory for %zu rounds", bench->rounds);
    }
    cell->engine = peer->create(bench->robot[s], message, sizeof message);
    if (!cell->engine) {
        return error_set(error, ERROR_UNSUPPORTED, "%s with %zu degrees of freedom: %s", peer->name,
                         bench->robot[s]->nv, message);
    }
    bench_put_states(peer, cell->engine, bench->robot[s]);
    cell->difference = bench_difference(peer, cell->engine, bench->peer[0],
                                        bench->cell[0][s].engine, bench->robot[s]->nv, NULL);
    cell->repeat = 1;
    cell->repeat = 1 + (size_t)(BATCH_NS / (dynamics_bench_time_cell(peer, cell) * PEER_SLOTS));
    return ERROR_NONE;
}

size_t dynamics_bench_reference(const struct dynamics_bench *bench)
{
    for (size_t e = 0; e < bench->nengine; e++) {
        if (!strcmp(bench->peer[e]->name, "Simbody")) {
            return e;
        }
    }
    return 0;
}

/* Prints one row per engine, the operation count of the generated code, and the paper's numbers. */
static void dynamics_bench_print_table(const struct dynamics_bench *bench)
{
    const size_t last = bench->nsize - 1, reference = dynamics_bench_reference(bench);
    const struct dynamics_module *module = symbolic_builtin(bench->robot[last]);

    printf("Generalized accelerations of %s, us of CPU time an evaluation, medians of %zu "
           "interleaved rounds\n\n%-34s",
           bench->robot[last]->name, bench->rounds, "degrees of freedom");
    for (size_t s = 0; s < bench->nsize; s++) {
        printf(" %9zu", bench->robot[s]->nv);
    }
    printf(" %9s %9s  difference\n", "a freedom", "speed");
    for (size_t e = 0; e < bench->nengine; e++) {
        const struct dynamics_cell *cell = bench->cell[e];

        printf("%-10s %-23s", bench->peer[e]->name, bench->peer[e]->version);
        for (size_t s = 0; s < bench->nsize; s++) {
            printf(" %9.3f", cell[s].median);
        }
        printf(" %9.4f %9.3f %11.1e\n", bench->slope[e],
               bench->cell[reference][last].median / cell[last].median, cell[last].difference);
    }
    printf("a freedom: slope over the sizes; speed: of the whole robot, times %s's; difference: "
           "average, relative\n",
           bench->peer[reference]->name);
    if (module) {
        printf("\nThe generated code of %zu freedoms takes %u floating-point operations, %s lanes "
               "counted each, sines and\ncosines apart.\n",
               bench->robot[last]->nv, module->operations, module->variant);
    }
    printf("\nThe paper, COMAN with 29: symbolic code 3.5 times as fast as Simbody, its slope half "
           "of Simbody's,\naverage relative difference 1.9e-13. Other simulators are measured as "
           "installed: Debian builds Simbody\nwith assertions on; rebuilt with full optimization "
           "it is about 1.8 times as fast.\n");
}

void dynamics_bench_draw(const struct dynamics_bench *bench, struct dynamics_plot *plot)
{
    plot->panel = svg_panel(plot->title, "degrees of freedom", "CPU time of one evaluation, us",
                            plot->series, bench->nengine);
    plot->panel.y.logarithmic = true;
    snprintf(plot->title, sizeof plot->title, "Generalized accelerations of %s",
             bench->robot[bench->nsize - 1]->name);
    for (size_t e = 0; e < bench->nengine; e++) {
        for (size_t s = 0; s < bench->nsize; s++) {
            plot->x[s] = (double)bench->robot[s]->nv;
            plot->y[e][s] = bench->cell[e][s].median;
        }
        plot->series[e] =
            svg_line(bench->peer[e]->name, plot->x, plot->y[e], bench->nsize, SVG_LINE_MARKERS);
    }
}

/* Writes dynamics.csv and dynamics.svg into a folder. */
static enum error_code write_files(const struct dynamics_bench *bench, const char *folder,
                                   struct error *error)
{
    struct dynamics_plot plot;
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, "dynamics.csv", error);

    if (code) {
        return code;
    }

    fprintf(file.whole.out,
            "engine,version,degrees_of_freedom,median_us,low_us,high_us,difference\n");
    for (size_t e = 0; e < bench->nengine; e++) {
        for (size_t s = 0; s < bench->nsize; s++) {
            const struct dynamics_cell *cell = &bench->cell[e][s];

            fprintf(file.whole.out, "%s,%s,%zu,%.4f,%.4f,%.4f,%.3e\n", bench->peer[e]->name,
                    bench->peer[e]->version, bench->robot[s]->nv, cell->median, cell->low,
                    cell->high, cell->difference);
        }
    }
    if ((code = whole_file_close(&file.whole, ERROR_NONE, error)) ||
        (code = report_file_open(&file, folder, "dynamics.svg", error))) {
        return code;
    }
    dynamics_bench_draw(bench, &plot);
    return whole_file_close(&file.whole, svg_write(&plot.panel, file.whole.out, error), error);
}

enum error_code dynamics_bench_run(struct dynamics_bench *bench, const char *file,
                                   const struct peers *peers, struct arena *arena,
                                   struct error *error)
{
    char path[PATH_MAX];
    const struct robot *whole;
    enum error_code code = config_locate(CONFIG_ROBOT, file, path, error);

    code = code ? code : robot_load(path, NULL, arena, &whole, error);
    if (!code && whole->nq > BENCH_NUMBERS) {
        code = error_set(error, ERROR_INPUT, "%s: found %zu coordinates, expected at most %d", file,
                         whole->nq, BENCH_NUMBERS);
    }
    code = code ? code : take_sizes(bench, whole, arena, error);

    /* List our implementations, then those of other simulators. The first one, our numeric
     * implementation, is the reference for the differences. */
    for (size_t i = 0; i < BENCH_OURS; i++) {
        bench->peer[bench->nengine++] = &bench_ours[i];
    }
    for (size_t i = 0; peers && i < peers->ndynamics && bench->nengine < DYNAMICS_ENGINES; i++) {
        bench->peer[bench->nengine++] = &peers->dynamics[i];
    }
    for (size_t e = 0; !code && e < bench->nengine; e++) {
        for (size_t s = 0; !code && s < bench->nsize; s++) {
            code = create_cell(bench, e, s, arena, error);
        }
    }
    if (!code) {
        for (size_t round = 0; round < bench->rounds; round++) {
            for (size_t s = 0; s < bench->nsize; s++) {
                for (size_t e = 0; e < bench->nengine; e++) {
                    bench->cell[e][s].ns[round] =
                        dynamics_bench_time_cell(bench->peer[e], &bench->cell[e][s]);
                }
            }
            bench_progress("dynamics", round + 1, bench->rounds);
        }

        /* Compute median and spread of each cell, us, and the least-squares slope over the
         * sizes, us per degree of freedom */
        for (size_t e = 0; e < bench->nengine; e++) {
            double n = (double)bench->nsize, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;

            for (size_t s = 0; s < bench->nsize; s++) {
                struct dynamics_cell *cell = &bench->cell[e][s];
                double x = (double)bench->robot[s]->nv;

                bench_sort(cell->ns, bench->rounds);
                cell->median = 1e-3 * cell->ns[bench->rounds / 2];
                cell->low = 1e-3 * cell->ns[bench->rounds / 10];
                cell->high = 1e-3 * cell->ns[bench->rounds - 1 - bench->rounds / 10];
                sx += x;
                sy += cell->median;
                sxx += x * x;
                sxy += x * cell->median;
            }
            bench->slope[e] = bench->nsize > 1 ? (n * sxy - sx * sy) / (n * sxx - sx * sx) : 0.0;
        }
    }
    return code;
}

void dynamics_bench_end(struct dynamics_bench *bench)
{
    for (size_t e = 0; e < bench->nengine; e++) {
        for (size_t s = 0; s < bench->nsize; s++) {
            if (bench->cell[e][s].engine) {
                bench->peer[e]->destroy(bench->cell[e][s].engine);
            }
        }
    }
}

int bench_dynamics(int argc, char **argv)
{
    static const char *file = "coman", *folder, *module;
    static int64_t rounds = 200;
    static const struct option_spec options[] = {
        {"--rounds", OPTION_INT, "N", "measurements of every engine and size, 200 by default",
         .value = &rounds, .min = 1.0, .max = ROUNDS_MAX},
        BENCH_OUT_OPTION(&folder, "dynamics.csv and dynamics.svg"),
        BENCH_PEERS_OPTION(&module),
    };
    static const struct operand_spec operands[] = {
        {"ROBOT", "a robot file or the name of a robot; coman by default", false, &file,
         .noun = "robots"}};
    static const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "dynamics",
        .summary = "CPU time of a robot's generalized accelerations by number of degrees of "
                   "freedom, the paper's Fig. 4.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_DYNAMICS "\n\n" MANUAL_PEERS,
    };
    static struct dynamics_bench bench;
    struct peers_library library;
    struct arena arena = {0};
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    bench.rounds = (size_t)rounds;
    code = bench_peers(module, "ours only", &library, &error);
    code = code ? code : arena_init(&arena, DYNAMICS_ARENA_BYTES, &error);
    code = code ? code : dynamics_bench_run(&bench, file, library.peers, &arena, &error);
    if (!code) {
        dynamics_bench_print_table(&bench);
        code = folder ? write_files(&bench, folder, &error) : ERROR_NONE;
    }
    dynamics_bench_end(&bench);
    arena_fini(&arena);
    peers_close(&library);
    return options_end(&spec, code, &error);
}
