/* SPDX-License-Identifier: Apache-2.0 */
/* Writes results as JUnit XML, one element per line. */
#include "app/scenario/jobs.h"

#include "base/markup.h"
#include "base/whole_file.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---- writing ---- */

/* Writes any text as an attribute's value or as content, on one line. */
static void junit_put_text(const char *text, FILE *out)
{
    markup_put_flags(out, text, MARKUP_ASCII | MARKUP_LINE_BREAKS);
}

/* Writes a property of a testcase. */
static void junit_put_property(const char *name, const char *value, FILE *out)
{
    fprintf(out, "        <property name=\"%s\" value=\"", name);
    junit_put_text(value, out);
    fputs("\"/>\n", out);
}

/* Writes a testcase with its properties and its failure. */
static void junit_write_case(const struct scenario_result *result, FILE *out)
{
    static const char *const element[] = {"", "failure", "error"};
    char number[32];

    /* The case, and the data to repeat it */
    fputs("    <testcase classname=\"scenarios.", out);
    junit_put_text(result->scenario->name, out);
    fputs("\" name=\"", out);
    junit_put_text(result->name, out);
    fprintf(out, "\" time=\"%.3f\">\n      <properties>\n", result->seconds);
    junit_put_property("file", result->scenario->file, out);
    if (result->scenario->values[0]) {
        junit_put_property("parameters", result->scenario->values, out);
    }
    if (result->ran) {
        snprintf(number, sizeof number, "%" PRIu64, result->seed);
        junit_put_property("seed", number, out);
        snprintf(number, sizeof number, "%016" PRIx64, result->state_hash);
        junit_put_property("state_hash", number, out);
    }
    fputs("      </properties>\n", out);

    /* The failure, and the place of the recording */
    if (result->status != SCENARIO_PASSED) {
        fprintf(out, "      <%s message=\"", element[result->status]);
        junit_put_text(result->message, out);
        fprintf(out, "\" type=\"%s\"/>\n",
                result->status == SCENARIO_FAILED ? "expectation" : "run");
    }
    if (result->record[0]) {
        fputs("      <system-out>", out);
        junit_put_text(result->record, out);
        fputs("/candump.log</system-out>\n", out);
    }
    fputs("    </testcase>\n", out);
}

/* Checks whether two results are of one scenario, and so of one suite. */
static bool junit_is_same_suite(const struct scenario_result *a, const struct scenario_result *b)
{
    return !strcmp(a->scenario->name, b->scenario->name);
}

/* Writes the totals of all results, or of those of one scenario, as attributes. */
static void junit_put_totals(const struct scenario_result *result, size_t count,
                             const struct scenario_result *of, FILE *out)
{
    size_t tests = 0, failures = 0, errors = 0;
    double seconds = 0.0;

    for (size_t i = 0; i < count; i++) {
        if (!of || junit_is_same_suite(&result[i], of)) {
            tests++;
            failures += result[i].status == SCENARIO_FAILED;
            errors += result[i].status == SCENARIO_BROKEN;
            seconds += result[i].seconds;
        }
    }
    fprintf(out, " tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" time=\"%.3f\">\n", tests, failures,
            errors, seconds);
}

enum error_code scenario_junit_write(const char *path, const struct scenario_result *result,
                                     size_t count, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);

    if (code) {
        return code;
    }
    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites", file.out);
    junit_put_totals(result, count, NULL, file.out);
    for (size_t i = 0; i < count; i++) {
        size_t first = 0;

        /* The first result of a scenario opens a suite for all of them */
        while (!junit_is_same_suite(&result[first], &result[i])) {
            first++;
        }
        if (first < i) {
            continue;
        }
        fputs("  <testsuite name=\"", file.out);
        junit_put_text(result[i].scenario->name, file.out);
        fputs("\"", file.out);
        junit_put_totals(result, count, &result[i], file.out);
        for (size_t k = i; k < count; k++) {
            if (junit_is_same_suite(&result[k], &result[i])) {
                junit_write_case(&result[k], file.out);
            }
        }
        fputs("  </testsuite>\n", file.out);
    }
    fputs("</testsuites>\n", file.out);
    return whole_file_close(&file, ERROR_NONE, error);
}
