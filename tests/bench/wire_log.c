/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks a candump log of buses in wire mode (stdin, 1 Mbit/s, whole microseconds) against the
 * reference encoder: a frame's end less its length by the reference is its start. A frame starts at
 * the end of the intermission behind the frame before, at the beginning of a tick, when boards and
 * host hand over what they have, or REPLY_US behind a recent frame, which it answers.
 * Usage: wire_log TICK_US REPLY_US IGNORED_ID... < candump.log
 */
#include "tests/unit/canbus/wire/wire_reference.h"

#include <stdio.h>
#include <stdlib.h>

enum { BUSES = 16, INTERMISSION_US = 3, RECENT = 32 };

struct bus {
    char name[16];
    long long end_us, recent_us[RECENT]; /* recent_us: ends of the last frames */
    unsigned long long frames, back_to_back;
};

static struct bus buses[BUSES];

static struct bus *find_bus(const char *name)
{
    for (int i = 0; i < BUSES; i++) {
        if (!buses[i].name[0]) {
            snprintf(buses[i].name, sizeof buses[i].name, "%s", name);
            buses[i].end_us = -100;
        }
        if (!strcmp(buses[i].name, name)) {
            return &buses[i];
        }
    }
    fprintf(stderr, "more than %d buses\n", BUSES);
    exit(2);
}

static int parse(const char *line, long long *time_us, char *bus, struct bus_frame *frame)
{
    long long seconds, micros;
    unsigned id;
    char data[32] = "";

    memset(frame, 0, sizeof *frame);
    if (sscanf(line, "(%lld.%lld) %15s %x#%31s", &seconds, &micros, bus, &id, data) < 4) {
        return 0;
    }
    *time_us = seconds * 1000000 + micros;
    frame->id = id;
    for (frame->len = 0; frame->len < 8 && data[2 * frame->len]; frame->len++) {
        unsigned byte;

        sscanf(data + 2 * frame->len, "%2x", &byte);
        frame->data[frame->len] = (uint8_t)byte;
    }
    return 1;
}

static int ignored(uint32_t id, int argc, char **argv)
{
    for (int i = 3; i < argc; i++) {
        if (strtoul(argv[i], NULL, 0) == id) {
            return 1;
        }
    }
    return 0;
}

/* Returns whether a frame that starts at this time answers a recent frame of the bus. */
static int answers(const struct bus *bus, long long start_us, long long reply_us)
{
    for (int i = 0; i < RECENT; i++) {
        if (bus->recent_us[i] > 0 && start_us == bus->recent_us[i] + reply_us) {
            return 1;
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    const long long tick_us = argc > 2 ? atoll(argv[1]) : 1000;
    const long long reply_us = argc > 2 ? atoll(argv[2]) : 0;
    unsigned long long frames = 0, back_to_back = 0;
    char line[256], name[16];

    while (fgets(line, sizeof line, stdin)) {
        struct bus_frame frame;
        long long end_us, start_us;
        unsigned nominal, data;
        struct bus *bus;

        if (!parse(line, &end_us, name, &frame) || ignored(frame.id, argc, argv)) {
            continue;
        }
        bus = find_bus(name);
        reference_length(&frame, &nominal, &data);
        start_us = end_us - nominal;
        if (start_us == bus->end_us + INTERMISSION_US) {
            bus->back_to_back++;
        } else if (start_us < bus->end_us + INTERMISSION_US ||
                   (start_us % tick_us != 0 && !answers(bus, start_us, reply_us))) {
            printf("wrong time: %s", line);
            return 1;
        }
        bus->end_us = bus->recent_us[bus->frames % RECENT] = end_us;
        bus->frames++;
    }
    for (int i = 0; i < BUSES && buses[i].name[0]; i++) {
        frames += buses[i].frames;
        back_to_back += buses[i].back_to_back;
        printf("# %s: %llu frames, %llu of them right behind another, the last ends at %.6f s\n",
               buses[i].name, buses[i].frames, buses[i].back_to_back,
               (double)buses[i].end_us * 1e-6);
    }
    printf("# %llu frames, every time as the reference encoder has it\n", frames);
    return frames > 0 && back_to_back > 0 ? 0 : 1;
}
