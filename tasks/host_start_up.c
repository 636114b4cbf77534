/* SPDX-License-Identifier: Apache-2.0 */
/* The host's start-up: finds its boards, configures each, switches the motors on. */
#include "tasks/host_private.h"

static const int64_t DISCOVERY_TIMEOUT_NS = 8000 * HOST_MS; /* boards may boot for five seconds */
static const int64_t DISCOVERY_REPEAT_NS = 250 * HOST_MS;
static const int64_t ENABLE_TIMEOUT_NS = 1000 * HOST_MS; /* a status follows a mode within 10 ms */
static const int64_t REPLY_TIMEOUT_NS = 300 * HOST_MS;   /* for a request, as long as real hosts
                                                          * wait */

enum { REQUEST_TRIES = 3 };

static void host_enter_phase(struct host *host, enum host_phase phase)
{
    host->phase = phase;
    host->phase_since_ns = host->now_ns;
}

/* Calls step for every board of ours; returns true when it was true for all. */
static bool host_every_node(struct host *host,
                            bool (*step)(struct host *, size_t bus, unsigned address))
{
    bool all = true;

    for (size_t b = 0; b < host->config.nbus; b++) {
        for (unsigned a = 1; a < HOST_ADDRESSES; a++) {
            if (host->line[b].node[a].kind != HOST_NO_BOARD && !step(host, b, a)) {
                all = false;
            }
        }
    }
    return all;
}

static bool host_node_found(struct host *host, size_t bus, unsigned address)
{
    return host->line[bus].node[address].found;
}

/* Fails the host for a board that has not answered; host_fail_node keeps the first of these
 * failures. */
static bool host_fail_missing(struct host *host, size_t bus, unsigned address)
{
    if (!host->line[bus].node[address].found) {
        host_fail_node(host, bus, address, "does not answer discovery");
        host->lost = true;
    }
    return true;
}

/* Asks who is there until all boards have answered, and fails after DISCOVERY_TIMEOUT_NS. */
static enum host_phase host_discover(struct host *host)
{
    if (host_every_node(host, host_node_found)) {
        host_enter_phase(host, HOST_CONFIGURING);
        return host->phase;
    }

    /* Asked again and again, for a board that boots answers late */
    if (!host->asked) {
        host->phase_since_ns = host->now_ns;
    }
    if (!host->asked || host->now_ns - host->asked_ns >= DISCOVERY_REPEAT_NS) {
        for (size_t b = 0; b < host->config.nbus; b++) {
            host->line[b].ops->discover(host, b);
        }
        host->asked = true;
        host->asked_ns = host->now_ns;
    }

    /* The message names the first board that is missing */
    if (host->now_ns - host->phase_since_ns > DISCOVERY_TIMEOUT_NS) {
        host_every_node(host, host_fail_missing);
    }
    return host->phase;
}

/* Sends a board one request after the other, each repeated until it is answered. Returns true
 * when all have been. */
static bool host_configure_node(struct host *host, size_t bus, unsigned address)
{
    struct host_node *node = &host->line[bus].node[address];
    struct host_request request = {0};
    bool waits = node->answered < node->requested;

    /* An answer is still due: wait, give up, or ask again */
    if (waits && host->now_ns - node->request_time_ns <= REPLY_TIMEOUT_NS) {
        return false;
    }
    if (waits && node->tries == REQUEST_TRIES) {
        host_fail_node(host, bus, address, "does not answer a start-up request");
        host->lost = true;
        return false;
    }
    if (!host->line[bus].ops->request(host, bus, address, node->answered, &request)) {
        return true;
    }
    /* Requests without an answer count as answered */
    host_queue(host, bus, &request.frame);
    node->requested = node->answered + 1;
    node->answered += !request.reply;
    node->tries = waits ? node->tries + 1 : 1;
    node->request_time_ns = host->now_ns;
    return false;
}

/* Switches all motors off, then on, until every board says so; fails after ENABLE_TIMEOUT_NS. */
static enum host_phase host_enable_motors(struct host *host)
{
    bool all = true;

    /* Off first, which clears a fault of an earlier run; then on, and again what has not obeyed */
    if (host->enabling < 2 || host->now_ns - host->asked_ns >= REPLY_TIMEOUT_NS) {
        for (size_t i = 0; i < host->config.naxis; i++) {
            if (host->enabling < 2 || host->joint[i].motor != HOST_MOTOR_ON) {
                host_set_motor(host, i, host->enabling > 0);
            }
        }
        host->enabling++;
        host->asked_ns = host->now_ns;
    }

    /* On means that the board says so and that both encoders have been heard */
    for (size_t i = 0; i < host->config.naxis; i++) {
        const struct host_joint *joint = &host->joint[i];
        bool ready =
            joint->motor == HOST_MOTOR_ON && joint->motor_time_ns >= 0 && joint->joint_time_ns >= 0;

        if (!ready && host->now_ns - host->phase_since_ns > ENABLE_TIMEOUT_NS) {
            return host_fail_joint(host, i,
                                   joint->motor == HOST_MOTOR_ON ? "reports no position"
                                                                 : "does not switch its motor on");
        }
        all = all && ready;
    }
    if (all) {
        host_enter_phase(host, HOST_READY);
    }
    return host->phase;
}

enum host_phase host_start_up(struct host *host)
{
    switch (host->phase) {
    case HOST_DISCOVERING:
        return host_discover(host);
    case HOST_CONFIGURING:
        if (host_every_node(host, host_configure_node) && host->phase == HOST_CONFIGURING) {
            host_enter_phase(host, HOST_ENABLING);
        }
        return host->phase;
    case HOST_ENABLING:
        return host_enable_motors(host);
    default:
        return host->phase;
    }
}
