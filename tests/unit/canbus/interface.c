/* SPDX-License-Identifier: Apache-2.0 */
/* Kinds, settings and states of CAN interfaces, as the kernel describes them. */
#include "canbus/interface.h"

#include "base/array.h"
#include "tests/test.h"

#include <net/if_arp.h>

static struct link_info described(uint16_t type, const char *kind)
{
    struct link_info info = {.type = type};

    strcpy(info.kind, kind);
    return info;
}

TEST(kinds_tell_who_can_be_set)
{
    static const struct {
        uint16_t type;
        const char *kind;
        enum interface_kind expected;
    } cases[] = {
        {ARPHRD_ETHER, "", INTERFACE_NOT_CAN},     {ARPHRD_ETHER, "can", INTERFACE_NOT_CAN},
        {ARPHRD_CAN, "can", INTERFACE_CONTROLLER}, {ARPHRD_CAN, "vcan", INTERFACE_VIRTUAL},
        {ARPHRD_CAN, "vxcan", INTERFACE_VIRTUAL},  {ARPHRD_CAN, "slcan", INTERFACE_OTHER},
        {ARPHRD_CAN, "", INTERFACE_OTHER},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        const struct link_info info = described(cases[i].type, cases[i].kind);

        assert_int_equal(interface_kind(&info), cases[i].expected);
    }
}

TEST(bit_rates_fit_within_half_a_percent)
{
    assert_true(interface_bitrate_fits(1000000, 1000000));
    assert_true(interface_bitrate_fits(995000, 1000000));
    assert_true(interface_bitrate_fits(1005000, 1000000));
    assert_false(interface_bitrate_fits(994999, 1000000));
    assert_false(interface_bitrate_fits(1005001, 1000000));
    assert_false(interface_bitrate_fits(0, 1000000));
}

TEST(a_controller_is_set_when_rate_sample_point_and_restart_are)
{
    struct interface_settings settings = {
        .bitrate = 500000, .sample_point = 0.75, .restart_ms = 100};
    struct link_info info = described(ARPHRD_CAN, "can");

    info.controller.timing.bitrate = 500000;
    info.controller.timing.sample_point = 750;
    info.controller.restart_ms = 100;
    assert_true(interface_is_set(&info, &settings));

    /* The controller comes within one of eight time quanta of a sample point */
    info.controller.timing.sample_point = 800;
    assert_true(interface_is_set(&info, &settings));
    info.controller.timing.sample_point = 820;
    assert_false(interface_is_set(&info, &settings));
    settings.sample_point = 0.0; /* any */
    assert_true(interface_is_set(&info, &settings));

    settings.restart_ms = 0;
    assert_false(interface_is_set(&info, &settings));
    settings.restart_ms = 100;
    settings.bitrate = 250000;
    assert_false(interface_is_set(&info, &settings));
}

TEST(a_port_has_the_state_of_a_controller_that_runs)
{
    static const enum can_port_state expected[] = {
        [CAN_STATE_ERROR_ACTIVE] = CAN_PORT_UP,
        [CAN_STATE_ERROR_WARNING] = CAN_PORT_WARNING,
        [CAN_STATE_ERROR_PASSIVE] = CAN_PORT_PASSIVE,
        [CAN_STATE_BUS_OFF] = CAN_PORT_BUS_OFF,
    };
    struct link_info info = described(ARPHRD_CAN, "can");
    enum can_port_state port;

    info.up = true;
    for (size_t i = 0; i < ARRAY_COUNT(expected); i++) {
        info.controller.state = (enum can_state)i;
        assert_true(interface_port_state(&info, &port));
        assert_int_equal(port, expected[i]);
    }
    info.controller.state = CAN_STATE_STOPPED;
    assert_false(interface_port_state(&info, &port));
    info.controller.state = CAN_STATE_SLEEPING;
    assert_false(interface_port_state(&info, &port));
    info.controller.state = CAN_STATE_ERROR_ACTIVE;
    info.up = false;
    assert_false(interface_port_state(&info, &port));
}

TEST(settings_out_of_range_are_refused_before_anything_is_asked)
{
    static const struct interface_settings wrong[] = {
        {.bitrate = 0},
        {.bitrate = 1000001},
        {.bitrate = 500000, .sample_point = 1.0},
        {.bitrate = 500000, .sample_point = -0.1},
        {.bitrate = 500000, .restart_ms = -1},
        {.bitrate = 500000, .restart_ms = 3600001},
    };
    struct error error;

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        assert_int_equal(interface_kernel.configure(NULL, "can99", &wrong[i], &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "interface can99: "));
    }
}
