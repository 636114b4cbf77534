/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a BLL motor board. Units are those of the protocol. RT-safe. */
#ifndef BOARDS_ICUB_MOTOR_PRIVATE_H
#define BOARDS_ICUB_MOTOR_PRIVATE_H

#include "boards/icub/board.h"

enum { MOTOR_AXES = 2 };

/* One bit for each of the seven parameters of the position PID, all set */
enum { PID_HAS_ALL = (1 << (ICUB_P_POSITION_INTEGRAL_LIMIT + 1)) - 1 };

struct motor_axis {
    struct axis base;
    int64_t parameter[ICUB_P_COUNT];
    int64_t saved[ICUB_P_SAVED]; /* contents of the flash: parameters below ICUB_P_SAVED */
    uint8_t faults;              /* STATUS reports them while their cause lasts */
    uint8_t faults_once;         /* STATUS reports them once */
    uint8_t pids;                /* bits: parameters of the position PID that the host has set */
    bool calibrated;             /* a calibration was completed since power-up */
    /* ICUB_BOARD_OVER_TEMPERATURE_0 and ICUB_BOARD_TEMPERATURE_ERROR_0, for this axis */
    uint8_t heat;
    bool limit_reported; /* an event has reported the present stay beyond a limit */
    struct speed_estimator joint, motor;
    int32_t offset;      /* position = ticks + offset */
    int32_t temperature; /* raw counts */
    bool thermometer_bad;

    int32_t desired;          /* position reference of this millisecond */
    int64_t desired_velocity; /* ramped velocity reference */
    int64_t velocity_rest;    /* fraction of a tick, carried to the next millisecond */
    struct trajectory trajectory;
    struct pid position_pid, torque_pid, impedance;
    int64_t torque_reference, torque; /* counts */
    int64_t output, pwm;              /* output: of the law; pwm: after the limits */

    /* times of the last commands, by kind of reference */
    int64_t voltage_ns, torque_ns, velocity_ns;
    int64_t source_ns;     /* time when the torque source was selected */
    int64_t calibrated_ns; /* end of the calibration */
    int32_t calibration_zero;
};

struct motor_board {
    struct icub_board icub;
    struct motor_axis axis[MOTOR_AXES];
    uint32_t policy;
    int64_t status_ms;
    uint8_t text; /* number of the next PRINT text, 0 to ICUB_PRINT_TEXTS - 1 */
    /* bits of STATUS byte 4. can: not yet reported; can_reported: already reported */
    uint8_t can, can_reported;
    int reported_tec, reported_rec;
    bool status_due, additional_due;
    bool protocol_ack; /* the host has stated a compatible protocol */
    bool powered;      /* has been powered up once */
};

static inline struct motor_board *motor_board_of(const struct board *board)
{
    return container_of(board, struct motor_board, icub.board);
}

static inline unsigned motor_axis_index(const struct board *board, const struct motor_axis *axis)
{
    return (unsigned)(axis - motor_board_of(board)->axis);
}

static inline int32_t motor_axis_position(const struct motor_axis *axis)
{
    return (int32_t)control_clamp((int64_t)axis->base.link_ticks + axis->offset, INT32_MIN,
                                  INT32_MAX);
}

static inline int64_t motor_axis_current_ma(const struct motor_axis *axis)
{
    int32_t value = 0;

    control_quantize(axis->base.current_a * 1e3, &value);
    return value;
}

static inline bool motor_runs(uint8_t mode)
{
    return mode != ICUB_MODE_IDLE && mode != ICUB_MODE_HARDWARE_FAULT;
}

/* Queues a text for the host's log, in PRINT frames of six characters. */
void motor_board_print(struct board *board, const char *text);

/* Sets the mode, even if unchanged, and resets the references (motor_axis.c). */
void motor_axis_set_mode(struct board *board, struct motor_axis *axis, uint8_t mode);

/* Checks what a strict board requires before an axis is switched on. The host must have stated its
 * protocol, set the position PID and, if required, calibrated the axis. Otherwise the axis enters
 * hardware fault and the function returns false. */
bool motor_axis_is_owed_nothing(struct board *board, struct motor_axis *axis, bool calibrated);

/* Obeys SET_CONTROL_MODE. Returns false for an unknown mode. */
bool motor_axis_command_mode(struct board *board, struct motor_axis *axis, int64_t mode);

/* Set the position reference to the present position; the second function also resets all other
 * references. */
void motor_axis_hold_position(struct motor_axis *axis);
void motor_axis_reset_references(struct board *board, struct motor_axis *axis);

/* Return whether the mode uses the trajectory generator, and whether it uses the velocity
 * reference. */
bool motor_axis_moves(const struct motor_axis *axis);
bool motor_axis_has_velocity(const struct motor_axis *axis);

/* Checks faults, limits and time-outs once a tick (motor_axis.c). */
void motor_board_watch(struct board *board);

/* Returns the state of the CAN controller in the format of STATUS byte 4. */
uint8_t motor_board_can_status(const struct board *board);

/* Runs one millisecond of an axis's control law (motor_axis.c). */
void motor_axis_step(const struct board *board, struct motor_axis *axis);

#endif
