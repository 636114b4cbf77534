/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A running simulator with a control socket, and clients of it, for tests. The loop runs in a
 * thread of its own, in free run, and is stopped at tick 0 when the test gets it (unless bench_open
 * is told otherwise). Clients may be used from any thread; what they return is for the test to
 * judge.
 */
#ifndef TESTS_UNIT_CONTROL_CONTROL_BENCH_H
#define TESTS_UNIT_CONTROL_CONTROL_BENCH_H

#include "control/control.h"
#include "control/socket.h"
#include "tests/test.h"

#include <errno.h>
#include <jansson.h>
#include <poll.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

enum { BENCH_LINE = CONTROL_OUTBOX, BENCH_PATIENCE_MS = 20000 };

#define BENCH_QUICK (150 * CLOCK_MS) /* patience of a server that a test waits for */

struct bench_client {
    int socket;
    size_t received;
    char inbox[BENCH_LINE];
};

struct bench {
    char folder[64], path[96];
    struct arena arena;
    const struct rig *rig;
    struct simulator *simulator;
    struct bus_ports ports;           /* of a guest, if there is one */
    struct control *control;          /* NULL = without one */
    struct control_counters counters; /* after bench_close */
    pthread_t loop;
    enum loop_end end;
    uint64_t ticks, hash; /* after bench_close */
    struct bench_client client;
};

/* ---- clients ---- */

static inline void client_open(struct bench_client *client, const char *path)
{
    struct error error;

    client->received = 0;
    if (control_socket_connect(path, &client->socket, &error)) {
        client->socket = -1;
    }
}

static inline void client_close(struct bench_client *client)
{
    close(client->socket);
    client->socket = -1;
}

/* all of it, or false */
static inline bool client_send(const struct bench_client *client, const void *data, size_t size)
{
    const char *at = data;

    while (size > 0) {
        ssize_t sent = send(client->socket, at, size, MSG_NOSIGNAL);

        if (sent <= 0 && errno != EINTR) {
            return false;
        }
        at += sent > 0 ? sent : 0;
        size -= sent > 0 ? (size_t)sent : 0;
    }
    return true;
}

static inline bool client_say(const struct bench_client *client, const char *text)
{
    return client_send(client, text, strlen(text));
}

/* The next line as an object of the caller's; NULL at the end or when nothing comes for long. */
static inline json_t *client_hear(struct bench_client *client)
{
    char *end;

    while (!(end = memchr(client->inbox, '\n', client->received))) {
        struct pollfd fd = {.fd = client->socket, .events = POLLIN};
        ssize_t count = -1;

        if (poll(&fd, 1, BENCH_PATIENCE_MS) > 0) {
            count = recv(client->socket, client->inbox + client->received,
                         BENCH_LINE - client->received, 0);
        }
        if (count <= 0) {
            return NULL;
        }
        client->received += (size_t)count;
    }
    {
        size_t size = (size_t)(end - client->inbox);
        json_t *line = json_loadb(client->inbox, size, 0, NULL);

        client->received -= size + 1;
        memmove(client->inbox, end + 1, client->received);
        return line;
    }
}

/* Whether the other side has closed, after lines that nobody wants. */
static inline bool client_is_cut(struct bench_client *client)
{
    json_t *line;

    while ((line = client_hear(client))) {
        json_decref(line);
    }
    return recv(client->socket, client->inbox, 1, MSG_DONTWAIT) == 0 || errno == ECONNRESET;
}

static inline json_t *client_ask(struct bench_client *client, const char *request)
{
    return client_say(client, request) && client_say(client, "\n") ? client_hear(client) : NULL;
}

static inline bool is_ok(const json_t *answer)
{
    return json_is_true(json_object_get(answer, "ok"));
}

static inline const char *string_of(const json_t *answer, const char *key)
{
    const char *text = json_string_value(json_object_get(answer, key));

    return text ? text : "";
}

static inline int64_t whole_of(const json_t *answer, const char *key)
{
    return json_integer_value(json_object_get(answer, key));
}

static inline double number_of(const json_t *answer, const char *key)
{
    return json_number_value(json_object_get(answer, key));
}

/* ---- the simulator ---- */

static inline void *bench_loop(void *context)
{
    struct bench *bench = context;

    bench->end = simulator_run(bench->simulator);
    return NULL;
}

struct bench_options {
    const char *rig; /* by name; NULL = coman */
    enum loop_clock clock;
    const char *task;
    const char *const *fault;
    size_t nfault;
    uint64_t ticks;
    int64_t patience_ns;
    bool without_socket, runs; /* runs: it does not wait at tick 0 */
    bool guest;                /* with ports on every bus */
};

/* An answer that must be good; its hash, or 0. */
static inline uint64_t bench_do(struct bench *bench, const char *request)
{
    json_t *answer = client_ask(&bench->client, request);
    uint64_t hash = strtoull(string_of(answer, "state_hash"), NULL, 16);

    if (!is_ok(answer)) {
        fail_msg("%s: %s", request, string_of(answer, "error"));
    }
    json_decref(answer);
    return hash;
}

static inline void bench_open(struct bench *bench, const struct bench_options *options)
{
    struct simulator_config config = {
        .clock = options->clock,
        .hold = RIG_HOLD_ENABLED,
        .transport = TRANSPORT_LOCAL,
        .task = options->task,
        .fault = options->fault,
        .nfault = options->nfault,
        .ticks = options->ticks,
        .requests = !options->without_socket,
        .guests = options->guest,
    };
    struct control_config control = {.path = bench->path, .patience_ns = options->patience_ns};
    struct realtime_report report;
    struct error error;
    char notice[256], file[512];

    memset(bench, 0, sizeof *bench);
    snprintf(bench->folder, sizeof bench->folder, "/tmp/coman-hil-control-XXXXXX");
    assert_non_null(mkdtemp(bench->folder));
    snprintf(bench->path, sizeof bench->path, "%s/control", bench->folder);
    assert_ok(arena_init(&bench->arena, (size_t)512 << 20, &error));
    snprintf(file, sizeof file, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR,
             options->rig ? options->rig : "coman");
    assert_ok(rig_load(file, &bench->arena, &bench->rig, &error));
    config.rig = bench->rig;
    assert_ok(simulator_create(&config, &bench->arena, &bench->simulator, notice, &error));
    if (options->guest) {
        assert_ok(simulator_join(bench->simulator, &bench->ports, &error));
    }
    if (!options->without_socket) {
        control.simulator = bench->simulator;
        control.requests = simulator_requests(bench->simulator);
        assert_ok(control_start(&control, &bench->control, &error));
        client_open(&bench->client, bench->path);
        assert_true(bench->client.socket >= 0);
    }
    assert_ok(simulator_start(bench->simulator, &report, &error));
    control_serve(bench->control);
    if (bench->control && !options->runs) {
        struct bench_client *second = test_malloc(sizeof *second);
        json_t *answer;

        /* when a later client has its answer, the pause waits for the loop to begin */
        assert_true(client_say(&bench->client, "{\"cmd\":\"pause\"}\n"));
        client_open(second, bench->path);
        answer = client_ask(second, "{\"cmd\":\"hello\"}");
        assert_true(is_ok(answer));
        json_decref(answer);
        client_close(second);
        test_free(second);
    }
    assert_int_equal(pthread_create(&bench->loop, NULL, bench_loop, bench), 0);
    if (bench->control && !options->runs) {
        json_t *answer = client_hear(&bench->client);

        assert_true(is_ok(answer));
        assert_int_equal(whole_of(answer, "tick"), 0);
        json_decref(answer);
    }
}

/* After the loop's thread was joined. */
static inline void bench_finish(struct bench *bench)
{
    bench->ticks = simulator_stats(bench->simulator)->ticks;
    bench->hash = plant_hash(simulator_plant(bench->simulator));
    if (bench->control) {
        client_close(&bench->client);
        control_stop(bench->control);
        control_counters(bench->control, &bench->counters);
        control_destroy(bench->control);
    }
    bus_ports_close(&bench->ports);
    simulator_destroy(bench->simulator);
    arena_fini(&bench->arena);
    assert_int_equal(access(bench->path, F_OK), -1);
    assert_int_equal(rmdir(bench->folder), 0);
}

/* Until the run has ended by itself, or after a stop. */
static inline void bench_close(struct bench *bench)
{
    pthread_join(bench->loop, NULL);
    bench_finish(bench);
}

#endif
