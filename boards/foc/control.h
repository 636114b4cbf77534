/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control laws of a 2FOC board, in the integers of its firmware. Pure functions on small
 * structs; nothing here knows frames or modes. RT-safe.
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
#ifndef BOARDS_FOC_CONTROL_H
#define BOARDS_FOC_CONTROL_H

#include "boards/foc/protocol.h"

#include <stdbool.h>
#include <stdint.h>

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
    float gain[FOC_PID_STICTION_DOWN + 1]; /* by enum foc_pid_parameter */
    double integral, error;
};

#endif
