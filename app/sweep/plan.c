/* SPDX-License-Identifier: Apache-2.0 */
/* Writes and reads plans. */
#include "app/sweep/plan.h"

#include "base/config.h"
#include "base/hash.h"
#include "base/input_file.h"
#include "base/memory_file.h"
#include "base/whole_file.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Reserved address space for a scenario and its rig, bytes. */
#define MEMORY ((size_t)1 << 30)

enum { LINE_MAX_BYTES = 1 << 16 }; /* longest accepted line of a plan */

/* A plan during writing. */
struct planner {
    const struct sweep *sweep;
    FILE *lines;
    const char *folder; /* resolved path of the plan's folder, with a slash at the end */
    const struct yaml_name *scenario; /* the present scenario */
    size_t ncase;                     /* number of cases so far */
    struct error *error;
};

static enum error_code plan_no_memory(struct error *error)
{
    return error_set(error, ERROR_MEMORY, "no memory left for a plan");
}

/* ---- writing ---- */

/* Writes the path of a file relative to the plan's folder. */
static enum error_code plan_relate_path(const char *folder, const char *file, char path[PATH_MAX],
                                        struct error *error)
{
    char whole[PATH_MAX];
    size_t same = 0, used = 0;

    if (!realpath(file, whole)) {
        return error_set_file(error, errno, file, "cannot be read");
    }

    /* Skip the common folders, go up with "../", then down to the file */
    for (size_t i = 0; folder[i] && folder[i] == whole[i]; i++) {
        same = folder[i] == '/' ? i + 1 : same;
    }
    path[0] = '\0';
    for (const char *at = folder + same; *at && used + 4 < PATH_MAX; at++) {
        used += *at == '/' ? (size_t)snprintf(path + used, PATH_MAX - used, "../") : 0;
    }
    snprintf(path + used, PATH_MAX - used, "%s", whole + same);
    return ERROR_NONE;
}

enum error_code plan_check_rig(struct scenario *scenario, uint64_t *hash, struct error *error)
{
    const struct rig *rig;
    struct arena arena;
    enum error_code code = arena_init(&arena, MEMORY, error);

    if (code) {
        return code;
    }
    code = scenario_load_rig(scenario, &arena, &rig, error);
    code = code ? code : scenario_bind(scenario, rig, error);
    if (!code) {
        *hash = rig->hash;
    }
    arena_fini(&arena);
    return code;
}

/* Writes the line of a case: scenario, values, seed and hash. */
static enum error_code plan_put_line(struct planner *planner, const struct scenario *scenario,
                                     uint64_t rig_hash)
{
    size_t number = ++planner->ncase;
    /* The seed of a case without its own seed: a hash of the sweep's seed and the case's number. It
     * has 52 bits, which every JSON reader keeps exactly */
    const uint64_t part[2] = {(uint64_t)planner->sweep->seed, number};
    uint64_t seed = yaml_has(&scenario->mark, "seed")
                        ? (uint64_t)scenario->seed
                        : hash_bytes(HASH_START, part, sizeof part) >> 12;
    char hash[PLAN_HASH], path[PATH_MAX];
    json_t *values = json_object(), *line;
    enum error_code code = plan_relate_path(planner->folder, scenario->file, path, planner->error);

    if (code) {
        json_decref(values);
        return code;
    }
    if (number > SWEEP_CASES_MAX) {
        json_decref(values);
        return yaml_error(planner->error, &planner->scenario->mark,
                          "found more than %d cases with those of the scenarios' own parameters, "
                          "expected fewer",
                          SWEEP_CASES_MAX);
    }

    /* The hash covers all inputs of the case; the values are stored as text */
    plan_hash_case(scenario, rig_hash, seed, planner->sweep->program, hash);
    for (size_t i = 0; i < scenario->nvalue; i++) {
        json_object_set_new(values, scenario->value[i].name, json_string(scenario->value[i].text));
    }
    line =
        json_pack("{s:I, s:s, s:s, s:o, s:I, s:s}", "case", (json_int_t)number, "scenario", path,
                  "name", scenario->name, "values", values, "seed", (json_int_t)seed, "hash", hash);
    if (!line || json_dumpf(line, planner->lines, JSON_PRESERVE_ORDER)) {
        code = plan_no_memory(planner->error);
    }
    fputc('\n', planner->lines);
    json_decref(line);
    return code;
}

/* Adds the origin of a case in the sweep to its error: the scenario, or the value at `mark` with
 * the other values. */
static enum error_code plan_blame(const struct planner *planner, const struct yaml_mark *mark,
                                  const struct scenario_value *value)
{
    char text[200] = "";
    size_t used = 0;

    if (!planner->sweep->nparameter) {
        mark = &planner->scenario->mark;
        return error_prefix(planner->error, "%s:%d:%d", mark->file, mark->line, mark->column);
    }
    for (size_t i = 0; i < planner->sweep->nparameter && used < sizeof text; i++) {
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%s = %s", i ? ", " : "",
                                 value[i].name, value[i].text);
    }
    return error_prefix(planner->error, "%s:%d:%d: with %s", mark->file, mark->line, mark->column,
                        text);
}

/* Writes a line for each case of the scenario with these values. Checks the rig if mark is set or
 * there are several cases; otherwise *rig_hash must be known. If rig_hash is NULL, it checks and
 * writes nothing. */
static enum error_code plan_cases(struct planner *planner, const char *path,
                                  const struct scenario_value *value, const struct yaml_mark *mark,
                                  uint64_t *rig_hash)
{
    uint64_t hash;
    struct scenario *cases;
    struct arena arena;
    size_t count;
    enum error_code code = arena_init(&arena, MEMORY, planner->error);

    if (code) {
        return code;
    }
    code = scenario_read_with(path, value, planner->sweep->nparameter, &arena, &cases, &count,
                              planner->error);
    for (size_t i = 0; !code && i < count; i++) {
        if (cases[i].host == SCENARIO_HOST_PROGRAM && !planner->sweep->program) {
            code = yaml_error(planner->error, &cases[i].mark,
                              "found host: program, expected the key program of the sweep");
        } else if (mark || count > 1) {
            code = plan_check_rig(&cases[i], rig_hash ? rig_hash : &hash, planner->error);
        }
        if (!code && rig_hash) {
            code = plan_put_line(planner, &cases[i], *rig_hash);
        }
    }
    arena_fini(&arena);
    return code == ERROR_INPUT ? plan_blame(planner, mark ? mark : &planner->scenario->mark, value)
                               : code;
}

/* Checks the rig with both ends of each range of drawn values. Values between are assumed to be
 * valid too. */
static enum error_code plan_check_ends(struct planner *planner, const char *path,
                                       struct scenario_value *value)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < planner->sweep->nparameter; i++) {
        const struct sweep_parameter *parameter = &planner->sweep->parameter[i];
        const double *ends =
            yaml_has(&parameter->mark, "uniform") ? parameter->uniform : parameter->limits;
        const char *drawn = value[i].text;

        for (int end = 0; parameter->drawn && end < 2 && !code; end++) {
            char text[SCENARIO_VALUE_MAX];

            snprintf(text, sizeof text, "%.9g", ends[end]);
            value[i].text = text;
            code = plan_cases(planner, path, value, &parameter->mark, NULL);
        }
        value[i].text = drawn;
    }
    return code;
}

/* Writes the cases of a combination, one per sample. */
static enum error_code plan_put_combination(struct planner *planner, const char *path,
                                            size_t combination, uint64_t *rig_hash)
{
    const struct sweep *sweep = planner->sweep;
    struct scenario_value value[SCENARIO_PARAMETERS_MAX];
    struct arena arena;
    enum error_code code = arena_init(&arena, MEMORY, planner->error);

    if (code) {
        return code;
    }

    /* Check the rig with the first sample; use its hash for the other samples */
    for (size_t i = 0; !code && i < (size_t)sweep->samples; i++) {
        const struct yaml_mark *mark = sweep->nparameter ? &sweep->parameter[0].mark : &sweep->mark;

        code = sweep_values(sweep, combination, i, &arena, value, planner->error);
        code = code ? code : plan_cases(planner, path, value, i ? NULL : mark, rig_hash);
        if (!code && i == 0) {
            code = plan_check_ends(planner, path, value);
        }
    }
    arena_fini(&arena);
    return code;
}

/* Finds a scenario's file, and writes its cases for all combinations. */
static enum error_code plan_put_scenario(struct planner *planner, const struct yaml_name *scenario,
                                         struct arena *arena)
{
    const struct sweep *sweep = planner->sweep;
    const char *path;
    uint64_t rig_hash = 0;
    enum error_code code;

    planner->scenario = scenario;
    if (strpbrk(scenario->name, "/.")) {
        code = yaml_resolve_path(&scenario->mark, scenario->name, arena, &path, planner->error);
    } else {
        code = config_locate_from(CONFIG_SCENARIO, scenario->name, sweep->mark.file, arena, &path,
                                  planner->error);
        code = code ? error_prefix(planner->error, "%s:%d:%d", scenario->mark.file,
                                   scenario->mark.line, scenario->mark.column)
                    : ERROR_NONE;
    }
    if (!code && access(path, R_OK)) {
        code = error_set_file(planner->error, errno, path, "cannot be read");
        error_prefix(planner->error, "%s:%d:%d", scenario->mark.file, scenario->mark.line,
                     scenario->mark.column);
    }
    for (size_t c = 0; !code && c < sweep->combinations; c++) {
        code = plan_put_combination(planner, path, c, &rig_hash);
    }
    return code;
}

/* Refuses a plan if its folder of results has results of another plan. Checks the first result that
 * can be read. */
static enum error_code plan_check_old_results(const char *path, const char *id, struct arena *arena,
                                              struct error *error)
{
    char folder[PATH_MAX], file[PATH_MAX + 300];
    struct plan_result result = {.plan = ""};
    const struct dirent *entry;
    DIR *directory;

    plan_results_folder(&(struct plan){.path = path}, folder);
    directory = opendir(folder);
    while (directory && !*result.plan && (entry = readdir(directory))) {
        snprintf(file, sizeof file, "%s/%s", folder, entry->d_name);
        if (*entry->d_name != '.' && plan_read_result(file, arena, &result, NULL)) {
            *result.plan = '\0';
        }
    }
    if (directory) {
        closedir(directory);
    }
    return !*result.plan || !strcmp(result.plan, id)
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%.200s: found results of plan %s, this is %s: remove the folder or "
                           "give the plan another name",
                           folder, result.plan, id);
}

/* Writes the plan file: a head with the id, which is a hash of the plan, then one line per case. */
static enum error_code plan_save(const struct planner *planner, const char *path, const char *lines,
                                 struct arena *arena, struct error *error)
{
    const struct sweep *sweep = planner->sweep;
    struct whole_file file;
    uint64_t sum = hash_bytes(HASH_START, lines, strlen(lines));
    char id[PLAN_HASH];
    json_t *head;
    enum error_code code;

    /* The id covers the lines, the name and the program */
    sum = hash_bytes(sum, sweep->name, strlen(sweep->name));
    sum = sweep->program ? hash_bytes(sum, sweep->program, strlen(sweep->program)) : sum;
    snprintf(id, sizeof id, "%016" PRIx64, sum);
    code = plan_check_old_results(path, id, arena, error);
    code = code ? code : whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    head = json_pack("{s:i, s:s, s:s, s:I, s:s, s:s}", "plan", PLAN_FORMAT_VERSION, "name",
                     sweep->name, "description", sweep->description ? sweep->description : "",
                     "cases", (json_int_t)planner->ncase, "program",
                     sweep->program ? sweep->program : "", "id", id);
    if (!head || json_dumpf(head, file.out, JSON_PRESERVE_ORDER)) {
        code = plan_no_memory(error);
    }
    json_decref(head);
    fprintf(file.out, "\n%s", lines);
    return whole_file_close(&file, code, error);
}

/* Finds the resolved path of a file's folder, with a slash at the end. */
static enum error_code plan_find_folder(const char *path, char folder[PATH_MAX],
                                        struct error *error)
{
    const char *slash = strrchr(path, '/');
    char name[PATH_MAX];
    size_t length;

    snprintf(name, sizeof name, "%.*s", slash ? (int)(slash - path) + 1 : 1, slash ? path : ".");
    if (!realpath(name, folder)) {
        return error_set_file(error, errno, name, "cannot be found");
    }
    length = strlen(folder);
    if (folder[length - 1] != '/' && length + 1 < PATH_MAX) {
        memcpy(folder + length, "/", 2);
    }
    return ERROR_NONE;
}

enum error_code plan_write(const char *path_of_sweep, const char *path, size_t *ncase,
                           struct error *error)
{
    struct sweep sweep;
    struct memory_file lines = {.text = NULL};
    struct planner planner = {.sweep = &sweep, .error = error};
    char folder[PATH_MAX];
    struct arena arena;
    enum error_code code = arena_init(&arena, MEMORY, error);

    if (code) {
        return code;
    }
    code = sweep_read(path_of_sweep, &arena, &sweep, error);
    code = code ? code : plan_find_folder(path, folder, error);
    if (code) {
        goto done;
    }
    planner.folder = folder;

    /* Make the lines in memory first, because the head contains their number and hash */
    planner.lines = memory_file_open(&lines);
    if (!planner.lines) {
        code = plan_no_memory(error);
        goto done;
    }

    /* Write the cases of all scenarios */
    code = ERROR_NONE;
    for (size_t i = 0; !code && i < planner.sweep->nscenario; i++) {
        code = plan_put_scenario(&planner, &planner.sweep->scenario[i], &arena);
    }
    if (code) {
        fclose(planner.lines);
    } else {
        code = memory_file_close(planner.lines, &lines, "a plan", error);
    }
    code = code ? code : plan_save(&planner, path, lines.text, &arena, error);
    *ncase = planner.ncase;
done:
    free(lines.text);
    arena_fini(&arena);
    return code;
}

/* ---- reading ---- */

/* Sets the error for invalid content of a line. */
static enum error_code plan_unexpected(const char *path, size_t line, const char *what,
                                       struct error *error)
{
    return error_set(error, ERROR_INPUT,
                     "%.200s:%zu: found no %s, expected a plan as test --plan writes it", path,
                     line, what);
}

enum error_code plan_newer(const char *path, struct error *error)
{
    return error_set(error, ERROR_INPUT,
                     "%.200s:1: found a newer format, expected %d at most: a newer coman-hil has "
                     "written the file",
                     path, PLAN_FORMAT_VERSION);
}

/* Reads a case from its line. Returns false if the line is not this case, or without memory. */
static bool plan_take_case(const char *text, size_t number, const char *folder, struct arena *arena,
                           struct plan_case *out)
{
    json_t *line = json_loads(text, JSON_REJECT_DUPLICATES, NULL), *values, *value;
    const char *file, *name, *hash, *key;
    char path[2 * PATH_MAX];
    json_int_t given, seed;
    bool good =
        line && !json_unpack(line, "{s:I, s:s, s:s, s:o, s:I, s:s}", "case", &given, "scenario",
                             &file, "name", &name, "values", &values, "seed", &seed, "hash", &hash);

    good = good && given == (json_int_t)number && json_is_object(values) && seed >= 0 &&
           strlen(hash) == PLAN_HASH - 1 && json_object_size(values) <= SCENARIO_PARAMETERS_MAX;

    /* Paths in a plan are relative to its folder */
    if (good) {
        snprintf(path, sizeof path, "%s%s", folder, file);
        *out = (struct plan_case){.number = number, .seed = (uint64_t)seed};
        out->scenario = arena_strdup(arena, path);
        out->file = arena_strdup(arena, file);
        out->name = arena_strdup(arena, name);
        out->value = arena_alloc(arena, json_object_size(values), sizeof *out->value);
        memcpy(out->hash, hash, PLAN_HASH);
        good = out->scenario && out->file && out->name && out->value;
        json_object_foreach(values, key, value)
        {
            if (good && json_is_string(value)) {
                out->value[out->nvalue++] = (struct scenario_value){
                    arena_strdup(arena, key), arena_strdup(arena, json_string_value(value))};
            }
        }
    }
    json_decref(line);
    return good;
}

/* Reads the head of a plan. *newer is true if a newer program wrote the plan. */
static bool plan_take_head(const char *text, struct arena *arena, struct plan *plan, bool *newer)
{
    json_t *line = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    const json_t *version = json_object_get(line, "plan");
    const char *name, *description, *program, *id;
    json_int_t cases;
    bool good = line &&
                !json_unpack(line, "{s:s, s:s, s:I, s:s, s:s}", "name", &name, "description",
                             &description, "cases", &cases, "program", &program, "id", &id) &&
                json_integer_value(version) == PLAN_FORMAT_VERSION && cases >= 1 &&
                cases <= SWEEP_CASES_MAX && strlen(id) == PLAN_HASH - 1;

    *newer = json_integer_value(version) > PLAN_FORMAT_VERSION;
    if (good) {
        plan->name = arena_strdup(arena, name);
        plan->description = arena_strdup(arena, description);
        plan->program = *program ? arena_strdup(arena, program) : NULL;
        plan->ncase = (size_t)cases;
        memcpy(plan->id, id, PLAN_HASH);
        good = plan->name && plan->description && (plan->program || !*program);
    }
    json_decref(line);
    return good;
}

/* Reads the lines of the cases. Parses only the requested cases. */
static enum error_code plan_read_lines(FILE *in, char *line, size_t first, size_t last,
                                       struct arena *arena, struct plan *plan, struct error *error)
{
    char folder[PATH_MAX];
    const char *slash = strrchr(plan->path, '/');
    size_t count = 0;

    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - plan->path) + 1 : 0, plan->path);
    while (fgets(line, LINE_MAX_BYTES, in)) {
        count++;
        if (!strchr(line, '\n')) {
            return plan_unexpected(plan->path, count + 1, "end of a line", error);
        }
        if (count > plan->ncase ||
            ((!last || (count >= first && count <= last)) &&
             !plan_take_case(line, count, folder, arena, &plan->list[plan->nlist++]))) {
            return plan_unexpected(plan->path, count + 1, "case", error);
        }
        if (count == last) {
            return ERROR_NONE;
        }
    }
    return count == plan->ncase && !last ? ERROR_NONE
                                         : plan_unexpected(plan->path, count + 2, "case", error);
}

enum error_code plan_read(const char *path, size_t first, size_t last, struct arena *arena,
                          struct plan *plan, struct error *error)
{
    char *line = malloc(LINE_MAX_BYTES);
    FILE *in;
    enum error_code code = input_file_stream(path, &in, error);
    bool newer = false;

    *plan = (struct plan){.path = path};
    if (code || !line) {
        code = code ? code : plan_no_memory(error);
        goto done;
    }
    if (!fgets(line, LINE_MAX_BYTES, in) || !plan_take_head(line, arena, plan, &newer)) {
        code = newer ? plan_newer(path, error) : plan_unexpected(path, 1, "head", error);
        goto done;
    }

    /* first = last = 0 requests all cases */
    if (last > plan->ncase || first > last) {
        code = error_set(error, ERROR_INPUT, "%.200s: found case %zu, expected 1 to %zu", path,
                         last, plan->ncase);
        goto done;
    }
    plan->list = arena_alloc(arena, last ? last - first + 1 : plan->ncase, sizeof *plan->list);
    code = plan->list ? plan_read_lines(in, line, first, last, arena, plan, error)
                      : plan_no_memory(error);
done:
    if (in) {
        fclose(in);
    }
    free(line);
    return code;
}
