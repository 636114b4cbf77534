/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig's buses: SocketCAN interfaces, or local buses in the process when the kernel has no CAN.
 * Opened all or none. Bit rates in bit/s, virtual times in ns. Not RT-safe but where it says so.
 */
#ifndef SIM_BUSES_H
#define SIM_BUSES_H

#include "canbus/port.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>

enum bus_transport {
    TRANSPORT_AUTO, /* socketcan when the kernel has CAN, else local */
    TRANSPORT_SOCKETCAN,
    TRANSPORT_LOCAL,
};

/* The ports of one participant, one for each bus. */
struct bus_ports {
    size_t count;
    struct can_port *port[RIG_BUSES_MAX];
};

struct buses {
    const struct rig *rig;
    const char *interface[RIG_BUSES_MAX]; /* of each bus, the rig's or the command line's */
    bool local;
    bool timed;                                /* frames take virtual time: buses_advance */
    struct local_bus *bus[RIG_BUSES_MAX];      /* when local */
    struct can_port *paced[RIG_BUSES_MAX];     /* the simulator's, when SocketCAN is paced */
    struct wire *wire[RIG_BUSES_MAX];          /* when timed */
    struct can_state_box state[RIG_BUSES_MAX]; /* of CAN controllers (sim/interfaces.h) */
    struct can_port *sought[RIG_BUSES_MAX];    /* the simulator's on SocketCAN, for buses_seek */
    int64_t seek_ns;                           /* no search before this time */
    int claim[RIG_BUSES_MAX];                  /* descriptors of buses_claim, from its first on */
    size_t nclaim;
};

/* Chooses the transport and creates the local buses. overrides has "NAME=INTERFACE" entries, as
 * of --bus; borrowed. guests: how often buses_join will be called; apart: not all of them are in
 * the simulator's thread. notice receives one line when auto falls back on local buses, else "".
 * Memory from arena. ERROR_INPUT, ERROR_MEMORY, ERROR_SYSTEM. */
enum error_code buses_open(const struct rig *rig, enum bus_transport transport,
                           const char *const *overrides, size_t noverride, size_t guests,
                           bool apart, struct arena *arena, struct buses *buses, char notice[256],
                           struct error *error);

/* Claims the interfaces of SocketCAN buses for the boards of this process, until buses_close. Other
 * simulators of the same network namespace that have claimed one are told in notice (else ""): two
 * with the same boards answer each frame twice, two with boards of one bus each may be meant so. */
void buses_claim(struct buses *buses, char notice[256]);

/* Joins every bus as the simulator: for all boards of the bus, each with a CAN controller of its
 * own where the buses are timed. Once, and before other participants. */
enum error_code buses_join_boards(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                                  struct error *error);

/* Joins every bus as one more participant. */
enum error_code buses_join(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                           struct error *error);

/* Moves timed buses to a virtual time; from the simulator's thread, RT-safe. */
void buses_advance(const struct buses *buses, int64_t now_ns);

/* Sets a function that is called with every frame that the wire of a timed bus has carried, in
 * the simulator's thread. To be set before the first frame. */
void buses_tap(const struct buses *buses, size_t bus,
               void (*tap)(void *context, const struct bus_frame *frame), void *context);

/* Reopens interfaces that have disappeared and come back, at most once a second. From one thread
 * other than the loop's, which would wait for locks of the kernel. */
void buses_seek(struct buses *buses, int64_t now_ns);

void bus_ports_close(struct bus_ports *ports);

/* Closes the buses, after all ports are closed. */
void buses_close(struct buses *buses);

#endif
