/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Examines a machine for what keeps it from a 1 kHz loop: the kernel, the rights of this process,
 * processors, interrupts, power saving, CAN interfaces, the load of the rig's buses, the external
 * boards. Reads files below /proc and /sys, queries CAN controllers and listens; changes and sends
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

/* One thing that was examined. */
struct doctor_finding {
    enum doctor_verdict verdict;
    const char *subject; /* "kernel", "irq affinity", ... */
    char found[192];     /* what was found, and for a warning what follows from it */
    char fix[192];       /* command that puts it right, "" = none is needed or known */
};

enum { DOCTOR_FINDINGS_MAX = 128 };

/* What to examine, and with what. */
struct doctor_config {
    const char *root; /* path before /proc and /sys: "", or a test's directory */
    const struct rig *rig;
    bool local;                             /* buses are inside the process: skip CAN interfaces */
    const struct interface_ops *interfaces; /* NULL = do not query controllers */
    /* Ports on which external boards are listened for, one for each bus: an element of NULL = not
     * on that bus, port NULL = nowhere. Listening takes listen_ns by the clock; memory from
     * arena. */
    struct can_port **port;
    int64_t listen_ns;
    struct clock *clock;
    struct arena *arena;
};

/* Fills at most max findings, in a fixed order; returns their number. */
size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max);

/* Returns the worst verdict of the findings. */
enum doctor_verdict doctor_verdict(const struct doctor_finding *findings, size_t count);

/* Checks whether a list of processors as the kernel writes it ("0-3,6") has this one. False for
 * text that is no such list. */
bool doctor_list_has(const char *list, int cpu);

#endif
