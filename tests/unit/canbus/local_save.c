/* SPDX-License-Identifier: Apache-2.0 */
/* A local bus goes back to a state that was saved: the frames between the nodes of one thread, and
 * its wire. */
#include "canbus/port.h"

#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "tests/unit/arena_fixture.h"
#include "tests/unit/canbus/numbered_frames.h"

static void frames_between_own_nodes_go_back_and_others_stay(void **state)
{
    const struct local_bus_config config = {.name = "bus", .max_nodes = 3, .inbox = 16};
    struct can_port *own[2], *other;
    struct local_bus *bus;
    struct error error;
    void *memory;

    (void)state;
    assert_int_equal(local_bus_create(&config, &arena, &bus, &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[0], &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[1], &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &other, &error), ERROR_NONE);
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

static void more_frames_than_a_copy_holds_are_refused(void **state)
{
    const struct local_bus_config config = {.name = "bus", .max_nodes = 2, .inbox = 4096};
    struct can_port *own[2];
    struct local_bus *bus;
    struct error error;
    void *memory;

    (void)state;
    assert_int_equal(local_bus_create(&config, &arena, &bus, &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[0], &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[1], &error), ERROR_NONE);
    memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
    for (int i = 0; i < 2048; i++) {
        send_numbered(own[0], 1);
    }
    assert_true(local_bus_save(bus, 2, memory));
    send_numbered(own[0], 1);
    assert_false(local_bus_save(bus, 2, memory));
    own[0]->ops->close(own[0]);
    own[1]->ops->close(own[1]);
    local_bus_destroy(bus);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(frames_between_own_nodes_go_back_and_others_stay,
                                        open_arena, close_arena),
        cmocka_unit_test_setup_teardown(more_frames_than_a_copy_holds_are_refused, open_arena,
                                        close_arena),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
