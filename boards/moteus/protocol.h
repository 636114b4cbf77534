/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register protocol of moteus controllers (mjbots, github.com/mjbots/moteus): the wire format
 * of its CAN FD frames, after its documents "CAN Protocol" and "Register Reference", firmware
 * 1.1.0. Boards and hosts share it; it has no behavior and is RT-safe.
 *
 * The identifier is source << 8 | destination. Bit 15 requests a reply, which the controller sends
 * to the source. An identifier that does not fit into 11 bits has 29 bits. The data is a sequence
 * of subframes:
 *
 *   0x00 0x04 0x08 0x0c  write int8, int16, int32, float: count, first register, values
 *   0x10 0x14 0x18 0x1c  read: count, first register
 *   0x20 0x24 0x28 0x2c  reply: count, first register, values
 *   0x30 0x31            error of a write, of a read: register, reason
 *   0x50                 padding: fills a frame up to a length of CAN FD
 *
 * A count of 1 to 3 is in the lowest two bits of the subframe; any other count follows in the next
 * byte. Count, register and reason are varuints: seven bits per byte, lowest first; bit 7 = another
 * byte follows. Values are little-endian. The lowest integer means NaN.
 */
#ifndef BOARDS_MOTEUS_PROTOCOL_H
#define BOARDS_MOTEUS_PROTOCOL_H

#include "canbus/frame.h"

#include <string.h>

enum {
    MOTEUS_ADDRESS_MAX = 31, /* limit of this program; the protocol allows 126 */
    MOTEUS_BROADCAST = 0x7f, /* address that selects all controllers */
    MOTEUS_WANTS_REPLY = 0x8000,
    MOTEUS_DATA_MAX = 64,
    MOTEUS_MAP_VERSION = 5,
    MOTEUS_FIRMWARE = 0x010100, /* firmware 1.1.0 */
};

enum moteus_subframe {
    MOTEUS_WRITE = 0x00,
    MOTEUS_READ = 0x10,
    MOTEUS_REPLY = 0x20,
    MOTEUS_WRITE_ERROR = 0x30,
    MOTEUS_READ_ERROR = 0x31,
    MOTEUS_NOP = 0x50,
};

/* Type of the values of a subframe, times 4. */
enum moteus_type { MOTEUS_INT8 = 0, MOTEUS_INT16 = 4, MOTEUS_INT32 = 8, MOTEUS_FLOAT = 12 };

/* Reasons of an error. */
enum moteus_reason { MOTEUS_OK = 0, MOTEUS_UNKNOWN_REGISTER = 1, MOTEUS_READ_ONLY = 2 };

enum moteus_register {
    MOTEUS_R_MODE = 0x000,
    MOTEUS_R_POSITION,
    MOTEUS_R_VELOCITY,
    MOTEUS_R_TORQUE,
    MOTEUS_R_Q_CURRENT,
    MOTEUS_R_D_CURRENT,
    MOTEUS_R_ABS_POSITION,
    MOTEUS_R_POWER,
    MOTEUS_R_MOTOR_TEMPERATURE = 0x00a,
    MOTEUS_R_TRAJECTORY_COMPLETE,
    MOTEUS_R_HOME_STATE,
    MOTEUS_R_VOLTAGE,
    MOTEUS_R_TEMPERATURE,
    MOTEUS_R_FAULT,

    MOTEUS_R_D_VOLTAGE_COMMAND = 0x01a,
    MOTEUS_R_Q_VOLTAGE_COMMAND,
    MOTEUS_R_Q_CURRENT_COMMAND,
    MOTEUS_R_D_CURRENT_COMMAND,

    MOTEUS_R_POSITION_COMMAND = 0x020,
    MOTEUS_R_VELOCITY_COMMAND,
    MOTEUS_R_FEEDFORWARD_TORQUE,
    MOTEUS_R_KP_SCALE,
    MOTEUS_R_KD_SCALE,
    MOTEUS_R_MAX_TORQUE,
    MOTEUS_R_STOP_POSITION,
    MOTEUS_R_TIMEOUT,
    MOTEUS_R_VELOCITY_LIMIT,
    MOTEUS_R_ACCELERATION_LIMIT,
    MOTEUS_R_ILIMIT_SCALE = 0x02b,
    MOTEUS_R_IGNORE_BOUNDS = 0x02d,

    MOTEUS_R_TORQUE_P = 0x030,
    MOTEUS_R_TORQUE_I,
    MOTEUS_R_TORQUE_D,
    MOTEUS_R_TORQUE_FEEDFORWARD,
    MOTEUS_R_TORQUE_TOTAL,
    MOTEUS_R_CONTROL_POSITION = 0x038,
    MOTEUS_R_CONTROL_VELOCITY,
    MOTEUS_R_CONTROL_TORQUE,
    MOTEUS_R_POSITION_ERROR,
    MOTEUS_R_VELOCITY_ERROR,
    MOTEUS_R_TORQUE_ERROR,

    MOTEUS_R_STAY_LOWER = 0x040,
    MOTEUS_R_STAY_UPPER,
    /* this and all later registers of this group repeat other registers (moteus_rows) */
    MOTEUS_R_STAY_FEEDFORWARD_TORQUE,
    MOTEUS_R_STAY_KP_SCALE,
    MOTEUS_R_STAY_KD_SCALE,
    MOTEUS_R_STAY_MAX_TORQUE,
    MOTEUS_R_STAY_TIMEOUT,
    MOTEUS_R_STAY_ILIMIT_SCALE,
    MOTEUS_R_STAY_IGNORE_BOUNDS,

    MOTEUS_R_ENCODER_0_POSITION = 0x050,
    MOTEUS_R_ENCODER_0_VELOCITY,
    MOTEUS_R_ENCODER_1_POSITION,
    MOTEUS_R_ENCODER_1_VELOCITY,
    MOTEUS_R_ENCODER_2_POSITION,
    MOTEUS_R_ENCODER_2_VELOCITY,
    MOTEUS_R_ENCODER_VALIDITY = 0x058,
    MOTEUS_R_AUX1_GPIO_COMMAND = 0x05c,
    MOTEUS_R_AUX2_GPIO_COMMAND,
    MOTEUS_R_AUX1_GPIO_STATUS,
    MOTEUS_R_AUX2_GPIO_STATUS,
    MOTEUS_R_AUX1_ANALOG = 0x060, /* five registers */
    MOTEUS_R_AUX2_ANALOG = 0x068, /* five registers */
    MOTEUS_R_MILLISECONDS = 0x070,
    MOTEUS_R_CLOCK_TRIM,
    MOTEUS_R_AUX1_PWM_PERIOD,
    MOTEUS_R_AUX1_PWM_DUTY,
    MOTEUS_R_AUX2_PWM_PERIOD,
    MOTEUS_R_AUX2_PWM_DUTY,
    MOTEUS_R_AUX1_PWM,         /* five registers */
    MOTEUS_R_AUX2_PWM = 0x07b, /* five registers */

    MOTEUS_R_MODEL = 0x100,
    MOTEUS_R_FIRMWARE,
    MOTEUS_R_MAP_VERSION,
    MOTEUS_R_SERIAL = 0x120, /* three registers */
    MOTEUS_R_OUTPUT_NEAREST = 0x130,
    MOTEUS_R_OUTPUT_EXACT,
    MOTEUS_R_RECAPTURE = 0x133,
    MOTEUS_R_UUID = 0x150,      /* four registers */
    MOTEUS_R_UUID_MASK = 0x154, /* four registers */
    MOTEUS_R_UUID_MASK_CAPABLE = 0x158,
    MOTEUS_REGISTERS
};

enum moteus_mode {
    MOTEUS_STOPPED = 0,
    MOTEUS_FAULT = 1,
    MOTEUS_ENABLING = 2,
    MOTEUS_CALIBRATING = 3,
    MOTEUS_CALIBRATION_COMPLETE = 4,
    MOTEUS_PWM = 5,
    MOTEUS_VOLTAGE_FOC = 7,
    MOTEUS_VOLTAGE_DQ = 8,
    MOTEUS_CURRENT = 9,
    MOTEUS_POSITION = 10,
    MOTEUS_TIMEOUT = 11,
    MOTEUS_ZERO_VELOCITY = 12,
    MOTEUS_STAY_WITHIN = 13,
    MOTEUS_MEASURE_INDUCTANCE = 14,
    MOTEUS_BRAKE = 15,
    MOTEUS_MODES
};

/* Values of the register FAULT. Codes from 96 on are no faults: each names the limit that restricts
 * the output of a mode. */
enum moteus_fault {
    MOTEUS_NO_FAULT = 0,
    MOTEUS_FAULT_FIRST = 32, /* calibration; lowest fault code */
    MOTEUS_OVER_VOLTAGE = 34,
    MOTEUS_ENCODER = 35,
    MOTEUS_OVER_TEMPERATURE = 38,
    MOTEUS_OUTSIDE_LIMIT = 39,
    MOTEUS_UNDER_VOLTAGE = 40,
    MOTEUS_STOP_POSITION = 45,
    MOTEUS_LIMIT_CURRENT = 99,
    MOTEUS_LIMIT_TORQUE = 102,
    MOTEUS_LIMIT_POSITION = 103,
};

/* Returns the identifier of a frame from `source` to `destination`. */
static inline uint32_t moteus_id(unsigned source, unsigned destination)
{
    return source << 8 | destination;
}

/* Returns a host's frame with a command, or without one. The frame also reads mode, motion and
 * fault. */
static inline struct bus_frame moteus_query(unsigned address, const uint8_t *command,
                                            unsigned length)
{
    static const uint8_t question[] = {
        MOTEUS_READ | MOTEUS_INT8 | 1,  MOTEUS_R_MODE,         /* mode */
        MOTEUS_READ | MOTEUS_FLOAT | 3, MOTEUS_R_POSITION,     /* position, velocity, torque */
        MOTEUS_READ | MOTEUS_FLOAT | 1, MOTEUS_R_ABS_POSITION, /* the link's angle */
        MOTEUS_READ | MOTEUS_INT8 | 3,  MOTEUS_R_VOLTAGE,      /* voltage, temperature, fault */
    };
    struct bus_frame frame = {.id = MOTEUS_WANTS_REPLY | moteus_id(0, address),
                              .flags = FRAME_EXTENDED | FRAME_FD | FRAME_BRS,
                              .len = frame_fd_length(length + (unsigned)sizeof question)};

    memset(frame.data, MOTEUS_NOP, frame.len);
    memcpy(frame.data, command, length);
    memcpy(frame.data + length, question, sizeof question);
    return frame;
}

#endif
