/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Real CAN interfaces: settings, state and control of their controllers. Queries use one rtnetlink
 * request (canbus/link.h): it prints nothing, and its answer is consistent. Settings use
 * libsocketcan, and only for controllers. On virtual interfaces the library prints to stderr and
 * fails. It also prints a line when the kernel refuses a setting, in addition to the returned
 * error. Setting needs CAP_NET_ADMIN.
 *
 * Not RT-safe: calls open sockets and wait for the kernel's interface lock. Functions that only
 * read a struct link_info or a state are RT-safe.
 */
#ifndef CANBUS_INTERFACE_H
#define CANBUS_INTERFACE_H

#include "canbus/link.h"
#include "canbus/port.h"

enum interface_kind {
    INTERFACE_NOT_CAN,
    INTERFACE_VIRTUAL,    /* vcan, vxcan: any bit rate, no states */
    INTERFACE_CONTROLLER, /* can */
    INTERFACE_OTHER,      /* carries CAN frames, but has no settings */
};

struct interface_settings {
    int64_t bitrate;     /* bit/s */
    double sample_point; /* fraction of a bit, 0 to 1; 0 = the driver's choice */
    int64_t restart_ms;  /* delay of the kernel's restart after bus-off; 0 = no restart */
};

/* Operations on interfaces, for a supervisor. A test can supply its own operations. */
struct interface_ops {
    /* ERROR_INPUT when there is no such interface. */
    enum error_code (*query)(void *context, const char *name, struct link_info *info,
                             struct error *error);

    /* Stops a controller, applies the settings and starts it. If it refuses the settings, restores
     * the old ones; a controller that was down then stays down. */
    enum error_code (*configure)(void *context, const char *name,
                                 const struct interface_settings *settings, struct error *error);

    /* Restarts a controller in bus-off now; ERROR_INPUT in any other state. */
    enum error_code (*restart)(void *context, const char *name, struct error *error);
    void *context;
};

extern const struct interface_ops interface_kernel;

enum interface_kind interface_kind(const struct link_info *info);

/* Checks whether two bit rates are close enough (0.5 %) to communicate. */
bool interface_bitrate_fits(uint32_t actual, int64_t wanted);

/* Checks whether a controller has these settings. */
bool interface_is_set(const struct link_info *info, const struct interface_settings *settings);

/* Returns the name of a state: "error active", ... */
const char *interface_state_name(enum can_state state);

/* Converts a controller's state to a port state; false = the controller is stopped. */
bool interface_port_state(const struct link_info *info, enum can_port_state *state);

/* Start and stop a controller. No effect if it is already in this state. */
enum error_code interface_start(const char *name, struct error *error);
enum error_code interface_stop(const char *name, struct error *error);

#endif
