/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The arithmetic of a motor board's 1 ms loop: PID on integers, trajectory generator, speed
 * estimator, quantization. Pure functions on small structs; nothing here knows frames or modes.
 * Integers as the firmware's, so that gains of real configurations mean the same. RT-safe.
 */
#ifndef BOARDS_MOTOR_CONTROL_H
#define BOARDS_MOTOR_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

/* To the nearest count, held within int32; false (*count untouched) when value is not finite. */
bool control_quantize(double value, int32_t *count);

static inline int64_t control_clamp(int64_t value, int64_t min, int64_t max)
{
    return value < min ? min : value > max ? max : value;
}

/* value / 2^shift toward zero; a shift outside 0-30 counts as its nearer end. */
int64_t control_shift_right(int64_t value, int64_t shift);

/*
 * Speed and acceleration from quantized positions, one a millisecond: differences over a window of
 * 32 ms, scaled by a power of two. The window makes one tick of quantization 1/32 tick/ms; the
 * speed is that of 16 ms ago.
 */
enum { ESTIMATOR_WINDOW_MS = 32, ESTIMATOR_HISTORY = 128 };

struct speed_estimator {
    int32_t position[ESTIMATOR_HISTORY];
    uint32_t head; /* newest */
};

/* As if the position had always been this. */
void estimator_reset(struct speed_estimator *estimator, int32_t position);
void estimator_push(struct speed_estimator *estimator, int32_t position);

/* ticks/ms * 2^shift */
int64_t estimator_speed(const struct speed_estimator *estimator, int64_t shift);

/* ticks/ms^2 * 2^shift */
int64_t estimator_acceleration(const struct speed_estimator *estimator, int64_t shift);

/*
 * Minimum-jerk motion from the present reference to a target: x(s) = x0 + v0 T s + (10 d - 6 v0 T)
 * s^3 - (15 d - 8 v0 T) s^4 + (6 d - 3 v0 T) s^5 with s = t/T, d the distance, v0 the speed that
 * the motion before had. T = 100 ms * |d| / speed: the speed of a POSITION_MOVE is ticks in 100 ms.
 */
struct trajectory {
    bool running;
    int32_t start, target;
    double v0, duration_ms, time_ms; /* v0 in ticks/ms */
    int32_t position;                /* where the last step put it */
};

void trajectory_stop(struct trajectory *trajectory, int32_t position);
void trajectory_start(struct trajectory *trajectory, int32_t target, int64_t speed);

/* Moves one millisecond on; returns the change of position. */
int32_t trajectory_step(struct trajectory *trajectory);

/*
 * PID with a right shift as scale. The error saturates at 16 bits; the derivative is the change of
 * the error a millisecond, averaged over the last ten; the integral part stays within +-limit.
 */
enum { PID_AVERAGE = 10 };

struct pid_gains {
    int64_t kp, ki, kd, shift, integral_limit;
};

struct pid {
    int32_t error;
    int64_t integral; /* before the shift */
    int64_t derivative[PID_AVERAGE], derivative_sum;
    unsigned next;
};

/* No integral, no derivative from what was before. */
void pid_reset(struct pid *pid);

/* One millisecond; error is taken before saturation. Returns the output before any limit. */
int64_t pid_step(struct pid *pid, const struct pid_gains *gains, int64_t error);

#endif
