/* SPDX-License-Identifier: Apache-2.0 */
/* The port that tells when frames passed the kernel, on a port that the test plays. */
#include "app/bench/latency_tap.h"
#include "tests/test.h"

struct played_port {
    struct can_port port;
    struct bus_frame waiting[8];
    size_t nwaiting, nsent;
    bool closed;
};

struct bench {
    struct arena arena;
    struct played_port played;
    struct latency_tap *tap;
};

static size_t played_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct played_port *played = (struct played_port *)port;
    size_t count = played->nwaiting;

    assert_true(count <= max);
    for (size_t i = 0; i < count; i++) {
        frames[i] = played->waiting[i];
    }
    played->nwaiting = 0;
    return count;
}

static size_t played_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    (void)frames;
    ((struct played_port *)port)->nsent += count;
    return count;
}

static int played_descriptor(const struct can_port *port)
{
    (void)port;
    return 42;
}

static void played_close(struct can_port *port)
{
    ((struct played_port *)port)->closed = true;
}

static const struct can_port_ops played_ops = {
    "played", played_receive, played_send, played_descriptor, played_close,
};

static struct bus_frame frame_at(uint32_t id, uint8_t value, int64_t time_ns)
{
    struct bus_frame frame = frame_make(id, 1, &value);

    frame.time_ns = time_ns;
    return frame;
}

/* A frame that the bus is to bring next. */
static void bring(struct bench *bench, struct bus_frame frame)
{
    bench->played.waiting[bench->played.nwaiting++] = frame;
}

static size_t take(struct bench *bench, struct bus_frame *frame)
{
    return can_receive(&bench->tap->port, frame, 1);
}

static void put(struct bench *bench, uint32_t id, uint8_t value)
{
    struct bus_frame frame = frame_at(id, value, 0);

    assert_int_equal(can_send(&bench->tap->port, &frame, 1), 1);
}

static inline void set_up(struct bench *bench)
{
    struct error error;

    *bench = (struct bench){.played.port = {.ops = &played_ops, .bus = "can0"}};
    assert_ok(arena_init(&bench->arena, 1 << 20, &error));
    assert_int_equal(latency_tap_create(&bench->played.port, &bench->arena, &bench->tap, &error),
                     0);
}

static inline void tear_down(struct bench *bench)
{
    arena_fini(&bench->arena);
}

BENCH(set_up, struct bench, tear_down)

TEST_ON(the_first_frame_after_the_mark_counts, set_up, bench)
{
    struct bus_frame frame;

    put(bench, 0x10, 1);
    latency_tap_mark(bench->tap);
    put(bench, 0x11, 2);
    put(bench, 0x12, 3);
    assert_int_equal(bench->played.nsent, 3);
    bring(bench, frame_at(0x11, 2, 1000));
    bring(bench, frame_at(0x12, 3, 1100));
    bring(bench, frame_at(0x20, 7, 1500));
    assert_int_equal(take(bench, &frame), 1);
    assert_int_equal(frame.id, 0x20);
    assert_int_equal(bench->tap->sent_ns, 1000);
    assert_int_equal(bench->tap->received_ns, 1500);
    assert_int_equal(take(bench, &frame), 0);
}

TEST_ON(frames_are_handed_on_one_a_call, set_up, bench)
{
    struct bus_frame frame[8];

    for (uint8_t i = 0; i < 3; i++) {
        bring(bench, frame_at(0x20, i, 1000 + i));
    }
    for (uint8_t i = 0; i < 3; i++) {
        assert_int_equal(can_receive(&bench->tap->port, frame, 8), 1);
        assert_int_equal(frame[0].data[0], i);
        assert_int_equal(bench->tap->received_ns, 1000 + i);
        assert_int_equal(bench->tap->frames, i + 1u);
    }
    assert_int_equal(can_receive(&bench->tap->port, frame, 8), 0);
}

/* Another node may send the same identifier with other data, and our bytes a second time. */
TEST_ON(what_others_send_is_handed_on, set_up, bench)
{
    struct bus_frame frame;

    put(bench, 0x11, 2);
    bring(bench, frame_at(0x11, 9, 900));
    bring(bench, frame_at(0x11, 2, 1000));
    bring(bench, frame_at(0x11, 2, 1100));
    assert_int_equal(take(bench, &frame), 1);
    assert_int_equal(frame.data[0], 9);
    assert_int_equal(take(bench, &frame), 1);
    assert_int_equal(frame.time_ns, 1100);
    assert_int_equal(bench->tap->sent_ns, 1000);
    assert_int_equal(take(bench, &frame), 0);
}

TEST_ON(frames_that_never_come_back_make_room, set_up, bench)
{
    struct bus_frame frame;

    for (int i = 0; i < 3 * LATENCY_TAP_SENT; i++) {
        put(bench, 0x11, (uint8_t)i);
    }
    bring(bench, frame_at(0x11, 3 * LATENCY_TAP_SENT - 1, 2000));
    bring(bench, frame_at(0x11, 0, 2100)); /* forgotten, so taken for another's */
    assert_int_equal(take(bench, &frame), 1);
    assert_int_equal(frame.time_ns, 2100);
    assert_int_equal(bench->tap->sent_ns, 2000);
}

TEST_ON(the_rest_is_that_of_the_port_behind, set_up, bench)
{
    struct bus_frame frame;

    bench->played.port.state = CAN_PORT_WARNING;
    bench->played.port.counters.rx_frames = 5;
    assert_int_equal(take(bench, &frame), 0);
    assert_int_equal(bench->tap->port.state, CAN_PORT_WARNING);
    assert_int_equal(bench->tap->port.counters.rx_frames, 5);
    assert_int_equal(bench->tap->port.ops->descriptor(&bench->tap->port), 42);
    bench->tap->port.ops->close(&bench->tap->port);
    assert_true(bench->played.closed);
}
