/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A port in a program of its own, so that can-utils can be put against it:
 *   canbus_tool log INTERFACE COUNT   prints COUNT frames as candump -L does; "ready" on stderr
 *   canbus_tool send INTERFACE FILE   sends the frames of a log
 * Ends with an error after 20 s without a frame.
 */
#include "canbus/candump.h"
#include "canbus/port.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>

enum { BATCH = 32, PATIENCE_MS = 20000 };

static int fail(const char *what)
{
    fprintf(stderr, "canbus_tool: %s\n", what);
    return 1;
}

static int log_frames(struct can_port *port, size_t count)
{
    struct pollfd wait = {.fd = port->ops->descriptor(port), .events = POLLIN};
    struct bus_frame frames[BATCH];
    char line[CANDUMP_LINE_MAX];

    fprintf(stderr, "ready\n");
    while (count > 0) {
        if (poll(&wait, 1, PATIENCE_MS) != 1) {
            return fail("no more frames");
        }
        size_t got = can_receive(port, frames, count < BATCH ? count : BATCH);

        for (size_t i = 0; i < got; i++) {
            candump_format(&frames[i], port->bus, line);
            fputs(line, stdout);
        }
        count -= got;
    }
    return port->counters.rx_dropped ? fail("frames were lost") : 0;
}

static int send_log(struct can_port *port, const char *path)
{
    struct candump_reader reader;
    struct bus_frame frame;
    struct error error;
    char bus[16];
    bool end;

    if (candump_open(&reader, path, &error)) {
        return fail(error.text);
    }
    while (!candump_next(&reader, &frame, bus, &end, &error) && !end) {
        if (can_send(port, &frame, 1) != 1) {
            candump_close(&reader);
            return fail("a frame was not sent");
        }
    }
    candump_close(&reader);
    return end ? 0 : fail(error.text);
}

int main(int argc, char **argv)
{
    struct socketcan_config config = {.fd = true};
    struct can_port *port;
    struct arena arena;
    struct error error;
    int status;

    if (argc != 4) {
        return fail("usage: canbus_tool log INTERFACE COUNT | send INTERFACE FILE");
    }
    config.interface = argv[2];
    if (arena_init(&arena, 1 << 20, &error) || socketcan_open(&config, &arena, &port, &error)) {
        return fail(error.text);
    }
    if (!strcmp(argv[1], "log")) {
        status = log_frames(port, strtoul(argv[3], NULL, 10));
    } else {
        status = send_log(port, argv[3]);
    }
    port->ops->close(port);
    arena_fini(&arena);
    return status;
}
