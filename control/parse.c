/* SPDX-License-Identifier: Apache-2.0 */
/* Parses requests of the control socket; a table lists the fields of each command. */
#include "control/parse.h"

#include "base/array.h"
#include "base/text.h"
#include "rt/requests.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { KEYS_PER_COMMAND = 8 };

#define OF(member) offsetof(struct control_request, member)

static const char *const command_names[CONTROL_COMMANDS] = {
    [CONTROL_HELLO] = "hello",
    [CONTROL_STATUS] = "status",
    [CONTROL_STATISTICS] = "statistics",
    [CONTROL_LIST] = "list",
    [CONTROL_GET] = "get",
    [CONTROL_SET] = "set",
    [CONTROL_FAULT] = "fault",
    [CONTROL_PUSH] = "push",
    [CONTROL_PAUSE] = "pause",
    [CONTROL_RESUME] = "resume",
    [CONTROL_STEP] = "step",
    [CONTROL_SPEED] = "speed",
    [CONTROL_RESET] = "reset",
    [CONTROL_CHECKPOINT] = "checkpoint",
    [CONTROL_RESTORE] = "restore",
    [CONTROL_WAIT] = "wait",
    [CONTROL_SUBSCRIBE] = "subscribe",
    [CONTROL_UNSUBSCRIBE] = "unsubscribe",
    [CONTROL_STOP] = "stop",
};

static const char *const list_names[CONTROL_LISTS] = {
    [CONTROL_LIST_TUNABLES] = "tunables",       [CONTROL_LIST_FAULTS] = "faults",
    [CONTROL_LIST_BODIES] = "bodies",           [CONTROL_LIST_SIGNALS] = "signals",
    [CONTROL_LIST_CHECKPOINTS] = "checkpoints", [CONTROL_LIST_COMMANDS] = "commands",
};

const char *control_command_name(enum control_command command)
{
    return command_names[command];
}

const char *control_list_name(enum control_list list)
{
    return list_names[list];
}

/* ---- the table ---- */

#define ANY 1e300
static const struct request_key keys[] = {
    {CONTROL_LIST, "what", KEY_LIST, true, OF(list), 0, 0},
    {CONTROL_LIST, "match", KEY_TEXT, false, OF(match), 0, 0},
    {CONTROL_GET, "name", KEY_TEXT, true, OF(name), 0, 0},
    {CONTROL_SET, "name", KEY_TEXT, true, OF(name), 0, 0},
    {CONTROL_SET, "value", KEY_REAL, true, OF(value), -ANY, ANY},
    {CONTROL_FAULT, "name", KEY_TEXT, true, OF(name), 0, 0},
    {CONTROL_FAULT, "on", KEY_SWITCH, true, OF(on), 0, 0},
    {CONTROL_PUSH, "body", KEY_TEXT, true, OF(name), 0, 0},
    {CONTROL_PUSH, "force_n", KEY_VECTOR, false, OF(force_n), -1e6, 1e6},
    {CONTROL_PUSH, "moment_nm", KEY_VECTOR, false, OF(moment_nm), -1e6, 1e6},
    {CONTROL_PUSH, "duration_s", KEY_REAL, false, OF(time_s), 0, 1e6},
    {CONTROL_STEP, "count", KEY_WHOLE, false, OF(count), 1, 1e12},
    {CONTROL_SPEED, "factor", KEY_REAL, true, OF(value), 0, 1000},
    {CONTROL_CHECKPOINT, "slot", KEY_WHOLE, false, OF(count), 1, CHECKPOINT_SLOTS - 1},
    {CONTROL_RESTORE, "slot", KEY_WHOLE, false, OF(count), 0, CHECKPOINT_SLOTS - 1},
    {CONTROL_WAIT, "tick", KEY_WHOLE, false, OF(count), 0, 9e15},
    {CONTROL_WAIT, "time_s", KEY_REAL, false, OF(time_s), 0, 9e6},
    {CONTROL_SUBSCRIBE, "signals", KEY_NAMES, true, OF(signals), 1, CONTROL_PATTERNS_MAX},
    {CONTROL_SUBSCRIBE, "period_ms", KEY_REAL, false, OF(period_ms), 1e-3, 60000},
};

static const struct request_table requests = {command_names, CONTROL_COMMANDS, keys,
                                              ARRAY_COUNT(keys)};

/* Returns the index of a word in a list, or count if it is not there. */
static size_t find_word(const char *word, const char *const *words, size_t count)
{
    size_t at = 0;

    while (at < count && strcmp(words[at], word) != 0) {
        at++;
    }
    return at;
}

/* Refuses a word that is not in a list and suggests the nearest word. what: kind of the word, for
 * the error. */
static enum error_code refuse_word(const char *command, const char *what, const char *word,
                                   const char *const *words, size_t count, struct error *error)
{
    const char *nearest = text_nearest(word, words, count);
    char all[256] = "";
    size_t used = 0;

    for (size_t i = 0; i < count; i++) {
        used += (size_t)snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "", words[i]);
    }
    return error_set(error, ERROR_INPUT, "%s: found %s \"%.60s\", expected one of %s%s%s", command,
                     what, word, all, nearest ? "; the nearest is " : "", nearest ? nearest : "");
}

/* ---- values ---- */

/* Returns the name of the type of a JSON value. */
static const char *json_type_name(const json_t *value)
{
    static const char *const names[] = {
        [JSON_OBJECT] = "an object", [JSON_ARRAY] = "an array", [JSON_STRING] = "a string",
        [JSON_INTEGER] = "a number", [JSON_REAL] = "a number",  [JSON_TRUE] = "true",
        [JSON_FALSE] = "false",      [JSON_NULL] = "null",
    };

    return names[json_typeof(value)];
}

/* Reads a number and checks the key's range. 7.0 counts as a whole number. */
static enum error_code read_number(const char *command, const struct request_key *key,
                                   const json_t *value, double *to, struct error *error)
{
    const bool whole = key->type == KEY_WHOLE;
    const double number = json_number_value(value);

    if (!json_is_number(value)) {
        const char *text = json_string_value(value);

        return error_set(error, ERROR_INPUT, "%s: key \"%s\": found %s%.40s%s, expected a %snumber",
                         command, key->name, text ? "\"" : "", text ? text : json_type_name(value),
                         text ? "\"" : "", whole ? "whole " : "");
    }
    if (!(number >= key->min && number <= key->max) || (whole && number != floor(number))) {
        return error_set(
            error, ERROR_INPUT, "%s: key \"%s\": found %.15g, expected %s%.15g to %.15g", command,
            key->name, number, whole ? "a whole number from " : "", key->min, key->max);
    }
    *to = number;
    return ERROR_NONE;
}

/* Checks that a value is an array, that its elements have one type, and that their number is in the
 * key's range. */
static enum error_code check_array(const char *command, const struct request_key *key,
                                   const json_t *value, double least, double most, bool names,
                                   struct error *error)
{
    const double count = (double)json_array_size(value);

    if (!json_is_array(value) || count < least || count > most) {
        return error_set(error, ERROR_INPUT,
                         "%s: key \"%s\": found %s of %g, expected an array of %g to %g %s",
                         command, key->name, json_type_name(value), count, least, most,
                         names ? "names" : "numbers");
    }
    for (size_t i = 0; names && i < json_array_size(value); i++) {
        const json_t *element = json_array_get(value, i);

        if (!json_is_string(element)) {
            return error_set(error, ERROR_INPUT,
                             "%s: key \"%s\": found %s, expected a name in each place", command,
                             key->name, json_type_name(element));
        }
    }
    return ERROR_NONE;
}

/* Reads the value of a key into its field. */
static enum error_code read_key(const char *command, const struct request_key *key,
                                const json_t *value, void *request, struct error *error)
{
    void *to = (char *)request + key->offset;
    const char *text = json_string_value(value);
    enum error_code code = ERROR_NONE;
    double number = 0.0;
    size_t list;

    switch (key->type) {
    case KEY_REAL:
        return read_number(command, key, value, to, error);
    case KEY_WHOLE:
        code = read_number(command, key, value, &number, error);
        *(int64_t *)to = (int64_t)number;
        return code;
    case KEY_VECTOR:
        code = check_array(command, key, value, 3, 3, false, error);
        for (size_t i = 0; i < 3 && !code; i++) {
            code = read_number(command, key, json_array_get(value, i), (double *)to + i, error);
        }
        return code;
    case KEY_NAMES:
        *(const json_t **)to = value;
        return check_array(command, key, value, key->min, key->max, true, error);
    case KEY_SWITCH:
        *(bool *)to = json_is_true(value);
        return json_is_boolean(value)
                   ? ERROR_NONE
                   : error_set(error, ERROR_INPUT,
                               "%s: key \"%s\": found %s, expected true or false", command,
                               key->name, json_type_name(value));
    case KEY_TEXT:
    case KEY_LIST:
        break;
    }
    if (!text) {
        return error_set(error, ERROR_INPUT, "%s: key \"%s\": found %s, expected a string", command,
                         key->name, json_type_name(value));
    }
    if (key->type == KEY_TEXT) {
        *(const char **)to = text;
        return ERROR_NONE;
    }
    list = find_word(text, list_names, CONTROL_LISTS);
    *(enum control_list *)to = (enum control_list)list;
    return list < CONTROL_LISTS
               ? ERROR_NONE
               : refuse_word(command, key->name, text, list_names, CONTROL_LISTS, error);
}

/* ---- a request ---- */

int request_find_command(const struct request_table *table, const json_t *root)
{
    const char *text = json_string_value(json_object_get(root, "cmd"));
    const size_t at = text ? find_word(text, table->command, table->ncommand) : table->ncommand;

    return at < table->ncommand ? (int)at : -1;
}

enum error_code request_read_keys(const struct request_table *table, int command, json_t *root,
                                  void *request, struct error *error)
{
    const char *known[KEYS_PER_COMMAND] = {"id", "cmd"}, *name;
    const struct request_key *key[KEYS_PER_COMMAND] = {NULL};
    size_t count = 2;
    json_t *value;

    /* Find the command's keys */
    for (size_t i = 0; i < table->nkey; i++) {
        if (table->key[i].command == command) {
            key[count] = &table->key[i];
            known[count++] = table->key[i].name;
        }
    }
    /* Read the keys of the request */
    json_object_foreach(root, name, value)
    {
        const size_t at = find_word(name, known, count);
        enum error_code code = ERROR_NONE;

        if (at == count) {
            code = refuse_word(table->command[command], "unknown key", name, known, count, error);
        } else if (key[at]) {
            code = read_key(table->command[command], key[at], value, request, error);
        }
        if (code) {
            return code;
        }
    }
    for (size_t i = 2; i < count; i++) {
        if (key[i]->required && !json_object_get(root, known[i])) {
            return error_set(error, ERROR_INPUT, "%s: found no key \"%s\", expected one",
                             table->command[command], known[i]);
        }
    }
    return ERROR_NONE;
}

/* Reads the id: a number, a string, or none. */
static enum error_code request_read_id(struct control_request *request, struct error *error)
{
    json_t *id = json_object_get(request->root, "id");

    if (id && !json_is_null(id)) {
        if (!json_is_number(id) && !json_is_string(id)) {
            return error_set(error, ERROR_INPUT,
                             "key \"id\": found %s, expected a number or a string",
                             json_type_name(id));
        }
        if (json_string_length(id) > CONTROL_ID_MAX) {
            return error_set(error, ERROR_INPUT,
                             "key \"id\": found a string of %zu bytes, expected at most %d",
                             json_string_length(id), CONTROL_ID_MAX);
        }
        request->id = id;
    }
    return ERROR_NONE;
}

/* Refuses a missing or unknown command. The error suggests the nearest command. */
static enum error_code request_refuse_command(const json_t *value, struct error *error)
{
    const char *text = json_string_value(value), *nearest;

    if (!text) {
        return error_set(error, ERROR_INPUT,
                         "key \"cmd\": found %s, expected a string, as in {\"cmd\": \"status\"}",
                         value ? json_type_name(value) : "none");
    }
    nearest = text_nearest(text, command_names, CONTROL_COMMANDS);
    return error_set(error, ERROR_INPUT, "found unknown command \"%.60s\", expected %s%s%s", text,
                     nearest ? "\"" : "one that list commands has", nearest ? nearest : "",
                     nearest ? "\"" : "");
}

/* Checks the rules that the table cannot express. */
static enum error_code request_check_rules(struct control_request *request, struct error *error)
{
    const json_t *root = request->root;

    if (request->command == CONTROL_WAIT) {
        bool tick = json_object_get(root, "tick"), time = json_object_get(root, "time_s");

        request->wait_time = time;
        if (tick == time) {
            return error_set(error, ERROR_INPUT,
                             "wait: found %s, expected one of the keys tick and time_s",
                             tick ? "both" : "neither");
        }
    }
    if (request->command == CONTROL_SPEED && request->value > 0 && request->value < 1e-3) {
        return error_set(error, ERROR_INPUT,
                         "speed: key \"factor\": found %g, expected 0 or 0.001 to 1000",
                         request->value);
    }
    return ERROR_NONE;
}

enum error_code control_parse(const char *line, size_t size, uint64_t number,
                              struct control_request *request, struct error *error)
{
    enum error_code code;
    json_error_t wrong;
    int command;

    *request = (struct control_request){.count = 1, .period_ms = 10.0};
    request->root = json_loadb(line, size, JSON_REJECT_DUPLICATES, &wrong);
    if (!request->root) {
        /* Out of memory: Jansson leaves the text empty, or in some cases writes a wrong text */
        return wrong.text[0] == '\0'
                   ? error_set(error, ERROR_MEMORY, "no memory for the request")
                   : error_set(error, ERROR_INPUT,
                               "line %" PRIu64 ", column %d (byte %d): found %s, expected a JSON "
                               "object in one line",
                               number, wrong.column, wrong.position, wrong.text);
    }
    if (!json_is_object(request->root)) {
        return error_set(error, ERROR_INPUT, "line %" PRIu64 ": found %s, expected a JSON object",
                         number, json_type_name(request->root));
    }
    /* Check the id first, so that a refusal has it; then the command, then its keys */
    code = request_read_id(request, error);
    if (code) {
        return code;
    }
    command = request_find_command(&requests, request->root);
    if (command < 0) {
        return request_refuse_command(json_object_get(request->root, "cmd"), error);
    }
    request->command = (enum control_command)command;
    code = request_read_keys(&requests, command, request->root, request, error);
    if (code && command == CONTROL_SET && request->name) {
        return error_prefix(error, "%.80s", request->name);
    }
    return code ? code : request_check_rules(request, error);
}

void control_request_clear(struct control_request *request)
{
    json_decref(request->root);
    *request = (struct control_request){.root = NULL};
}

/* ---- names and texts ---- */

bool control_matches(const char *pattern, const char *name)
{
    const char *star = NULL, *from = NULL;

    /* A star first matches no characters. Whenever the rest of the pattern fails, it matches one
     * more */
    while (*name) {
        if (*pattern == '*') {
            star = ++pattern;
            from = name;
        } else if (*pattern == '?' || *pattern == *name) {
            pattern++;
            name++;
        } else if (star) {
            pattern = star;
            name = ++from;
        } else {
            return false;
        }
    }
    while (*pattern == '*') {
        pattern++;
    }
    return *pattern == '\0';
}

json_t *control_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *control_text(const char *text)
{
    json_t *string = json_string(text);
    char clean[1024];

    if (string) {
        return string;
    }
    snprintf(clean, sizeof clean, "%s", text);
    for (char *at = clean; *at; at++) {
        *at = (unsigned char)*at >= 0x80 ? '?' : *at;
    }
    return json_string(clean);
}
