/* SPDX-License-Identifier: Apache-2.0 */
/* The server's thread. One poll waits for orders, connections and clients. */
#include "control/private.h"

#include <errno.h>
#include <sys/eventfd.h>

enum {
    EVENTS = 64,    /* capacity for log lines, a power of two */
    IDLE_MS = 1000, /* interval of checks for slow clients, ms */
    BUSY_MS = 1,    /* interval of checks for answers of the loop, ms */
    ROWS_MS = 5,    /* interval of checks for new rows, ms */
    ACCEPT_PAUSE_MS =
        100, /* delay before accepting again after the system refused a connection, ms */
};

/* Default timeout of a slow or silent client, ns. */
#define PATIENCE_NS (30 * CLOCK_SECOND)
#define MEMORY ((size_t)16 << 20) /* size of the server's arena in address space, bytes */

/* ---- the thread ---- */

enum { POLL_FIXED = 2, POLL_COUNT = POLL_FIXED + CONTROL_PLACES };

/* Fills in the descriptors to poll and the longest time to wait, ms. */
static void control_prepare_poll(const struct control *control, bool accepts,
                                 struct pollfd fd[POLL_COUNT], int *timeout_ms)
{
    *timeout_ms = accepts ? IDLE_MS : ACCEPT_PAUSE_MS;
    fd[0] = (struct pollfd){.fd = control->event, .events = POLLIN};
    fd[1] = (struct pollfd){.fd = accepts ? control->socket.descriptor : -1, .events = POLLIN};
    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        const struct control_client *client = &control->client[i];
        bool reads = control_may_read(client) && !client->ended && client->received < CONTROL_LINE;
        bool writes = client->socket >= 0 && client->filled > client->sent;

        fd[POLL_FIXED + i] = (struct pollfd){
            .fd = client->socket, .events = (short)((reads ? POLLIN : 0) | (writes ? POLLOUT : 0))};
        if (client->socket >= 0 && client->subscription.count > 0 && *timeout_ms > ROWS_MS) {
            *timeout_ms = ROWS_MS;
        }
        if (client->socket >= 0 && client->waiting != WAITING_NOT) {
            *timeout_ms = BUSY_MS;
        }
    }
}

/* Handles the poll events of a client. Returns true if further lines wait for the next turn. */
static bool control_serve_client(struct control *control, struct control_client *client,
                                 short events)
{
    if (client->socket < 0) {
        return false;
    }
    if ((events & (POLLHUP | POLLERR)) && (client->ended || !control_may_read(client))) {
        /* The connection is closed in both directions, so no answer can arrive */
        control_drop(control, client);
        return false;
    }
    if (events & POLLOUT) {
        control_flush(control, client);
    }
    return (events & ~POLLOUT) && control_may_read(client) &&
           control_read_requests(control, client);
}

/* Runs the thread: waits for an order, then serves the clients until the order to stop. */
static void *control_thread_main(void *context)
{
    struct control *control = context;
    struct clock *clock = clock_monotonic();
    struct pollfd order = {.fd = control->event, .events = POLLIN};
    int64_t accept_ns = 0;
    uint64_t orders;
    bool more = false;

    /* Wait for the order to serve or to stop */
    while (atomic_load(&control->order) == CONTROL_ORDER_WAIT) {
        poll(&order, 1, -1);
    }
    (void)!read(control->event, &orders, sizeof orders);
    while (atomic_load(&control->order) != CONTROL_ORDER_STOP) {
        struct pollfd fd[POLL_COUNT];
        int timeout_ms;

        control_prepare_poll(control, control->now_ns >= accept_ns, fd, &timeout_ms);
        if (poll(fd, POLL_COUNT, more ? 0 : timeout_ms) < 0) {
            memset(fd, 0, sizeof fd); /* interrupted, or out of memory: poll again */
        }

        /* Pass on the answers of the loop first, so that answers keep their order. Then serve new
         * lines and rows */
        control->now_ns = clock_now(clock);
        more = control_pump(control);
        for (size_t i = 0; i < CONTROL_PLACES; i++) {
            more = control_serve_client(control, &control->client[i], fd[POLL_FIXED + i].revents) ||
                   more;
        }
        more = control_rows(control) || more;

        /* Drop finished and slow clients to make room for new ones */
        for (size_t i = 0; i < CONTROL_PLACES; i++) {
            control_check(control, &control->client[i]);
        }
        if (fd[1].revents && !control_accept(control)) {
            accept_ns = control->now_ns + ACCEPT_PAUSE_MS * CLOCK_MS;
        }
    }
    control_end(control);
    return NULL;
}

/* ---- start and stop ---- */

/* Allocates the server and its clients' buffers in the server's own arena. */
static enum error_code control_allocate(const struct control_config *config, struct arena *arena,
                                        struct control **out, struct error *error)
{
    struct control *control = arena_alloc(arena, 1, sizeof *control);
    size_t nsignal = simulator_parts(config->simulator).nsignal;
    char *inbox = arena_alloc(arena, CONTROL_PLACES, CONTROL_LINE);
    char *outbox = arena_alloc(arena, CONTROL_PLACES, CONTROL_OUTBOX);
    uint16_t *signal = arena_alloc(arena, CONTROL_PLACES, (nsignal + 1) * sizeof *signal);
    void *events = arena_alloc(arena, EVENTS, sizeof(struct control_event));

    if (!control || !inbox || !outbox || !signal || !events) {
        return error_set(error, ERROR_MEMORY, "control socket: no memory");
    }
    control->config = *config;
    control->arena = *arena;
    control->rig = simulator_configuration(config->simulator)->rig;
    control->socket.descriptor = control->event = -1;
    control->patience_ns = config->patience_ns ? config->patience_ns : PATIENCE_NS;
    ring_init(&control->events, events, sizeof(struct control_event), EVENTS);
    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        struct control_client *client = &control->client[i];

        client->socket = -1;
        client->inbox = inbox + i * (size_t)CONTROL_LINE;
        client->outbox = outbox + i * (size_t)CONTROL_OUTBOX;
        client->subscription.signal = signal + i * (nsignal + 1);
    }
    *out = control;
    return ERROR_NONE;
}

enum error_code control_start(const struct control_config *config, struct control **out,
                              struct error *error)
{
    struct arena arena;
    struct control *control = NULL;
    enum error_code code = arena_init(&arena, MEMORY, error);
    int reason;

    if (code) {
        return code;
    }
    /* Allocate the memory, open the socket, then start the thread */
    code = control_allocate(config, &arena, &control, error);
    if (code) {
        goto fail_allocate;
    }
    code = config->path ? control_socket_open(config->path, &control->socket, error)
                        : control_socket_open_default(config->name, &control->socket, error);
    if (code) {
        goto fail_allocate;
    }
    control->event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (control->event < 0) {
        code = error_set_errno(error, errno, "control socket: cannot create an event descriptor");
        goto fail_event;
    }
    reason = pthread_create(&control->thread, NULL, control_thread_main, control);
    if (reason) {
        code = error_set_errno(error, reason, "control socket: cannot start its thread");
        goto fail_thread;
    }
    *out = control;
    return ERROR_NONE;

fail_thread:
    close(control->event);
fail_event:
    control_socket_close(&control->socket);
fail_allocate:
    arena_fini(&arena);
    return code;
}

/* Gives the thread an order and wakes the thread. */
static void give_order(struct control *control, enum control_order order)
{
    const uint64_t one = 1;

    atomic_store(&control->order, (int)order);
    /* Cannot fail, because the counter of the eventfd is far from its limit */
    (void)!write(control->event, &one, sizeof one);
}

void control_serve(struct control *control)
{
    if (control) {
        give_order(control, CONTROL_ORDER_SERVE);
    }
}

const char *control_path(const struct control *control)
{
    return control->socket.path;
}

bool control_next_event(struct control *control, uint64_t *key, char *text, size_t size)
{
    struct control_event event;

    if (!ring_pop(&control->events, &event)) {
        return false;
    }
    /* The upper half makes the key different from the keys of simulator_next_event */
    *key = UINT64_C(6) << 32 | event.key;
    snprintf(text, size, "%s", event.text);
    return true;
}

bool control_has_stopped(const struct control *control)
{
    return control && atomic_load(&control->stopped);
}

void control_stop(struct control *control)
{
    if (control) {
        give_order(control, CONTROL_ORDER_STOP);
        pthread_join(control->thread, NULL);
        close(control->event);
        control_socket_close(&control->socket);
    }
}

void control_counters(const struct control *control, struct control_counters *counters)
{
    *counters = control->counters;
}

void control_destroy(struct control *control)
{
    if (control) {
        struct arena arena = control->arena;

        arena_fini(&arena);
    }
}
