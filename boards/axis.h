/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One axis of a motor board, whatever the board speaks: its sensors, the faults of its supply, its
 * readings and its overload, its bridge; and the arithmetic of a board's 1 ms loop: PID on
 * integers, trajectory generator, speed estimator, quantization. Nothing here knows frames or
 * modes. Integers as the firmware's, so that gains of real configurations mean the same. RT-safe.
 */
#ifndef BOARDS_AXIS_H
#define BOARDS_AXIS_H

#include "model/plant_io.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

struct board;
struct board_axis_config;

/* Begins the structure of an axis in each protocol (struct board_ops). */
struct axis {
    const struct board_axis_config *config;
    double supply_v;  /* of the board */
    uint8_t mode;     /* in the terms of the protocol (struct protocol) */
    bool on, faulty;  /* the bridge is closed; the axis is in hardware fault */
    double voltage_v; /* of the closed bridge */

    /* Readings at the last sample; what has no number stays as it was and is bad */
    int32_t motor_ticks, link_ticks;
    double motor_rad, link_rad; /* of the ticks; axis_find_angles */
    double current_a, torque_nm, winding_c, pressure_pa[2], valve_opening;
    bool bad_motor, bad_link, bad_torque; /* bad_motor: its encoder or its current */
    bool first;                           /* the last sample was the first since power-up */
    int64_t sampled_ms, passed_ms;     /* time of the last sample, -1: none; since the one before */
    double before_rad, velocity_rad_s; /* of the motor, a running mean; axis_find_angles */
    double overload_ms;                /* axis_find_faults */
};

/* Faults that every board can have. */
enum axis_fault {
    AXIS_UNDER_VOLTAGE = 1 << 0,
    AXIS_OVER_VOLTAGE = 1 << 1,
    AXIS_OVER_CURRENT = 1 << 2,
    AXIS_MOTOR_ENCODER = 1 << 3,
    AXIS_LINK_ENCODER = 1 << 4,
    AXIS_TORQUE_SENSOR = 1 << 5,
    AXIS_UNDER_PRESSURE = 1 << 13,
    AXIS_OVER_PRESSURE = 1 << 14,
};

/* Begins an axis with an open bridge, after the power-up of its board. */
void axis_power_up(const struct board *board, unsigned index);

/* Reads the sensors of a board's axes that have a joint. */
void axes_read_sensors(const struct board *board, const struct plant_sensors *sensors);

/* Computes the angles of an axis and the rate of its rotor from the encoders' ticks; once after
 * each sample, by the protocols that work with angles. */
void axis_find_angles(struct axis *axis);

/* Writes the bridges of a board's axes into the command of the plant. */
void axes_drive_bridges(const struct board *board, struct plant_command *command);

/* Updates a rate, the running mean of the change of a value within ms milliseconds. */
void axis_update_rate(double *rate, double *before, double now, int64_t ms);

/* Returns the faults that an axis has now, by enum axis_fault; once a tick. Over-current is I2t:
 * integral (I^2 - limit^2) dt = limit^2 * 10 ms, while the bridge is closed. */
uint32_t axis_find_faults(const struct board *board, struct axis *axis, double limit_a);

/* Rounds to the nearest count, held within int32; returns false (*count untouched) when value is
 * not finite. */
static inline bool control_quantize(double value, int32_t *count)
{
    const double shifted = value + 0.5;

    /* Values within the range, which has no NaN; floor() by hand: a call of the library costs more
     * than all the rest */
    if (shifted > (double)INT32_MIN && shifted < (double)INT32_MAX) {
        *count = (int32_t)shifted;
        *count -= *count > shifted;
        return true;
    }
    if (!isfinite(value)) {
        return false;
    }
    *count = shifted < 0.0 ? INT32_MIN : INT32_MAX;
    return true;
}

static inline int64_t control_clamp(int64_t value, int64_t min, int64_t max)
{
    return value < min ? min : value > max ? max : value;
}

/*
 * Loops in SI units, for boards that have them. The current loop, a step a millisecond: v = kp e +
 * sum of ki e dt, and the caller adds the back-EMF. At standstill the winding is i' = a i + (1 - a)
 * / R v with a = exp(-1 ms R / L), so that kp = g R a / (1 - a), ki = g R / 1 ms cancel its pole
 * and leave i' = i + g e: the error falls by 1 - g a step. The g that is tuned for is 1/2, which
 * stays stable down to a quarter of the resistance.
 */
void current_loop_tune(double ohm, double henry, double *kp_v_a, double *ki_v_as);
double current_loop_step(double *integral_v, double kp_v_a, double ki_v_as, double error_a,
                         double supply_v);

/* Returns value / 2^shift toward zero; a shift outside 0-30 counts as its nearer end. */
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

/* Resets the estimator as if the position had always been this. */
void estimator_reset(struct speed_estimator *estimator, int32_t position);
static inline void estimator_push(struct speed_estimator *estimator, int32_t position)
{
    estimator->head = (estimator->head + 1) % ESTIMATOR_HISTORY;
    estimator->position[estimator->head] = position;
}

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

/* Advances the trajectory by one millisecond; returns the change of position. */
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

/* Resets integral and derivative. */
void pid_reset(struct pid *pid);

/* Steps the PID by one millisecond; error is taken before saturation. Returns the output before
 * any limit. */
int64_t pid_step(struct pid *pid, const struct pid_gains *gains, int64_t error);

#endif
