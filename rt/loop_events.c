/* SPDX-License-Identifier: Apache-2.0 */
/* Holds the names and budgets of the loop's phases. Queues the loop's events and formats them for
 * the log. */
#include "rt/loop_private.h"

#include <stdio.h>

const struct word loop_clock_words[] = {{"real", LOOP_CLOCK_REAL},
                                        {"lockstep", LOOP_CLOCK_LOCKSTEP},
                                        {"free", LOOP_CLOCK_FREE},
                                        {NULL, 0}};
const struct word loop_overrun_words[] = {{"skip", LOOP_OVERRUN_SKIP},
                                          {"slip", LOOP_OVERRUN_SLIP},
                                          {"stop", LOOP_OVERRUN_STOP},
                                          {NULL, 0}};

const struct phase_budget phase_budgets[PHASE_COUNT] = {
    [PHASE_WAIT] = {"sleeps until the deadline (real), until a STEP comes (lockstep) or not at all "
                    "(free); before that, faults that are due begin and end and requests of "
                    "another thread are carried out; an inline task takes its step",
                    0, 0.0, 0.0},
    [PHASE_RECEIVE] = {"takes all frames from all buses and hands each to its board; a wire in "
                       "virtual time hands its frames over in the tick (transmit)",
                       1050, 0.3, 1.5},
    [PHASE_BOARDS] = {"state machines, time-outs and control loops of the boards: the voltage of "
                      "each motor",
                      7900, 1.7, 4.9},
    [PHASE_PLANT] = {"moves the robot on by a tick: actuators, dynamics, contact", 92000, 19.0,
                     42.0},
    [PHASE_SENSORS] = {"samples, delays, quantizes and disturbs what the boards measure", 13600,
                       1.8, 4.2},
    [PHASE_TRANSMIT] = {"wires in virtual time move on and boards answer at the end of a frame; "
                        "boards send what is due",
                        54000, 16.8, 43.4},
    [PHASE_PUBLISH] = {"hands state and counters to other threads, a row to the recorder", 1550,
                       0.8, 3.0},
    [PHASE_ARRIVALS] = {"in real time, between two ticks: hands frames to their boards and sends "
                        "the answers; part of no tick",
                        0, 0.0, 0.0},
};

void loop_emit_event(struct loop *loop, enum loop_event_kind kind, int bus, int64_t a, int64_t b)
{
    struct loop_event event = {loop->stats.time_ns, kind, bus, a, b};

    loop->stats.events_lost += !ring_push(&loop->events, &event);
}

bool loop_next_event(struct loop *loop, struct loop_event *event)
{
    return ring_pop(&loop->events, event);
}

const char *loop_phase_name(enum loop_phase phase)
{
    static const char *const names[PHASE_COUNT] = {
        "wait", "receive", "boards", "plant", "sensors", "transmit", "publish", "arrivals",
    };

    return names[phase];
}

/* Formats an event that a request caused; enum loop_event_kind has the units of a and b. */
static void loop_format_request(const struct loop *loop, const struct loop_event *event, char *text,
                                size_t size)
{
    const struct requests *requests = loop->config.requests;
    const struct request_machine *machine = &requests->machine;
    const struct tunable *tunable;
    long long a = event->a, b = event->b;
    double value;

    switch (event->kind) {
    /* Time: pause, speed, checkpoints */
    case LOOP_EVENT_PAUSED:
        snprintf(text, size, "control: paused at tick %lld", a);
        break;
    case LOOP_EVENT_RESUMED:
        snprintf(text, size, "control: resumed at tick %lld", a);
        break;
    case LOOP_EVENT_SPEED:
        snprintf(text, size, a ? "control: speed %g" : "control: as fast as possible",
                 (double)a * 1e-6);
        break;
    case LOOP_EVENT_CHECKPOINT:
        snprintf(text, size, "control: checkpoint %lld at tick %lld", a, b);
        break;
    case LOOP_EVENT_RESTORED:
        snprintf(text, size,
                 a ? "control: restored checkpoint %lld, tick %lld" : "control: reset to the start",
                 a, b);
        break;
    /* The machine: pushes (mN to N) and tunables */
    case LOOP_EVENT_PUSH:
        snprintf(text, size, "control: body %s pushed with %.1f N",
                 machine->body(machine->context, (size_t)a), (double)b * 1e-3);
        break;
    case LOOP_EVENT_LET_GO:
        snprintf(text, size, "control: body %s let go, pushed with %.1f N at most",
                 machine->body(machine->context, (size_t)a), (double)b * 1e-3);
        break;
    case LOOP_EVENT_SET:
        tunable = requests_tunable(requests, (size_t)a);
        memcpy(&value, &event->b, sizeof value);
        snprintf(text, size, "control: %s is %g%s%s", tunable->name, value,
                 tunable->unit[0] ? " " : "", tunable->unit);
        break;
    default:
        snprintf(text, size, "event %d", (int)event->kind);
        break;
    }
}

void loop_event_format(const struct loop *loop, const struct loop_event *event, char *text,
                       size_t size)
{
    const char *bus = event->bus >= 0 ? loop->config.port[event->bus]->bus : "";
    long long a = event->a, b = event->b;

    switch (event->kind) {
    /* Deadlines of the real clock */
    case LOOP_EVENT_OVERRUN:
        snprintf(text, size, "overrun by %.3f ms in phase %s", (double)b * 1e-6,
                 loop_phase_name((enum loop_phase)a));
        break;
    case LOOP_EVENT_PAUSE:
        snprintf(text, size, "%.1f s behind: counted as a pause, goes on at the next deadline",
                 (double)a * 1e-9);
        break;
    /* Buses */
    case LOOP_EVENT_BUS_STATE:
        snprintf(text, size, "bus %s is %s (was %s)", bus,
                 can_port_state_name((enum can_port_state)b),
                 can_port_state_name((enum can_port_state)a));
        break;
    case LOOP_EVENT_ARRIVALS:
        snprintf(text, size,
                 "flood on %s: %lld frames between two ticks; the rest waits for the tick", bus, a);
        break;
    case LOOP_EVENT_FRAMES_LOST:
        snprintf(text, size, "lost %lld frames on receiving and %lld on sending", a, b);
        break;
    /* Lockstep */
    case LOOP_EVENT_SILENT:
        snprintf(text, size, "no STEP frame on %s for %.1f s: still waiting for the controller",
                 bus, (double)a * 1e-9);
        break;
    case LOOP_EVENT_BACK:
        snprintf(text, size, "STEP frames on %s again after %.1f s", bus, (double)a * 1e-9);
        break;
    case LOOP_EVENT_STEP_MISMATCH:
        snprintf(text, size, "STEP on %s expects tick %lld, but this is tick %lld: not run", bus, a,
                 b);
        break;
    case LOOP_EVENT_STEP_MALFORMED:
        snprintf(text, size, "malformed STEP on %s: length %lld, expected %d", bus, a,
                 LOCKSTEP_LENGTH);
        break;
    default:
        loop_format_request(loop, event, text, size);
        break;
    }
}
