/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil test with plans: makes one, runs a case of it, merges the results. */
#include "app/cli/cmd_test_plan.h"

#include "app/sweep/plan.h"
#include "base/options.h"

#include <stdio.h>

/* Of address space. */
#define MEMORY ((size_t)1 << 30)

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

int test_plan_case(const char *path, size_t number, const char *output)
{
    static const char *const word[] = {"passed", "failed", "broken"};
    struct plan plan;
    struct plan_result result;
    struct arena arena;
    struct error error;
    enum error_code code = arena_init(&arena, MEMORY, &error);

    if (code) {
        return command_fail("test", &error);
    }
    code = plan_read(path, number, &arena, &plan, &error);
    code = code ? code : plan_run_case(&plan, output, &result, &arena, &error);
    if (!code) {
        printf("case %zu %s%s%s\n", number, word[result.status], *result.message ? ": " : "",
               result.message);
    }
    arena_fini(&arena);
    return code ? command_fail("test", &error) : STATUS_OK;
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
