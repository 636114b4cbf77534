/* SPDX-License-Identifier: Apache-2.0 */
/* What coman-hil test does with plans (app/sweep/plan.h); each returns an exit status. Not
 * RT-safe. */
#ifndef APP_CLI_CMD_TEST_PLAN_H
#define APP_CLI_CMD_TEST_PLAN_H

#include <stddef.h>

/* --plan: output is the plan's file. */
int test_plan_sweep(const char *sweep, const char *output);

/* --case: STATUS_OK when there is a result, whatever the verdict, so that an engine repeats only
 * what has none. output: run again, and record a failure there; NULL = no. */
int test_plan_case(const char *plan, size_t number, const char *output);

/* --merge: STATUS_FAILED when some case did not pass. */
int test_plan_merge(const char *plan);

#endif
