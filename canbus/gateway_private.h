/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to canbus: the state of the gateway, for its thread (gateway.c), the clients' connections
 * (gateway_client.c) and their commands (gateway_command.c). Not RT-safe; only the gateway's thread
 * uses it.
 */
#ifndef CANBUS_GATEWAY_PRIVATE_H
#define CANBUS_GATEWAY_PRIVATE_H

#include "canbus/gateway.h"
#include "canbus/slcan.h"
#include "canbus/socketcand.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum gateway_client_mode { CLIENT_NO_BUS, CLIENT_BCM, CLIENT_RAW };

enum {
    GATEWAY_EVERY_BUS = GATEWAY_BUSES, /* client->bus of a connection with every bus */
    GATEWAY_INBOX = 4096,
};

/* Settings of an slcan channel, made by its client. */
struct gateway_slcan_state {
    bool stamps, listens;
    bool refused;   /* the client requested a bit rate that differs from the bus */
    uint8_t status; /* flags reported by the command F */
};

struct gateway_client {
    int socket; /* -1 = free place */
    int other;  /* terminal: its slave end */
    bool is_slcan, is_terminal;
    struct gateway_slcan_state slcan;
    enum gateway_client_mode mode;
    size_t bus;
    unsigned junk;
    int64_t since_ms; /* time of the connection */
    int64_t quiet_until_ms;
    /* time since when a STEP waits for this client to read; 0 = none waits */
    int64_t awaited_since_ms;
    bool step_waits; /* its next command is a STEP */
    struct bus_frame step;
    size_t received; /* bytes in inbox, not yet executed */
    char inbox[GATEWAY_INBOX];
    size_t waiting; /* bytes in outbox */
    char *outbox;
};

struct gateway {
    struct gateway_config config;
    struct gateway_counters counters;
    int64_t *time_ns;      /* time of the newest frame of each bus, on its clock */
    int64_t step_until_ms; /* a STEP runs and clients wait until this time; 0 = none runs */
    _Atomic uint64_t done_count;
    atomic_bool heard;  /* a client receives frames of a bus */
    _Atomic bool holds; /* holds back the frames of a STEP until released */
    int listener, stop_event;
    int slcan_listener[GATEWAY_SLCAN]; /* -1 = a terminal */
    size_t slcan_bus[GATEWAY_SLCAN];
    uint16_t port;
    pthread_t thread;
    struct gateway_client client[GATEWAY_CLIENTS];
};

/* Returns the time of CLOCK_MONOTONIC in ms. */
int64_t gateway_now_ms(void);

/* ---- gateway_client.c ---- */

/* Accepts all waiting clients of a listener. slcan: index of the listener's channel; negative =
 * socketcand. Rejects clients when all places are taken. */
void gateway_accept_clients(struct gateway *gateway, int listener, int slcan);

/* Disconnects clients that have not opened a bus in time. */
void gateway_close_silent(struct gateway *gateway);

/* Reads a client's data into its inbox and executes its commands. */
void gateway_read_client(struct gateway *gateway, struct gateway_client *client);

/* Puts text into the client's outbox. Disconnects the client when the outbox stays full. */
void gateway_queue_text(struct gateway *gateway, struct gateway_client *client, const char *text,
                        size_t length);

/* Sends as much of the client's outbox as the system accepts. */
void gateway_flush_client(struct gateway_client *client);

void gateway_close_client(struct gateway_client *client);

/* Disconnects a client that does not read and discards its output. */
void gateway_cut_slow(struct gateway *gateway, struct gateway_client *client);

/* Queues a frame for all raw-mode clients of a bus, except its sender; NULL = sent by the bus. */
void gateway_forward_frame(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                           const struct gateway_client *from);

/* ---- gateway_command.c ---- */

/* Checks whether clients' commands must wait because a STEP runs. */
static inline bool gateway_step_runs(const struct gateway *gateway)
{
    return gateway->step_until_ms > 0;
}

/* Check whether a frame is the STEP, or the DONE, of lockstep. */
bool gateway_is_step(const struct gateway *gateway, size_t bus, const struct bus_frame *frame);
bool gateway_is_done(const struct gateway *gateway, const struct bus_frame *frame);

/* Finds a bus by its name or alias; false = there is none. */
bool gateway_find_bus(const struct gateway *gateway, const char *name, size_t *bus);

/* Sends a client's frame to a bus and to the other clients. Returns false when the bus refuses
 * it. */
bool gateway_send_frame(struct gateway *gateway, struct gateway_client *client, size_t bus,
                        const struct bus_frame *request);

/* Executes the complete commands in the inbox up to a STEP, which stays in the inbox. While a STEP
 * runs, executes nothing. Skips text between commands. */
void gateway_execute_inbox(struct gateway *gateway, struct gateway_client *client);

/* Sends the waiting STEP. First reads the waiting data of all clients, and waits until the clients
 * have read most of their output. */
void gateway_release_step(struct gateway *gateway);

/* ---- gateway_slcan.c ---- */

/* Open the terminals and listeners of the slcan channels; close them and remove the links. */
enum error_code gateway_slcan_start(struct gateway *gateway, struct error *error);
void gateway_slcan_stop(struct gateway *gateway);

/* Executes the complete commands in the inbox of an slcan channel, as gateway_execute_inbox
 * does. */
void gateway_slcan_execute_inbox(struct gateway *gateway, struct gateway_client *client);

/* Closes the slcan channel of a terminal whose client does not read or has left. The command F then
 * reports an overrun. */
void gateway_slcan_reset(struct gateway_client *client);

/* Checks whether a client must read before a STEP may run. */
bool gateway_is_behind(const struct gateway_client *client);

#endif
