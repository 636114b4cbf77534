/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A socketcand server for ports. Programs in other processes join the buses of this process over
 * TCP, with any socketcand client (python-can, Kayak, ...), in raw mode only. The clients of a bus
 * receive the frames of the bus and of each other. A client that opens the bus GATEWAY_ALL has
 * every bus on one connection, with the bus name behind each frame. docs/gateway.md is the manual.
 *
 * The server also offers slcan channels (canbus/slcan.h): pseudo-terminals or TCP ports in front of
 * one bus, for programs that support only serial adapters. A terminal always exists. Errors that
 * disconnect other clients only close its channel.
 *
 * One thread does all the work and owns the ports. Unread output of a client waits in a buffer of
 * GATEWAY_OUTBOX bytes. The server disconnects a client that lets this buffer fill, sends
 * GATEWAY_JUNK_MAX wrong commands or an endless command, or opens no bus. The bus never waits for a
 * client. Not RT-safe: the thread runs beside the loop.
 *
 * Lockstep. The server forwards a STEP after it has read the waiting data of all clients. A frame
 * that a host on this machine sent before the STEP, on any connection, therefore belongs to the
 * STEP; over a network only frames of one connection are ordered. Later frames of clients wait
 * until the STEP is done or lost. The DONE of the STEP's bus follows all frames of the boards on
 * all buses. A STEP waits for clients that have not read their output, for a limited time.
 *
 * All memory is allocated at the start. The thread serves clients, buses and the stop event in
 * turn, each for a bounded time. When a bus refuses a frame because its queue is full, the frame is
 * dropped and counted, and the client gets an error. On local buses every participant has separate
 * room for the gateway's frames (canbus/port.h): a flood from clients drops only their own frames.
 * On a wire in virtual time a flood also takes bus time, as on a real bus.
 */
#ifndef CANBUS_GATEWAY_H
#define CANBUS_GATEWAY_H

#include "canbus/port.h"

enum {
    GATEWAY_BUSES = 64,
    /* enough for two clients with one connection per bus on ten buses */
    GATEWAY_CLIENTS = 32,
    GATEWAY_OUTBOX = 256 * 1024,
    GATEWAY_JUNK_MAX = 16,
    GATEWAY_SLCAN = 16, /* most slcan channels */
};

#define GATEWAY_ALL "all" /* bus name that opens every bus */

/* How to recognize STEP and DONE (canbus/lockstep.h). */
struct gateway_lockstep {
    bool on;                   /* false: a STEP is sent to the bus, and the client gets an error */
    size_t bus;                /* bus of the STEP; its DONE is sent last */
    uint32_t step_id, done_id; /* done_id 0 = no STEP exists */
};

struct gateway_bus {
    const char *name;              /* name for clients: at most SOCKETCAND_BUS_MAX characters */
    const char *alias;             /* second name, NULL = none */
    struct can_port *port;         /* borrowed; no other thread may use it until gateway_stop */
    int64_t bitrate, data_bitrate; /* bit/s; data_bitrate 0 = no CAN FD */
};

/* An slcan channel: a pseudo-terminal with a symbolic link at `path`, or a TCP port. */
struct gateway_slcan {
    const char *bus;  /* name or alias of its bus */
    const char *path; /* NULL = TCP */
    const char *host; /* numeric address; NULL = 127.0.0.1 */
    uint16_t port;
};

struct gateway_config {
    const char *host;              /* numeric address, IPv4 or IPv6; NULL = 127.0.0.1 */
    uint16_t port;                 /* 0 = any free port */
    size_t nbus;                   /* at most GATEWAY_BUSES */
    const struct gateway_bus *bus; /* copied, except the names */
    struct gateway_lockstep lockstep;
    size_t nslcan;                     /* at most GATEWAY_SLCAN */
    const struct gateway_slcan *slcan; /* not copied */
    bool slcan_only;                   /* no socketcand server: host and port are unused */
    /* In lockstep: after a STEP, forwards nothing to clients until gateway_release_done. An
     * observer of the buses therefore sees the frames of a STEP before a client can answer */
    bool hold_done;
    /* Returns the lines that answer "tell WORD", `size` bytes that are valid until the next call;
     * NULL = unknown word. The gateway's thread calls it. NULL = all words are unknown */
    const char *(*tell)(void *context, const char *word, size_t *size);
    void *context;
};

struct gateway_counters {
    uint64_t clients;    /* accepted */
    uint64_t refused;    /* rejected because all places were taken */
    uint64_t cut_slow;   /* disconnected with a full outbox */
    uint64_t cut_junk;   /* disconnected for wrong commands */
    uint64_t cut_silent; /* disconnected because they opened no bus */
    uint64_t to_bus;     /* frames */
    uint64_t not_taken;  /* client frames that their bus refused */
    uint64_t to_client;  /* frames sent to clients, counted once per client */
    uint64_t wakeups;    /* wake-ups of the thread */
};

struct gateway;

/* Listens and starts the thread. ERROR_INPUT when the host is not a numeric address, ERROR_SYSTEM
 * when it cannot listen. Memory from arena. */
enum error_code gateway_start(const struct gateway_config *config, struct arena *arena,
                              struct gateway **gateway, struct error *error);

/* Returns the TCP port of the server; 0 with slcan_only. */
uint16_t gateway_port(const struct gateway *gateway);

/* With hold_done: forwards the frames of a STEP and its DONE to the clients. From any thread;
 * RT-safe. */
void gateway_release_done(struct gateway *gateway);

/* Returns how many DONE frames of the lockstep bus have been queued for clients. Later frames of a
 * bus are queued behind them. From any thread; RT-safe. */
uint64_t gateway_done_count(const struct gateway *gateway);

/* Returns whether a client hears a bus, and so may send frames. From any thread; RT-safe. */
bool gateway_is_heard(const struct gateway *gateway);

/* Ends the thread and all connections. NULL is allowed. */
void gateway_stop(struct gateway *gateway);

/* Copies the counters; only after gateway_stop. */
void gateway_counters(const struct gateway *gateway, struct gateway_counters *counters);

#endif
