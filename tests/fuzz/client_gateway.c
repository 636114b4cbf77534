/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A gateway that says anything at all to a client: it is taken in pieces of any size, frames go
 * where the tables say and end within their messages, and a step that waits for its DONE ends.
 */
#include "client/coman_hil_client.c"

#include "tests/fuzz/fuzz.h"

static const char table[] = "joint J left_leg\n"
                            "bus left_leg can0 icub 6f0 6ff 0\n"
                            "report 111 c 8 1FFFFFFF - -\n"
                            "value J position 0 0|32@1- 0.001 0\n"
                            "report 120 f 64 1FFFFFFF - -\n"
                            "value J current 1 496|16@1- 0.001 0\n"
                            "messages left_leg\n"
                            "message 111 c 8 b_POSITION\n"
                            "signal 0|32@1- 0.001 0 -1 8 J_position\n";

/* A client of that table, at the end of a pair of sockets. */
static void start(struct hil_client *client, int sockets[2])
{
    *client = (struct hil_client){.core = calloc(1, sizeof *client->core)};
    fuzz_require(client->core, "no memory");
    client->core->table = strdup(table);
    fuzz_require(table_read_text(client, "table") == HIL_CLIENT_OK, "%s", client->message);
    fuzz_require(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets) == 0, "no sockets");
    client->core->gateway = sockets[0];
    client->core->timeout_ms = 1;
    client->core->refresh_ticks = 10;
    client->core->lockstep = true;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hil_client client;
    struct hil_client_joint state;
    enum hil_client_code code;
    int sockets[2];
    size_t sent = 0;

    start(&client, sockets);

    /* In pieces while nobody steps, the rest while a step waits */
    while (size > 1 && sent < size / 2) {
        const size_t piece = 1 + data[sent] % 64;
        const size_t count = piece < size - sent ? piece : size - sent;

        fuzz_require(send(sockets[1], data + sent, count, MSG_NOSIGNAL) == (ssize_t)count,
                     "no way");
        sent += count;
        code = stream_receive(&client);
        fuzz_require(!code || fuzz_is_sentence(client.message), "%s", client.message);
    }
    if (send(sockets[1], data + sent, size - sent, MSG_NOSIGNAL | MSG_DONTWAIT) < 0) {
        sent = size;
    }
    shutdown(sockets[1], SHUT_WR);
    code = hil_client_step(&client, 1);
    fuzz_require(!code || fuzz_is_sentence(client.message), "%s", client.message);
    fuzz_require(hil_client_read(&client, 0, &state) == HIL_CLIENT_OK && state.time_ns >= -1,
                 "%" PRId64, state.time_ns);
    for (size_t i = 0; i < client.core->nmessage; i++) {
        fuzz_require(client.core->message[i].heard <= 64, "%u", client.core->message[i].heard);
    }
    *(code ? &fuzz_tally.refused : &fuzz_tally.taken) += 1;
    close(sockets[1]);
    hil_client_close(&client);
    return 0;
}
