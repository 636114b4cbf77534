/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil identify: fits a drive's parameters to recordings of it. coman-hil validate: compares
 * rigs with measured benches. */
#include "app/cli/cli.h"
#include "app/identify/identify.h"
#include "base/config.h"
#include "base/whole_file.h"
#include "manual/identify.h"
#include "manual/validate.h"

#include <math.h>
#include <signal.h>
#include <unistd.h>

enum { FIT_STEPS = 40 }; /* maximum number of iterations */

struct identify_options {
    const char *rig, *bench, *joint, *free, *output, *report;
    struct option_list recording;
    bool cross;
};

/* Set by an interrupt from the keyboard. */
static volatile sig_atomic_t interrupted;

static void stop_fit(int number)
{
    (void)number;
    interrupted = 1;
}

/* Shows the progress: overwrites its line on a terminal, else writes a line. */
static void show_progress(int step, double rms, enum signal signal)
{
    const bool terminal = isatty(STDERR_FILENO);

    fprintf(stderr, "%sidentify: step %d, RMS error %.5f %s%s", terminal ? "\r" : "", step, rms,
            signal_kinds[signal].unit, terminal ? " " : "\n");
}

/* Splits the keys of --free in place. Returns their number. */
static size_t split_keys(char *text, const char *key[IDENTIFY_FREE_MAX + 1])
{
    size_t count = 0;

    while (text && count <= IDENTIFY_FREE_MAX) {
        key[count++] = strsep(&text, ",");
    }
    return count;
}

/* Prints the parameters, those that the data cannot determine, and the errors. */
static void print_identified(const struct fit_problem *problem,
                             const struct identify_result *result)
{
    const struct identify_bench *bench = problem->bench;
    const struct fit_result *fit = &result->fit;
    const char *unit = signal_kinds[fit->first].unit;

    for (size_t i = 0; i < problem->nfree; i++) {
        const char *group = problem->free[i].group;

        printf("%-24s %12.6g +- %-9.2g %s%s%s\n", parameters[problem->free[i].parameter].key,
               fit->value[i], fit->sigma[i], word_of(fit_verdict_words, (int)fit->verdict[i]),
               group ? ", group " : "", group ? group : "");
    }
    for (size_t i = 0; i < problem->nfree; i++) {
        for (size_t k = 0; k < i; k++) {
            if (fabs(fit->correlation[i][k]) > FIT_CORRELATED) {
                printf("%s and %s are hardly told apart: correlation %.3f\n",
                       parameters[problem->free[k].parameter].key,
                       parameters[problem->free[i].parameter].key, fit->correlation[i][k]);
            }
        }
    }
    for (size_t i = 0; i < bench->nrecording; i++) {
        const struct recording *r = &bench->recording[i];

        printf("%s: mean error %.4f %s, %.4f before", r->file, result->fitted[i], unit,
               result->start[i]);
        if (!isnan(result->crossed[i])) {
            printf(", %.4f by the folds without it", result->crossed[i]);
        }
        for (size_t s = 0; s < SIGNALS; s++) {
            if (r->signal[s]) {
                printf("; %s %.1f %% of RMS", signal_kinds[s].key,
                       100.0 * simulation_compare(r->signal[s], result->simulated[i].signal[s],
                                                  r->count)
                                   .share);
            }
        }
        puts(r->judge ? ", not fitted to" : "");
    }
    printf("mean error %.4f %s", identify_mean(result->fitted, bench->nrecording), unit);
    if (result->nfold > 0) {
        printf(", cross-validated %.4f %s over %zu folds",
               identify_mean(result->crossed, bench->nrecording), unit, result->nfold);
    }
    printf("; %d simulations, %.1f s\n", fit->simulations, result->spent_s);
}

/* Opens the input: a bench file, or a rig with recordings of "run --record". */
static enum error_code open_bench(const struct identify_options *o, struct arena *arena,
                                  struct identify_bench *bench, struct error *error)
{
    char path[PATH_MAX];
    enum error_code code = ERROR_NONE;

    if (o->bench) {
        code = config_locate(CONFIG_VALIDATION, o->bench, path, error);
        code = code ? code : identify_open(path, arena, bench, error);
    } else {
        code = identify_open_own(o->rig, o->joint, arena, bench, error);
    }

    if (!code && o->recording.count > 0) {
        code = identify_take_files(bench, o->recording.item, o->recording.count, arena, error);
    }
    if (!code && bench->missing && o->recording.count == 0) {
        code = error_set(error, ERROR_INPUT, "%s: found no recordings, expected them: %.300s",
                         bench->bench.name, bench->bench.obtain);
    } else if (!code && bench->nrecording == 0) {
        code = error_set(error, ERROR_INPUT, "--recording: found none, expected one or more");
    }
    return code;
}

/* Identifies and writes the requested results. *failed is whether the fit is of no use or was
 * interrupted. */
static enum error_code identify_do(const struct identify_options *o, struct arena *arena,
                                   bool *failed, struct error *error)
{
    static struct identify_bench bench;
    static struct identify_result result;
    static struct fit_problem problem;
    const char *key[IDENTIFY_FREE_MAX + 1];
    char *keys = o->free ? arena_strdup(arena, o->free) : NULL;
    enum error_code code = open_bench(o, arena, &bench, error);

    if (code) {
        return code;
    }
    problem = (struct fit_problem){.bench = &bench,
                                   .steps = FIT_STEPS,
                                   .progress = show_progress,
                                   .interrupted = &interrupted};

    /* An interrupt ends the fit with an interim result. A second one ends the program. */
    sigaction(SIGINT, &(struct sigaction){.sa_handler = stop_fit, .sa_flags = (int)SA_RESETHAND},
              NULL);
    /* Refuses a file that cannot be written before the fit, which may take long */
    code = o->output ? whole_file_probe(o->output, error) : ERROR_NONE;
    code = code ? code : fit_prepare(&problem, key, split_keys(keys, key), error);
    code = code ? code : identify_run(&problem, o->cross, arena, &result, error);
    if (isatty(STDERR_FILENO)) {
        fputs("\r\033[K", stderr);
    }
    if (code) {
        return code;
    }
    print_identified(&problem, &result);
    *failed = interrupted || result.failure[0];
    if (result.failure[0]) {
        fprintf(stderr, "identify: error: %s; no drive file is written\n", result.failure);
    } else if (interrupted) {
        fputs("identify: interrupted; the numbers are interim ones\n", stderr);
    }
    if (o->output && !result.failure[0]) {
        code = identify_write_drive(&problem, &result, o->output, error);
    }
    if (!code && o->report) {
        code = identify_write_page(&problem, &result, o->report, error);
    }
    return code;
}

int cmd_identify(int argc, char **argv)
{
    static struct identify_options o;
    static const struct option_spec options[] = {
        {"--recording", OPTION_LIST, "FILE",
         "a recording as CSV, of run --record by default; may be given more than once; by default "
         "those of the bench",
         .value = &o.recording},
        {"--bench", OPTION_STRING, "FILE",
         "a measured bench: what the columns mean, the servo's law, which numbers are free within "
         "which bounds, its recordings; RIG is then not needed",
         .value = &o.bench, .noun = "validations"},
        {"--joint", OPTION_STRING, "NAME", "the joint; by default the only one", .value = &o.joint},
        {"--free", OPTION_STRING, "KEY,...",
         "numbers to be found, by their keys in a drive's file; by default those of the bench",
         .value = &o.free},
        {"--cross", OPTION_FLAG, NULL,
         "also fit without each group of recordings, and judge on that group", .value = &o.cross},
        {"--output", OPTION_STRING, "FILE", "drive's file to write", .value = &o.output,
         .letter = "-o"},
        {"--report", OPTION_STRING, "DIR", "folder for a page with plots", .value = &o.report},
    };
    static const struct operand_spec operands[] = {{"RIG",
                                                    "rig of one driven joint, by file or name",
                                                    false, .value = &o.rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "identify",
        .summary = "Fit a drive's numbers to recordings of it.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_IDENTIFY,
    };
    struct arena arena;
    struct error error;
    enum error_code code;
    bool failed = false;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (!o.rig == !o.bench) {
        error_set(&error, ERROR_INPUT, "found %s, expected a RIG or a --bench",
                  o.rig ? "both a rig and a bench" : "neither a rig nor a bench");
        return options_fail(&spec, &error);
    }
    code = arena_init(&arena, RIG_COMMAND_ARENA, &error);
    if (!code) {
        code = identify_do(&o, &arena, &failed, &error);
        arena_fini(&arena);
    }
    status = options_end(&spec, code, &error);
    return status == STATUS_OK && failed ? STATUS_FAILED : status;
}

/* ---- validate ---- */

struct validate_options {
    const char *const *bench;
    const char *report;
};

/* Prints the verdict of a bench. */
static void print_validation(const struct validation *v)
{
    const struct bench *bench = &v->bench.bench;
    const double scale = v->is_share ? 100.0 : 1.0, limit = scale * bench->limit[v->is_share];
    const int digits = v->is_share ? 1 : 4;

    if (v->bench.missing) {
        printf("%-6s %-20s %s\n", validation_verdict(v), bench->name, bench->obtain);
        return;
    }
    printf("%-6s %-20s mean error %.*f %s", validation_verdict(v), bench->name, digits,
           scale * v->mean, validation_unit(v));
    if (limit > 0.0) {
        printf(", limit %.*f", digits, limit);
    }
    for (size_t i = 0; i < bench->npublished; i++) {
        printf("; %s %.*f", bench->published[i].what, digits,
               scale * bench->published[i].error[v->is_share]);
    }
    putchar('\n');
    for (size_t i = 0; i < v->bench.nrecording; i++) {
        const struct recording *recording = &v->bench.recording[i];

        if (recording->signal[SIGNAL_LOSS]) {
            const double *loss = v->simulated[i].signal[SIGNAL_LOSS];

            printf("       %s: losses %.1f %% (median), efficiency %.1f points%s\n",
                   recording->file, 100.0 * v->error[i],
                   100.0 * point_efficiency_error(recording, loss),
                   recording->judge ? ", judged" : "");
        }
        if (!recording->is_checked) {
            fprintf(stderr,
                    "coman-hil: %s: warning: found no key \"crc32\" for %s, expected \"%s\": the "
                    "file may have changed unnoticed\n",
                    bench->name, recording->file, recording->sum);
        }
    }
}

/* Runs the given benches, or all installed ones, and writes the page. *failed is whether one has
 * not passed. */
static enum error_code validate_all(const struct validate_options *o, struct arena *arena,
                                    bool *failed, struct error *error)
{
    struct validation *validation;
    struct config_entry *entry;
    char path[PATH_MAX];
    size_t count = 0;
    enum error_code code =
        o->bench[0] ? ERROR_NONE : config_list(CONFIG_VALIDATION, arena, &entry, &count, error);

    while (o->bench[0] && o->bench[count] && !code) {
        code = config_locate(CONFIG_VALIDATION, o->bench[count++], path, error);
    }
    if (code) {
        return code;
    }
    validation = arena_alloc(arena, count + 1, sizeof *validation);
    if (!validation) {
        return error_set(error, ERROR_MEMORY, "no memory for benches");
    }
    for (size_t i = 0; i < count && !code; i++) {
        code =
            o->bench[0] ? config_locate(CONFIG_VALIDATION, o->bench[i], path, error) : ERROR_NONE;
        code =
            code ? code
                 : validation_run(o->bench[0] ? path : entry[i].path, arena, &validation[i], error);
        if (!code) {
            print_validation(&validation[i]);
            *failed |= strcmp(validation_verdict(&validation[i]), "passed") != 0 &&
                       (o->bench[0] || !validation[i].bench.missing);
        }
    }
    return !code && o->report ? validation_write_page(validation, count, o->report, error) : code;
}

int cmd_validate(int argc, char **argv)
{
    static struct validate_options o;
    static const struct option_spec options[] = {
        {"--report", OPTION_STRING, "DIR", "folder for a page with plots", .value = &o.report},
    };
    static const struct operand_spec operands[] = {
        {"BENCH", "measured bench, by file or name; by default all that are installed", false,
         .list = &o.bench, .noun = "validations"}};
    static const struct command_spec spec = {
        .name = "validate",
        .summary = "Compare simulated drives with measured ones.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .many = true,
        .manual = MANUAL_VALIDATE,
    };
    struct arena arena;
    struct error error;
    enum error_code code;
    bool failed = false;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    code = arena_init(&arena, RIG_COMMAND_ARENA, &error);
    if (!code) {
        code = validate_all(&o, &arena, &failed, &error);
        arena_fini(&arena);
    }
    status = options_end(&spec, code, &error);
    return status == STATUS_OK && failed ? STATUS_FAILED : status;
}
