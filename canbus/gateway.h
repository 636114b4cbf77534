/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A socketcand server in front of ports: programs in other processes join the buses of this process
 * over TCP, with any client of the protocol (python-can's socketcand interface, Kayak, ...). Raw
 * mode only; the clients of a bus receive the frames of the bus and of each other. A client that
 * opens the bus GATEWAY_ALL has every bus on one connection, and the name of the bus behind each
 * frame. docs/gateway.md is the manual.
 *
 * Beside them stand slcan channels (canbus/slcan.h), each a pseudo-terminal or a TCP port in front
 * of one bus, for programs that know serial adapters only. A terminal is there all the time: what
 * would disconnect another client closes its channel.
 *
 * One thread does all the work and owns the ports. Output that a client does not read waits in a
 * buffer of GATEWAY_OUTBOX bytes; a client that lets it fill up is disconnected, as is one that
 * sends GATEWAY_JUNK_MAX wrong commands or a command without an end, or that opens no bus. The bus
 * never waits for a client. Not RT-safe: it runs beside the loop.
 *
 * Lockstep. A STEP is passed on when every client has been read to the end, so that what a host on
 * this machine has sent before it, on any connection, takes part in the STEP; over a network only
 * one connection has an order. Nothing that a client has sent after it is passed on before the
 * STEP is done (or lost). The DONE of the STEP's bus comes after all that the boards have sent on
 * any bus. A STEP waits, for a bounded time, for clients that have not read what they were sent.
 *
 * All memory is allocated at the start; clients, buses and the stop event are served in turn, each
 * for a bounded time. A frame that a bus refuses, because its queue is full, is answered with an
 * error, counted and dropped. On local buses every participant has room of its own for the
 * gateway's frames (canbus/port.h): a flood by clients drops their own frames, never those of
 * boards or controllers. Only on a wire in virtual time it takes bus time from the others, as on a
 * real bus.
 */
#ifndef CANBUS_GATEWAY_H
#define CANBUS_GATEWAY_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/port.h"

#include <stdint.h>

enum {
    GATEWAY_BUSES = 64,
    GATEWAY_CLIENTS = 32, /* two that have a connection for each of ten buses, and more */
    GATEWAY_OUTBOX = 256 * 1024,
    GATEWAY_JUNK_MAX = 16,
    GATEWAY_SLCAN = 16, /* channels */
};

enum { GATEWAY_PORT = 29536 }; /* socketcand's */

#define GATEWAY_ALL "all" /* the name by which a client opens every bus */

/* How STEP and DONE are recognized (canbus/lockstep.h). */
struct gateway_lockstep {
    bool on;                   /* off: a STEP is sent on, and answered with an error */
    size_t bus;                /* that carries STEP; its DONE is sent last */
    uint32_t step_id, done_id; /* done_id 0 = there is no STEP */
};

struct gateway_bus {
    const char *name;      /* as clients open it: at most SOCKETCAND_BUS_MAX characters */
    const char *alias;     /* another name for it, NULL = none */
    struct can_port *port; /* not owned; used by no other thread until the gateway is stopped */
    int64_t bitrate, data_bitrate; /* bit/s; the second 0 without CAN FD */
};

/* An slcan channel: a pseudo-terminal that a link at path names, or a TCP port. */
struct gateway_slcan {
    const char *bus;  /* name or alias */
    const char *path; /* NULL: TCP */
    const char *host; /* numeric address; NULL = 127.0.0.1 */
    uint16_t port;
};

struct gateway_config {
    const char *host;              /* numeric address, IPv4 or IPv6; NULL = 127.0.0.1 */
    uint16_t port;                 /* 0 = any that is free */
    size_t nbus;                   /* at most GATEWAY_BUSES */
    const struct gateway_bus *bus; /* copied, the names not */
    struct gateway_lockstep lockstep;
    size_t nslcan;                     /* at most GATEWAY_SLCAN */
    const struct gateway_slcan *slcan; /* not copied */
    bool slcan_only;                   /* no socketcand: host and port are without meaning */
    /* Looks at the ports every millisecond instead of sleeping on their descriptors: whoever sends
     * on a local bus, as a real-time loop, need not signal then */
    bool by_time;
    /* In lockstep: from a STEP on nothing is passed on to clients until gateway_release_done, so
     * that who observes the buses sees what the STEP has brought before a client can answer */
    bool hold_done;
};

struct gateway_counters {
    uint64_t clients;    /* accepted */
    uint64_t refused;    /* found no place */
    uint64_t cut_slow;   /* disconnected with a full outbox */
    uint64_t cut_junk;   /* disconnected for wrong commands */
    uint64_t cut_silent; /* disconnected without having opened a bus */
    uint64_t to_bus;     /* frames */
    uint64_t not_taken;  /* frames of clients that their bus refused */
    uint64_t to_client;  /* frames, once for each client */
    uint64_t wakeups;    /* of the thread, by whatever there was to do */
};

struct gateway;

/* Listens and starts the thread. ERROR_INPUT for a host that is no numeric address, ERROR_SYSTEM
 * when it cannot listen there. Memory from arena. */
enum error_code gateway_start(const struct gateway_config *config, struct arena *arena,
                              struct gateway **gateway, struct error *error);

/* Returns the TCP port that it listens on; 0 with slcan_only. */
uint16_t gateway_port(const struct gateway *gateway);

/* With hold_done: passes on what a STEP has brought, and its DONE. From any thread; RT-safe. */
void gateway_release_done(struct gateway *gateway);

/* Returns how many DONE frames of the lockstep bus have been queued for the clients, each behind
 * all that belongs before it: what comes on a bus from now on stands behind them. From any
 * thread; RT-safe. */
uint64_t gateway_done_count(const struct gateway *gateway);

/* Ends the thread and all connections. NULL is allowed. */
void gateway_stop(struct gateway *gateway);

/* Copies the counters; only after gateway_stop. */
void gateway_counters(const struct gateway *gateway, struct gateway_counters *counters);

#endif
