/* SPDX-License-Identifier: Apache-2.0 */
/* The listener of the soak notices what breaks the rules of lockstep. */
#include "base/hash.h"
#include "boards/icub/protocol.h"
#include "canbus/lockstep.h"
#include "tests/soak/listener.h"
#include "tests/test.h"

#include <string.h>

enum { BUSES = 2 };

struct bench {
    struct arena arena;
    struct local_bus *bus[BUSES];
    struct can_port *port[BUSES]; /* of whoever sends */
    struct rig rig;
    struct listener listener;
};

FIXTURE(set_up)
{
    static const struct rig_bus names[BUSES] = {{.name = "torso"}, {.name = "arm"}};
    static struct bench bench;
    struct error error;

    memset(&bench, 0, sizeof bench);
    assert_int_equal(arena_init(&bench.arena, 16 << 20, &error), ERROR_NONE);
    bench.rig.nbus = BUSES;
    bench.rig.bus = names;
    bench.rig.lockstep =
        (struct loop_lockstep){.step_id = LOCKSTEP_STEP_ID, .done_id = LOCKSTEP_DONE_ID};
    bench.listener.rig = &bench.rig;
    bench.listener.ports.count = BUSES;
    for (int b = 0; b < BUSES; b++) {
        const struct local_bus_config config = {
            .name = names[b].name, .max_nodes = 2, .inbox = 1024};

        assert_int_equal(local_bus_create(&config, &bench.arena, &bench.bus[b], &error),
                         ERROR_NONE);
        assert_int_equal(local_bus_join(bench.bus[b], NULL, 0, &bench.port[b], &error), ERROR_NONE);
        assert_int_equal(
            local_bus_join(bench.bus[b], NULL, 0, &bench.listener.ports.port[b], &error),
            ERROR_NONE);
    }
    *test_state = &bench;
    return 0;
}

FIXTURE(tear_down)
{
    struct bench *bench = *test_state;

    for (int b = 0; b < BUSES; b++) {
        bench->port[b]->ops->close(bench->port[b]);
    }
    bus_ports_close(&bench->listener.ports);
    for (int b = 0; b < BUSES; b++) {
        local_bus_destroy(bench->bus[b]);
    }
    arena_fini(&bench->arena);
    return 0;
}

static void send(struct bench *bench, int bus, uint32_t id, uint32_t tick, uint16_t last)
{
    uint8_t data[LOCKSTEP_LENGTH];
    struct bus_frame frame;

    put_u32_le(data, tick);
    put_u16_le(data + 4, last);
    frame = frame_make(id, LOCKSTEP_LENGTH, data);
    assert_int_equal(can_send(bench->port[bus], &frame, 1), 1);
}

static void ask(struct bench *bench, uint32_t tick, uint16_t ticks)
{
    send(bench, 0, LOCKSTEP_STEP_ID, tick, ticks);
}

static void answer(struct bench *bench, uint32_t tick, uint16_t flags)
{
    for (int b = 0; b < BUSES; b++) {
        send(bench, b, LOCKSTEP_DONE_ID, tick, flags);
    }
}

TEST_WITH(right_answers_pass, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 1);
    answer(bench, 1, LOCKSTEP_FAULT);
    ask(bench, 1, 5);
    ask(bench, 7, 1); /* waits until those five have run, and is refused then */
    answer(bench, 6, 0);
    answer(bench, 6, LOCKSTEP_MISMATCH);
    assert_true(listener_check(&bench->listener, true));
    assert_int_equal(bench->listener.tick, 6);
    assert_int_equal(bench->listener.steps, 2);
    assert_int_equal(bench->listener.refused, 1);
}

TEST_WITH(done_that_nobody_asked_for_is_noticed, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 1);
    answer(bench, 1, 0);
    answer(bench, 1, 0);
    assert_false(listener_check(&bench->listener, true));
    assert_non_null(strstr(bench->listener.failure, "no STEP"));
}

TEST_WITH(done_of_another_tick_is_noticed, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 2);
    answer(bench, 1, 0);
    assert_false(listener_check(&bench->listener, true));
    assert_non_null(strstr(bench->listener.failure, "expected tick 2"));
}

TEST_WITH(refusal_of_a_right_step_is_noticed, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 1);
    answer(bench, 1, LOCKSTEP_MISMATCH);
    assert_false(listener_check(&bench->listener, true));
}

TEST_WITH(step_without_an_answer_is_noticed, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 1);
    assert_true(listener_check(&bench->listener, false)); /* it may still come */
    assert_false(listener_check(&bench->listener, true));
    assert_non_null(strstr(bench->listener.failure, "without an answer"));
}

TEST_WITH(bus_without_its_done_is_noticed, set_up, tear_down)
{
    struct bench *bench = *test_state;

    ask(bench, 0, 1);
    send(bench, 0, LOCKSTEP_DONE_ID, 1, 0);
    assert_false(listener_check(&bench->listener, true));
    assert_non_null(strstr(bench->listener.failure, "bus arm had 0 DONE"));
}

TEST_WITH(hash_tells_one_bit_of_one_frame, set_up, tear_down)
{
    struct bench *bench = *test_state;
    uint64_t hash[2];

    for (unsigned i = 0; i < 2; i++) {
        bench->listener.hash = HASH_START;
        send(bench, 1, 0x123, i, 0);
        assert_true(listener_check(&bench->listener, true));
        hash[i] = bench->listener.hash;
    }
    assert_int_not_equal(hash[0], hash[1]);
    assert_int_equal(bench->listener.frames[1], 2);
}
