/* SPDX-License-Identifier: Apache-2.0 */
/* Runs one case of a plan, and writes and reads its result. */
#include "app/sweep/plan.h"

#include "base/whole_file.h"

#include <elf.h>
#include <errno.h>
#include <ftw.h>
#include <inttypes.h>
#include <jansson.h>
#include <link.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *const status_word[] = {"passed", "failed", "broken"};

/* ---- which program ---- */

/* The build id that the linker gave this program, as hexadecimal digits; the first object is the
 * program itself. */
static int binary_take_id(struct dl_phdr_info *info, size_t size, void *context)
{
    char *id = context;

    (void)size;
    for (size_t i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *segment = &info->dlpi_phdr[i];
        const unsigned char *at = (const unsigned char *)info->dlpi_addr + segment->p_vaddr;
        const unsigned char *end = at + segment->p_memsz;
        ElfW(Nhdr) note;

        for (; segment->p_type == PT_NOTE && (size_t)(end - at) > sizeof note;
             at += sizeof note + ((note.n_namesz + 3) & ~3U) + ((note.n_descsz + 3) & ~3U)) {
            memcpy(&note, at, sizeof note);
            if (note.n_type == NT_GNU_BUILD_ID && note.n_descsz <= 20) {
                for (size_t k = 0; k < note.n_descsz; k++) {
                    snprintf(id + 2 * k, 3, "%02x", at[sizeof note + 4 + k]);
                }
                return 1;
            }
        }
    }
    return 1;
}

static void plan_find_binary(char id[64])
{
    snprintf(id, 64, "none");
    dl_iterate_phdr(binary_take_id, id);
}

/* ---- results ---- */

void plan_results_folder(const struct plan *plan, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%.4000s.results", plan->path);
}

static void plan_result_path(const struct plan *plan, size_t number, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%.4000s.results/%zu.json", plan->path, number);
}

enum error_code plan_read_result(const char *path, struct arena *arena, struct plan_result *result,
                                 struct error *error)
{
    json_t *file = json_load_file(path, JSON_REJECT_DUPLICATES, NULL), *margin = NULL;
    const json_t *version = json_object_get(file, "format_version");
    bool newer = json_integer_value(version) > PLAN_FORMAT_VERSION;
    const char *plan, *hash, *binary, *status, *state, *message;
    json_int_t number;
    bool good =
        file && !json_unpack(file, "{s:I, s:s, s:s, s:s, s:s, s:s, s:F, s:o, s:F, s:s}", "case",
                             &number, "plan", &plan, "hash", &hash, "binary", &binary, "status",
                             &status, "state_hash", &state, "virtual_s", &result->virtual_s,
                             "margin", &margin, "failed_s", &result->failed_s, "message", &message);
    int s = 0;

    good = good && !newer && (!version || json_integer_value(version) >= 1);
    good = good && strlen(plan) < PLAN_HASH && strlen(hash) < PLAN_HASH && strlen(binary) < 64 &&
           number > 0;
    while (good && s < 3 && strcmp(status, status_word[s]) != 0) {
        s++;
    }
    if (good && s < 3) {
        result->number = (size_t)number;
        snprintf(result->plan, sizeof result->plan, "%s", plan);
        snprintf(result->hash, sizeof result->hash, "%s", hash);
        snprintf(result->binary, sizeof result->binary, "%s", binary);
        result->status = (enum scenario_status)s;
        result->state_hash = strtoull(state, NULL, 16);
        result->has_margin = json_is_number(margin);
        result->margin = json_number_value(margin);
        result->message = arena_strdup(arena, message);
    }
    json_decref(file);
    return good && s < 3 && result->message ? ERROR_NONE
           : newer
               ? plan_newer(path, error)
               : error_set(error, ERROR_INPUT,
                           "%.200s: found no result, expected one as test --case writes it", path);
}

static enum error_code plan_write_result(const struct plan *plan, const struct plan_result *result,
                                         struct error *error)
{
    char path[PATH_MAX], part[PATH_MAX + 32], state[PLAN_HASH];
    json_t *margin = result->has_margin ? json_real(result->margin) : json_null(), *text;
    enum error_code code = ERROR_NONE;
    FILE *out;

    snprintf(state, sizeof state, "%016" PRIx64, result->state_hash);
    text =
        json_pack("{s:i, s:I, s:s, s:s, s:s, s:s, s:s, s:f, s:o, s:f, s:s}", "format_version",
                  PLAN_FORMAT_VERSION, "case", (json_int_t)result->number, "plan", result->plan,
                  "hash", result->hash, "binary", result->binary, "status",
                  status_word[result->status], "state_hash", state, "virtual_s", result->virtual_s,
                  "margin", margin, "failed_s", result->failed_s, "message", result->message);

    /* Two of the same case may run at once: each writes a file of its own, and the last to take the
     * name has the same bytes */
    plan_result_path(plan, result->number, path);
    snprintf(part, sizeof part, "%s.%ld", path, (long)getpid());
    out = text ? fopen(part, "w") : NULL;
    if (!text) {
        code = error_set(error, ERROR_MEMORY, "no memory left for a result");
    } else if (!out) {
        code = error_set_file(error, errno, part, "cannot be written");
    } else {
        int failed = json_dumpf(text, out, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(12));

        failed |= fputc('\n', out) == EOF;
        failed |= fflush(out) || fsync(fileno(out));
        failed |= fclose(out);
        if (failed || rename(part, path)) {
            code = error_set_file(error, errno, part, "cannot be written");
            unlink(part);
        }
    }
    json_decref(text);
    return code;
}

/* ---- the run ---- */

/* Reads the scenario of a case with its values. */
static enum error_code plan_read_scenario(const struct plan_case *one, struct arena *arena,
                                          struct scenario **scenario, struct error *error)
{
    size_t count;
    enum error_code code =
        scenario_read_with(one->scenario, one->value, one->nvalue, arena, scenario, &count, error);

    if (!code && count != 1) {
        code =
            error_set(error, ERROR_INPUT, "%.200s: found %zu cases, expected the one of the plan",
                      one->scenario, count);
    }
    return code;
}

static void plan_keep_job(void *context, const struct scenario_job *job)
{
    (void)context;
    (void)job;
}

/* What a job came to, in a result. */
static enum error_code plan_judge(const struct plan *plan, const struct scenario_job *job,
                                  struct plan_result *result, struct arena *arena,
                                  struct error *error)
{
    const struct plan_case *one = &plan->list[0];
    const struct scenario_outcome *outcome = &job->outcome;
    struct scenario_result *verdict = arena_alloc(arena, 1, sizeof *verdict);
    char hash[PLAN_HASH];

    if (!verdict) {
        return error_set(error, ERROR_MEMORY, "no memory left for a result");
    }

    /* Without a rig's hash the run has not begun, or its process did not come to an end */
    if (!outcome->rig_hash) {
        return error_set(error, ERROR_SYSTEM, "case %zu has no result: %.400s", one->number,
                         outcome->text);
    }
    plan_hash_case(job->scenario, outcome->rig_hash, one->seed, plan->program, hash);
    if (strcmp(hash, one->hash) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found a scenario, rig or mesh that has changed since the plan "
                         "was made (case %zu is %s, expected %s); make a new plan",
                         plan->path, one->number, hash, one->hash);
    }
    scenario_judge(job, verdict);
    *result = (struct plan_result){.number = one->number,
                                   .status = verdict->status,
                                   .state_hash = outcome->state_hash,
                                   .virtual_s = (double)outcome->virtual_ns * 1e-9,
                                   .failed_s = -1.0,
                                   .message = verdict->message};
    memcpy(result->plan, plan->id, sizeof result->plan);
    memcpy(result->hash, one->hash, sizeof result->hash);
    plan_find_binary(result->binary);

    /* The nearest that a signal came to its bounds, and the first expectation that was not met */
    for (size_t i = 0; i < outcome->nverdict; i++) {
        const struct scenario_verdict *met = &outcome->verdict[i];
        double time_s = (double)(met->time_ns < 0 ? outcome->virtual_ns : met->time_ns) * 1e-9;

        if (met->has_margin) {
            result->margin = result->has_margin ? fmin(result->margin, met->margin) : met->margin;
            result->has_margin = true;
        }
        if (!met->met && (result->failed_s < 0.0 || time_s < result->failed_s)) {
            result->failed_s = time_s;
        }
    }
    return ERROR_NONE;
}

static int plan_remove_entry(const char *path, const struct stat *status, int type,
                             struct FTW *place)
{
    (void)status;
    (void)type;
    (void)place;
    return remove(path);
}

/* Runs the case in a process, with a scratch folder for the program under test, which is gone
 * afterwards. */
static enum error_code plan_execute(const struct plan *plan, const char *record,
                                    struct scenario_job *job, struct error *error)
{
    const struct plan_case *one = &plan->list[0];
    char scratch[PATH_MAX + 64], folder[PATH_MAX];
    struct scenario_jobs_options options = {.parallel = 1,
                                            .seed_given = true,
                                            .seed = one->seed,
                                            .program = plan->program,
                                            .ended = plan_keep_job};
    enum error_code code;

    snprintf(job->record, sizeof job->record, "%s", record ? record : "");
    if (plan->program) {
        plan_results_folder(plan, folder);
        snprintf(scratch, sizeof scratch, "%s/scratch-%zu-XXXXXX", folder, one->number);
        if (!mkdtemp(scratch)) {
            return error_set_file(error, errno, scratch, "cannot be made");
        }
        options.scratch = scratch;
    }
    code = scenario_jobs_run(job, 1, &options, error);
    if (plan->program) {
        nftw(scratch, plan_remove_entry, 16, FTW_DEPTH | FTW_PHYS);
    }
    return code;
}

/* A result that is there already counts when it is of this plan and program. */
static enum error_code plan_check_result(const struct plan *plan, const struct plan_result *result,
                                         const char *path, struct error *error)
{
    char binary[64];

    plan_find_binary(binary);
    if (strcmp(result->plan, plan->id) != 0 || result->number != plan->list[0].number) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found case %zu of plan %s, expected case %zu of plan %s", path,
                         result->number, result->plan, plan->list[0].number, plan->id);
    }
    if (strcmp(result->binary, binary) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found a result of program %.40s, this is %.40s; one program runs "
                         "all cases of a plan",
                         path, result->binary, binary);
    }
    return ERROR_NONE;
}

enum error_code plan_run_case(const struct plan *plan, const char *record,
                              struct plan_result *result, struct arena *arena, struct error *error)
{
    struct scenario_job *job = arena_alloc(arena, 1, sizeof *job);
    struct plan_result old;
    char path[PATH_MAX];
    bool there;
    enum error_code code = ERROR_NONE;

    plan_results_folder(plan, path);
    if (!job || (mkdir(path, 0777) && errno != EEXIST)) {
        return job ? error_set_file(error, errno, path, "cannot be made")
                   : error_set(error, ERROR_MEMORY, "no memory left for a case");
    }

    /* Done is done */
    plan_result_path(plan, plan->list[0].number, path);
    there = !access(path, F_OK);
    if (there && ((code = plan_read_result(path, arena, &old, error)) ||
                  (code = plan_check_result(plan, &old, path, error)))) {
        return code;
    }
    if (there && !record) {
        *result = old;
        return ERROR_NONE;
    }

    job->mutation = -1;
    if ((code = plan_read_scenario(&plan->list[0], arena, &job->scenario, error)) ||
        (code = plan_execute(plan, record, job, error)) ||
        (code = plan_judge(plan, job, result, arena, error))) {
        return code;
    }
    if (there && (old.state_hash != result->state_hash || old.status != result->status)) {
        return error_set(error, ERROR_SYSTEM,
                         "case %zu came out otherwise than in %.200s: the run does not depend on "
                         "its input alone",
                         result->number, path);
    }
    return there ? ERROR_NONE : plan_write_result(plan, result, error);
}
