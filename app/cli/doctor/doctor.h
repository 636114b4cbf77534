/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Examines a machine for obstacles to a 1 kHz loop: the kernel, the rights of this process,
 * processors, interrupts, power saving, the module of a contact engine, CAN interfaces, the load of
 * the rig's buses, the external boards. It reads files in /proc and /sys, queries CAN controllers
 * and listens; it changes and sends nothing. Not RT-safe.
 */
#ifndef APP_CLI_DOCTOR_DOCTOR_H
#define APP_CLI_DOCTOR_DOCTOR_H

#include "canbus/interface.h"
#include "canbus/port.h"
#include "rig/rig.h"
#include "rt/clock.h"

enum doctor_verdict {
    DOCTOR_OK,
    DOCTOR_WARN, /* possible, but deadlines may be missed */
    DOCTOR_FAIL, /* the rig cannot run as configured */
};

/* One examined item. */
struct doctor_finding {
    enum doctor_verdict verdict;
    const char *subject; /* "kernel", "irq affinity", ... */
    char found[192];     /* the finding; for a warning also its consequence */
    char fix[192];       /* command that fixes it; "" = none needed or known */
};

enum { DOCTOR_FINDINGS_MAX = 128 };

/* What to examine, and how. */
struct doctor_config {
    const char *root; /* prefix of /proc and /sys: "", or a test's directory */
    const struct rig *rig;
    /* the buses are inside the process: skip CAN interfaces */
    bool local;
    const struct interface_ops *interfaces; /* NULL = do not query controllers */
    /* Ports for listening to external boards, one per bus. A NULL element skips its bus; port NULL
     * skips all. Listening takes listen_ns by the clock; memory is from arena */
    struct can_port **port;
    int64_t listen_ns;
    struct clock *clock;
    struct arena *arena;
};

/* Writes at most max findings, in a fixed order. Returns their number. */
size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max);

/* Returns the worst verdict of the findings. */
enum doctor_verdict doctor_verdict(const struct doctor_finding *findings, size_t count);

/* Checks whether a list of processors in the kernel's format ("0-3,6") contains this one. Returns
 * false for other text. */
bool doctor_list_has(const char *list, int cpu);

#endif
