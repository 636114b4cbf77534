/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message of protocol icub as a table row: code, exact lengths, fields. Boards use the rows
 * to decode requests and to build replies and periodic frames. The DBC export uses the same rows.
 * Immutable; RT-safe.
 *
 * Fields follow each other without gaps. They begin at byte 1 in commands (byte 0 is the command)
 * and at byte 0 in periodic frames. Lengths include all bytes.
 */
#ifndef BOARDS_ICUB_TABLE_H
#define BOARDS_ICUB_TABLE_H

#include "boards/field.h"
#include "boards/icub/protocol.h"

/* Parameters of a motor axis that a host can set. The parameters that one message sets or gets have
 * consecutive numbers. */
enum icub_parameter {
    ICUB_P_POSITION_KP, /* PWM counts per tick, before the right shift */
    ICUB_P_POSITION_KI,
    ICUB_P_POSITION_KD,
    ICUB_P_POSITION_SHIFT,
    ICUB_P_POSITION_OFFSET, /* PWM counts; also the unit of all limits and stictions */
    ICUB_P_POSITION_LIMIT,
    ICUB_P_POSITION_INTEGRAL_LIMIT,
    ICUB_P_POSITION_STICTION_UP,
    ICUB_P_POSITION_STICTION_DOWN,
    ICUB_P_TORQUE_KP, /* PWM counts per torque count, before the right shift */
    ICUB_P_TORQUE_KI,
    ICUB_P_TORQUE_KD,
    ICUB_P_TORQUE_SHIFT,
    ICUB_P_TORQUE_OFFSET,
    ICUB_P_TORQUE_LIMIT,
    ICUB_P_TORQUE_INTEGRAL_LIMIT,
    /* stored without effect: the drive's own controller holds the current */
    ICUB_P_CURRENT_KP,
    ICUB_P_CURRENT_KI,
    ICUB_P_CURRENT_KD,
    ICUB_P_CURRENT_SHIFT,
    ICUB_P_STIFFNESS,        /* torque counts per tick */
    ICUB_P_DAMPING,          /* torque counts per tick/ms */
    ICUB_P_IMPEDANCE_OFFSET, /* torque counts */
    ICUB_P_MIN_POSITION,     /* ticks */
    ICUB_P_MAX_POSITION,
    ICUB_P_MAX_VELOCITY,  /* ticks/ms * 2^velocity shift */
    ICUB_P_PWM_LIMIT,     /* PWM counts */
    ICUB_P_CURRENT_LIMIT, /* mA */
    ICUB_P_VELOCITY_SHIFT,
    ICUB_P_VELOCITY_TIMEOUT, /* ms */
    ICUB_P_JOINT_SPEED_SHIFT,
    ICUB_P_JOINT_ACCELERATION_SHIFT,
    ICUB_P_MOTOR_SPEED_SHIFT,
    ICUB_P_MOTOR_ACCELERATION_SHIFT,
    ICUB_P_TORQUE_SOURCE, /* address of a STRAIN board; 0 = torque sensor of the axis */
    ICUB_P_TORQUE_CHANNEL,
    /* Stored for the host; our control laws do not use them */
    ICUB_P_TORQUE_STICTION_UP,
    ICUB_P_TORQUE_STICTION_DOWN,
    ICUB_P_BEMF,
    ICUB_P_BEMF_SHIFT,
    ICUB_P_KTAU,
    ICUB_P_KTAU_SHIFT,
    ICUB_P_KFF,
    ICUB_P_TORQUE_FILTER,
    ICUB_P_TEMPERATURE_LIMIT,
    ICUB_P_I2T,                    /* I2t parameters, seven bytes */
    ICUB_P_SAVED = ICUB_P_I2T + 7, /* WRITE_FLASH saves all parameters before this one */
    /* References */
    ICUB_P_DESIRED_POSITION = ICUB_P_SAVED, /* ticks */
    ICUB_P_DESIRED_VELOCITY,                /* ticks/ms * 2^velocity shift */
    ICUB_P_DESIRED_ACCELERATION,            /* per ms; 0 or less = immediate */
    ICUB_P_DESIRED_TORQUE,                  /* torque counts; mA in current mode */
    ICUB_P_OPEN_LOOP,                       /* PWM counts */
    ICUB_P_INTERACTION,                     /* enum icub_interaction */
    ICUB_P_COUNT,
};

enum icub_kind {
    ICUB_NO_COMMAND = 0,
    ICUB_SET, /* stores the request's fields in parameter, parameter + 1, ... */
    ICUB_GET, /* fills the reply's fields from parameter, parameter + 1, ... */
    ICUB_DO,  /* the board handles the command in its own code */
};

struct icub_command {
    const char *name;
    enum icub_kind kind;
    uint8_t parameter; /* used by ICUB_SET and ICUB_GET: enum icub_parameter or foc_parameter */
    uint8_t request_min, request_max; /* shortest and longest valid request */
    uint8_t reply_length;             /* 0 = no reply */
    const struct field *request;      /* NULL = no fields */
    const struct field *reply;
};

struct icub_frame_type {
    const char *name; /* NULL = the type does not exist */
    uint8_t length;
    const struct field *fields;
};

/* Names of enum icub_mode, and of the board types in class 7 */
extern const struct field_value icub_mode_names[], icub_board_names[];

extern const struct icub_command icub_motor_commands[ICUB_MOTOR_COMMANDS];     /* class 0 */
extern const struct icub_command icub_strain_commands[ICUB_STRAIN_COMMANDS];   /* class 2 */
extern const struct icub_frame_type icub_motor_frames[16];                     /* class 1 */
extern const struct icub_command icub_inertial_commands[ICUB_STRAIN_COMMANDS]; /* class 2 */
extern const struct icub_frame_type icub_analog_frames[16];                    /* class 3 */
extern const struct icub_frame_type icub_inertial_frames[16];                  /* class 5 */

/* Returns the row of a class 7 command; NULL = no such command. */
const struct icub_command *icub_management_command(uint8_t code);

#endif
