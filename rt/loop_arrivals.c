/* SPDX-License-Identifier: Apache-2.0 */
/* Receives frames between two ticks of the real clock, and sends what the machine answers to them.
 * rt/loop.h states the rules. */
#include "rt/loop_private.h"

/* The loop stops receiving this long before the deadline, ns. Longer than the work for one
 * batch. */
#define ARRIVALS_GUARD_NS INT64_C(60000)

enum { ARRIVALS_BATCH = 16 }; /* frames between two readings of the clock */

bool loop_arrivals_create(struct loop *loop, struct arena *arena)
{
    /* One more descriptor than buses, for requests */
    loop->poll = arena_alloc(arena, loop->config.nbus + 1, sizeof *loop->poll);
    return loop->poll != NULL;
}

bool loop_arrivals_possible(const struct loop *loop)
{
    const struct loop_machine *machine = &loop->config.machine;

    return loop->config.clock == LOOP_CLOCK_REAL && loop->period_ns > 0 && machine->answer &&
           (!machine->listens || machine->listens(machine->context));
}

/* Converts a duration between virtual and clock time, which differ by the speed of the run. */
static int64_t loop_scale_time(int64_t duration_ns, int64_t to, int64_t from)
{
    return to == from ? duration_ns : (int64_t)((double)duration_ns * (double)to / (double)from);
}

int64_t loop_virtual_time(const struct loop *loop, int64_t tick_ns, int64_t clock_ns)
{
    return tick_ns +
           loop_scale_time(clock_ns - loop->deadline_ns, loop->config.tick_ns, loop->period_ns);
}

bool loop_arrivals_begin(struct loop *loop, int64_t now_ns, int64_t *until_ns)
{
    const struct loop_machine *machine = &loop->config.machine;
    int64_t until = loop->deadline_ns - ARRIVALS_GUARD_NS, due_ns = INT64_MAX;

    if (now_ns >= until || loop->arrivals_ended || !loop_arrivals_possible(loop)) {
        return false;
    }
    for (size_t b = 0; b < loop->config.nbus; b++) {
        struct can_port *port = loop->config.port[b];

        loop->poll[b] = (struct pollfd){.fd = port->ops->descriptor(port), .events = POLLIN};
    }

    /* Wake for the next answer that is due before the tick */
    if (machine->next_answer) {
        due_ns = machine->next_answer(machine->context);
    }
    if (due_ns < loop->stats.time_ns) {
        due_ns = loop->deadline_ns + loop_scale_time(due_ns - loop->stats.time_ns, loop->period_ns,
                                                     loop->config.tick_ns);
        until = due_ns < until ? due_ns : until;
    }
    *until_ns = until < *until_ns ? until : *until_ns;
    return true;
}

/* Sends the answers of a bus that are due. */
static void arrivals_answer(struct loop *loop, size_t bus)
{
    const struct loop_machine *machine = &loop->config.machine;

    if (machine->set_due) {
        machine->set_due(machine->context, loop_virtual_time(loop, loop->stats.time_ns,
                                                             clock_now(loop->config.time)));
    }
    loop_send_frames(loop, bus,
                     machine->answer(machine->context, loop->stats.time_ns, bus, loop->outgoing,
                                     loop->config.transmit_max[bus]));
}

/* Receives at most a batch from a bus and sends the answers. Returns the number of frames. */
static size_t arrivals_serve_bus(struct loop *loop, size_t bus)
{
    const size_t count = loop_take_frames(loop, bus, loop->batch, ARRIVALS_BATCH);

    for (size_t i = 0; i < count; i++) {
        loop_deliver_frame(loop, bus, &loop->batch[i]);
    }
    if (count > 0) {
        arrivals_answer(loop, bus);
    }
    return count;
}

int64_t loop_arrivals_serve(struct loop *loop, int64_t begin_ns)
{
    const struct loop_machine *machine = &loop->config.machine;
    const int64_t arrival_ns = loop_virtual_time(loop, loop->stats.time_ns, begin_ns);
    int64_t now = begin_ns;

    loop->early_ns = loop->stats.time_ns - arrival_ns;
    for (size_t b = 0; b < loop->config.nbus && !loop->arrivals_ended; b++) {
        size_t count = loop->poll[b].revents ? ARRIVALS_BATCH : 0, total = 0;

        while (count == ARRIVALS_BATCH && !loop->arrivals_ended) {
            count = arrivals_serve_bus(loop, b);
            total += count;
            loop->arrivals += count;
            now = clock_now(loop->config.time);
            loop->arrivals_ended =
                loop->arrivals >= LOOP_ARRIVALS_MAX || now >= loop->deadline_ns - ARRIVALS_GUARD_NS;
            if (loop->arrivals >= LOOP_ARRIVALS_MAX) {
                loop->stats.arrivals_full++;
                loop_emit_event(loop, LOOP_EVENT_ARRIVALS, (int)b, LOOP_ARRIVALS_MAX, 0);
            }
        }
        /* A readable descriptor without a frame (lost interface) must not keep the loop awake */
        loop->arrivals_ended = loop->arrivals_ended || (loop->poll[b].revents && total == 0);
    }

    /* Send the answers to earlier commands that are due by now */
    if (machine->next_answer && machine->next_answer(machine->context) <= arrival_ns) {
        for (size_t b = 0; b < loop->config.nbus; b++) {
            arrivals_answer(loop, b);
        }
        now = clock_now(loop->config.time);
    }
    loop->early_ns = 0;
    loop->arrivals_ns += now - begin_ns;
    if (now > loop->deadline_ns && begin_ns < now) {
        loop->arrivals_late_ns =
            now - (begin_ns > loop->deadline_ns ? begin_ns : loop->deadline_ns);
    }
    return now;
}

void loop_arrivals_end(struct loop *loop)
{
    /* Exclude the work for arrivals from the wait; include work after the deadline in an overrun */
    loop->mark_ns += loop->arrivals_ns;
    loop->spent[PHASE_ARRIVALS] = loop->arrivals_late_ns;
    if (loop->arrivals > 0) {
        histogram_add(&loop->stats.phase[PHASE_ARRIVALS], loop->arrivals_ns);
        loop->stats.arrivals += loop->arrivals;
    }
    loop->arrivals = 0;
    loop->arrivals_ns = loop->arrivals_late_ns = 0;
    loop->arrivals_ended = false;
}
