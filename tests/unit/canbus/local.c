/* SPDX-License-Identifier: Apache-2.0 */
/* The bus in the process: order, filters, overflow, descriptors, and two threads at once. */
#include "canbus/port.h"

#include "base/array.h"
#include "tests/test.h"

#include <linux/can/error.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>

enum { NODES = 4, INBOX = 64 };

struct bench {
    struct arena arena;
    struct local_bus *bus;
    struct can_port *node[NODES];
};

static struct can_port *join(struct local_bus *bus)
{
    struct can_port *port = NULL;
    struct error error;

    assert_ok(local_bus_join(bus, 1, NULL, 0, &port, &error));
    return port;
}

static enum error_code create(const char *name, size_t max_nodes, size_t inbox, bool fd,
                              struct arena *arena, struct local_bus **bus, struct error *error)
{
    const struct local_bus_config config = {
        .name = name, .max_nodes = max_nodes, .inbox = inbox, .fd = fd};

    return local_bus_create(&config, arena, bus, error);
}

static inline void set_up(struct bench *bench)
{
    struct error error;

    assert_ok(arena_init(&bench->arena, 64 << 20, &error));
    assert_ok(create("limb", NODES, INBOX, false, &bench->arena, &bench->bus, &error));
}

static inline void tear_down(struct bench *bench)
{
    local_bus_destroy(bench->bus);
    arena_fini(&bench->arena);
}

static void join_all(struct bench *bench)
{
    for (int i = 0; i < NODES; i++) {
        bench->node[i] = join(bench->bus);
    }
}

static struct bus_frame numbered(uint32_t id, uint32_t number)
{
    uint8_t data[4];

    put_u32_le(data, number);
    return frame_make(id, 4, data);
}

static bool readable(int descriptor)
{
    struct pollfd poll_for = {.fd = descriptor, .events = POLLIN};

    return poll(&poll_for, 1, 0) == 1;
}

BENCH(set_up, struct bench, tear_down)

TEST_ON(gives_a_frame_to_every_other_node_with_all_its_fields, set_up, bench)
{
    struct bus_frame sent = {.id = 0x1ABCDEF0, .flags = FRAME_EXTENDED, .len = 3, .time_ns = 42};
    struct bus_frame got[4];

    join_all(bench);
    memcpy(sent.data, "abc", 3);
    assert_int_equal(can_send(bench->node[1], &sent, 1), 1);
    for (int i = 0; i < NODES; i++) {
        assert_int_equal(can_receive(bench->node[i], got, 4), i == 1 ? 0 : 1);
        if (i != 1) {
            assert_int_equal(got[0].id, sent.id);
            assert_int_equal(got[0].flags, sent.flags);
            assert_int_equal(got[0].len, sent.len);
            assert_int_equal(got[0].time_ns, 42);
            assert_memory_equal(got[0].data, sent.data, sizeof sent.data);
            assert_int_equal(bench->node[i]->counters.rx_frames, 1);
            assert_int_equal(bench->node[i]->counters.rx_bits, 67 + 24);
        }
    }
    assert_int_equal(bench->node[1]->counters.tx_frames, 1);
    assert_int_equal(bench->node[1]->counters.tx_bits, 67 + 24);
    assert_string_equal(bench->node[1]->bus, "limb");
    assert_string_equal(bench->node[1]->ops->name, "local");
    assert_int_equal(bench->node[1]->state, CAN_PORT_UP);
}

/* Three nodes send in an order of their own; the fourth reads in odd portions. */
TEST_ON(keeps_the_order_of_the_bus_over_many_senders, set_up, bench)
{
    struct bus_frame got[INBOX];
    uint32_t sent = 0, seen = 0, random = 12345;

    join_all(bench);
    for (int round = 0; round < 2000; round++) {
        size_t count;

        for (int i = 0; i < 5; i++) {
            struct bus_frame frame;

            random = random * 1664525 + 1013904223;
            frame = numbered(0x100, sent++);
            assert_int_equal(can_send(bench->node[random >> 16 & 1 ? 0 : 2], &frame, 1), 1);
        }
        while ((count = can_receive(bench->node[3], got, 1 + random % 7))) {
            for (size_t i = 0; i < count; i++) {
                assert_int_equal(get_u32_le(got[i].data), seen++);
            }
        }
        while (can_receive(bench->node[0], got, INBOX) + can_receive(bench->node[1], got, INBOX) +
               can_receive(bench->node[2], got, INBOX)) {
        }
    }
    assert_int_equal(seen, sent);
    assert_int_equal(bench->node[3]->counters.rx_dropped, 0);
}

TEST_ON(drops_the_newest_when_an_inbox_is_full_and_counts_them, set_up, bench)
{
    struct bus_frame got[2 * INBOX];

    join_all(bench);
    for (uint32_t i = 0; i < INBOX + 10; i++) {
        struct bus_frame frame = numbered(0x1, i);

        assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
        /* Node 1 reads as it comes, node 2 does not */
        assert_int_equal(can_receive(bench->node[1], got, 1), 1);
    }
    assert_int_equal(can_receive(bench->node[2], got, 2 * INBOX), INBOX);
    for (uint32_t i = 0; i < INBOX; i++) {
        assert_int_equal(get_u32_le(got[i].data), i);
    }
    assert_int_equal(bench->node[2]->counters.rx_dropped, 10);
    assert_int_equal(bench->node[2]->counters.rx_frames, INBOX);
    assert_int_equal(bench->node[1]->counters.rx_dropped, 0);
    assert_int_equal(bench->node[0]->counters.tx_dropped, 0);
    /* The bus goes on afterwards */
    got[0] = numbered(0x1, 99);
    assert_int_equal(can_send(bench->node[0], got, 1), 1);
    assert_int_equal(can_receive(bench->node[2], got, 2), 1);
    assert_int_equal(get_u32_le(got[0].data), 99);
    assert_int_equal(bench->node[2]->counters.rx_dropped, 10);
}

TEST_ON(passes_what_a_filter_matches_and_every_error_frame, set_up, bench)
{
    static const struct {
        uint32_t id;
        uint8_t flags;
        bool passes;
    } cases[] = {
        {0x123, 0, true},
        {0x124, 0, false},
        {0x123, FRAME_REMOTE, true},
        {0x123, FRAME_EXTENDED, false},
        {0x701, 0, true},
        {0x7FF, 0, true},
        {0x6FF, 0, false},
        {0x0ABC0001, FRAME_EXTENDED, true},
        {0x0ABC0101, FRAME_EXTENDED, false},
        {0x1ABC0001, FRAME_EXTENDED, false},
        {CAN_ERR_ACK, FRAME_ERROR, true},
    };
    static const struct frame_filter filter[] = {
        {.id = 0x123, .mask = 0x7FF},
        {.id = 0x7AA, .mask = 0x700},
        {.id = 0x0ABC0000, .mask = 0x1FFFFF00, .extended = true},
    };
    struct can_port *sender = join(bench->bus), *picky;
    struct bus_frame got[2];
    struct error error;

    assert_ok(local_bus_join(bench->bus, 1, filter, 3, &picky, &error));
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct bus_frame frame = {.id = cases[i].id, .flags = cases[i].flags};

        assert_int_equal(can_send(sender, &frame, 1), 1);
        if (can_receive(picky, got, 2) != cases[i].passes) {
            fail_msg("case %zu", i);
        }
    }
    assert_int_equal(picky->counters.error_frames, 1);
    assert_int_equal(picky->counters.rx_dropped, 0);
}

TEST_ON(refuses_invalid_frames_alone_and_counts_them, set_up, bench)
{
    struct bus_frame frames[4] = {
        {.id = 0x123, .len = 8},
        {.id = 0x800, .len = 8},
        {.id = 0x123, .flags = FRAME_FD, .len = 8}, /* the bus is classic */
        {.id = 0x124, .len = 8},
    };
    struct bus_frame got[4];

    join_all(bench);
    assert_int_equal(can_send(bench->node[0], frames, 4), 2);
    assert_int_equal(bench->node[0]->counters.tx_frames, 2);
    assert_int_equal(bench->node[0]->counters.tx_dropped, 2);
    assert_int_equal(can_receive(bench->node[1], got, 4), 2);
    assert_int_equal(got[0].id, 0x123);
    assert_int_equal(got[1].id, 0x124);
}

TEST_ON(carries_fd_frames_on_an_fd_bus, set_up, bench)
{
    struct bus_frame sent = {.id = 0x123, .flags = FRAME_FD | FRAME_BRS, .len = 64}, got[2];
    struct can_port *a, *b;
    struct local_bus *bus;
    struct error error;

    memset(sent.data, 0x5A, sizeof sent.data);
    assert_ok(create("fd", 2, 8, true, &bench->arena, &bus, &error));
    a = join(bus);
    b = join(bus);
    assert_true(a->fd);
    assert_int_equal(can_send(a, &sent, 1), 1);
    assert_int_equal(can_receive(b, got, 2), 1);
    assert_int_equal(got[0].flags, FRAME_FD | FRAME_BRS);
    assert_memory_equal(got[0].data, sent.data, 64);
    local_bus_destroy(bus);
}

TEST_ON(follows_the_controller_states_that_error_frames_report, set_up, bench)
{
    static const struct {
        struct bus_frame frame;
        enum can_port_state state;
    } cases[] = {
        {{.id = CAN_ERR_ACK}, CAN_PORT_UP},
        {{.id = CAN_ERR_CRTL, .data[1] = CAN_ERR_CRTL_TX_WARNING}, CAN_PORT_WARNING},
        {{.id = CAN_ERR_CRTL, .data[1] = CAN_ERR_CRTL_RX_PASSIVE}, CAN_PORT_PASSIVE},
        {{.id = CAN_ERR_CRTL, .data[1] = CAN_ERR_CRTL_RX_OVERFLOW}, CAN_PORT_PASSIVE},
        {{.id = CAN_ERR_BUSOFF}, CAN_PORT_BUS_OFF},
        {{.id = CAN_ERR_RESTARTED}, CAN_PORT_UP},
        {{.id = CAN_ERR_CRTL, .data[1] = CAN_ERR_CRTL_RX_WARNING}, CAN_PORT_WARNING},
        {{.id = CAN_ERR_CRTL, .data[1] = CAN_ERR_CRTL_ACTIVE}, CAN_PORT_UP},
    };
    struct bus_frame frame, got[2];

    join_all(bench);
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        frame = cases[i].frame;
        frame.flags = FRAME_ERROR;
        frame.len = 8;
        assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
        assert_int_equal(can_receive(bench->node[1], got, 2), 1);
        assert_int_equal(bench->node[1]->state, cases[i].state);
    }
    assert_int_equal(bench->node[1]->counters.error_frames, ARRAY_COUNT(cases));
    assert_int_equal(bench->node[1]->counters.rx_frames, 0);
    /* Traffic proves that a controller has left bus-off */
    frame = (struct bus_frame){.id = CAN_ERR_BUSOFF, .flags = FRAME_ERROR, .len = 8};
    assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
    frame = numbered(1, 1);
    assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
    assert_int_equal(can_receive(bench->node[1], got, 1), 1);
    assert_int_equal(bench->node[1]->state, CAN_PORT_BUS_OFF);
    assert_int_equal(can_receive(bench->node[1], got, 1), 1);
    assert_int_equal(bench->node[1]->state, CAN_PORT_UP);
}

TEST_ON(descriptor_is_readable_once_for_each_call_while_frames_wait, set_up, bench)
{
    struct bus_frame frame = numbered(1, 1), got[8];
    int descriptor;

    join_all(bench);
    /* A frame that came before anybody asked for the descriptor counts */
    assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
    descriptor = bench->node[1]->ops->descriptor(bench->node[1]);
    assert_true(readable(descriptor));
    assert_int_equal(can_receive(bench->node[1], got, 8), 1);
    assert_false(readable(descriptor));
    for (int round = 0; round < 3; round++) {
        struct bus_frame batch[3] = {frame, frame, frame};

        /* Only a call before the frames makes it readable */
        assert_int_equal(can_send(bench->node[2], batch, 3), 3);
        assert_false(readable(descriptor));
        assert_int_equal(can_receive(bench->node[1], got, 8), 3);
        assert_int_equal(bench->node[1]->ops->descriptor(bench->node[1]), descriptor);
        assert_int_equal(can_send(bench->node[2], batch, 3), 3);
        assert_int_equal(can_send(bench->node[0], batch, 3), 3);
        assert_true(readable(descriptor));
        assert_int_equal(can_receive(bench->node[1], got, 2), 2);
        assert_true(readable(descriptor));
        assert_int_equal(can_receive(bench->node[1], got, 8), 4);
        assert_false(readable(descriptor));
        assert_int_equal(can_receive(bench->node[1], got, 8), 0);
        assert_false(readable(descriptor));
    }
}

TEST_ON(closed_node_receives_no_more_and_disturbs_nobody, set_up, bench)
{
    struct bus_frame frame = numbered(1, 1), got[8];

    join_all(bench);
    bench->node[1]->ops->close(bench->node[1]);
    for (int i = 0; i < 2 * INBOX; i++) {
        assert_int_equal(can_send(bench->node[0], &frame, 1), 1);
        assert_int_equal(can_receive(bench->node[2], got, 8), 1);
    }
    assert_int_equal(can_receive(bench->node[1], got, 8), 0);
    assert_int_equal(bench->node[1]->counters.rx_dropped, 0);
}

TEST_ON(refuses_impossible_sizes_with_a_message, set_up, bench)
{
    struct frame_filter filters[LOCAL_BUS_FILTERS_MAX + 1] = {{0}};
    struct can_port *port;
    struct local_bus *bus;
    struct arena small;
    struct error error;

    assert_int_equal(create("x", 0, 8, false, &bench->arena, &bus, &error), ERROR_INPUT);
    assert_int_equal(create("x", 257, 8, false, &bench->arena, &bus, &error), ERROR_INPUT);
    assert_int_equal(create("x", 2, 7, false, &bench->arena, &bus, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "power of two"));
    assert_int_equal(
        local_bus_join(bench->bus, 1, filters, LOCAL_BUS_FILTERS_MAX + 1, &port, &error),
        ERROR_INPUT);
    join_all(bench);
    assert_int_equal(local_bus_join(bench->bus, 1, NULL, 0, &port, &error), ERROR_MEMORY);
    assert_string_equal(error.text, "local bus limb: all 4 places are taken");
    /* Every size of arena that is too small is survived */
    for (size_t size = 1 << 12; size < 1 << 20; size += 1 << 14) {
        assert_ok(arena_init(&small, size, &error));
        assert_int_equal(create("x", 16, 1024, false, &small, &bus, &error), ERROR_MEMORY);
        arena_fini(&small);
    }
    local_bus_destroy(NULL);
}

enum { STREAM = 20000 };

struct stream {
    struct can_port *port;
    uint32_t id;
    uint32_t received[3];
    bool in_order;
};

/* How far a stream may be: INBOX / 2 ahead of the slower peer keeps every inbox from running
 * over. */
static uint32_t allowance(const struct stream *stream)
{
    uint32_t slower = UINT32_MAX;

    for (uint32_t i = 0; i < 3; i++) {
        if (i != stream->id && stream->received[i] < slower) {
            slower = stream->received[i];
        }
    }
    return slower + INBOX / 2 < STREAM ? slower + INBOX / 2 : STREAM;
}

/* Sends a numbered stream while it reads that of two others; sleeps on the descriptor when idle. A
 * lost frame or wake-up ends in the time-out of poll. */
static void *exchange(void *context)
{
    struct stream *stream = context;
    uint32_t sent = 0, total = 0;

    stream->in_order = true;
    while (sent < STREAM || total < 2 * STREAM) {
        struct bus_frame frames[16];
        size_t count;

        for (count = 0; count < 8 && sent < allowance(stream); count++) {
            frames[count] = numbered(stream->id, sent++);
        }
        can_send(stream->port, frames, count);
        count = can_receive(stream->port, frames, 16);
        for (size_t i = 0; i < count; i++) {
            uint32_t *next = &stream->received[frames[i].id];

            stream->in_order &= get_u32_le(frames[i].data) == (*next)++;
        }
        total += (uint32_t)count;
        if (!count && sent == allowance(stream)) {
            struct pollfd wait = {.fd = stream->port->ops->descriptor(stream->port),
                                  .events = POLLIN};

            if (poll(&wait, 1, 20000) == 0) {
                return NULL;
            }
        }
    }
    return NULL;
}

TEST_ON(three_threads_exchange_everything_in_order, set_up, bench)
{
    struct stream stream[3];
    pthread_t thread[3];

    memset(stream, 0, sizeof stream);
    for (uint32_t i = 0; i < 3; i++) {
        stream[i].port = join(bench->bus);
        stream[i].id = i;
    }
    for (int i = 0; i < 3; i++) {
        assert_int_equal(pthread_create(&thread[i], NULL, exchange, &stream[i]), 0);
    }
    for (int i = 0; i < 3; i++) {
        pthread_join(thread[i], NULL);
    }
    for (int i = 0; i < 3; i++) {
        assert_true(stream[i].in_order);
        assert_int_equal(stream[i].port->counters.tx_frames, STREAM);
        assert_int_equal(stream[i].port->counters.rx_frames, 2 * STREAM);
        assert_int_equal(stream[i].port->counters.rx_dropped, 0);
    }
}

struct flood {
    struct can_port *port;
    uint32_t count;
};

static void *flood(void *context)
{
    struct flood *work = context;

    for (uint32_t i = 0; i < work->count; i++) {
        struct bus_frame frame = numbered(1, i);

        can_send(work->port, &frame, 1);
    }
    return NULL;
}

/* A writer that never waits: what arrives is in order, and what does not is counted. */
TEST_ON(accounts_for_every_frame_of_a_flood, set_up, bench)
{
    struct flood work = {.port = join(bench->bus), .count = 200000};
    struct can_port *reader = join(bench->bus);
    struct bus_frame got[INBOX];
    int64_t last = -1;
    pthread_t thread;
    size_t count;

    assert_int_equal(pthread_create(&thread, NULL, flood, &work), 0);
    do {
        count = can_receive(reader, got, INBOX);
        for (size_t i = 0; i < count; i++) {
            assert_true((int64_t)get_u32_le(got[i].data) > last);
            last = get_u32_le(got[i].data);
        }
        if (!count) {
            sched_yield();
        }
    } while (reader->counters.rx_frames + reader->counters.rx_dropped < work.count);
    pthread_join(thread, NULL);
    assert_int_equal(can_receive(reader, got, INBOX), 0);
    assert_int_equal(reader->counters.rx_frames + reader->counters.rx_dropped, work.count);
}
