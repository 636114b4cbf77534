/* SPDX-License-Identifier: Apache-2.0 */
/* A bad bus between two nodes of a local one: each rule does what it says while it is active and
 * nothing before, beside and after. */
#include "canbus/fault_port.h"

#include "base/array.h"
#include "tests/test.h"

static struct error error;

enum { INBOX = 16384, STEP_ID = 0x6f0, DONE_ID = 0x6ff, MS = 1000000 };

struct bench {
    struct arena arena;
    struct local_bus *bus;
    struct can_port *near, *far; /* the far one is plain */
    bool active;
    struct fault_port_rule rule;
    struct bus_frame frame[8192];
};

static inline void set_up(struct bench *bench)
{
    const struct local_bus_config config = {.name = "limb", .max_nodes = 2, .inbox = INBOX};

    assert_ok(arena_init(&bench->arena, 64 << 20, &error));
    assert_ok(local_bus_create(&config, &bench->arena, &bench->bus, &error));
    assert_ok(local_bus_join(bench->bus, 1, NULL, 0, &bench->near, &error));
    assert_ok(local_bus_join(bench->bus, 1, NULL, 0, &bench->far, &error));
}

static inline void tear_down(struct bench *bench)
{
    bench->near->ops->close(bench->near);
    bench->far->ops->close(bench->far);
    local_bus_destroy(bench->bus);
    arena_fini(&bench->arena);
}

static void spoil(struct bench *bench, struct fault_port_rule rule, uint64_t seed)
{
    struct fault_port_config config = {.port = bench->near,
                                       .rule = &bench->rule,
                                       .nrule = 1,
                                       .exempt = {STEP_ID, DONE_ID},
                                       .nexempt = 2,
                                       .seed = seed};

    bench->rule = rule;
    bench->rule.active = &bench->active;
    bench->rule.stream = "1";
    assert_ok(fault_port_create(&config, &bench->arena, &bench->near, &error));
}

static void send(struct can_port *port, uint32_t id, unsigned first, unsigned count)
{
    for (unsigned i = first; i < first + count; i++) {
        const uint8_t data[2] = {(uint8_t)i, (uint8_t)(i >> 8)};
        struct bus_frame frame = frame_make(id, 2, data);

        assert_int_equal(can_send(port, &frame, 1), 1);
    }
}

static size_t receive(struct bench *bench, struct can_port *port)
{
    return can_receive(port, bench->frame, ARRAY_COUNT(bench->frame));
}

static unsigned number(const struct bus_frame *frame)
{
    return get_u16_le(frame->data);
}

/* Frames numbered from 0 to count - 1, each once, in order. */
static void assert_all(const struct bench *bench, size_t found, size_t count)
{
    assert_int_equal(found, count);
    for (size_t i = 0; i < count; i++) {
        assert_int_equal(number(&bench->frame[i]), i);
    }
}

BENCH(set_up, struct bench, tear_down)

TEST_ON(lost_frames_are_the_share_asked_for_in_both_directions, set_up, bench)
{
    const double n = 8000, p = 0.1, bound = 5.0 * sqrt(n * p * (1.0 - p));

    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_LOSS, .probability = p, .id = -1}, 1);
    send(bench->far, 0x101, 0, 8000);
    assert_true(fabs((double)receive(bench, bench->near) - n * (1.0 - p)) < bound);
    send(bench->near, 0x101, 0, 8000);
    assert_true(fabs((double)receive(bench, bench->far) - n * (1.0 - p)) < bound);
    assert_int_equal(bench->near->counters.rx_dropped, 0); /* no news of the port */
}

TEST_ON(corrupted_frames_differ_in_one_bit_of_their_data, set_up, bench)
{
    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_CORRUPTION, .probability = 1.0, .id = -1}, 1);
    send(bench->far, 0x101, 0, 500);
    assert_int_equal(receive(bench, bench->near), 500);
    for (unsigned i = 0; i < 500; i++) {
        assert_int_equal(bench->frame[i].id, 0x101);
        assert_int_equal(bench->frame[i].len, 2);
        assert_int_equal(__builtin_popcount(number(&bench->frame[i]) ^ i), 1);
    }
}

TEST_ON(frames_without_data_cannot_be_corrupted, set_up, bench)
{
    struct bus_frame frame = frame_make(0x101, 0, NULL);

    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_CORRUPTION, .probability = 1.0, .id = -1}, 1);
    assert_int_equal(can_send(bench->far, &frame, 1), 1);
    assert_int_equal(receive(bench, bench->near), 1);
    assert_int_equal(bench->frame[0].len, 0);
}

TEST_ON(duplicates_follow_their_frame_also_through_small_batches, set_up, bench)
{
    size_t count = 0, got;

    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_DUPLICATE, .probability = 1.0, .id = -1}, 1);
    send(bench->far, 0x101, 0, 99);
    do {
        got = can_receive(bench->near, bench->frame + count, 7);
        count += got;
    } while (got == 7);
    assert_int_equal(count, 198);
    for (size_t i = 0; i < count; i++) {
        assert_int_equal(number(&bench->frame[i]), i / 2);
    }
    send(bench->near, 0x101, 0, 99);
    assert_int_equal(receive(bench, bench->far), 198);
}

TEST_ON(late_frames_come_after_their_delay_and_in_order, set_up, bench)
{
    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_LATE, .delay_ns = 3 * MS, .id = -1}, 1);
    for (unsigned ms = 0; ms < 20; ms++) {
        fault_port_time(bench->near, (int64_t)ms * MS);
        send(bench->far, 0x101, ms, 1);
        send(bench->near, 0x102, ms, 1);
        assert_int_equal(receive(bench, bench->near), ms >= 3);
        if (ms >= 3) {
            assert_int_equal(number(&bench->frame[0]), ms - 3);
        }
        assert_int_equal(receive(bench, bench->far), ms >= 3);
        if (ms >= 3) {
            assert_int_equal(number(&bench->frame[0]), ms - 3);
        }
    }
    bench->active = false; /* what is on its way still arrives */
    fault_port_time(bench->near, 30 * (int64_t)MS);
    assert_int_equal(receive(bench, bench->near), 3);
}

TEST_ON(more_late_frames_than_can_wait_are_counted_as_dropped, set_up, bench)
{
    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_LATE, .delay_ns = MS, .id = -1}, 1);
    send(bench->far, 0x101, 0, FAULT_PORT_HELD + 10);
    assert_int_equal(receive(bench, bench->near), 0);
    assert_int_equal(bench->near->counters.rx_dropped, 10);
}

TEST_ON(bus_off_carries_nothing_and_says_so, set_up, bench)
{
    struct bus_frame frame = frame_make(0x101, 0, NULL);

    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_BUS_OFF, .id = -1}, 1);
    send(bench->far, 0x101, 0, 10);
    assert_int_equal(receive(bench, bench->near), 0);
    assert_int_equal(bench->near->state, CAN_PORT_BUS_OFF);
    assert_int_equal(can_send(bench->near, &frame, 1), 0);
    assert_int_equal(bench->near->counters.tx_dropped, 1);
    assert_int_equal(receive(bench, bench->far), 0);
    bench->active = false;
    send(bench->far, 0x101, 0, 10);
    assert_all(bench, receive(bench, bench->near), 10);
    assert_int_equal(bench->near->state, CAN_PORT_UP);
}

TEST_ON(lockstep_frames_pass_unless_a_rule_names_them, set_up, bench)
{
    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_LOSS, .probability = 1.0, .id = -1}, 1);
    send(bench->far, STEP_ID, 0, 5);
    send(bench->far, 0x101, 0, 5);
    assert_int_equal(receive(bench, bench->near), 5);
    bench->rule.id = STEP_ID;
    spoil(bench, bench->rule, 1);
    send(bench->far, STEP_ID, 0, 5);
    send(bench->far, DONE_ID, 0, 5);
    assert_int_equal(receive(bench, bench->near), 5);
    assert_int_equal(bench->frame[0].id, DONE_ID);
}

TEST_ON(lockstep_frames_pass_even_when_the_bus_is_off, set_up, bench)
{
    struct bus_frame frames[2] = {frame_make(0x101, 0, NULL), frame_make(DONE_ID, 0, NULL)};

    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_BUS_OFF, .id = -1}, 1);
    send(bench->far, 0x101, 0, 5);
    send(bench->far, STEP_ID, 0, 5);
    assert_int_equal(receive(bench, bench->near), 5);
    assert_int_equal(bench->frame[0].id, STEP_ID);
    assert_int_equal(can_send(bench->near, frames, 2), 1);
    assert_int_equal(bench->near->counters.tx_dropped, 1);
    assert_int_equal(receive(bench, bench->far), 1);
    assert_int_equal(bench->frame[0].id, DONE_ID);
}

TEST_ON(rule_with_an_id_leaves_the_others_alone, set_up, bench)
{
    bench->active = true;
    spoil(bench, (struct fault_port_rule){FAULT_PORT_LOSS, .probability = 1.0, .id = 0x102}, 1);
    send(bench->near, 0x102, 0, 5);
    send(bench->near, 0x101, 0, 5);
    assert_all(bench, receive(bench, bench->far), 5);
    assert_int_equal(bench->frame[0].id, 0x101);
}

/* ---- several rules, and none ---- */

static void spoil_by(struct bench *bench, struct fault_port_rule *rule, size_t count)
{
    const struct fault_port_config config = {.port = bench->near, .rule = rule, .nrule = count};

    bench->active = true;
    for (size_t i = 0; i < count; i++) {
        rule[i].active = &bench->active;
        rule[i].stream = "1";
    }
    assert_ok(fault_port_create(&config, &bench->arena, &bench->near, &error));
}

TEST_ON(each_rule_acts_on_the_frames_of_its_id, set_up, bench)
{
    struct fault_port_rule rule[] = {{FAULT_PORT_LOSS, .probability = 1.0, .id = 0},
                                     {FAULT_PORT_DUPLICATE, .probability = 1.0, .id = 0x101},
                                     {FAULT_PORT_LOSS, .probability = 1.0, .id = 0x102}};

    spoil_by(bench, rule, ARRAY_COUNT(rule));
    for (uint32_t id = 0; id <= 3; id++) {
        send(bench->far, id ? 0x100 + id : 0, id, 1);
        send(bench->near, id ? 0x100 + id : 0, id, 1);
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(receive(bench, i ? bench->near : bench->far), 3);
        assert_int_equal(bench->frame[0].id, 0x101);
        assert_int_equal(bench->frame[1].id, 0x101);
        assert_int_equal(bench->frame[2].id, 0x103);
    }
}

TEST_ON(delays_of_two_rules_add_up, set_up, bench)
{
    struct fault_port_rule rule[] = {{FAULT_PORT_LATE, .delay_ns = MS, .id = -1},
                                     {FAULT_PORT_LATE, .delay_ns = 2 * MS, .id = -1}};

    spoil_by(bench, rule, ARRAY_COUNT(rule));
    send(bench->far, 0x101, 0, 1);
    for (int64_t ns = 0; ns < 3 * MS; ns += MS - 1) {
        fault_port_time(bench->near, ns);
        assert_int_equal(receive(bench, bench->near), 0);
    }
    fault_port_time(bench->near, 3 * MS);
    assert_int_equal(receive(bench, bench->near), 1);
}

TEST_ON(any_rule_may_switch_the_bus_off, set_up, bench)
{
    struct fault_port_rule rule[] = {{FAULT_PORT_LOSS, .probability = 0.0, .id = -1},
                                     {FAULT_PORT_BUS_OFF, .id = -1}};

    spoil_by(bench, rule, ARRAY_COUNT(rule));
    send(bench->far, 0x101, 0, 5);
    assert_int_equal(receive(bench, bench->near), 0);
    assert_int_equal(bench->near->state, CAN_PORT_BUS_OFF);
}

TEST_ON(without_rules_it_is_a_port, set_up, bench)
{
    struct fault_port_rule none;

    spoil_by(bench, &none, 0);
    send(bench->far, 0x101, 0, 100);
    assert_all(bench, receive(bench, bench->near), 100);
    send(bench->near, 0x101, 0, 100);
    assert_all(bench, receive(bench, bench->far), 100);
}
