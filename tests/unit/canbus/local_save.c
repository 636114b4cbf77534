/* SPDX-License-Identifier: Apache-2.0 */
/* A local bus goes back to a state that was saved: the frames between the nodes of one thread, and
 * its wire. */
#include "canbus/wire/wire.h"

#include <linux/can/error.h>

#include "tests/unit/arena_fixture.h"
#include "tests/unit/canbus/numbered_frames.h"
#include "tests/unit/canbus/wire/wire_force.h"

static struct error error;

TEST_WITH(frames_between_own_nodes_go_back_and_others_stay, open_arena, close_arena)
{
    const struct local_bus_config config = {.name = "bus", .max_nodes = 3, .inbox = 16};
    struct can_port *own[2], *other;
    struct local_bus *bus;
    void *memory;

    assert_ok(local_bus_create(&config, &arena, &bus, &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[0], &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[1], &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &other, &error));
    memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
    send_numbered(own[0], 1);
    send_numbered(own[1], 2);
    send_numbered(own[0], 3);
    assert_true(local_bus_save(bus, 2, memory));
    assert_int_equal(take_numbers(own[1]), 13);
    assert_int_equal(take_numbers(own[0]), 2);
    send_numbered(own[0], 4);
    send_numbered(other, 5);
    local_bus_restore(bus, 2, memory);
    assert_int_equal(take_numbers(own[1]), 135); /* 4 was never sent, 5 is another's and waits */
    assert_int_equal(take_numbers(own[0]), 25);
    assert_int_equal(take_numbers(other), 1234); /* what has left stays */
    /* a second time, from the same copy */
    local_bus_restore(bus, 2, memory);
    assert_int_equal(take_numbers(own[1]), 13);
    for (int i = 0; i < 2; i++) {
        own[i]->ops->close(own[i]);
    }
    other->ops->close(other);
    local_bus_destroy(bus);
}

TEST_WITH(more_frames_than_a_copy_holds_are_refused, open_arena, close_arena)
{
    const struct local_bus_config config = {.name = "bus", .max_nodes = 2, .inbox = 4096};
    struct can_port *own[2];
    struct bus_frame frame;
    struct local_bus *bus;
    void *memory;

    assert_ok(local_bus_create(&config, &arena, &bus, &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[0], &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[1], &error));
    memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
    for (int i = 0; i < 2048; i++) {
        send_numbered(own[0], 1);
    }
    assert_true(local_bus_save(bus, 2, memory));
    local_bus_restore(bus, 2, memory);
    for (int i = 0; i < 2048; i++) {
        assert_int_equal(can_receive(own[1], &frame, 1), 1);
        assert_int_equal(frame.id, 1);
    }
    assert_int_equal(can_receive(own[1], &frame, 1), 0);
    local_bus_restore(bus, 2, memory);
    send_numbered(own[0], 1);
    assert_false(local_bus_save(bus, 2, memory));

    /* The same number in two lanes */
    assert_int_equal(can_receive(own[1], &frame, 1), 1);
    assert_true(local_bus_save(bus, 2, memory));
    send_numbered(own[1], 1);
    assert_false(local_bus_save(bus, 2, memory));
    own[0]->ops->close(own[0]);
    own[1]->ops->close(own[1]);
    local_bus_destroy(bus);
}

/* ---- with a wire ---- */

enum { MS = 1000000, BOARDS = 2, HOST = BOARDS, QUEUE = 4 };

/* A bus with a wire: two controllers of the boards' port, the host's, and another thread's. */
struct bench {
    struct local_bus *bus;
    struct can_port *boards, *host, *other;
};

static struct can_port *join(struct local_bus *bus, size_t nodes)
{
    struct can_port *port = NULL;

    assert_ok(local_bus_join(bus, nodes, NULL, 0, &port, &error));
    return port;
}

static struct bench open_wire(void)
{
    const struct local_bus_config config = {.name = "limb",
                                            .max_nodes = 3,
                                            .inbox = 64,
                                            .mode = LOCAL_BUS_WIRE,
                                            .wire_nodes = BOARDS + 2,
                                            .queue = QUEUE,
                                            .restart_delay_ns = 10 * MS};
    struct bench bench;

    assert_ok(local_bus_create(&config, &arena, &bench.bus, &error));
    bench.boards = join(bench.bus, BOARDS);
    bench.host = join(bench.bus, 1);
    bench.other = join(bench.bus, 1);
    return bench;
}

/* What a checkpoint keeps of a bus whose first two nodes are of its own thread. */
struct moment {
    void *of_bus, *of_wire;
};

static void save_again(const struct bench *bench, const struct moment *moment)
{
    size_t size;
    void *wire = wire_memory(local_bus_wire(bench->bus), &size);

    assert_true(local_bus_save(bench->bus, 2, moment->of_bus));
    memcpy(moment->of_wire, wire, size);
}

/* Saves, and looks that nothing is written behind what the bus asked for. */
static struct moment save(const struct bench *bench)
{
    enum { BEHIND = 1024 };
    const size_t asked = local_bus_save_size(bench->bus);
    struct moment moment;
    unsigned char *kept;
    size_t size;
    void *wire = wire_memory(local_bus_wire(bench->bus), &size);

    arena_join(wire, size); /* with the gaps between its pieces */
    moment.of_bus = kept = arena_alloc(&arena, 1, asked + BEHIND);
    moment.of_wire = arena_alloc(&arena, 1, size);
    memset(kept, 0xa5, asked + BEHIND);
    save_again(bench, &moment);
    for (size_t i = 0; i < BEHIND; i++) {
        assert_int_equal(kept[asked + i], 0xa5);
    }
    return moment;
}

static void restore(const struct bench *bench, const struct moment *moment)
{
    size_t size;
    void *wire = wire_memory(local_bus_wire(bench->bus), &size);

    memcpy(wire, moment->of_wire, size);
    local_bus_restore(bench->bus, 2, moment->of_bus);
}

TEST_WITH(a_frame_that_waits_for_the_wire_goes_over_it_again, open_arena, close_arena)
{
    struct bench bench = open_wire();
    struct moment moment;

    send_numbered(bench.host, 1);
    moment = save(&bench); /* before the wire has seen that anybody is there */
    for (int i = 0; i < 3; i++) {
        local_bus_advance(bench.bus, MS);
        assert_int_equal(take_numbers(bench.boards), 1);
        restore(&bench, &moment);
    }
    local_bus_destroy(bench.bus);
}

TEST_WITH(who_has_left_after_going_back_acknowledges_nothing, open_arena, close_arena)
{
    struct bench bench = open_wire();
    struct wire_node_stats stats;
    struct moment moment;

    local_bus_advance(bench.bus, MS);
    moment = save(&bench);
    local_bus_advance(bench.bus, 2 * MS);
    restore(&bench, &moment);
    bench.boards->ops->close(bench.boards);
    bench.other->ops->close(bench.other);
    send_numbered(bench.host, 1);
    local_bus_advance(bench.bus, 3 * MS);
    wire_node_stats(local_bus_wire(bench.bus), HOST, &stats);
    assert_int_equal(stats.confirmed, 0);
    local_bus_destroy(bench.bus);
}

/* Ten frames for a queue of four. */
static void overflow(const struct bench *bench, int64_t until_ns)
{
    for (uint32_t i = 0; i < 10; i++) {
        send_numbered(bench->host, 1 + i);
        send_numbered(bench->boards, 101 + i);
    }
    local_bus_advance(bench->bus, until_ns);
    take_numbers(bench->boards);
    take_numbers(bench->host);
    take_numbers(bench->other);
}

TEST_WITH(what_the_wire_drops_is_counted_again_after_going_back, open_arena, close_arena)
{
    struct bench bench = open_wire();
    struct moment moment, later;

    overflow(&bench, 10 * MS);
    moment = save(&bench);
    for (unsigned times = 1; times < 4; times++) {
        assert_int_equal(bench.host->counters.tx_dropped, 6 * times);
        assert_int_equal(bench.boards->counters.tx_dropped, 6 * times);
        restore(&bench, &moment);
        overflow(&bench, 20 * MS);
    }

    /* Also where the memory has held a later moment */
    later = save(&bench);
    restore(&bench, &moment);
    save_again(&bench, &later);
    restore(&bench, &later);
    overflow(&bench, 20 * MS);
    assert_int_equal(bench.host->counters.tx_dropped, 6 * 5);
    local_bus_destroy(bench.bus);
}

TEST_WITH(states_of_controllers_go_back_and_those_of_others_stay, open_arena, close_arena)
{
    struct bench bench = open_wire();
    struct wire *wire = local_bus_wire(bench.bus);
    struct moment up, half;

    local_bus_advance(bench.bus, MS);
    up = save(&bench);

    /* All of the boards' controllers, the host's and another's go off */
    wire_force_bus_off(wire, 0);
    local_bus_advance(bench.bus, 2 * MS);
    half = save(&bench);
    for (size_t node = 1; node < BOARDS + 2; node++) {
        wire_force_bus_off(wire, node);
    }
    local_bus_advance(bench.bus, 3 * MS);
    assert_int_equal(take_numbers(bench.boards), CAN_ERR_BUSOFF);
    assert_int_equal(take_numbers(bench.host), CAN_ERR_BUSOFF);
    assert_int_equal(take_numbers(bench.other), CAN_ERR_BUSOFF);
    assert_int_equal(bench.boards->state, CAN_PORT_BUS_OFF);
    restore(&bench, &up);
    assert_int_equal(bench.boards->state, CAN_PORT_UP);
    assert_int_equal(bench.host->state, CAN_PORT_UP);
    assert_int_equal(bench.other->state, CAN_PORT_BUS_OFF);

    /* With one of its controllers on the bus the port is; the other one takes it off, as it did */
    wire_force_bus_off(wire, 1);
    local_bus_advance(bench.bus, 3 * MS);
    take_numbers(bench.boards);
    assert_int_equal(bench.boards->state, CAN_PORT_UP);
    restore(&bench, &half);
    wire_force_bus_off(wire, 1);
    local_bus_advance(bench.bus, 3 * MS);
    assert_int_equal(take_numbers(bench.boards), CAN_ERR_BUSOFF);
    assert_int_equal(bench.boards->state, CAN_PORT_BUS_OFF);

    /* A port that is saved off the bus is told when its controllers are restarted */
    up = save(&bench);
    for (int i = 0; i < 2; i++) {
        local_bus_advance(bench.bus, 40 * MS);
        assert_true(take_numbers(bench.boards) & CAN_ERR_RESTARTED);
        assert_int_equal(bench.boards->state, CAN_PORT_UP);
        restore(&bench, &up);
        assert_int_equal(bench.boards->state, CAN_PORT_BUS_OFF);
    }
    local_bus_destroy(bench.bus);
}
