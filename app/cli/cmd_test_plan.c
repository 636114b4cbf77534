/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil test with plans: makes a plan, runs cases of it, merges the results. */
#include "app/cli/cmd_test_plan.h"

#include "app/sweep/plan.h"
#include "base/input_file.h"
#include "base/options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINES_MAX = 1000 }; /* in which a sweep names its scenarios */

/* Bytes of address space. */
#define MEMORY ((size_t)1 << 30)

const char *test_plan_describe(const char *path)
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

int test_plan_sweep(const char *sweep, const char *output)
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
                "--case: found \"%.40s\", expected a number or two as 1-500, each from 1 to "
                "%d",
                text, SWEEP_CASES_MAX);
        }
        at = *end ? end + 1 : at; /* one number is both */
    }
    return ERROR_NONE;
}

/* Prints the verdict of a case, or why it has none. */
static void test_case_ended(void *context, const struct plan_case *one,
                            const struct plan_result *result, const struct error *why)
{
    static const char *const word[] = {"passed", "failed", "broken"};
    int *status = context;

    if (!result) {
        *status = command_fail("test", why);
        return;
    }
    printf("case %zu %s%s%s\n", one->number, word[result->status], *result->message ? ": " : "",
           result->message);
    fflush(stdout);
}

int test_plan_cases(const char *path, const char *cases, size_t parallel, const char *output)
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

int test_plan_merge(const char *path)
{
    struct error error;
    size_t count, failed;

    if (plan_merge(path, &count, &failed, &error)) {
        return command_fail("test", &error);
    }
    printf("%zu cases: %zu passed, %zu did not\n", count, count - failed, failed);
    return failed ? STATUS_FAILED : STATUS_OK;
}
