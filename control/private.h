/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions and state that the files of the control socket share (control/control.h). control.c has
 * the thread, clients.c the bytes of a client, execute.c carries out requests, answer.c makes
 * answers about the simulator, rows.c serves subscriptions. All run in the server's thread, except
 * functions of control.h. Not RT-safe.
 */
#ifndef CONTROL_PRIVATE_H
#define CONTROL_PRIVATE_H

#include "control/control.h"
#include "control/parse.h"
#include "control/socket.h"
#include "base/ring.h"

#include <pthread.h>

/* One place more than clients: whoever gets it may only pause, resume and stop. */
enum { CONTROL_EVENT_TEXT = 240, CONTROL_PLACES = CONTROL_CLIENTS + 1 };

/* The event that an answer to a client's request waits for. */
enum control_waiting {
    WAITING_NOT,
    WAITING_ROOM, /* room in the ring to the loop */
    WAITING_LOOP, /* the loop's answer */
    WAITING_TICK, /* a tick or a time */
};

struct control_subscription {
    size_t count;         /* number of signals; 0 = no subscription */
    uint16_t *signal;     /* indices of the signals; room for all */
    uint64_t period;      /* in ticks */
    uint64_t rows;        /* rows sent to the client */
    uint64_t missed;      /* rows missed in total */
    uint64_t missed_told; /* missed rows already reported */
    bool begun;           /* a row has been seen, at `tick` */
    uint64_t tick;
    uint64_t lost; /* last value of struct stream_row's lost */
};

struct control_client {
    int socket; /* -1 = free place */
    pid_t pid;
    uint64_t line; /* number of the last line */
    unsigned junk; /* wrong lines since the last valid one */
    bool counted;  /* has sent a request */
    bool ended;    /* has closed its sending side */
    bool skipping; /* skips the rest of a line that was too long */
    size_t received;
    char *inbox; /* CONTROL_LINE */
    size_t sent, filled;
    char *outbox;         /* CONTROL_OUTBOX bytes; those from sent to filled wait */
    int64_t last_byte_ns; /* time of the last received byte */
    uint64_t activity;    /* number of its connection, or of its last received bytes */
    /* time when the client last took a byte, or when the outbox began to fill */
    int64_t taken_ns;

    enum control_waiting waiting;
    struct loop_request loop_request;
    struct control_request request; /* the waiting request */

    struct control_subscription subscription;
    bool seen; /* `before` holds the last status */
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
    struct arena arena;  /* the server's own arena, because the simulator's is sealed */
    int event;           /* eventfd: order has changed */
    _Atomic int order;   /* enum control_order */
    atomic_bool stopped; /* a client has stopped the run */
    pthread_t thread;
    int64_t patience_ns;
    int64_t now_ns; /* time of this turn */
    uint64_t tickets, activities;
    struct control_counters counters;
    /* the moment of each checkpoint; ticket 0 = empty */
    struct request_answer slot[CHECKPOINT_SLOTS];
    struct ring events;         /* struct control_event */
    struct histogram histogram; /* copy for statistics */
    struct control_client client[CONTROL_PLACES];
};

/* ---- clients.c ---- */

void control_log(struct control *control, uint64_t key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Accepts the waiting connections; false = the system refused one (no descriptor left). */
bool control_accept(struct control *control);

/* Receives bytes and carries out complete lines, a limited number per call; true = more are
 * waiting. */
bool control_read_requests(struct control *control, struct control_client *client);
bool control_carry_out_requests(struct control *control, struct control_client *client);

/* Checks whether the client's next bytes may be received and its next request carried out. */
bool control_may_read(const struct control_client *client);

void control_flush(struct control *control, struct control_client *client);
void control_check(struct control *control, struct control_client *client);
void control_drop(struct control *control, struct control_client *client);

/* Returns room for size bytes at the end of the outbox; the caller adds them to `filled`. NULL = no
 * room. */
char *control_room(struct control *control, struct control_client *client, size_t size);

/* Sends the answer to a request, with its id and "ok". Takes over body; NULL = out of memory. */
void control_answer(struct control *control, struct control_client *client, const json_t *id,
                    json_t *body);
void control_refuse(struct control *control, struct control_client *client, const json_t *id,
                    const char *code, const char *text, json_t *body);

/* ---- execute.c ---- */

/* Carries out client->request, or starts to. Takes over the request and clears it. */
void control_execute(struct control *control, struct control_client *client);

/* Continues the waiting requests: for room in the ring, answers of the loop, a tick. true = a
 * client has more to carry out. */
bool control_pump(struct control *control);

/* Answers every waiting request at the end of the run. */
void control_end(struct control *control);

/* ---- answer.c; NULL: no memory ---- */

json_t *control_hello(const struct control *control);
json_t *control_status(const struct control *control, struct control_client *client);
json_t *control_statistics(struct control *control);
json_t *control_list(const struct control *control, const struct control_request *request);
json_t *control_tunable(const struct control *control, size_t index);

/* Returns the name of a list's entry; NULL = no such index. */
const char *control_list_entry(const struct control *control, enum control_list list, size_t index);
/* Appends a value and takes it over; when out of memory the array becomes NULL. */
void control_append(json_t **array, json_t *value);
json_t *control_hash(uint64_t hash);

/* ---- rows.c ---- */

/* Begin and end a subscription. NULL with an error: unknown signal, or invalid period. */
json_t *control_subscribe(struct control *control, struct control_client *client,
                          const struct control_request *request, struct error *error);
json_t *control_unsubscribe(struct control *control, struct control_client *client);
void control_forget(struct control *control, struct control_client *client);

/* Sends new rows to their subscribers, a limited number per call; true = more are waiting. */
bool control_rows(struct control *control);

#endif
