/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Private to canbus: the state of the gateway, shared by its thread (gateway.c) and what it does
 * for each client (gateway_client.c). Not RT-safe; all of it belongs to the gateway's thread.
 */
#ifndef CANBUS_GATEWAY_PRIVATE_H
#define CANBUS_GATEWAY_PRIVATE_H

#include "canbus/gateway.h"
#include "canbus/socketcand.h"

#include <pthread.h>

enum gateway_client_mode { CLIENT_NO_BUS, CLIENT_BCM, CLIENT_RAW };

struct gateway_client {
    int socket; /* -1 = free place */
    enum gateway_client_mode mode;
    size_t bus;
    unsigned junk;
    int64_t quiet_until_ms;
    size_t received; /* of inbox: a command that has not ended yet */
    char inbox[SOCKETCAND_TEXT_MAX];
    size_t waiting; /* of outbox */
    char *outbox;
};

struct gateway {
    struct gateway_config config;
    struct gateway_counters counters;
    int64_t *time_ns; /* of the newest frame of each bus, on its clock */
    int listener, stop_event;
    uint16_t port;
    pthread_t thread;
    struct gateway_client client[GATEWAY_CLIENTS];
};

/* CLOCK_MONOTONIC. */
int64_t gateway_now_ms(void);

/* Accepts every client that waits; refuses those beyond GATEWAY_CLIENTS. */
void gateway_accept_clients(struct gateway *gateway);

/* Reads what a client has sent and executes its commands. */
void gateway_read_client(struct gateway *gateway, struct gateway_client *client);

/* Sends what waits for a client, as far as the system takes it. */
void gateway_flush_client(struct gateway_client *client);

void gateway_close_client(struct gateway_client *client);

/* Queues a frame for all clients of a bus in raw mode but the one that sent it, NULL = none did. */
void gateway_forward_frame(struct gateway *gateway, size_t bus, const struct bus_frame *frame,
                           const struct gateway_client *from);

#endif
