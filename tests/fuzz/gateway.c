/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A client of the gateway that says anything at all over TCP: it is answered in commands of the
 * protocol or cut off, soon, a second client of the same bus and a board on it hear nothing but
 * legal frames, and the server is there for the next one.
 */
#include "canbus/gateway.h"

#include "tests/fuzz/fuzz.h"

#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { HEARD = 1 << 16, PATIENCE_MS = 30000 };

static struct gateway *gateway;
static struct can_port *board; /* another node of the bus */

static void stop(void)
{
    gateway_stop(gateway);
}

static void start(void)
{
    static struct arena arena;
    static struct local_bus *bus;
    static struct can_port *port;
    const struct local_bus_config bus_config = {
        .name = "can0", .max_nodes = 2, .inbox = 256, .fd = true};
    struct gateway_bus entry = {.name = "can0", .alias = "left_leg"};
    struct gateway_config config = {.nbus = 1, .bus = &entry};
    struct error error;

    fuzz_require(arena_init(&arena, (size_t)32 << 20, NULL) == ERROR_NONE, "no memory");
    fuzz_require(local_bus_create(&bus_config, &arena, &bus, &error) == ERROR_NONE, "%s",
                 error.text);
    fuzz_require(local_bus_join(bus, 1, NULL, 0, &port, &error) == ERROR_NONE, "%s", error.text);
    fuzz_require(local_bus_join(bus, 1, NULL, 0, &board, &error) == ERROR_NONE, "%s", error.text);
    entry.port = port;
    fuzz_require(gateway_start(&config, &arena, &gateway, &error) == ERROR_NONE, "%s", error.text);
    fuzz_require(atexit(stop) == 0, "no end");
}

static int connect_client(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons(gateway_port(gateway)),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const struct linger at_once = {.l_onoff = 1};
    int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    fuzz_require(client >= 0 && connect(client, (struct sockaddr *)&address, sizeof address) == 0,
                 "no connection");
    /* No connection is left behind in the system, however many are made */
    setsockopt(client, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    return client;
}

/* What the server says until it says the text, or until it cuts the client off. */
static void listen_for(int client, const char *text, char heard[HEARD])
{
    struct pollfd fd = {.fd = client, .events = POLLIN};
    size_t size = 0;
    ssize_t count = 1;

    heard[0] = '\0';
    while (count > 0 && size + 1 < HEARD && !strstr(heard, text)) {
        int ready = poll(&fd, 1, PATIENCE_MS);

        if (ready < 0 && errno == EINTR) { /* libFuzzer's clock */
            continue;
        }
        fuzz_require(ready == 1, "silence after %s", heard);
        count = recv(client, heard + size, HEARD - 1 - size, 0);
        size += count > 0 ? (size_t)count : 0;
        heard[size] = '\0';
    }
}

/* The board sends what the input makes of it, and gets what the client has sent. */
static void use_board(const uint8_t *data, size_t size)
{
    struct fuzz_bytes bytes = {data, size};
    struct bus_frame frame;

    fuzz_frame(&bytes, &frame);
    frame.time_ns = 0;
    frame.node = 0;
    fuzz_require(can_send(board, &frame, 1) == (frame_valid(&frame) ? 1 : 0), "id 0x%x", frame.id);
    while (can_receive(board, &frame, 1) == 1) {
        fuzz_require(frame_valid(&frame) && !(frame.flags & FRAME_ERROR), "id 0x%x flags 0x%x",
                     frame.id, frame.flags);
    }
}

/* Whole commands, but for the last one when the client was cut off. */
static void check_heard(const char *heard)
{
    while (*heard) {
        const char *end = strchr(heard, '>');

        fuzz_require(*heard == '<' || *heard == '\n', "%s", heard);
        if (*heard == '\n') {
            heard++;
            continue;
        }
        fuzz_require(!memchr(heard + 1, '<', end ? (size_t)(end - heard) : strlen(heard) - 1), "%s",
                     heard);
        heard = end ? end + 1 : heard + strlen(heard);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char hello[] = "< open can0 >< rawmode >";
    static char heard[HEARD];
    int client, other;

    if (!gateway) {
        start();
    }
    other = connect_client();
    fuzz_require(send(other, hello, sizeof hello - 1, MSG_NOSIGNAL) == sizeof hello - 1, "no way");
    listen_for(other, "< ok >< ok >", heard);

    client = connect_client();
    fuzz_require(send(client, data, size, MSG_NOSIGNAL) == (ssize_t)size || size == 0, "no way");
    /* The answer to this comes last, unless it stands within a command of the input */
    if (send(client, "\n><echo>", 8, MSG_NOSIGNAL) == 8) {
        shutdown(client, SHUT_WR);
    }
    use_board(data, size);
    listen_for(client, "< echo >", heard);
    check_heard(heard);
    close(client);

    fuzz_require(send(other, "< echo >", 8, MSG_NOSIGNAL) == 8, "the other one was cut off");
    listen_for(other, "< echo >", heard);
    fuzz_require(strstr(heard, "< echo >"), "%s", heard);
    check_heard(heard);
    close(other);
    return 0;
}
