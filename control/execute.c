/* SPDX-License-Identifier: Apache-2.0 */
/* Carries out requests: at once, through the simulation loop, or when a tick is reached. */
#include "control/private.h"

#include <math.h>

enum { KEY_STOP = 16 }; /* key of a log line */

/* ---- names ---- */

/* Finds the index of a name in a list. The error suggests the nearest name. what: word for an
 * entry, for the error. */
static enum error_code find_name(const struct control *control, enum control_list list,
                                 const char *what, const char *name, size_t *index,
                                 struct error *error)
{
    const char *nearest = NULL, *known;
    size_t count = 0;

    for (; (known = control_list_entry(control, list, count)); count++) {
        if (strcmp(known, name) == 0) {
            *index = count;
            return ERROR_NONE;
        }
        /* text_nearest is associative, so comparing pairs is enough */
        nearest = text_nearest(name, (const char *[]){nearest ? nearest : known, known}, 2);
    }
    if (count == 0) {
        return error_set(error, ERROR_INPUT, "found no %s \"%.80s\": this run has none", what,
                         name);
    }
    return error_set(error, ERROR_INPUT, "found no %s \"%.80s\", expected one of %zu%s%s%s", what,
                     name, count, nearest ? "; the nearest is \"" : "", nearest ? nearest : "",
                     nearest ? "\"" : "");
}

/* ---- requests to the loop ---- */

/* Fills in a request to the loop that sets a tunable. Refuses a value out of range. */
static enum error_code request_complete_set(const struct control *control,
                                            const struct control_request *request,
                                            struct loop_request *to, struct error *error)
{
    enum error_code code =
        find_name(control, CONTROL_LIST_TUNABLES, "tunable", request->name, &to->index, error);
    const struct tunable *tunable;

    if (code) {
        return code;
    }
    tunable = requests_tunable(control->config.requests, to->index);
    if (!(request->value >= tunable->min && request->value <= tunable->max) ||
        (tunable->whole && request->value != floor(request->value))) {
        return error_set(error, ERROR_INPUT, "set: %s: found %.15g, expected %s%.15g to %.15g%s%s",
                         tunable->name, request->value, tunable->whole ? "a whole number, " : "",
                         tunable->min, tunable->max, tunable->unit[0] ? " " : "", tunable->unit);
    }
    to->value = request->value;
    return ERROR_NONE;
}

/* For each command: 1 + the kind of its request to the loop; 0 = the loop is not needed. */
static const int loop_kinds[CONTROL_COMMANDS] = {
    [CONTROL_PAUSE] = REQUEST_PAUSE + 1,     [CONTROL_RESUME] = REQUEST_RESUME + 1,
    [CONTROL_RESET] = REQUEST_RESET + 1,     [CONTROL_STEP] = REQUEST_STEP + 1,
    [CONTROL_SPEED] = REQUEST_SPEED + 1,     [CONTROL_CHECKPOINT] = REQUEST_CHECKPOINT + 1,
    [CONTROL_RESTORE] = REQUEST_RESTORE + 1, [CONTROL_FAULT] = REQUEST_FAULT + 1,
    [CONTROL_PUSH] = REQUEST_PUSH + 1,       [CONTROL_SET] = REQUEST_SET + 1,
};

/* Converts a client's request to a request to the loop. Names become indices here, so the loop does
 * not search. */
static enum error_code make_loop_request(const struct control *control,
                                         const struct control_request *request,
                                         struct loop_request *to, struct error *error)
{
    *to = (struct loop_request){
        .kind = (enum request_kind)(loop_kinds[request->command] - 1),
        .index = (size_t)request->count, /* slot of the checkpoint */
        .count = (uint64_t)request->count,
        .value = request->value,
        .on = request->on,
        .duration_ns = (int64_t)llround(request->time_s * 1e9),
    };
    memcpy(to->force_n, request->force_n, sizeof to->force_n);
    memcpy(to->moment_nm, request->moment_nm, sizeof to->moment_nm);
    switch (to->kind) {
    case REQUEST_FAULT:
        return find_name(control, CONTROL_LIST_FAULTS, "fault", request->name, &to->index, error);
    case REQUEST_PUSH:
        return find_name(control, CONTROL_LIST_BODIES, "body", request->name, &to->index, error);
    case REQUEST_SET:
        return request_complete_set(control, request, to, error);
    default:
        return ERROR_NONE;
    }
}

/* Sends the request to the loop, or waits for free space in the loop's ring. */
static void client_ask_loop(struct control *control, struct control_client *client)
{
    client->waiting =
        requests_ask(control->config.requests, &client->loop_request) ? WAITING_LOOP : WAITING_ROOM;
}

/* Begins a request to the loop, or refuses an invalid one. */
static void begin_loop_request(struct control *control, struct control_client *client)
{
    struct error error;

    if (make_loop_request(control, &client->request, &client->loop_request, &error)) {
        control_refuse(control, client, client->request.id, "input", error.text, NULL);
        control_request_clear(&client->request);
        return;
    }
    /* The ticket identifies the loop's answer. It also contains the slot of the checkpoint, because
     * the client may have left before the answer */
    client->loop_request.ticket = ++control->tickets * CHECKPOINT_SLOTS;
    if (client->loop_request.kind == REQUEST_CHECKPOINT) {
        client->loop_request.ticket += client->loop_request.index;
    }
    client_ask_loop(control, client);
}

/* ---- requests answered at once ---- */

/* Answers a request that does not need the loop. */
static void answer_now(struct control *control, struct control_client *client)
{
    struct control_request request = client->request;
    struct error error;
    json_t *body = NULL;
    size_t index;

    /* Default error: a NULL body without another error means out of memory */
    error_set(&error, ERROR_MEMORY, "no memory for the answer");
    switch (request.command) {
    case CONTROL_HELLO:
        body = control_hello(control);
        break;
    case CONTROL_STATUS:
        body = control_status(control, client);
        break;
    case CONTROL_STATISTICS:
        body = control_statistics(control);
        break;
    case CONTROL_LIST:
        body = control_list(control, &request);
        break;
    case CONTROL_GET:
        body = find_name(control, CONTROL_LIST_TUNABLES, "tunable", request.name, &index, &error)
                   ? NULL
                   : control_tunable(control, index);
        break;
    case CONTROL_SUBSCRIBE:
        body = control_subscribe(control, client, &request, &error);
        break;
    case CONTROL_UNSUBSCRIBE:
        body = control_unsubscribe(control, client);
        break;
    default:
        control_log(control, KEY_STOP, "control: process %ld ends the run", (long)client->pid);
        atomic_store(&control->stopped, true);
        simulator_stop(control->config.simulator);
        body = json_object();
        break;
    }

    /* Keep the request valid until its id is in the answer */
    if (body) {
        control_answer(control, client, request.id, body);
    } else {
        control_refuse(control, client, request.id, error.code == ERROR_MEMORY ? "memory" : "input",
                       error.text, NULL);
    }
    control_request_clear(&client->request);
}

void control_execute(struct control *control, struct control_client *client)
{
    if (loop_kinds[client->request.command]) {
        begin_loop_request(control, client);
    } else if (client->request.command == CONTROL_WAIT) {
        client->waiting = WAITING_TICK;
    } else {
        answer_now(control, client);
    }
}

/* ---- waiting ---- */

/* Returns the text of a refusal by the loop, with the reason in this run. */
static const char *verdict_text(const struct control *control, enum control_command command,
                                enum request_verdict verdict)
{
    bool back =
        command == CONTROL_RESET || command == CONTROL_CHECKPOINT || command == CONTROL_RESTORE;

    if (verdict == REQUEST_UNAVAILABLE && back &&
        simulator_task_runner(control->config.simulator)) {
        return "this run cannot go back: with the real clock its task has a thread of its own; "
               "start the task as a process (coman-hil task), or run with --clock free or lockstep";
    }
    if (verdict == REQUEST_CLOCK && command == CONTROL_SPEED) {
        return simulator_configuration(control->config.simulator)->clock == LOOP_CLOCK_LOCKSTEP
                   ? "in lockstep the STEPs are the pace"
                   : "the task has a thread of its own, which needs a speed greater than 0";
    }
    return request_verdict_text(verdict);
}

/* Passes the loop's answer to the client. */
static void finish_loop_request(struct control *control, struct control_client *client,
                                const struct request_answer *answer)
{
    /* The protocol's codes for the verdicts */
    static const char *const codes[] = {
        [REQUEST_OK] = "",
        [REQUEST_RANGE] = "input",
        [REQUEST_EMPTY] = "empty",
        [REQUEST_RECORDING] = "recording",
        [REQUEST_CLOCK] = "clock",
        [REQUEST_BUSY] = "busy",
        [REQUEST_UNAVAILABLE] = "unavailable",
        [REQUEST_CUT] = "cut",
    };
    struct control_request request = client->request;
    json_t *body =
        json_pack("{s:I, s:f, s:o}", "tick", (json_int_t)answer->tick, "time_s",
                  (double)answer->time_ns * 1e-9, "state_hash", control_hash(answer->state_hash));

    if (request.command == CONTROL_PUSH && body) {
        json_object_set_new(body, "ended_n", control_number(answer->ended[0]));
        json_object_set_new(body, "ended_nm", control_number(answer->ended[1]));
    }
    client->request.root = NULL;
    client->waiting = WAITING_NOT;
    if (answer->verdict == REQUEST_OK) {
        control_answer(control, client, request.id, body);
    } else {
        control_refuse(control, client, request.id, codes[answer->verdict],
                       verdict_text(control, request.command, answer->verdict), body);
    }
    control_request_clear(&request);
}

/* Receives the loop's answers and passes each answer to the client that waits for it. */
static void take_loop_answers(struct control *control)
{
    struct request_answer answer;

    while (requests_answer(control->config.requests, &answer)) {
        size_t slot = answer.ticket % CHECKPOINT_SLOTS;

        control_rows(control); /* send rows of earlier ticks before the answer */
        if (slot > 0 && answer.verdict == REQUEST_OK) {
            control->slot[slot] = answer;
        }
        for (size_t i = 0; i < CONTROL_PLACES; i++) {
            struct control_client *client = &control->client[i];

            if (client->socket >= 0 && client->waiting == WAITING_LOOP &&
                client->loop_request.ticket == answer.ticket) {
                finish_loop_request(control, client, &answer);
            }
        }
    }
}

bool control_pump(struct control *control)
{
    bool more = false;

    take_loop_answers(control);
    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        struct control_client *client = &control->client[i];

        if (client->socket < 0) {
            continue;
        }
        if (client->waiting == WAITING_ROOM) {
            client_ask_loop(control, client);
        } else if (client->waiting == WAITING_TICK) {
            /* Answer a wait request when its tick or time has been reached */
            struct simulator_status status = {0};
            struct control_request request = client->request;

            simulator_read(control->config.simulator, &status);
            if (request.wait_time ? (double)status.time_ns * 1e-9 >= request.time_s
                                  : status.tick >= (uint64_t)request.count) {
                client->request.root = NULL;
                client->waiting = WAITING_NOT;
                control_answer(control, client, request.id,
                               json_pack("{s:I, s:f}", "tick", (json_int_t)status.tick, "time_s",
                                         (double)status.time_ns * 1e-9));
                control_request_clear(&request);
            }
        }
        if (client->received > 0 && control_carry_out_requests(control, client)) {
            more = true;
        }
    }
    return more;
}

void control_end(struct control *control)
{
    take_loop_answers(control);
    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        struct control_client *client = &control->client[i];

        if (client->socket >= 0 && client->waiting != WAITING_NOT) {
            struct control_request request = client->request;

            client->request.root = NULL;
            control_refuse(control, client, request.id, "ended", "the run is over", NULL);
            control_request_clear(&request);
        }
        control_flush(control, client);
        control_drop(control, client);
    }
}
