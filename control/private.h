/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the control socket (control/control.h) share: control.c has the thread,
 * clients.c the bytes from and to a client, execute.c carries requests out, answer.c makes the
 * answers that describe the simulator, rows.c serves subscriptions. All in the server's thread but
 * for what control.h says. Not RT-safe.
 */
#ifndef CONTROL_PRIVATE_H
#define CONTROL_PRIVATE_H

#include "control/control.h"
#include "control/parse.h"
#include "control/socket.h"
#include "base/ring.h"

#include <pthread.h>

enum { CONTROL_EVENT_TEXT = 240 };

/* What the answer to a client's request waits for. */
enum control_waiting {
    WAITING_NOT,
    WAITING_ROOM, /* in the ring to the loop */
    WAITING_LOOP, /* for the loop's answer */
    WAITING_TICK, /* for a tick or a time */
};

struct control_subscription {
    size_t count;         /* of signals; 0 = none */
    uint16_t *signal;     /* their numbers; room for all */
    uint64_t period;      /* ticks */
    uint64_t rows;        /* sent to the client */
    uint64_t missed;      /* in all */
    uint64_t missed_told; /* of those, reported in rows */
    bool begun;           /* a row was seen, at tick */
    uint64_t tick;
    uint64_t lost; /* struct stream_row's, as last seen */
};

struct control_client {
    int socket; /* -1 = free place */
    pid_t pid;
    uint64_t line; /* number of the last line read */
    unsigned junk; /* wrong lines since the last good one */
    bool counted;  /* has asked for something */
    bool ended;    /* will send no more */
    bool skipping; /* the rest of a line that was too long */
    size_t received;
    char *inbox; /* CONTROL_LINE */
    size_t sent, filled;
    char *outbox;         /* CONTROL_OUTBOX; sent to filled wait */
    int64_t last_byte_ns; /* the last byte came */
    int64_t taken_ns;     /* the last byte was taken, or the outbox began to fill */

    enum control_waiting waiting;
    struct loop_request loop_request;
    struct control_request request; /* being waited for */

    struct control_subscription subscription;
    bool seen; /* before is that of the last status */
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
    struct arena arena;  /* of all this: its own, for the simulator's is sealed while we run */
    int event;           /* eventfd: order has changed */
    _Atomic int order;   /* enum control_order */
    atomic_bool stopped; /* a client has ended the run */
    pthread_t thread;
    int64_t patience_ns;
    int64_t now_ns; /* of this turn */
    uint64_t tickets;
    struct control_counters counters;
    struct request_answer slot[CHECKPOINT_SLOTS]; /* what each checkpoint is of; ticket 0 = empty */
    struct ring events;                           /* struct control_event */
    struct histogram histogram;                   /* a copy, for statistics */
    struct control_client client[CONTROL_CLIENTS];
};

/* ---- clients.c ---- */

void control_log(struct control *control, uint64_t key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Accepts the connections that wait; false = the system refuses one (no descriptor left). */
bool control_accept(struct control *control);

/* Receives bytes, and carries out the complete lines, some at a time; true = there are more. */
bool control_read_requests(struct control *control, struct control_client *client);
bool control_carry_out_requests(struct control *control, struct control_client *client);

/* Checks whether the client's next bytes may be received, and its next request be carried out. */
bool control_may_read(const struct control_client *client);

void control_flush(struct control *control, struct control_client *client);
void control_check(struct control *control, struct control_client *client);
void control_drop(struct control *control, struct control_client *client);

/* Returns room for so many bytes at the outbox's end, to be counted in filled; NULL = there is
 * none. */
char *control_room(struct control *control, struct control_client *client, size_t size);

/* Sends the answer to a request, with its id and "ok"; body is taken over, NULL counts as no
 * memory. */
void control_answer(struct control *control, struct control_client *client, const json_t *id,
                    json_t *body);
void control_refuse(struct control *control, struct control_client *client, const json_t *id,
                    const char *code, const char *text, json_t *body);

/* ---- execute.c ---- */

/* Carries out client->request, or begins to; the request is then its own to clear. */
void control_execute(struct control *control, struct control_client *client);

/* Continues the requests that wait: for room in the ring, for answers of the loop, for a tick.
 * True = a client has more to carry out. */
bool control_pump(struct control *control);

/* The run is over: answers every request that waits. */
void control_end(struct control *control);

/* ---- answer.c; NULL: no memory ---- */

json_t *control_hello(const struct control *control);
json_t *control_status(const struct control *control, struct control_client *client);
json_t *control_statistics(struct control *control);
json_t *control_list(const struct control *control, const struct control_request *request);
json_t *control_tunable(const struct control *control, size_t index);

/* Returns the name of an entry of a list; NULL = there is none of that index. */
const char *control_list_entry(const struct control *control, enum control_list list, size_t index);
/* Appends a value, which is taken over; without memory the array becomes NULL. */
void control_append(json_t **array, json_t *value);
json_t *control_hash(uint64_t hash);

/* ---- rows.c ---- */

/* Begin and end a subscription; NULL with an error: no such signal, no such period. */
json_t *control_subscribe(struct control *control, struct control_client *client,
                          const struct control_request *request, struct error *error);
json_t *control_unsubscribe(struct control *control, struct control_client *client);
void control_forget(struct control *control, struct control_client *client);

/* Sends rows that have come to their subscribers, some at a time; true = there are more. */
bool control_rows(struct control *control);

#endif
