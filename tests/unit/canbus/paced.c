/* SPDX-License-Identifier: Apache-2.0 */
/* A port that is paced by a wire in virtual time. */
#include "canbus/paced.h"

#include "tests/unit/arena_fixture.h"
#include "tests/unit/canbus/wire/wire_bench.h"

enum { STEP = 0x6f0, DONE = 0x6ff };

static struct bus_frame got[64];

/* A port without time: takes everything, gives what the test puts in. */
struct script {
    struct can_port port;
    struct bus_frame sent[64], waiting[64];
    size_t nsent, nwaiting;
    bool closed;
};

static struct script script;

static size_t script_send(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    (void)port;
    for (size_t i = 0; i < count; i++) {
        script.sent[script.nsent++ % 64] = frames[i];
    }
    script.port.counters.tx_frames += count;
    return count;
}

static size_t script_receive(struct can_port *port, struct bus_frame *frames, size_t max)
{
    size_t count = script.nwaiting < max ? script.nwaiting : max;

    (void)port;
    memcpy(frames, script.waiting, count * sizeof *frames);
    script.nwaiting = 0;
    return count;
}

static int script_descriptor(const struct can_port *port)
{
    (void)port;
    return 77;
}

static void script_close(struct can_port *port)
{
    (void)port;
    script.closed = true;
}

static struct can_port *open_paced(size_t queue)
{
    static const struct can_port_ops ops = {.name = "script",
                                            .receive = script_receive,
                                            .send = script_send,
                                            .descriptor = script_descriptor,
                                            .close = script_close};
    struct paced_port_config config = {
        .bitrate = 1000000, .nodes = 2, .queue = queue, .bypass_id = {STEP, DONE}, .nbypass = 2};
    struct can_port *port = NULL;
    struct error error;

    memset(&script, 0, sizeof script);
    script.port = (struct can_port){.ops = &ops, .bus = "can0"};
    config.port = &script.port;
    assert_ok(paced_port_create(&config, &arena, &port, &error));
    return port;
}

TEST_WITH(paced_frames_leave_when_a_wire_would_have_delivered_them, open_arena, close_arena)
{
    struct can_port *port = open_paced(64);
    struct bus_frame frames[20];

    for (size_t i = 0; i < 20; i++) {
        frames[i] = bench_frame(0x200 - (uint32_t)i, 8);
        frames[i].node = i % 2;
    }
    assert_int_equal(can_send(port, frames, 20), 20);
    assert_int_equal(script.nsent, 0);
    paced_port_advance(port, MS);
    /* The reference: frames of some 110 to 125 us and 3 us between them, the most urgent first */
    {
        int64_t end = 0;
        size_t expected = 0;

        for (size_t i = 20; i-- > 0;) {
            end += bench_duration(&frames[i], 1000000, 0);
            expected += end <= MS;
            end += 3 * US;
        }
        assert_int_equal(script.nsent, expected);
    }
    assert_int_equal(script.sent[0].id, 0x200 - 19);
    paced_port_advance(port, 3 * MS);
    assert_int_equal(script.nsent, 20);
    port->ops->close(port);
    assert_true(script.closed);
}

TEST_WITH(what_comes_in_takes_its_share_of_the_paced_bus, open_arena, close_arena)
{
    struct can_port *port = open_paced(64);
    struct bus_frame mine = bench_frame(0x700, 8);
    struct wire_stats stats;

    for (uint32_t i = 0; i < 30; i++) {
        script.waiting[i] = bench_frame(0x100 + i, 8);
    }
    script.waiting[30] = bench_frame(STEP, 6);
    script.nwaiting = 31;
    assert_int_equal(can_receive(port, got, 64), 31);
    can_send(port, &mine, 1);
    paced_port_advance(port, 3 * MS);
    assert_int_equal(script.nsent, 0);
    paced_port_advance(port, 6 * MS);
    assert_int_equal(script.nsent, 1);
    wire_stats(paced_port_wire(port), &stats);
    assert_int_equal(stats.frames, 31);
    assert_true(stats.load_mean > 0.5);
}

TEST_WITH(paced_ports_drop_what_the_wire_cannot_hold_and_pass_lockstep, open_arena, close_arena)
{
    struct can_port *port = open_paced(4);
    struct bus_frame frame = bench_frame(0x123, 8), done = bench_frame(DONE, 6);

    for (int i = 0; i < 10; i++) {
        assert_int_equal(can_send(port, &frame, 1), i < 4);
    }
    assert_int_equal(port->counters.tx_dropped, 6);
    assert_int_equal(can_send(port, &done, 1), 1);
    assert_int_equal(script.nsent, 1);
    assert_int_equal(script.sent[0].id, DONE);
    assert_int_equal(port->ops->descriptor(port), 77);
    script.port.state = CAN_PORT_DOWN;
    paced_port_advance(port, MS);
    assert_int_equal(port->state, CAN_PORT_DOWN);
    assert_int_equal(port->counters.tx_frames, 5);
}
