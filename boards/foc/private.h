/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control laws and the state of a 2FOC board. The laws use the integers of the firmware. Units
 * are the protocol's. RT-safe.
 *
 * The current modes hand the current to the drive's own controller (boards/axis.h). Its bandwidth
 * is kp / L, with kp in thousandths of the supply per mA; ki has no effect there. The other laws
 * and the current limiter run once a millisecond.
 *
 * The voltage Vq is in thousandths of the supply, at most 950 as in the firmware's PWM.
 */
#ifndef BOARDS_FOC_PRIVATE_H
#define BOARDS_FOC_PRIVATE_H

#include "boards/foc/table.h"
#include "boards/icub/board.h"

/* shift: between Vq and the scale +-32000 of the bus */
enum { FOC_VQ_MAX = 950, FOC_VQ_SHIFT = 5 };

/* An incremental PI law: v += kp (e - e') + ki (e + e'), with kp and ki scaled by a left shift. */
struct foc_law {
    int64_t kp, ki, shift;
    int64_t v, error;
};

/* The current limiter for modes whose output is a voltage. It adds the voltage that keeps the
 * current at its peak. */
struct foc_limiter {
    int64_t side; /* sign of the limited current; 0 = not limiting */
    int64_t v, error;
};

/* A position PID in floating point; output +-32000. A limit of 0 for output or integral means full
 * scale. */
struct foc_position_law {
    double integral, error;
};

enum { FOC_ANSWERS_MAX = 8 }; /* most answers to DESIRED_TARGETS in one tick */

struct foc_board {
    struct icub_board icub;
    struct axis axis;
    uint32_t faults;
    uint8_t encoder; /* enum foc_encoder_state */
    bool compatible; /* the host has stated a compatible protocol */
    bool motor_set, current_set;
    uint8_t flags; /* enum foc_motor_flag */
    int64_t setting[FOC_P_COUNT];
    /* gains that the host has set, from floats or integers */
    double gain[FOC_LOOPS][FOC_PID_STICTION_DOWN + 1];
    struct foc_law law[FOC_LOOP_POSITION];
    struct foc_position_law position_law;
    /* stored for the host, without effect */
    float motor_parameter[FOC_MOTOR_MAX_VELOCITY + 1];

    int64_t target;   /* last set point in the present mode, in its unit */
    int64_t speed_ma; /* current reference in mode SPEED_CURRENT */
    struct foc_limiter limiter;
    int64_t vq;
    int32_t start; /* position at the start of the mode */

    int64_t i2t; /* mA^2 ms / 1024 */
    int64_t target_ns;

    int32_t position, velocity; /* icubdeg, icubdeg/ms */
    int32_t position_before;    /* position one millisecond ago */
    int32_t turn;               /* whole revolutions; a change is an index pulse */
    int32_t temperature;        /* raw counts */
    bool started;

    unsigned answers;
    int64_t status_ms, additional_ms; /* times of the last frames */
};

static inline struct foc_board *foc_board_of(const struct board *board)
{
    return container_of(board, struct foc_board, icub.board);
}

static inline bool foc_runs(uint8_t mode)
{
    return mode != ICUB_MODE_IDLE && mode != ICUB_MODE_HARDWARE_FAULT &&
           mode != ICUB_MODE_NOT_CONFIGURED;
}

extern const struct icub_board_ops foc_icub_ops;

#endif
