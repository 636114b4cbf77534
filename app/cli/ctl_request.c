/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the requests of ctl from words. A value for which there is no memory is omitted; the
 * server then refuses the request. */
#include "app/cli/ctl_request.h"

#include "control/ctl_print.h"
#include "base/array.h"
#include "base/text.h"

#include <string.h>

enum { WORD_COPY = 256 };

/* Reports wrong arguments of a command, and the arguments that it takes. */
static enum error_code ctl_usage_error(struct error *error, const char *command,
                                       const char *expected)
{
    return error_set(error, ERROR_INPUT, "%s: expected %s", command, expected);
}

/* Converts a word to a number if it is one, else to a string; the server checks the type. */
static json_t *value_of(const char *word)
{
    double number;
    int64_t whole;

    if (text_to_int(word, -(INT64_C(1) << 53), INT64_C(1) << 53, &whole)) {
        return json_integer(whole);
    }
    return text_to_double(word, &number) ? json_real(number) : json_string(word);
}

/* Makes an array of "1,2,3". */
static json_t *vector_of(const char *word)
{
    json_t *array = json_array();
    char copy[WORD_COPY], *at = copy;

    snprintf(copy, sizeof copy, "%s", word);
    while (at) {
        json_array_append_new(array, value_of(strsep(&at, ",")));
    }
    return array;
}

/* Puts "KEY=VALUE" into the request; the server checks the key. */
static enum error_code put_pair(json_t *request, const char *command, const char *word,
                                struct error *error)
{
    const char *equals = strchr(word, '=');
    char key[WORD_COPY];

    if (!equals || equals == word || equals - word >= WORD_COPY) {
        return error_set(error, ERROR_INPUT, "%s: found \"%.100s\", expected KEY=VALUE", command,
                         word);
    }
    snprintf(key, sizeof key, "%.*s", (int)(equals - word), word);
    json_object_set_new(request, key,
                        strchr(equals, ',') ? vector_of(equals + 1) : value_of(equals + 1));
    return ERROR_NONE;
}

/* Puts the optional argument into the request, under a key. */
static enum error_code put_optional(json_t *request, const struct ctl_options *o, const char *key,
                                    struct error *error)
{
    if (o->nword > 1) {
        return ctl_usage_error(error, o->command, "at most one argument");
    }
    if (o->nword == 1) {
        json_object_set_new(request, key, value_of(o->word[0]));
    }
    return ERROR_NONE;
}

/* Makes a request without arguments. */
static enum error_code make_plain(json_t *request, const struct ctl_options *o, struct error *error)
{
    (void)request;
    return o->nword > 0 ? ctl_usage_error(error, o->command, "no argument") : ERROR_NONE;
}

/* Makes `list WHAT [PATTERN]`. */
static enum error_code make_list(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword < 1 || o->nword > 2) {
        return ctl_usage_error(
            error, o->command,
            "tunables, faults, bodies, signals, checkpoints or commands, and maybe a "
            "pattern");
    }
    json_object_set_new(request, "what", json_string(o->word[0]));
    if (o->nword == 2) {
        json_object_set_new(request, "match", json_string(o->word[1]));
    }
    return ERROR_NONE;
}

/* Makes `get NAME`; for a pattern, a list of the matching tunables. */
static enum error_code make_get(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword != 1) {
        return ctl_usage_error(error, o->command, "the name of a tunable, or a pattern");
    }
    if (strpbrk(o->word[0], "*?")) {
        json_object_set_new(request, "cmd", json_string("list"));
        json_object_set_new(request, "what", json_string("tunables"));
        json_object_set_new(request, "match", json_string(o->word[0]));
    } else {
        json_object_set_new(request, "name", json_string(o->word[0]));
    }
    return ERROR_NONE;
}

/* Makes `set NAME=VALUE`, or `set NAME VALUE`. */
static enum error_code make_set(json_t *request, const struct ctl_options *o, struct error *error)
{
    const char *equals = o->nword == 1 ? strchr(o->word[0], '=') : NULL;

    if (o->nword != 2 && !equals) {
        return ctl_usage_error(error, o->command, "NAME=VALUE or NAME VALUE");
    }
    json_object_set_new(request, "name",
                        equals ? json_stringn(o->word[0], (size_t)(equals - o->word[0]))
                               : json_string(o->word[0]));
    json_object_set_new(request, "value", value_of(equals ? equals + 1 : o->word[1]));
    return ERROR_NONE;
}

/* Makes `fault NAME on|off`. */
static enum error_code make_fault(json_t *request, const struct ctl_options *o, struct error *error)
{
    bool on = o->nword == 2 && strcmp(o->word[1], "on") == 0;

    if (o->nword != 2 || (!on && strcmp(o->word[1], "off") != 0)) {
        return ctl_usage_error(error, o->command, "the name of a fault, then on or off");
    }
    json_object_set_new(request, "name", json_string(o->word[0]));
    json_object_set_new(request, "on", json_boolean(on));
    return ERROR_NONE;
}

/* Makes `push BODY KEY=VALUE...`. */
static enum error_code make_push(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword < 1) {
        return ctl_usage_error(error, o->command,
                               "BODY [force_n=X,Y,Z] [moment_nm=X,Y,Z] [duration_s=S]");
    }
    json_object_set_new(request, "body", json_string(o->word[0]));
    for (size_t i = 1; i < o->nword; i++) {
        enum error_code code = put_pair(request, o->command, o->word[i], error);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

static enum error_code make_step(json_t *request, const struct ctl_options *o, struct error *error)
{
    return put_optional(request, o, "count", error);
}

static enum error_code make_slot(json_t *request, const struct ctl_options *o, struct error *error)
{
    return put_optional(request, o, "slot", error);
}

/* Makes `speed FACTOR`; "max" is sent as 0. */
static enum error_code make_speed(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword != 1) {
        return ctl_usage_error(error, o->command, "a factor, or max");
    }
    json_object_set_new(request, "factor",
                        strcmp(o->word[0], "max") == 0 ? json_integer(0) : value_of(o->word[0]));
    return ERROR_NONE;
}

/* Makes `wait tick=N`, or `wait time_s=S`. */
static enum error_code make_wait(json_t *request, const struct ctl_options *o, struct error *error)
{
    return o->nword != 1 ? ctl_usage_error(error, o->command, "tick=N or time_s=S")
                         : put_pair(request, o->command, o->word[0], error);
}

/* Makes `subscribe SIGNAL...` with the period. */
static enum error_code make_subscribe(json_t *request, const struct ctl_options *o,
                                      struct error *error)
{
    json_t *signals = json_array();

    if (o->nword < 1) {
        json_decref(signals);
        return ctl_usage_error(error, o->command,
                               "names or patterns of signals; \"list signals\" has them");
    }
    for (size_t i = 0; i < o->nword; i++) {
        json_array_append_new(signals, json_string(o->word[i]));
    }
    json_object_set_new(request, "signals", signals);
    json_object_set_new(request, "period_ms", json_real(o->period_ms));
    return ERROR_NONE;
}

static const struct ctl_command commands[] = {
    {"hello", make_plain, ctl_print_hello},
    {"status", make_plain, ctl_print_status},
    {"statistics", make_plain, ctl_print_statistics},
    {"list", make_list, ctl_print_list},
    {"get", make_get, NULL},
    {"set", make_set, NULL},
    {"fault", make_fault, NULL},
    {"push", make_push, NULL},
    {"pause", make_plain, NULL},
    {"resume", make_plain, NULL},
    {"step", make_step, NULL},
    {"speed", make_speed, NULL},
    {"reset", make_plain, NULL},
    {"checkpoint", make_slot, NULL},
    {"restore", make_slot, NULL},
    {"wait", make_wait, NULL},
    {"subscribe", make_subscribe, NULL},
    {"stop", make_plain, NULL},
};

const char *const *ctl_command_names(void)
{
    static const char *names[ARRAY_COUNT(commands) + 1];

    for (size_t i = 0; i < ARRAY_COUNT(commands); i++) {
        names[i] = commands[i].name;
    }
    return names;
}

const struct ctl_command *ctl_find_command(const char *name, struct error *error)
{
    const char *nearest;

    for (size_t i = 0; i < ARRAY_COUNT(commands); i++) {
        if (strcmp(commands[i].name, name) == 0) {
            return &commands[i];
        }
    }
    nearest = text_nearest(name, ctl_command_names(), ARRAY_COUNT(commands));
    error_set(error, ERROR_INPUT, "found unknown command \"%.100s\", expected %s%s%s", name,
              nearest ? "\"" : "one that ctl --help lists", nearest ? nearest : "",
              nearest ? "\"" : "");
    return NULL;
}
