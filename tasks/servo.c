/* SPDX-License-Identifier: Apache-2.0 */
/* Position loops on motor angles. */
#include "tasks/servo.h"

#include <math.h>

struct loop {
    double wanted, rate;
    double trim, integral;
};

struct servo {
    struct servo_config config;
    struct host *host;
    struct loop *loop;
    int64_t last_ns; /* of the last commands; -1 = none yet */
};

enum error_code servo_create(const struct servo_config *config, struct host *host,
                             struct arena *arena, struct servo **out, struct error *error)
{
    size_t naxis = host_configuration(host)->naxis;
    struct servo *servo = arena_alloc(arena, 1, sizeof *servo);
    struct loop *loop = arena_alloc(arena, naxis, sizeof *loop);

    if (!servo || !loop) {
        return error_set(error, ERROR_MEMORY, "no memory for the servo loops");
    }
    servo->config = *config;
    servo->host = host;
    servo->loop = loop;
    servo->last_ns = -1;
    *out = servo;
    return ERROR_NONE;
}

void servo_start(struct servo *servo)
{
    for (size_t i = 0; i < host_configuration(servo->host)->naxis; i++) {
        const struct host_joint *joint = host_joint(servo->host, i);
        double wanted = servo->config.trim_per_s > 0 ? joint->joint_rad : joint->motor_rad;

        servo->loop[i] = (struct loop){.wanted = wanted, .trim = joint->motor_rad - wanted};
    }
    servo->last_ns = -1;
}

void servo_set(struct servo *servo, size_t axis, double angle, double rate)
{
    servo->loop[axis].wanted = angle;
    servo->loop[axis].rate = rate;
}

double servo_wanted(const struct servo *servo, size_t axis)
{
    return servo->loop[axis].wanted;
}

double servo_reference(const struct servo *servo, size_t axis)
{
    return servo->loop[axis].wanted + servo->loop[axis].trim;
}

/* what the link is off, less what its encoder cannot tell: integrated for ever, the rounding of two
 * legs that stand on the same ground would wind them against each other */
static double link_error(const struct servo *servo, size_t axis)
{
    double step = 1 / host_configuration(servo->host)->axis[axis].joint_ticks_per_rad;
    double error = servo->loop[axis].wanted - host_joint(servo->host, axis)->joint_rad;

    return error > step ? error - step : error < -step ? error + step : 0;
}

/* one axis; the integral stands still while the voltage is saturated in its direction */
static double voltage(struct servo *servo, size_t axis, double dt)
{
    const struct servo_config *config = &servo->config;
    double supply = host_configuration(servo->host)->supply_v;
    struct loop *loop = &servo->loop[axis];
    const struct host_joint *joint = host_joint(servo->host, axis);
    double error = servo_reference(servo, axis) - joint->motor_rad;
    double V = config->kp_v_per_rad * error + config->ki_v_per_rad_s * loop->integral +
               config->kw_v_s_per_rad * loop->rate;

    if (fabs(V) < supply || V * error < 0) {
        loop->integral += error * dt;
        loop->trim += config->trim_per_s * link_error(servo, axis) * dt;
    }
    return fmin(fmax(V, -supply), supply);
}

void servo_update(struct servo *servo)
{
    int64_t now = host_time_ns(servo->host);
    double dt = servo->last_ns < 0 ? 0 : (double)(now - servo->last_ns) * 1e-9;

    if (servo->last_ns >= 0 && now - servo->last_ns < servo->config.command_period_ns) {
        return;
    }
    servo->last_ns = now;
    for (size_t i = 0; i < host_configuration(servo->host)->naxis; i++) {
        host_set_voltage(servo->host, i, voltage(servo, i, dt));
    }
}
