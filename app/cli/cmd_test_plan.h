/* SPDX-License-Identifier: Apache-2.0 */
/* Does what coman-hil test does with plans (app/sweep/plan.h); each function returns an exit
 * status. Not RT-safe. */
#ifndef APP_CLI_CMD_TEST_PLAN_H
#define APP_CLI_CMD_TEST_PLAN_H

#include <stddef.h>

/* Returns what a file is that is no scenario, and the options it is given with, as text for a
 * message: a sweep or a plan; NULL = it is neither. */
const char *test_plan_describe(const char *path);

/* Makes a plan (--plan): output is the plan's file. */
int test_plan_sweep(const char *sweep, const char *output);

/* Runs cases (--case): cases is a number or a range, FIRST-LAST; parallel of them at a time.
 * STATUS_OK when there are results, whatever the verdicts, so that an engine repeats only cases
 * without one. output: run one case again, and record a failure there; NULL = no. */
int test_plan_cases(const char *plan, const char *cases, size_t parallel, const char *output);

/* Merges the results (--merge): STATUS_FAILED when some case did not pass. */
int test_plan_merge(const char *plan);

#endif
