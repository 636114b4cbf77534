/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil test: scenarios, their verdicts, and the files that tell of them. */
#include "base/text.h"
#include "rt/clock.h"
#include "app/cli/commands.h"
#include "base/options.h"
#include "app/scenario/jobs.h"
#include "app/scenario/private.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MEMORY ((size_t)1 << 30) /* of address space */

struct test_options {
    const char **file; /* NULL ends */
    const char *shard, *junit, *output;
    int64_t jobs, seed;
    bool mutate, merge, list;
};

/* Everything that is to be run, and what came out of it. */
struct plan {
    struct arena arena;
    size_t njob, ncase;
    struct scenario_job *job;
    size_t nresult;
    struct scenario_result *result;
    size_t passed, failed, broken;
};

/* %s: the kinds of signals */
static const char manual_format[] =
    "A scenario is a YAML file; config/scenarios holds those that come with the program. name, "
    "description, rig (a file relative to it); clock: free (the default) or lockstep; hold, wire, "
    "settle and seed as of run; duration_s, clean_up_s, wall_limit_s (60); host: enabled brings "
    "the "
    "boards up, or task: NAME leads them, or neither; faults: lines as of run --fault.\n\n"
    "stimuli, a list, each at_s seconds after a label (after: start, the default; ready, when all "
    "motors are on; or another stimulus's label), for for_s seconds: frame {bus, id, data, copies, "
    "extended, fd, remote}, again every_s; voltage {joint, volts}, refreshed every_s (0.01); motor "
    "{joint or "
    "all, on}; push {body, force_n, moment_nm}; fault: a line without times; silence: true, the "
    "host "
    "sends nothing; or a label alone. clean_up is a list of them after duration_s.\n\n"
    "expectations, a list, each with a name and a window of from_s to to_s (or within_s after "
    "from_s) "
    "after a label: signal with between [LOW, HIGH] all the time or reaches [LOW, HIGH] once, "
    "relative: true to its value when the window opens; frame {bus, id, id_mask, data with x for "
    "any "
    "digit} or event (a part of a line of the log), seen at least once, never: true, or count "
    "[LEAST, "
    "MOST]; of a frame also period_s [LEAST, MOST] between two.\n\n"
    "parameters: {NAME: {values: [...]}} stand as ${NAME} anywhere else; the scenario is run with "
    "every "
    "combination of them.\n\n"
    "mutations, a list of {name, fault: LINE or without: LABEL, fails: [NAME...]}: what would make "
    "the "
    "scenario fail, and which expectations then must. --mutate runs them too, and complains when a "
    "scenario does not notice, or has an expectation that no mutation makes fail.\n\n"
    "A run that fails is made again with the recorder on: DIR/NAME then holds candump.log, "
    "signals.csv "
    "and a plot of each expectation that was not met.\n\n"
    "--shard I/N takes every N-th case from the I-th, for the jobs of a matrix or an array (I = "
    "SLURM_ARRAY_TASK_ID); each writes --junit, and --merge puts those files together.\n\n"
    "Signals:\n%s";

static char manual[8192];

static void write_manual(void)
{
    const char *const *line = scenario_signal_help();
    char signals[2048] = "";
    size_t used = 0;

    for (; *line && used < sizeof signals; line++) {
        used += (size_t)snprintf(signals + used, sizeof signals - used, "%s\n", *line);
    }
    snprintf(manual, sizeof manual, manual_format, signals);
}

static bool parse(int argc, char **argv, struct test_options *out, int *status)
{
    static struct test_options o;
    static const struct option_spec options[] = {
        {"--jobs", OPTION_INT, "N", "runs at a time; as many as there are processors by default",
         .value = &o.jobs, .min = 1.0, .max = 256.0},
        {"--mutate", OPTION_FLAG, NULL,
         "also run every mutation, which has to make its scenario fail", .value = &o.mutate},
        {"--shard", OPTION_STRING, "I/N", "only the I-th of N parts of the cases, from 1",
         .value = &o.shard},
        {"--seed", OPTION_INT, "N", "of noise and faults, instead of the scenarios' own",
         .value = &o.seed, .min = 0.0, .max = 9e15},
        {"--output", OPTION_STRING, "DIR",
         "where recordings and plots of what fails go; test-results by default",
         .value = &o.output},
        {"--junit", OPTION_STRING, "FILE", "write the results as JUnit XML", .value = &o.junit},
        {"--merge", OPTION_FLAG, NULL,
         "run nothing: put the JUnit files that are given into the one of --junit",
         .value = &o.merge},
        {"--list", OPTION_FLAG, NULL, "run nothing: list the cases", .value = &o.list},
    };
    static struct operand_spec operands[] = {
        {.name = "FILE", .help = "scenarios; with --merge, JUnit files", .required = true}};
    static const struct command_spec spec = {
        .name = "test",
        .summary = "Run scenarios: tests of a rig with a verdict.",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 1,
        .many = true,
        .manual = manual,
    };

    write_manual();
    o = (struct test_options){.seed = -1, .output = "test-results"};
    o.file = calloc((size_t)argc + 1, sizeof *o.file);
    if (!o.file) {
        struct error error;

        error_set(&error, ERROR_MEMORY, "no memory left for the command line");
        *status = command_fail("test", &error);
        return false;
    }
    operands[0].value = o.file;
    if (!options_read(&spec, argc, argv, status)) {
        free(o.file);
        return false;
    }
    *out = o;
    return true;
}

/* ---- what is to be run ---- */

static enum error_code parse_shard(const char *text, int64_t shard[2], struct error *error)
{
    const char *slash = text ? strchr(text, '/') : NULL;
    char first[32];

    shard[0] = shard[1] = 1;
    if (!text) {
        return ERROR_NONE;
    }
    snprintf(first, sizeof first, "%.*s", slash ? (int)(slash - text) : 0, text);
    if (!slash || !text_to_int(slash + 1, 1, 1000000, &shard[1]) ||
        !text_to_int(first, 1, shard[1], &shard[0])) {
        return error_set(error, ERROR_INPUT,
                         "--shard: found \"%.60s\", expected I/N with I from 1 to N, as in 2/8",
                         text);
    }
    return ERROR_NONE;
}

/* Directories of one name would be written over each other. */
static enum error_code check_names(struct scenario *const *scenario, size_t count,
                                   struct error *error)
{
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < i; k++) {
            if (strcmp(scenario[i]->name, scenario[k]->name) == 0) {
                return yaml_error(
                    error, &scenario[i]->mark,
                    "found scenario \"%s\", which is in %.200s too, expected a name of its "
                    "own",
                    scenario[i]->name, scenario[k]->file);
            }
        }
    }
    return ERROR_NONE;
}

/* What the scenario names has to be in its rig. Parameters are numbers: one case speaks for all. */
static enum error_code check_rig(struct scenario *scenario, struct error *error)
{
    const struct rig *rig;
    struct arena arena;
    enum error_code code = arena_init(&arena, MEMORY, error);

    if (code) {
        return code;
    }
    code = rig_load(scenario->rig_path, &arena, &rig, error);
    if (!code) {
        code = scenario_bind(scenario, rig, error);
    }
    arena_fini(&arena);
    return code;
}

static void add_jobs(struct plan *plan, struct scenario *scenario, size_t number, size_t count,
                     const struct test_options *options)
{
    for (int m = -1; m < (options->mutate ? (int)scenario->nmutation : 0); m++) {
        struct scenario_job *job = &plan->job[plan->njob++];
        int used;

        job->scenario = scenario;
        job->mutation = m;
        if (m < 0) {
            used =
                snprintf(job->record, sizeof job->record, "%s/%s", options->output, scenario->name);
            if (count > 1 && used > 0 && (size_t)used < sizeof job->record) {
                snprintf(job->record + used, sizeof job->record - (size_t)used, "-%zu", number + 1);
            }
        }
    }
}

static enum error_code make_plan(struct plan *plan, const struct test_options *options,
                                 struct error *error)
{
    size_t nfile = 0, number = 0, most = 0;
    struct scenario **first, **cases;
    size_t *ncases;
    int64_t shard[2];
    enum error_code code = parse_shard(options->shard, shard, error);

    while (options->file[nfile]) {
        nfile++;
    }
    first = cases = arena_alloc(&plan->arena, nfile, sizeof *cases);
    ncases = arena_alloc(&plan->arena, nfile, sizeof *ncases);
    if (!cases || !ncases) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu scenarios", nfile);
    }
    for (size_t f = 0; f < nfile && !code; f++) {
        code = scenario_read(options->file[f], &plan->arena, &cases[f], &ncases[f], error);
        code = code ? code : check_rig(cases[f], error);
        most += code ? 0 : ncases[f] * (1 + cases[f]->nmutation);
        number += code ? 0 : ncases[f];
    }
    code = code ? code : check_names(first, nfile, error);
    if (code) {
        return code;
    }
    plan->job = arena_alloc(&plan->arena, most, sizeof *plan->job);
    plan->result = arena_alloc(&plan->arena, most + number, sizeof *plan->result);
    if (!plan->job || !plan->result) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu runs", most);
    }
    number = 0;
    for (size_t f = 0; f < nfile; f++) {
        for (size_t i = 0; i < ncases[f]; i++) {
            if ((int64_t)(number++ % (size_t)shard[1]) == shard[0] - 1) {
                add_jobs(plan, &cases[f][i], i, ncases[f], options);
                plan->ncase++;
            }
        }
    }
    return ERROR_NONE;
}

/* ---- what came out ---- */

static void print_result(struct plan *plan, const struct scenario_result *result)
{
    static const char *const word[] = {"ok    ", "FAIL  ", "ERROR "};

    plan->passed += result->status == SCENARIO_PASSED;
    plan->failed += result->status == SCENARIO_FAILED;
    plan->broken += result->status == SCENARIO_BROKEN;
    printf("%s%s", word[result->status], result->name);
    if (result->ran) {
        printf("  %.2f s", result->seconds);
    }
    putchar('\n');
    for (const char *line = result->message; *line;) {
        int length = (int)strcspn(line, "\n");

        printf("      %.*s\n", length, line);
        line += length + (line[length] == '\n');
    }
    if (result->record[0]) {
        printf("      recording and plots: %s\n", result->record);
    }
    fflush(stdout);
}

static void on_end(void *context, const struct scenario_job *job)
{
    struct plan *plan = context;
    struct scenario_result *result = &plan->result[plan->nresult++];

    scenario_judge(job, result);
    print_result(plan, result);
}

static void judge_mutations(struct plan *plan)
{
    for (size_t from = 0, to = 0; from < plan->njob; from = to) {
        struct scenario_result *result = &plan->result[plan->nresult++];

        for (to = from; to < plan->njob && plan->job[to].scenario == plan->job[from].scenario;
             to++) {
        }
        scenario_judge_mutations(plan->job + from, to - from, result);
        print_result(plan, result);
    }
}

static void list(const struct plan *plan)
{
    for (size_t i = 0; i < plan->njob; i++) {
        const struct scenario *scenario = plan->job[i].scenario;
        int mutation = plan->job[i].mutation;

        if (mutation < 0) {
            printf("%s%s%s: %s\n", scenario->name, scenario->values[0] ? " " : "", scenario->values,
                   scenario->description);
        } else {
            printf("  mutation %s\n", scenario->mutation[mutation].name);
        }
    }
}

static int run_plan(struct plan *plan, const struct test_options *options)
{
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    struct scenario_jobs_options jobs = {
        .parallel = options->jobs    ? (size_t)options->jobs
                    : processors > 0 ? (size_t)processors
                                     : 1,
        .seed_given = options->seed >= 0,
        .seed = (uint64_t)options->seed,
        .ended = on_end,
        .context = plan,
    };
    struct clock *time = clock_monotonic();
    int64_t begin = clock_now(time);
    struct error error;

    if (scenario_jobs_run(plan->job, plan->njob, &jobs, &error)) {
        return command_fail("test", &error);
    }
    if (options->mutate) {
        judge_mutations(plan);
    }
    printf("%zu cases in %zu runs: %zu passed, %zu failed, %zu did not run; %.1f s\n", plan->ncase,
           plan->njob, plan->passed, plan->failed, plan->broken,
           (double)(clock_now(time) - begin) * 1e-9);
    if (options->junit &&
        scenario_junit_write(options->junit, plan->result, plan->nresult, &error)) {
        return command_fail("test", &error);
    }
    return plan->failed + plan->broken ? STATUS_FAILED : STATUS_OK;
}

static int merge(const struct test_options *options)
{
    size_t count = 0, tests, failed;
    struct error error;

    while (options->file[count]) {
        count++;
    }
    if (!options->junit) {
        error_set(&error, ERROR_INPUT, "found --merge without --junit, expected the file to write");
        return command_fail("test", &error);
    }
    if (scenario_junit_merge(options->file, count, options->junit, &tests, &failed, &error)) {
        return command_fail("test", &error);
    }
    printf("%zu results of %zu files, %zu failed\n", tests, count, failed);
    return failed ? STATUS_FAILED : STATUS_OK;
}

static int test(const struct test_options *options)
{
    struct plan plan = {.njob = 0};
    struct error error;
    int status;

    if (arena_init(&plan.arena, MEMORY, &error)) {
        return command_fail("test", &error);
    }
    if (make_plan(&plan, options, &error)) {
        status = command_fail("test", &error);
    } else if (options->list) {
        list(&plan);
        status = STATUS_OK;
    } else {
        status = run_plan(&plan, options);
    }
    arena_fini(&plan.arena);
    return status;
}

int cmd_test(int argc, char **argv)
{
    struct test_options options;
    int status;

    if (!parse(argc, argv, &options, &status)) {
        return status;
    }
    status = options.merge ? merge(&options) : test(&options);
    free(options.file);
    return status;
}
