/* SPDX-License-Identifier: Apache-2.0 */
/* Opens a rig's buses, joins them as a participant, and advances buses with timing. */
#include "sim/buses.h"

#include "base/text.h"
#include "canbus/paced.h"
#include "sim/interfaces.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum {
    /* Capacities of the inbox of a participant, in frames. The first is for a thread that may be
     * late. The second is for a reader in the simulator's thread that reads in the same tick; it is
     * small to stay in the processor's cache */
    LOCAL_INBOX = 4096,
    LOCAL_INBOX_INLINE = 1024,
    INTERFACE_MAX = 15,          /* IFNAMSIZ minus the terminating zero */
    WIRE_QUEUE = 256,            /* frames queued in a CAN controller */
    WIRE_RESTART_NS = 100000000, /* from bus-off to the start of the recovery */
    SEEK_NS = 1000000000,
};

/* Applies a --bus option, "NAME=INTERFACE", to the interface of a bus. */
static enum error_code bus_apply_override(struct buses *buses, const char *item,
                                          struct error *error)
{
    const char *equals = strchr(item, '=');
    char name[64];
    int bus;

    if (!equals || equals == item || equals[1] == '\0' || equals - item >= (int)sizeof name) {
        return error_set(error, ERROR_INPUT,
                         "--bus: found \"%.100s\", expected NAME=INTERFACE, as in left_leg=can1",
                         item);
    }
    if (strlen(equals + 1) > INTERFACE_MAX) {
        return error_set(error, ERROR_INPUT,
                         "--bus: found interface \"%.100s\", expected a name of at most %d "
                         "characters",
                         equals + 1, INTERFACE_MAX);
    }
    snprintf(name, sizeof name, "%.*s", (int)(equals - item), item);
    bus = rig_find_bus(buses->rig, name);
    if (bus < 0) {
        /* Refuses a --bus option whose bus the rig does not have, and suggests the nearest name */
        const char *names[RIG_BUSES_MAX], *nearest;
        char list[256] = "";

        for (size_t b = 0; b < buses->rig->nbus; b++) {
            size_t used = strlen(list);

            names[b] = buses->rig->bus[b].name;
            snprintf(list + used, sizeof list - used, "%s%s", b ? ", " : "", names[b]);
        }
        nearest = text_nearest(name, names, buses->rig->nbus);
        return error_set(
            error, ERROR_INPUT,
            "--bus: found \"%.100s\", but the rig has no bus \"%.50s\"; expected one of %s%s%s%s",
            item, name, list, nearest ? "; did you mean \"" : "", nearest ? nearest : "",
            nearest ? "\"?" : "");
    }
    buses->interface[bus] = equals + 1;
    return ERROR_NONE;
}

/* Checks that each bus has its own interface. Two buses on one interface would mix their boards'
 * addresses. */
static enum error_code buses_check_distinct(const struct buses *buses, struct error *error)
{
    for (size_t b = 0; b < buses->rig->nbus; b++) {
        for (size_t a = 0; a < b; a++) {
            if (strcmp(buses->interface[a], buses->interface[b]) == 0) {
                return error_set(error, ERROR_INPUT,
                                 "buses %s and %s are both on interface %s, expected one each",
                                 buses->rig->bus[a].name, buses->rig->bus[b].name,
                                 buses->interface[a]);
            }
        }
    }
    return ERROR_NONE;
}

/* Returns the number of CAN controllers of the simulator on a bus: one per board, at least one. */
static size_t bus_count_controllers(const struct rig_bus *bus)
{
    return bus->nboard ? bus->nboard : 1;
}

/* Creates a local bus for each bus of the rig, with or without a wire. */
static enum error_code buses_create_local(struct buses *buses, size_t guests, bool apart,
                                          struct arena *arena, struct error *error)
{
    const struct rig *rig = buses->rig;

    /* STEP and DONE bypass the wire, because they do not exist on a real bus */
    for (size_t b = 0; b < rig->nbus; b++) {
        const struct rig_bus *bus = &rig->bus[b];
        const struct local_bus_config config = {
            .name = buses->interface[b],
            .max_nodes = 1 + guests,
            .inbox = apart ? LOCAL_INBOX : LOCAL_INBOX_INLINE,
            .fd = bus->fd,
            .mode = rig->wire.timed ? LOCAL_BUS_WIRE : LOCAL_BUS_IDEAL,
            .bitrate = bus->bitrate,
            .data_bitrate = bus->data_bitrate,
            .wire_nodes = bus_count_controllers(bus) + guests,
            .queue = WIRE_QUEUE,
            .fifo = rig->wire.fifo,
            .restart_delay_ns = WIRE_RESTART_NS,
            .seed = b,
            .bypass_id = {rig->lockstep.step_id, rig->lockstep.done_id},
            .nbypass = 2,
        };
        enum error_code code = local_bus_create(&config, arena, &buses->bus[b], error);

        if (code) {
            buses_close(buses);
            return code;
        }
        buses->wire[b] = local_bus_wire(buses->bus[b]);
    }
    buses->timed = rig->wire.timed;
    return ERROR_NONE;
}

enum error_code buses_open(const struct rig *rig, enum bus_transport transport,
                           const char *const *overrides, size_t noverride, size_t guests,
                           bool apart, struct arena *arena, struct buses *buses, char notice[256],
                           struct error *error)
{
    enum error_code code = ERROR_NONE;

    memset(buses, 0, sizeof *buses);
    notice[0] = '\0';
    if (rig->nbus > RIG_BUSES_MAX) {
        return error_set(error, ERROR_INPUT, "%s: found %zu buses, expected at most %d", rig->file,
                         rig->nbus, RIG_BUSES_MAX);
    }

    /* Assigns an interface to each bus: from the rig, or from --bus */
    buses->rig = rig;
    for (size_t b = 0; b < rig->nbus; b++) {
        buses->interface[b] = rig->bus[b].interface;
    }
    for (size_t i = 0; !code && i < noverride; i++) {
        code = bus_apply_override(buses, overrides[i], error);
    }
    code = code ? code : buses_check_distinct(buses, error);
    if (code) {
        return code;
    }
    /* The rig names an interface, so it needs SocketCAN: reports why it is missing */
    if (transport == TRANSPORT_AUTO && noverride == 0 && !socketcan_available()) {
        snprintf(notice, 256,
                 "this kernel has no CAN: the buses are local to this process; only "
                 "a task started with --task and clients of --gateway can reach them");
        transport = TRANSPORT_LOCAL;
    }
    buses->local = transport == TRANSPORT_LOCAL;
    return buses->local ? buses_create_local(buses, guests, apart, arena, error)
                        : interfaces_prepare(rig, buses->interface, &interface_kernel, error);
}

/* Claims an interface by an abstract socket. Its name exists as long as the process, and is
 * visible in the interface's network namespace. Returns whether another process has claimed it. */
static bool bus_is_claimed(const char *interface, int *claim)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int length = snprintf(address.sun_path + 1, sizeof address.sun_path - 1, "coman-hil/boards/%s",
                          interface);
    socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)length);

    *claim = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    return *claim >= 0 && bind(*claim, (const struct sockaddr *)&address, size) &&
           errno == EADDRINUSE;
}

void buses_claim(struct buses *buses, char notice[256])
{
    size_t used = 0;

    notice[0] = '\0';
    for (size_t b = 0; b < buses->rig->nbus && !buses->local; b++) {
        if (bus_is_claimed(buses->interface[b], &buses->claim[buses->nclaim++]) && used < 64) {
            used += (size_t)snprintf(notice + used, 256 - used, "%s%s", used ? ", " : "",
                                     buses->interface[b]);
        }
    }
    if (used > 0) {
        snprintf(notice + used, 256 - used,
                 ": another coman-hil plays boards there too; unless they are other boards, each "
                 "frame is answered twice (coman-hil ctl finds it)");
    }
}

/* Joins a bus as one participant, or for all its boards; opens the port. */
static enum error_code bus_join(struct buses *buses, size_t bus, bool boards, struct arena *arena,
                                struct can_port **port, struct error *error)
{
    struct socketcan_config config = {.interface = buses->interface[bus],
                                      .fd = buses->rig->bus[bus].fd,
                                      .controller = &buses->state[bus],
                                      .sought = boards};
    size_t nodes = boards ? bus_count_controllers(&buses->rig->bus[bus]) : 1;

    if (buses->local) {
        return local_bus_join(buses->bus[bus], nodes, NULL, 0, port, error);
    }
    if (socketcan_open(&config, arena, port, error)) {
        return error_prefix(error, "bus %s", buses->rig->bus[bus].name);
    }
    buses->sought[bus] = boards ? *port : buses->sought[bus];
    return ERROR_NONE;
}

/* Puts a wire in virtual time before the simulator's SocketCAN port. */
static enum error_code bus_add_pacing(struct buses *buses, size_t b, struct arena *arena,
                                      struct can_port **port, struct error *error)
{
    const struct rig *rig = buses->rig;
    const struct paced_port_config config = {
        .port = *port,
        .bitrate = rig->bus[b].bitrate,
        .data_bitrate = rig->bus[b].data_bitrate,
        .nodes = bus_count_controllers(&rig->bus[b]),
        .queue = WIRE_QUEUE,
        .fifo = rig->wire.fifo,
        .bypass_id = {rig->lockstep.step_id, rig->lockstep.done_id},
        .nbypass = 2,
    };
    enum error_code code = paced_port_create(&config, arena, &buses->paced[b], error);

    if (code) {
        return code;
    }
    *port = buses->paced[b];
    buses->wire[b] = paced_port_wire(*port);
    buses->timed = true;
    return ERROR_NONE;
}

/* Joins all buses or none, as the boards or as one more participant. */
static enum error_code buses_join_all(struct buses *buses, bool boards, struct arena *arena,
                                      struct bus_ports *ports, struct error *error)
{
    memset(ports, 0, sizeof *ports);
    for (size_t b = 0; b < buses->rig->nbus; b++) {
        enum error_code code = bus_join(buses, b, boards, arena, &ports->port[b], error);

        ports->count += !code;
        if (!code && boards && !buses->local && buses->rig->wire.paced) {
            code = bus_add_pacing(buses, b, arena, &ports->port[b], error);
        }
        if (code) {
            bus_ports_close(ports);
            return code;
        }
    }
    return ERROR_NONE;
}

enum error_code buses_join_boards(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                                  struct error *error)
{
    return buses_join_all(buses, true, arena, ports, error);
}

enum error_code buses_join(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                           struct error *error)
{
    return buses_join_all(buses, false, arena, ports, error);
}

int64_t buses_advance(const struct buses *buses, size_t bus, int64_t now_ns)
{
    if (buses->bus[bus]) {
        return local_bus_advance(buses->bus[bus], now_ns);
    }
    if (buses->paced[bus]) {
        paced_port_advance(buses->paced[bus], now_ns);
    }
    return now_ns;
}

void buses_tap(const struct buses *buses, size_t bus,
               void (*tap)(void *context, const struct bus_frame *frame), void *context)
{
    if (buses->bus[bus]) {
        local_bus_tap(buses->bus[bus], tap, context);
    } else {
        paced_port_tap(buses->paced[bus], tap, context);
    }
}

void buses_seek(struct buses *buses, int64_t now_ns)
{
    if (now_ns < buses->seek_ns) {
        return;
    }
    buses->seek_ns = now_ns + SEEK_NS;
    for (size_t b = 0; b < buses->rig->nbus; b++) {
        if (buses->sought[b]) {
            socketcan_seek(buses->sought[b]);
        }
    }
}

void bus_ports_close(struct bus_ports *ports)
{
    for (size_t b = 0; b < ports->count; b++) {
        ports->port[b]->ops->close(ports->port[b]);
    }
    ports->count = 0;
}

void buses_close(struct buses *buses)
{
    for (size_t b = 0; b < RIG_BUSES_MAX; b++) {
        if (buses->bus[b]) {
            local_bus_destroy(buses->bus[b]);
            buses->bus[b] = NULL;
        }
    }
    while (buses->nclaim > 0) {
        if (buses->claim[--buses->nclaim] >= 0) {
            close(buses->claim[buses->nclaim]);
        }
    }
}
