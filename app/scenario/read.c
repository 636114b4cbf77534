/* SPDX-License-Identifier: Apache-2.0 */
/* Reads scenarios: first the parameters, then the document, once per combination of their
 * values. */
#include "app/scenario/private.h"

#include "base/config.h"
#include "base/hash.h"
#include "base/input_file.h"
#include "base/text.h"

#include <limits.h>
#include <stdlib.h>
#include <unistd.h>

#define AT(type, member) offsetof(struct type, member)

/* maximum size of a scenario file, before and after values are inserted, bytes */
enum { EXPANDED_MAX = 1 << 20 };

/* The mapping "parameters:" of a file, and the caller's values, which replace the file's values. */
struct parameters {
    struct yaml_mark mark;
    size_t count;
    struct scenario_parameter *parameter;
    const struct scenario_value *given;
    size_t ngiven;
};

static const struct yaml_field only_parameters[] = {
    YAML_ENTRIES("parameters", YAML_DICT, true, parameters, parameter, count,
                 scenario_parameter_schema),
};
static const struct yaml_schema parameters_schema =
    YAML_SCHEMA("the parameters", struct parameters, only_parameters);

/* ---- blocks of a file ---- */

/* Finds the block of a key: its line and the following indented lines. key: ends with a colon.
 * Returns false if the text has no such block. */
static bool find_block(const char *text, size_t size, const char *key, size_t *from, size_t *to)
{
    const size_t length = strlen(key);
    bool inside = false;

    for (size_t at = 0; at < size;) {
        const char *end = memchr(text + at, '\n', size - at);
        size_t next = end ? (size_t)(end - text) + 1 : size;

        if (inside && text[at] != ' ' && text[at] != '\n' && text[at] != '#') {
            *to = at;
            return true;
        }
        if (!inside && next - at >= length && !memcmp(text + at, key, length)) {
            inside = true;
            *from = at;
        }
        at = next;
    }
    *to = size;
    return inside;
}

/* Counts the line ends in a text. */
static size_t count_lines(const char *text, size_t size)
{
    size_t count = 0;

    for (size_t i = 0; i < size; i++) {
        count += text[i] == '\n';
    }
    return count;
}

/* ---- parameters ---- */

/* Returns the caller's value for a parameter; NULL = none, use the values of the file. */
static const char *given_value(const struct parameters *parameters, size_t index)
{
    const int at =
        TEXT_FIND(parameters->given, parameters->ngiven, name, parameters->parameter[index].name);

    return at < 0 ? NULL : parameters->given[at].text;
}

/* Returns the number of values of a parameter. */
static size_t parameter_values(const struct parameters *parameters, size_t index)
{
    const struct scenario_parameter *parameter = &parameters->parameter[index];

    return given_value(parameters, index) ? 1 : parameter->nvalue + parameter->nword;
}

/* Checks that words are plain names, so that they cannot change the structure of the document. */
static enum error_code check_words(const struct scenario_parameter *parameter, struct error *error)
{
    for (size_t i = 0; i < parameter->nword; i++) {
        const struct yaml_name *word = &parameter->word[i];

        if (!text_is_name(word->name)) {
            return yaml_error(error, &word->mark,
                              "found word \"%.60s\", expected letters, digits and _ - . only",
                              word->name);
        }
    }
    return ERROR_NONE;
}

/* Checks the parameters. *cases receives the product of their numbers of values. */
static enum error_code check_parameters(const struct parameters *given, size_t *cases,
                                        struct error *error)
{
    *cases = 1;
    for (size_t i = 0; i < given->count; i++) {
        const struct scenario_parameter *parameter = &given->parameter[i];

        if (!text_is_name(parameter->name) || (parameter->nvalue > 0) == (parameter->nword > 0)) {
            return yaml_error(error, &parameter->mark,
                              "found parameter \"%.40s\" with %zu values and %zu words, expected a "
                              "plain name and at least one value, or one word",
                              parameter->name, parameter->nvalue, parameter->nword);
        }

        /* Check the limit before the multiplication */
        if (i >= SCENARIO_PARAMETERS_MAX ||
            parameter_values(given, i) > SCENARIO_CASES_MAX / *cases) {
            return yaml_error(error, &parameter->mark,
                              "found too many parameters or values, expected at most %d parameters "
                              "and %d combinations",
                              SCENARIO_PARAMETERS_MAX, SCENARIO_CASES_MAX);
        }
        if (check_words(parameter, error)) {
            return ERROR_INPUT;
        }
        *cases *= parameter_values(given, i);
    }
    return ERROR_NONE;
}

/* Checks that each of the caller's values belongs to a parameter of the file. */
static enum error_code check_given(const char *name, const struct parameters *parameters,
                                   struct error *error)
{
    const struct yaml_names known = YAML_NAMES(parameters->parameter, parameters->count, name);
    const struct yaml_mark nowhere = {0};
    int unused;

    for (size_t i = 0; i < parameters->ngiven; i++) {
        if (yaml_find_name(known, "parameter", parameters->given[i].name, &nowhere, &unused,
                           error)) {
            return error_prefix(error, "%.200s", name);
        }
    }
    return ERROR_NONE;
}

/* Reads only the block of parameters. Empty lines replace the lines before it, so that messages
 * have the right line number. *cases receives the number of combinations. */
static enum error_code read_parameters(const char *name, const char *text, size_t size,
                                       struct arena *arena, struct parameters *out, size_t *cases,
                                       struct error *error)
{
    const struct parameters asked = *out;
    size_t from = 0, to = 0, lines;
    enum error_code code;
    char *alone;

    *cases = 1;
    if (!find_block(text, size, "parameters:", &from, &to)) {
        return check_given(name, out, error);
    }
    lines = count_lines(text, from);
    alone = arena_alloc(arena, lines + to - from + 1, 1);
    if (!alone) {
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", name);
    }
    memset(alone, '\n', lines);
    memcpy(alone + lines, text + from, to - from);
    code = yaml_read_text(name, alone, lines + to - from, &parameters_schema, arena, out, error);
    out->given = asked.given;
    out->ngiven = asked.ngiven;
    code = code ? code : check_parameters(out, cases, error);
    return code ? code : check_given(name, out, error);
}

/* Writes a parameter's value in combination `number` as text. The last parameter varies fastest. */
static void value_in(const struct parameters *given, size_t index, size_t number,
                     char text[SCENARIO_VALUE_MAX])
{
    const struct scenario_parameter *parameter = &given->parameter[index];
    const char *instead = given_value(given, index);

    if (instead) {
        snprintf(text, SCENARIO_VALUE_MAX, "%s", instead);
        return;
    }

    /* Decompose the number in mixed radix; each digit selects the value of a parameter */
    for (size_t i = given->count - 1; i > index; i--) {
        number /= parameter_values(given, i);
    }
    number %= parameter_values(given, index);
    if (parameter->nword) {
        snprintf(text, SCENARIO_VALUE_MAX, "%s", parameter->word[number].name);
    } else {
        snprintf(text, SCENARIO_VALUE_MAX, "%.15g", parameter->value[number]);
    }
}

/* Copies the text and replaces each ${NAME}. out has space for EXPANDED_MAX bytes. */
static enum error_code expand_parameters(const char *file, const char *text, size_t size,
                                         const struct parameters *given, size_t number, char *out,
                                         size_t *used, struct error *error)
{
    *used = 0;
    for (size_t at = 0; at < size;) {
        char name[64], value[SCENARIO_VALUE_MAX];
        size_t length;
        int index;

        if (*used + sizeof value > EXPANDED_MAX) {
            return error_set(error, ERROR_INPUT, "%s: found more than %d bytes, expected fewer",
                             file, EXPANDED_MAX);
        }

        /* Copy text outside ${NAME} */
        if (text[at] != '$' || at + 1 == size || text[at + 1] != '{') {
            out[(*used)++] = text[at++];
            continue;
        }
        for (length = 0; at + 2 + length < size && length + 1 < sizeof name &&
                         text[at + 2 + length] != '}' && text[at + 2 + length] != '\n';
             length++) {
            name[length] = text[at + 2 + length];
        }
        name[length] = '\0';

        /* Find the parameter's value in this combination */
        index = TEXT_FIND(given->parameter, given->count, name, name);
        if (index < 0 || at + 2 + length >= size || text[at + 2 + length] != '}') {
            /* Report, with line and column, a ${NAME} with an unknown parameter or without a
             * closing brace */
            const struct yaml_names known = YAML_NAMES(given->parameter, given->count, name);
            struct yaml_mark mark = {.file = file, .line = 1, .column = 1};
            enum error_code code;
            int unused;

            for (size_t i = 0; i < at; i++) {
                mark.column = text[i] == '\n' ? 1 : mark.column + 1;
                mark.line += text[i] == '\n';
            }
            code = yaml_find_name(known, "parameter", name, &mark, &unused, error);
            return code
                       ? code
                       : yaml_error(error, &mark,
                                    "found ${%.40s without its end, expected ${%.40s}", name, name);
        }
        value_in(given, (size_t)index, number, value);
        *used += (size_t)snprintf(out + *used, sizeof value, "%s", value);
        at += length + 3;
    }
    return ERROR_NONE;
}

/* Stores the values of this combination, and describes them as "a=1, b=2". */
static enum error_code keep_values(const struct parameters *given, size_t number,
                                   struct arena *arena, struct scenario *scenario,
                                   struct error *error)
{
    struct scenario_value *value = arena_alloc(arena, given->count, sizeof *value);
    size_t used = 0;

    scenario->values[0] = '\0';
    scenario->value = value;
    scenario->nvalue = given->count;
    for (size_t i = 0; value && i < given->count; i++) {
        char text[SCENARIO_VALUE_MAX];

        value_in(given, i, number, text);
        value[i].name = given->parameter[i].name;
        value[i].text = arena_strdup(arena, text);
        if (!value[i].text) {
            value = NULL;
        } else if (used < SCENARIO_TEXT) {
            used += (size_t)snprintf(scenario->values + used, SCENARIO_TEXT - used, "%s%s=%s",
                                     i ? ", " : "", value[i].name, value[i].text);
        }
    }
    return value || !given->count
               ? ERROR_NONE
               : error_set(error, ERROR_MEMORY, "no memory left for a scenario's parameters");
}

/* ---- changes of the rig ---- */

/* Moves the block "changes:" from the document to a rig file of its own; other lines keep their
 * line numbers. The line of the key `changes` is reserved for the rig's key `extends`. */
static enum error_code take_changes(const char *name, char *text, size_t size, struct arena *arena,
                                    const char **changes, size_t *changes_size, size_t *key_at,
                                    struct error *error)
{
    static const char key[] = "changes:";
    size_t from = 0, to = 0, first, indent;
    struct yaml_mark mark;
    char *copy;

    *changes = NULL;
    if (!find_block(text, size, key, &from, &to)) {
        return ERROR_NONE;
    }

    /* Require a mapping on separate lines; comments may precede it */
    mark = (struct yaml_mark){.file = name, .line = (int)count_lines(text, from) + 1, .column = 1};
    for (first = from + sizeof key - 1; first < to && text[first] == ' '; first++) {
    }
    if (first < to && text[first] != '\n' && text[first] != '#') {
        return yaml_error(error, &mark,
                          "found changes on the line of their key, expected lines below it");
    }
    do {
        const char *end = memchr(text + first, '\n', to - first);

        first = end ? (size_t)(end - text) + 1 : to;
        indent = first < to ? strspn(text + first, " ") : 0;
    } while (first < to && (text[first + indent] == '\n' || text[first + indent] == '#'));
    if (first >= to || indent == 0) {
        return yaml_error(error, &mark, "found no changes, expected keys of a rig");
    }

    /* Write empty lines, so that messages have the right line number, then the indentation of the
     * key `extends` */
    *key_at = count_lines(text, from) + indent;
    *changes_size = *key_at + 1 + (to - first) + count_lines(text + from, first - from);
    copy = arena_alloc(arena, *changes_size, 1);
    if (!copy) {
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", name);
    }
    memset(copy, '\n', *key_at - indent);
    memset(copy + *key_at - indent, ' ', indent);
    copy[*key_at] = '\0';
    memset(copy + *key_at + 1, '\n', count_lines(text + from, first - from));
    memcpy(copy + *changes_size - (to - first), text + first, to - first);
    for (size_t i = from; i < to; i++) {
        text[i] = text[i] == '\n' ? '\n' : ' ';
    }
    *changes = copy;
    return ERROR_NONE;
}

/* Writes "extends: RIG" into the line that take_changes has reserved. */
static enum error_code extend_rig(struct scenario *scenario, size_t key_at, struct arena *arena,
                                  struct error *error)
{
    const char *tail = scenario->changes + key_at + 1;
    size_t ntail = scenario->changes_size - key_at - 1, size = ntail + key_at + 512, used;
    char *text = arena_alloc(arena, size, 1);

    if (!text) {
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", scenario->file);
    }
    if (strpbrk(scenario->rig, "\"\\\n")) {
        return yaml_error(error, yaml_place(&scenario->mark, "rig"),
                          "found a rig with a quotation mark or backslash in its name, expected "
                          "none with changes");
    }
    used = (size_t)snprintf(text, size, "%sextends: \"%s\"", scenario->changes, scenario->rig);
    memcpy(text + used, tail, ntail);
    scenario->changes = text;
    scenario->changes_size = used + ntail;
    return ERROR_NONE;
}

enum error_code scenario_load_rig(const struct scenario *scenario, struct arena *arena,
                                  const struct rig **rig, struct error *error)
{
    const struct yaml_mark *mark = yaml_place(&scenario->mark, "rig");
    char found[PATH_MAX];
    enum error_code code = scenario->changes
                               ? rig_load_text(scenario->file, scenario->changes,
                                               scenario->changes_size, arena, rig, error)
                               : rig_load(scenario->rig_path, arena, rig, error);

    /* Report a missing rig as an error of the scenario */
    if (code && !scenario->changes &&
        (config_locate(CONFIG_RIG, scenario->rig_path, found, NULL) || access(found, R_OK))) {
        error_prefix(error, "%s:%d:%d", mark->file, mark->line, mark->column);
    }
    return code;
}

/* ---- the file ---- */

/* Reads the document for combination `number`. expanded: a buffer of EXPANDED_MAX bytes. */
static enum error_code read_case(const char *name, const char *text, size_t size,
                                 const struct parameters *given, size_t number, char *expanded,
                                 struct arena *arena, struct scenario *one, struct error *error)
{
    size_t used, key_at = 0, changes_size = 0;
    const char *changes = NULL;
    uint64_t hash;
    enum error_code code =
        expand_parameters(name, text, size, given, number, expanded, &used, error);

    if (code) {
        return code;
    }

    /* The hash covers the whole text, so it is computed before the changes are removed */
    hash = hash_bytes(HASH_START, expanded, used);
    code = take_changes(name, expanded, used, arena, &changes, &changes_size, &key_at, error);
    code = code ? code
                : yaml_read_text(name, expanded, used, &scenario_file_schema, arena, one, error);
    if (code) {
        return code;
    }
    one->file = one->mark.file;
    one->text_hash = hash;
    one->changes = changes;
    one->changes_size = changes_size;
    code = keep_values(given, number, arena, one, error);
    code = code ? code : scenario_check(one, arena, error);
    return code || !changes ? code : extend_rig(one, key_at, arena, error);
}

/* Makes one scenario from a text for each combination of its parameters. */
static enum error_code read_text(const char *name, const char *text, size_t size,
                                 struct parameters *given, struct arena *arena,
                                 struct scenario **cases, size_t *count, struct error *error)
{
    enum error_code code = read_parameters(name, text, size, arena, given, count, error);
    char *expanded = code ? NULL : malloc(EXPANDED_MAX);

    if (code) {
        return code;
    }
    *cases = arena_alloc(arena, *count, sizeof **cases);
    if (!expanded || !*cases) {
        free(expanded);
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", name);
    }

    /* Read the document once per combination, because a parameter may be anywhere in it */
    for (size_t i = 0; i < *count && !code; i++) {
        code = read_case(name, text, size, given, i, expanded, arena, &(*cases)[i], error);
    }
    free(expanded);
    return code;
}

enum error_code scenario_read_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, struct scenario **cases, size_t *count,
                                   struct error *error)
{
    struct parameters own = {.count = 0};

    return read_text(name, text, size, &own, arena, cases, count, error);
}

enum error_code scenario_read_with(const char *path, const struct scenario_value *given,
                                   size_t ngiven, struct arena *arena, struct scenario **cases,
                                   size_t *count, struct error *error)
{
    struct parameters instead = {.given = given, .ngiven = ngiven};
    char *text;
    size_t size;
    enum error_code code = input_file_load(path, EXPANDED_MAX - 1, &text, &size, error);

    code = code ? code : read_text(path, text, size, &instead, arena, cases, count, error);
    free(text);
    return code;
}

enum error_code scenario_read(const char *path, struct arena *arena, struct scenario **cases,
                              size_t *count, struct error *error)
{
    return scenario_read_with(path, NULL, 0, arena, cases, count, error);
}
