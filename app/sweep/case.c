/* SPDX-License-Identifier: Apache-2.0 */
/* Runs the cases of a plan, and writes and reads their results. */
#include "app/sweep/plan.h"

#include "base/hash.h"
#include "base/input_file.h"
#include "base/whole_file.h"
#include "contact/mesh/solid_store.h"

#include <elf.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <link.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    BATCH = 64, /* number of cases that are read and run together */
    RESULT_BYTES_MAX = 1 << 20,
};

/* Reserved address space for a batch and for a rig, bytes; unused pages cost nothing. */
#define BATCH_MEMORY ((size_t)1 << 30)
#define RIG_MEMORY ((size_t)1 << 30)

const char *const plan_status_word[PLAN_STATUSES] = {"passed", "failed", "broken"};

/* ---- which program ---- */

/* Writes this program's build id from the linker as hexadecimal digits. A callback of
 * dl_iterate_phdr, whose first object is the program. */
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

/* Finds the build id of this program; "none" if the linker did not add one. */
static void plan_find_binary(char id[64])
{
    snprintf(id, 64, "none");
    dl_iterate_phdr(binary_take_id, id);
}

/* ---- results ---- */

void plan_hash_case(const struct scenario *scenario, uint64_t rig_hash, uint64_t seed,
                    const char *program, char hash[PLAN_HASH])
{
    uint64_t sum = hash_bytes(HASH_START, &scenario->text_hash, sizeof scenario->text_hash);

    sum = hash_bytes(sum, &rig_hash, sizeof rig_hash);
    sum = hash_bytes(sum, &seed, sizeof seed);
    sum = program ? hash_bytes(sum, program, strlen(program)) : sum;
    snprintf(hash, PLAN_HASH, "%016" PRIx64, sum);
}

void plan_results_folder(const struct plan *plan, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%.4000s.results", plan->path);
}

/* Writes the path of a case's result. */
static void plan_result_path(const struct plan *plan, size_t number, char path[PATH_MAX])
{
    snprintf(path, PATH_MAX, "%.4000s.results/%zu.json", plan->path, number);
}

/* Loads a JSON file. Returns NULL if the file cannot be read or is not JSON. */
static json_t *result_load(const char *path)
{
    char *text;
    size_t size;
    json_t *file = NULL;

    if (!input_file_load(path, RESULT_BYTES_MAX, &text, &size, NULL)) {
        file = json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL);
        free(text);
    }
    return file;
}

enum error_code plan_read_result(const char *path, struct arena *arena, struct plan_result *result,
                                 struct error *error)
{
    json_t *file = result_load(path), *margin = NULL;
    const json_t *version = json_object_get(file, "format_version");
    bool newer = json_integer_value(version) > PLAN_FORMAT_VERSION;
    const char *plan, *hash, *binary, *status, *state, *message;
    json_int_t number;
    /* Check that all keys exist, then the format version and the values */
    bool good =
        file && !json_unpack(file, "{s:I, s:s, s:s, s:s, s:s, s:s, s:F, s:o, s:F, s:s}", "case",
                             &number, "plan", &plan, "hash", &hash, "binary", &binary, "status",
                             &status, "state_hash", &state, "virtual_s", &result->virtual_s,
                             "margin", &margin, "failed_s", &result->failed_s, "message", &message);
    int s = 0;

    good = good && !newer && (!version || json_integer_value(version) >= 1);
    good = good && strlen(plan) < PLAN_HASH && strlen(hash) < PLAN_HASH && strlen(binary) < 64 &&
           number > 0;
    while (good && s < 3 && strcmp(status, plan_status_word[s]) != 0) {
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
    if (good && s < 3 && result->message) {
        return ERROR_NONE;
    }
    return newer ? plan_newer(path, error)
                 : error_set(error, ERROR_INPUT,
                             "%.200s: found no result, expected one as test --case writes it: "
                             "remove the file to run the case again",
                             path);
}

/* Writes the result of a case. The file is complete or missing. */
static enum error_code plan_write_result(const struct plan *plan, const struct plan_result *result,
                                         struct error *error)
{
    char path[PATH_MAX], state[PLAN_HASH];
    json_t *margin = result->has_margin ? json_real(result->margin) : json_null(), *text;
    struct whole_file file;
    enum error_code code;

    snprintf(state, sizeof state, "%016" PRIx64, result->state_hash);
    text = json_pack("{s:i, s:I, s:s, s:s, s:s, s:s, s:s, s:f, s:o, s:f, s:s}", "format_version",
                     PLAN_FORMAT_VERSION, "case", (json_int_t)result->number, "plan", result->plan,
                     "hash", result->hash, "binary", result->binary, "status",
                     plan_status_word[result->status], "state_hash", state, "virtual_s",
                     result->virtual_s, "margin", margin, "failed_s", result->failed_s, "message",
                     result->message);

    /* Write the complete file in one step, because a sweep repeats a case without a file */
    plan_result_path(plan, result->number, path);
    code = text ? whole_file_open(&file, path, error)
                : error_set(error, ERROR_MEMORY, "no memory left for a result");
    if (!code) {
        if (json_dumpf(text, file.out, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(12))) {
            code = error_set(error, ERROR_SYSTEM, "%s: a result cannot be written", path);
        }
        fputc('\n', file.out);
        code = whole_file_close(&file, code, error);
    }
    json_decref(text);
    return code;
}

/* ---- the run ---- */

/* Converts the outcome of a job to the result of a case. Returns an error if the run did not
 * finish, or differs from the plan. */
static enum error_code plan_judge(const struct plan *plan, const struct plan_case *one,
                                  const struct scenario_job *job, struct plan_result *result,
                                  struct arena *arena, struct error *error)
{
    const struct scenario_outcome *outcome = &job->outcome;
    struct scenario_result *verdict = arena_alloc(arena, 1, sizeof *verdict);
    char hash[PLAN_HASH];

    if (!verdict) {
        return error_set(error, ERROR_MEMORY, "no memory left for a result");
    }

    /* Without the rig's hash, the run did not start or its process died */
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

    /* Find the least margin, and the time of the first expectation that was not met */
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

/* Checks that an existing result belongs to this plan, case and program. */
static enum error_code plan_check_result(const struct plan *plan, const struct plan_case *one,
                                         const struct plan_result *result, const char *path,
                                         struct error *error)
{
    char binary[64];

    plan_find_binary(binary);
    if (strcmp(result->plan, plan->id) != 0 || result->number != one->number) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found case %zu of plan %s, expected case %zu of plan %s: remove "
                         "%.200s.results or give the plan another name",
                         path, result->number, result->plan, one->number, plan->id, plan->path);
    }
    if (strcmp(result->binary, binary) != 0) {
        return error_set(error, ERROR_INPUT,
                         "%.200s: found a result of program %.40s, this is %.40s; one program runs "
                         "all cases of a plan",
                         path, result->binary, binary);
    }
    return ERROR_NONE;
}

/* ---- several cases ---- */

/* A case of a batch. It has a result, or a job, or an error. */
struct plan_slot {
    const struct plan_case *one;
    struct scenario_job *job; /* NULL = nothing to run */
    bool there;               /* the result exists already */
    struct plan_result result;
    struct error why; /* code ERROR_NONE = no error */
};

/* The cases that run together. */
struct plan_batch {
    const struct plan *plan;
    const struct plan_run_options *options;
    struct arena *arena;
    size_t nslot, told, njob;
    struct plan_slot *slot;
    struct scenario_job *job;
    struct plan_slot **slot_of; /* by job: its case */
};

/* Reports all cases before `until` that are not yet reported, in order. */
static void plan_tell(struct plan_batch *batch, size_t until)
{
    for (; batch->told < until; batch->told++) {
        const struct plan_slot *slot = &batch->slot[batch->told];

        batch->options->ended(batch->options->context, slot->one,
                              slot->why.code ? NULL : &slot->result, &slot->why);
    }
}

/* Makes a scratch folder for the program under test in the folder of results. Does nothing if the
 * plan has no program. */
static enum error_code plan_make_scratch(const struct plan *plan, struct plan_slot *slot,
                                         struct arena *arena, struct error *error)
{
    char scratch[PATH_MAX + 64], folder[PATH_MAX];

    if (!plan->program) {
        return ERROR_NONE;
    }
    plan_results_folder(plan, folder);
    snprintf(scratch, sizeof scratch, "%s/scratch-%zu-XXXXXX", folder, slot->one->number);
    if (!mkdtemp(scratch)) {
        return error_set_file(error, errno, scratch, "cannot be made");
    }
    slot->job->scratch = arena_strdup(arena, scratch);
    if (!slot->job->scratch) {
        rmdir(scratch);
        return error_set(error, ERROR_MEMORY, "no memory left for a case");
    }
    return ERROR_NONE;
}

/* Removes the scratch folder with its contents. */
static void plan_remove_scratch(struct scenario_job *job)
{
    if (job->scratch) {
        folder_remove(job->scratch);
        job->scratch = NULL;
    }
}

/* Looks for the result of a case. Prepares a run if there is no result, or if a folder for
 * recordings is given. */
static enum error_code plan_prepare_case(struct plan_batch *batch, struct plan_slot *slot,
                                         struct error *error)
{
    const struct plan *plan = batch->plan;
    const char *record = batch->options->record;
    struct scenario_job *job = &batch->job[batch->njob];
    char path[PATH_MAX];
    enum error_code code;
    size_t count;

    /* A case with a result is complete */
    plan_result_path(plan, slot->one->number, path);
    slot->there = !access(path, F_OK);
    if (slot->there && ((code = plan_read_result(path, batch->arena, &slot->result, error)) ||
                        (code = plan_check_result(plan, slot->one, &slot->result, path, error)))) {
        return code;
    }
    if (slot->there && !record) {
        return ERROR_NONE;
    }

    job->mutation = -1;
    job->seed_given = true;
    job->seed = slot->one->seed;
    snprintf(job->record, sizeof job->record, "%s", record ? record : "");

    /* Read the scenario of a case, and insert the case's values */
    code = scenario_read_with(slot->one->scenario, slot->one->value, slot->one->nvalue,
                              batch->arena, &job->scenario, &count, error);
    if (!code && count != 1) {
        code =
            error_set(error, ERROR_INPUT, "%.200s: found %zu cases, expected the one of the plan",
                      slot->one->scenario, count);
    }
    slot->job = job;
    code = code ? code : plan_make_scratch(plan, slot, batch->arena, error);
    if (code) {
        slot->job = NULL;
        return code;
    }
    batch->slot_of[batch->njob++] = slot;
    return ERROR_NONE;
}

/* Stores the result of a finished job: writes it, or compares it with the existing one. */
static enum error_code plan_take_result(const struct plan_batch *batch, struct plan_slot *slot,
                                        struct error *error)
{
    struct plan_result result;
    enum error_code code =
        plan_judge(batch->plan, slot->one, slot->job, &result, batch->arena, error);
    char path[PATH_MAX];

    if (code) {
        return code;
    }
    if (slot->there &&
        (slot->result.state_hash != result.state_hash || slot->result.status != result.status)) {
        plan_result_path(batch->plan, result.number, path);
        return error_set(error, ERROR_SYSTEM,
                         "case %zu came out otherwise than in %.200s: the run does not depend on "
                         "its input alone",
                         result.number, path);
    }
    slot->result = result;
    return slot->there ? ERROR_NONE : plan_write_result(batch->plan, &result, error);
}

/* Stores the result of a job. Then reports all cases up to the first incomplete one. */
static void plan_end_job(void *context, const struct scenario_job *job)
{
    struct plan_batch *batch = context;
    struct plan_slot *slot = batch->slot_of[job - batch->job];

    plan_remove_scratch(slot->job);
    plan_take_result(batch, slot, &slot->why);
    plan_tell(batch, (size_t)(slot - batch->slot) + 1);
}

/* Runs the cases of a batch, and reports each. */
static enum error_code plan_run_batch(struct plan_batch *batch, const struct plan_case *list,
                                      struct error *error)
{
    const struct scenario_jobs_options options = {.parallel = batch->options->parallel,
                                                  .program = batch->plan->program,
                                                  .ended = plan_end_job,
                                                  .context = batch};
    enum error_code code;
    const struct rig *rig;
    struct arena arena;
    struct error unused;

    batch->slot = arena_alloc(batch->arena, batch->nslot, sizeof *batch->slot);
    batch->job = arena_alloc(batch->arena, batch->nslot, sizeof *batch->job);
    batch->slot_of = arena_alloc(batch->arena, batch->nslot, sizeof *batch->slot_of);
    if (!batch->slot || !batch->job || !batch->slot_of) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu cases", batch->nslot);
    }
    for (size_t i = 0; i < batch->nslot; i++) {
        batch->slot[i].one = &list[i];
        plan_prepare_case(batch, &batch->slot[i], &batch->slot[i].why);
    }

    /* Load the rig of the first case once. The forked processes then find its files, meshes and
     * solids in the stores. Ignore errors, because the case reports them. */
    if (batch->njob > 1 && !arena_init(&arena, RIG_MEMORY, &unused)) {
        scenario_load_rig(batch->job[0].scenario, &arena, &rig, &unused);
        arena_fini(&arena);
    }
    code = scenario_jobs_run(batch->job, batch->njob, &options, error);

    /* Remove the scratch folders that an error has left */
    for (size_t j = 0; j < batch->njob; j++) {
        plan_remove_scratch(&batch->job[j]);
    }
    if (!code) {
        plan_tell(batch, batch->nslot);
    }
    return code;
}

enum error_code plan_run_cases(const struct plan *plan, const struct plan_run_options *options,
                               struct error *error)
{
    const char *slash;
    char path[PATH_MAX];
    enum error_code code = solid_store_open(error);

    /* The path cannot be a symbolic link, because it is made from the plan's name */
    plan_results_folder(plan, path);
    slash = strrchr(path, '/');
    folder_enclose(path, slash ? (size_t)(slash - path) + 1 : 0);
    code = code ? code : folder_make(path, NULL, error);
    for (size_t from = 0; !code && from < plan->nlist; from += BATCH) {
        struct arena arena;
        struct plan_batch batch = {.plan = plan,
                                   .options = options,
                                   .arena = &arena,
                                   .nslot =
                                       plan->nlist - from < BATCH ? plan->nlist - from : BATCH};

        code = arena_init(&arena, BATCH_MEMORY, error);
        if (!code) {
            code = plan_run_batch(&batch, &plan->list[from], error);
            arena_fini(&arena);
        }
    }
    solid_store_close();
    return code;
}
