/* SPDX-License-Identifier: Apache-2.0 */
/* Whether the boards are healthy, and what is wrong when they are not. */
#include "tasks/host_private.h"

#include <stdio.h>

static const int64_t TELEMETRY_TIMEOUT_NS = 200 * HOST_MS; /* without rotor positions */

void host_fail_node(struct host *host, size_t bus, unsigned address, const char *what)
{
    if (host->phase != HOST_FAILED) { /* the first failure is the cause of the others */
        snprintf(host->message, sizeof host->message, "board %u on %s %s", address,
                 host->config.port[bus]->bus, what);
        host->phase = HOST_FAILED;
    }
}

enum { FAULTS_TEXT = 128 };

/* ": over-current, under-voltage", what a fault without a name may mean, or nothing */
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
