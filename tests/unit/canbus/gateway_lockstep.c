/* SPDX-License-Identifier: Apache-2.0 */
/* The gateway in lockstep: clients on real sockets of the loopback interface, local buses, and a
 * machine on the other side that runs STEPs as the loop does. */
#include "canbus/gateway.h"
#include "canbus/lockstep.h"
#include "tests/test.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { BUSES = 5, STEP_BUS = 2, PATIENCE_MS = 20000 };
enum { COMMAND_ID = 0x101, TELEMETRY_ID = 0x201, STALL = 0xee };

static const char *const bus_name[BUSES] = {"torso", "left_leg", "right_leg", "left_arm",
                                            "right_arm"};

struct fixture {
    struct arena arena;
    struct local_bus *bus[BUSES];
    struct can_port *machine[BUSES], *guest[BUSES];
    struct gateway *gateway;
    pthread_t thread;
    atomic_bool stop;
    size_t flood;  /* telemetry on each bus, each STEP */
    int dawdle_us; /* from the STEP to the reading of the other buses */
    uint64_t hash; /* of all commands, by bus and STEP */
    uint32_t tick;
};

/* ---- the machine ---- */

static void machine_take(struct fixture *f, size_t bus, const struct bus_frame *frame)
{
    const uint64_t what = (uint64_t)frame->data[0] << 24 | (uint64_t)bus << 16 | f->tick;

    f->hash = (f->hash ^ what) * UINT64_C(0x100000001b3);
}

static void machine_send_done(struct fixture *f, size_t bus)
{
    uint8_t data[LOCKSTEP_LENGTH] = {0};
    struct bus_frame frame;

    put_u32_le(data, f->tick);
    frame = frame_make(LOCKSTEP_DONE_ID, LOCKSTEP_LENGTH, data);
    frame.time_ns = INT64_C(1000000) * f->tick;
    can_send(f->machine[bus], &frame, 1);
}

/* What the loop does: the other buses are read once, when the STEP has come. */
static void machine_step(struct fixture *f)
{
    struct bus_frame frame;

    usleep((useconds_t)f->dawdle_us);
    for (size_t b = 0; b < BUSES; b++) {
        while (b != STEP_BUS && can_receive(f->machine[b], &frame, 1)) {
            machine_take(f, b, &frame);
        }
    }
    f->tick++;
    for (size_t b = 0; b < BUSES; b++) {
        frame = frame_make(TELEMETRY_ID, 8, (const uint8_t[8]){(uint8_t)b});
        for (size_t i = 0; i < f->flood; i++) {
            can_send(f->machine[b], &frame, 1);
        }
    }
    for (size_t b = 0; b < BUSES; b++) {
        if (b != STEP_BUS) {
            machine_send_done(f, b);
        }
    }
    machine_send_done(f, STEP_BUS);
}

static void *machine_main(void *context)
{
    struct fixture *f = context;
    struct can_port *port = f->machine[STEP_BUS];
    struct bus_frame frame;

    while (!atomic_load(&f->stop)) {
        struct pollfd fd = {.fd = port->ops->descriptor(port), .events = POLLIN};

        poll(&fd, 1, 20);
        while (can_receive(port, &frame, 1)) {
            if (frame.id == LOCKSTEP_STEP_ID) {
                machine_step(f);
            } else {
                machine_take(f, STEP_BUS, &frame);
            }
        }
    }
    return NULL;
}

/* A send that keeps the gateway's thread busy for a while when it is asked to */
static struct can_port_ops stalling;
static size_t (*send_at_once)(struct can_port *port, const struct bus_frame *frames, size_t count);

static size_t stall_and_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    if (frames[0].data[0] == STALL) {
        usleep(5000);
    }
    return send_at_once(port, frames, count);
}

static inline void start(struct fixture *f)
{
    struct gateway_bus bus[BUSES];
    struct gateway_config config = {
        .nbus = BUSES,
        .bus = bus,
        .lockstep = {true, STEP_BUS, LOCKSTEP_STEP_ID, LOCKSTEP_DONE_ID},
    };

    if (arena_init(&f->arena, (size_t)128 << 20, NULL)) {
        fail();
    }
    for (size_t b = 0; b < BUSES; b++) {
        const struct local_bus_config of = {.name = bus_name[b], .max_nodes = 2, .inbox = 4096};

        if (local_bus_create(&of, &f->arena, &f->bus[b], NULL) ||
            local_bus_join(f->bus[b], 1, NULL, 0, &f->machine[b], NULL) ||
            local_bus_join(f->bus[b], 1, NULL, 0, &f->guest[b], NULL)) {
            fail();
        }
        stalling = *f->guest[b]->ops;
        bus[b] = (struct gateway_bus){.name = bus_name[b], .port = f->guest[b]};
    }
    send_at_once = stalling.send;
    stalling.send = stall_and_send;
    f->guest[0]->ops = &stalling;
    assert_false(gateway_start(&config, &f->arena, &f->gateway, NULL) ||
                 pthread_create(&f->thread, NULL, machine_main, f));
}

static inline void stop(struct fixture *f)
{
    gateway_stop(f->gateway);
    atomic_store(&f->stop, true);
    pthread_join(f->thread, NULL);
    for (size_t b = 0; b < BUSES; b++) {
        local_bus_destroy(f->bus[b]);
    }
    arena_fini(&f->arena);
}

/* ---- a client, as a program that does not know of Nagle's algorithm ---- */

struct client {
    int socket;
    size_t have, frames, dones; /* dones: DONE frames among the frames */
    char last[64];              /* the last frame */
    char text[8192];
};

static void say(const struct client *client, const char *text)
{
    assert_int_equal(send(client->socket, text, strlen(text), MSG_NOSIGNAL), strlen(text));
}

/* Receives once, counts what is complete; false when the connection has ended. */
static bool client_listen(struct client *client)
{
    struct pollfd fd = {.fd = client->socket, .events = POLLIN};
    char *end, *at = client->text;
    ssize_t count;

    if (poll(&fd, 1, PATIENCE_MS) != 1) {
        fail_msg("nothing more came; the last was \"%s\"", client->last);
    }
    count = recv(client->socket, client->text + client->have,
                 sizeof client->text - 1 - client->have, 0);
    if (count <= 0) {
        return false;
    }
    client->have += (size_t)count;
    client->text[client->have] = '\0';
    while ((end = strchr(at, '>'))) {
        snprintf(client->last, sizeof client->last, "%.*s", (int)(end + 1 - at), at);
        client->frames += strstr(client->last, "< frame ") != NULL;
        client->dones += strstr(client->last, "< frame 6FF ") != NULL;
        at = end + 1;
    }
    client->have -= (size_t)(at - client->text);
    memmove(client->text, at, client->have + 1);
    return true;
}

static void client_await(struct client *client, const char *answer)
{
    do {
        assert_true(client_listen(client));
    } while (!strstr(client->last, answer));
}

static void client_join(const struct fixture *f, const char *bus, int buffer, struct client *client)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons(gateway_port(f->gateway)),
                                  .sin_addr = {htonl(INADDR_LOOPBACK)}};
    char text[64];

    memset(client, 0, sizeof *client);
    client->socket = socket(AF_INET, SOCK_STREAM, 0);
    if (buffer) {
        setsockopt(client->socket, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
    }
    assert_int_equal(connect(client->socket, (const struct sockaddr *)&address, sizeof address), 0);
    client_await(client, "< hi >");
    snprintf(text, sizeof text, "< open %s >", bus);
    say(client, text);
    client_await(client, "< ok >");
    say(client, "< rawmode >");
    client_await(client, "< ok >");
}

static void client_command(const struct client *client, unsigned value, const char *bus)
{
    char text[64];

    snprintf(text, sizeof text, "< send %X 1 %x %s >", COMMAND_ID, value, bus);
    say(client, text);
}

static void client_step(const struct client *client, const char *bus)
{
    char text[64];

    snprintf(text, sizeof text, "< send %X 6 0 0 0 0 1 0 %s >", LOCKSTEP_STEP_ID, bus);
    say(client, text);
}

static void await_done(struct client *client, size_t dones)
{
    while (client->dones < dones) {
        assert_true(client_listen(client));
    }
}

static int64_t now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ---- the promises ---- */

BENCH(start, struct fixture, stop)

/* While the gateway is busy, twice a command on each of five connections, of which Nagle's
 * algorithm keeps the second back, then STEP: all of them take part in it, each time. */
TEST_ON(every_command_before_a_step_takes_part_in_it, start, f)
{
    enum { REPEATS = 100, STEPS = 5 };
    struct client client[BUSES];
    uint64_t first = 0;
    size_t dones = 0;

    for (size_t b = 0; b < BUSES; b++) {
        client_join(f, bus_name[b], 0, &client[b]);
    }
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        f->hash = 0;
        f->tick = 0;
        for (unsigned step = 0; step < STEPS; step++) {
            client_command(&client[0], STALL, "");
            for (size_t b = 0; b < 2 * BUSES; b++) {
                client_command(&client[b % BUSES], step, "");
            }
            client_step(&client[STEP_BUS], "");
            await_done(&client[STEP_BUS], ++dones);
        }
        first = repeat ? first : f->hash;
        assert_int_equal(f->hash, first);
    }
    for (size_t b = 0; b < BUSES; b++) {
        close(client[b].socket);
    }
}

/* One connection gives the same, and hears one DONE a STEP, after all that came with it. */
TEST_ON(one_connection_has_an_order, start, f)
{
    enum { STEPS = 100, FLOOD = 7 };
    struct client client;

    f->flood = FLOOD;
    client_join(f, "all", 0, &client);
    for (size_t step = 1; step <= STEPS; step++) {
        for (size_t b = 0; b < 2 * BUSES; b++) {
            client_command(&client, (unsigned)step, bus_name[b % BUSES]);
        }
        client_step(&client, "right_leg");
        await_done(&client, step);
        assert_int_equal(client.frames, step * (FLOOD * BUSES + 1));
        assert_non_null(strstr(client.last, "right_leg"));
    }
    close(client.socket);
}

/* A STEP and what follows it in one breath: what follows belongs to the next, on every bus. */
TEST_ON(nothing_overtakes_a_step_that_runs, start, f)
{
    enum { STEPS = 10 };
    struct client client;
    uint64_t one_by_one = 0;

    f->dawdle_us = 60000;
    client_join(f, "all", 0, &client);
    for (int together = 0; together < 2; together++) {
        f->hash = 0;
        f->tick = 0;
        client.dones = 0;
        for (unsigned step = 0; step < STEPS; step++) {
            client_step(&client, "right_leg");
            if (!together) {
                await_done(&client, step + 1);
            }
            client_command(&client, step, "torso");
            client_command(&client, step, "left_arm");
        }
        client_step(&client, "right_leg");
        await_done(&client, STEPS + 1);
        assert_int_equal(f->tick, STEPS + 1);
        one_by_one = together ? one_by_one : f->hash;
    }
    assert_int_equal(f->hash, one_by_one);
    close(client.socket);
}

static void counters_at_the_end(struct fixture *f, struct gateway_counters *counters)
{
    gateway_stop(f->gateway);
    gateway_counters(f->gateway, counters);
    f->gateway = NULL;
}

/* Reads what there is, but not much. */
static void client_read_a_little(struct client *client, size_t frames)
{
    struct pollfd fd = {.fd = client->socket, .events = POLLIN};
    const size_t enough = client->frames + frames;

    while (client->frames < enough && poll(&fd, 1, 20) == 1) {
        assert_true(client_listen(client));
    }
}

/* The STEPs wait for who reads slowly, only when it has to, so that it loses nothing. */
TEST_ON(a_step_waits_for_a_slow_client, start, f)
{
    enum { STEPS = 200, FLOOD = 1000 };
    struct gateway_counters counters;
    struct client client, slow;

    f->flood = FLOOD;
    client_join(f, "right_leg", 0, &client);
    client_join(f, "left_leg", 4096, &slow);
    for (size_t step = 1; step <= STEPS; step++) {
        struct pollfd fd = {.fd = client.socket, .events = POLLIN};

        client_step(&client, "");
        while (client.dones < step) {
            if (poll(&fd, 1, 50) == 1) {
                assert_true(client_listen(&client));
            } else {
                client_read_a_little(&slow, 4 * (size_t)FLOOD);
            }
        }
    }
    while (slow.frames < STEPS * (FLOOD + 1)) {
        assert_true(client_listen(&slow));
    }
    counters_at_the_end(f, &counters);
    assert_int_equal(counters.cut_slow, 0);
    close(client.socket);
    close(slow.socket);
}

/* Who does not read at all holds a STEP up once, then it is disconnected. */
TEST_ON(a_step_does_not_wait_for_ever, start, f)
{
    enum { STEPS = 200, FLOOD = 1000 };
    struct gateway_counters counters;
    struct client client, slow;

    f->flood = FLOOD;
    client_join(f, "right_leg", 0, &client);
    client_join(f, "left_leg", 4096, &slow);
    for (size_t step = 1; step <= STEPS; step++) {
        client_step(&client, "");
        await_done(&client, step);
    }
    counters_at_the_end(f, &counters);
    assert_int_equal(counters.cut_slow, 1);
    close(client.socket);
    close(slow.socket);
}

/* One wake-up for the STEP and one for its DONE; others only by time. */
TEST_ON(a_step_costs_two_wakeups, start, f)
{
    enum { STEPS = 1000, RESERVE = 100 };
    struct gateway_counters counters;
    struct client client;
    int64_t begin_ms;

    f->flood = 1;
    client_join(f, "all", 0, &client);
    begin_ms = now_ms();
    for (size_t step = 1; step <= STEPS; step++) {
        client_step(&client, "right_leg");
        await_done(&client, step);
    }
    counters_at_the_end(f, &counters);
    /* The telemetry of the STEP's bus may wake it before its DONE does */
    assert_in_range(counters.wakeups, STEPS, 3 * STEPS + RESERVE + (uint64_t)(now_ms() - begin_ms));
    close(client.socket);
}

/* A command and a STEP by a client that waits for acknowledgements: a delayed one takes 40 ms. */
TEST_ON(every_command_is_acknowledged_at_once, start, f)
{
    enum { STEPS = 100, DELAYED_MS = 35 };
    struct client client;
    int delayed = 0;

    client_join(f, "all", 0, &client);
    for (size_t step = 1; step <= STEPS; step++) {
        int64_t begin_ms = now_ms();

        client_command(&client, 1, "left_arm");
        client_step(&client, "right_leg");
        await_done(&client, step);
        delayed += now_ms() - begin_ms >= DELAYED_MS;
    }
    assert_in_range(delayed, 0, STEPS / 2);
    close(client.socket);
}

/* A STEP whose DONE never comes does not lock the client out. */
TEST_ON(a_lost_step_may_be_sent_again, start, f)
{
    struct client client;

    atomic_store(&f->stop, true);
    pthread_join(f->thread, NULL);
    client_join(f, "all", 0, &client);
    client_step(&client, "right_leg");
    say(&client, "< echo >");
    client_await(&client, "< echo >");
    atomic_store(&f->stop, false);
    assert_int_equal(pthread_create(&f->thread, NULL, machine_main, f), 0);
    client_step(&client, "right_leg");
    await_done(&client, 2);
    close(client.socket);
}
