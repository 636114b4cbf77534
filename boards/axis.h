/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One axis of a motor board, for every protocol: it reads the sensors, finds the faults of supply,
 * sensors and current, and drives the bridge. Also the arithmetic of a board's 1 ms loop: integer
 * PID, trajectory generator, speed estimator, quantization. This header does not depend on frames
 * or modes. The integer arithmetic follows the firmware, so that gains of real configurations have
 * the same effect. RT-safe.
 */
#ifndef BOARDS_AXIS_H
#define BOARDS_AXIS_H

#include "model/plant_io.h"

#include <math.h>

struct board;
struct board_axis_config;

/* The common part of an axis. It is the first member of each protocol's axis structure (struct
 * board_ops). */
struct axis {
    const struct board_axis_config *config;
    double supply_v;  /* supply of the board */
    uint8_t mode;     /* mode number of the protocol (protocol.mode_name) */
    bool on, faulty;  /* on: the bridge is closed; faulty: hardware fault */
    double voltage_v; /* bridge voltage while the bridge is closed; under a law: as measured */
    struct current_law law; /* set by axis_follow_law; off: voltage_v is the command */

    /* Readings of the last sample. A reading that is not finite keeps its old value, and its bad
     * flag is set. */
    int32_t motor_ticks, link_ticks;
    double motor_rad, link_rad; /* angles from the ticks, by axis_find_angles */
    double current_a, torque_nm, winding_c, pressure_pa[2], valve_opening;
    bool bad_motor, bad_link, bad_torque; /* bad_motor: no reading of the encoder or the current */
    bool first;                           /* the last sample is the first since power-up */
    /* sampled_ms: time of the last sample, -1 = none; passed_ms: time since the sample before it */
    int64_t sampled_ms, passed_ms;
    /* last motor angle, running mean of its rate; by axis_find_angles */
    double before_rad, velocity_rad_s;
    double overload_ms; /* I2t state in ms (axis_find_faults) */
};

/* Faults that a motor board of any protocol can have. */
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

/* Resets an axis after the power-up of its board. The bridge is open. */
void axis_power_up(const struct board *board, unsigned index);

/* Reads the sensors of all axes of a board that have a joint. */
void axes_read_sensors(const struct board *board, const struct plant_sensors *sensors);

/* Computes angles and rotor rate of an axis from the encoder ticks. Protocols that work with angles
 * call it once after each sample. */
void axis_find_angles(struct axis *axis);

/* Writes the bridge states and voltages of a board's axes into the command of the plant. */
void axes_drive_bridges(const struct board *board, struct plant_command *command);

/* Updates *rate, in 1/s, to the mean of its old value and the rate of the last ms milliseconds.
 * *before is the value at the previous call; it becomes `now`. */
void axis_update_rate(double *rate, double *before, double now, int64_t ms);

/* Returns the present faults of an axis as bits of enum axis_fault. Call it once a tick.
 * Over-current is an I2t limit: it trips when integral (I^2 - limit^2) dt exceeds limit^2 * 10 ms.
 * The integral stays at or above 0, and an open bridge resets it. */
uint32_t axis_find_faults(const struct board *board, struct axis *axis, double limit_a);

/* Rounds to the nearest count and saturates to int32. Returns false, and leaves *count unchanged,
 * when value is not finite. */
static inline bool control_quantize(double value, int32_t *count)
{
    const double shifted = value + 0.5;

    /* Common case: the value is within the range, and so is not NaN. Compute floor() inline,
     * because a library call costs more than the rest of the function. */
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

/* Returns a gain of the configuration; 0 stands for 1. */
static inline double axis_gain_or_1(double gain)
{
    return gain != 0.0 ? gain : 1.0;
}

/* Hands a law to the drive's own current controller, instead of a voltage. The law holds until
 * axis_follow_law or axis_apply_voltage is called. position_rad: an angle of the encoder. */
static inline void axis_follow_law(struct axis *axis, const struct current_law *law)
{
    axis->law = *law;
    axis->law.on = true;
}

/* Applies a voltage, clipped to the supply. */
static inline void axis_apply_voltage(struct axis *axis, double v)
{
    axis->law.on = false;
    axis->voltage_v = fmax(fmin(v, axis->supply_v), -axis->supply_v);
}

/* Commands a current to a current controller with the gain kp_v_a, whose bandwidth is kp_v_a / L.
 * If the gain is 0, the voltage is 0. */
void axis_follow_current(struct axis *axis, double current_a, double limit_a, double kp_v_a);

/* Returns the current of the law in force at the last readings, A. */
double axis_wanted_current(const struct axis *axis);

/* Returns value / 2^shift, rounded toward zero. The shift is clamped to 0-30. */
int64_t control_shift_right(int64_t value, int64_t shift);

/*
 * Estimates speed and acceleration from quantized positions, one position per millisecond. It takes
 * differences over a window of 32 ms and scales them by a power of two. The window reduces one tick
 * of quantization to 1/32 tick/ms. The speed has a delay of 16 ms.
 */
enum { ESTIMATOR_WINDOW_MS = 32, ESTIMATOR_HISTORY = 128 };

struct speed_estimator {
    int32_t position[ESTIMATOR_HISTORY];
    uint32_t head; /* newest */
};

/* Fills the history with one position: speed and acceleration are then 0. */
void estimator_reset(struct speed_estimator *estimator, int32_t position);
static inline void estimator_push(struct speed_estimator *estimator, int32_t position)
{
    estimator->head = (estimator->head + 1) % ESTIMATOR_HISTORY;
    estimator->position[estimator->head] = position;
}

/* Returns the speed, ticks/ms * 2^shift. */
int64_t estimator_speed(const struct speed_estimator *estimator, int64_t shift);

/* Returns the acceleration, ticks/ms^2 * 2^shift. */
int64_t estimator_acceleration(const struct speed_estimator *estimator, int64_t shift);

/*
 * Minimum-jerk motion from the present reference to a target: x(s) = x0 + v0 T s + (10 d - 6 v0 T)
 * s^3 - (15 d - 8 v0 T) s^4 + (6 d - 3 v0 T) s^5. Here s = t/T, d is the distance and v0 the
 * initial speed. T = 100 ms * |d| / speed, because a POSITION_MOVE gives its speed in ticks per 100
 * ms.
 */
struct trajectory {
    bool running;
    int32_t start, target;
    double v0, duration_ms, time_ms; /* v0 in ticks/ms */
    int32_t position;                /* position after the last step */
};

void trajectory_stop(struct trajectory *trajectory, int32_t position);
void trajectory_start(struct trajectory *trajectory, int32_t target, int64_t speed);

/* Advances the trajectory by one millisecond; returns the change of position. */
int32_t trajectory_step(struct trajectory *trajectory);

/*
 * PID whose output is shifted right as scaling. The error saturates at 16 bits. The derivative is
 * the change of the error per millisecond, averaged over the last ten changes. The integral part is
 * clamped to +-integral_limit.
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

/* Advances the PID by one millisecond. `error` need not be saturated. Returns the output before any
 * limit. */
int64_t pid_step(struct pid *pid, const struct pid_gains *gains, int64_t error);

#endif
