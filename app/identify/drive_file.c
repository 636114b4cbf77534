/* SPDX-License-Identifier: Apache-2.0 */
/* Writes an identified drive as a file of the catalogue. */

#include "app/identify/identify.h"

#include "base/whole_file.h"

#include <limits.h>
#include <string.h>

/* Writes the source of the numbers, as comments. */
static void write_head(const struct fit_problem *problem, const struct identify_result *result,
                       FILE *out)
{
    const struct identify_bench *bench = problem->bench;
    const double crossed = identify_mean(result->crossed, bench->nrecording);

    fprintf(out,
            "# SPDX-License-Identifier: Apache-2.0\n"
            "# Identified by coman-hil identify from these recordings, each simulated without\n"
            "# being set back to what was measured:\n");
    for (size_t i = 0; i < bench->nrecording; i++) {
        if (!bench->recording[i].judge) {
            fprintf(out, "#   %-44s mean error %.4f %s\n", bench->recording[i].name,
                    result->fitted[i], signal_kinds[result->fit.first].unit);
        }
    }
    if (crossed >= 0.0) {
        fprintf(out, "# Cross-validated over %zu folds: %.4f %s.\n", result->nfold, crossed,
                signal_kinds[result->fit.first].unit);
    }
    for (size_t i = 0; i < problem->nfree; i++) {
        const char *key = problem->free[i].name;

        if (problem->free[i].group) {
            fprintf(out, "# Of the recordings of group %s: %s %.6g.\n", problem->free[i].group, key,
                    result->fit.value[i]);
        } else if (!parameter_is_written(&result->fit.trial, problem->free[i].parameter)) {
            fprintf(out, "# Of the bench, no number of the drive: %s %.6g.\n", key,
                    result->fit.value[i]);
        }
    }
    fprintf(out, "#\n# Behind each number stands how far it can be trusted: I, identified (with "
                 "sigma, or what\n# the recordings do not tell), F, follows such a one, or as in "
                 "the drive that it began\n# from.\n");
}

/* Writes the keys of the drive of joint j, each with the uncertainty of its value. */
static void write_keys(const struct fit_problem *problem, const struct identify_result *result,
                       int j, FILE *out)
{
    const struct trial_robot *made = &result->fit.trial;

    fprintf(out, "drive:\n");
    for (int i = j * parameter_count; i < (j + 1) * parameter_count; i++) {
        const double value = parameter_get(made, i);
        int free = -1;

        for (size_t k = 0; k < problem->nfree; k++) {
            free = problem->free[k].parameter == i && !problem->free[k].group ? (int)k : free;
        }
        if (!parameter_is_written(made, i)) {
            continue;
        }
        fprintf(out, "  %s: %.6g", parameter_of(i)->key, value);
        if (free >= 0) {
            const int partner = fit_partner(&result->fit, problem->nfree, (size_t)free);

            fprintf(out, "  # I: sigma %.2g, %s", result->fit.sigma[free],
                    word_of(fit_verdict_words, (int)result->fit.verdict[free]));
            if (partner >= 0) {
                fprintf(out, "; correlation %.3f with %s", result->fit.correlation[free][partner],
                        problem->free[partner].name);
            }
            fputc('\n', out);
        } else {
            fprintf(out, "  # %s\n",
                    value != parameter_get(&problem->bench->trial, i) ? "F" : "as it was");
        }
    }
    if (made->effects[j].freewheel) {
        fprintf(out, "  freewheel: true  # as it was\n");
    }
}

/* Writes the file of the drive of joint j. */
static enum error_code write_drive_of(const struct fit_problem *problem,
                                      const struct identify_result *result, int j, const char *path,
                                      struct error *error)
{
    const struct identify_bench *bench = problem->bench;
    const struct robot_effects *effects = &bench->trial.effects[j];
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    const int length = (int)strcspn(name, ".");
    struct whole_file file;
    enum error_code code;

    if (effects->nerror + effects->ncogging > 0) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a drive with cogging or gear errors, expected one without: "
                         "these are not written back",
                         bench->bench.name);
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    write_head(problem, result, file.out);
    fprintf(file.out,
            "name: %.*s\ndescription: \"%s, identified\"\nsource: \"identified from %s\"\n", length,
            name, bench->bench.name, bench->bench.source);
    fprintf(file.out, "supply_v: %.6g\n", bench->supply_v);
    write_keys(problem, result, j, file.out);
    return whole_file_close(&file, ERROR_NONE, error);
}

enum error_code identify_write_drive(const struct fit_problem *problem,
                                     const struct identify_result *result, const char *path,
                                     struct error *error)
{
    const struct trial_robot *trial = &problem->bench->trial;
    const char *slash = strrchr(path, '/'), *dot = strrchr(path, '.');
    const int stem = (int)(dot && dot > slash ? dot - path : (long)strlen(path));
    enum error_code code = ERROR_NONE;
    bool several = false;

    for (size_t k = 0; k < trial->njoint; k++) {
        several |= trial->drive[trial->at[k]] != trial->drive[trial->at[0]];
    }
    for (size_t k = 0; k < trial->njoint && !code; k++) {
        const int j = trial->at[k];
        char own[PATH_MAX];

        if (trial->drive[j] == j) {
            snprintf(own, sizeof own, "%.*s-%.100s%s", stem, path, trial->joint[j].name,
                     path + stem);
            code = write_drive_of(problem, result, j, several ? own : path, error);
        }
    }
    return code;
}
