/* SPDX-License-Identifier: Apache-2.0 */
/* Copies of memory with holes come back where they were, and so does the wire of a bus. */
#include "sim/checkpoint.h"

#include "base/ring.h"
#include "canbus/port.h"
#include "canbus/wire/wire.h"

#include "tests/unit/arena_fixture.h"
#include "tests/unit/canbus/numbered_frames.h"
#include "tests/unit/canbus/wire/wire_force.h"

TEST_WITH(copies_come_back_around_their_holes, open_arena, close_arena)
{
    unsigned char memory[256], other[13];
    const struct span moving[] = {{memory, sizeof memory}, {other, sizeof other}};
    const struct span hole[] = {
        {memory + 100, 7}, {memory, 3}, {NULL, 0}, {memory + 250, 6}, {memory + 50, 1}};
    struct checkpoint *checkpoint;
    struct error error;

    assert_ok(checkpoint_create(moving, 2, hole, 5, 2, &arena, &checkpoint, &error));
    memset(memory, 1, sizeof memory);
    memset(other, 1, sizeof other);
    checkpoint_save(checkpoint, 0);
    memset(memory, 2, sizeof memory);
    memset(other, 2, sizeof other);
    checkpoint_save(checkpoint, 1);
    memset(memory, 3, sizeof memory);
    checkpoint_restore(checkpoint, 0);
    for (size_t i = 0; i < sizeof memory; i++) {
        bool in_hole = i < 3 || i == 50 || (i >= 100 && i < 107) || i >= 250;

        assert_int_equal(memory[i], in_hole ? 3 : 1);
    }
    for (size_t i = 0; i < sizeof other; i++) {
        assert_int_equal(other[i], 1);
    }
    checkpoint_restore(checkpoint, 1);
    assert_int_equal(memory[10], 2);
    assert_int_equal(other[12], 2);
}

TEST_WITH(no_memory_for_copies_is_an_error, open_arena, close_arena)
{
    unsigned char memory[64];
    const struct span moving = {memory, sizeof memory};
    struct checkpoint *checkpoint;
    struct error error;

    assert_int_equal(
        checkpoint_create(&moving, 1, NULL, 0, (size_t)1 << 40, &arena, &checkpoint, &error),
        ERROR_MEMORY);
}

/* A frame is on the wire, another waits in its queue, when time goes back. */
TEST_WITH(a_wire_goes_back_with_its_bus, open_arena, close_arena)
{
    const struct local_bus_config config = {
        .name = "bus", .max_nodes = 2, .inbox = 16, .mode = LOCAL_BUS_WIRE};
    struct can_port *own[2];
    struct local_bus *bus;
    struct checkpoint *wire;
    struct error error;
    struct span moving;
    void *memory;

    assert_ok(local_bus_create(&config, &arena, &bus, &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[0], &error));
    assert_ok(local_bus_join(bus, 1, NULL, 0, &own[1], &error));
    memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
    moving.memory = wire_memory(local_bus_wire(bus), &moving.size);
    assert_ok(checkpoint_create(&moving, 1, NULL, 0, 1, &arena, &wire, &error));
    local_bus_advance(bus, 1000000);
    send_numbered(own[0], 1);
    send_numbered(own[0], 2);
    local_bus_advance(bus, 1050000); /* the first is half across */
    send_numbered(own[0], 3);        /* not yet taken over */
    assert_true(local_bus_save(bus, 2, memory));
    checkpoint_save(wire, 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(take_numbers(own[1]), 0);
        local_bus_advance(bus, 1200000);
        assert_int_equal(take_numbers(own[1]), 1);
        local_bus_advance(bus, 2000000);
        assert_int_equal(take_numbers(own[1]), 23);
        assert_int_equal(wire_now(local_bus_wire(bus)), 2000000);
        checkpoint_restore(wire, 0);
        local_bus_restore(bus, 2, memory);
    }
    own[0]->ops->close(own[0]);
    own[1]->ops->close(own[1]);
    local_bus_destroy(bus);
}

/* A client that has left meanwhile is not there again: nobody acknowledges what is sent. One that
 * was not there yet is. */
TEST_WITH(who_is_on_a_wire_does_not_go_back, open_arena, close_arena)
{
    const struct local_bus_config config = {
        .name = "bus", .max_nodes = 2, .inbox = 16, .mode = LOCAL_BUS_WIRE};

    for (int stays = 0; stays < 2; stays++) {
        struct can_port *own, *client;
        struct local_bus *bus;
        struct checkpoint *wire;
        struct error error;
        struct span moving;
        struct wire_stats stats;
        void *memory;

        assert_ok(local_bus_create(&config, &arena, &bus, &error));
        assert_ok(local_bus_join(bus, 1, NULL, 0, &own, &error));
        memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
        moving.memory = wire_memory(local_bus_wire(bus), &moving.size);
        assert_ok(checkpoint_create(&moving, 1, NULL, 0, 1, &arena, &wire, &error));
        for (int step = 0; step < 2; step++) {
            local_bus_advance(bus, (step + 1) * INT64_C(1000000));
            if (step == stays) { /* before the copy, or after it */
                assert_ok(local_bus_join(bus, 1, NULL, 0, &client, &error));
            }
            if (step == 0) {
                local_bus_advance(bus, 1500000);
                assert_true(local_bus_save(bus, 1, memory));
                checkpoint_save(wire, 0);
            }
        }
        if (stays == 0) {
            client->ops->close(client);
        }
        local_bus_advance(bus, 3000000);
        checkpoint_restore(wire, 0);
        local_bus_restore(bus, 1, memory);
        send_numbered(own, 1);
        local_bus_advance(bus, 4000000);
        wire_stats(local_bus_wire(bus), &stats);
        assert_int_equal(stats.frames, stays);
        assert_int_equal(stats.errors[WIRE_ACK_ERROR] == 0, stays);
        if (stays == 1) {
            assert_int_equal(take_numbers(client), 1);
            client->ops->close(client);
        }
        own->ops->close(own);
        local_bus_destroy(bus);
    }
}
