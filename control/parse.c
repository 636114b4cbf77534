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

enum key_type {
    KEY_TEXT,     /* const char * */
    KEY_REAL,     /* double */
    KEY_WHOLE,    /* int64_t */
    KEY_SWITCH,   /* bool */
    KEY_VECTOR,   /* double[3] */
    KEY_LIST,     /* enum control_list */
    KEY_PATTERNS, /* const json_t * */
};

struct key {
    enum control_command command;
    const char *name;
    enum key_type type;
    bool required;
    size_t offset;
    double min, max; /* of numbers */
};

#define ANY 1e300

static const struct key keys[] = {
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
    {CONTROL_SUBSCRIBE, "signals", KEY_PATTERNS, true, OF(signals), 0, 0},
    {CONTROL_SUBSCRIBE, "period_ms", KEY_REAL, false, OF(period_ms), 1e-3, 60000},
};

enum { KEYS_PER_COMMAND = 8 };

/* Lists the keys of a command, after id and cmd; returns how many. */
static size_t request_key_names(enum control_command command, const char *names[KEYS_PER_COMMAND])
{
    size_t count = 0;

    names[count++] = "id";
    names[count++] = "cmd";
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        if (keys[i].command == command) {
            names[count++] = keys[i].name;
        }
    }
    return count;
}

/* Finds a key of a command; NULL = it has none of that name. */
static const struct key *request_find_key(enum control_command command, const char *name)
{
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        if (keys[i].command == command && strcmp(keys[i].name, name) == 0) {
            return &keys[i];
        }
    }
    return NULL;
}

/* ---- values ---- */

/* Returns the type of a JSON value in words. */
static const char *json_type_name(const json_t *value)
{
    static const char *const names[] = {
        [JSON_OBJECT] = "an object", [JSON_ARRAY] = "an array", [JSON_STRING] = "a string",
        [JSON_INTEGER] = "a number", [JSON_REAL] = "a number",  [JSON_TRUE] = "true",
        [JSON_FALSE] = "false",      [JSON_NULL] = "null",
    };

    return names[json_typeof(value)];
}

/* Refuses a value of the wrong type. */
static enum error_code request_wrong_type(const struct key *key, const json_t *value,
                                          const char *expected, struct error *error)
{
    return error_set(error, ERROR_INPUT, "%s: key \"%s\": found %s, expected %s",
                     command_names[key->command], key->name, json_type_name(value), expected);
}

/* Reads a number within the key's range. */
static enum error_code request_read_real(const struct key *key, const json_t *value, double *to,
                                         struct error *error)
{
    double number = json_number_value(value);

    if (!json_is_number(value)) {
        return request_wrong_type(key, value, "a number", error);
    }
    if (!(number >= key->min && number <= key->max)) {
        return error_set(error, ERROR_INPUT, "%s: key \"%s\": found %g, expected %g to %g",
                         command_names[key->command], key->name, number, key->min, key->max);
    }
    *to = number;
    return ERROR_NONE;
}

/* Reads a whole number within the key's range; 7.0 counts as one. */
static enum error_code request_read_whole(const struct key *key, const json_t *value, int64_t *to,
                                          struct error *error)
{
    double number = json_number_value(value);

    if (!json_is_number(value)) {
        return request_wrong_type(key, value, "a whole number", error);
    }
    if (!(number >= key->min && number <= key->max && number == floor(number))) {
        return error_set(error, ERROR_INPUT,
                         "%s: key \"%s\": found %.15g, expected a whole number from %.15g to %.15g",
                         command_names[key->command], key->name, number, key->min, key->max);
    }
    *to = (int64_t)number;
    return ERROR_NONE;
}

/* Reads an array of three numbers. */
static enum error_code request_read_vector(const struct key *key, const json_t *value, double to[3],
                                           struct error *error)
{
    if (!json_is_array(value)) {
        return request_wrong_type(key, value, "an array of three numbers", error);
    }
    if (json_array_size(value) != 3) {
        return error_set(error, ERROR_INPUT,
                         "%s: key \"%s\": found an array of %zu, expected three numbers",
                         command_names[key->command], key->name, json_array_size(value));
    }
    for (size_t i = 0; i < 3; i++) {
        enum error_code code = request_read_real(key, json_array_get(value, i), &to[i], error);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* Reads the name of a list. */
static enum error_code request_read_list(const struct key *key, const json_t *value,
                                         enum control_list *to, struct error *error)
{
    const char *text = json_string_value(value), *nearest;

    for (int i = 0; text && i < CONTROL_LISTS; i++) {
        if (strcmp(list_names[i], text) == 0) {
            *to = (enum control_list)i;
            return ERROR_NONE;
        }
    }
    if (!text) {
        return request_wrong_type(key, value, "a string", error);
    }
    nearest = text_nearest(text, list_names, CONTROL_LISTS);
    return error_set(error, ERROR_INPUT,
                     "list: key \"what\": found \"%.60s\", expected tunables, faults, bodies, "
                     "signals, checkpoints or commands%s%s",
                     text, nearest ? "; the nearest is " : "", nearest ? nearest : "");
}

/* Reads a non-empty array of names or patterns, which stays the request's. */
static enum error_code request_read_patterns(const struct key *key, const json_t *value,
                                             const json_t **to, struct error *error)
{
    size_t count = json_array_size(value);

    if (!json_is_array(value)) {
        return request_wrong_type(key, value, "an array of names", error);
    }
    if (count == 0 || count > CONTROL_PATTERNS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "%s: key \"%s\": found an array of %zu, expected 1 to %d names",
                         command_names[key->command], key->name, count, CONTROL_PATTERNS_MAX);
    }
    for (size_t i = 0; i < count; i++) {
        if (!json_is_string(json_array_get(value, i))) {
            return request_wrong_type(key, json_array_get(value, i), "a name in each place", error);
        }
    }
    *to = value;
    return ERROR_NONE;
}

/* Refuses a value that a tunable cannot have, with the tunable's name. */
static enum error_code request_wrong_setting(const char *tunable, const json_t *value,
                                             struct error *error)
{
    const char *text = json_string_value(value);

    return error_set(error, ERROR_INPUT, "set: %.80s: found %s%.40s%s, expected a number", tunable,
                     text ? "\"" : "", text ? text : json_type_name(value), text ? "\"" : "");
}

/* Reads the value of a key into its field of the request. */
static enum error_code request_read_key(const struct key *key, const json_t *value,
                                        struct control_request *request, struct error *error)
{
    const char *tunable = json_string_value(json_object_get(request->root, "name"));
    void *to = (char *)request + key->offset;

    switch (key->type) {
    case KEY_REAL:
        if (key->command == CONTROL_SET && tunable && !json_is_number(value)) {
            return request_wrong_setting(tunable, value, error);
        }
        return request_read_real(key, value, to, error);
    case KEY_WHOLE:
        return request_read_whole(key, value, to, error);
    case KEY_VECTOR:
        return request_read_vector(key, value, to, error);
    case KEY_LIST:
        return request_read_list(key, value, to, error);
    case KEY_PATTERNS:
        return request_read_patterns(key, value, to, error);
    case KEY_SWITCH:
        if (!json_is_boolean(value)) {
            return request_wrong_type(key, value, "true or false", error);
        }
        *(bool *)to = json_is_true(value);
        return ERROR_NONE;
    case KEY_TEXT:
        if (!json_is_string(value)) {
            return request_wrong_type(key, value, "a string", error);
        }
        *(const char **)to = json_string_value(value);
        return ERROR_NONE;
    }
    return ERROR_NONE;
}

/* ---- a request ---- */

/* Refuses an unknown key, and suggests the nearest. */
static enum error_code request_unknown_key(enum control_command command, const char *name,
                                           struct error *error)
{
    const char *names[KEYS_PER_COMMAND], *nearest;
    size_t count = request_key_names(command, names), used = 0;
    char all[256] = "";

    for (size_t i = 0; i < count; i++) {
        used += (size_t)snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "", names[i]);
    }
    nearest = text_nearest(name, names, count);
    return error_set(error, ERROR_INPUT, "%s: found unknown key \"%.60s\", expected one of %s%s%s",
                     command_names[command], name, all, nearest ? "; the nearest is " : "",
                     nearest ? nearest : "");
}

/* Reads all keys of a request, and checks that required ones are there. */
static enum error_code request_read_keys(struct control_request *request, struct error *error)
{
    enum control_command command = request->command;
    const char *name;
    json_t *value;

    json_object_foreach(request->root, name, value)
    {
        const struct key *key = request_find_key(command, name);
        enum error_code code = ERROR_NONE;

        if (key) {
            code = request_read_key(key, value, request, error);
        } else if (strcmp(name, "id") != 0 && strcmp(name, "cmd") != 0) {
            code = request_unknown_key(command, name, error);
        }
        if (code) {
            return code;
        }
    }
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        if (keys[i].command == command && keys[i].required &&
            !json_object_get(request->root, keys[i].name)) {
            return error_set(error, ERROR_INPUT, "%s: found no key \"%s\", expected one",
                             command_names[command], keys[i].name);
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

/* Reads the command; an unknown one is refused with the nearest. */
static enum error_code request_read_command(struct control_request *request, struct error *error)
{
    const json_t *value = json_object_get(request->root, "cmd");
    const char *text = json_string_value(value), *nearest;

    if (!value) {
        return error_set(error, ERROR_INPUT,
                         "found no key \"cmd\", expected one, as in {\"cmd\": \"status\"}");
    }
    if (!text) {
        return error_set(error, ERROR_INPUT, "key \"cmd\": found %s, expected a string",
                         json_type_name(value));
    }
    for (int i = 0; i < CONTROL_COMMANDS; i++) {
        if (strcmp(command_names[i], text) == 0) {
            request->command = (enum control_command)i;
            return ERROR_NONE;
        }
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

/* Parses a line as JSON, then id, command and keys, in the order in which errors are reported. */
static enum error_code read_request(const char *line, size_t size, uint64_t number,
                                    struct control_request *request, struct error *error)
{
    enum error_code code;
    json_error_t wrong;

    request->root = json_loadb(line, size, JSON_REJECT_DUPLICATES, &wrong);
    if (!request->root) {
        /* The library has no text when memory ran out, and in some places a wrong one */
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
    if ((code = request_read_id(request, error)) || (code = request_read_command(request, error)) ||
        (code = request_read_keys(request, error))) {
        return code;
    }
    return request_check_rules(request, error);
}

enum error_code control_parse(const char *line, size_t size, uint64_t number,
                              struct control_request *request, struct error *error)
{
    *request = (struct control_request){.count = 1, .period_ms = 10.0};
    return read_request(line, size, number, request, error);
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

    /* A star matches as little as possible, and one character more when the rest does not fit */
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
