/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Real CAN interfaces: settings, state and control of their controllers. Queried by one rtnetlink
 * request of our own (canbus/link.h), which never prints and whose answer is of one moment; set by
 * libsocketcan, which is called for controllers only, since on virtual interfaces it prints to
 * stderr and fails. It also prints a line when the kernel refuses a setting, besides the error that
 * is returned. Setting needs CAP_NET_ADMIN.
 *
 * Not RT-safe: calls open sockets and wait for the kernel's interface lock. Those that take a
 * struct link_info or a state only look at it and are RT-safe.
 */
#ifndef CANBUS_INTERFACE_H
#define CANBUS_INTERFACE_H

#include "base/error.h"
#include "canbus/link.h"
#include "canbus/port.h"

enum interface_kind {
    INTERFACE_NOT_CAN,
    INTERFACE_VIRTUAL,    /* vcan, vxcan: carries any rate, has no states */
    INTERFACE_CONTROLLER, /* can */
    INTERFACE_OTHER,      /* carries CAN frames, but the kernel cannot control it */
};

struct interface_settings {
    int64_t bitrate;     /* bit/s */
    double sample_point; /* 0 to 1, as part of a bit; 0 = the driver's choice */
    int64_t restart_ms;  /* from bus-off to the kernel's restart; 0 = the kernel does not restart */
};

/* The operations of a supervisor of interfaces: the kernel's, or those of a test. */
struct interface_ops {
    /* ERROR_INPUT when there is no such interface. */
    enum error_code (*query)(void *context, const char *name, struct link_info *info,
                             struct error *error);

    /* Stops a controller, sets it and starts it. When it refuses the settings, it goes on with
     * those that it had; one that was down stays down then. */
    enum error_code (*configure)(void *context, const char *name,
                                 const struct interface_settings *settings, struct error *error);

    /* Takes a controller out of bus-off now; ERROR_INPUT when it is in another state. */
    enum error_code (*restart)(void *context, const char *name, struct error *error);
    void *context;
};

extern const struct interface_ops interface_kernel;

enum interface_kind interface_kind(const struct link_info *info);

/* Checks whether a controller's bit rate is near enough (0.5 %) to another to communicate at it. */
bool interface_bitrate_fits(uint32_t actual, int64_t wanted);

/* Checks whether a controller is set as the settings say. */
bool interface_is_set(const struct link_info *info, const struct interface_settings *settings);

/* Returns the name of a state: "error active", ... */
const char *interface_state_name(enum can_state state);

/* Translates a controller's state into that of a port; false = the controller does not run and
 * has none. */
bool interface_port_state(const struct link_info *info, enum can_port_state *state);

/* Put a controller on the bus and take it off; no effect when it is there already. */
enum error_code interface_start(const char *name, struct error *error);
enum error_code interface_stop(const char *name, struct error *error);

#endif
