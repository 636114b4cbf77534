/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to canbus: the state of the gateway, shared by its thread (gateway.c), the connections of
 * its clients (gateway_client.c) and what they ask for (gateway_command.c). Not RT-safe; all of it
 * belongs to the gateway's thread.
 */
#ifndef CANBUS_GATEWAY_PRIVATE_H
#define CANBUS_GATEWAY_PRIVATE_H

#include "canbus/gateway.h"
#include "canbus/slcan.h"
#include "canbus/socketcand.h"

#include <pthread.h>
#include <stdatomic.h>

enum gateway_client_mode { CLIENT_NO_BUS, CLIENT_BCM, CLIENT_RAW };

enum {
    GATEWAY_EVERY_BUS = GATEWAY_BUSES, /* client->bus of a connection that has all of them */
    GATEWAY_INBOX = 4096,
};

/* Settings of an slcan channel, as its client made them. */
struct gateway_slcan_state {
    bool stamps, listens;
    bool refused;   /* it asked for a bit rate that the bus does not have */
    uint8_t status; /* flags that the command F reports */
};

struct gateway_client {
    int socket; /* -1 = free place */
    int other;  /* of a terminal: its other end */
    bool is_slcan, is_terminal;
    struct gateway_slcan_state slcan;
    enum gateway_client_mode mode;
    size_t bus;
    unsigned junk;
    int64_t since_ms; /* accepted */
    int64_t quiet_until_ms;
    int64_t awaited_since_ms; /* since when a STEP waits for the client to read; 0 = none waits */
    bool step_waits;          /* its next command is a STEP */
    struct bus_frame step;
    size_t received; /* of inbox: what has not been executed */
    char inbox[GATEWAY_INBOX];
    size_t waiting; /* of outbox */
    char *outbox;
};

struct gateway {
    struct gateway_config config;
    struct gateway_counters counters;
    int64_t *time_ns;      /* of the newest frame of each bus, on its clock */
    int64_t step_until_ms; /* a STEP runs, and is waited for until this time; 0 = none runs */
    _Atomic uint64_t done_count;
    _Atomic bool holds; /* what a STEP brings, until it is released */
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

/* Accepts every client that waits at a listener, which is that of an slcan channel unless slcan is
 * negative; refuses those that find no place. */
void gateway_accept_clients(struct gateway *gateway, int listener, int slcan);

/* Disconnects clients that have not opened a bus in time. */
void gateway_close_silent(struct gateway *gateway);

/* Reads what a client has sent, as far as its inbox holds it, and executes its commands. */
void gateway_read_client(struct gateway *gateway, struct gateway_client *client);

/* Puts text into the client's outbox; a client whose outbox stays full is disconnected. */
void gateway_queue_text(struct gateway *gateway, struct gateway_client *client, const char *text,
                        size_t length);

/* Sends what waits for a client, as far as the system takes it. */
void gateway_flush_client(struct gateway_client *client);

void gateway_close_client(struct gateway_client *client);

/* Disconnects a client that does not read; what waits for it is discarded. */
void gateway_cut_slow(struct gateway *gateway, struct gateway_client *client);

/* Queues a frame for all clients of a bus in raw mode but the one that sent it, NULL = none did. */
void gateway_forward_frame(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                           const struct gateway_client *from);

/* ---- gateway_command.c ---- */

/* Checks whether commands of clients have to wait because a STEP runs. */
static inline bool gateway_step_runs(const struct gateway *gateway)
{
    return gateway->step_until_ms > 0;
}

/* Check whether a frame is the STEP, or the DONE, of lockstep. */
bool gateway_is_step(const struct gateway *gateway, size_t bus, const struct bus_frame *frame);
bool gateway_is_done(const struct gateway *gateway, const struct bus_frame *frame);

/* Finds a bus by its name or alias; false = there is none. */
bool gateway_find_bus(const struct gateway *gateway, const char *name, size_t *bus);

/* Sends a client's frame onto a bus and to the other clients; false: the bus has not taken it. */
bool gateway_send_frame(struct gateway *gateway, struct gateway_client *client, size_t bus,
                        const struct bus_frame *request);

/* Executes every complete command in the inbox, up to a STEP, which stays until it is released;
 * none while a STEP runs. What stands between commands is skipped. */
void gateway_execute_inbox(struct gateway *gateway, struct gateway_client *client);

/* Sends the STEP that waits, if one does and nothing is in its way: once every client has been read
 * to the end and has taken most of what waits for it. */
void gateway_release_step(struct gateway *gateway);

/* ---- gateway_slcan.c ---- */

/* Open the terminals and listeners of the slcan channels; close them and remove the links. */
enum error_code gateway_slcan_start(struct gateway *gateway, struct error *error);
void gateway_slcan_stop(struct gateway *gateway);

/* Executes the complete commands in the inbox of an slcan channel, as gateway_execute_inbox
 * does. */
void gateway_slcan_execute_inbox(struct gateway *gateway, struct gateway_client *client);

/* Formats a frame for the client of an slcan channel; returns its length, 0 = slcan has no such
 * frame. */
size_t gateway_slcan_format(const struct gateway_client *client, const struct bus_frame *frame,
                            char text[SLCAN_TEXT_MAX]);

/* Closes the channel of a terminal, which has not been read or is gone; F tells of an overrun. */
void gateway_slcan_reset(struct gateway_client *client);

/* Checks whether a client must read before a STEP may run. */
bool gateway_is_behind(const struct gateway_client *client);

#endif
