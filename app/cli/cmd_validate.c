/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil validate: compares rigs with measured benches. */
#include "app/cli/cli.h"
#include "app/identify/identify.h"
#include "base/config.h"
#include "manual/validate.h"

struct validate_options {
    const char *const *bench;
    const char *report;
};

/* Prints the verdict of a bench. */
static void print_validation(const struct validation *v)
{
    const struct bench *bench = &v->bench.bench;
    const bool points = bench->npoint > 0;
    const double scale = points ? 100.0 : 1.0,
                 limit = points ? bench->limit_share : bench->limit_rad;
    const char *unit = points ? "%" : "rad";
    const int digits = points ? 1 : 4;

    printf("%-6s %-20s mean error %.*f %s", v->passed ? "passed" : "failed", bench->name, digits,
           scale * v->mean, unit);
    if (limit > 0.0) {
        printf(", limit %.*f", digits, scale * limit);
    }
    for (size_t i = 0; i < bench->npublished; i++) {
        const struct bench_published *one = &bench->published[i];

        printf("; %s %.*f", one->what, digits,
               scale * (points ? one->error_share : one->error_rad));
    }
    putchar('\n');
}

/* Lists the paths of the benches to run: the given ones, or all installed ones. */
static enum error_code list_benches(const char *const *given, struct arena *arena,
                                    const char ***path, size_t *count, struct error *error)
{
    struct config_entry *entry;
    enum error_code code = ERROR_NONE;
    char found[PATH_MAX];

    *count = 0;
    if (!given[0]) {
        code = config_list(CONFIG_VALIDATION, arena, &entry, count, error);
    }
    while (!code && given[0] && given[*count]) {
        ++*count;
    }
    *path = code ? NULL : arena_alloc(arena, *count + 1, sizeof **path);
    if (!code && !*path) {
        return error_set(error, ERROR_MEMORY, "no memory for benches");
    }
    for (size_t i = 0; i < *count && !code; i++) {
        if (given[0]) {
            code = config_locate(CONFIG_VALIDATION, given[i], found, error);
            (*path)[i] = code ? NULL : arena_strdup(arena, found);
        } else {
            (*path)[i] = entry[i].path;
        }
    }
    return code;
}

/* Runs all benches and writes the page. *failed is whether one exceeded its limit. */
static enum error_code validate_all(const struct validate_options *o, struct arena *arena,
                                    bool *failed, struct error *error)
{
    struct validation *validation;
    const char **path;
    size_t count;
    enum error_code code = list_benches(o->bench, arena, &path, &count, error);

    if (code) {
        return code;
    }
    validation = arena_alloc(arena, count + 1, sizeof *validation);
    if (!validation) {
        return error_set(error, ERROR_MEMORY, "no memory for benches");
    }
    for (size_t i = 0; i < count && !code; i++) {
        code = validation_run(path[i], arena, &validation[i], error);
        if (!code) {
            print_validation(&validation[i]);
            *failed |= !validation[i].passed;
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
        .summary = "Hold simulated drives against measured ones.",
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
