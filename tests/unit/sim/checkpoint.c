/* SPDX-License-Identifier: Apache-2.0 */
/* What going back and another pace are made of: copies with holes, frames on their way, the clock. */
#include "base/ring.h"
#include "canbus/port.h"
#include "canbus/wire/wire.h"
#include "sim/checkpoint.h"
#include "rt/pace.h"

#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static struct arena arena;

static int set_up(void **state)
{
    struct error error;

    (void)state;
    return arena_init(&arena, (size_t)64 << 20, &error);
}

static int tear_down(void **state)
{
    (void)state;
    arena_fini(&arena);
    return 0;
}

/* ---- copies ---- */

static void copies_come_back_around_their_holes(void **state)
{
    unsigned char memory[256], other[13];
    const struct span moving[] = {{memory, sizeof memory}, {other, sizeof other}};
    const struct span hole[] = {
        {memory + 100, 7}, {memory, 3}, {NULL, 0}, {memory + 250, 6}, {memory + 50, 1}};
    struct checkpoint *checkpoint;
    struct error error;

    (void)state;
    assert_int_equal(checkpoint_create(moving, 2, hole, 5, 2, &arena, &checkpoint, &error),
                     ERROR_NONE);
    assert_int_equal(checkpoint_size(checkpoint), 256 + 13 - 7 - 3 - 6 - 1);
    memset(memory, 1, sizeof memory);
    memset(other, 1, sizeof other);
    checkpoint_keep(checkpoint, 0);
    memset(memory, 2, sizeof memory);
    memset(other, 2, sizeof other);
    checkpoint_keep(checkpoint, 1);
    memset(memory, 3, sizeof memory);
    checkpoint_back(checkpoint, 0);
    for (size_t i = 0; i < sizeof memory; i++) {
        bool in_hole = i < 3 || i == 50 || (i >= 100 && i < 107) || i >= 250;

        assert_int_equal(memory[i], in_hole ? 3 : 1);
    }
    for (size_t i = 0; i < sizeof other; i++) {
        assert_int_equal(other[i], 1);
    }
    checkpoint_back(checkpoint, 1);
    assert_int_equal(memory[10], 2);
    assert_int_equal(other[12], 2);
}

static void no_memory_for_copies_is_an_error(void **state)
{
    unsigned char memory[64];
    const struct span moving = {memory, sizeof memory};
    struct checkpoint *checkpoint;
    struct error error;

    (void)state;
    assert_int_equal(
        checkpoint_create(&moving, 1, NULL, 0, (size_t)1 << 40, &arena, &checkpoint, &error),
        ERROR_MEMORY);
}

/* ---- frames on their way ---- */

static struct bus_frame numbered(uint32_t id)
{
    uint8_t data[8] = {0};

    return frame_make(id, 8, data);
}

static void send(struct can_port *port, uint32_t id)
{
    struct bus_frame frame = numbered(id);

    assert_int_equal(can_send(port, &frame, 1), 1);
}

/* the ids that wait, as decimal digits */
static unsigned waiting(struct can_port *port)
{
    struct bus_frame frame;
    unsigned ids = 0;

    while (can_receive(port, &frame, 1)) {
        ids = 10 * ids + frame.id;
    }
    return ids;
}

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
    send(own[0], 1);
    send(own[1], 2);
    send(own[0], 3);
    assert_true(local_bus_save(bus, 2, memory));
    assert_int_equal(waiting(own[1]), 13);
    assert_int_equal(waiting(own[0]), 2);
    send(own[0], 4);
    send(other, 5);
    local_bus_restore(bus, 2, memory);
    assert_int_equal(waiting(own[1]), 135); /* 4 was never sent, 5 is another's and waits */
    assert_int_equal(waiting(own[0]), 25);
    assert_int_equal(waiting(other), 1234); /* what has left stays */
    /* a second time, from the same copy */
    local_bus_restore(bus, 2, memory);
    assert_int_equal(waiting(own[1]), 13);
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
        send(own[0], 1);
    }
    assert_true(local_bus_save(bus, 2, memory));
    send(own[0], 1);
    assert_false(local_bus_save(bus, 2, memory));
    own[0]->ops->close(own[0]);
    own[1]->ops->close(own[1]);
    local_bus_destroy(bus);
}

/* A frame is on the wire, another waits in its queue, when time goes back. */
static void a_wire_goes_back_with_its_bus(void **state)
{
    const struct local_bus_config config = {
        .name = "bus", .max_nodes = 2, .inbox = 16, .mode = LOCAL_BUS_WIRE};
    struct can_port *own[2];
    struct local_bus *bus;
    struct checkpoint *wire;
    struct error error;
    struct span moving;
    void *memory;

    (void)state;
    assert_int_equal(local_bus_create(&config, &arena, &bus, &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[0], &error), ERROR_NONE);
    assert_int_equal(local_bus_join(bus, NULL, 0, &own[1], &error), ERROR_NONE);
    memory = arena_alloc(&arena, 1, local_bus_save_size(bus));
    moving.memory = wire_memory(local_bus_wire(bus), &moving.size);
    assert_int_equal(checkpoint_create(&moving, 1, NULL, 0, 1, &arena, &wire, &error), ERROR_NONE);
    local_bus_advance(bus, 1000000);
    send(own[0], 1);
    send(own[0], 2);
    local_bus_advance(bus, 1050000); /* the first is half across */
    send(own[0], 3);                 /* not yet taken over */
    assert_true(local_bus_save(bus, 2, memory));
    checkpoint_keep(wire, 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(waiting(own[1]), 0);
        local_bus_advance(bus, 1200000);
        assert_int_equal(waiting(own[1]), 1);
        local_bus_advance(bus, 2000000);
        assert_int_equal(waiting(own[1]), 23);
        assert_int_equal(wire_now(local_bus_wire(bus)), 2000000);
        checkpoint_back(wire, 0);
        local_bus_restore(bus, 2, memory);
    }
    own[0]->ops->close(own[0]);
    own[1]->ops->close(own[1]);
    local_bus_destroy(bus);
}

/* ---- the clock ---- */

struct scripted {
    struct clock clock;
    int64_t now;
    int sleeps;
    struct pace *pace;
    double rate; /* to be set in sleep number change_at */
    int change_at;
};

static int64_t scripted_now(struct clock *clock)
{
    return ((struct scripted *)clock)->now;
}

static void scripted_sleep(struct clock *clock, int64_t deadline)
{
    struct scripted *scripted = (struct scripted *)clock;

    scripted->now = deadline > scripted->now ? deadline : scripted->now;
    if (++scripted->sleeps == scripted->change_at) {
        pace_set(scripted->pace, scripted->rate);
    }
    assert_true(scripted->sleeps < 1000);
}

static const struct clock_ops scripted_ops = {scripted_now, scripted_sleep, NULL};

static struct clock *paced(struct scripted *scripted)
{
    struct error error;

    *scripted = (struct scripted){.clock = {&scripted_ops}, .now = 7000000000, .change_at = -1};
    assert_int_equal(pace_create(&scripted->clock, &arena, &scripted->pace, &error), ERROR_NONE);
    return pace_clock(scripted->pace);
}

static void a_clock_follows_its_pace(void **state)
{
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    (void)state;
    assert_int_equal(clock_now(clock), 7000000000);
    scripted.now += 1000;
    assert_int_equal(clock_now(clock), 7000001000);
    pace_set(scripted.pace, 0.25);
    scripted.now += 4000;
    assert_int_equal(clock_now(clock), 7000002000);
    pace_set(scripted.pace, 0.0);
    scripted.now += 1000000;
    assert_int_equal(clock_now(clock), 7000002000);
    pace_set(scripted.pace, 8.0);
    scripted.now += 1000;
    assert_int_equal(clock_now(clock), 7000010000);
}

static void a_sleeper_wakes_at_its_own_deadline(void **state)
{
    static const double rates[] = {0.01, 0.5, 1.0, 3.0, 1000.0};
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    (void)state;
    for (int i = 0; i < 5; i++) {
        int64_t begin = scripted.now, deadline;

        pace_set(scripted.pace, rates[i]);
        scripted.sleeps = 0;
        deadline = clock_now(clock) + CLOCK_MS;
        clock_sleep_until(clock, deadline);
        assert_true(clock_now(clock) >= deadline);
        assert_true((double)(scripted.now - begin) <= 1e6 / rates[i] + 5.0);
    }
}

static void a_sleeper_sleeps_on_while_the_clock_stands(void **state)
{
    struct scripted scripted;
    struct clock *clock = paced(&scripted);

    (void)state;
    pace_set(scripted.pace, 0.0);
    scripted.rate = 2.0;
    scripted.change_at = 100; /* of 5 ms each */
    clock_sleep_until(clock, clock_now(clock) + CLOCK_MS);
    assert_true(scripted.now - 7000000000 > 500 * CLOCK_MS);
    assert_true(scripted.now - 7000000000 < 502 * CLOCK_MS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(copies_come_back_around_their_holes, set_up, tear_down),
        cmocka_unit_test_setup_teardown(no_memory_for_copies_is_an_error, set_up, tear_down),
        cmocka_unit_test_setup_teardown(frames_between_own_nodes_go_back_and_others_stay, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(more_frames_than_a_copy_holds_are_refused, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_wire_goes_back_with_its_bus, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_clock_follows_its_pace, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_sleeper_wakes_at_its_own_deadline, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_sleeper_sleeps_on_while_the_clock_stands, set_up,
                                        tear_down),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
