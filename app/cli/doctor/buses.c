/* SPDX-License-Identifier: Apache-2.0 */
/* Examines CAN interfaces, and the load of a rig's buses. */
#include "app/cli/doctor/private.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ARPHRD_CAN = 280 }; /* type of a CAN interface in sysfs, as in linux/if_arp.h */

/* Transmit queue, frames, below which a controller may lose frames when a tick's batch is sent. */
enum { SHORT_QUEUE = 100 };

/* Checks whether an interface is a virtual CAN (vcan). */
static bool interface_is_virtual(const struct doctor *d, const char *interface)
{
    char text[64];

    return doctor_read_line(d, text, sizeof text, "/sys/devices/virtual/net/%s/type", interface);
}

/* Examines the interface of a bus: that it is there, is CAN, is up, and has a long enough queue. */
static void examine_interface(struct doctor *d, const struct rig_bus *bus)
{
    const char *name = bus->interface;
    char type[64], flags[64] = "0", queue[64] = "0", fix[192];
    bool up, is_virtual = interface_is_virtual(d, name);

    if (!doctor_read_line(d, type, sizeof type, "/sys/class/net/%s/type", name)) {
        snprintf(fix, sizeof fix, "ip link add dev %s type vcan && ip link set up %s", name, name);
        doctor_add_finding(d, DOCTOR_FAIL, "interface", fix,
                           "%s of bus %s: there is no such interface", name, bus->name);
        return;
    }

    /* Judge its state in the order in which it would stop a run */
    doctor_read_line(d, flags, sizeof flags, "/sys/class/net/%s/flags", name);
    doctor_read_line(d, queue, sizeof queue, "/sys/class/net/%s/tx_queue_len", name);
    up = (strtoul(flags, NULL, 16) & 1) != 0;
    if (strtol(type, NULL, 10) != ARPHRD_CAN) {
        doctor_add_finding(d, DOCTOR_FAIL, "interface",
                           "name another one: run --bus NAME=INTERFACE",
                           "%s of bus %s is no CAN interface", name, bus->name);
    } else if (!up && is_virtual) {
        snprintf(fix, sizeof fix, "ip link set up %s", name);
        doctor_add_finding(d, DOCTOR_FAIL, "interface", fix, "%s of bus %s is down", name,
                           bus->name);
    } else if (!up && bus->configure && doctor_has_capability(d, CAP_NET_ADMIN)) {
        doctor_add_finding(d, DOCTOR_OK, "interface", "",
                           "%s of bus %s is down: a run sets it to %" PRId64 " bit/s and starts it",
                           name, bus->name, bus->bitrate);
    } else if (!up) {
        snprintf(fix, sizeof fix, "ip link set %s up type can bitrate %" PRId64 " restart-ms 100",
                 name, bus->bitrate);
        doctor_add_finding(d, DOCTOR_FAIL, "interface", fix, "%s of bus %s is down", name,
                           bus->name);
    } else if (!is_virtual && strtol(queue, NULL, 10) < SHORT_QUEUE) {
        snprintf(fix, sizeof fix, "ip link set %s txqueuelen 1000", name);
        doctor_add_finding(d, DOCTOR_WARN, "interface", fix,
                           "%s of bus %s queues %s frames only: a tick's batch may be lost", name,
                           bus->name, queue);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "interface", "", "%s of bus %s is up%s", name, bus->name,
                           is_virtual ? ", virtual" : "");
    }
}

/* Checks whether a CAN controller runs at another bit rate than the rig says; adds the finding
 * then. */
static bool bitrate_is_wrong(struct doctor *d, const struct rig_bus *bus,
                             const struct link_info *info)
{
    const uint32_t actual = info->controller.timing.bitrate;
    char fix[192];

    if (interface_bitrate_fits(actual, bus->bitrate)) {
        return false;
    }
    snprintf(fix, sizeof fix,
             "ip link set %s down && ip link set %s type can bitrate %" PRId64
             " && ip link set %s up, or configure: true in the rig",
             bus->interface, bus->interface, bus->bitrate, bus->interface);

    /* A run that configures the interface mends it, if it has the right to */
    if (!bus->configure) {
        doctor_add_finding(d, DOCTOR_FAIL, "controller", fix,
                           "%s of bus %s runs at %u bit/s, the rig says %" PRId64, bus->interface,
                           bus->name, actual, bus->bitrate);
    } else if (!doctor_has_capability(d, CAP_NET_ADMIN)) {
        doctor_add_finding(d, DOCTOR_FAIL, "controller", "run it with CAP_NET_ADMIN",
                           "%s of bus %s is to be set to %" PRId64
                           " bit/s, which this process may not do",
                           bus->interface, bus->name, bus->bitrate);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "controller", "",
                           "%s of bus %s runs at %u bit/s: a run sets it to %" PRId64,
                           bus->interface, bus->name, actual, bus->bitrate);
    }
    return true;
}

/* Examines the state of a CAN controller that is up, which only netlink tells. */
static void examine_can_controller(struct doctor *d, const struct rig_bus *bus)
{
    const struct interface_ops *ops = d->config->interfaces;
    const char *name = bus->interface;
    const struct link_controller *c;
    struct link_info info;
    char fix[192];

    if (!ops || ops->query(ops->context, name, &info, NULL) || !info.up ||
        interface_kind(&info) != INTERFACE_CONTROLLER || bitrate_is_wrong(d, bus, &info)) {
        return;
    }

    /* Judge the worst first: bus-off, errors, and a bus-off that would last */
    c = &info.controller;
    if (c->state == CAN_STATE_BUS_OFF) {
        snprintf(fix, sizeof fix, "check cable and terminators; ip link set %s type can restart",
                 name);
        doctor_add_finding(d, DOCTOR_FAIL, "controller", fix, "%s of bus %s is in bus-off", name,
                           bus->name);
    } else if (c->state != CAN_STATE_ERROR_ACTIVE) {
        doctor_add_finding(
            d, DOCTOR_WARN, "controller",
            "check cable, terminators, and that another node is on with the same bit rate",
            "%s of bus %s is %s (TEC %u, REC %u)", name, bus->name, interface_state_name(c->state),
            c->errors.txerr, c->errors.rxerr);
    } else if (!c->restart_ms && !bus->configure) {
        snprintf(fix, sizeof fix, "ip link set %s down; ip link set %s up type can restart-ms 100",
                 name, name);
        doctor_add_finding(d, DOCTOR_WARN, "controller", fix,
                           "%s of bus %s stays in bus-off once it is there: it has no restart-ms",
                           name, bus->name);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "controller", "",
                           "%s of bus %s is error active at %u bit/s", name, bus->name,
                           c->timing.bitrate);
    }
}

/* Examines the room for frames while the loop is delayed: without CAP_NET_ADMIN a socket's buffer
 * is at most as large as the kernel allows every process. */
static void examine_receive_buffer(struct doctor *d)
{
    /* The buffer that a run asks for, bytes, and what a frame takes of it with the kernel's own
     * overhead. */
    enum { WANTED = 4 << 20, FRAME_COST = 384 /* of that size, with the kernel's own account */ };
    char text[DOCTOR_TEXT];
    long long most;

    if (doctor_has_capability(d, CAP_NET_ADMIN) ||
        !doctor_read_line(d, text, sizeof text, "/proc/sys/net/core/rmem_max")) {
        return;
    }
    most = strtoll(text, NULL, 10);
    if (most < WANTED) {
        doctor_add_finding(d, DOCTOR_WARN, "receive buffer", "sysctl -w net.core.rmem_max=4194304",
                           "%lld bytes, about %lld frames, wait for the loop at most; more are "
                           "lost, and counted",
                           most, most / FRAME_COST);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "receive buffer", "",
                           "%lld bytes of frames may wait for the loop", most);
    }
}

/* Examines whether the kernel has CAN, then each interface and controller of the rig. */
static void examine_kernel_can(struct doctor *d)
{
    char text[DOCTOR_TEXT];

    /* The kernel registers the protocol family once the module has been loaded */
    if (!doctor_read_entry(d, "/proc/net/protocols", "CAN_RAW", text, sizeof text) &&
        !doctor_read_line(d, text, sizeof text, "/proc/net/can/version")) {
        doctor_add_finding(d, DOCTOR_WARN, "CAN", "modprobe can-raw vcan",
                           "the kernel has no CAN now: buses stay inside the process");
        return;
    }
    doctor_add_finding(d, DOCTOR_OK, "CAN", "", "the kernel has raw CAN sockets");
    examine_receive_buffer(d);
    for (size_t i = 0; i < d->config->rig->nbus; i++) {
        examine_interface(d, &d->config->rig->bus[i]);
        examine_can_controller(d, &d->config->rig->bus[i]);
    }
}

/* Examines whether a bus carries its worst-case load, telemetry and commands together. */
static void examine_bus_load(struct doctor *d, size_t bus)
{
    const struct rig *rig = d->config->rig;
    double telemetry, commands, percent;

    rig_bus_load(rig, bus, rig->servo.command_period_ns, &telemetry, &commands);
    percent = 100.0 * (telemetry + commands) / (double)rig->bus[bus].bitrate;
    if (percent > 100.0) {
        doctor_add_finding(
            d, DOCTOR_WARN, "bus load", "coman-hil check tells which split or rate fits",
            "%s needs %.0f %% of its wire in the worst case", rig->bus[bus].name, percent);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "bus load", "",
                           "%s needs %.0f %% of its wire in the worst case", rig->bus[bus].name,
                           percent);
    }
}

void doctor_examine_buses(struct doctor *d)
{
    if (!d->config->local) {
        examine_kernel_can(d);
    }
    for (size_t i = 0; i < d->config->rig->nbus; i++) {
        examine_bus_load(d, i);
    }
}
