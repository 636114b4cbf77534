/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The iCub CAN protocol, protocol foc (2FOC boards): one motor per address, targets and telemetry
 * every millisecond. Boards and hosts share it; it has no behavior and is RT-safe.
 * boards/icub/protocol.h defines identifiers, classes, modes, class 7 and the STRAIN boards on the
 * same bus. This file has the differences. Numbers are little-endian.
 *
 * The host sends DESIRED_TARGETS: four i16, one for each of the addresses 1 to 4. The mode of the
 * addressed board defines the meaning of its target:
 *
 *   mode (enum icub_mode)        target
 *   ICUB_MODE_OPEN_LOOP          voltage, +-32000 = +-100 % of the supply (applied up to 95 %)
 *   ICUB_MODE_CURRENT            mA
 *   ICUB_MODE_SPEED_VOLTAGE      icubdeg/ms; a velocity loop whose output is the voltage
 *   ICUB_MODE_SPEED_CURRENT      icubdeg/ms; a velocity loop whose output is the current
 *   ICUB_MODE_POSITION           icubdeg from the motor's position when the mode began
 *
 * A board starts in ICUB_MODE_NOT_CONFIGURED. There it obeys only discovery, GET_FIRMWARE_VERSION
 * and configuration commands. It becomes idle after it has received four commands:
 * GET_FIRMWARE_VERSION with exactly the protocol 1.6, SET_MOTOR_CONFIG, SET_CURRENT_LIMIT with a
 * peak above 0, and SET_CURRENT_PID. GET_FIRMWARE_VERSION must come first: without it the others
 * are refused. No command is acknowledged; STATUS reports the mode. From idle, SET_CONTROL_MODE
 * selects one of the modes above. From one of these modes, it selects another or idle. Each change
 * resets the set points to 0.
 *
 * An icubdeg is 1/65536 of a revolution of the ROTOR, before the gear: with a gear of 100, 1 rad at
 * the link is 1043038 icubdeg. Every board answers each DESIRED_TARGETS with one FOC and one STATUS
 * frame (the rig can lower the rate of STATUS). If SET_MOTOR_CONFIG says that there is a
 * thermometer, some answers also have ADDITIONAL_STATUS. The set point expires 50 ms after the last
 * DESIRED_TARGETS. The board then enters ICUB_MODE_HARDWARE_FAULT. The host clears the fault with
 * SET_CONTROL_MODE and ICUB_MODE_FORCE_IDLE.
 *
 *   id                  name               data
 *   0x10F               DESIRED_TARGETS    0: i16 target of address 1, 2: of 2, 4: of 3, 6: of 4
 *   0x100 | a << 4 | 0  FOC                0: i16 current, mA; 2: i16 velocity, icubdeg/ms;
 *                                          4: i32 position, icubdeg
 *   0x100 | a << 4 | 3  STATUS             0: u8 mode; 1: u8 encoder bits; 2: i16 PWM, +-32000;
 *                                          4: u32 fault bits
 *   0x100 | a << 4 | C  ADDITIONAL_STATUS  0: 2 bytes, 0; 2: i16 temperature, 0.1 degree C
 *
 * In the real protocol temperatures are raw counts that depend on the thermometer; here a count is
 * 0.1 degree C. A board checks the temperature if SET_MOTOR_CONFIG says that there is a
 * thermometer.
 */
#ifndef BOARDS_FOC_PROTOCOL_H
#define BOARDS_FOC_PROTOCOL_H

#include "boards/icub/protocol.h"

enum { FOC_AXES_MAX = 4 }; /* only addresses 1-4 have a target */

enum { FOC_DESIRED_TARGETS_ID = 0x10f };

/* Class 1 frame types */
enum foc_type {
    FOC_FEEDBACK = 0x0,
    FOC_STATUS = 0x3,
    FOC_ADDITIONAL_STATUS = 0xc,
    FOC_DESIRED_TARGETS = 0xf, /* source 0 */
};

enum { FOC_TARGETS_LENGTH = 8, FOC_FEEDBACK_LENGTH = 8, FOC_STATUS_LENGTH = 8 };
enum { FOC_ADDITIONAL_STATUS_LENGTH = 4 };

enum {
    FOC_PWM_FULL_SCALE = 32000, /* 100 % of the supply */
    FOC_PWM_MAX = 30400,        /* largest output of the bridge: 95 % */
    FOC_ICUBDEG_PER_REV = 65536,
    FOC_TARGET_TIMEOUT_MS = 50,
};

/* Class 0, data[0]: the supported commands of icub_motor_command, and commands of these boards
 * only */
enum foc_command {
    FOC_GET_MOTOR_PARAMETER = 0x01,
    FOC_SET_MOTOR_PARAMETER = 0x02,
    FOC_SET_CONTROL_MODE = ICUB_SET_CONTROL_MODE,
    /* length 8: one unused byte, nominal, peak, overload */
    FOC_SET_CURRENT_LIMIT = ICUB_SET_CURRENT_LIMIT,
    FOC_GET_FIRMWARE_VERSION = ICUB_GET_FIRMWARE_VERSION,
    FOC_SET_CURRENT_PID = 0x65, /* kp, ki, kd: i16; shift: u8 */
    FOC_GET_CURRENT_PID,
    FOC_SET_CURRENT_PID_LIMITS, /* offset, limit of the output, of the integral: i16 */
    FOC_GET_CURRENT_PID_LIMITS,
    FOC_SET_VELOCITY_PID,
    FOC_GET_VELOCITY_PID,
    FOC_SET_VELOCITY_PID_LIMITS,
    FOC_GET_VELOCITY_PID_LIMITS,
    FOC_SET_MOTOR_CONFIG = 0x77,
    FOC_SET_TEMPERATURE_LIMIT = 0x79,
    FOC_GET_TEMPERATURE_LIMIT,
    FOC_GET_MOTOR_CONFIG,
    FOC_GET_CURRENT_LIMIT,
    FOC_SET_PID, /* one parameter as float32 */
    FOC_GET_PID,
};

/* SET_MOTOR_CONFIG byte 1 */
enum foc_motor_flag {
    FOC_HAS_QE = 1 << 0,
    FOC_HAS_HALL = 1 << 1,
    FOC_HAS_TEMPERATURE = 1 << 2,
    FOC_HAS_INDEX = 1 << 3,
    FOC_MOTOR_FLAGS = 0x3f, /* flags that GET_MOTOR_CONFIG returns */
};

/* SET_PID bytes 1 and 2; byte 3 unused; bytes 4-7 float32 */
enum foc_pid_loop { FOC_LOOP_CURRENT, FOC_LOOP_VELOCITY, FOC_LOOP_POSITION, FOC_LOOPS };

enum foc_pid_parameter {
    FOC_PID_KP = 2,
    FOC_PID_KI = 3,
    FOC_PID_KD = 4,
    FOC_PID_INTEGRAL_LIMIT = 5,
    FOC_PID_OUTPUT_LIMIT = 6,
    FOC_PID_KFF = 7,
    FOC_PID_STICTION_UP = 8,
    FOC_PID_STICTION_DOWN = 9,
    FOC_PID_NONE = 15, /* in an answer: the board cannot tell the parameter */
};

/* SET/GET_MOTOR_PARAMETER byte 1. Bytes 2-5 have the value, a float32 (Hall: i16 offset, u8
 * swap) */
enum foc_motor_parameter {
    FOC_MOTOR_BEMF = 1,
    FOC_MOTOR_HALL = 2,
    FOC_MOTOR_MAX_VELOCITY = 3,
};

/* STATUS byte 1 */
enum foc_encoder_state {
    FOC_QE_PHASE_BROKEN = 1 << 3,
    FOC_QE_NOT_CALIBRATED = 1 << 4,
};

/* STATUS bytes 4-7: the bits that the simulated boards set. foc_fault_names names all bits */
#define FOC_FAULT_OVER_CURRENT (UINT32_C(1) << 4)
#define FOC_FAULT_OVER_VOLTAGE (UINT32_C(1) << 5)
#define FOC_FAULT_UNDER_VOLTAGE (UINT32_C(1) << 6)
#define FOC_FAULT_OVER_HEATING (UINT32_C(1) << 9)
#define FOC_FAULT_CAN_RX_WARNING (UINT32_C(1) << 10)
#define FOC_FAULT_CAN_TX_WARNING (UINT32_C(1) << 11)
#define FOC_FAULT_CAN_RX_PASSIVE (UINT32_C(1) << 12)
#define FOC_FAULT_CAN_TX_PASSIVE (UINT32_C(1) << 13)
#define FOC_FAULT_SET_POINT_EXPIRED (UINT32_C(1) << 14)
#define FOC_FAULT_CAN_OVERRUN (UINT32_C(1) << 15)
#define FOC_FAULT_ENCODER (UINT32_C(1) << 19)
#define FOC_FAULT_I2T (UINT32_C(1) << 22)
#define FOC_FAULT_CAN_WAS_WARNING (UINT32_C(1) << 28)
#define FOC_FAULT_CAN_RX_WAS_PASSIVE (UINT32_C(1) << 30)
#define FOC_FAULT_CAN_TX_WAS_PASSIVE (UINT32_C(1) << 31)

enum { FOC_BOARD_2FOC = 8 }; /* board type in class 7 discovery */

/* Returns the shortest period of ADDITIONAL_STATUS of a board, ms. */
static inline unsigned foc_additional_status_ms(unsigned address)
{
    return 100 + 100 * address;
}

#endif
