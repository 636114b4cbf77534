/* SPDX-License-Identifier: Apache-2.0 */
/* What every port counts, and the state that error frames give it. */
#include "canbus/port_private.h"

#include "tests/test.h"

static struct bus_frame error_frame(uint32_t class, uint8_t controller)
{
    return (struct bus_frame){.id = class, .flags = FRAME_ERROR, .len = 8, .data = {0, controller}};
}

TEST(error_frames_move_the_state)
{
    static const struct {
        enum can_port_state before;
        uint32_t class;
        uint8_t controller;
        enum can_port_state after;
    } cases[] = {
        {CAN_PORT_UP, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING, CAN_PORT_WARNING},
        {CAN_PORT_UP, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CAN_PORT_PASSIVE},
        {CAN_PORT_PASSIVE, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, CAN_PORT_WARNING},
        {CAN_PORT_PASSIVE, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CAN_PORT_UP},
        {CAN_PORT_UP, CAN_ERR_BUSOFF, 0, CAN_PORT_BUS_OFF},
        {CAN_PORT_BUS_OFF, CAN_ERR_RESTARTED, 0, CAN_PORT_UP},
        {CAN_PORT_WARNING, CAN_ERR_ACK, 0, CAN_PORT_WARNING},
        /* Of a stuck queue the error states are the cause */
        {CAN_PORT_STUCK, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CAN_PORT_STUCK},
        {CAN_PORT_STUCK, CAN_ERR_BUSOFF, 0, CAN_PORT_BUS_OFF},
        /* A lost interface stays lost, whatever was still queued */
        {CAN_PORT_DOWN, CAN_ERR_RESTARTED, 0, CAN_PORT_DOWN},
        {CAN_PORT_GONE, CAN_ERR_BUSOFF, 0, CAN_PORT_GONE},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        const struct bus_frame frame = error_frame(cases[i].class, cases[i].controller);
        struct can_port port = {.state = cases[i].before};

        port_count_received(&port, &frame);
        if (port.state != cases[i].after) {
            fail_msg("case %zu: %s, expected %s", i, can_port_state_name(port.state),
                     can_port_state_name(cases[i].after));
        }
        assert_int_equal(port.counters.error_frames, 1);
        assert_int_equal(port.counters.rx_frames, 0);
    }
}

TEST(a_short_error_frame_says_nothing_of_the_controller)
{
    struct bus_frame frame = error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
    struct can_port port = {.state = CAN_PORT_UP};

    frame.len = 1;
    port_count_received(&port, &frame);
    assert_int_equal(port.state, CAN_PORT_UP);
}

TEST(frames_are_counted_with_their_bits)
{
    const struct bus_frame classic = frame_make(1, 8, (const uint8_t[8]){0});
    const struct bus_frame fast = {.id = 1, .flags = FRAME_FD | FRAME_BRS, .len = 16};
    struct can_port port = {.state = CAN_PORT_UP};

    port_count_received(&port, &classic);
    port_count_sent(&port, &classic);
    port_count_sent(&port, &fast);
    assert_int_equal(port.counters.rx_frames, 1);
    assert_int_equal(port.counters.tx_frames, 2);
    assert_int_equal(port.counters.rx_bits, frame_bits(&classic));
    assert_int_equal(port.counters.tx_bits, frame_bits(&classic) + frame_bits(&fast));
    assert_int_equal(port.counters.fast_bits, frame_fast_bits(&fast));
}

TEST(a_received_frame_proves_that_bus_off_is_over)
{
    const struct bus_frame frame = frame_make(1, 0, NULL);
    struct can_port port = {.state = CAN_PORT_BUS_OFF};

    port_count_received(&port, &frame);
    assert_int_equal(port.state, CAN_PORT_UP);
}

TEST(fd_frames_are_sent_where_the_bus_has_them)
{
    const struct bus_frame fd = {.id = 1, .flags = FRAME_FD, .len = 12};
    struct bus_frame frame = frame_make(1, 0, NULL);
    struct can_port port = {.fd = false};

    assert_true(port_may_send(&port, &frame));
    assert_false(port_may_send(&port, &fd));
    port.fd = true;
    assert_true(port_may_send(&port, &fd));
    frame.id = 0x800;
    assert_false(port_may_send(&port, &frame));
}

TEST(every_post_differs_from_the_one_before_and_from_none)
{
    struct can_state_box box = {0};
    uint32_t last = 0;

    for (int i = 0; i < 1000; i++) {
        const uint32_t post = (can_state_post(&box, CAN_PORT_WARNING), box.post);

        assert_true(post != 0 && post != last);
        assert_int_equal(post & 0xff, CAN_PORT_WARNING);
        last = post;
    }

    /* Also when its number wraps around */
    box.post = UINT32_C(0x7fffff) << 8 | UINT32_C(1) << 31;
    can_state_post(&box, CAN_PORT_UP);
    assert_true(box.post != 0);
}
