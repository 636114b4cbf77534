/* SPDX-License-Identifier: Apache-2.0 */
/* Opening a rig's buses: what --bus may say, and local buses that carry frames both ways. */
#include "sim/buses.h"

#include "tests/unit/arena_fixture.h"

static const struct rig_bus rig_buses[] = {
    {.name = "torso", .interface = "can0", .bitrate = 1000000},
    {.name = "left_leg", .interface = "can1", .bitrate = 1000000},
};

static const struct rig rig = {.file = "rig.yaml", .nbus = 2, .bus = rig_buses};

TEST_WITH(wrong_overrides_are_refused_with_what_was_expected, open_arena, close_arena)
{
    static const struct {
        const char *item[2], *message;
    } cases[] = {
        {{"torso"}, "expected NAME=INTERFACE"},
        {{"=can3"}, "expected NAME=INTERFACE"},
        {{"torso="}, "expected NAME=INTERFACE"},
        {{"lef_leg=can3"}, "did you mean \"left_leg\""},
        {{"qqqqqqqqq=can3"}, "expected one of torso, left_leg"},
        {{"torso=interface-name-16"}, "at most 15"},
        {{"torso=can1"}, "both on interface can1"},
        {{"torso=can5", "left_leg=can5"}, "both on interface can5"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct error error = {0};
        struct buses buses;
        char notice[256];

        assert_int_equal(buses_open(&rig, TRANSPORT_LOCAL, cases[i].item, cases[i].item[1] ? 2 : 1,
                                    1, true, &arena, &buses, notice, &error),
                         ERROR_INPUT);
        assert_non_null(strstr(error.text, cases[i].message));
    }
}

TEST_WITH(local_buses_bear_the_interface_names_and_carry_frames, open_arena, close_arena)
{
    const char *item[] = {"left_leg=vcan7"};
    struct bus_ports simulator CLOSED_BY(bus_ports_close), task CLOSED_BY(bus_ports_close);
    struct bus_frame frame = frame_make(0x123, 2, (const uint8_t[]){1, 2}), found;
    struct buses buses CLOSED_BY(buses_close);
    struct error error;
    char notice[256];

    assert_ok(buses_open(&rig, TRANSPORT_LOCAL, item, 1, 1, true, &arena, &buses, notice, &error));
    assert_string_equal(notice, "");
    assert_true(buses.local);
    assert_ok(buses_join(&buses, &arena, &simulator, &error));
    assert_ok(buses_join(&buses, &arena, &task, &error));
    assert_string_equal(simulator.port[0]->bus, "can0");
    assert_string_equal(simulator.port[1]->bus, "vcan7");
    assert_int_equal(can_send(task.port[1], &frame, 1), 1);
    assert_int_equal(can_receive(simulator.port[0], &found, 1), 0);
    assert_int_equal(can_receive(simulator.port[1], &found, 1), 1);
    assert_int_equal(found.id, 0x123);
}

/* What one side sends needs its time on the wire; the boards' side stands for as many controllers
 * as there are boards. */
TEST_WITH(timed_local_buses_deliver_when_they_are_advanced, open_arena, close_arena)
{
    static const struct rig_bus timed_buses[] = {
        {.name = "arm", .interface = "can0", .bitrate = 1000000, .nboard = 3}};
    static const struct rig timed = {.file = "rig.yaml",
                                     .nbus = 1,
                                     .bus = timed_buses,
                                     .wire = {.timed = true},
                                     .lockstep = {.step_id = 0x6f0, .done_id = 0x6ff}};
    struct bus_frame frame = frame_make(0x123, 2, (const uint8_t[]){1, 2}), found;
    struct bus_ports simulator CLOSED_BY(bus_ports_close), task CLOSED_BY(bus_ports_close);
    struct buses buses CLOSED_BY(buses_close);
    struct error error;
    char notice[256];

    assert_ok(
        buses_open(&timed, TRANSPORT_LOCAL, NULL, 0, 1, true, &arena, &buses, notice, &error));
    assert_true(buses.timed);
    assert_non_null(buses.wire[0]);
    assert_ok(buses_join_boards(&buses, &arena, &simulator, &error));
    assert_ok(buses_join(&buses, &arena, &task, &error));
    frame.node = 2;
    assert_int_equal(can_send(simulator.port[0], &frame, 1), 1);
    assert_int_equal(can_receive(task.port[0], &found, 1), 0);
    buses_advance(&buses, 0, 1000000);
    assert_int_equal(can_receive(task.port[0], &found, 1), 1);
    assert_true(found.time_ns > 60000 && found.time_ns < 80000);
}

TEST_WITH(without_can_auto_is_local_and_says_so, open_arena, close_arena)
{
    struct buses buses CLOSED_BY(buses_close);
    struct error error;
    char notice[256];

    assert_ok(buses_open(&rig, TRANSPORT_AUTO, NULL, 0, 1, true, &arena, &buses, notice, &error));
    assert_int_equal(buses.local, !socketcan_available());
    assert_int_equal(notice[0] != '\0', !socketcan_available());
}

TEST_WITH(a_named_interface_is_never_replaced_by_a_local_bus, open_arena, close_arena)
{
    const char *item[] = {"torso=no-such-if"};
    struct bus_ports ports;
    struct buses buses CLOSED_BY(buses_close);
    struct error error;
    char notice[256];

    assert_ok(buses_open(&rig, TRANSPORT_AUTO, item, 1, 1, true, &arena, &buses, notice, &error));
    assert_int_not_equal(buses_join(&buses, &arena, &ports, &error), ERROR_NONE);
    assert_int_equal(ports.count, 0);
    assert_non_null(strstr(error.text, "bus torso"));
}

/* One simulator after the other on an interface is as usual; a second one beside it is told. */
TEST(a_second_simulator_on_an_interface_is_told)
{
    struct buses first = {.rig = &rig, .interface = {"claim-a", "claim-b"}};
    struct buses second = {.rig = &rig, .interface = {"claim-b", "claim-c"}};
    char notice[256];

    for (int i = 0; i < 2; i++) {
        buses_claim(&first, notice);
        assert_string_equal(notice, "");
        buses_claim(&second, notice);
        assert_non_null(strstr(notice, "claim-b: another coman-hil plays boards there too"));
        assert_null(strstr(notice, "claim-c"));
        buses_close(&second);
        buses_close(&first);
    }
}
