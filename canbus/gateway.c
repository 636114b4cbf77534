/* SPDX-License-Identifier: Apache-2.0 */
/* The gateway's thread, which waits in one poll on the listening sockets, the stop event,
 * clients and ports. */
#include "canbus/gateway_private.h"

#include "base/listen.h"

#include <poll.h>
#include <sys/eventfd.h>

enum {
    BATCH = 64,
    TURNS = 256,
    IDLE_MS = 1000,
    POLL_MS = 1,
    LOOK_MS = 20, /* interval at which the ports are emptied when no client waits for frames */
};

/* ---- what the buses have received ---- */

/* Forwards a received frame to the clients of its bus; a DONE ends the STEP that is running. */
static void gateway_relay_frame(struct gateway *gateway, size_t bus, const struct bus_frame *from)
{
    struct bus_frame frame = *from;

    /* A frame without a time stamp gets the newest one of its bus */
    if (frame.time_ns == 0) {
        frame.time_ns = gateway->time_ns[bus];
    }
    gateway->time_ns[bus] = frame.time_ns;
    if (bus == gateway->config.lockstep.bus && gateway_is_done(gateway, &frame)) {
        gateway->step_until_ms = 0;
        atomic_fetch_add(&gateway->done_count, 1);
    }
    gateway_forward_frame(gateway, bus, &frame, NULL);
}

/* Forwards the received frames of a bus to its clients, at most TURNS batches, so that a busy bus
 * does not delay the others. */
static void gateway_forward_bus(struct gateway *gateway, size_t bus)
{
    struct can_port *port = gateway->config.bus[bus].port;
    struct bus_frame frame[BATCH];
    size_t count = BATCH;

    for (int turn = 0; turn < TURNS && count == BATCH; turn++) {
        count = can_receive(port, frame, BATCH);
        for (size_t i = 0; i < count; i++) {
            gateway_relay_frame(gateway, bus, &frame[i]);
        }
    }
}

/* Forwards the frames of all buses. In lockstep, receives the STEP's bus first and forwards it
 * last: its DONE is the last frame of a STEP, so all other frames have arrived by then. */
static void gateway_forward_buses(struct gateway *gateway)
{
    const struct gateway_lockstep *lockstep = &gateway->config.lockstep;
    struct bus_frame last[BATCH];
    size_t count = BATCH;

    for (int turn = 0; turn < TURNS && count == BATCH; turn++) {
        count =
            lockstep->on ? can_receive(gateway->config.bus[lockstep->bus].port, last, BATCH) : 0;
        for (size_t b = 0; b < gateway->config.nbus; b++) {
            if (!lockstep->on || b != lockstep->bus) {
                gateway_forward_bus(gateway, b);
            }
        }
        for (size_t i = 0; i < count; i++) {
            gateway_relay_frame(gateway, lockstep->bus, &last[i]);
        }
    }
}

/* ---- the thread ---- */

enum { POLL_FIXED = 2 + GATEWAY_SLCAN, POLL_MAX = POLL_FIXED + GATEWAY_CLIENTS + GATEWAY_BUSES };

/* Returns the poll events of a client, and lowers the timeout if necessary. A client with a waiting
 * STEP is not read. A client that has just received "ok" gets no frames yet. */
static short gateway_client_events(const struct gateway *gateway,
                                   const struct gateway_client *client, int *timeout_ms)
{
    const bool held = client->step_waits || gateway_step_runs(gateway);
    bool quiet = client->waiting > 0 && gateway_now_ms() < client->quiet_until_ms;
    int most_ms = quiet ? POLL_MS : held || client->received ? LOOK_MS : IDLE_MS;

    if (client->socket < 0) {
        return 0;
    }
    *timeout_ms = most_ms < *timeout_ms ? most_ms : *timeout_ms;
    return (short)((held ? 0 : POLLIN) | (client->waiting && !quiet ? POLLOUT : 0));
}

/* Fills in the descriptors and the timeout of poll: listeners, clients, then ports. */
static size_t gateway_prepare_poll(struct gateway *gateway, struct pollfd fd[POLL_MAX],
                                   int *timeout_ms)
{
    const struct gateway_lockstep *lockstep = &gateway->config.lockstep;
    size_t count = POLL_FIXED;
    bool look = false, heard = false; /* heard: some client receives the frames of a bus */

    *timeout_ms = IDLE_MS;
    fd[0] = (struct pollfd){.fd = gateway->stop_event, .events = POLLIN};
    fd[1] = (struct pollfd){.fd = gateway->listener, .events = POLLIN};
    for (size_t i = 0; i < GATEWAY_SLCAN; i++) {
        fd[2 + i] = (struct pollfd){.fd = gateway->slcan_listener[i], .events = POLLIN};
    }
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        const struct gateway_client *client = &gateway->client[i];

        heard = heard || (client->socket >= 0 && client->mode == CLIENT_RAW);
        fd[count++] = (struct pollfd){.fd = client->socket,
                                      .events = gateway_client_events(gateway, client, timeout_ms)};
    }
    atomic_store_explicit(&gateway->heard, heard, memory_order_relaxed);
    for (size_t b = 0; b < gateway->config.nbus; b++) {
        /* In lockstep, poll only the bus of the DONE. Otherwise, poll the buses only if a client
         * receives their frames. Without a client, the thread empties the ports every LOOK_MS. */
        struct can_port *port = gateway->config.bus[b].port;
        int descriptor =
            (lockstep->on ? b == lockstep->bus : heard) ? port->ops->descriptor(port) : -1;

        fd[count++] = (struct pollfd){.fd = descriptor, .events = POLLIN};
        look = look || descriptor < 0;
    }
    if (look) {
        int look_ms = heard && (!lockstep->on || gateway_step_runs(gateway)) ? POLL_MS : LOOK_MS;

        *timeout_ms = look_ms < *timeout_ms ? look_ms : *timeout_ms;
    }
    return count;
}

/* Runs the gateway until the stop event is raised; the thread's main function. */
static void *gateway_run(void *context)
{
    struct gateway *gateway = context;
    struct pollfd fd[POLL_MAX];

    for (;;) {
        int timeout_ms;
        size_t count = gateway_prepare_poll(gateway, fd, &timeout_ms);

        /* Wait for an event; the stop event ends the thread */
        poll(fd, (nfds_t)count, timeout_ms);
        if (fd[0].revents) {
            return NULL;
        }
        /* Release the clients if the DONE of a STEP is overdue */
        gateway->counters.wakeups++;
        if (gateway_step_runs(gateway) && gateway_now_ms() >= gateway->step_until_ms) {
            gateway->step_until_ms = 0;
        }

        /* Forward frames of the buses before accepting clients: new clients get no older frames */
        if (!atomic_load(&gateway->holds)) {
            gateway_forward_buses(gateway);
        }

        /* Execute clients' commands: first commands that waited for a STEP, then new commands, and
         * last a STEP */
        for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
            struct gateway_client *client = &gateway->client[i];

            if (client->socket >= 0 && client->received) {
                gateway_execute_inbox(gateway, client);
            }
            if (client->socket >= 0 && (fd[POLL_FIXED + i].revents & ~POLLOUT)) {
                gateway_read_client(gateway, client);
            }
        }
        gateway_release_step(gateway);

        /* Send the output of clients, except clients that must receive an answer alone. Clients
         * that may receive the DONE of a STEP come last, so that the other clients already have all
         * frames of the STEP. */
        const struct gateway_lockstep *lockstep = &gateway->config.lockstep;

        for (int last = 0; last < 2; last++) {
            for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
                struct gateway_client *client = &gateway->client[i];
                const bool hears_step =
                    client->bus == lockstep->bus || client->bus == GATEWAY_EVERY_BUS;

                if (client->waiting && hears_step == last &&
                    (client->mode != CLIENT_RAW || gateway_now_ms() >= client->quiet_until_ms)) {
                    gateway_flush_client(client);
                }
            }
        }

        /* Accept clients last, because they change the places in the poll set */
        gateway_close_silent(gateway);
        if (fd[1].revents) {
            gateway_accept_clients(gateway, gateway->listener, -1);
        }
        for (int i = 0; i < GATEWAY_SLCAN; i++) {
            if (fd[2 + i].revents) {
                gateway_accept_clients(gateway, gateway->slcan_listener[i], i);
            }
        }
    }
}

/* ---- start and stop ---- */

/* Closes all clients, listeners and the stop event. */
static void gateway_close_all(struct gateway *gateway)
{
    gateway_slcan_stop(gateway);
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        gateway_close_client(&gateway->client[i]);
    }
    if (gateway->listener >= 0) {
        close(gateway->listener);
    }
    if (gateway->stop_event >= 0) {
        close(gateway->stop_event);
    }
}

/* Allocates the gateway and the output buffers of its clients; all descriptors start closed
 * (-1). */
static enum error_code gateway_allocate(const struct gateway_config *config, struct arena *arena,
                                        struct gateway **out, struct error *error)
{
    struct gateway *gateway = arena_alloc(arena, 1, sizeof *gateway);
    struct gateway_bus *bus = arena_alloc(arena, config->nbus, sizeof *bus);
    int64_t *time_ns = arena_alloc(arena, config->nbus, sizeof *time_ns);
    char *outbox = arena_alloc(arena, GATEWAY_CLIENTS, GATEWAY_OUTBOX);

    if (!gateway || !bus || !time_ns || !outbox) {
        return error_set(error, ERROR_MEMORY, "gateway: no memory");
    }
    for (size_t i = 0; i < config->nbus; i++) {
        bus[i] = config->bus[i];
    }
    *gateway =
        (struct gateway){.config = *config, .time_ns = time_ns, .listener = -1, .stop_event = -1};
    gateway->config.bus = bus;
    for (size_t i = 0; i < GATEWAY_SLCAN; i++) {
        gateway->slcan_listener[i] = -1;
    }
    for (size_t i = 0; i < GATEWAY_CLIENTS; i++) {
        gateway->client[i] =
            (struct gateway_client){.socket = -1, .outbox = outbox + i * (size_t)GATEWAY_OUTBOX};
    }
    *out = gateway;
    return ERROR_NONE;
}

/* Checks the number of buses, the bus of the STEP and the names of the buses. */
static enum error_code gateway_check_config(const struct gateway_config *config,
                                            struct error *error)
{
    if (config->nbus > GATEWAY_BUSES) {
        return error_set(error, ERROR_INPUT, "gateway: found %zu buses, expected at most %d",
                         config->nbus, GATEWAY_BUSES);
    }
    if (config->lockstep.on && config->lockstep.bus >= config->nbus) {
        return error_set(error, ERROR_INPUT, "gateway: STEP on bus %zu, but there are %zu",
                         config->lockstep.bus, config->nbus);
    }
    for (size_t i = 0; i < config->nbus; i++) {
        if (strcmp(config->bus[i].name, GATEWAY_ALL) == 0) {
            return error_set(error, ERROR_INPUT,
                             "gateway: found a bus of the name \"" GATEWAY_ALL
                             "\", by which clients open every bus; expected another name");
        }
        if (strlen(config->bus[i].name) > SOCKETCAND_BUS_MAX) {
            return error_set(error, ERROR_INPUT,
                             "gateway: found bus name \"%.64s\", expected at most %d characters",
                             config->bus[i].name, SOCKETCAND_BUS_MAX);
        }
    }
    return ERROR_NONE;
}

enum error_code gateway_start(const struct gateway_config *config, struct arena *arena,
                              struct gateway **out, struct error *error)
{
    struct gateway *gateway = NULL;
    enum error_code code = gateway_check_config(config, error);
    int reason;

    code = code ? code : gateway_allocate(config, arena, &gateway, error);
    if (code) {
        return code;
    }
    if (!config->slcan_only) {
        struct sockaddr_storage bound;

        code = listen_at("gateway", config->host, config->port, &gateway->listener, &bound, error);
        gateway->port = code ? 0 : listen_port(&bound);
    }
    code = code ? code : gateway_slcan_start(gateway, error);
    if (code) {
        goto fail;
    }
    gateway->stop_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (gateway->stop_event < 0) {
        code = error_set_errno(error, errno, "gateway: cannot create an event descriptor");
        goto fail;
    }
    reason = pthread_create(&gateway->thread, NULL, gateway_run, gateway);
    if (reason) {
        code = error_set_errno(error, reason, "gateway: cannot start its thread");
        goto fail;
    }
    *out = gateway;
    return ERROR_NONE;

fail:
    gateway_close_all(gateway);
    return code;
}

uint16_t gateway_port(const struct gateway *gateway)
{
    return gateway->port;
}

void gateway_release_done(struct gateway *gateway)
{
    atomic_store(&gateway->holds, false);
}

uint64_t gateway_done_count(const struct gateway *gateway)
{
    return atomic_load(&gateway->done_count);
}

void gateway_stop(struct gateway *gateway)
{
    uint64_t one = 1;

    if (!gateway) {
        return;
    }
    /* Cannot fail: the counter is zero */
    (void)!write(gateway->stop_event, &one, sizeof one);
    pthread_join(gateway->thread, NULL);
    gateway_close_all(gateway);
}

bool gateway_is_heard(const struct gateway *gateway)
{
    return atomic_load_explicit(&gateway->heard, memory_order_relaxed);
}

void gateway_counters(const struct gateway *gateway, struct gateway_counters *counters)
{
    *counters = gateway->counters;
}
