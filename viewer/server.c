/* SPDX-License-Identifier: Apache-2.0 */
/* The server's thread. It waits in a single poll() for orders, the listening socket, the clients,
 * and the clients' connections to the control socket. */
#include "viewer/private.h"

#include "base/listen.h"

#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#define MEMORY ((size_t)256 << 20) /* reserved address space */

enum { POLL_FIXED = 2, POLL_COUNT = POLL_FIXED + 2 * VIEWER_CLIENTS };
enum {
    IDLE_MS = 500,
    ROWS_MS = 20, /* period of reading rows; a run at full speed fills the stream in 30 ms */
    TRACE_MS = 5,
    AWAIT_MS = 5,
    AWAIT_LONGEST_MS = 500
};

/* ---- the thread ---- */

/* Returns the time until the next action is due, ms. */
static int viewer_idle_ms(const struct viewer *viewer)
{
    int64_t wait_ns = (int64_t)IDLE_MS * CLOCK_MS;

    if (viewer->awaited || viewer->rows_hurry) {
        return AWAIT_MS;
    }
    wait_ns = viewer->history ? ROWS_MS * CLOCK_MS : wait_ns;
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        const struct viewer_client *client = &viewer->client[i];

        if (client->socket >= 0 && client->watch.on) {
            int64_t due_ns = client->watch.due_ns - viewer->now_ns;

            wait_ns = due_ns < wait_ns ? due_ns : wait_ns;
            wait_ns = client->watch.trace && wait_ns > TRACE_MS * CLOCK_MS ? TRACE_MS * CLOCK_MS
                                                                           : wait_ns;
        }
    }
    return wait_ns <= 0 ? 0 : (int)((wait_ns + CLOCK_MS - 1) / CLOCK_MS);
}

/* Handles the events of a client and of its control socket. */
static void viewer_serve_client(struct viewer *viewer, struct viewer_client *client, short events,
                                short control)
{
    if (client->socket >= 0 && events & POLLOUT) {
        client_flush(viewer, client);
    }
    if (client->socket >= 0 && events & ~POLLOUT) {
        client_read(viewer, client);
    }
    if (client->socket >= 0 && client->control >= 0 && control) {
        control_link_read(viewer, client);
    }
}

/* Requests views from the simulator while a client watches, and stops the requests otherwise. */
static void viewer_update_wish(struct viewer *viewer)
{
    bool wanted = false;

    if (viewer->ended) {
        return;
    }
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        wanted = wanted || (viewer->client[i].socket >= 0 && viewer->client[i].watch.on);
    }
    if (!viewer->config.simulator || wanted == viewer->wanted) {
        return;
    }

    /* The present view is old: wait for a new view */
    if (wanted) {
        viewer->views_before = simulator_view_read(viewer->config.simulator, &viewer->view);
        viewer->awaited_till_ns = viewer->now_ns + AWAIT_LONGEST_MS * CLOCK_MS;
    }
    viewer->wanted = viewer->awaited = wanted;
    simulator_want_views(viewer->config.simulator, wanted);
}

/* Handles the end of the loop: reads the last rows and the last view. */
static void viewer_note_end(struct viewer *viewer)
{
    viewer->ended = true;
    viewer->awaited = false;
    if (viewer->config.simulator) {
        viewer_take_rows(viewer);
        simulator_want_views(viewer->config.simulator, false);
    }
    if (viewer->stream) {
        stream_want(viewer->stream, 0);
    }
}

/* Publishes the counters for other threads. */
static void viewer_publish_counters(struct viewer *viewer)
{
    pthread_mutex_lock(&viewer->events_lock);
    viewer->told = viewer->counters;
    pthread_mutex_unlock(&viewer->events_lock);
}

/* Sends the end of the run to all clients, and disconnects them. */
static void viewer_end_clients(struct viewer *viewer)
{
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        struct viewer_client *client = &viewer->client[i];

        if (client->socket >= 0 && viewer->end) {
            client_tell_end(viewer, client);
        }
        if (client->socket >= 0 && client->mode == CLIENT_SOCKET) {
            client_bye(viewer, client, WEBSOCKET_AWAY, "the run is over");
        }
        if (client->socket >= 0) {
            client_close(viewer, client);
        }
    }
    if (viewer->config.simulator) {
        simulator_want_views(viewer->config.simulator, false);
    }
}

/* Main function of the thread: serves the clients from the first order until the order to stop. */
static void *viewer_thread_main(void *context)
{
    struct viewer *viewer = context;
    struct clock *clock = clock_monotonic();

    while (atomic_load(&viewer->order) == VIEWER_ORDER_WAIT) {
        poll(&(struct pollfd){.fd = viewer->event, .events = POLLIN}, 1, -1);
    }
    if (viewer->stream) {
        stream_want(viewer->stream, 1);
    }
    while (atomic_load(&viewer->order) != VIEWER_ORDER_STOP) {
        struct pollfd fd[POLL_COUNT];
        uint64_t orders;

        viewer->now_ns = clock_now(clock);

        /* Fill the descriptors to poll: orders, listener, then each client and its control
         * socket */
        fd[0] = (struct pollfd){.fd = viewer->event, .events = POLLIN};
        fd[1] = (struct pollfd){.fd = viewer->listener, .events = POLLIN};
        for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
            const struct viewer_client *client = &viewer->client[i];
            bool writes = client->socket >= 0 && client_waiting(client) > 0;

            /* Read from a client only while its outbox has space for answers */
            bool reads = client->socket >= 0 && client_waiting(client) < VIEWER_OUTBOX / 2;

            fd[POLL_FIXED + 2 * i] =
                (struct pollfd){.fd = client->socket,
                                .events = (short)((reads ? POLLIN : 0) | (writes ? POLLOUT : 0))};
            fd[POLL_FIXED + 2 * i + 1] = (struct pollfd){
                .fd = client->socket >= 0 && reads ? client->control : -1, .events = POLLIN};
        }
        if (poll(fd, POLL_COUNT, viewer_idle_ms(viewer)) < 0) {
            memset(fd, 0, sizeof fd); /* a signal, or no memory: poll again */
        }

        if (fd[0].revents) {
            (void)!read(viewer->event, &orders, sizeof orders);
        }
        if (!viewer->ended && atomic_load(&viewer->order) == VIEWER_ORDER_END) {
            viewer_note_end(viewer);
        }

        /* Messages of clients first, then their output */
        viewer->now_ns = clock_now(clock);
        for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
            viewer_serve_client(viewer, &viewer->client[i], fd[POLL_FIXED + 2 * i].revents,
                                fd[POLL_FIXED + 2 * i + 1].revents);
        }
        viewer_hear_buses(viewer);
        viewer_take_rows(viewer);
        viewer_update_wish(viewer);
        viewer_send_states(viewer);

        /* Remove finished and slow clients, so that new clients find a place */
        for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
            client_check(viewer, &viewer->client[i]);
        }
        if (fd[1].revents) {
            viewer_accept_client(viewer);
        }
        viewer_count_staying(viewer);
        viewer_publish_counters(viewer);
    }
    viewer_end_clients(viewer);
    viewer_publish_counters(viewer);
    return NULL;
}

/* ---- start ---- */

/* Copies a given token. If `given` is NULL, makes a random token of hexadecimal digits. Returns
 * false if the system has no random numbers. */
static bool viewer_set_token(char token[VIEWER_TOKEN], const char *given)
{
    uint8_t random[(VIEWER_TOKEN - 1) / 2];

    if (given) {
        snprintf(token, VIEWER_TOKEN, "%s", given);
        return true;
    }
    if (getrandom(random, sizeof random, 0) != sizeof random) {
        return false;
    }
    for (size_t i = 0; i < sizeof random; i++) {
        snprintf(token + 2 * i, 3, "%02x", random[i]);
    }
    return true;
}

/* Formats the page's addresses, with the loopback address if the server listens on all. */
static void viewer_make_addresses(struct viewer *viewer)
{
    const char *host = viewer->bound.host;
    bool six = strchr(host, ':');

    if (viewer->bound.any) {
        host = six ? "::1" : "127.0.0.1";
    }
    for (int right = 0; right < 2; right++) {
        if (right == 0 || viewer->config.control) {
            snprintf(viewer->address[right], sizeof viewer->address[right],
                     "http://%s%s%s:%u/#token=%s", six ? "[" : "", host, six ? "]" : "",
                     viewer->bound.port, viewer->token[right]);
        }
    }
}

/* Allocates the server and the buffers of its clients. */
static enum error_code viewer_allocate(const struct viewer_config *config, struct arena *arena,
                                       struct viewer **out, struct error *error)
{
    struct viewer *viewer = arena_alloc(arena, 1, sizeof *viewer);

    if (!viewer) {
        return error_set(error, ERROR_MEMORY, "page: no memory");
    }
    viewer->config = *config;
    /* Rig and signals come from the recording or from the simulator */
    if (config->recording) {
        viewer->rig = config->rig;
        viewer->signal = config->recording->signals.title;
        viewer->nsignal = config->recording->signals.ncolumn;
    } else {
        viewer->rig = simulator_configuration(config->simulator)->rig;
        viewer->signal = simulator_parts(config->simulator).signal;
        viewer->nsignal = simulator_parts(config->simulator).nsignal;
    }
    viewer->listener = viewer->event = -1;
    viewer->histogram = arena_alloc(arena, 1, sizeof *viewer->histogram);
    viewer->mesh = arena_alloc(arena, VIEWER_MESHES, sizeof *viewer->mesh);
    viewer->visual = arena_alloc(arena, ROBOT_VISUALS_MAX, sizeof *viewer->visual);
    if (!viewer->histogram || !viewer->mesh || !viewer->visual) {
        return error_set(error, ERROR_MEMORY, "page: no memory");
    }

    /* Mark all places as unused, and allocate their buffers */
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        struct viewer_client *client = &viewer->client[i];

        *client = (struct viewer_client){
            .socket = -1,
            .control = -1,
            .inbox = arena_alloc(arena, 1, VIEWER_INBOX),
            .message = arena_alloc(arena, 1, VIEWER_INBOX),
            .outbox = arena_alloc(arena, 1, VIEWER_OUTBOX),
            .trace = arena_alloc(arena, 1, VIEWER_TRACE),
            .line = arena_alloc(arena, 1, VIEWER_LINE),
        };
        if (!client->inbox || !client->message || !client->outbox || !client->trace ||
            !client->line) {
            return error_set(error, ERROR_MEMORY, "page: no memory");
        }
    }
    viewer->arena = *arena;
    pthread_mutex_init(&viewer->events_lock, NULL);
    *out = viewer;
    return ERROR_NONE;
}

/* Allocates all parts, then opens the socket, then starts the thread. */
static enum error_code viewer_open(struct viewer *viewer, struct error *error)
{
    enum error_code code;
    json_t *hello;
    int reason;

    if (!viewer_set_token(viewer->token[0], viewer->config.token[0]) ||
        !viewer_set_token(viewer->token[1], viewer->config.token[1]) ||
        !viewer_set_token(viewer->run, NULL)) {
        return error_set_errno(error, errno, "page: no random numbers for its tokens");
    }
    if ((code = viewer_create_state(viewer, error)) ||
        (code = viewer_create_history(viewer, error))) {
        return code;
    }
    hello = viewer_hello(viewer);
    viewer->hello = hello ? json_dumps(hello, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
    json_decref(hello);
    if (!viewer->hello) {
        return error_set(error, ERROR_MEMORY, "page: no memory for the description of the rig");
    }
    viewer->hello_size = strlen(viewer->hello);

    /* Open the listening socket, and store the bound address */
    const char *host = viewer->config.host ? viewer->config.host : "127.0.0.1";
    struct http_bound *bound = &viewer->bound;
    struct sockaddr_storage address;
    const struct in6_addr *v6 = &((const struct sockaddr_in6 *)&address)->sin6_addr;

    code = listen_at("page", host, viewer->config.port, &viewer->listener, &address, error);
    if (code) {
        return code;
    }
    snprintf(bound->host, sizeof bound->host, "%s", host);
    bound->port = listen_port(&address);
    if (address.ss_family == AF_INET) {
        const in_addr_t v4 = ntohl(((const struct sockaddr_in *)&address)->sin_addr.s_addr);

        bound->loopback = v4 >> 24 == IN_LOOPBACKNET;
        bound->any = v4 == INADDR_ANY;
    } else {
        bound->loopback = IN6_IS_ADDR_LOOPBACK(v6);
        bound->any = IN6_IS_ADDR_UNSPECIFIED(v6);
    }
    viewer_make_addresses(viewer);
    viewer->event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (viewer->event < 0) {
        return error_set_errno(error, errno, "page: cannot create an event descriptor");
    }
    reason = pthread_create(&viewer->thread, NULL, viewer_thread_main, viewer);
    return reason ? error_set_errno(error, reason, "page: cannot start its thread") : ERROR_NONE;
}

enum error_code viewer_start(const struct viewer_config *config, struct viewer **out,
                             struct error *error)
{
    struct arena arena;
    struct viewer *viewer = NULL;
    enum error_code code = arena_init(&arena, MEMORY, error);

    if (code) {
        return code;
    }
    code = viewer_allocate(config, &arena, &viewer, error);
    if (code) {
        arena_fini(&arena);
        return code;
    }
    code = viewer_open(viewer, error);
    if (code && viewer->event >= 0) {
        close(viewer->event);
    }
    if (code) {
        viewer_destroy(viewer);
        return code;
    }
    *out = viewer;
    return ERROR_NONE;
}

/* ---- control of the thread ---- */

void viewer_give_order(struct viewer *viewer, enum viewer_order order)
{
    const uint64_t one = 1;

    atomic_store(&viewer->order, (int)order);
    /* The write cannot fail, because the counter is small */
    (void)!write(viewer->event, &one, sizeof one);
}

void viewer_serve(struct viewer *viewer)
{
    if (viewer) {
        viewer_give_order(viewer, VIEWER_ORDER_SERVE);
    }
}

const char *viewer_token(const struct viewer *viewer, bool control)
{
    return viewer->token[control];
}

uint16_t viewer_port(const struct viewer *viewer)
{
    return viewer->bound.port;
}

const char *viewer_address(const struct viewer *viewer, bool control)
{
    return viewer->address[control];
}

void viewer_put_event(struct viewer *viewer, enum journal_priority priority, const char *text)
{
    pthread_mutex_lock(&viewer->events_lock);
    struct viewer_event *event = &viewer->events[viewer->nevent++ % VIEWER_EVENTS];

    event->priority = priority;
    snprintf(event->text, sizeof event->text, "%s", text);
    pthread_mutex_unlock(&viewer->events_lock);
}

void viewer_stop(struct viewer *viewer)
{
    if (viewer) {
        viewer_give_order(viewer, VIEWER_ORDER_STOP);
        pthread_join(viewer->thread, NULL);
        close(viewer->event);
    }
}

void viewer_counters(struct viewer *viewer, struct viewer_counters *counters)
{
    pthread_mutex_lock(&viewer->events_lock);
    *counters = viewer->told;
    pthread_mutex_unlock(&viewer->events_lock);
}

void viewer_destroy(struct viewer *viewer)
{
    struct arena arena;

    if (!viewer) {
        return;
    }
    if (viewer->listener >= 0) {
        close(viewer->listener);
    }
    for (size_t i = 0; i < VIEWER_MESHES && viewer->mesh; i++) {
        free((void *)(uintptr_t)viewer->mesh[i].data);
    }
    for (size_t i = 0; i < ROBOT_VISUALS_MAX && viewer->visual; i++) {
        free((void *)(uintptr_t)viewer->visual[i].data);
    }
    for (size_t i = 0; i < VIEWER_FILES; i++) {
        recorded_file_close(&viewer->file[i]);
    }
    free(viewer->end);
    free(viewer->hello);
    free(viewer->database);
    pthread_mutex_destroy(&viewer->events_lock);
    arena = viewer->arena;
    arena_fini(&arena);
}
