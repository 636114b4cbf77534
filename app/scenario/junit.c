/* SPDX-License-Identifier: Apache-2.0 */
/* Writes results as JUnit XML, one element per line. The file is valid in the schemas of Ant and of
 * Jenkins' xUnit plugin (tests/service/junit.py). A testcase therefore has no properties and no
 * output. */
#include "app/scenario/jobs.h"

#include "base/markup.h"
#include "base/whole_file.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char *const element[] = {"", "failure", "error"};

/* Writes a text on one line, escaped for an attribute's value or for content. */
static void junit_put_text(const char *text, FILE *out)
{
    markup_put_flags(out, text, MARKUP_ASCII | MARKUP_LINE_BREAKS);
}

/* Writes a property of a suite. name: the testcase that it describes; "" = all. */
static void junit_put_property(const char *name, const char *what, const char *value, FILE *out)
{
    fputs("      <property name=\"", out);
    junit_put_text(name, out);
    fprintf(out, "%s%s\" value=\"", *name ? " " : "", what);
    junit_put_text(value, out);
    fputs("\"/>\n", out);
}

/* Writes a testcase; a failure names its recording. */
static void junit_put_case(const struct scenario_result *result, FILE *out)
{
    fputs("    <testcase classname=\"scenarios.", out);
    junit_put_text(result->scenario->name, out);
    fputs("\" name=\"", out);
    junit_put_text(result->name, out);
    fprintf(out, "\" time=\"%.3f\"", result->seconds);
    if (result->status == SCENARIO_PASSED) {
        fputs("/>\n", out);
        return;
    }
    fprintf(out, ">\n      <%s type=\"%s\" message=\"", element[result->status],
            result->status == SCENARIO_FAILED ? "expectation" : "run");
    junit_put_text(result->message, out);
    fputs("\">", out);
    junit_put_text(result->message, out);
    if (result->record[0]) {
        fputs("&#10;recording: ", out);
        junit_put_text(result->record, out);
    }
    fprintf(out, "</%s>\n    </testcase>\n", element[result->status]);
}

/* Writes the suite `place`: the results i with of[i] == place. */
static void junit_put_suite(const struct scenario_result *result, const size_t *of, size_t count,
                            size_t suite, const char *place, FILE *out)
{
    const struct scenario_result *first = NULL;
    size_t tests[3] = {0};
    double seconds = 0.0;

    for (size_t i = count; i-- > 0;) {
        if (of[i] == suite) {
            first = &result[i];
            tests[result[i].status]++;
            seconds += result[i].seconds;
        }
    }
    fprintf(out,
            "  <testsuite id=\"%zu\" package=\"scenarios\" name=\"%s\" %s tests=\"%zu\" "
            "failures=\"%zu\" errors=\"%zu\" time=\"%.3f\">\n    <properties>\n",
            suite, first->scenario->name, place, tests[0] + tests[1] + tests[2],
            tests[SCENARIO_FAILED], tests[SCENARIO_BROKEN], seconds);
    junit_put_property("", "file", first->scenario->file, out);
    for (size_t i = 0; i < count; i++) {
        if (of[i] == suite) {
            /* Write the data that are needed to repeat a case, as properties */
            char number[32];

            if (result[i].scenario->values[0]) {
                junit_put_property(result[i].name, "parameters", result[i].scenario->values, out);
            }
            if (result[i].ran) {
                snprintf(number, sizeof number, "%" PRIu64, result[i].seed);
                junit_put_property(result[i].name, "seed", number, out);
                snprintf(number, sizeof number, "%016" PRIx64, result[i].state_hash);
                junit_put_property(result[i].name, "state_hash", number, out);
            }
        }
    }
    fputs("    </properties>\n", out);
    for (size_t i = 0; i < count; i++) {
        if (of[i] == suite) {
            junit_put_case(&result[i], out);
        }
    }
    fputs("    <system-out>", out);
    for (size_t i = 0; i < count; i++) {
        if (of[i] == suite && result[i].record[0]) {
            junit_put_text(result[i].record, out);
            fputs("/candump.log&#10;", out);
        }
    }
    fputs("</system-out>\n    <system-err></system-err>\n  </testsuite>\n", out);
}

enum error_code scenario_junit_write(const char *path, const struct scenario_result *result,
                                     size_t count, time_t begun, struct error *error)
{
    size_t *of = calloc(count + 1, sizeof *of), *first = calloc(count + 1, sizeof *first);
    size_t suites = 0;
    struct whole_file file;
    char host[65] = "localhost", place[128];
    struct tm time;
    enum error_code code =
        of && first ? whole_file_open(&file, path, error)
                    : error_set(error, ERROR_MEMORY, "no memory left for %zu results", count);

    if (code) {
        goto done;
    }

    /* Write one suite per scenario, in the order of the results */
    for (size_t i = 0; i < count; i++) {
        while (of[i] < suites &&
               strcmp(result[first[of[i]]].scenario->name, result[i].scenario->name) != 0) {
            of[i]++;
        }
        if (of[i] == suites) {
            first[suites++] = i;
        }
    }
    gmtime_r(&begun, &time);
    if (begun && gethostname(host, sizeof host - 1)) {
        snprintf(host, sizeof host, "localhost");
    }
    strftime(place, sizeof place, "timestamp=\"%FT%T\" hostname=\"", &time);
    strcat(strcat(place, *host ? host : "localhost"), "\"");
    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n", file.out);
    for (size_t suite = 0; suite < suites; suite++) {
        junit_put_suite(result, of, count, suite, place, file.out);
    }
    fputs("</testsuites>\n", file.out);
    code = whole_file_close(&file, code, error);
done:
    free(of);
    free(first);
    return code;
}
