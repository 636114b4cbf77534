/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil ctl: observes and controls a running simulator through its control socket. */
#include "app/cli/cli.h"
#include "app/cli/ctl_request.h"
#include "control/ctl_client.h"
#include "control/ctl_print.h"
#include "manual/ctl.h"

#include <errno.h>
#include <netdb.h>
#include <stdlib.h>
#include <unistd.h>

/* Longest host name; payload of the longest UDP datagram over IPv4, bytes. */
enum { HOST_SIZE = 256, DATAGRAM_MAX = 65507 };

/* Splits HOST:PORT at the last colon; an IPv6 address before it is in brackets. A port alone means
 * localhost. Returns false for other text. */
static bool udp_split_address(const char *to, char host[HOST_SIZE], const char **port)
{
    const char *colon = strrchr(to, ':');
    size_t length = colon ? (size_t)(colon - to) : 0;

    *port = colon ? colon + 1 : to;
    if (!**port || length >= HOST_SIZE || (colon && length == 0)) {
        return false;
    }
    if (length > 2 && to[0] == '[' && to[length - 1] == ']') {
        snprintf(host, HOST_SIZE, "%.*s", (int)length - 2, to + 1);
    } else {
        snprintf(host, HOST_SIZE, "%.*s", colon ? (int)length : 9, colon ? to : "localhost");
    }
    return strspn(*port, "0123456789") == strlen(*port);
}

static enum error_code ctl_udp_open(const char *to, int *descriptor, struct error *error)
{
    const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_DGRAM};
    struct addrinfo *found = NULL;
    char host[HOST_SIZE];
    const char *port;
    int reason;

    if (!udp_split_address(to, host, &port)) {
        return error_set(error, ERROR_INPUT,
                         "--udp: found \"%.100s\", expected HOST:PORT, as in localhost:9870", to);
    }
    reason = getaddrinfo(host, port, &hints, &found);
    if (reason) {
        return error_set(error,
                         reason == EAI_MEMORY                          ? ERROR_MEMORY
                         : reason == EAI_SYSTEM || reason == EAI_AGAIN ? ERROR_SYSTEM
                                                                       : ERROR_INPUT,
                         "--udp: %.100s: %s", to,
                         reason == EAI_MEMORY   ? "no memory left"
                         : reason == EAI_SYSTEM ? strerror(errno)
                                                : gai_strerror(reason));
    }

    /* A connected socket needs no address for each datagram */
    *descriptor = socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (*descriptor < 0 || connect(*descriptor, found->ai_addr, found->ai_addrlen)) {
        error_set_errno(error, errno, "--udp: %.100s", to);
        if (*descriptor >= 0) {
            close(*descriptor);
        }
        freeaddrinfo(found);
        return ERROR_SYSTEM;
    }
    freeaddrinfo(found);
    return ERROR_NONE;
}

static enum error_code ctl_udp_send(int descriptor, const json_t *answer, const json_t *row,
                                    struct error *error)
{
    const json_t *names = json_object_get(answer, "signals");
    const json_t *values = json_object_get(row, "values");
    json_t *message = json_object();
    char *text;
    size_t size;

    json_object_set(message, "timestamp", json_object_get(row, "time_s"));
    for (size_t i = 0; i < json_array_size(names) && i < json_array_size(values); i++) {
        const char *name = json_string_value(json_array_get(names, i));

        if (name) {
            json_object_set(message, name, json_array_get(values, i));
        }
    }
    text = json_dumps(message, JSON_COMPACT | JSON_REAL_PRECISION(15));
    json_decref(message);
    if (!text) {
        return error_set(error, ERROR_MEMORY, "no memory for a datagram");
    }

    /* Ignore a failed send: there may be no receiver yet, or a queue is full, and the next row may
     * arrive */
    size = strlen(text);
    if (size <= DATAGRAM_MAX) {
        (void)!send(descriptor, text, size, MSG_NOSIGNAL);
    }
    free(text);
    return size <= DATAGRAM_MAX
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "--udp: found a row of %zu bytes, expected one that fits into a "
                           "datagram of %d: subscribe to fewer signals",
                           size, DATAGRAM_MAX);
}

/* ---- answers ---- */

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number)
{
    (void)number;
    interrupted = 1;
}

/* Returns the exit status for a refusal, from the answer's "code". */
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

/* Receives the answer, an object that the caller frees. Returns NULL and sets the exit status if
 * there is no answer to print. */
static json_t *ctl_receive_answer(struct ctl_client *client, bool json, int *status)
{
    struct error error;
    json_t *answer;
    const char *text;
    char *line;

    /* Read a line, or find the reason why there is none */
    switch (ctl_read_line(client, &line, &error)) {
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
    answer = ctl_parse_printable(line);
    if (json) {
        puts(line);
    }

    /* Returns only an answer with "ok": true */
    if (!json_is_object(answer)) {
        error_set(&error, ERROR_SYSTEM, "%s answers with something other than a JSON object",
                  client->path);
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

/* Prints a row, or sends it to the UDP socket (-1 = none). Counts it in *rows. */
static enum error_code ctl_give_row(const struct ctl_options *o, int udp, const json_t *titles,
                                    char *line, int64_t *rows, struct error *error)
{
    json_t *row = ctl_parse_printable(line);
    enum error_code code = ERROR_NONE;
    json_int_t missed = json_integer_value(json_object_get(row, "missed"));

    if (missed > 0 && !o->json) {
        fflush(stdout);
        fprintf(stderr, "coman-hil ctl: missed %lld rows\n", (long long)missed);
    }
    if (udp >= 0 && json_is_array(json_object_get(row, "values"))) {
        code = ctl_udp_send(udp, titles, row, error);
    } else if (udp < 0 && o->json) {
        puts(line);
    } else if (udp < 0) {
        ctl_print_row(titles, row, o->csv, stdout);
    }
    *rows += json_is_array(json_object_get(row, "values"));
    json_decref(row);
    return code;
}

/* Prints or sends rows until the user or the run stops, or until --rows have been received. */
static int ctl_follow_rows(struct ctl_client *client, const struct ctl_options *o, int udp,
                           const json_t *answer)
{
    struct error error;
    int64_t rows = 0;

    if (!o->json && udp < 0) {
        ctl_print_titles(answer, o->csv, stdout);
    }

    /* Each line is a row; flushes the output before it waits for the next one */
    while (o->rows == 0 || rows < o->rows) {
        char *line;

        fflush(stdout);
        switch (ctl_read_line(client, &line, &error)) {
        case CTL_LINE:
            if (ctl_give_row(o, udp, answer, line, &rows, &error)) {
                return command_fail("ctl", &error);
            }
            break;
        case CTL_INTERRUPTED:
            return STATUS_OK;
        case CTL_END:
            fprintf(stderr, "coman-hil ctl: the connection was closed: the run has ended, or rows "
                            "were not drained for too long\n");
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

/* Waits after a stop request until the simulator closes the connection. */
static int ctl_wait_for_end(struct ctl_client *client)
{
    struct error error;
    char *line;

    for (;;) {
        switch (ctl_read_line(client, &line, &error)) {
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

/* Prints an answer in its command's format; with --json the line was printed before. */
static void print_answer(const struct ctl_options *o, const struct ctl_command *command,
                         const json_t *request, const json_t *answer)
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
    } else if (strcmp(command->name, "push") == 0 && !json_object_get(request, "force_n") &&
               !json_object_get(request, "moment_nm")) {
        const double force = json_number_value(json_object_get(answer, "ended_n"));
        const double moment = json_number_value(json_object_get(answer, "ended_nm"));

        if (force > 0.0 || moment > 0.0) {
            printf("ended the push of %g N and %g Nm on %s\n", force, moment, o->word[0]);
        } else {
            printf("no push acted on %s: found neither force_n nor moment_nm\n", o->word[0]);
        }
        ctl_print_moment(command->name, answer, stdout);
    } else {
        ctl_print_moment(command->name, answer, stdout);
    }
}

/* Checks whether a request with a pattern has no match. */
static bool answer_matches_nothing(const json_t *request, const json_t *answer)
{
    const char *what = json_string_value(json_object_get(request, "what"));

    return what && json_object_get(request, "match") &&
           json_array_size(json_object_get(answer, what)) == 0;
}

/* Sends the request and prints the answer. Then receives rows or waits for the end of the
 * connection, if the command does so. */
static int ctl_converse(struct ctl_client *client, const struct ctl_options *o, int udp,
                        const struct ctl_command *command, const json_t *request)
{
    struct error error;
    json_t *answer;
    int status;

    if (ctl_send(client, request, &error)) {
        return command_fail("ctl", &error);
    }
    answer = ctl_receive_answer(client, o->json, &status);
    if (!answer) {
        return status;
    }
    if (strcmp(command->name, "subscribe") == 0) {
        status = ctl_follow_rows(client, o, udp, answer);
    } else if (answer_matches_nothing(request, answer)) {
        error_set(&error, ERROR_INPUT,
                  "found nothing that \"%.80s\" matches, expected a pattern "
                  "of %s: \"coman-hil ctl list %s\" prints them",
                  json_string_value(json_object_get(request, "match")),
                  json_string_value(json_object_get(request, "what")),
                  json_string_value(json_object_get(request, "what")));
        status = command_fail("ctl", &error);
    } else {
        print_answer(o, command, request, answer);
    }
    if (strcmp(command->name, "stop") == 0) {
        status = ctl_wait_for_end(client);
    }
    json_decref(answer);
    return status;
}

/* Makes the request, connects, and exchanges messages. */
static int ctl_run(const struct ctl_options *o)
{
    static struct ctl_client client;
    const struct sigaction action = {.sa_handler = on_interrupt};
    const struct ctl_command *command;
    json_t *request = json_object();
    struct error error;
    int status, udp = -1;

    /* Completes the request before it looks for the simulator, so that wrong words fail
     * immediately */
    command = ctl_find_command(o->command, &error);
    json_object_set_new(request, "cmd", json_string(o->command));
    if (o->udp && command && strcmp(o->command, "subscribe") != 0) {
        error_set(&error, ERROR_INPUT, "found --udp with %s, expected it with subscribe",
                  o->command);
        command = NULL;
    }
    if (!command || ctl_make_request(command, o, request, &error) ||
        (o->udp && ctl_udp_open(o->udp, &udp, &error))) {
        json_decref(request);
        return command_fail("ctl", &error);
    }

    /* One request per connection */
    client.interrupted = &interrupted;
    if (ctl_connect(&client, o->socket, &error)) {
        status = command_fail("ctl", &error);
    } else {
        sigaction(SIGINT, &action, NULL);
        sigaction(SIGTERM, &action, NULL);
        status = ctl_converse(&client, o, udp, command, request);
        ctl_close(&client);
    }
    if (udp >= 0) {
        close(udp);
    }
    json_decref(request);
    return status;
}

int cmd_ctl(int argc, char **argv)
{
    static struct ctl_options o = {.period_ms = 10.0};
    static const struct option_spec options[] = {
        {"--socket", OPTION_STRING, "PATH", "the control socket of the simulator",
         .value = &o.socket},
        {"--json", OPTION_FLAG, NULL, "print the answers as they come, one JSON object per line",
         .value = &o.json},
        {"--period", OPTION_REAL, "MS",
         "subscribe: a row every MS ms of virtual time, 10 by default", .value = &o.period_ms,
         .min = 1e-3, .max = 60000.0, .unit = "ms"},
        {"--rows", OPTION_INT, "N", "subscribe: end after N rows", .value = &o.rows, .min = 1.0,
         .max = 1e12},
        {"--csv", OPTION_FLAG, NULL, "subscribe: rows as in signals.csv, for plot and others",
         .value = &o.csv},
        {"--udp", OPTION_STRING, "HOST:PORT",
         "subscribe: send each row as a UDP datagram of JSON instead of printing it, as "
         "PlotJuggler's UDP server takes them",
         .value = &o.udp},
    };
    static struct operand_spec operands[] = {
        {"COMMAND", "what to do; see below", true, .value = &o.command},
        {"ARGUMENT", "an argument of the command", false, .list = &o.word},
    };
    static const struct command_spec spec = {
        .name = "ctl",
        .summary = "Observe and control a running simulator.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .many = true,
        .manual = MANUAL_CTL,
    };
    int status;

    operands[0].words = ctl_command_names();

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    while (o.word[o.nword]) {
        o.nword++;
    }
    return ctl_run(&o);
}
