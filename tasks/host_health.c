/* SPDX-License-Identifier: Apache-2.0 */
/* Checks whether the boards are healthy, and says what is wrong when they are not. */
#include "tasks/host_private.h"

#include <stdio.h>

static const int64_t TELEMETRY_TIMEOUT_NS = 200 * HOST_MS; /* longest time without rotor
                                                            * positions */
static const int64_t SENSOR_TIMEOUT_NS = 100 * HOST_MS;    /* longest time without a watched
                                                            * sensor's values, ... */
enum {
    SENSOR_TIMEOUT_PERIODS = 10
}; /* ... or so many of its periods, if
                                                            * that is longer */

void host_fail_node(struct host *host, size_t bus, unsigned address, const char *what)
{
    if (host->phase != HOST_FAILED) { /* the first failure is the cause of the others */
        snprintf(host->message, sizeof host->message, "board %u on %s %s", address,
                 host->config.port[bus]->bus, what);
        host->phase = HOST_FAILED;
    }
}

enum { FAULTS_TEXT = 128 };

/* Writes the names of a joint's faults, ": over-current, under-voltage"; or what a fault without
 * a bit may mean, or nothing. Returns text. */
static const char *host_list_faults(const struct host *host, size_t axis, char text[FAULTS_TEXT])
{
    const struct host_ops *ops = host->line[host->config.axis[axis].bus].ops;
    uint32_t fault = host->joint[axis].fault;
    size_t used = 0;

    text[0] = '\0';
    if (fault == 0 && ops->unnamed_fault) {
        snprintf(text, FAULTS_TEXT, ": %s", ops->unnamed_fault);
    }
    for (int bit = 0; bit < 32 && used < FAULTS_TEXT - 1; bit++) {
        if (fault >> bit & 1 && ops->fault_name[bit]) {
            used += (size_t)snprintf(text + used, FAULTS_TEXT - used, "%s%s", used ? ", " : ": ",
                                     ops->fault_name[bit]);
        }
    }
    return text;
}

enum host_phase host_fail_joint(struct host *host, size_t axis, const char *what)
{
    const struct host_joint *joint = &host->joint[axis];
    char names[FAULTS_TEXT];

    if (joint->motor == HOST_MOTOR_FAULT) {
        snprintf(host->message, sizeof host->message, "joint %s is in fault 0x%02X%s",
                 host->config.axis[axis].joint, (unsigned)joint->fault,
                 host_list_faults(host, axis, names));
    } else {
        snprintf(host->message, sizeof host->message, "joint %s %s", host->config.axis[axis].joint,
                 what);
    }
    return host->phase = HOST_FAILED;
}

void host_watch_force(struct host *host, size_t ft)
{
    host->force_watched[ft] = true;
}

void host_watch_motion(struct host *host)
{
    host->motion_watched = true;
}

/* Fails the host when a value that a task needs came too long ago: at time_ns, -1 = never. One
 * from before the end of the start-up is waited for from there on. */
static void host_judge_sensor(struct host *host, int bus, unsigned address, int64_t time_ns,
                              const char *what)
{
    int64_t period_ns = host->line[bus].node[address].period_ns;
    int64_t since_ns = time_ns > host->phase_since_ns ? time_ns : host->phase_since_ns;
    int64_t timeout_ns = SENSOR_TIMEOUT_PERIODS * period_ns;

    timeout_ns = timeout_ns > SENSOR_TIMEOUT_NS ? timeout_ns : SENSOR_TIMEOUT_NS;
    if (host->phase != HOST_FAILED && host->now_ns - since_ns > timeout_ns) {
        host_fail_node(host, (size_t)bus, address, what);
        host->lost = true;
    }
}

/* Checks the age of all watched values. */
static void host_judge_sensors(struct host *host)
{
    const struct host_imu *imu = &host->config.imu;
    const struct host_motion *motion = &host->motion;

    for (size_t i = 0; i < host->config.nft; i++) {
        const struct host_ft *ft = &host->config.ft[i];

        if (host->force_watched[i]) {
            host_judge_sensor(host, ft->bus, ft->address, host->force[i].force_time_ns,
                              "sends no force");
            host_judge_sensor(host, ft->bus, ft->address, host->force[i].torque_time_ns,
                              "sends no torque");
        }
    }
    if (host->motion_watched) {
        host_judge_sensor(host, imu->bus, imu->address, motion->rate_time_ns,
                          "sends no angular rate");
        host_judge_sensor(host, imu->bus, imu->address,
                          motion->quaternion_time_ns >= 0 ? motion->quaternion_time_ns
                                                          : motion->acceleration_time_ns,
                          "sends no attitude");
    }
}

bool host_healthy(struct host *host)
{
    for (size_t i = 0; i < host->config.naxis && host->phase != HOST_FAILED; i++) {
        const struct host_joint *joint = &host->joint[i];

        if (joint->motor != HOST_MOTOR_ON) {
            /* Off without a fault: a board that was restarted */
            host->lost = joint->motor == HOST_MOTOR_OFF;
            host_fail_joint(host, i,
                            joint->motor == HOST_MOTOR_OTHER ? "is in a mode that was not commanded"
                                                             : "has switched its motor off");
        } else if (host->now_ns - joint->motor_time_ns > TELEMETRY_TIMEOUT_NS) {
            host_fail_joint(host, i, "sends no telemetry");
            host->lost = joint->motor != HOST_MOTOR_FAULT;
        }
    }
    host_judge_sensors(host);
    return host->phase != HOST_FAILED;
}

const char *host_message(const struct host *host)
{
    return host->message;
}

bool host_lost(const struct host *host)
{
    return host->phase == HOST_FAILED && host->lost;
}
