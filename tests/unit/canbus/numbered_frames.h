/* SPDX-License-Identifier: Apache-2.0 */
/* Frames that are told apart by their id, 1 to 9, and the ids that a port has waiting. */
#ifndef TESTS_UNIT_CANBUS_NUMBERED_FRAMES_H
#define TESTS_UNIT_CANBUS_NUMBERED_FRAMES_H

#include "canbus/port.h"
#include "tests/test.h"

static inline void send_numbered(struct can_port *port, uint32_t id)
{
    struct bus_frame frame = frame_make(id, 8, (const uint8_t[8]){0});

    assert_int_equal(can_send(port, &frame, 1), 1);
}

/* The ids that wait, as decimal digits; takes the frames. */
static inline unsigned take_numbers(struct can_port *port)
{
    struct bus_frame frame;
    unsigned ids = 0;

    while (can_receive(port, &frame, 1)) {
        ids = 10 * ids + frame.id;
    }
    return ids;
}

#endif
