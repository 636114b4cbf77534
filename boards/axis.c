/* SPDX-License-Identifier: Apache-2.0 */
/* Implements one axis of a motor board and the arithmetic of its loop; see boards/axis.h. */
#include "boards/axis.h"

#include "boards/board_private.h"

#define OVERLOAD_MS 10.0

/* ---- the axis ---- */

void axis_update_rate(double *rate, double *before, double now, int64_t ms)
{
    if (ms > 0) {
        *rate = (*rate + (now - *before) / ((double)ms * 1e-3)) / 2.0;
        *before = now;
    }
}

void axis_power_up(const struct board *board, unsigned index)
{
    struct axis *axis = board_axis(board, index);

    axis->config = &board->config.axis[index];
    axis->on = axis->faulty = axis->law.on = false;
    axis->sampled_ms = -1;
    axis->velocity_rad_s = axis->overload_ms = axis->voltage_v = 0.0;
}

void axes_read_sensors(const struct board *board, const struct plant_sensors *sensors)
{
    const int64_t now_ms = board->boards->now_ns / MS;

    for (unsigned i = 0; i < board->axes; i++) {
        struct axis *axis = board_axis(board, i);

        if (axis->config->joint >= 0) {
            /* Read the sensors of an axis that has a joint */
            const struct motor_sense *sense = &sensors->motor[axis->config->joint];
            const struct board_axis_config *config = axis->config;
            int32_t motor;

            axis->bad_motor = !control_quantize(sense->qm * config->motor_ticks_per_rad, &motor) ||
                              !isfinite(sense->current_a);
            if (!axis->bad_motor) {
                axis->motor_ticks = motor;
                axis->current_a = sense->current_a;
                axis->voltage_v = axis->law.on ? sense->voltage_v : axis->voltage_v;
            }
            /* A link angle or torque that is not finite keeps its old value */
            axis->bad_link =
                !control_quantize(sense->q * config->joint_ticks_per_rad, &axis->link_ticks);
            axis->bad_torque = !isfinite(sense->torque_nm);
            axis->torque_nm = axis->bad_torque ? axis->torque_nm : sense->torque_nm;
            axis->supply_v = board->boards->supply_v;
            axis->winding_c = sense->winding_c;
            if (config->valve) {
                axis->pressure_pa[0] = sense->pressure_pa[0];
                axis->pressure_pa[1] = sense->pressure_pa[1];
                axis->valve_opening = sense->valve_opening;
            }

            axis->first = axis->sampled_ms < 0;
            axis->passed_ms = axis->first ? 0 : now_ms - axis->sampled_ms;
            axis->sampled_ms = now_ms;
        }
    }
}

void axis_find_angles(struct axis *axis)
{
    axis->motor_rad = axis->motor_ticks / axis->config->motor_ticks_per_rad;
    axis->link_rad = axis->link_ticks / axis->config->joint_ticks_per_rad;
    axis->before_rad = axis->first ? axis->motor_rad : axis->before_rad;
    axis_update_rate(&axis->velocity_rad_s, &axis->before_rad, axis->motor_rad, axis->passed_ms);
}

void axes_drive_bridges(const struct board *board, struct plant_command *command)
{
    for (unsigned i = 0; i < board->axes; i++) {
        const struct axis *axis = board_axis(board, i);

        if (axis->config->joint >= 0) {
            struct motor_command *motor = &command->motor[axis->config->joint];

            motor->bridge_on = axis->on;
            motor->voltage_v = axis->on ? axis->voltage_v : 0.0;
            motor->law.on = axis->on && axis->law.on;
            if (motor->law.on) {
                motor->law = axis->law;
                motor->law.reading_rad = axis->motor_ticks / axis->config->motor_ticks_per_rad;
            }
        }
    }
}

/* Updates the overload of an axis by one tick. The unit is ms of (I / limit)^2 - 1. Returns whether
 * the axis has tripped. An open bridge resets the overload. */
static inline bool axis_is_overloaded(struct axis *axis, double limit_a, double tick_ms)
{
    double part = axis->current_a * axis->current_a / (limit_a * limit_a);
    double overload_ms = axis->overload_ms + (part - 1.0) * tick_ms;

    /* Comparisons instead of fmax, which is a call into the library */
    axis->overload_ms = axis->on && overload_ms > 0.0 ? overload_ms : 0.0;
    return axis->overload_ms > OVERLOAD_MS;
}

uint32_t axis_find_faults(const struct board *board, struct axis *axis, double limit_a)
{
    const struct board_config *config = &board->config;
    double supply_v = board->boards->supply_v, over_v = config->over_voltage_v;
    double tick_ms = (double)board->boards->tick_ns / MS;
    uint32_t faults = supply_v < config->under_voltage_v ? AXIS_UNDER_VOLTAGE : 0;

    faults |= over_v > 0.0 && supply_v > over_v ? AXIS_OVER_VOLTAGE : 0;
    faults |= axis_is_overloaded(axis, limit_a, tick_ms) ? AXIS_OVER_CURRENT : 0;
    if (axis->bad_motor || axis->bad_link || axis->bad_torque) {
        faults |= axis->bad_motor ? AXIS_MOTOR_ENCODER : 0;
        faults |= axis->bad_link ? AXIS_LINK_ENCODER : 0;
        faults |= axis->bad_torque ? AXIS_TORQUE_SENSOR : 0;
    }
    if (axis->config->valve) {
        double oil_pa = board->boards->oil_pa, over_pa = config->over_pressure_pa;

        faults |= oil_pa < config->under_pressure_pa ? AXIS_UNDER_PRESSURE : 0;
        faults |= over_pa > 0.0 && oil_pa > over_pa ? AXIS_OVER_PRESSURE : 0;
    }
    return faults;
}

/* ---- control loops ---- */

double axis_wanted_current(const struct axis *axis)
{
    const struct current_law *law = &axis->law;
    double wanted_a = law->current_a +
                      law->stiffness_a_rad * (law->position_rad - axis->motor_rad) +
                      law->damping_a_s_rad * (law->speed_rad_s - axis->velocity_rad_s);

    return law->on ? fmax(fmin(wanted_a, law->limit_a), -law->limit_a) : 0.0;
}

int64_t control_shift_right(int64_t value, int64_t shift)
{
    return value / (INT64_C(1) << control_clamp(shift, 0, 30));
}

void estimator_reset(struct speed_estimator *estimator, int32_t position)
{
    for (unsigned i = 0; i < ESTIMATOR_HISTORY; i++) {
        estimator->position[i] = position;
    }
    estimator->head = 0;
}

/* Returns the position `ms` milliseconds ago, ticks. */
static int64_t estimator_position_ago(const struct speed_estimator *estimator, unsigned ms)
{
    return estimator->position[(estimator->head + ESTIMATOR_HISTORY - ms) % ESTIMATOR_HISTORY];
}

/* Returns value * 2^shift / divisor. The shift is clamped to 0-26: with a larger shift, any result
 * other than 0 exceeds 16 bits. */
static int64_t estimator_scale(int64_t value, int64_t shift, int64_t divisor)
{
    return value * (INT64_C(1) << control_clamp(shift, 0, 26)) / divisor;
}

int64_t estimator_speed(const struct speed_estimator *estimator, int64_t shift)
{
    int64_t change = estimator_position_ago(estimator, 0) -
                     estimator_position_ago(estimator, ESTIMATOR_WINDOW_MS);

    return estimator_scale(change, shift, ESTIMATOR_WINDOW_MS);
}

int64_t estimator_acceleration(const struct speed_estimator *estimator, int64_t shift)
{
    int64_t change = estimator_position_ago(estimator, 0) -
                     2 * estimator_position_ago(estimator, ESTIMATOR_WINDOW_MS) +
                     estimator_position_ago(estimator, 2 * ESTIMATOR_WINDOW_MS);

    return estimator_scale(change, shift, ESTIMATOR_WINDOW_MS * ESTIMATOR_WINDOW_MS);
}

void trajectory_stop(struct trajectory *trajectory, int32_t position)
{
    memset(trajectory, 0, sizeof *trajectory);
    trajectory->position = trajectory->target = trajectory->start = position;
}

/* Returns the distance from the start at s = t/T, ticks. If speed is not NULL, sets *speed to its
 * derivative, ticks/ms. */
static double trajectory_evaluate(const struct trajectory *trajectory, double s, double *speed)
{
    double d = (double)trajectory->target - (double)trajectory->start;
    double v = trajectory->v0 * trajectory->duration_ms;
    double c3 = 10.0 * d - 6.0 * v, c4 = 15.0 * d - 8.0 * v, c5 = 6.0 * d - 3.0 * v;

    if (speed) {
        *speed =
            (v + s * s * (3.0 * c3 + s * (-4.0 * c4 + s * 5.0 * c5))) / trajectory->duration_ms;
    }
    return s * (v + s * s * (c3 + s * (-c4 + s * c5)));
}

void trajectory_start(struct trajectory *trajectory, int32_t target, int64_t speed)
{
    double distance = fabs((double)target - (double)trajectory->position);
    double v0 = 0.0;

    if (trajectory->running) {
        trajectory_evaluate(trajectory, trajectory->time_ms / trajectory->duration_ms, &v0);
    }
    trajectory->start = trajectory->position;
    trajectory->target = target;
    trajectory->v0 = v0;
    trajectory->time_ms = 0.0;
    trajectory->duration_ms = fmax(1.0, 100.0 * distance / (double)(speed < 1 ? 1 : speed));
    trajectory->running = true;
}

int32_t trajectory_step(struct trajectory *trajectory)
{
    int32_t before = trajectory->position;
    int32_t after = trajectory->target;

    if (!trajectory->running) {
        return 0;
    }
    trajectory->time_ms += 1.0;
    if (trajectory->time_ms >= trajectory->duration_ms) {
        trajectory->running = false;
    } else {
        control_quantize(trajectory->start +
                             trajectory_evaluate(
                                 trajectory, trajectory->time_ms / trajectory->duration_ms, NULL),
                         &after);
    }
    trajectory->position = after;
    return (int32_t)control_clamp((int64_t)after - before, INT32_MIN, INT32_MAX);
}

void pid_reset(struct pid *pid)
{
    memset(pid, 0, sizeof *pid);
}

int64_t pid_step(struct pid *pid, const struct pid_gains *gains, int64_t error)
{
    int32_t now = (int32_t)control_clamp(error, INT16_MIN, INT16_MAX);
    int64_t derivative = control_shift_right((now - pid->error) * gains->kd, gains->shift);
    int64_t limit = control_clamp(gains->integral_limit, 0, INT16_MAX);
    int64_t bound = limit * (INT64_C(1) << control_clamp(gains->shift, 0, 30));

    pid->error = now;
    pid->derivative_sum += derivative - pid->derivative[pid->next];
    pid->derivative[pid->next] = derivative;
    pid->next = (pid->next + 1) % PID_AVERAGE;
    pid->integral = control_clamp(pid->integral + now * gains->ki, -bound, bound);
    return control_shift_right(now * gains->kp, gains->shift) + pid->derivative_sum / PID_AVERAGE +
           control_shift_right(pid->integral, gains->shift);
}
