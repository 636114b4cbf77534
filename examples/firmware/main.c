/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The program: a millisecond at a time it takes what the buses have brought, runs the leg, answers
 * its operator. Its clock is the simulator's: STEP asks for a millisecond, DONE ends it. On the
 * robot the timer's interrupt would take the place of time_await.
 */
#include "control.h"
#include "leg.h"

enum { STEP_ID = 0x6f0, DONE_ID = 0x6ff, DONE_MISMATCH = 1 << 2 };

/* Frames of the operator and to him. */
enum {
    STOP_ID = 0x600, /* on any bus */
    MOVE_ID = 0x610, /* u8 joint, u8 0, i16 mrad, u16 ms */
    HEARTBEAT_ID = 0x640,
    SERVICE_ID = 0x650, /* u8 what */
    REPORT_ID = 0x651,
};
enum { SERVICE_REPORT = 1, SERVICE_HANG = 2 };
enum { OPERATOR = 0, MAINTENANCE = 1 /* controllers */ };
enum { EVENT_REPORT = CAN_EVENT_USER, HEARTBEAT_TICKS = 10 };

#ifdef BUG_FIFO
enum { FRAMES_OF_A_TICK = 7 }; /* three boards send two each, now and then a temperature */
#endif

static uint32_t tick;
static unsigned report_segment = BOARDS;

/* ---- operator ---- */

static void operator_take(unsigned controller, const struct can_frame *frame)
{
    if (frame->id == STOP_ID) {
        leg_stop();
    } else if (frame->id == MOVE_ID && frame->length == 6 && controller == OPERATOR) {
        leg_move(frame->data[0], (int16_t)get_u16(frame->data + 2), get_u16(frame->data + 4));
    } else if (frame->id == SERVICE_ID && frame->length == 1 && controller == MAINTENANCE) {
        if (frame->data[0] == SERVICE_REPORT) {
            can_raise(EVENT_REPORT);
        }
        while (frame->data[0] == SERVICE_HANG) {
            /* for the test of the watchdog */
        }
    }
}

static void operator_send_heartbeat(void)
{
    struct can_frame frame = {.id = HEARTBEAT_ID, .length = 8};

    frame.data[0] = (uint8_t)leg.state;
    frame.data[1] = (uint8_t)leg.cause;
    frame.data[2] = leg.indexed;
    frame.data[3] = (uint8_t)watchdog_restarts();
    frame.data[4] = (uint8_t)can_controllers[0].overflows;
    frame.data[5] = (uint8_t)can_controllers[1].overflows;
    put_u16(frame.data + 6, (uint16_t)tick);
    can_send(OPERATOR, &frame);
}

/* A segment of the report about each board; the next one when it has been sent, so that the report
 * never fills the transmit FIFO before set-points. */
static void operator_send_segment(void)
{
    const struct board *board = &boards[report_segment];
    struct can_frame frame = {.id = REPORT_ID, .length = 8};

    frame.data[0] = (uint8_t)report_segment;
    frame.data[1] = board->mode;
    put_u16(frame.data + 2, (uint16_t)control_mrad(board->position_icubdeg));
    put_u16(frame.data + 4, (uint16_t)(board->current_ma - leg.offset_ma[report_segment]));
    put_u16(frame.data + 6, (uint16_t)leg.offset_ma[report_segment]);
    report_segment++;
    can_send_and_tell(MAINTENANCE, &frame);
}

static void handle_events(uint32_t events)
{
    if (events & CAN_EVENT_BUS_OFF) {
        leg_bus_off();
    }
    if (events & EVENT_REPORT) {
        report_segment = 0;
        operator_send_segment();
    } else if (events & CAN_EVENT_SENT && report_segment < BOARDS) {
        operator_send_segment();
    }
}

/* ---- time ---- */

static void take_frames(unsigned controller, bool *done)
{
    struct can_frame frame;

    while (!*done && can_receive(controller, &frame)) {
        if (controller == OPERATOR && frame.id == DONE_ID && frame.length == 6) {
            tick = get_u32(frame.data);
            *done = true;
        } else if (!boards_take(controller, &frame)) {
            operator_take(controller, &frame);
        }
    }
}

/* Asks for a millisecond and waits until it is over. DONE comes last: all that the boards have sent
 * in it is in the FIFOs. A program that was started again is told here what time it is. */
static void time_await(void)
{
    struct can_frame step = {.id = STEP_ID, .length = 6, .data = {0, 0, 0, 0, 1}};
    bool done = false, other = false;

    put_u32(step.data, tick);
    can_send(OPERATOR, &step);
    while (!done) {
        can_await(OPERATOR);
        take_frames(OPERATOR, &done);
    }
#ifdef BUG_FIFO
    can_poll(MAINTENANCE, FRAMES_OF_A_TICK);
#endif
    take_frames(MAINTENANCE, &other);
}

int main(void)
{
    console_init();
    interrupts_init();
    interrupts_enable();
    console_print(watchdog_restarts() ? "leg controller, started again\n" : "leg controller\n");
    for (unsigned c = 0; c < CAN_CONTROLLERS; c++) {
        can_start(c);
    }
    leg_init();
    for (;;) {
        watchdog_feed();
        time_await();
        leg_step(tick);
        if (tick % HEARTBEAT_TICKS == 0) {
            operator_send_heartbeat();
        }
        can_events(handle_events);
    }
}
