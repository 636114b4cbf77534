/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The socketcan port against a real kernel: on virtual interfaces that the tests create, break and
 * remove. Runs in user-mode Linux (uml/run.sh), or anywhere as root on a kernel with vcan;
 * elsewhere all but the error messages is skipped.
 */
#include "canbus/port.h"
#include "tests/test.h"

#include <linux/can/error.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

/* A name of the greatest length that the kernel has. */
#define VCAN "hil-vcan-test-0"

enum { MANY = 256 };

struct bench {
    struct arena arena;
    struct can_port *a, *b;
};

static bool run(const char *command)
{
    return system(command) == 0;
}

static struct can_port *open_port(struct bench *bench, struct socketcan_config config)
{
    struct can_port *port = NULL;
    struct error error;

    config.interface = VCAN;
    assert_no_error(socketcan_open(&config, &bench->arena, &port, &error), error.text);
    return port;
}

FIXTURE(set_up)
{
    static struct bench bench;
    struct error error;

    memset(&bench, 0, sizeof bench);
    *test_state = &bench;
    if (arena_init(&bench.arena, 4 << 20, &error)) {
        return -1;
    }
    if (socketcan_available() && run("ip link add dev " VCAN " type vcan 2>/dev/null") &&
        run("ip link set " VCAN " up")) {
        bench.a = open_port(&bench, (struct socketcan_config){.fd = true});
        bench.b = open_port(&bench, (struct socketcan_config){.fd = true});
    }
    return 0;
}

FIXTURE(tear_down)
{
    struct bench *bench = *test_state;

    if (bench->a) {
        bench->a->ops->close(bench->a);
        bench->b->ops->close(bench->b);
        run("ip link del " VCAN " 2>/dev/null");
    }
    arena_fini(&bench->arena);
    return 0;
}

static struct bench *need_vcan(void **state)
{
    struct bench *bench = *state;

    if (!bench->a) {
        print_message("SKIP: no virtual CAN interface can be created here\n");
        skip();
    }
    return bench;
}

static enum error_code try_open(struct bench *bench, const char *interface, bool fd,
                                struct error *error)
{
    const struct socketcan_config config = {.interface = interface, .fd = fd};
    struct can_port *port = NULL;
    enum error_code code = socketcan_open(&config, &bench->arena, &port, error);

    if (!code) {
        port->ops->close(port);
    }
    return code;
}

static void assert_says(const struct error *error, const char *part)
{
    if (!strstr(error->text, part)) {
        fail_msg("\"%s\" does not say \"%s\"", error->text, part);
    }
}

static struct bus_frame numbered(uint32_t id, uint32_t number)
{
    uint8_t data[4];

    put_u32_le(data, number);
    return frame_make(id, 4, data);
}

static void assert_frame(const struct bus_frame *got, const struct bus_frame *sent)
{
    assert_int_equal(got->id, sent->id);
    assert_int_equal(got->flags, sent->flags);
    assert_int_equal(got->len, sent->len);
    assert_memory_equal(got->data, sent->data, sizeof sent->data);
}

/* Waits for the frames that are expected, as the kernel delivers them a little after the call that
 * has sent them; looks for more than those, too. Returns how many came, at most MANY. */
static size_t collect(struct can_port *port, struct bus_frame *frames, size_t expected)
{
    struct pollfd wait = {.fd = port->ops->descriptor(port), .events = POLLIN};
    size_t count = 0;

    while (count < MANY && poll(&wait, 1, count < expected ? 5000 : 20) == 1) {
        count += can_receive(port, frames + count, MANY - count);
    }
    return count;
}

/* Sends `count` numbered frames, with pauses in which the kernel delivers them: it would drop what
 * exceeds its own backlog before our buffer sees it. */
static void send_many(struct can_port *port, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const struct bus_frame frame = frame_make(0x100, 0, NULL);

        assert_int_equal(can_send(port, &frame, 1), 1);
        if (i % 100 == 99) {
            usleep(2000);
        }
    }
}

static int64_t monotonic_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

TEST_WITH(says_that_the_kernel_has_no_can, set_up, tear_down)
{
    struct error error;

    if (socketcan_available()) {
        print_message("SKIP: this kernel has CAN\n");
        skip();
    }
    assert_int_equal(try_open(*test_state, "can0", false, &error), ERROR_UNSUPPORTED);
    assert_says(&error, "this kernel has no CAN");
}

TEST_WITH(refuses_names_that_no_interface_can_have, set_up, tear_down)
{
    struct error error;

    assert_int_equal(try_open(*test_state, "", false, &error), ERROR_INPUT);
    assert_int_equal(try_open(*test_state, "sixteen-letters!", false, &error), ERROR_INPUT);
    assert_says(&error, "has 16 characters, expected 1 to 15");
}

TEST_WITH(each_way_to_fail_has_its_own_message, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct error error;

    assert_int_equal(try_open(bench, "no-such-one", false, &error), ERROR_INPUT);
    assert_says(&error, "no interface no-such-one");
    assert_says(&error, VCAN);
    assert_says(&error, "type vcan");
    assert_int_equal(try_open(bench, "lo", false, &error), ERROR_INPUT);
    assert_says(&error, "interface lo is not a CAN interface");
    assert_true(run("ip link set " VCAN " down && ip link set " VCAN " mtu 16"));
    assert_int_equal(try_open(bench, VCAN, false, &error), ERROR_SYSTEM);
    assert_says(&error, "`ip link set " VCAN " up`");
    assert_true(run("ip link set " VCAN " up"));
    assert_int_equal(try_open(bench, VCAN, true, &error), ERROR_INPUT);
    assert_says(&error, "does not carry CAN FD (MTU 16");
    assert_ok(try_open(bench, VCAN, false, &error));
}

TEST_WITH(carries_batches_both_ways_in_order, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct bus_frame sent[200], got[MANY];
    const int64_t before = monotonic_ns();

    for (uint32_t i = 0; i < 200; i++) {
        sent[i] = numbered(i % 2 ? 0x1ABCDEF0 + i : 0x100 + i, i);
        sent[i].flags = i % 2 ? FRAME_EXTENDED : 0;
    }
    for (int round = 0; round < 2; round++) {
        struct can_port *from = round ? bench->b : bench->a, *to = round ? bench->a : bench->b;

        assert_int_equal(can_send(from, sent, 200), 200);
        assert_int_equal(collect(to, got, 200), 200);
        for (int i = 0; i < 200; i++) {
            assert_frame(&got[i], &sent[i]);
            assert_true(got[i].time_ns > before - 1000000000);
            assert_true(got[i].time_ns <= monotonic_ns() + 1000000000);
        }
        assert_int_equal(can_receive(to, got, MANY), 0);
        assert_int_equal(from->counters.tx_frames, 200);
        assert_int_equal(to->counters.rx_frames, 200);
        assert_int_equal(from->counters.tx_bits, 100 * (47 + 32) + 100 * (67 + 32));
        assert_int_equal(to->counters.rx_bits, from->counters.tx_bits);
        assert_int_equal(from->counters.tx_dropped + to->counters.rx_dropped, 0);
    }
}

TEST_WITH(carries_every_kind_of_frame_unchanged, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct bus_frame sent[] = {
        {.id = 0x123},
        {.id = 0x7FF, .flags = FRAME_REMOTE, .len = 5},
        {.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED | FRAME_REMOTE},
        {.id = 0x123, .flags = FRAME_FD, .len = 8, .data = {1, 2, 3}},
        {.id = 0x123, .flags = FRAME_FD | FRAME_BRS, .len = 64},
        {.id = 0x456, .flags = FRAME_FD | FRAME_EXTENDED | FRAME_BRS | FRAME_ESI, .len = 48},
        {.id = 0x800, .len = 1}, /* invalid: is left out */
        {.id = 0x124, .len = 1, .data = {9}},
    };
    struct bus_frame got[MANY];

    memset(sent[4].data, 0xA5, 64);
    memset(sent[5].data, 0x5A, 48);
    assert_int_equal(can_send(bench->a, sent, 8), 7);
    assert_int_equal(bench->a->counters.tx_dropped, 1);
    assert_int_equal(collect(bench->b, got, 7), 7);
    for (int i = 0; i < 6; i++) {
        assert_frame(&got[i], &sent[i]);
    }
    assert_frame(&got[6], &sent[7]);
}

TEST_WITH(filters_pass_what_matches_and_own_frames_come_when_asked_for, set_up, tear_down)
{
    static const struct frame_filter filter[] = {
        {.id = 0x123, .mask = 0x7FF},
        {.id = 0x700, .mask = 0x700},
        {.id = 0x0ABC0000, .mask = 0x1FFFFF00, .extended = true},
    };
    static const struct bus_frame sent[] = {
        {.id = 0x123},
        {.id = 0x124},
        {.id = 0x123, .flags = FRAME_EXTENDED},
        {.id = 0x70F},
        {.id = 0x0ABC0011, .flags = FRAME_EXTENDED},
        {.id = 0x0ABD0011, .flags = FRAME_EXTENDED},
        {.id = CAN_ERR_ACK, .flags = FRAME_ERROR, .len = 8},
    };
    struct bench *bench = need_vcan(test_state);
    struct can_port *picky = open_port(
        bench, (struct socketcan_config){.filter = filter, .nfilter = 3, .receive_own = true});
    struct bus_frame got[MANY];

    for (int round = 0; round < 2; round++) {
        assert_int_equal(can_send(round ? picky : bench->a, sent, 7), 7);
        assert_int_equal(collect(picky, got, 4), 4);
        assert_int_equal(got[0].id, 0x123);
        assert_int_equal(got[1].id, 0x70F);
        assert_int_equal(got[2].id, 0x0ABC0011);
        assert_int_equal(got[3].flags, FRAME_ERROR);
    }
    assert_int_equal(collect(bench->a, got, 7), 7); /* those of picky alone, not its own */
    picky->ops->close(picky);
}

TEST_WITH(follows_the_states_of_injected_error_frames, set_up, tear_down)
{
    static const struct {
        uint32_t id;
        uint8_t controller;
        enum can_port_state state;
    } cases[] = {
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, CAN_PORT_WARNING},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CAN_PORT_PASSIVE},
        {CAN_ERR_BUSOFF, 0, CAN_PORT_BUS_OFF},
        {CAN_ERR_RESTARTED, 0, CAN_PORT_UP},
    };
    struct bench *bench = need_vcan(test_state);
    struct bus_frame got[MANY];

    for (size_t i = 0; i < 4; i++) {
        struct bus_frame frame = {.id = cases[i].id, .flags = FRAME_ERROR, .len = 8};

        frame.data[1] = cases[i].controller;
        assert_int_equal(can_send(bench->a, &frame, 1), 1);
        assert_int_equal(collect(bench->b, got, 1), 1);
        assert_frame(&got[0], &frame);
        assert_int_equal(bench->b->state, cases[i].state);
    }
    assert_int_equal(bench->b->counters.error_frames, 4);
}

TEST_WITH(counts_what_the_kernel_drops_when_a_receive_buffer_runs_over, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct can_port *small = open_port(bench, (struct socketcan_config){.receive_buffer_bytes = 1});
    const struct bus_frame frame = numbered(0x100, 0);
    struct bus_frame got[MANY];
    size_t seen = 0, count;

    send_many(bench->a, 1000);
    while ((count = collect(small, got, 0))) {
        seen += count;
    }
    assert_in_range(seen, 1, 999);
    /* The kernel tells the number with the next frame that it delivers */
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(collect(small, got, 1), 1);
    assert_int_equal(small->counters.rx_dropped, 1000 - seen);
    /* The default buffer holds ten times the 278 frames of the system's without loss */
    while (collect(bench->b, got, 0)) {
    }
    send_many(bench->a, 3000);
    for (seen = 0; (count = collect(bench->b, got, 0)); seen += count) {
    }
    assert_int_equal(seen, 3000);
    assert_int_equal(bench->b->counters.rx_dropped, 0);
    small->ops->close(small);
}

TEST_WITH(what_a_flood_has_lost_is_known_when_the_rest_was_received, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    const struct bus_frame frame = numbered(0x100, 0);
    struct can_port *port =
        open_port(bench, (struct socketcan_config){.receive_buffer_bytes = 256 << 10});
    struct bus_frame got[MANY];
    size_t seen = 0, count;

    send_many(bench->a, 3000);
    while ((count = collect(port, got, 0))) {
        seen += count;
    }
    assert_in_range(seen, MANY, 2999);
    /* No frame comes after them that could tell */
    assert_int_equal(port->counters.rx_dropped, 3000 - seen);
    /* And it is counted once */
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(collect(port, got, 1), 1);
    assert_int_equal(port->counters.rx_dropped, 3000 - seen);
    port->ops->close(port);
}

/* Calls receive until the port is in a state; it looks for its interface once a second. */
static bool comes_to(struct can_port *port, enum can_port_state state)
{
    struct bus_frame got[MANY];

    for (int i = 0; i < 500 && port->state != state; i++) {
        can_receive(port, got, MANY);
        usleep(10000);
    }
    return port->state == state;
}

TEST_WITH(comes_back_when_its_interface_was_down, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct bus_frame frame = numbered(0x123, 7), got[MANY];

    assert_true(run("ip link set " VCAN " down"));
    assert_int_equal(can_send(bench->a, &frame, 1), 0);
    assert_true(comes_to(bench->a, CAN_PORT_DOWN));
    assert_true(comes_to(bench->b, CAN_PORT_DOWN));
    assert_int_equal(bench->a->counters.down_events, 1);
    assert_int_equal(bench->a->counters.tx_dropped, 1);
    assert_int_equal(can_receive(bench->a, got, MANY), 0);
    assert_true(run("ip link set " VCAN " up"));
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    assert_true(comes_to(bench->b, CAN_PORT_UP));
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(collect(bench->b, got, 1), 1);
    assert_frame(&got[0], &frame);
    assert_int_equal(bench->a->counters.down_events, 1);
    assert_int_equal(bench->b->counters.down_events, 1);
}

TEST_WITH(comes_back_with_its_filters_when_its_interface_was_created_anew, set_up, tear_down)
{
    static const struct frame_filter filter = {.id = 0x123, .mask = 0x7FF};
    struct bench *bench = need_vcan(test_state);
    struct can_port *picky =
        open_port(bench, (struct socketcan_config){.filter = &filter, .nfilter = 1});
    struct bus_frame frame = numbered(0x123, 7), other = numbered(0x124, 8), got[MANY];

    assert_true(run("ip link del " VCAN));
    assert_true(comes_to(bench->a, CAN_PORT_GONE));
    assert_true(comes_to(picky, CAN_PORT_GONE));
    assert_int_equal(can_send(bench->a, &frame, 1), 0);
    assert_int_equal(bench->a->counters.down_events, 1);
    /* Under another index, and at first down */
    assert_true(run("ip link add dev hil-between type vcan && ip link add dev " VCAN
                    " type vcan && ip link del hil-between"));
    assert_true(comes_to(bench->a, CAN_PORT_DOWN));
    assert_true(run("ip link set " VCAN " up"));
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    assert_true(comes_to(picky, CAN_PORT_UP));
    assert_int_equal(can_send(bench->a, &other, 1), 1);
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(collect(picky, got, 1), 1);
    assert_frame(&got[0], &frame);
    assert_int_equal(picky->counters.down_events, 1);
    assert_int_equal(can_send(picky, &other, 1), 1);
    assert_int_equal(collect(bench->a, got, 1), 1);
    assert_frame(&got[0], &other);
    picky->ops->close(picky);
}

TEST_WITH(a_sought_port_comes_back_when_it_was_sought_and_not_before, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct can_port *port = open_port(bench, (struct socketcan_config){.sought = true});
    struct bus_frame frame = numbered(0x123, 7), got[MANY];

    socketcan_seek(port); /* nothing to look for */
    assert_int_equal(port->state, CAN_PORT_UP);
    for (int round = 1; round <= 2; round++) {
        assert_true(run("ip link set " VCAN " down"));
        assert_true(comes_to(port, CAN_PORT_DOWN));
        assert_int_equal(port->counters.down_events, round);
        socketcan_seek(port);
        assert_int_equal(can_receive(port, got, MANY), 0);
        assert_int_equal(port->state, CAN_PORT_DOWN);
        assert_true(run("ip link set " VCAN " up"));
        assert_true(comes_to(bench->a, CAN_PORT_UP)); /* which looks for itself */
        can_receive(port, got, MANY);
        assert_int_equal(port->state, CAN_PORT_DOWN);
        socketcan_seek(port);
        assert_int_equal(port->state, CAN_PORT_DOWN); /* the port's thread changes it */
        can_receive(port, got, MANY);
        assert_int_equal(port->state, CAN_PORT_UP);
        assert_int_equal(can_send(port, &frame, 1), 1);
        assert_int_equal(collect(bench->a, got, 1), 1);
        assert_frame(&got[0], &frame);
        while (can_receive(bench->a, got, MANY) || can_receive(port, got, MANY)) {
        }
    }
    port->ops->close(port);
}

static void set_time_of_day(int64_t by_s)
{
    struct timespec now;

    clock_gettime(CLOCK_REALTIME, &now);
    now.tv_sec += by_s;
    assert_int_equal(clock_settime(CLOCK_REALTIME, &now), 0);
}

TEST_WITH(the_time_of_day_may_be_set_while_frames_wait, set_up, tear_down)
{
    static const int64_t jump_s[] = {3600, -7200, 3600};
    struct bench *bench = need_vcan(test_state);
    struct bus_frame frame = numbered(0x123, 7), got[MANY];
    int64_t last = monotonic_ns();

    if (!getenv("HIL_UML")) {
        print_message("SKIP: sets the time of the whole machine: only in user-mode Linux\n");
        skip();
    }
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(collect(bench->b, got, 1), 1);
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(can_send(bench->a, &frame, 1), 1);
        set_time_of_day(jump_s[i]);
        assert_int_equal(collect(bench->b, &got[1], 1), 1);
        assert_true(got[1].time_ns >= got[0].time_ns);
        assert_true(got[1].time_ns >= last - 1000000000);
        assert_true(got[1].time_ns <= monotonic_ns());
        got[0] = got[1];
        last = monotonic_ns();
    }
}

TEST_WITH(descriptor_is_readable_while_frames_wait, set_up, tear_down)
{
    struct bench *bench = need_vcan(test_state);
    struct pollfd wait = {.fd = bench->b->ops->descriptor(bench->b), .events = POLLIN};
    struct bus_frame frame = numbered(1, 1), got[MANY];

    assert_int_equal(poll(&wait, 1, 0), 0);
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(poll(&wait, 1, 5000), 1);
    assert_int_equal(collect(bench->b, got, 1), 1);
    assert_int_equal(poll(&wait, 1, 0), 0);
}
