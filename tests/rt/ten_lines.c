/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A program of its own around the loop, linked with the library rt alone: a first-order plant
 * behind one bus in the process, a second in virtual time. The machine is the two functions that it
 * needs, main the ten lines that run it. Prints TAP: 50 time constants later the plant has arrived.
 */
#include "rt/loop.h"

#include <math.h>
#include <stdio.h>

static bool lag_step(void *context, int64_t now_ns)
{
    double *x = context;

    (void)now_ns;
    *x += (1.0 - *x) * 0.05;
    return true;
}

static size_t lag_transmit(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                           size_t max)
{
    const uint8_t percent = (uint8_t)lround(100.0 * *(const double *)context);

    (void)now_ns, (void)bus, (void)max;
    frames[0] = frame_make(0x123, 1, &percent);
    return 1;
}

int main(void)
{
    double x = 0.0;
    struct arena arena;
    struct error error;
    struct local_bus *bus;
    struct can_port *board, *host;
    struct loop *loop;
    struct bus_frame heard[1000] = {0};
    size_t count;

    if (arena_init(&arena, 64 << 20, &error) ||
        local_bus_create(&(struct local_bus_config){.name = "can0", .max_nodes = 2, .inbox = 1024},
                         &arena, &bus, &error) ||
        local_bus_join(bus, 1, NULL, 0, &board, &error) ||
        local_bus_join(bus, 1, NULL, 0, &host, &error) ||
        loop_create(
            &(struct loop_config){
                .clock = LOOP_CLOCK_FREE,
                .ticks = 1000,
                .nbus = 1,
                .port = &board,
                .machine = {.context = &x, .plant = lag_step, .transmit = lag_transmit}},
            &arena, &loop, &error)) {
        return printf("Bail out! %s\n", error.text), 1;
    }
    loop_run(loop);
    count = can_receive(host, heard, 1000);
    if (loop_stats(loop)->time_ns != CLOCK_SECOND || count != 1000 || heard[999].data[0] != 100) {
        return printf("1..1\nnot ok 1 - %zu frames, the last %d\n", count, heard[999].data[0]), 1;
    }
    return printf("1..1\nok 1 - a second of a machine of its own, a frame each tick\n"), 0;
}
