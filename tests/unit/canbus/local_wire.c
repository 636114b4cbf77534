/* SPDX-License-Identifier: Apache-2.0 */
/* The local bus in wire mode. */
#include "base/array.h"
#include "canbus/port.h"
#include "tests/unit/canbus/wire/wire_bench.h"
#include "tests/unit/canbus/wire/wire_force.h"

#include <linux/can/error.h>
#include <pthread.h>
#include <sched.h>

enum { BOARDS = 4, STEP = 0x6f0, DONE = 0x6ff };

static struct arena arena;
static struct local_bus *bus;
static struct can_port *boards, *host;
static struct bus_frame got[256];

static struct can_port *join(size_t nodes)
{
    struct can_port *port = NULL;
    struct error error;

    assert_no_error(local_bus_join(bus, nodes, NULL, 0, &port, &error), error.text);
    return port;
}

/* A bus whose controllers have all joined in. */
static void open_bus(size_t queue)
{
    const struct local_bus_config config = {.name = "limb",
                                            .max_nodes = 3,
                                            .inbox = 256,
                                            .mode = LOCAL_BUS_WIRE,
                                            .wire_nodes = BOARDS + 2,
                                            .queue = queue,
                                            .restart_delay_ns = 10 * MS,
                                            .bypass_id = {STEP, DONE},
                                            .nbypass = 2};
    struct error error;

    assert_ok(local_bus_create(&config, &arena, &bus, &error));
    boards = join(BOARDS);
    host = join(1);
    local_bus_advance(bus, MS);
}

FIXTURE(set_up)
{
    struct error error;

    return (int)arena_init(&arena, (size_t)64 << 20, &error);
}

FIXTURE(tear_down)
{
    local_bus_destroy(bus);
    bus = NULL;
    arena_fini(&arena);
    return 0;
}

TEST_WITH(a_frame_arrives_when_its_bits_have, set_up, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t length = bench_duration(&frame, 1000000, 0);

    open_bus(0);
    frame.node = 2;
    assert_int_equal(can_send(boards, &frame, 1), 1);
    assert_int_equal(can_receive(host, got, 8), 0);
    local_bus_advance(bus, MS + length - 1);
    assert_int_equal(can_receive(host, got, 8), 0);
    local_bus_advance(bus, MS + length);
    assert_int_equal(can_receive(host, got, 8), 1);
    assert_int_equal(got[0].time_ns, MS + length);
    assert_int_equal(can_receive(boards, got, 8), 0);
}

/* What both sides send at one time competes, whoever called first. */
TEST_WITH(the_lowest_identifier_of_both_sides_goes_first, set_up, tear_down)
{
    open_bus(0);
    for (uint32_t i = 0; i < 4; i++) {
        struct bus_frame of_board = bench_frame(0x301 + 2 * i, 8);
        struct bus_frame of_host = bench_frame(0x300 + 2 * i, 3);

        of_board.node = (uint16_t)i;
        can_send(boards, &of_board, 1);
        can_send(host, &of_host, 1);
    }
    local_bus_advance(bus, 3 * MS);
    assert_int_equal(can_receive(host, got, 8), 4);
    assert_int_equal(can_receive(boards, got + 4, 8), 4);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(got[i].id, 0x301 + 2 * i);
        assert_int_equal(got[4 + i].id, 0x300 + 2 * i);
        assert_true(got[4 + i].time_ns < got[i].time_ns);
    }
}

TEST_WITH(lockstep_frames_take_no_time_and_keep_their_place, set_up, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8), step = bench_frame(STEP, 6);

    open_bus(0);
    can_send(host, &frame, 1);
    can_send(host, &step, 1);
    assert_int_equal(can_receive(boards, got, 8), 1);
    assert_int_equal(got[0].id, STEP);
    step.id = DONE;
    local_bus_advance(bus, 2 * MS);
    can_send(host, &step, 1);
    assert_int_equal(can_receive(boards, got, 8), 2);
    assert_int_equal(got[0].id, 0x123);
    assert_int_equal(got[1].id, DONE);
}

TEST_WITH(drops_of_a_controller_reach_the_counters_of_its_port, set_up, tear_down)
{
    open_bus(4);
    for (uint32_t i = 0; i < 10; i++) {
        struct bus_frame frame = bench_frame(0x100 + i, 8);

        assert_int_equal(can_send(host, &frame, 1), 1);
    }
    local_bus_advance(bus, 10 * MS);
    can_receive(host, got, 8);
    assert_int_equal(host->counters.tx_frames, 10);
    assert_int_equal(host->counters.tx_dropped, 6);
    assert_int_equal(can_receive(boards, got, 256), 4);
    /* A node that the port does not stand for */
    assert_int_equal(can_send(host, &(struct bus_frame){.id = 1, .node = 1}, 1), 0);
    assert_int_equal(host->counters.tx_dropped, 7);
}

/* As SocketCAN would: error frames tell the program of its controller's state. */
TEST_WITH(a_port_hears_of_the_state_of_its_controller, set_up, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    struct wire *wire;
    int fault;

    open_bus(0);
    wire = local_bus_wire(bus);
    fault = wire_inject(
        wire,
        &(struct wire_fault){.kind = WIRE_FAULT_CORRUPT, .node = BOARDS, .receiver = WIRE_ANY});
    can_send(host, &frame, 1);
    local_bus_advance(bus, 8 * MS);
    assert_int_equal(can_receive(host, got, 8), 3);
    assert_int_equal(got[0].id, CAN_ERR_CRTL);
    assert_int_equal(got[0].data[1], CAN_ERR_CRTL_TX_WARNING);
    assert_int_equal(got[0].data[6], 96);
    assert_int_equal(got[1].data[1], CAN_ERR_CRTL_TX_PASSIVE);
    assert_int_equal(got[2].id, CAN_ERR_BUSOFF);
    assert_int_equal(host->state, CAN_PORT_BUS_OFF);
    wire_heal(wire, fault);
    local_bus_advance(bus, 30 * MS);
    assert_int_equal(can_receive(host, got, 8), 1);
    assert_true(got[0].id & CAN_ERR_RESTARTED);
    assert_int_equal(host->state, CAN_PORT_UP);
    /* One board in bus-off leaves the others on the bus */
    wire_force_bus_off(wire, 1);
    local_bus_advance(bus, 31 * MS);
    can_receive(boards, got, 8);
    assert_int_equal(boards->state, CAN_PORT_UP);
}

/* Errors hit the node that sends: a stranger with the identifier of board 2 makes that board error
 * passive, and no other. */
TEST_WITH(a_fault_of_one_board_leaves_the_others_alone, set_up, tear_down)
{
    const struct wire_fault stranger = {.kind = WIRE_FAULT_COLLISION,
                                        .node = WIRE_ANY,
                                        .receiver = WIRE_ANY,
                                        .id = 0x102,
                                        .id_mask = 0x7ff,
                                        .probability = 1.0};
    struct wire_node_stats stats;
    size_t count = 0, of_victim = 0;

    open_bus(0);
    assert_true(wire_inject(local_bus_wire(bus), &stranger) >= 0);
    for (int tick = 0; tick < 10; tick++) {
        for (uint16_t node = 0; node < BOARDS; node++) {
            struct bus_frame frame = bench_frame(0x100u + node, 2);

            frame.node = node;
            can_send(boards, &frame, 1);
        }
        local_bus_advance(bus, (2 + tick) * MS);
        count += can_receive(host, got + count, 64);
    }
    for (size_t i = 0; i < count; i++) {
        of_victim += got[i].id == 0x102;
        assert_int_equal(got[i].node, 0); /* nothing for a receiver */
    }
    for (size_t node = 0; node < BOARDS; node++) {
        wire_node_stats(local_bus_wire(bus), node, &stats);
        assert_int_equal(stats.confirmed, node == 2 ? of_victim : 10);
        assert_int_equal(stats.errors > 0, node == 2);
        assert_int_equal(stats.tec_peak >= 128, node == 2);
    }
}

/* A STEP of several ticks: nobody receives between them, and every frame has the time of its
 * tick. */
TEST_WITH(frames_of_several_ticks_wait_in_their_order, set_up, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 1), done = bench_frame(DONE, 6);
    int64_t length;

    open_bus(0);
    for (int tick = 1; tick <= 20; tick++) {
        frame.data[0] = (uint8_t)tick;
        can_send(boards, &frame, 1);
        local_bus_advance(bus, (tick + 1) * MS);
    }
    can_send(boards, &done, 1);
    assert_int_equal(can_receive(host, got, 64), 21);
    for (int tick = 1; tick <= 20; tick++) {
        frame.data[0] = (uint8_t)tick;
        length = bench_duration(&frame, 1000000, 0);
        assert_int_equal(got[tick - 1].data[0], tick);
        assert_int_equal(got[tick - 1].time_ns, tick * MS + length);
    }
    assert_int_equal(got[20].id, DONE);
}

/* ---- a listener that answers within the advance ---- */

/* The boards: each answers its command with identifier 0 after a delay. */
static struct {
    int64_t delay_ns, heard_ns[8], due_ns[8];
    size_t heard, sent;
} listener;

static int64_t listener_next(void)
{
    return listener.sent < listener.heard ? listener.due_ns[listener.sent] : INT64_MAX;
}

static int64_t listen(void *context, const struct bus_frame *frame)
{
    (void)context;
    listener.heard_ns[listener.heard] = frame->time_ns;
    listener.due_ns[listener.heard++] = frame->time_ns + listener.delay_ns;
    return listener_next();
}

/* Advances to a time, and sends the answers of the boards where the bus stops. */
static void advance_with_answers(int64_t to_ns)
{
    int64_t at_ns = 0;

    while (at_ns < to_ns) {
        const int64_t next_ns = listener_next();

        at_ns = local_bus_advance(bus, next_ns < to_ns ? next_ns : to_ns);
        for (; at_ns < to_ns && listener_next() <= at_ns; listener.sent++) {
            struct bus_frame answer = bench_frame(0, 6);

            answer.node = (uint16_t)listener.sent;
            answer.data[0] = (uint8_t)(1 + listener.sent);
            can_send(boards, &answer, 1);
        }
    }
}

/* Closed form of two commands at 1 ms and their answers with one identifier: an answer that is due
 * goes before the next command, and competes for the bus at the end of its delay. */
TEST(an_answer_competes_for_the_bus_at_the_end_of_its_delay)
{
    static const int64_t delay_ns[] = {0, 50 * US, 300 * US, 5 * MS};
    const int64_t gap = 3 * US; /* intermission */

    for (size_t row = 0; row < ARRAY_COUNT(delay_ns); row++) {
        const int64_t delay = delay_ns[row];
        struct bus_frame command[2] = {bench_frame(1, 8), bench_frame(2, 8)}, answer[2];
        int64_t c[2], a[2], end[2], begin[2];

        set_up(NULL);
        open_bus(0);
        memset(&listener, 0, sizeof listener);
        listener.delay_ns = delay;
        local_bus_listen(bus, listen, NULL);
        for (size_t i = 0; i < 2; i++) {
            answer[i] = bench_frame(0, 6);
            answer[i].data[0] = (uint8_t)(1 + i);
            c[i] = bench_duration(&command[i], 1000000, 0);
            a[i] = bench_duration(&answer[i], 1000000, 0);
            assert_int_equal(can_send(host, &command[i], 1), 1);
        }
        advance_with_answers(20 * MS);

        end[0] = MS + c[0];
        if (delay <= gap) {
            begin[0] = end[0] + gap;
            end[1] = begin[0] + a[0] + gap + c[1];
            begin[1] = end[1] + gap;
        } else {
            end[1] = end[0] + gap + c[1];
            begin[0] = end[0] + delay > end[1] + gap ? end[0] + delay : end[1] + gap;
            begin[1] = begin[0] + a[0] + gap;
            begin[1] = end[1] + delay > begin[1] ? end[1] + delay : begin[1];
        }
        assert_int_equal(listener.heard, 2);
        assert_int_equal(can_receive(host, got, 8), 2);
        for (size_t i = 0; i < 2; i++) {
            assert_int_equal(listener.heard_ns[i], end[i]);
            assert_int_equal(got[i].data[0], 1 + i);
            assert_int_equal(got[i].time_ns, begin[i] + a[i]);
        }
        assert_int_equal(can_receive(boards, got, 8), 0);
        assert_int_equal(boards->counters.rx_frames, 2);
        assert_int_equal(boards->counters.tx_dropped, 0);
        tear_down(NULL);
    }
}

/* A destroyed answer is repeated behind its error frame: its flags, delimiter and intermission. */
TEST_WITH(a_destroyed_answer_is_repeated_at_the_time_of_the_wire, set_up, tear_down)
{
    const struct wire_fault once = {
        .kind = WIRE_FAULT_CORRUPT, .node = 0, .receiver = WIRE_ANY, .count = 1};
    struct bus_frame command = bench_frame(1, 8), answer = bench_frame(0, 6);
    int64_t good_ns, length;
    struct wire_stats stats;

    open_bus(0);
    memset(&listener, 0, sizeof listener);
    local_bus_listen(bus, listen, NULL);
    answer.data[0] = 1;
    length = bench_duration(&answer, 1000000, 0);
    good_ns = MS + bench_duration(&command, 1000000, 0) + 3 * US + length;
    assert_true(wire_inject(local_bus_wire(bus), &once) >= 0);
    can_send(host, &command, 1);
    advance_with_answers(2 * MS);
    wire_stats(local_bus_wire(bus), &stats);
    assert_int_equal(stats.errors[WIRE_BIT_ERROR], 1);
    assert_int_equal(can_receive(host, got, 8), 1);
    assert_true(got[0].time_ns > good_ns + 17 * US);
    assert_true(got[0].time_ns < good_ns + length + 23 * US);
}

TEST_WITH(a_port_that_closes_no_longer_acknowledges, set_up, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    struct wire_node_stats stats;

    open_bus(0);
    boards->ops->close(boards);
    can_send(host, &frame, 1);
    local_bus_advance(bus, 50 * MS);
    wire_node_stats(local_bus_wire(bus), BOARDS, &stats);
    assert_int_equal(stats.confirmed, 0);
    assert_int_equal(stats.state, WIRE_ERROR_PASSIVE);
}

TEST_WITH(controllers_are_given_out_once, set_up, tear_down)
{
    struct can_port *port;
    struct error error;

    open_bus(0);
    assert_int_equal(local_bus_join(bus, 2, NULL, 0, &port, &error), ERROR_MEMORY);
    assert_non_null(strstr(error.text, "2 controllers wanted, 1 of 6 are left"));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &port, &error));
}

/* ---- senders in threads of their own ---- */

enum { STREAM = 3000 };

static void *stream(void *context)
{
    struct can_port *port = context;

    for (uint32_t i = 0; i < STREAM; i++) {
        /* No identifier on two nodes: they would collide */
        struct bus_frame frame = bench_frame((port == host ? 0x200 : 0x300) + i % 7, 4);

        put_u32_le(frame.data, i);
        while (can_send(port, &frame, 1) == 0) {
            sched_yield();
        }
        if (i % 50 == 49) {
            sched_yield();
        }
    }
    return NULL;
}

TEST_WITH(threads_may_send_while_time_moves, set_up, tear_down)
{
    struct can_port *other;
    pthread_t thread[2];
    size_t received = 0;
    int64_t last = 0;

    open_bus(4096);
    other = join(1);
    assert_int_equal(pthread_create(&thread[0], NULL, stream, host), 0);
    assert_int_equal(pthread_create(&thread[1], NULL, stream, other), 0);
    for (int64_t tick = 2; received < 2 * STREAM; tick++) {
        size_t count;

        local_bus_advance(bus, tick * MS);
        while ((count = can_receive(boards, got, 256))) {
            for (size_t i = 0; i < count; i++) {
                assert_true(got[i].time_ns >= last);
                last = got[i].time_ns;
            }
            received += count;
        }
        sched_yield();
    }
    pthread_join(thread[0], NULL);
    pthread_join(thread[1], NULL);
    assert_int_equal(received, 2 * STREAM);
}
