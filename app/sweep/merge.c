/* SPDX-License-Identifier: Apache-2.0 */
/* Collects the results of a plan's cases, and writes them as JUnit XML, CSV and HTML. */
#include "app/sweep/plan.h"

#include "base/text.h"
#include "base/whole_file.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Reserved address space for a plan with its results, bytes. */
#define MEMORY ((size_t)4 << 30)

/* ---- collecting ---- */

/* Checks that a result belongs to this plan, to a case that has no result yet, and to the same
 * program as the first result. */
static enum error_code merge_check(const struct plan *plan, const struct plan_result *all,
                                   const struct plan_result *one, const char *path,
                                   const struct plan_result **first, struct error *error)
{
    if (strcmp(one->plan, plan->id) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found a result of plan %s, expected %s: remove the file", path,
                         one->plan, plan->id);
    }
    if (one->number > plan->ncase || strcmp(one->hash, plan->list[one->number - 1].hash) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found case %zu with hash %s, which the plan does not have", path,
                         one->number, one->hash);
    }
    if (all[one->number - 1].number) {
        return error_set(error, ERROR_INPUT, "%.200s: found case %zu a second time, expected once",
                         path, one->number);
    }
    if (*first && strcmp((*first)->binary, one->binary) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found a result of program %.40s, case %zu is of %.40s; one "
                         "program runs all cases of a plan",
                         path, one->binary, (*first)->number, (*first)->binary);
    }
    return ERROR_NONE;
}

/* Checks that all cases have a result. */
static enum error_code merge_check_gaps(const struct plan *plan, const struct plan_result *all,
                                        struct error *error)
{
    size_t missing = 0, first = 0;

    for (size_t i = plan->ncase; i-- > 0;) {
        if (!all[i].number) {
            missing++;
            first = i + 1;
        }
    }
    return missing ? error_set(error, ERROR_INPUT,
                               "%.200s: found no result of %zu of %zu cases, the first is case %zu",
                               plan->path, missing, plan->ncase, first)
                   : ERROR_NONE;
}

/* Selects the files of results for scandir. */
static int merge_is_result(const struct dirent *entry)
{
    const char *dot = strrchr(entry->d_name, '.');

    return dot && !strcmp(dot, ".json");
}

/* Reads the results of all cases, in the order of the cases. ERROR_INPUT if a result is missing,
 * occurs twice, or belongs to another plan or program. */
static enum error_code plan_collect(const struct plan *plan, struct arena *arena,
                                    struct plan_result **results, struct error *error)
{
    struct plan_result *all = arena_alloc(arena, plan->ncase, sizeof *all), one;
    const struct plan_result *first = NULL;
    char folder[PATH_MAX], path[PATH_MAX + 300];
    struct dirent **entry = NULL;
    enum error_code code = ERROR_NONE;
    int count;

    if (!all) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu results", plan->ncase);
    }

    /* Read the files in a fixed order, so that messages are the same on every machine */
    plan_results_folder(plan, folder);
    count = scandir(folder, &entry, merge_is_result, alphasort);
    if (count < 0) {
        return error_set_file(error, errno, folder, "cannot be read");
    }
    for (int i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, entry[i]->d_name);
        code = code ? code : plan_read_result(path, arena, &one, error);
        code = code ? code : merge_check(plan, all, &one, path, &first, error);
        if (!code) {
            all[one.number - 1] = one;
            first = first ? first : &all[one.number - 1];
        }
        free(entry[i]);
    }
    free(entry);
    *results = all;
    return code ? code : merge_check_gaps(plan, all, error);
}

/* ---- writing ---- */

size_t plan_names(const struct plan *plan, const char *name[PLAN_NAMES_MAX])
{
    size_t count = 0;

    for (size_t i = 0; i < plan->nlist; i++) {
        for (size_t v = 0; v < plan->list[i].nvalue; v++) {
            const char *own = plan->list[i].value[v].name;

            if (TEXT_INDEX(name, count, own) < 0 && count < PLAN_NAMES_MAX) {
                name[count++] = own;
            }
        }
    }
    return count;
}

const char *plan_value(const struct plan_case *one, const char *name)
{
    const int at = TEXT_FIND(one->value, one->nvalue, name, name);

    return at < 0 ? "" : one->value[at].text;
}

/* Writes a line for each case: its values, verdict, margin and hash. */
static enum error_code merge_write_csv(const struct plan *plan, const struct plan_result *result,
                                       const char *path, struct error *error)
{
    const char *name[PLAN_NAMES_MAX];
    size_t nname = plan_names(plan, name);
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }

    /* Columns are the parameters of all scenarios; a case leaves other scenarios' cells empty */
    fputs("case,scenario", file.out);
    for (size_t k = 0; k < nname; k++) {
        fprintf(file.out, ",%s", name[k]);
    }
    fputs(",seed,status,margin,failed_s,virtual_s,state_hash,message\n", file.out);
    for (size_t i = 0; i < plan->ncase; i++) {
        const struct plan_case *one = &plan->list[i];

        fprintf(file.out, "%zu,%s", one->number, one->name);
        for (size_t k = 0; k < nname; k++) {
            fprintf(file.out, ",%s", plan_value(one, name[k]));
        }
        fprintf(file.out, ",%" PRIu64 ",%s,", one->seed, plan_status_word[result[i].status]);
        if (result[i].has_margin) {
            fprintf(file.out, "%.9g", result[i].margin);
        }
        fputc(',', file.out);
        if (result[i].failed_s >= 0.0) {
            fprintf(file.out, "%.9g", result[i].failed_s);
        }
        fprintf(file.out, ",%.9g,%016" PRIx64 ",", result[i].virtual_s, result[i].state_hash);

        /* Write a field of CSV in quotation marks (RFC 4180); line breaks become "; " */
        const char *text = result[i].message;

        fputc('"', file.out);
        for (; *text; text++) {
            fputs(*text == '"'    ? "\"\""
                  : *text == '\n' ? "; "
                                  : (const char[2]){*text, '\0'},
                  file.out);
        }
        fputc('"', file.out);
        fputc('\n', file.out);
    }
    return whole_file_close(&file, code, error);
}

/* Writes the results as JUnit XML. Times are virtual, so they are the same on every machine. */
static enum error_code merge_write_junit(const struct plan *plan, const struct plan_result *result,
                                         struct arena *arena, const char *path, struct error *error)
{
    struct scenario_result *all = arena_alloc(arena, plan->ncase, sizeof *all);

    for (size_t i = 0; all && i < plan->ncase; i++) {
        const struct plan_case *one = &plan->list[i];
        struct scenario *scenario = arena_alloc(arena, 1, sizeof *scenario);
        size_t used = 0;

        if (!scenario) {
            all = NULL;
            break;
        }
        scenario->name = one->name;
        scenario->file = one->file;
        for (size_t k = 0; k < one->nvalue && used < SCENARIO_TEXT; k++) {
            used += (size_t)snprintf(scenario->values + used, SCENARIO_TEXT - used, "%s%s=%s",
                                     k ? ", " : "", one->value[k].name, one->value[k].text);
        }
        all[i] = (struct scenario_result){.scenario = scenario,
                                          .status = result[i].status,
                                          .record = "",
                                          .ran = result[i].status != SCENARIO_BROKEN,
                                          .seed = one->seed,
                                          .state_hash = result[i].state_hash,
                                          .seconds = result[i].virtual_s};
        snprintf(all[i].name, sizeof all[i].name, "case %zu", one->number);
        snprintf(all[i].message, sizeof all[i].message, "%s", result[i].message);
    }
    return all ? scenario_junit_write(path, all, plan->ncase, 0, error)
               : error_set(error, ERROR_MEMORY, "no memory left for %zu results", plan->ncase);
}

enum error_code plan_merge(const char *path, size_t *ncase, size_t *failed, struct error *error)
{
    struct plan plan;
    struct plan_result *result = NULL;
    char to[PATH_MAX];
    struct arena arena;
    enum error_code code = arena_init(&arena, MEMORY, error);

    if (code) {
        return code;
    }
    *failed = 0;
    if ((code = plan_read(path, 0, 0, &arena, &plan, error)) ||
        (code = plan_collect(&plan, &arena, &result, error))) {
        goto done;
    }
    for (size_t i = 0; i < plan.ncase; i++) {
        *failed += result[i].status != SCENARIO_PASSED;
    }
    *ncase = plan.ncase;

    /* Write the same results in three formats */
    snprintf(to, sizeof to, "%.4000s.xml", path);
    code = merge_write_junit(&plan, result, &arena, to, error);
    snprintf(to, sizeof to, "%.4000s.csv", path);
    code = code ? code : merge_write_csv(&plan, result, to, error);
    snprintf(to, sizeof to, "%.4000s.html", path);
    code = code ? code : plan_page_write(&plan, result, to, error);
done:
    arena_fini(&arena);
    return code;
}

void plan_wilson_interval(size_t passed, size_t count, double *low, double *high)
{
    /* z: 97.5 % quantile of the normal distribution */
    const double z = 1.959963984540054, n = (double)count;
    const double p = count ? (double)passed / n : 0.0;
    const double middle = count ? (p + z * z / (2 * n)) / (1 + z * z / n) : 0.5;
    const double half =
        count ? z * sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n) : 0.5;

    *low = fmax(0.0, middle - half);
    *high = fmin(1.0, middle + half);
}
