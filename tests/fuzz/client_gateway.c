/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A gateway that says anything at all to a client: it is taken in pieces of any size, frames go
 * where the tables say and end within their messages, and a step that waits for its DONE ends.
 */
#include "client/coman_hil_client.c"

#include "tests/fuzz/fuzz.h"

static const char tables[] = "\n"
                             "BO_ 1 COMMAND: 8 host\n"
                             " SG_ command M : 0|8@1+ (1,0) [0|255] \"\" b\n"
                             "BO_ 273 b_POSITION: 8 b\n"
                             " SG_ J_position : 0|32@1- (0.001,0) [0|0] \"rad\" host\n"
                             "BO_ 288 b_TELEMETRY_FD: 64 b\n"
                             " SG_ J_current : 496|16@1- (0.001,0) [0|0] \"A\" host\n"
                             "BO_ 1776 STEP: 6 host\n"
                             " SG_ tick : 0|32@1+ (1,0) [0|0] \"\" simulator\n"
                             " SG_ ticks : 32|16@1+ (1,0) [0|0] \"\" simulator\n"
                             "BO_ 1791 DONE: 6 simulator\n"
                             "CM_ \"Rig r, bus left_leg on can0: protocol icub, supply 48 V\";\n"
                             "CM_ BU_ b \"address 1, motors J\";\n"
                             "CM_ SG_ 273 J_position \"J\";\n"
                             "CM_ SG_ 288 J_current \"J\";\n";

/* A client of those tables, at the end of a pair of sockets. */
static void start(struct hil_client *client, int sockets[2])
{
    *client = (struct hil_client){.core = calloc(1, sizeof *client->core)};
    fuzz_require(client->core, "no memory");
    fuzz_write_file("a.dbc", tables, sizeof tables - 1);
    fuzz_require(tables_open(client, fuzz_folder(), "r") == HIL_CLIENT_OK, "%s", client->message);
    fuzz_require(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets) == 0, "no sockets");
    joint_resolve(client->core, &client->core->joint[0]);
    client->core->gateway = sockets[0];
    client->core->timeout_ms = 1;
    client->core->refresh_ticks = 10;
    client->core->lockstep = true;
    client->core->step = message_find(client->core, &client->core->bus[0], "STEP", "");
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
