/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil test: runs scenarios, and writes their verdicts, recordings and JUnit results. */
#include "app/cli/cli.h"
#include "app/scenario/jobs.h"
#include "app/scenario/scenario.h"
#include "app/sweep/plan.h"
#include "base/config.h"
#include "base/input_file.h"
#include "base/whole_file.h"
#include "manual/test.h"

#include <stdlib.h>
#include <unistd.h>

enum { LINES_MAX = 1000 }; /* number of lines in which to look for the key scenarios of a sweep */

/* Reserved address space, bytes. */
#define MEMORY ((size_t)1 << 30)

static const char *test_plan_describe(const char *path)
{
    const char *wanted = NULL;
    char line[256];
    FILE *file;

    input_file_stream(path, &file, NULL);
    for (int i = 0; i < LINES_MAX && file && !wanted && fgets(line, sizeof line, file); i++) {
        if (i == 0 && !strncmp(line, "{\"plan\":", 8)) {
            wanted = "a plan: --case CASES runs cases of it, --merge writes their results";
        } else if (!strncmp(line, "scenarios:", 10)) {
            wanted =
                "a sweep: --plan with --output PLAN makes its plan, of which --case runs cases";
        }
    }
    if (file) {
        fclose(file);
    }
    return wanted;
}

static int test_plan_sweep(const char *sweep, const char *output)
{
    struct error error;
    size_t count = 0;

    if (!output) {
        error_set(&error, ERROR_INPUT, "found --plan without --output, expected the plan to write");
        return command_fail("test", &error);
    }
    if (plan_write(sweep, output, &count, &error)) {
        return command_fail("test", &error);
    }
    printf("%zu cases\n", count);
    return STATUS_OK;
}

/* Parses K or FIRST-LAST, from 1. */
static enum error_code test_read_range(const char *text, size_t range[2], struct error *error)
{
    const char *at = text;

    for (int i = 0; i < 2; i++) {
        char *end = NULL;

        range[i] = *at >= '1' && *at <= '9' ? strtoul(at, &end, 10) : 0;
        if (range[i] < 1 || range[i] > SWEEP_CASES_MAX || range[i] < range[0] ||
            (*end && (i || *end != '-'))) {
            return error_set(
                error, ERROR_INPUT,
                "--case: found \"%.40s\", expected a number or two as 1-500, each from 1 to %d",
                text, SWEEP_CASES_MAX);
        }
        at = *end ? end + 1 : at; /* one number is both first and last */
    }
    return ERROR_NONE;
}

/* Prints the verdict of a case, or the reason why it has none. */
static void test_case_ended(void *context, const struct plan_case *one,
                            const struct plan_result *result, const struct error *why)
{
    int *status = context;

    if (!result) {
        *status = command_fail("test", why);
        return;
    }
    printf("case %zu %s%s%s\n", one->number, plan_status_word[result->status],
           *result->message ? ": " : "", result->message);
    fflush(stdout);
}

static int test_plan_cases(const char *path, const char *cases, size_t parallel, const char *output)
{
    int status = STATUS_OK;
    const struct plan_run_options options = {
        .parallel = parallel, .record = output, .ended = test_case_ended, .context = &status};
    struct plan plan;
    struct arena arena;
    struct error error;
    size_t range[2];
    enum error_code code = test_read_range(cases, range, &error);

    if (!code && output && range[1] > range[0]) {
        code =
            error_set(&error, ERROR_INPUT,
                      "found --output with cases %.40s, expected one: it has a recording", cases);
    }
    code = code ? code : arena_init(&arena, MEMORY, &error);
    if (code) {
        return command_fail("test", &error);
    }
    code = plan_read(path, range[0], range[1], &arena, &plan, &error);
    code = code ? code : plan_run_cases(&plan, &options, &error);
    arena_fini(&arena);
    return code ? command_fail("test", &error) : status;
}

static int test_plan_merge(const char *path)
{
    struct error error;
    size_t count, failed;

    if (plan_merge(path, &count, &failed, &error)) {
        return command_fail("test", &error);
    }
    printf("%zu cases: %zu passed, %zu did not\n", count, count - failed, failed);
    return failed ? STATUS_FAILED : STATUS_OK;
}

struct test_options {
    const char *const *file; /* ends with NULL */
    const char *junit, *output, *program, *cases;
    int64_t jobs, seed;
    bool mutate, to_the_end, plan, merge, list;
};

/* All planned runs, and their results. */
struct test_runs {
    struct arena arena;
    size_t njob, ncase;
    struct scenario_job *job;
    size_t nresult;
    struct scenario_result *result;
    size_t passed, failed, broken;
};

enum { SIGNALS_SIZE = 2048 };

/* Reads the command line; returns false and the exit status if there is nothing to run. */
static bool test_parse_options(int argc, char **argv, struct test_options *out, int *status)
{
    static struct test_options o;
    static const struct option_spec options[] = {
        {"--jobs", OPTION_INT, "N", "parallel runs; as many as there are processors by default",
         .value = &o.jobs, .min = 1.0, .max = 256.0},
        {"--mutate", OPTION_FLAG, NULL,
         "also run every mutation, which must make its scenario fail", .value = &o.mutate},
        {"--to-the-end", OPTION_FLAG, NULL,
         "go on after the first expectation that is not met, to judge all of them",
         .value = &o.to_the_end},
        {"--seed", OPTION_INT, "N", "seed of noise and faults, instead of the scenarios' own",
         .value = &o.seed, .min = 0.0, .max = 9e15},
        {"--output", OPTION_STRING, "DIR",
         "folder for recordings and plots of failures, test-results by default; with --plan the "
         "plan to write; with --case run it again, compare, and record a failure there",
         .value = &o.output, .letter = "-o"},
        {"--program", OPTION_STRING, "COMMAND",
         "the host of scenarios with host: program, a shell command", .value = &o.program},
        {"--junit", OPTION_STRING, "FILE", "write the results as JUnit XML", .value = &o.junit},
        {"--plan", OPTION_FLAG, NULL, "run nothing: make the plan of a sweep's file",
         .value = &o.plan},
        {"--case", OPTION_STRING, "CASES",
         "run one case of a plan, or those of a range as 1-500, unless they have results",
         .value = &o.cases},
        {"--merge", OPTION_FLAG, NULL,
         "run nothing: write PLAN.xml, PLAN.csv and PLAN.html of a plan's results",
         .value = &o.merge},
        {"--list", OPTION_FLAG, NULL, "run nothing: list the cases", .value = &o.list},
    };
    static const struct operand_spec operands[] = {
        {"SCENARIO",
         "files or names of scenarios; a sweep's file with --plan, a plan with --case and --merge",
         true, .list = &o.file, .noun = "scenarios"}};
    static char manual[sizeof MANUAL_TEST + SIGNALS_SIZE];
    static const struct command_spec spec = {
        .name = "test",
        .summary = "Run scenarios: tests of a rig with a verdict.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .many = true,
        .manual = manual,
    };
    char signals[SIGNALS_SIZE];
    const char *const *line = scenario_signal_help();
    size_t used = 0;

    /* Write the help on signals: one line per kind */
    signals[0] = '\0';
    for (; *line && used < SIGNALS_SIZE; line++) {
        used += (size_t)snprintf(signals + used, SIGNALS_SIZE - used, "  %s\n", *line);
    }
    options_insert(manual, sizeof manual, MANUAL_TEST, "@SIGNALS@", signals);

    o = (struct test_options){.seed = -1};
    if (!options_read(&spec, argc, argv, status)) {
        return false;
    }
    *out = o;
    return true;
}

/* ---- the plan ---- */

/* Refuses two scenarios with one name, because both would write to the same directory. */
static enum error_code test_check_names(struct scenario *const *scenario, size_t count,
                                        struct error *error)
{
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < i; k++) {
            if (strcmp(scenario[i]->name, scenario[k]->name) == 0) {
                return yaml_error(
                    error, &scenario[i]->mark,
                    "found scenario \"%s\", which is in %.200s too, expected a name of its own",
                    scenario[i]->name, scenario[k]->file);
            }
        }
    }
    return ERROR_NONE;
}

/* Returns the folder for recordings of failures. */
static const char *test_output(const struct test_options *options)
{
    return options->output ? options->output : "test-results";
}

/* Reads and checks a scenario. Refuses a sweep or a plan; the error names the right options. */
static enum error_code test_read_scenario(const char *file, struct arena *arena,
                                          struct scenario **cases, size_t *ncase,
                                          struct error *error)
{
    char path[PATH_MAX];
    enum error_code code = config_locate(CONFIG_SCENARIO, file, path, error);
    const char *wanted;
    uint64_t hash;

    if (code) {
        return code;
    }
    code = scenario_read(path, arena, cases, ncase, error);
    wanted = code == ERROR_INPUT ? test_plan_describe(path) : NULL;
    if (wanted) {
        return error_set(error, ERROR_INPUT, "%.200s: found %s", path, wanted);
    }
    return code ? code : plan_check_rig(*cases, &hash, error);
}

/* Reads and checks all scenarios, and makes the list of runs. */
static enum error_code make_plan(struct test_runs *plan, const struct test_options *options,
                                 struct error *error)
{
    size_t nfile = 0, ncase = 0, njob = 0;
    struct scenario **cases;
    size_t *ncases;
    enum error_code code;

    while (options->file[nfile]) {
        nfile++;
    }
    cases = arena_alloc(&plan->arena, nfile, sizeof *cases);
    ncases = arena_alloc(&plan->arena, nfile, sizeof *ncases);
    if (!cases || !ncases) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu scenarios", nfile);
    }

    /* Reads and checks everything before the first run */
    for (size_t f = 0; f < nfile; f++) {
        code = test_read_scenario(options->file[f], &plan->arena, &cases[f], &ncases[f], error);
        if (code) {
            return code;
        }
        if (cases[f]->host == SCENARIO_HOST_PROGRAM && !options->program && !options->list) {
            return yaml_error(error, &cases[f]->mark,
                              "found host: program, expected the option --program COMMAND");
        }
        ncase += ncases[f];
        njob += ncases[f] * (1 + cases[f]->nmutation);
    }
    folder_enclose(test_output(options), strlen(test_output(options)));
    code = test_check_names(cases, nfile, error);
    if (code) {
        return code;
    }

    /* A job per run; a result per run, and one for the mutations of each case */
    plan->job = arena_alloc(&plan->arena, njob, sizeof *plan->job);
    plan->result = arena_alloc(&plan->arena, njob + ncase, sizeof *plan->result);
    if (!plan->job || !plan->result) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu runs", njob);
    }

    /* Plans the runs of all cases, with their mutations */
    for (size_t f = 0; f < nfile; f++) {
        for (size_t i = 0; i < ncases[f]; i++) {
            /* Add the runs of a case: the case itself, recorded in its own directory, then each
             * mutation, without a recording */
            for (int m = -1; m < (options->mutate ? (int)cases[f][i].nmutation : 0); m++) {
                struct scenario_job *job = &plan->job[plan->njob++];
                int used;

                job->scenario = &cases[f][i];
                job->mutation = m;
                job->seed_given = options->seed >= 0;
                job->seed = (uint64_t)options->seed;
                if (m < 0) {
                    used = snprintf(job->record, sizeof job->record, "%s/%s", test_output(options),
                                    cases[f][i].name);
                    if (ncases[f] > 1 && used > 0 && (size_t)used < sizeof job->record) {
                        snprintf(job->record + used, sizeof job->record - (size_t)used, "-%zu",
                                 i + 1);
                    }
                }
            }
            plan->ncase++;
        }
    }
    return ERROR_NONE;
}

/* ---- results ---- */

/* Prints the verdict of a run with its message, and counts it. */
static void print_result(struct test_runs *plan, const struct scenario_result *result)
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

/* Judges a finished run; called in the order of the plan. */
static void on_end(void *context, const struct scenario_job *job)
{
    struct test_runs *plan = context;
    struct scenario_result *result = &plan->result[plan->nresult++];

    scenario_judge(job, result);
    print_result(plan, result);
}

/* Returns the number of parallel runs: the given one, or one per processor. */
static size_t test_parallel(const struct test_options *options)
{
    long processors = sysconf(_SC_NPROCESSORS_ONLN);

    return options->jobs ? (size_t)options->jobs : processors > 0 ? (size_t)processors : 1;
}

/* Executes all runs, prints and writes the results; returns the exit status. */
static int run_plan(struct test_runs *plan, const struct test_options *options)
{
    struct scenario_jobs_options jobs = {
        .parallel = test_parallel(options),
        .to_the_end = options->to_the_end,
        .program = options->program,
        .ended = on_end,
        .context = plan,
    };
    const time_t begun = time(NULL);
    int64_t begin = clock_now(clock_monotonic());
    struct error error;

    /* Refuses a file that cannot be written before the runs, which may take long */
    if (options->junit && whole_file_probe(options->junit, &error)) {
        return command_fail("test", &error);
    }

    /* Results are printed as jobs end, in the order of the plan */
    if (scenario_jobs_run(plan->job, plan->njob, &jobs, &error)) {
        return command_fail("test", &error);
    }
    if (options->mutate) {
        /* Judges the mutations of each case, which are adjacent in the plan */
        for (size_t from = 0, to = 0; from < plan->njob; from = to) {
            struct scenario_result *result = &plan->result[plan->nresult++];

            /* The runs of one case are consecutive jobs with the same scenario */
            for (to = from; to < plan->njob && plan->job[to].scenario == plan->job[from].scenario;
                 to++) {
            }
            scenario_judge_mutations(plan->job + from, to - from, result);
            print_result(plan, result);
        }
    }

    /* Prints the totals, and writes the file */
    printf("%zu case%s in %zu run%s: %zu passed, %zu failed, %zu did not run; %.1f s\n",
           plan->ncase, plan->ncase == 1 ? "" : "s", plan->njob, plan->njob == 1 ? "" : "s",
           plan->passed, plan->failed, plan->broken,
           (double)(clock_now(clock_monotonic()) - begin) * 1e-9);
    if (options->junit &&
        scenario_junit_write(options->junit, plan->result, plan->nresult, begun, &error)) {
        return command_fail("test", &error);
    }
    return plan->failed + plan->broken ? STATUS_FAILED : STATUS_OK;
}

/* Runs or lists the given scenarios; returns the exit status. */
static int test_run_scenarios(const struct test_options *options)
{
    struct test_runs plan = {.njob = 0};
    struct error error;
    int status;

    if (arena_init(&plan.arena, MEMORY, &error)) {
        return command_fail("test", &error);
    }
    if (make_plan(&plan, options, &error)) {
        status = command_fail("test", &error);
    } else if (options->list) {
        /* Lists the cases, and the mutations below each */
        for (size_t i = 0; i < plan.njob; i++) {
            const struct scenario *scenario = plan.job[i].scenario;
            int mutation = plan.job[i].mutation;

            if (mutation < 0) {
                printf("%s%s%s: %s\n", scenario->name, scenario->values[0] ? " " : "",
                       scenario->values, scenario->description);
            } else {
                printf("  mutation %s\n", scenario->mutation[mutation].name);
            }
        }
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

    if (!test_parse_options(argc, argv, &options, &status)) {
        return status;
    }
    if (options.plan || options.cases || options.merge) {
        /* Run one of the commands about plans; refuse options that are not for it */
        struct error error;

        if (options.plan + (options.cases != NULL) + options.merge > 1 || options.file[1] ||
            options.mutate || options.list || options.junit || options.program ||
            options.to_the_end || options.seed >= 0 || (options.jobs && !options.cases) ||
            (options.merge && options.output)) {
            error_set(&error, ERROR_INPUT,
                      "found options that do not belong together, expected --plan SWEEP --output "
                      "PLAN, --case CASES PLAN or --merge PLAN");
            return command_fail("test", &error);
        }
        status = options.plan    ? test_plan_sweep(options.file[0], options.output)
                 : options.cases ? test_plan_cases(options.file[0], options.cases,
                                                   test_parallel(&options), options.output)
                                 : test_plan_merge(options.file[0]);
    } else {
        status = test_run_scenarios(&options);
    }
    return status;
}
