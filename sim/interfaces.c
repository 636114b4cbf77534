/* SPDX-License-Identifier: Apache-2.0 */
/* Prepares and watches the SocketCAN interfaces of a rig. */
#include "sim/interfaces.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Period of polling, and window for counting restarts. */
static const int64_t POLL_NS = 1000000000;
static const int64_t MINUTE_NS = 60000000000;

/* Returns the controller settings that a bus requires. */
static struct interface_settings interface_settings_of(const struct rig_bus *bus)
{
    return (struct interface_settings){
        .bitrate = bus->bitrate,
        .sample_point = bus->sample_point,
        .restart_ms = bus->restart_ms,
    };
}

/* ---- before the run ---- */

/* Checks the data bit rate of FD frames, which libsocketcan cannot set. */
static enum error_code interface_check_data_bitrate(const struct rig_bus *bus, const char *name,
                                                    const struct link_info *info,
                                                    struct error *error)
{
    const uint32_t actual = info->controller.data_timing.bitrate;

    if (!bus->fd || interface_bitrate_fits(actual, bus->data_bitrate)) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT,
                     "bus %s: interface %s has a data bit rate of %u bit/s, expected %" PRId64
                     " as the rig says; set it with `ip link set %s down && ip link set %s type "
                     "can bitrate %" PRId64 " dbitrate %" PRId64 " fd on && ip link set %s up`",
                     bus->name, name, actual, bus->data_bitrate, name, name, bus->bitrate,
                     bus->data_bitrate, name);
}

/* Configures a controller or checks its bit rate, according to the bus; accepts virtual
 * interfaces. */
static enum error_code interface_prepare(const struct rig_bus *bus, const char *name,
                                         const struct interface_ops *ops, struct error *error)
{
    const struct interface_settings settings = interface_settings_of(bus);
    struct link_info info;
    enum error_code code = ops->query(ops->context, name, &info, error);

    if (code) {
        return code == ERROR_INPUT ? ERROR_NONE : code;
    }
    if (interface_kind(&info) != INTERFACE_CONTROLLER) {
        return ERROR_NONE;
    }
    code = interface_check_data_bitrate(bus, name, &info, error);
    if (code) {
        return code;
    }
    if (bus->configure) {
        return info.up && interface_is_set(&info, &settings)
                   ? ERROR_NONE
                   : ops->configure(ops->context, name, &settings, error);
    }
    return info.up && !interface_bitrate_fits(info.controller.timing.bitrate, bus->bitrate)
               ? error_set(error, ERROR_INPUT,
                           "bus %s: interface %s runs at %u bit/s, expected %" PRId64
                           " as the rig says; set it with `ip link set %s down && ip link set %s "
                           "type can bitrate %" PRId64
                           " && ip link set %s up`, or let the bus have configure: true",
                           bus->name, name, info.controller.timing.bitrate, bus->bitrate, name,
                           name, bus->bitrate, name)
               : ERROR_NONE;
}

enum error_code interfaces_prepare(const struct rig *rig, const char *const *interface,
                                   const struct interface_ops *ops, struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t b = 0; b < rig->nbus && !code; b++) {
        code = interface_prepare(&rig->bus[b], interface[b], ops, error);
    }
    return code;
}

/* ---- during the run ---- */

void interfaces_init(struct interfaces *interfaces, const struct rig *rig,
                     const char *const *interface, struct can_state_box *box,
                     const struct interface_ops *ops)
{
    memset(interfaces, 0, sizeof *interfaces);
    interfaces->ops = ops;
    interfaces->count = rig->nbus;
    interfaces->next_ns = INT64_MIN;
    for (size_t b = 0; b < rig->nbus; b++) {
        interfaces->watch[b] =
            (struct interface_watch){.name = interface[b], .bus = &rig->bus[b], .box = &box[b]};
    }
}

/* Stores an event of an interface for the log; a later event replaces it. */
__attribute__((format(printf, 2, 3))) static void watch_report(struct interface_watch *watch,
                                                               const char *format, ...)
{
    int used = snprintf(watch->event, sizeof watch->event, "bus %s: interface %s ",
                        watch->bus->name, watch->name);
    va_list args;

    va_start(args, format);
    vsnprintf(watch->event + used, sizeof watch->event - (size_t)used, format, args);
    va_end(args);
}

/* Configures the CAN controller again and reports the cause; returns false on failure. */
static bool watch_configure(struct interface_watch *watch, const struct interface_ops *ops,
                            const char *found)
{
    const struct interface_settings settings = interface_settings_of(watch->bus);
    struct error error;

    if (ops->configure(ops->context, watch->name, &settings, &error)) {
        watch_report(watch, "%s and cannot be set again: %.140s", found, error.text);
        return false;
    }
    watch_report(watch, "%s: set again to %" PRId64 " bit/s", found, watch->bus->bitrate);
    return true;
}

/* Restarts a controller in bus-off, unless the limit per minute is reached. */
static void watch_restart(struct interface_watch *watch, const struct interface_ops *ops,
                          int64_t now_ns)
{
    int64_t *oldest = &watch->restart_ns[watch->restarts % INTERFACES_RESTARTS];
    struct error error;

    if (watch->restarts >= INTERFACES_RESTARTS && now_ns - *oldest < MINUTE_NS) {
        if (!watch->limited) {
            watch_report(watch, "is in bus-off again after %d restarts in a minute, and waits",
                         INTERFACES_RESTARTS);
        }
        watch->limited = true;
        return;
    }
    watch->limited = false;
    if (ops->restart(ops->context, watch->name, &error)) {
        watch_report(watch, "is in bus-off and cannot be restarted: %.140s", error.text);
        return;
    }
    *oldest = now_ns;
    watch->restarts++;
    watch_report(watch, "was in bus-off: restarted, number %" PRIu64, watch->restarts);
}

/* Polls an interface, repairs it as far as allowed, and posts the controller's state to its
 * ports. */
static void watch_poll(struct interface_watch *watch, const struct interface_ops *ops,
                       int64_t now_ns)
{
    const int before = watch->info.index;
    enum can_port_state state;
    struct link_info info;
    struct error error;

    /* Returns early without an interface; its port reports the absence */
    if (ops->query(ops->context, watch->name, &info, &error) ||
        interface_kind(&info) != INTERFACE_CONTROLLER) {
        return;
    }
    watch->info = info;
    if (watch->seen && info.index != before && watch->bus->configure) {
        if (!watch_configure(watch, ops, "was created anew")) {
            watch->info.index = before; /* tries again at the next poll */
        }
    } else {
        /* Repairs or reports a bit rate that differs from the rig's */
        const uint32_t actual = watch->info.controller.timing.bitrate;
        const bool wrong = watch->info.up && !interface_bitrate_fits(actual, watch->bus->bitrate);
        char found[64];

        snprintf(found, sizeof found, "runs at %u bit/s", actual);
        if (wrong && watch->bus->configure) {
            watch_configure(watch, ops, found);
        } else if (wrong && !watch->mismatch) {
            watch_report(watch, "%s, the rig says %" PRId64 ": it disturbs the bus", found,
                         watch->bus->bitrate);
        }
        watch->mismatch = wrong;

        /* Restarts or reports a controller in bus-off */
        const struct link_controller *controller = &watch->info.controller;
        const bool off = watch->info.up && controller->state == CAN_STATE_BUS_OFF;

        if (off && watch->bus->configure && !controller->restart_ms) {
            watch_restart(watch, ops, now_ns);
        } else if (off && !watch->off) {
            if (controller->restart_ms) {
                watch_report(watch, "is in bus-off; the kernel restarts it after %u ms",
                             controller->restart_ms);
            } else {
                watch_report(
                    watch,
                    "is in bus-off until it is restarted (`ip link set %s type can restart`)",
                    watch->name);
            }
        }
        watch->off = off;
    }
    watch->seen = true;
    if (interface_port_state(&info, &state)) {
        can_state_post(watch->box, state);
    }
}

void interfaces_watch(struct interfaces *interfaces, int64_t now_ns)
{
    if (now_ns < interfaces->next_ns) {
        return;
    }
    interfaces->next_ns = now_ns + POLL_NS;
    for (size_t b = 0; b < interfaces->count; b++) {
        watch_poll(&interfaces->watch[b], interfaces->ops, now_ns);
    }
}

bool interfaces_next_event(struct interfaces *interfaces, size_t *bus, char *text, size_t size)
{
    for (size_t b = 0; b < interfaces->count; b++) {
        struct interface_watch *watch = &interfaces->watch[b];

        if (watch->event[0]) {
            *bus = b;
            snprintf(text, size, "%s", watch->event);
            watch->event[0] = '\0';
            return true;
        }
    }
    return false;
}

bool interfaces_describe(const struct interfaces *interfaces, size_t bus, char *text, size_t size)
{
    const struct interface_watch *watch = &interfaces->watch[bus];
    const struct link_controller *c;
    struct link_info info;
    struct error error;

    if (bus >= interfaces->count ||
        interfaces->ops->query(interfaces->ops->context, watch->name, &info, &error) ||
        interface_kind(&info) != INTERFACE_CONTROLLER) {
        return false;
    }
    c = &info.controller;
    snprintf(text, size,
             "%s, %u bit/s, sample point %.3f, TEC %u, REC %u; times in warning %u, passive %u, "
             "bus-off %u; restarts %u, bus errors %u, arbitration lost %u",
             info.up ? interface_state_name(c->state) : "down", c->timing.bitrate,
             (double)c->timing.sample_point * 1e-3, c->errors.txerr, c->errors.rxerr,
             c->stats.error_warning, c->stats.error_passive, c->stats.bus_off, c->stats.restarts,
             c->stats.bus_error, c->stats.arbitration_lost);
    return true;
}
