/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions and state that the files of the control socket share (control/control.h). control.c
 * runs the thread, clients.c receives and sends lines, execute.c carries out requests, answer.c
 * makes answers about the simulator, and rows.c serves subscriptions. All functions run in the
 * server's thread, except the functions of control.h. Not RT-safe.
 */
#ifndef CONTROL_PRIVATE_H
#define CONTROL_PRIVATE_H

#include "base/ring.h"
#include "base/text.h"
#include "control/control.h"
#include "control/parse.h"
#include "control/socket.h"

#include <pthread.h>
#include <unistd.h>

/* CONTROL_PLACES: one more than clients. The client in the last place may only pause, resume and
 * stop the run. */
enum { CONTROL_EVENT_TEXT = 240, CONTROL_PLACES = CONTROL_CLIENTS + 1 };

/* The event for which a client's request waits. */
enum control_waiting {
    WAITING_NOT,
    WAITING_ROOM, /* free space in the ring to the loop */
    WAITING_LOOP, /* the loop's answer */
    WAITING_TICK, /* a tick or a time */
};

struct control_subscription {
    size_t count;         /* number of signals; 0 = no subscription */
    uint16_t *signal;     /* indices of the signals; capacity for all signals */
    uint64_t period;      /* in ticks */
    uint64_t rows;        /* rows sent to the client */
    uint64_t missed;      /* rows missed in total */
    uint64_t missed_told; /* missed rows already reported */
    bool begun;           /* there was a row; `tick` is the tick of the last one */
    uint64_t tick;
    uint64_t lost; /* member `lost` of the last struct stream_row */
};

struct control_client {
    int socket; /* -1 = free place */
    pid_t pid;
    uint64_t line; /* number of the last line */
    unsigned junk; /* invalid lines since the last valid line */
    bool counted;  /* has sent a request */
    bool ended;    /* has closed its sending side */
    bool skipping; /* skips the rest of a line that was too long */
    size_t received;
    char *inbox; /* CONTROL_LINE bytes */
    size_t sent, filled;
    char *outbox;         /* CONTROL_OUTBOX bytes; bytes `sent` to `filled` are unsent */
    int64_t last_byte_ns; /* time of the last received byte */
    uint64_t activity;    /* grows with each connection and with each receipt of bytes */
    /* last time when the client accepted bytes, or when the empty outbox got bytes */
    int64_t taken_ns;

    enum control_waiting waiting;
    struct loop_request loop_request;
    struct control_request request; /* the waiting request */

    struct control_subscription subscription;
    bool seen; /* `before` is valid: the last status sent to this client */
    struct simulator_status before;
};

/* Orders to the server's thread. */
enum control_order { CONTROL_ORDER_WAIT, CONTROL_ORDER_SERVE, CONTROL_ORDER_STOP };

struct control_event {
    uint64_t key;
    char text[CONTROL_EVENT_TEXT];
};

struct control {
    struct control_config config;
    const struct rig *rig;
    struct control_socket socket;
    struct arena arena;  /* the server's arena; the simulator's arena is sealed */
    int event;           /* eventfd; wakes the thread when order has changed */
    _Atomic int order;   /* enum control_order */
    atomic_bool stopped; /* a client has stopped the run */
    pthread_t thread;
    int64_t patience_ns;
    int64_t now_ns; /* time of this turn */
    uint64_t tickets, activities;
    struct control_counters counters;
    /* tick, time and hash of each checkpoint; ticket 0 = empty slot */
    struct request_answer slot[CHECKPOINT_SLOTS];
    struct ring events;         /* struct control_event */
    struct histogram histogram; /* copy for statistics */
    struct control_client client[CONTROL_PLACES];
};

/* ---- clients.c ---- */

void control_log(struct control *control, uint64_t key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Accepts the waiting connections. Returns false if the system refused one because no descriptor is
 * left. */
bool control_accept(struct control *control);

/* control_read_requests receives bytes and carries out complete lines; control_carry_out_requests
 * only carries out lines already received. Both limit the number of lines per call and return true
 * if more are waiting. */
bool control_read_requests(struct control *control, struct control_client *client);
bool control_carry_out_requests(struct control *control, struct control_client *client);

/* Returns whether the server may receive the client's next bytes and carry out its next request. */
bool control_may_read(const struct control_client *client);

void control_flush(struct control *control, struct control_client *client);
void control_check(struct control *control, struct control_client *client);
void control_drop(struct control *control, struct control_client *client);

/* Returns a pointer to `size` free bytes at the end of the outbox, or NULL if it has no space. The
 * caller writes the bytes and adds their number to `filled`. */
char *control_room(struct control *control, struct control_client *client, size_t size);

/* Send the answer to a request, with its id and "ok": control_answer for success, control_refuse
 * for an error. Both take ownership of body. A NULL body of control_answer means out of memory. */
void control_answer(struct control *control, struct control_client *client, const json_t *id,
                    json_t *body);
void control_refuse(struct control *control, struct control_client *client, const json_t *id,
                    const char *code, const char *text, json_t *body);

/* ---- execute.c ---- */

/* Carries out client->request, or begins to. Takes ownership of the request and clears it when it
 * is answered. */
void control_execute(struct control *control, struct control_client *client);

/* Continues requests that wait for free space in the ring, for the loop's answer or for a tick.
 * Returns true if a client has further lines to carry out. */
bool control_pump(struct control *control);

/* Answers every waiting request at the end of the run. */
void control_end(struct control *control);

/* ---- answer.c; NULL: no memory ---- */

json_t *control_hello(const struct control *control);
json_t *control_status(const struct control *control, struct control_client *client);
json_t *control_statistics(struct control *control);
json_t *control_list(const struct control *control, const struct control_request *request);
json_t *control_tunable(const struct control *control, size_t index);

/* Returns the name of an entry of a list, or NULL if the index is too large. */
const char *control_list_entry(const struct control *control, enum control_list list, size_t index);
/* Appends a value and takes ownership of it. Out of memory: the array becomes NULL. */
void control_append(json_t **array, json_t *value);
json_t *control_hash(uint64_t hash);

/* ---- rows.c ---- */

/* Begin and end a subscription; both return the body of the answer. control_subscribe returns NULL
 * with an error for an unknown signal or an invalid period. control_forget ends a subscription
 * without an answer. */
json_t *control_subscribe(struct control *control, struct control_client *client,
                          const struct control_request *request, struct error *error);
json_t *control_unsubscribe(struct control *control, struct control_client *client);
void control_forget(struct control *control, struct control_client *client);

/* Sends new rows to their subscribers, a limited number per call. Returns true if more rows are
 * waiting. */
bool control_rows(struct control *control);

#endif
