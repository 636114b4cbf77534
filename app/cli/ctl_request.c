/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the requests of ctl from words. */
#include "app/cli/ctl_request.h"

#include "control/ctl_print.h"
#include "base/array.h"
#include "base/text.h"

#include <string.h>

enum { WORD_COPY = 256 };

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

static const struct ctl_command commands[] = {
    {"hello", 0, 0, {0}, "no argument", ctl_print_hello},
    {"status", 0, 0, {0}, "no argument", ctl_print_status},
    {"statistics", 0, 0, {0}, "no argument", ctl_print_statistics},
    {"list",
     1,
     2,
     {"what", "match"},
     "tunables, faults, bodies, signals, checkpoints or commands, and maybe a pattern",
     ctl_print_list},
    {"get", 1, 1, {"name"}, "the name of a tunable, or a pattern", NULL},
    {"set", 1, 2, {"name", "value"}, "NAME=VALUE or NAME VALUE", NULL},
    {"fault", 2, 2, {"name", "on"}, "the name of a fault, then on or off", NULL},
    {"push", 1, SIZE_MAX, {"body"}, "BODY [force_n=X,Y,Z] [moment_nm=X,Y,Z] [duration_s=S]", NULL},
    {"pause", 0, 0, {0}, "no argument", NULL},
    {"resume", 0, 0, {0}, "no argument", NULL},
    {"step", 0, 1, {"count"}, "at most one argument", NULL},
    {"speed", 1, 1, {"factor"}, "a factor, or max", NULL},
    {"reset", 0, 0, {0}, "no argument", NULL},
    {"checkpoint", 0, 1, {"slot"}, "at most one argument", NULL},
    {"restore", 0, 1, {"slot"}, "at most one argument", NULL},
    {"wait", 1, 1, {0}, "tick=N or time_s=S", NULL},
    {"subscribe",
     1,
     SIZE_MAX,
     {0},
     "names or patterns of signals; \"list signals\" has them",
     NULL},
    {"stop", 0, 0, {0}, "no argument", NULL},
};

/* Makes the value of a key from a word. Returns NULL if the command does not accept the word. */
static json_t *ctl_value(const char *key, const char *word)
{
    if (strcmp(key, "on") == 0) {
        return strcmp(word, "on") == 0    ? json_true()
               : strcmp(word, "off") == 0 ? json_false()
                                          : NULL;
    }
    if (strcmp(key, "factor") == 0 && strcmp(word, "max") == 0) {
        return json_integer(0);
    }
    return strstr(" value count slot factor ", key) ? value_of(word) : json_string(word);
}

enum error_code ctl_make_request(const struct ctl_command *command, const struct ctl_options *o,
                                 json_t *request, struct error *error)
{
    const bool set = strcmp(command->name, "set") == 0;
    const char *equals = set && o->nword == 1 ? strchr(o->word[0], '=') : NULL;
    json_t *signals = json_array(), *value;
    bool good = o->nword >= command->least && o->nword <= command->most &&
                (!set || o->nword == 2 || equals);

    json_object_set_new(request, "signals", signals);
    for (size_t i = 0; good && i < o->nword; i++) {
        const char *key = i < ARRAY_COUNT(command->key) ? command->key[i] : NULL;

        if (key) {
            value = ctl_value(key, o->word[i]);
            good = value != NULL;
            json_object_set_new(request, key, value);
        } else if (strcmp(command->name, "subscribe") == 0) {
            json_array_append_new(signals, json_string(o->word[i]));
        } else if (put_pair(request, command->name, o->word[i], error)) {
            return error->code;
        }
    }
    if (!good) {
        return error_set(error, ERROR_INPUT, "%s: expected %s", command->name, command->expected);
    }

    /* Adjust the request: split NAME=VALUE, turn a pattern into a list of tunables, and add the
     * period of rows */
    if (equals) {
        json_object_set_new(request, "name",
                            json_stringn(o->word[0], (size_t)(equals - o->word[0])));
        json_object_set_new(request, "value", value_of(equals + 1));
    }
    if (strcmp(command->name, "get") == 0 && strpbrk(o->word[0], "*?")) {
        json_object_del(request, "name");
        json_object_set_new(request, "cmd", json_string("list"));
        json_object_set_new(request, "what", json_string("tunables"));
        json_object_set_new(request, "match", json_string(o->word[0]));
    }
    if (strcmp(command->name, "subscribe") == 0) {
        json_object_set_new(request, "period_ms", json_real(o->period_ms));
    } else {
        json_object_del(request, "signals");
    }
    return ERROR_NONE;
}

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
