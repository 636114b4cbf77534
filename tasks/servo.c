/* SPDX-License-Identifier: Apache-2.0 */
/* Position loops on motor angles; struct servo_gains (tasks/task.h) has the law. */
#include "tasks/servo.h"

#include <math.h>

/* Minimum time difference to compute a rate. Over a shorter time, the jitter of arrival times is
 * too large */
enum { RATE_SPAN_NS = 2000000 };

/* Time constant of the mean deflection, s. The mean does not follow an oscillation with a period of
 * one second. It follows the weight in a slow motion. */
#define SWAY_S 0.3

struct loop {
    double wanted, rate;
    double trim, integral;
    double excitation_v;          /* added by servo_excite */
    double load_v;                /* voltage that carries the load of the joint */
    double mean_deflection;       /* mean deflection of the spring, smoothed with SWAY_S */
    double motor_rad, motor_rate; /* motor angle used last, and rate computed with it */
    int64_t motor_time_ns;
};

struct servo {
    struct servo_config config;
    struct host *host;
    const struct host_config *robot; /* configuration of the host */
    const struct host_joint *joint;  /* joints of the host, by axis */
    struct loop *loop;
    int64_t last_ns; /* time of the last commands; -1 = none */
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
    servo->robot = host_configuration(host);
    servo->joint = host_joint(host, 0);
    servo->loop = loop;
    servo->last_ns = -1;
    *out = servo;
    return ERROR_NONE;
}

/* Returns the spring's deflection, rad: from the torque if it is measured, otherwise from both
 * encoders. */
static double servo_deflection(const struct servo *servo, size_t axis)
{
    const double spring_nm_rad = servo->robot->axis[axis].drive.spring_nm_rad;
    const struct host_joint *joint = &servo->joint[axis];

    if (!(spring_nm_rad > 0) || !joint->torque_told) {
        return joint->motor_rad - joint->joint_rad;
    }
    return joint->torque_nm / spring_nm_rad;
}

void servo_start(struct servo *servo)
{
    for (size_t i = 0; i < servo->robot->naxis; i++) {
        const struct host_joint *joint = &servo->joint[i];
        const struct servo_gains *gains = &servo->config.gains[i];
        /* With an outer loop, start from the link's angle; otherwise, from the motor's angle */
        double wanted = gains->trim_per_s > 0 ? joint->joint_rad : joint->motor_rad;

        servo->loop[i] = (struct loop){
            .wanted = wanted,
            .trim = joint->motor_rad - wanted,
            .load_v = gains->load_v_per_nm * joint->torque_nm,
            .mean_deflection = servo_deflection(servo, i),
            .motor_rad = joint->motor_rad,
            .motor_time_ns = joint->motor_time_ns,
        };
    }
    servo->last_ns = -1;
}

void servo_use(struct servo *servo, const struct servo_gains *gains)
{
    servo->config.gains = gains;
    servo_start(servo);
}

void servo_set_load(struct servo *servo, size_t axis, double torque_nm)
{
    servo->loop[axis].load_v = servo->config.gains[axis].load_v_per_nm * torque_nm;
}

void servo_set(struct servo *servo, size_t axis, double angle, double rate)
{
    servo->loop[axis].wanted = angle;
    servo->loop[axis].rate = rate;
}

void servo_excite(struct servo *servo, size_t axis, double volts)
{
    servo->loop[axis].excitation_v = volts;
}

double servo_wanted(const struct servo *servo, size_t axis)
{
    return servo->loop[axis].wanted;
}

double servo_reference(const struct servo *servo, size_t axis)
{
    return servo->loop[axis].wanted + servo->loop[axis].trim;
}

/* Computes the voltage of an axis by the control law of struct servo_gains. An integral stops while
 * the voltage is saturated in the direction of the error (anti-windup). */
static double servo_axis_voltage(struct servo *servo, size_t axis, double dt)
{
    const struct servo_gains *gains = &servo->config.gains[axis];
    double supply = servo->robot->supply_v;
    double limit = gains->limit_v > 0 ? fmin(gains->limit_v, supply) : supply;
    struct loop *loop = &servo->loop[axis];
    const struct host_joint *joint = &servo->joint[axis];
    double error = loop->wanted + loop->trim - joint->motor_rad;
    double deflection = servo_deflection(servo, axis), sway, off;
    /* Use a dead zone of one encoder tick for the link's angle. Otherwise, integrated rounding
     * errors would press two standing legs against each other with an increasing force */
    double tick = 1 / servo->robot->axis[axis].joint_ticks_per_rad;
    double V = gains->kp_v_per_rad * error + gains->ki_v_per_rad_s * loop->integral +
               gains->kd_v_s_per_rad * (loop->rate - loop->motor_rate) +
               gains->kw_v_s_per_rad * loop->rate + loop->load_v + loop->excitation_v;

    /* Compute sway, the difference of the deflection to its mean */
    loop->mean_deflection += (deflection - loop->mean_deflection) * dt / (SWAY_S + dt);
    sway = deflection - loop->mean_deflection;
    if (fabs(V) < limit || V * error < 0) {
        off = loop->wanted - joint->joint_rad;
        off = off > tick ? off - tick : off < -tick ? off + tick : 0;
        loop->integral += error * dt;
        loop->trim += gains->trim_per_s * off * dt;
        loop->trim -= gains->sway_damping_per_s * sway * dt;
    }
    /* Limit the torque, which is proportional to the voltage beyond the back-EMF */
    if (gains->torque_limit_nm > 0) {
        double back = gains->kw_v_s_per_rad * loop->motor_rate;
        double most = gains->load_v_per_nm * gains->torque_limit_nm;

        V = fmin(fmax(V, back - most), back + most);
    }
    return V > limit ? limit : V > -limit ? V : -limit;
}

void servo_update(struct servo *servo)
{
    int64_t now = host_time_ns(servo->host);
    double dt = servo->last_ns < 0 ? 0 : (double)(now - servo->last_ns) * 1e-9;

    if (servo->last_ns >= 0 && now - servo->last_ns < servo->config.command_period_ns) {
        return;
    }
    servo->last_ns = now;
    for (size_t i = 0; i < servo->robot->naxis; i++) {
        const struct host_joint *joint = &servo->joint[i];
        struct loop *loop = &servo->loop[i];
        int64_t span = joint->motor_time_ns - loop->motor_time_ns;

        /* Compute the motor's rate from the difference of two messages */
        if (span >= RATE_SPAN_NS) {
            loop->motor_rate = (joint->motor_rad - loop->motor_rad) / ((double)span * 1e-9);
            loop->motor_rad = joint->motor_rad;
            loop->motor_time_ns = joint->motor_time_ns;
        }
        host_set_reference(servo->host, i, loop->wanted + loop->trim, loop->rate);
        host_set_voltage(servo->host, i, servo_axis_voltage(servo, i, dt));
    }
}
