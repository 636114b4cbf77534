/* SPDX-License-Identifier: Apache-2.0 */
/* Writes results as JUnit XML, one element per line. */
#include "app/scenario/jobs.h"

#include "base/markup.h"
#include "base/memory_file.h"
#include "base/whole_file.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SUITES_MAX = 4096, SUITE_NAME = 256 };

/* The testcases of one scenario, with their totals. */
struct suite {
    char name[SUITE_NAME]; /* name of the scenario, which needs no escapes */
    size_t tests, failures, errors;
    double seconds;
    struct memory_file body; /* the testcases */
    FILE *to;
};

struct suites {
    size_t count;
    struct suite suite[SUITES_MAX];
};

/* ---- writing ---- */

/* Writes any text as an attribute's value or as content, on one line. */
static void junit_put_text(const char *text, FILE *out)
{
    markup_put_flags(out, text, MARKUP_ASCII | MARKUP_LINE_BREAKS);
}

/* Returns the suite with a name, a new one if needed; NULL without room or memory. */
static struct suite *junit_find_suite(struct suites *suites, const char *name)
{
    struct suite *suite;

    for (size_t i = 0; i < suites->count; i++) {
        if (strcmp(suites->suite[i].name, name) == 0) {
            return &suites->suite[i];
        }
    }
    if (suites->count == SUITES_MAX) {
        return NULL;
    }
    suite = &suites->suite[suites->count];
    snprintf(suite->name, sizeof suite->name, "%s", name);
    suite->to = memory_file_open(&suite->body);
    suites->count += suite->to != NULL;
    return suite->to ? suite : NULL;
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

/* Frees all suites; suites may be NULL. */
static void junit_free_suites(struct suites *suites)
{
    for (size_t i = 0; suites && i < suites->count; i++) {
        if (suites->suite[i].to) {
            fclose(suites->suite[i].to);
        }
        free(suites->suite[i].body.text);
    }
    free(suites);
}

/* Writes the suites with their totals; `all` receives the sums. */
static enum error_code junit_write_suites(struct suites *suites, const char *path,
                                          struct suite *all, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);
    FILE *out = file.out;

    if (code) {
        return code;
    }

    /* The totals precede the suites */
    for (size_t i = 0; i < suites->count; i++) {
        const struct suite *suite = &suites->suite[i];

        all->tests += suite->tests;
        all->failures += suite->failures;
        all->errors += suite->errors;
        all->seconds += suite->seconds;
    }
    fprintf(out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
            "<testsuites tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" time=\"%.3f\">\n",
            all->tests, all->failures, all->errors, all->seconds);
    for (size_t i = 0; i < suites->count && !code; i++) {
        struct suite *suite = &suites->suite[i];

        fprintf(out,
                "  <testsuite name=\"%s\" tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" "
                "time=\"%.3f\">\n",
                suite->name, suite->tests, suite->failures, suite->errors, suite->seconds);
        code = memory_file_close(suite->to, &suite->body, "the results", error);
        suite->to = NULL;
        fputs(code ? "" : suite->body.text, out);
        fputs("  </testsuite>\n", out);
    }
    fputs("</testsuites>\n", out);
    return whole_file_close(&file, code, error);
}

enum error_code scenario_junit_write(const char *path, const struct scenario_result *result,
                                     size_t count, struct error *error)
{
    struct suites *suites = calloc(1, sizeof *suites);
    enum error_code code = ERROR_NONE;
    struct suite all = {.tests = 0};

    for (size_t i = 0; i < count && !code; i++) {
        struct suite *suite = suites ? junit_find_suite(suites, result[i].scenario->name) : NULL;

        if (!suite) {
            code = error_set(error, ERROR_MEMORY, "no memory left for %zu results", count);
            break;
        }
        junit_write_case(&result[i], suite->to);
        suite->tests++;
        suite->failures += result[i].status == SCENARIO_FAILED;
        suite->errors += result[i].status == SCENARIO_BROKEN;
        suite->seconds += result[i].seconds;
    }
    if (!suites) {
        code = error_set(error, ERROR_MEMORY, "no memory left for results");
    }
    code = code ? code : junit_write_suites(suites, path, &all, error);
    junit_free_suites(suites);
    return code;
}
