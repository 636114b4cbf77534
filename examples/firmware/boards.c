/* SPDX-License-Identifier: Apache-2.0 */
/* Frames to and from the motor boards. */
#include "boards.h"

enum { TARGETS_ID = 0x10f, CLASS_POLLING = 0, CLASS_PERIODIC = 1, FEEDBACK = 0, STATUS = 3 };
enum {
    SET_CONTROL_MODE = 0x09,
    SET_CURRENT_LIMIT = 0x48,
    GET_FIRMWARE_VERSION = 0x5b,
    SET_CURRENT_PID = 0x65,
    SET_MOTOR_CONFIG = 0x77,
};
enum { PROTOCOL_MAJOR = 1, PROTOCOL_MINOR = 6, TYPE_2FOC = 8 };
enum { HAS_ENCODER = 1 << 0, HAS_INDEX = 1 << 3, ENCODER_TICKS = 4096, POLES = 8 };

/* A motor of 0.664 ohm heats with 24 W at 6 A; the bridge trips at 20 A. */
enum { NOMINAL_MA = 3000, PEAK_MA = 6000, OVERLOAD_MA = 20000 };

/* Volt at the winding for an ampere of error, once a millisecond: half of what would end the error
 * in one step (0.664 ohm, 0.32 mH, 48 V), in 32768ths of a thousandth of the supply a mA. */
enum { CURRENT_KP = 146, CURRENT_KI = 227, CURRENT_SHIFT = 15 };

struct board boards[BOARDS] = {
    {.joint = "LHipSag", .controller = 0, .address = 1},
#ifdef BUG_SWAPPED
    {.joint = "LHipLat", .controller = 0, .address = 3},
    {.joint = "LHipYaw", .controller = 0, .address = 2},
#else
    {.joint = "LHipLat", .controller = 0, .address = 2},
    {.joint = "LHipYaw", .controller = 0, .address = 3},
#endif
    {.joint = "LKneeSag", .controller = 1, .address = 1},
    {.joint = "LAnkLat", .controller = 1, .address = 2},
    {.joint = "LAnkSag", .controller = 1, .address = 3},
};

static bool stranger;

static struct board *board_find(unsigned controller, unsigned address)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        if (boards[i].controller == controller && boards[i].address == address) {
            return &boards[i];
        }
    }
    return NULL;
}

void boards_forget(void)
{
    stranger = false;
    for (unsigned i = 0; i < BOARDS; i++) {
        boards[i].answered = false;
        boards[i].silence = 0;
        boards[i].target = 0;
        boards[i].faults = 0;
    }
}

/* ---- what arrives ---- */

static void board_take_status(struct board *board, const uint8_t *data)
{
    board->mode = data[0];
    board->encoder = data[1];
    board->faults = get_u32(data + 4);
    board->silence = 0;
}

static void board_take_feedback(struct board *board, const uint8_t *data)
{
    board->current_ma = (int16_t)get_u16(data);
#ifdef BUG_POSITION
    board->position_icubdeg = (int32_t)__builtin_bswap32(get_u32(data + 4));
#else
    board->position_icubdeg = (int32_t)get_u32(data + 4);
#endif
}

bool boards_take(unsigned controller, const struct can_frame *frame)
{
    const unsigned class = frame->id >> 8, address = frame->id >> 4 & 0xf, low = frame->id & 0xf;
    struct board *board = board_find(controller, address);

    if (class == CLASS_POLLING && low == 0 && frame->length == 8 &&
        frame->data[0] == GET_FIRMWARE_VERSION) {
        if (board) {
            board->answered = frame->data[1] == TYPE_2FOC && frame->data[7] == 1;
        } else {
#ifndef BUG_STRANGER
            stranger = true;
#endif
        }
        return true;
    }
    if (class != CLASS_PERIODIC || !board || frame->length != 8) {
        return class <= CLASS_PERIODIC;
    }
    if (low == STATUS) {
        board_take_status(board, frame->data);
    } else if (low == FEEDBACK) {
        board_take_feedback(board, frame->data);
    }
    return true;
}

void boards_count_silence(void)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        boards[i].silence++;
    }
}

bool boards_have_stranger(void)
{
    return stranger;
}

/* ---- what is sent ---- */

void boards_send_targets(void)
{
    for (unsigned c = 0; c < CAN_CONTROLLERS; c++) {
        struct can_frame frame = {.id = TARGETS_ID, .length = 8};

        for (unsigned i = 0; i < BOARDS; i++) {
            if (boards[i].controller == c) {
                put_u16(frame.data + 2 * (boards[i].address - 1), (uint16_t)boards[i].target);
            }
        }
        can_send(c, &frame);
    }
}

void boards_request_version(unsigned controller, unsigned address)
{
    can_send(controller,
             &(struct can_frame){.id = address,
                                 .length = 3,
                                 .data = {GET_FIRMWARE_VERSION, PROTOCOL_MAJOR, PROTOCOL_MINOR}});
}

static void put_limit(uint8_t *data, uint16_t ma)
{
#ifdef BUG_BYTE_ORDER
    data[0] = (uint8_t)(ma >> 8);
    data[1] = (uint8_t)ma;
#else
    put_u16(data, ma);
#endif
}

void board_configure(const struct board *board)
{
    struct can_frame motor = {.id = board->address, .length = 7, .data = {SET_MOTOR_CONFIG}};
    struct can_frame limit = {.id = board->address, .length = 8, .data = {SET_CURRENT_LIMIT}};
    struct can_frame law = {.id = board->address, .length = 8, .data = {SET_CURRENT_PID}};

    motor.data[1] = HAS_ENCODER | HAS_INDEX;
    put_u16(motor.data + 2, ENCODER_TICKS);
    motor.data[6] = POLES;
    put_limit(limit.data + 2, NOMINAL_MA);
    put_limit(limit.data + 4, PEAK_MA);
    put_limit(limit.data + 6, OVERLOAD_MA);
    put_u16(law.data + 1, CURRENT_KP);
    put_u16(law.data + 3, CURRENT_KI);
    law.data[7] = CURRENT_SHIFT;
    can_send(board->controller, &motor);
    can_send(board->controller, &limit);
    can_send(board->controller, &law);
}

void board_set_mode(const struct board *board, enum board_mode mode)
{
    can_send(board->controller, &(struct can_frame){.id = board->address,
                                                    .length = 2,
                                                    .data = {SET_CONTROL_MODE, (uint8_t)mode}});
}
