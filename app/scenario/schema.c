/* SPDX-License-Identifier: Apache-2.0 */
/* Reads scenarios: the parameters first, then the document once for each of their combinations. */
#include "app/scenario/private.h"

#include "base/count.h"
#include "base/text.h"

#include <errno.h>
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define AT(member) offsetof(struct STRUCT, member)

enum { EXPANDED_MAX = 1 << 20, PARAMETERS_MAX = 16 };

/* ---- the form of a file ---- */

static const struct yaml_enum clock_words[] = {
    {"free", LOOP_CLOCK_FREE}, {"lockstep", LOOP_CLOCK_LOCKSTEP}, {NULL, 0}};
static const struct yaml_enum hold_words[] = {{"none", RIG_HOLD_NONE},
                                              {"until_enabled", RIG_HOLD_ENABLED},
                                              {"always", RIG_HOLD_ALWAYS},
                                              {NULL, 0}};
static const struct yaml_enum wire_words[] = {{"ideal", 0}, {"wire", 1}, {NULL, 0}};
static const struct yaml_enum host_words[] = {{"none", SCENARIO_HOST_NONE},
                                              {"enabled", SCENARIO_HOST_ENABLED},
                                              {"program", SCENARIO_HOST_PROGRAM},
                                              {NULL, 0}};

#define STRUCT scenario_frame
static const struct yaml_field frame_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(id), .min = 0, .max = 0x1fffffff},
    {"data", YAML_STRING, false, .offset = AT(data)},
    {"copies", YAML_INT, false, .offset = AT(copies), .min = 1, .max = 256},
    {"extended", YAML_BOOL, false, .offset = AT(extended)},
    {"fd", YAML_BOOL, false, .offset = AT(fd)},
    {"remote", YAML_BOOL, false, .offset = AT(remote)},
};
#undef STRUCT
static const struct scenario_frame frame_defaults = {.copies = 1};
static const struct yaml_schema frame_schema = {.what = "a frame",
                                                .size = sizeof(struct scenario_frame),
                                                .fields = frame_fields,
                                                .field_count = ARRAY_COUNT(frame_fields),
                                                .defaults = &frame_defaults};

#define STRUCT scenario_voltage
static const struct yaml_field voltage_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(joint), .min = 1, .max = 63},
    {"volts", YAML_REAL, true, .offset = AT(volts), .min = -1e3, .max = 1e3},
};
#undef STRUCT
static const struct yaml_schema voltage_schema = {.what = "a voltage",
                                                  .size = sizeof(struct scenario_voltage),
                                                  .fields = voltage_fields,
                                                  .field_count = ARRAY_COUNT(voltage_fields)};

#define STRUCT scenario_motor
static const struct yaml_field motor_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(joint), .min = 1, .max = 63},
    {"on", YAML_BOOL, true, .offset = AT(on)},
};
#undef STRUCT
static const struct yaml_schema motor_schema = {.what = "a motor",
                                                .size = sizeof(struct scenario_motor),
                                                .fields = motor_fields,
                                                .field_count = ARRAY_COUNT(motor_fields)};

#define STRUCT scenario_push
static const struct yaml_field push_fields[] = {
    {"body", YAML_STRING, true, .offset = AT(body), .min = 1, .max = 63},
    {"force_n", YAML_REALS, false, .offset = AT(force_n), .count = 3, .min = -1e5, .max = 1e5},
    {"moment_nm", YAML_REALS, false, .offset = AT(moment_nm), .count = 3, .min = -1e5, .max = 1e5},
};
#undef STRUCT
static const struct yaml_schema push_schema = {.what = "a push",
                                               .size = sizeof(struct scenario_push),
                                               .fields = push_fields,
                                               .field_count = ARRAY_COUNT(push_fields)};

#define STRUCT scenario_stimulus
static const struct yaml_field stimulus_fields[] = {
    {"label", YAML_STRING, false, .offset = AT(label), .min = 1, .max = 63},
    {"after", YAML_STRING, false, .offset = AT(after), .min = 1, .max = 63},
    {"at_s", YAML_REAL, false, .offset = AT(at_s), .min = 0.0, .max = 1e5},
    {"for_s", YAML_REAL, false, .offset = AT(for_s), .min = DBL_MIN, .max = 1e5},
    {"every_s", YAML_REAL, false, .offset = AT(every_s), .min = 1e-4, .max = 1e5},
    {"frame", YAML_MAP, false, .offset = AT(frame), .given_offset = AT(frame_given),
     .schema = &frame_schema},
    {"voltage", YAML_MAP, false, .offset = AT(voltage), .given_offset = AT(voltage_given),
     .schema = &voltage_schema},
    {"motor", YAML_MAP, false, .offset = AT(motor), .given_offset = AT(motor_given),
     .schema = &motor_schema},
    {"push", YAML_MAP, false, .offset = AT(push), .given_offset = AT(push_given),
     .schema = &push_schema},
    {"fault", YAML_STRING, false, .offset = AT(fault), .min = 1, .max = 140,
     .given_offset = AT(fault_given)},
    {"silence", YAML_BOOL, false, .offset = AT(silence)},
};
#undef STRUCT
static const struct yaml_schema stimulus_schema = {.what = "a stimulus",
                                                   .size = sizeof(struct scenario_stimulus),
                                                   .fields = stimulus_fields,
                                                   .field_count = ARRAY_COUNT(stimulus_fields)};

#define STRUCT scenario_pattern
static const struct yaml_field pattern_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(id), .min = 0, .max = 0x1fffffff},
    {"id_mask", YAML_INT, false, .offset = AT(id_mask), .min = 0, .max = 0x1fffffff},
    {"extended", YAML_BOOL, false, .offset = AT(extended)},
    {"data", YAML_STRING, false, .offset = AT(data), .given_offset = AT(data_given)},
};
#undef STRUCT
static const struct scenario_pattern pattern_defaults = {.id_mask = 0x1fffffff};
static const struct yaml_schema pattern_schema = {.what = "a pattern of frames",
                                                  .size = sizeof(struct scenario_pattern),
                                                  .fields = pattern_fields,
                                                  .field_count = ARRAY_COUNT(pattern_fields),
                                                  .defaults = &pattern_defaults};

#define STRUCT scenario_expectation
static const struct yaml_field expectation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 95},
    {"after", YAML_STRING, false, .offset = AT(after), .min = 1, .max = 63},
    {"from_s", YAML_REAL, false, .offset = AT(from_s), .min = 0.0, .max = 1e5},
    {"to_s", YAML_REAL, false, .offset = AT(to_s), .min = 0.0, .max = 1e5,
     .given_offset = AT(to_given)},
    {"within_s", YAML_REAL, false, .offset = AT(within_s), .min = 0.0, .max = 1e5,
     .given_offset = AT(within_given)},
    {"signal", YAML_STRING, false, .offset = AT(signal), .min = 1, .max = 95,
     .given_offset = AT(signal_given)},
    {"between", YAML_REALS, false, .offset = AT(between), .count = 2,
     .given_offset = AT(between_given)},
    {"reaches", YAML_REALS, false, .offset = AT(reaches), .count = 2,
     .given_offset = AT(reaches_given)},
    {"relative", YAML_BOOL, false, .offset = AT(relative)},
    {"frame", YAML_MAP, false, .offset = AT(frame), .given_offset = AT(frame_given),
     .schema = &pattern_schema},
    {"event", YAML_STRING, false, .offset = AT(event), .min = 1, .max = 127,
     .given_offset = AT(event_given)},
    {"count", YAML_REALS, false, .offset = AT(count), .count = 2, .min = 0.0, .max = 1e9,
     .given_offset = AT(count_given)},
    {"period_s", YAML_REALS, false, .offset = AT(period_s), .count = 2, .min = 0.0, .max = 1e5,
     .given_offset = AT(period_given)},
    {"never", YAML_BOOL, false, .offset = AT(never)},
};
#undef STRUCT
static const struct yaml_schema expectation_schema = {.what = "an expectation",
                                                      .size = sizeof(struct scenario_expectation),
                                                      .fields = expectation_fields,
                                                      .field_count =
                                                          ARRAY_COUNT(expectation_fields)};

#define STRUCT scenario_mutation
static const struct yaml_field mutation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 63},
    {"fault", YAML_STRING, false, .offset = AT(fault), .min = 1, .max = 159,
     .given_offset = AT(fault_given)},
    {"without", YAML_STRING, false, .offset = AT(without), .min = 1, .max = 63,
     .given_offset = AT(without_given)},
    {"fails", YAML_NAME_LIST, false, .offset = AT(fails), .count_offset = AT(nfail)},
};
#undef STRUCT
static const struct yaml_schema mutation_schema = {.what = "a mutation",
                                                   .size = sizeof(struct scenario_mutation),
                                                   .fields = mutation_fields,
                                                   .field_count = ARRAY_COUNT(mutation_fields)};

#define STRUCT scenario_parameter
static const struct yaml_field parameter_fields[] = {
    {"values", YAML_REAL_LIST, true, .offset = AT(value), .count_offset = AT(count)},
};
#undef STRUCT
static const struct yaml_schema parameter_schema = {.what = "a parameter",
                                                    .size = sizeof(struct scenario_parameter),
                                                    .fields = parameter_fields,
                                                    .field_count = ARRAY_COUNT(parameter_fields),
                                                    .name_offset =
                                                        offsetof(struct scenario_parameter, name)};

#define STRUCT scenario
static const struct yaml_field scenario_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 63},
    {"description", YAML_STRING, true, .offset = AT(description), .min = 1, .max = 1000},
    {"rig", YAML_STRING, true, .offset = AT(rig), .min = 1, .max = 255,
     .mark_offset = AT(rig_mark)},
    {"clock", YAML_ENUM, false, .offset = AT(clock), .names = clock_words},
    {"hold", YAML_ENUM, false, .offset = AT(hold), .names = hold_words,
     .given_offset = AT(hold_given)},
    {"wire", YAML_ENUM, false, .offset = AT(wire), .names = wire_words,
     .given_offset = AT(wire_given)},
    {"settle", YAML_BOOL, false, .offset = AT(settle)},
    {"seed", YAML_INT, false, .offset = AT(seed), .min = 0, .max = 9e15,
     .given_offset = AT(seed_given)},
    {"duration_s", YAML_REAL, true, .offset = AT(duration_s), .min = 1e-3, .max = 1e4},
    {"clean_up_s", YAML_REAL, false, .offset = AT(clean_up_s), .min = 0.0, .max = 1e3},
    {"wall_limit_s", YAML_REAL, false, .offset = AT(wall_limit_s), .min = 0.1, .max = 1e5},
    {"host", YAML_ENUM, false, .offset = AT(host), .names = host_words},
    {"task", YAML_STRING, false, .offset = AT(task), .min = 1, .max = 31,
     .mark_offset = AT(task_mark), .given_offset = AT(task_given)},
    {"parameters", YAML_DICT, false, .offset = AT(parameter), .count_offset = AT(nparameter),
     .schema = &parameter_schema},
    {"faults", YAML_NAME_LIST, false, .offset = AT(fault), .count_offset = AT(nfault)},
    {"stimuli", YAML_LIST, false, .offset = AT(stimulus), .count_offset = AT(nstimulus),
     .schema = &stimulus_schema},
    {"clean_up", YAML_LIST, false, .offset = AT(clean_up), .count_offset = AT(ncleanup),
     .schema = &stimulus_schema},
    {"expectations", YAML_LIST, true, .offset = AT(expectation), .count_offset = AT(nexpectation),
     .schema = &expectation_schema},
    {"mutations", YAML_LIST, false, .offset = AT(mutation), .count_offset = AT(nmutation),
     .schema = &mutation_schema},
};
#undef STRUCT
static const struct scenario scenario_defaults = {
    .clock = LOOP_CLOCK_FREE,
    .wall_limit_s = 60.0,
};
const struct yaml_schema scenario_file_schema = {.what = "the scenario",
                                                 .size = sizeof(struct scenario),
                                                 .fields = scenario_fields,
                                                 .field_count = ARRAY_COUNT(scenario_fields),
                                                 .defaults = &scenario_defaults};

/* ---- parameters ---- */

/* The mapping "parameters:" at the top level of a file. */
struct parameters {
    struct yaml_mark mark;
    size_t count;
    struct scenario_parameter *parameter;
};

#define STRUCT parameters
static const struct yaml_field only_parameters[] = {
    {"parameters", YAML_DICT, true, .offset = AT(parameter), .count_offset = AT(count),
     .schema = &parameter_schema},
};
#undef STRUCT
static const struct yaml_schema parameters_schema = {.what = "the parameters",
                                                     .size = sizeof(struct parameters),
                                                     .fields = only_parameters,
                                                     .field_count = ARRAY_COUNT(only_parameters)};

/* The lines from "parameters:" to the next that begins at the margin; false when there are none. */
static bool find_block(const char *text, size_t size, size_t *from, size_t *to)
{
    static const char key[] = "parameters:";
    bool inside = false;

    for (size_t at = 0; at < size;) {
        const char *end = memchr(text + at, '\n', size - at);
        size_t next = end ? (size_t)(end - text) + 1 : size;

        if (inside && text[at] != ' ' && text[at] != '\n' && text[at] != '#') {
            *to = at;
            return true;
        }
        if (!inside && next - at >= sizeof key - 1 && !memcmp(text + at, key, sizeof key - 1)) {
            inside = true;
            *from = at;
        }
        at = next;
    }
    *to = size;
    return inside;
}

static enum error_code check_parameters(const struct parameters *given, size_t *cases,
                                        struct error *error)
{
    *cases = 1;
    for (size_t i = 0; i < given->count; i++) {
        const struct scenario_parameter *parameter = &given->parameter[i];

        if (!text_is_name(parameter->name) || parameter->count == 0) {
            return yaml_error(
                error, &parameter->mark,
                "found parameter \"%.40s\" with %zu values, expected a plain name and at "
                "least one value",
                parameter->name, parameter->count);
        }
        if (i >= PARAMETERS_MAX || parameter->count > SCENARIO_CASES_MAX / *cases) {
            return yaml_error(
                error, &parameter->mark,
                "found too many parameters or values, expected at most %d parameters and "
                "%d combinations",
                PARAMETERS_MAX, SCENARIO_CASES_MAX);
        }
        *cases *= parameter->count;
    }
    return ERROR_NONE;
}

/* Reads the block alone, after as many empty lines as precede it, so that messages name its
 * lines. */
static enum error_code read_parameters(const char *name, const char *text, size_t size,
                                       struct arena *arena, struct parameters *given, size_t *cases,
                                       struct error *error)
{
    size_t from = 0, to = 0, used = 0;
    enum error_code code;
    char *alone;

    memset(given, 0, sizeof *given);
    *cases = 1;
    if (!find_block(text, size, &from, &to)) {
        return ERROR_NONE;
    }
    alone = arena_alloc(arena, to + 1, 1);
    if (!alone) {
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", name);
    }
    for (size_t i = 0; i < from; i++) {
        if (text[i] == '\n') {
            alone[used++] = '\n';
        }
    }
    memcpy(alone + used, text + from, to - from);
    code = yaml_read_text(name, alone, used + to - from, &parameters_schema, arena, given, error);
    return code ? code : check_parameters(given, cases, error);
}

/* The value of a parameter in one of the combinations. */
static double value_in(const struct parameters *given, size_t index, size_t number)
{
    for (size_t i = given->count - 1; i > index; i--) {
        number /= given->parameter[i].count;
    }
    return given->parameter[index].value[number % given->parameter[index].count];
}

static enum error_code unknown_parameter(const char *file, const char *text, size_t at,
                                         const char *name, const struct parameters *given,
                                         struct error *error)
{
    const char *names[PARAMETERS_MAX], *nearest;
    struct yaml_mark mark = {file, 1, 1};

    for (size_t i = 0; i < at; i++) {
        mark.column = text[i] == '\n' ? 1 : mark.column + 1;
        mark.line += text[i] == '\n';
    }
    for (size_t i = 0; i < given->count; i++) {
        names[i] = given->parameter[i].name;
    }
    nearest = text_nearest(name, names, given->count);
    return yaml_error(error, &mark, "found ${%.40s}, expected ${NAME} of a parameter%s%s%s", name,
                      nearest ? "; did you mean \"" : "", nearest ? nearest : "",
                      nearest ? "\"?" : "");
}

/* The text with every ${NAME} replaced; *out has room for EXPANDED_MAX bytes. */
static enum error_code expand_parameters(const char *file, const char *text, size_t size,
                                         const struct parameters *given, size_t number, char *out,
                                         size_t *used, struct error *error)
{
    *used = 0;
    for (size_t at = 0; at < size;) {
        char name[64], value[32];
        size_t length, index = 0;

        if (*used + sizeof value > EXPANDED_MAX) {
            return error_set(error, ERROR_INPUT, "%s: found more than %d bytes, expected fewer",
                             file, EXPANDED_MAX);
        }

        /* Everything but ${NAME} is copied */
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

        /* Its value in this combination */
        while (index < given->count && strcmp(given->parameter[index].name, name) != 0) {
            index++;
        }
        if (index == given->count || at + 2 + length >= size || text[at + 2 + length] != '}') {
            return unknown_parameter(file, text, at, name, given, error);
        }
        *used +=
            (size_t)snprintf(out + *used, sizeof value, "%.15g", value_in(given, index, number));
        at += length + 3;
    }
    return ERROR_NONE;
}

static void describe_values(const struct parameters *given, size_t number,
                            char values[SCENARIO_TEXT])
{
    size_t used = 0;

    values[0] = '\0';
    for (size_t i = 0; i < given->count && used < SCENARIO_TEXT; i++) {
        used += (size_t)snprintf(values + used, SCENARIO_TEXT - used, "%s%s=%.15g", i ? ", " : "",
                                 given->parameter[i].name, value_in(given, i, number));
    }
}

enum error_code scenario_read_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, struct scenario **cases, size_t *count,
                                   struct error *error)
{
    struct parameters given;
    enum error_code code = read_parameters(name, text, size, arena, &given, count, error);
    char *expanded = code ? NULL : malloc(EXPANDED_MAX);
    size_t used;

    if (code) {
        return code;
    }
    *cases = arena_alloc(arena, *count, sizeof **cases);
    if (!expanded || !*cases) {
        free(expanded);
        return error_set(error, ERROR_MEMORY, "no memory left for scenario %s", name);
    }

    /* The document is read once for each combination: a parameter may stand anywhere in it */
    for (size_t i = 0; i < *count && !code; i++) {
        struct scenario *one = &(*cases)[i];

        code = expand_parameters(name, text, size, &given, i, expanded, &used, error);
        if (!code) {
            code = yaml_read_text(name, expanded, used, &scenario_file_schema, arena, one, error);
        }
        if (!code) {
            one->file = one->mark.file;
            describe_values(&given, i, one->values);
            code = scenario_check(one, arena, error);
        }
    }
    free(expanded);
    return code;
}

enum error_code scenario_read(const char *path, struct arena *arena, struct scenario **cases,
                              size_t *count, struct error *error)
{
    char *text = malloc(EXPANDED_MAX);
    FILE *in = text ? fopen(path, "rb") : NULL;
    enum error_code code = ERROR_NONE;
    size_t size;

    if (!in) {
        code = text ? error_set_file(error, errno, path, "cannot be read")
                    : error_set(error, ERROR_MEMORY, "no memory left for scenario %s", path);
        free(text);
        return code;
    }
    size = fread(text, 1, EXPANDED_MAX, in);
    if (ferror(in)) {
        code = error_set_file(error, errno, path, "cannot be read");
    } else if (size == EXPANDED_MAX) {
        code = error_set(error, ERROR_INPUT, "%s: found %d bytes or more, expected fewer", path,
                         EXPANDED_MAX);
    } else {
        code = scenario_read_text(path, text, size, arena, cases, count, error);
    }
    fclose(in);
    free(text);
    return code;
}
