/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench throughput: reads its options and runs its rounds. */
#include "app/bench/throughput.h"

#include "app/bench/benchmarks.h"
#include "app/bench/output.h"
#include "base/count.h"
#include "base/options.h"
#include "base/whole_file.h"
#include "manual/throughput.h"

#include <errno.h>
#include <ftw.h>
#include <limits.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Rigs that are measured by default, with their tasks. */
static const struct throughput_rig shipped[] = {
    {.rig = "coman", .task = "squat"},        {.rig = "walk-flat", .task = "walk"},
    {.rig = "walk-walkman", .task = "walk"},  {.rig = "grasp", .task = "grasp"},
    {.rig = "coman-cia402", .task = "squat"}, {.rig = "coman-compact", .task = "squat"},
    {.rig = "coman-foc", .task = "squat"},    {.rig = "hyq", .task = "hold"},
};

/* The command line. */
struct throughput_command {
    const char *task, *peers, *file;
    const char **rig;
    int64_t rounds;
};

/* Finds coman-hil beside this program: its name without "-bench". */
static enum error_code throughput_find_program(char path[PATH_MAX], struct error *error)
{
    static const char end[] = "-bench";
    ssize_t length = readlink("/proc/self/exe", path, PATH_MAX - 1);
    size_t rest = length < 0 ? 0 : (size_t)length - strlen(end);

    if (length <= (ssize_t)strlen(end) || strncmp(path + rest, end, strlen(end)) != 0) {
        return error_set(error, ERROR_UNSUPPORTED, "cannot tell where coman-hil is");
    }
    path[rest] = '\0';
    return access(path, X_OK) ? error_set_file(error, errno, path, "cannot be run") : ERROR_NONE;
}

/* Chooses the rigs that were named, or the shipped ones, and reads their files. */
static enum error_code throughput_choose_rigs(const struct throughput_command *options,
                                              struct throughput *all, struct error *error)
{
    if (!options->rig[0]) {
        memcpy(all->rig, shipped, sizeof shipped);
        all->nrig = ARRAY_COUNT(shipped);
    }
    for (; options->rig[all->nrig] && options->rig[0]; all->nrig++) {
        struct throughput_rig *rig = &all->rig[all->nrig];

        if (all->nrig == THROUGHPUT_RIGS) {
            return error_set(error, ERROR_INPUT, "found more rigs than %d", THROUGHPUT_RIGS);
        }
        rig->rig = options->rig[all->nrig];
        for (size_t i = 0; i < ARRAY_COUNT(shipped); i++) {
            rig->task = strcmp(rig->rig, shipped[i].rig) == 0 ? shipped[i].task : rig->task;
        }
    }

    /* --task goes before the list's task, and that before the one of the rig's file */
    for (size_t i = 0; i < all->nrig; i++) {
        enum error_code code;

        all->rig[i].task = options->task ? options->task : all->rig[i].task;
        if ((code = throughput_read_rig(&all->rig[i], error))) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* Removes an entry of a folder; called by nftw from the bottom up. */
static int throughput_remove_entry(const char *path, const struct stat *status, int kind,
                                   struct FTW *where)
{
    (void)status;
    (void)kind;
    (void)where;
    return remove(path);
}

/* Runs all rounds, the rigs in turn, each in a folder of its own below a scratch folder. */
static enum error_code throughput_run_rounds(const struct throughput_command *options,
                                             struct throughput *all, struct error *error)
{
    const char *parent = getenv("TMPDIR");
    char program[PATH_MAX], scratch[PATH_MAX], folder[PATH_MAX + 32];
    enum error_code code = throughput_find_program(program, error);

    if (code) {
        return code;
    }
    snprintf(scratch, sizeof scratch, "%.4000s/coman-hil-XXXXXX", parent ? parent : "/tmp");
    if (!mkdtemp(scratch)) {
        return error_set_file(error, errno, scratch, "cannot be made");
    }
    for (size_t n = 0; !code && n < all->rounds * all->nrig; n++) {
        struct throughput_rig *rig = &all->rig[n % all->nrig];

        snprintf(folder, sizeof folder, "%s/%zu", scratch, n % all->nrig);
        if (mkdir(folder, 0700) && errno != EEXIST) {
            code = error_set_file(error, errno, folder, "cannot be made");
            break;
        }
        code = throughput_measure(all, rig, program, folder, options->peers,
                                  &rig->sample[n / all->nrig], error);
        bench_progress("throughput", n + 1, all->rounds * all->nrig);
    }
    nftw(scratch, throughput_remove_entry, 8, FTW_DEPTH | FTW_PHYS);
    return code;
}

/* Measures everything, prints the tables and writes the JSON. */
static enum error_code throughput_report(const struct throughput_command *options,
                                         struct throughput *all, struct error *error)
{
    static char version[32];
    struct whole_file file;
    enum error_code code;

    if ((code = throughput_choose_rigs(options, all, error)) ||
        (code = throughput_find_mujoco(options->peers, version, error))) {
        return code;
    }
    all->mujoco = version[0] ? version : NULL;
    if ((code = throughput_run_rounds(options, all, error))) {
        return code;
    }
    throughput_print(all, stdout);
    if (options->file && !(code = whole_file_open(&file, options->file, error))) {
        throughput_write_json(all, file.out);
        code = whole_file_close(&file, ERROR_NONE, error);
    }
    return code;
}

int bench_throughput(int argc, char **argv)
{
    static struct throughput_command o = {.rounds = 5};
    static struct throughput all = {.seconds = 3.0};
    static const struct option_spec options[] = {
        {"--rounds", OPTION_INT, "N", "measurements of each, 5 by default", .value = &o.rounds,
         .min = 1, .max = THROUGHPUT_ROUNDS},
        {"--seconds", OPTION_REAL, "S", "simulated time of a case, 3 by default",
         .value = &all.seconds, .min = 0.1, .max = 1000.0, .unit = "seconds"},
        {"--task", OPTION_STRING, "TASK",
         "of all rigs; by default that of the list below, else what the rig's file is for",
         .value = &o.task},
        BENCH_PEERS_OPTION(&o.peers),
        {"--output", OPTION_STRING, "FILE", "write all figures into this file, as JSON",
         .value = &o.file, .letter = "-o"},
    };
    struct operand_spec operand = {"RIG", "rigs' files or names; without them the list below",
                                   .noun = "rigs"};
    const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "throughput",
        .summary = "Simulated seconds that a sweep gets out of a processor in an hour.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = &operand,
        .noperand = 1,
        .many = true,
        .manual = MANUAL_THROUGHPUT,
    };
    struct error error;
    enum error_code code;
    int status;

    /* Room for as many rigs as there are words */
    o.rig = calloc((size_t)argc + 1, sizeof *o.rig);
    if (!o.rig) {
        code = error_set(&error, ERROR_MEMORY, "no memory left for the command line");
        return options_end(&spec, code, &error);
    }
    operand.value = o.rig;
    if (!options_read(&spec, argc, argv, &status)) {
        free(o.rig);
        return status;
    }
    all.rounds = (size_t)o.rounds;
    code = throughput_report(&o, &all, &error);
    free(o.rig);
    return options_end(&spec, code, &error);
}
