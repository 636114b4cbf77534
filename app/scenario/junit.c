/* SPDX-License-Identifier: Apache-2.0 */
/* Results as JUnit XML, one element per line; and files of that form combined into one. */
#include "app/scenario/jobs.h"

#include "base/markup.h"
#include "base/memory_file.h"
#include "base/text.h"
#include "base/whole_file.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINE_BYTES = 1 << 16, SUITES_MAX = 4096, SUITE_NAME = 256 };

static const char declaration[] = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

struct suite {
    char name[SUITE_NAME]; /* as in the file: escaped */
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

/* Text as an attribute's value or as content, on one line whatever it holds. */
static void junit_put_text(const char *text, FILE *out)
{
    markup_put_flags(out, text, MARKUP_ASCII | MARKUP_LINE_BREAKS);
}

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

static void junit_put_property(const char *name, const char *value, FILE *out)
{
    fprintf(out, "        <property name=\"%s\" value=\"", name);
    junit_put_text(value, out);
    fputs("\"/>\n", out);
}

static void junit_write_case(const struct scenario_result *result, FILE *out)
{
    static const char *const element[] = {"", "failure", "error"};
    char number[32];

    /* Which case, and with what it can be repeated */
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

    /* What went wrong, and where the recording is */
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

static enum error_code junit_write_suites(struct suites *suites, const char *path,
                                          struct suite *all, struct error *error)
{
    struct whole_file file;
    enum error_code code = whole_file_open(&file, path, error);
    FILE *out = file.out;

    if (code) {
        return code;
    }

    /* The totals stand before the suites */
    for (size_t i = 0; i < suites->count; i++) {
        const struct suite *suite = &suites->suite[i];

        all->tests += suite->tests;
        all->failures += suite->failures;
        all->errors += suite->errors;
        all->seconds += suite->seconds;
    }
    fprintf(out, "%s<testsuites tests=\"%zu\" failures=\"%zu\" errors=\"%zu\" time=\"%.3f\">\n",
            declaration, all->tests, all->failures, all->errors, all->seconds);
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

/* ---- combining files ---- */

struct reader {
    const char *path;
    long line;
    char *text; /* LINE_BYTES */
    struct error *error;
};

static enum error_code junit_unexpected(const struct reader *reader, const char *expected)
{
    return error_set(reader->error, ERROR_INPUT, "%.200s:%ld: found \"%.40s\", expected %s",
                     reader->path, reader->line, reader->text, expected);
}

static bool junit_line_begins(const char *text, const char *with)
{
    return strncmp(text, with, strlen(with)) == 0;
}

/* The value of an attribute of the element in the line; false: there is none, or it is too long. */
static bool junit_attribute(const char *line, const char *name, char *value, size_t size)
{
    const char *at = strstr(line, name), *end;

    at = at ? at + strlen(name) : NULL;
    end = at ? strchr(at, '"') : NULL;
    if (!end || (size_t)(end - at) >= size) {
        return false;
    }
    snprintf(value, size, "%.*s", (int)(end - at), at);
    return true;
}

/* Adds a line of a suite, and counts it. */
static enum error_code junit_take_line(const struct reader *reader, struct suite *suite)
{
    const char *line = reader->text;
    double seconds;
    char time[32];

    if (junit_line_begins(line, "    <testcase ")) {
        if (!junit_attribute(line, " time=\"", time, sizeof time) ||
            !text_to_double(time, &seconds)) {
            return junit_unexpected(reader, "a testcase with a time");
        }
        suite->tests++;
        suite->seconds += seconds;
    } else if (junit_line_begins(line, "      <failure ")) {
        suite->failures++;
    } else if (junit_line_begins(line, "      <error ")) {
        suite->errors++;
    } else if (!junit_line_begins(line, "      <properties>") &&
               !junit_line_begins(line, "        <property ") &&
               !junit_line_begins(line, "      </properties>") &&
               !junit_line_begins(line, "      <system-out>") &&
               !junit_line_begins(line, "    </testcase>")) {
        return junit_unexpected(reader, "a line of a testcase as test --junit writes it");
    }
    fputs(line, suite->to);
    return ERROR_NONE;
}

/* Where in a file of suites a reader is. */
struct place {
    struct suite *suite; /* NULL = between suites */
    bool inside_case, done;
};

/* Takes a line after the first two of a file. */
static enum error_code junit_take_body(struct reader *reader, struct suites *suites,
                                       struct place *place)
{
    const char *line = reader->text;
    char name[SUITE_NAME];

    if (place->done) {
        return junit_unexpected(reader, "nothing after </testsuites>");
    }

    /* Between suites: one begins, or all have ended */
    if (!place->suite && junit_line_begins(line, "</testsuites>")) {
        place->done = true;
        return ERROR_NONE;
    }
    if (!place->suite) {
        if (!junit_line_begins(line, "  <testsuite ")) {
            return junit_unexpected(reader, "a testsuite");
        }
        if (!junit_attribute(line, " name=\"", name, sizeof name)) {
            return junit_unexpected(reader, "a testsuite with a name");
        }
        place->suite = junit_find_suite(suites, name);
        return place->suite
                   ? ERROR_NONE
                   : error_set(reader->error, ERROR_MEMORY, "%.200s: no memory left", reader->path);
    }

    /* In a suite: its end, or a line of a testcase */
    if (!place->inside_case && junit_line_begins(line, "  </testsuite>")) {
        place->suite = NULL;
        return ERROR_NONE;
    }
    place->inside_case = !junit_line_begins(line, "    </testcase>") &&
                         (place->inside_case || junit_line_begins(line, "    <testcase "));
    return junit_take_line(reader, place->suite);
}

static enum error_code junit_take_file(struct reader *reader, FILE *in, struct suites *suites)
{
    struct place place = {.suite = NULL};

    for (reader->line = 1; fgets(reader->text, LINE_BYTES, in); reader->line++) {
        const char *line = reader->text;
        enum error_code code;

        if (!strchr(line, '\n')) {
            return junit_unexpected(reader, "a shorter line");
        }
        if (reader->line == 1 ? strcmp(line, declaration) != 0
                              : reader->line == 2 && !junit_line_begins(line, "<testsuites ")) {
            return junit_unexpected(reader, "JUnit XML as test --junit writes it");
        }
        if (reader->line <= 2) {
            continue;
        }
        code = junit_take_body(reader, suites, &place);
        if (code) {
            return code;
        }
    }
    if (ferror(in)) {
        return error_set_file(reader->error, errno, reader->path, "cannot be read");
    }
    snprintf(reader->text, LINE_BYTES, "the end");
    return place.done ? ERROR_NONE : junit_unexpected(reader, "</testsuites>");
}

enum error_code scenario_junit_merge(const char *const *from, size_t count, const char *path,
                                     size_t *tests, size_t *failed, struct error *error)
{
    struct suites *suites = calloc(1, sizeof *suites);
    struct reader reader = {.text = malloc(LINE_BYTES), .error = error};
    enum error_code code = ERROR_NONE;
    struct suite all = {.tests = 0};

    if (!suites || !reader.text) {
        code = error_set(error, ERROR_MEMORY, "no memory left for results");
    }
    for (size_t i = 0; i < count && !code; i++) {
        FILE *in = fopen(from[i], "r");

        reader.path = from[i];
        code = in ? junit_take_file(&reader, in, suites)
                  : error_set_file(error, errno, from[i], "cannot be read");
        if (in) {
            fclose(in);
        }
    }
    code = code ? code : junit_write_suites(suites, path, &all, error);
    *tests = all.tests;
    *failed = all.failures + all.errors;
    junit_free_suites(suites);
    free(reader.text);
    return code;
}
