/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil ctl: looks at a running simulator and steers it, over its control socket. */
#include "base/text.h"
#include "app/cli/commands.h"
#include "app/control/ctl_client.h"
#include "app/control/ctl_print.h"
#include "base/options.h"

#include <stdlib.h>
#include <string.h>

enum { WORDS_MAX = 1024, WORD_COPY = 256 };

static const char manual[] =
    "Commands. status, statistics, hello: how it is. list tunables, faults, bodies, signals, "
    "checkpoints or commands [PATTERN]. get NAME or PATTERN. set NAME=VALUE (or NAME VALUE). "
    "fault NAME on or off. push BODY [force_n=X,Y,Z] [moment_nm=X,Y,Z] [duration_s=S]: in the "
    "world frame, until the next push without duration_s. pause, resume, step [TICKS]. speed "
    "FACTOR: virtual seconds a second; max: as fast as it goes. reset: to the start. checkpoint "
    "[SLOT], restore [SLOT]: slots 1 to 3, 1 by default; 0 is the start. wait tick=N or "
    "time_s=S. subscribe SIGNAL or PATTERN...: rows until Ctrl-C, the end of the run or --rows. "
    "stop: ends the run.\n"
    "\n"
    "Patterns have * for any characters and ? for one; quote them. A value that begins with a "
    "minus needs NAME=VALUE.\n"
    "\n"
    "Which simulator. --socket PATH, else COMAN_HIL_CONTROL in the environment, else the newest "
    "of the user's that runs: \"run\" opens a socket at $XDG_RUNTIME_DIR/coman-hil/RIG.sock "
    "(RIG-2.sock for a second run of the same rig). When there is none of these, the newest in "
    "/run/coman-hil: RIG.sock of root's runs, RIG/control of coman-hil@RIG.service. Only who has "
    "started it, and root, may use it.\n"
    "\n"
    "Programs. The socket is a unix stream socket; a request is one line of JSON, its answer "
    "another, which repeats the id:\n"
    "\n"
    "  {\"id\": 1, \"cmd\": \"status\"}: {\"id\": 1, \"ok\": true, \"tick\": 1250, ...}\n"
    "  {\"cmd\": \"list\", \"what\": \"tunables\", \"match\": \"*knee*\"}\n"
    "  {\"cmd\": \"get\", \"name\": N}, {\"cmd\": \"set\", \"name\": N, \"value\": V}\n"
    "  {\"cmd\": \"fault\", \"name\": N, \"on\": true}\n"
    "  {\"cmd\": \"push\", \"body\": B, \"force_n\": [x, y, z], \"duration_s\": S}\n"
    "  {\"cmd\": \"pause\"}, \"resume\", \"reset\", \"stop\", \"hello\", \"statistics\"\n"
    "  {\"cmd\": \"step\", \"count\": N}: answered when they have run\n"
    "  {\"cmd\": \"speed\", \"factor\": F}: 0 is as fast as it goes\n"
    "  {\"cmd\": \"checkpoint\", \"slot\": 1}, {\"cmd\": \"restore\", \"slot\": 1}\n"
    "  {\"cmd\": \"wait\", \"tick\": N} or {\"cmd\": \"wait\", \"time_s\": T}\n"
    "  {\"cmd\": \"subscribe\", \"signals\": [\"q_*\"], \"period_ms\": 10}, \"unsubscribe\"\n"
    "\n"
    "After a subscribe rows come between the answers, {\"time_s\": T, \"tick\": N, \"values\": "
    "[...]}, with \"missed\": N when N were left out before it.\n"
    "\n"
    "A refusal is {\"id\": 1, \"ok\": false, \"code\": C, \"error\": \"found ..., expected "
    "...\"}; C is input, or what the loop refuses: empty (no such checkpoint), recording (no way "
    "back while one runs), clock, busy (a step runs), unavailable, cut (a pause ended the step), "
    "or ended. Requests are answered in their order, one after another: to pause a long step use "
    "a second connection. pause to restore, fault, push and set answer tick, time_s and "
    "state_hash as of then. Who sends 16 wrong lines in a row, half a line and then nothing for "
    "30 s, or does not take its answers for 30 s is cut off.\n"
    "\n"
    "Exit status: 0 done; 1 refused by the loop; 2 wrong command line, name or value; 3 no "
    "running simulator, or it went away; 4 this run cannot do it.";

struct ctl_options {
    const char *command, *socket;
    const char **word; /* NULL ends */
    size_t nword;
    double timeout_s, period_ms;
    int64_t rows;
    bool json, csv;
};

/* ---- from words to a request; a value that is NULL has gone wrong before ---- */

static enum error_code usage(struct error *error, const char *command, const char *expected)
{
    return error_set(error, ERROR_INPUT, "%s: expected %s", command, expected);
}

/* a number where the word is one, else the word: the server says what it expected */
static json_t *value_of(const char *word)
{
    double number;
    int64_t whole;

    if (text_to_int(word, -(INT64_C(1) << 53), INT64_C(1) << 53, &whole)) {
        return json_integer(whole);
    }
    return text_to_double(word, &number) ? json_real(number) : json_string(word);
}

/* "1,2,3" */
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

/* "KEY=VALUE" as a key of the request; the server knows which there are */
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

static enum error_code put_optional(json_t *request, const struct ctl_options *o, const char *key,
                                    struct error *error)
{
    if (o->nword > 1) {
        return usage(error, o->command, "at most one argument");
    }
    if (o->nword == 1) {
        json_object_set_new(request, key, value_of(o->word[0]));
    }
    return ERROR_NONE;
}

static enum error_code make_plain(json_t *request, const struct ctl_options *o, struct error *error)
{
    (void)request;
    return o->nword > 0 ? usage(error, o->command, "no argument") : ERROR_NONE;
}

static enum error_code make_list(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword < 1 || o->nword > 2) {
        return usage(error, o->command,
                     "tunables, faults, bodies, signals, checkpoints or commands, and maybe a "
                     "pattern");
    }
    json_object_set_new(request, "what", json_string(o->word[0]));
    if (o->nword == 2) {
        json_object_set_new(request, "match", json_string(o->word[1]));
    }
    return ERROR_NONE;
}

static enum error_code make_get(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword != 1) {
        return usage(error, o->command, "the name of a tunable, or a pattern");
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

static enum error_code make_set(json_t *request, const struct ctl_options *o, struct error *error)
{
    const char *equals = o->nword == 1 ? strchr(o->word[0], '=') : NULL;

    if (o->nword != 2 && !equals) {
        return usage(error, o->command, "NAME=VALUE or NAME VALUE");
    }
    json_object_set_new(request, "name",
                        equals ? json_stringn(o->word[0], (size_t)(equals - o->word[0]))
                               : json_string(o->word[0]));
    json_object_set_new(request, "value", value_of(equals ? equals + 1 : o->word[1]));
    return ERROR_NONE;
}

static enum error_code make_fault(json_t *request, const struct ctl_options *o, struct error *error)
{
    bool on = o->nword == 2 && strcmp(o->word[1], "on") == 0;

    if (o->nword != 2 || (!on && strcmp(o->word[1], "off") != 0)) {
        return usage(error, o->command, "the name of a fault, then on or off");
    }
    json_object_set_new(request, "name", json_string(o->word[0]));
    json_object_set_new(request, "on", json_boolean(on));
    return ERROR_NONE;
}

static enum error_code make_push(json_t *request, const struct ctl_options *o, struct error *error)
{
    enum error_code code = ERROR_NONE;

    if (o->nword < 1) {
        return usage(error, o->command, "BODY [force_n=X,Y,Z] [moment_nm=X,Y,Z] [duration_s=S]");
    }
    json_object_set_new(request, "body", json_string(o->word[0]));
    for (size_t i = 1; i < o->nword && !code; i++) {
        code = put_pair(request, o->command, o->word[i], error);
    }
    return code;
}

static enum error_code make_step(json_t *request, const struct ctl_options *o, struct error *error)
{
    return put_optional(request, o, "count", error);
}

static enum error_code make_slot(json_t *request, const struct ctl_options *o, struct error *error)
{
    return put_optional(request, o, "slot", error);
}

static enum error_code make_speed(json_t *request, const struct ctl_options *o, struct error *error)
{
    if (o->nword != 1) {
        return usage(error, o->command, "a factor, or max");
    }
    json_object_set_new(request, "factor",
                        strcmp(o->word[0], "max") == 0 ? json_integer(0) : value_of(o->word[0]));
    return ERROR_NONE;
}

static enum error_code make_wait(json_t *request, const struct ctl_options *o, struct error *error)
{
    return o->nword != 1 ? usage(error, o->command, "tick=N or time_s=S")
                         : put_pair(request, o->command, o->word[0], error);
}

static enum error_code make_subscribe(json_t *request, const struct ctl_options *o,
                                      struct error *error)
{
    json_t *signals = json_array();

    if (o->nword < 1) {
        json_decref(signals);
        return usage(error, o->command, "names or patterns of signals; \"list signals\" has them");
    }
    for (size_t i = 0; i < o->nword; i++) {
        json_array_append_new(signals, json_string(o->word[i]));
    }
    json_object_set_new(request, "signals", signals);
    json_object_set_new(request, "period_ms", json_real(o->period_ms));
    return ERROR_NONE;
}

static const struct ctl_command {
    const char *name;
    enum error_code (*make)(json_t *request, const struct ctl_options *o, struct error *error);
    void (*print)(const json_t *answer, FILE *out); /* NULL: tick, time and hash */
} commands[] = {
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

enum { NCOMMAND = sizeof commands / sizeof commands[0] };

static const struct ctl_command *find_command(const char *name, struct error *error)
{
    const char *names[NCOMMAND], *nearest;

    for (size_t i = 0; i < NCOMMAND; i++) {
        names[i] = commands[i].name;
        if (strcmp(names[i], name) == 0) {
            return &commands[i];
        }
    }
    nearest = text_nearest(name, names, NCOMMAND);
    error_set(error, ERROR_INPUT, "found unknown command \"%.100s\", expected %s%s%s", name,
              nearest ? "\"" : "one that ctl --help lists", nearest ? nearest : "",
              nearest ? "\"" : "");
    return NULL;
}

/* ---- answers ---- */

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number)
{
    (void)number;
    interrupted = 1;
}

static int status_of_refusal(const json_t *answer)
{
    const char *code = json_string_value(json_object_get(answer, "code"));

    if (code && strcmp(code, "input") == 0) {
        return STATUS_INPUT;
    }
    if (code && (strcmp(code, "unavailable") == 0 || strcmp(code, "clock") == 0)) {
        return STATUS_UNSUPPORTED;
    }
    return STATUS_FAILED;
}

/* The answer, as an object of the caller's; NULL with the exit status. */
static json_t *hear_answer(struct ctl_client *client, bool json, int *status)
{
    struct error error;
    json_t *answer = NULL;
    const char *text;
    char *line;

    switch (ctl_hear(client, &line, &error)) {
    case CTL_INTERRUPTED:
        *status = STATUS_FAILED;
        return NULL;
    case CTL_FAILED:
        *status = command_fail("ctl", &error);
        return NULL;
    case CTL_END:
        error_set(&error, ERROR_SYSTEM, "%s closed the connection: the run has ended",
                  client->path);
        *status = command_fail("ctl", &error);
        return NULL;
    case CTL_LINE:
        break;
    }
    if (json) {
        puts(line);
    }
    answer = json_loads(line, 0, NULL);
    if (!json_is_object(answer)) {
        error_set(&error, ERROR_SYSTEM, "%s answers with what is no JSON object", client->path);
        *status = command_fail("ctl", &error);
    } else if (!json_is_true(json_object_get(answer, "ok"))) {
        text = json_string_value(json_object_get(answer, "error"));
        fprintf(stderr, "coman-hil ctl: %s\n", text ? text : "refused");
        *status = status_of_refusal(answer);
    } else {
        *status = STATUS_OK;
        return answer;
    }
    json_decref(answer);
    return NULL;
}

static void print_line(const struct ctl_options *o, const json_t *titles, const char *line,
                       int64_t *rows)
{
    json_t *row = json_loads(line, 0, NULL);
    json_int_t missed = json_integer_value(json_object_get(row, "missed"));

    if (missed > 0 && !o->json) {
        fflush(stdout);
        fprintf(stderr, "coman-hil ctl: missed %lld rows\n", (long long)missed);
    }
    if (o->json) {
        puts(line);
    } else {
        ctl_print_row(titles, row, o->csv, stdout);
    }
    *rows += json_is_array(json_object_get(row, "values"));
    json_decref(row);
}

/* Rows until the user or the run ends. */
static int follow(struct ctl_client *client, const struct ctl_options *o, const json_t *answer)
{
    struct error error;
    int64_t rows = 0;

    if (!o->json) {
        ctl_print_titles(answer, o->csv, stdout);
    }
    client->timeout_ns = 0; /* a pause may last */
    while (o->rows == 0 || rows < o->rows) {
        char *line;

        fflush(stdout);
        switch (ctl_hear(client, &line, &error)) {
        case CTL_LINE:
            print_line(o, answer, line, &rows);
            break;
        case CTL_INTERRUPTED:
            return STATUS_OK;
        case CTL_END:
            fprintf(stderr, "coman-hil ctl: the connection was closed: the run has ended, or rows "
                            "were not taken for long\n");
            return STATUS_OK;
        case CTL_FAILED:
            return command_fail("ctl", &error);
        }
        if (ferror(stdout)) {
            return STATUS_SYSTEM;
        }
    }
    return STATUS_OK;
}

/* After a stop, until the simulator is gone. */
static int see_it_end(struct ctl_client *client)
{
    struct error error;
    char *line;

    for (;;) {
        switch (ctl_hear(client, &line, &error)) {
        case CTL_LINE:
            break;
        case CTL_INTERRUPTED:
            return STATUS_FAILED;
        case CTL_END:
            return STATUS_OK;
        case CTL_FAILED:
            return command_fail("ctl", &error);
        }
    }
}

static void print_answer(const struct ctl_options *o, const struct ctl_command *command,
                         const json_t *answer)
{
    if (o->json || strcmp(command->name, "stop") == 0) {
        return;
    }
    if (command->print) {
        command->print(answer, stdout);
    } else if (strcmp(command->name, "get") == 0) {
        if (json_object_get(answer, "tunables")) {
            ctl_print_list(answer, stdout);
        } else {
            ctl_print_tunable(answer, stdout);
        }
    } else {
        ctl_print_moment(command->name, answer, stdout);
    }
}

static int converse(struct ctl_client *client, const struct ctl_options *o,
                    const struct ctl_command *command, const json_t *request)
{
    struct error error;
    json_t *answer;
    int status;

    if (ctl_send(client, request, &error)) {
        return command_fail("ctl", &error);
    }
    answer = hear_answer(client, o->json, &status);
    if (!answer) {
        return status;
    }
    if (strcmp(command->name, "subscribe") == 0) {
        status = follow(client, o, answer);
    } else {
        print_answer(o, command, answer);
    }
    if (strcmp(command->name, "stop") == 0) {
        status = see_it_end(client);
    }
    json_decref(answer);
    return status;
}

static int ctl(const struct ctl_options *o)
{
    static struct ctl_client client;
    const struct sigaction action = {.sa_handler = on_interrupt};
    const struct ctl_command *command;
    json_t *request = json_object();
    struct error error;
    int status;

    command = find_command(o->command, &error);
    json_object_set_new(request, "cmd", json_string(o->command));
    if (!command || command->make(request, o, &error)) {
        json_decref(request);
        return command_fail("ctl", &error);
    }
    client.timeout_ns = (int64_t)(o->timeout_s * 1e9);
    client.interrupted = &interrupted;
    if (ctl_connect(&client, o->socket, &error)) {
        json_decref(request);
        return command_fail("ctl", &error);
    }
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    status = converse(&client, o, command, request);
    ctl_close(&client);
    json_decref(request);
    return status;
}

int cmd_ctl(int argc, char **argv)
{
    static const char *word[WORDS_MAX + 1];
    static struct ctl_options o = {.word = word, .period_ms = 10.0};
    static const struct option_spec options[] = {
        {"--socket", OPTION_STRING, "PATH", "the control socket of the simulator",
         .value = &o.socket},
        {"--json", OPTION_FLAG, NULL, "print the answers as they come, a JSON object a line",
         .value = &o.json},
        {"--period", OPTION_REAL, "MS",
         "subscribe: a row every MS ms of virtual time, 10 by default", .value = &o.period_ms,
         .min = 1e-3, .max = 60000.0, .unit = "ms"},
        {"--rows", OPTION_INT, "N", "subscribe: end after N rows", .value = &o.rows, .min = 1.0,
         .max = 1e12},
        {"--csv", OPTION_FLAG, NULL, "subscribe: rows as in signals.csv, for plot and others",
         .value = &o.csv},
        {"--timeout", OPTION_REAL, "S", "give up when an answer takes longer; never by default",
         .value = &o.timeout_s, .min = 1e-3, .max = 1e6, .unit = "seconds"},
    };
    static const struct operand_spec operands[] = {
        {"COMMAND", "what to do; see below", true, &o.command},
        {"ARGUMENT", "of the command", false, word},
    };
    static const struct command_spec spec = {
        .name = "ctl",
        .summary = "Look at a running simulator and steer it.",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 2,
        .many = true,
        .manual = manual,
    };
    struct error error;
    int status;

    if (argc > WORDS_MAX) {
        error_set(&error, ERROR_INPUT, "found %d words, expected at most %d", argc, WORDS_MAX);
        return command_fail("ctl", &error);
    }
    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    while (o.word[o.nword]) {
        o.nword++;
    }
    return ctl(&o);
}
