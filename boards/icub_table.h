/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message of persona A as a table: its code, its exact lengths and its fields. The boards
 * decode requests and build replies and periodic frames from these rows, and an export of the
 * protocol (DBC) reads the same rows, so that the two cannot differ. Immutable; RT-safe.
 *
 * Fields follow each other without gaps: from byte 1 in commands (byte 0 is the command), from byte
 * 0 in periodic frames. Lengths count every byte.
 */
#ifndef BOARDS_ICUB_TABLE_H
#define BOARDS_ICUB_TABLE_H

#include "boards/icub_protocol.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum icub_type {
    ICUB_END = 0, /* closes a list of fields */
    ICUB_U8,
    ICUB_U16,
    ICUB_I16,
    ICUB_U32,
    ICUB_I32,
    ICUB_U16_BE,
    ICUB_I16_BE,
    ICUB_PAD, /* one byte, zero when sent, ignored when received */
};

struct icub_field {
    enum icub_type type;
    const char *name;
    const char *unit; /* NULL: a bare number */
    int64_t min, max; /* refused outside; both 0: whatever the type holds */
};

enum { ICUB_FIELDS_MAX = 8 }; /* values that one message carries at most */

/* What the host can set in one axis of a motor board. Neighbors travel in one message. */
enum icub_parameter {
    ICUB_P_POSITION_KP, /* PWM counts per tick, before the right shift */
    ICUB_P_POSITION_KI,
    ICUB_P_POSITION_KD,
    ICUB_P_POSITION_SHIFT,
    ICUB_P_POSITION_OFFSET, /* PWM counts, as all limits and stictions */
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
    ICUB_P_CURRENT_KP, /* PWM counts per mA, before the right shift */
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
    ICUB_P_TORQUE_SOURCE, /* address of a STRAIN board; 0: the axis's own torque sensor */
    ICUB_P_TORQUE_CHANNEL,
    /* kept for the host and given back; no control law of ours uses them */
    ICUB_P_TORQUE_STICTION_UP,
    ICUB_P_TORQUE_STICTION_DOWN,
    ICUB_P_BEMF,
    ICUB_P_BEMF_SHIFT,
    ICUB_P_KTAU,
    ICUB_P_KTAU_SHIFT,
    ICUB_P_KFF,
    ICUB_P_TORQUE_FILTER,
    ICUB_P_TEMPERATURE_LIMIT,
    ICUB_P_I2T,                    /* seven bytes */
    ICUB_P_SAVED = ICUB_P_I2T + 7, /* what WRITE_FLASH keeps are the parameters above */
    /* references */
    ICUB_P_DESIRED_POSITION = ICUB_P_SAVED, /* ticks */
    ICUB_P_DESIRED_VELOCITY,                /* ticks/ms * 2^velocity shift */
    ICUB_P_DESIRED_ACCELERATION,            /* per ms; 0 or less: at once */
    ICUB_P_DESIRED_TORQUE,                  /* torque counts; in current mode mA */
    ICUB_P_OPEN_LOOP,                       /* PWM counts */
    ICUB_P_INTERACTION,                     /* enum icub_interaction */
    ICUB_P_COUNT,
};

enum icub_kind {
    ICUB_NO_COMMAND = 0,
    ICUB_SET, /* the request's fields go to parameter, parameter + 1, ... */
    ICUB_GET, /* the reply's fields come from there */
    ICUB_DO,  /* the board has code of its own for it */
};

struct icub_command {
    const char *name;
    enum icub_kind kind;
    enum icub_parameter parameter;    /* of ICUB_SET and ICUB_GET */
    uint8_t request_min, request_max; /* length of the request; equal but for a few */
    uint8_t reply_length;             /* 0: no reply */
    const struct icub_field *request; /* NULL: none */
    const struct icub_field *reply;
};

struct icub_frame_type {
    const char *name; /* NULL: no such type */
    uint8_t length;
    const struct icub_field *fields;
};

extern const struct icub_command icub_motor_commands[ICUB_MOTOR_COMMANDS];   /* class 0 */
extern const struct icub_command icub_strain_commands[ICUB_STRAIN_COMMANDS]; /* class 2 */
extern const struct icub_frame_type icub_motor_frames[16];                   /* class 1 */
extern const struct icub_frame_type icub_analog_frames[16];                  /* class 3 */

/* Class 7; NULL when there is no such command. */
const struct icub_command *icub_management_command(uint8_t code);

/* Number of values (fields without padding) of a list, and the bytes they take. */
size_t icub_field_count(const struct icub_field *fields);
size_t icub_field_bytes(const struct icub_field *fields);

/* Reads the values of fields from data; a field beyond size reads as 0. Returns false when a value
 * is outside its field's range. values holds ICUB_FIELDS_MAX. */
bool icub_decode(const struct icub_field *fields, const uint8_t *data, size_t size,
                 int64_t *values);

/* Writes the values, each brought into the range of its type, and zero padding. */
void icub_encode(const struct icub_field *fields, const int64_t *values, uint8_t *data);

#endif
