/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig's buses: SocketCAN interfaces, or local buses within the process if the kernel has no CAN.
 * Either all are opened or none. Bit rates in bit/s, virtual times in ns. Not RT-safe unless a
 * function says so.
 */
#ifndef SIM_BUSES_H
#define SIM_BUSES_H

#include "canbus/port.h"
#include "rig/rig.h"

enum bus_transport {
    TRANSPORT_AUTO, /* socketcan if the kernel has CAN, else local */
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
    /* interface of each bus, from the rig or the command line */
    const char *interface[RIG_BUSES_MAX];
    bool local;
    /* buses have timing: frames take time on a wire, and buses_advance moves them */
    bool timed;
    struct local_bus *bus[RIG_BUSES_MAX]; /* local buses */
    /* the simulator's port on each SocketCAN bus with pacing */
    struct can_port *paced[RIG_BUSES_MAX];
    struct wire *wire[RIG_BUSES_MAX];          /* wires of timed buses */
    struct can_state_box state[RIG_BUSES_MAX]; /* states of CAN controllers (sim/interfaces.h) */
    /* the simulator's SocketCAN ports, for buses_seek */
    struct can_port *sought[RIG_BUSES_MAX];
    int64_t seek_ns;          /* earliest time of the next search */
    int claim[RIG_BUSES_MAX]; /* sockets that claim interfaces (buses_claim) */
    size_t nclaim;
};

/* Chooses the transport and creates the local buses. overrides: "NAME=INTERFACE" entries, as for
 * --bus; borrowed. guests: number of later calls of buses_join. apart: some guests run outside the
 * simulator's thread. notice receives one line if auto selects local buses, else "". Memory from
 * arena. ERROR_INPUT, ERROR_MEMORY, ERROR_SYSTEM. */
enum error_code buses_open(const struct rig *rig, enum bus_transport transport,
                           const char *const *overrides, size_t noverride, size_t guests,
                           bool apart, struct arena *arena, struct buses *buses, char notice[256],
                           struct error *error);

/* Claims the interfaces of SocketCAN buses for the boards of this process, until buses_close. If
 * other simulators of this network namespace have claimed one of these interfaces, notice receives
 * their list, else "". Two simulators with the same boards answer each frame twice. Two simulators
 * with different boards of one bus may be intended. */
void buses_claim(struct buses *buses, char notice[256]);

/* Joins each bus as the simulator, for all boards of the bus. On a timed bus each board has its
 * own CAN controller. Call it once, before other participants join. */
enum error_code buses_join_boards(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                                  struct error *error);

/* Joins each bus as one more participant. */
enum error_code buses_join(struct buses *buses, struct arena *arena, struct bus_ports *ports,
                           struct error *error);

/* Advances a timed bus to a virtual time. Returns the time reached: now_ns, or earlier where a
 * board sends (local_bus_listen). Call it from the simulator's thread. RT-safe. */
int64_t buses_advance(const struct buses *buses, size_t bus, int64_t now_ns);

/* Sets a callback that receives each frame after the wire of a timed bus has carried it. The
 * callback runs in the simulator's thread. Set it before the first frame. */
void buses_tap(const struct buses *buses, size_t bus,
               void (*tap)(void *context, const struct bus_frame *frame), void *context);

/* Reopens interfaces that have disappeared and come back, at most once a second. Call it from one
 * thread other than the loop's, because it waits for kernel locks. */
void buses_seek(struct buses *buses, int64_t now_ns);

void bus_ports_close(struct bus_ports *ports);

/* Closes the buses. Close all ports first. */
void buses_close(struct buses *buses);

#endif
