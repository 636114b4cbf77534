/* SPDX-License-Identifier: Apache-2.0 */
/* Queries CAN interfaces by rtnetlink and controls them by libsocketcan. */
#include "canbus/interface.h"

#include <errno.h>
#include <inttypes.h>
#include <libsocketcan.h>
#include <linux/capability.h>
#include <math.h>
#include <net/if_arp.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { BITRATE_MAX = 1000000, RESTART_MS_MAX = 3600000 };

/* Largest accepted relative difference from the requested bit rate. */
static const double BITRATE_TOLERANCE = 0.005;

/* Tolerance of the sample point, fraction of a bit: half a time quantum of a controller with eight
 * quanta per bit, the fewest. */
static const double SAMPLE_POINT_TOLERANCE = 0.0625;

enum interface_kind interface_kind(const struct link_info *info)
{
    if (info->type != ARPHRD_CAN) {
        return INTERFACE_NOT_CAN;
    }
    if (strcmp(info->kind, "can") == 0) {
        return INTERFACE_CONTROLLER;
    }
    return strcmp(info->kind, "vcan") == 0 || strcmp(info->kind, "vxcan") == 0 ? INTERFACE_VIRTUAL
                                                                               : INTERFACE_OTHER;
}

bool interface_bitrate_fits(uint32_t actual, int64_t wanted)
{
    return fabs((double)actual - (double)wanted) <= BITRATE_TOLERANCE * (double)wanted;
}

bool interface_is_set(const struct link_info *info, const struct interface_settings *settings)
{
    const struct link_controller *controller = &info->controller;
    const double sample_point = (double)controller->timing.sample_point * 1e-3;

    return interface_bitrate_fits(controller->timing.bitrate, settings->bitrate) &&
           controller->restart_ms == settings->restart_ms &&
           (settings->sample_point == 0.0 ||
            fabs(sample_point - settings->sample_point) <= SAMPLE_POINT_TOLERANCE);
}

const char *interface_state_name(enum can_state state)
{
    static const char *const names[CAN_STATE_MAX] = {
        [CAN_STATE_ERROR_ACTIVE] = "error active",
        [CAN_STATE_ERROR_WARNING] = "error warning",
        [CAN_STATE_ERROR_PASSIVE] = "error passive",
        [CAN_STATE_BUS_OFF] = "bus-off",
        [CAN_STATE_STOPPED] = "stopped",
        [CAN_STATE_SLEEPING] = "sleeping",
    };

    return names[state];
}

bool interface_port_state(const struct link_info *info, enum can_port_state *state)
{
    static const enum can_port_state states[CAN_STATE_STOPPED] = {
        [CAN_STATE_ERROR_ACTIVE] = CAN_PORT_UP,
        [CAN_STATE_ERROR_WARNING] = CAN_PORT_WARNING,
        [CAN_STATE_ERROR_PASSIVE] = CAN_PORT_PASSIVE,
        [CAN_STATE_BUS_OFF] = CAN_PORT_BUS_OFF,
    };

    if (!info->up || info->controller.state >= CAN_STATE_STOPPED) {
        return false;
    }
    *state = states[info->controller.state];
    return true;
}

/* Queries an interface from the kernel; ERROR_INPUT = no such interface. */
static enum error_code interface_query(void *context, const char *name, struct link_info *info,
                                       struct error *error)
{
    const int link = link_open();
    int failure;

    (void)context;
    if (link < 0) {
        return error_set_errno(error, errno, "cannot open a netlink socket");
    }
    failure = link_query(link, name, info);
    close(link);
    if (failure == ENODEV) {
        return error_set(error, ERROR_INPUT, "no interface %s", name);
    }
    return failure
               ? error_set_errno(error, failure, "cannot ask the kernel about interface %s", name)
               : ERROR_NONE;
}

/* Checks whether this process has CAP_NET_ADMIN. */
static bool interface_may_administer(void)
{
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3] = {{0}};

    return !syscall(SYS_capget, &header, data) &&
           (data[CAP_TO_INDEX(CAP_NET_ADMIN)].effective & CAP_TO_MASK(CAP_NET_ADMIN));
}

/* Checks the causes of failures beforehand, because libsocketcan only prints them. */
static enum error_code interface_check_controller(const char *name, struct link_info *info,
                                                  struct error *error)
{
    enum error_code code = interface_query(NULL, name, info, error);

    if (code) {
        return code;
    }
    if (interface_kind(info) != INTERFACE_CONTROLLER) {
        return error_set(error, ERROR_INPUT, "interface %s is %s%s, which has no controller to set",
                         name, info->kind[0] ? "of kind " : "no CAN controller",
                         info->kind[0] ? info->kind : "");
    }
    if (!interface_may_administer()) {
        return error_set(error, ERROR_SYSTEM,
                         "no permission to set interface %s: it needs CAP_NET_ADMIN", name);
    }
    return ERROR_NONE;
}

/* Converts a result of libsocketcan and errno into an error. */
static enum error_code interface_check_result(int result, const char *name, const char *what,
                                              struct error *error)
{
    return result ? error_set_errno(error, errno, "cannot %s interface %s", what, name)
                  : ERROR_NONE;
}

enum error_code interface_start(const char *name, struct error *error)
{
    struct link_info info;
    enum error_code code = interface_check_controller(name, &info, error);

    return code ? code : interface_check_result(can_do_start(name), name, "start", error);
}

enum error_code interface_stop(const char *name, struct error *error)
{
    struct link_info info;
    enum error_code code = interface_check_controller(name, &info, error);

    return code ? code : interface_check_result(can_do_stop(name), name, "stop", error);
}

/* Sets bit rate and restart time of a stopped controller, and checks the result. */
static enum error_code interface_apply_settings(const char *name,
                                                const struct interface_settings *settings,
                                                struct error *error)
{
    const uint32_t bitrate = (uint32_t)settings->bitrate;
    const uint32_t sample_point = (uint32_t)lround(settings->sample_point * 1e3);
    struct link_info info;
    enum error_code code;

    /* A sample point of 0 is the driver's choice */
    code = interface_check_result(sample_point
                                      ? can_set_bitrate_samplepoint(name, bitrate, sample_point)
                                      : can_set_bitrate(name, bitrate),
                                  name, "set the bit rate of", error);
    code = code ? code
                : interface_check_result(can_set_restart_ms(name, (uint32_t)settings->restart_ms),
                                         name, "set the restart of", error);

    /* The driver uses the nearest bit rate of its clock, which may be far off */
    code = code ? code : interface_query(NULL, name, &info, error);
    if (code) {
        return code;
    }
    if (!interface_is_set(&info, settings)) {
        return error_set(error, ERROR_INPUT,
                         "interface %s cannot make %" PRId64 " bit/s with sample point %.3f from "
                         "its clock of %u Hz; it would be %u bit/s and %.3f",
                         name, settings->bitrate, settings->sample_point,
                         info.controller.clock.freq, info.controller.timing.bitrate,
                         (double)info.controller.timing.sample_point * 1e-3);
    }
    return ERROR_NONE;
}

/* Stops a controller, applies the settings, and starts it again. On failure restores the old
 * settings. */
static enum error_code interface_configure(void *context, const char *name,
                                           const struct interface_settings *settings,
                                           struct error *error)
{
    struct link_info before;
    enum error_code code;

    (void)context;

    /* Check the ranges of bit rate, sample point and restart time */
    if (settings->bitrate < 1 || settings->bitrate > BITRATE_MAX) {
        return error_set(error, ERROR_INPUT,
                         "interface %s: bit rate %" PRId64 ", expected 1 to %d bit/s", name,
                         settings->bitrate, BITRATE_MAX);
    }
    if (!(settings->sample_point >= 0.0 && settings->sample_point < 1.0)) {
        return error_set(error, ERROR_INPUT,
                         "interface %s: sample point %g, expected a part of a bit below 1", name,
                         settings->sample_point);
    }
    if (settings->restart_ms < 0 || settings->restart_ms > RESTART_MS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "interface %s: restart after %" PRId64 " ms, expected 0 to %d", name,
                         settings->restart_ms, RESTART_MS_MAX);
    }

    /* A controller takes settings only while it is stopped */
    code = interface_check_controller(name, &before, error);
    code = code ? code : interface_stop(name, error);
    if (code) {
        return code;
    }
    code = interface_apply_settings(name, settings, error);
    if (!code) {
        return interface_start(name, error);
    }

    /* Restore the old settings, because other programs may use this interface */
    if (before.controller.timing.bitrate) {
        can_set_bittiming(name, &before.controller.timing);
        can_set_restart_ms(name, before.controller.restart_ms);
    }
    if (before.up) {
        can_do_start(name);
    }
    return code;
}

/* Restarts a controller that is bus-off; any other state is an error. */
static enum error_code interface_restart(void *context, const char *name, struct error *error)
{
    struct link_info info;
    enum error_code code = interface_check_controller(name, &info, error);

    (void)context;
    if (code) {
        return code;
    }
    if (!info.up || info.controller.state != CAN_STATE_BUS_OFF) {
        return error_set(error, ERROR_INPUT, "interface %s is %s, expected bus-off for a restart",
                         name, info.up ? interface_state_name(info.controller.state) : "down");
    }
    return interface_check_result(can_do_restart(name), name, "restart", error);
}

const struct interface_ops interface_kernel = {
    .query = interface_query,
    .configure = interface_configure,
    .restart = interface_restart,
};
