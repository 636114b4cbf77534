/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control laws of a 2FOC board, in the integers of its firmware; and the state of the board.
 * Units are the protocol's. RT-safe.
 *
 * One difference to the firmware: its inner loops run at 20 to 40 kHz, these once a millisecond,
 * which is as fine as the plant's voltage is. Gains of the current loop must be chosen for that.
 * Let a = exp(-1 ms R / L); a motor at rest has its pole at 1 - g when, for the winding R at the
 * supply U, kp + ki/2 = g R / ((1 - a) U), in thousandths of the supply a mA, and (kp - ki/2) / (kp
 * + ki/2) = a. Above g = 1 it rings, from 2 on it is unstable. Without feed-forward of the back-EMF
 * a motor that speeds up keeps an error of current.
 *
 * Vq, the voltage, is in thousandths of the supply, at most 950, as the firmware's PWM has it.
 */
#ifndef BOARDS_FOC_PRIVATE_H
#define BOARDS_FOC_PRIVATE_H

#include "boards/foc/table.h"
#include "boards/icub/board.h"

enum { FOC_VQ_MAX = 950, FOC_VQ_SHIFT = 5 /* between Vq and the +-32000 of the bus */ };

enum foc_law_gain { FOC_LAW_KP, FOC_LAW_KI, FOC_LAW_GAINS };

/* An incremental PI law: v += kp (e - e') + ki (e + e'), kp and ki shifted left. */
struct foc_law {
    int64_t kp, ki, shift;
    double gain[FOC_LAW_GAINS]; /* as they were set, whichever way */
    int64_t v, error;
};

/* The current limiter of the modes that end in a voltage: it adds what holds the current at its
 * peak. */
struct foc_limiter {
    int64_t side; /* +1 or -1 while it acts */
    int64_t v, error;
};

/* A PID on floats: output +-32000. An output or integral limit of 0 counts as full scale. */
struct foc_position_law {
    double gain[FOC_PID_STICTION_DOWN + 1]; /* by enum foc_pid_parameter */
    double integral, error;
};

enum { FOC_ANSWERS_MAX = 8 }; /* to DESIRED_TARGETS within a tick */

struct foc_board {
    struct icub_board icub;
    struct axis axis;
    uint32_t faults;
    uint8_t encoder; /* enum foc_encoder_state */
    bool compatible; /* the host speaks our protocol */
    bool motor_set, current_set;
    uint8_t flags; /* enum foc_motor_flag */
    int64_t resolution, index_offset, poles, tolerance;
    int64_t nominal_ma, peak_ma, overload_ma;
    int64_t temperature_limit; /* raw; 0 = none */
    struct foc_law current, speed;
    struct foc_position_law position_law;
    float motor_parameter[FOC_MOTOR_MAX_VELOCITY + 1]; /* kept for the host */

    int64_t target;   /* as last commanded for the present mode */
    int64_t speed_ma; /* reference of the current loop in SPEED_CURRENT */
    struct foc_limiter limiter;
    int64_t vq;
    int32_t start; /* position when the mode began */

    int64_t i2t; /* mA^2 ms / 1024 */
    int64_t target_ns;

    int32_t position, velocity; /* icubdeg, icubdeg/ms */
    int32_t position_before;    /* a millisecond ago */
    int32_t turn;               /* whole revolutions, to see the index go by */
    int32_t temperature;        /* raw */
    bool started;

    unsigned answers;
    int64_t status_ms;
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

struct board *foc_board_create(struct arena *arena);

#endif
