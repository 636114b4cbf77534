/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Examines a machine for what keeps it from 1 kHz: the kernel, the rights of this process,
 * processors, interrupts, power saving, CAN interfaces, the load of the rig's buses, the external
 * boards. Reads files below /proc and /sys, queries CAN controllers and listens, changes and sends
 * nothing. Not RT-safe.
 */
#ifndef APP_CLI_DOCTOR_DOCTOR_H
#define APP_CLI_DOCTOR_DOCTOR_H

#include "canbus/interface.h"
#include "canbus/port.h"
#include "rig/rig.h"
#include "rt/clock.h"

#include <stdbool.h>
#include <stddef.h>

enum doctor_verdict {
    DOCTOR_OK,
    DOCTOR_WARN, /* it runs, but deadlines may be missed */
    DOCTOR_FAIL, /* the rig cannot run as it says */
};

struct doctor_finding {
    enum doctor_verdict verdict;
    const char *subject; /* "kernel", "irq affinity", ... */
    char found[192];     /* what is there, and for a warning what follows from it */
    char fix[192];       /* the command that puts it right, "" = none is needed or none is known */
};

enum { DOCTOR_FINDINGS_MAX = 128 };

struct doctor_config {
    const char *root; /* what stands before /proc and /sys: "", or a test's directory */
    const struct rig *rig;
    bool local; /* the buses are in the process: CAN interfaces are not looked at */
    const struct interface_ops *interfaces; /* NULL = controllers are not asked */
    /* Where external boards are listened for: a port for each bus, NULL = not on that one; none at
     * all with port NULL. For so long, by the clock; memory for it from arena. */
    struct can_port **port;
    int64_t listen_ns;
    struct clock *clock;
    struct arena *arena;
};

/* Fills at most max findings, in an order that does not change; returns how many. */
size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max);

/* The worst of them. */
enum doctor_verdict doctor_verdict(const struct doctor_finding *findings, size_t count);

/* Whether a list of processors as the kernel writes it ("0-3,6") has this one. False for text that
 * is no such list. */
bool doctor_list_has(const char *list, int cpu);

#endif
