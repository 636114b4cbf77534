/* SPDX-License-Identifier: Apache-2.0 */
/* Collects the events of all parts of a run as lines of the log. */
#include "sim/simulator_private.h"

/* Sources of events: the upper 32 bits of a key. The lower 32 bits are the topic within the source.
 * Events with the same time are recorded in the order of this list. */
enum event_source {
    EVENT_RELEASE,
    EVENT_LOOP,
    EVENT_FAULT,
    EVENT_INTERFACE,
    EVENT_ROBOT,
    EVENT_BOARD,
    EVENT_CLAMPED_TRIP,
    EVENT_RECORDER,
    EVENT_CONTROL, /* host events from control/ */
};

/* Makes the key of an event; the log limits repetitions by key. */
static uint64_t event_key(enum event_source source, uint64_t topic)
{
    return (uint64_t)source << 32 | topic;
}

enum journal_priority simulator_event_priority(uint64_t key)
{
    const uint64_t kind = (key & UINT32_MAX) >> 8; /* kind of a loop event */

    switch (key >> 32) {
    case EVENT_LOOP:
        return kind == LOOP_EVENT_BACK     ? JOURNAL_INFO
               : kind >= LOOP_EVENT_PAUSED ? JOURNAL_NOTICE
                                           : JOURNAL_WARNING;
    case EVENT_BOARD:

        /* Priority of changes that a host requested */
        switch ((enum board_event_kind)(key >> 16 & 0xffff)) {
        case BOARD_EVENT_MODE:
        case BOARD_EVENT_ADDRESS:
        case BOARD_EVENT_RESTART:
        case BOARD_EVENT_FIRMWARE:
        case BOARD_EVENT_HEARD:
            return JOURNAL_INFO;
        default:
            return JOURNAL_WARNING;
        }
    case EVENT_RECORDER:
        return JOURNAL_ERROR;
    case EVENT_RELEASE:
        return JOURNAL_INFO;
    case EVENT_FAULT:
        return JOURNAL_NOTICE;
    default:
        return JOURNAL_WARNING;
    }
}

/* Writes why an axis tripped against the clamp and how to avoid it; returns false if none has. */
static bool simulator_next_clamped_trip(struct simulator *simulator, int64_t *time_ns, char *text,
                                        size_t size)
{
    double seconds;

    *time_ns = atomic_exchange(&simulator->clamped_trip, -1);
    seconds = (double)*time_ns * 1e-9;
    if (*time_ns < 0) {
        return false;
    }
    if (simulator->config.hold == RIG_HOLD_ENABLED) {
        snprintf(text, size,
                 "%.6f s: an axis has tripped against the clamp: the rig holds all links until all "
                 "%zu motors are on, and %d were on then. Switch on the others too, or take a rig "
                 "that holds nothing (initial: {hold: none}), as coman-bench",
                 seconds, simulator->config.rig->naxis, atomic_load(&simulator->clamped_trip_on));
    } else {
        snprintf(text, size,
                 "%.6f s: an axis has tripped against the clamp: all links are held. Release them, "
                 "or take a rig that holds nothing (initial: {hold: none}), as coman-bench",
                 seconds);
    }
    return true;
}

/* Returns the present virtual time, for events without a time of their own. */
static int64_t event_time_now(const struct simulator *simulator)
{
    struct simulator_status status;

    return simulator_read(simulator, &status) ? status.time_ns : 0;
}

/* Reads one event with its virtual time; returns false if there is none. */
static bool simulator_take_event(struct simulator *simulator, uint64_t *key, int64_t *time_ns,
                                 char *text, size_t size)
{
    struct loop_event loop_event;
    struct board_event board_event;
    struct fault_event fault_event;
    struct watch_event watch_event;
    unsigned kind;
    int64_t released = atomic_exchange(&simulator->released, -1);
    size_t bus;
    int used;

    /* Checks the sources in order */
    if (released >= 0) {
        *key = event_key(EVENT_RELEASE, 0);
        *time_ns = released;
        snprintf(text, size, "%.6f s: all motors are on, the robot is released",
                 (double)released * 1e-9);
        return true;
    }
    if (loop_next_event(simulator->loop, &loop_event)) {
        *key = event_key(EVENT_LOOP, (uint64_t)loop_event.kind << 8 | (uint8_t)loop_event.bus);
        *time_ns = loop_event.time_ns;
        used = snprintf(text, size, "%.6f s: ", (double)loop_event.time_ns * 1e-9);
        loop_event_format(simulator->loop, &loop_event, text + used, size - (size_t)used);
        return true;
    }
    if (faults_next_event(simulator->faults, &fault_event)) {
        *key = event_key(EVENT_FAULT, fault_event.fault);
        *time_ns = fault_event.time_ns;
        fault_event_format(simulator->faults, &fault_event, text, size);
        return true;
    }
    if (interfaces_next_event(&simulator->interfaces, &bus, text, size)) {
        *key = event_key(EVENT_INTERFACE, bus);
        *time_ns = event_time_now(simulator);
        return true;
    }
    if (watch_next_event(simulator->watch, &watch_event)) {
        *key = event_key(EVENT_ROBOT, (uint64_t)watch_event.kind << 16 | watch_event.index);
        *time_ns = watch_event.time_ns;
        watch_event_format(simulator->watch, &watch_event, text, size);
        return true;
    }
    if (boards_next_event(simulator->boards, &board_event)) {
        /* One topic for all axes, because they change their mode together when a controller
         * connects or disconnects */
        bool grouped = board_event.kind == BOARD_EVENT_MODE;

        *key = event_key(EVENT_BOARD,
                         (uint64_t)board_event.kind << 16 |
                             (grouped ? 0 : (uint64_t)board_event.bus << 8 | board_event.address));
        *time_ns = board_event.time_ns;
        board_event_format(simulator->boards, &board_event, text, size);
        if (board_event.kind == BOARD_EVENT_UNKNOWN || board_event.kind == BOARD_EVENT_MALFORMED) {
            pthread_mutex_lock(&simulator->dropped.lock);
            simulator->dropped.time_ns = board_event.time_ns;
            snprintf(simulator->dropped.reason, sizeof simulator->dropped.reason, "%s", text);
            pthread_mutex_unlock(&simulator->dropped.lock);
        }
        return true;
    }
    if (simulator_next_clamped_trip(simulator, time_ns, text,
                                    size)) { /* after the boards: a board's event names the axis */
        *key = event_key(EVENT_CLAMPED_TRIP, 0);
        return true;
    }
    if (simulator->recorder && recorder_next_event(simulator->recorder, &kind, text, size)) {
        *key = event_key(EVENT_RECORDER, kind);
        *time_ns = event_time_now(simulator);
        return true;
    }
    return false;
}

bool simulator_next_event(struct simulator *simulator, uint64_t *key, char *text, size_t size)
{
    int64_t time_ns;

    if (!simulator_take_event(simulator, key, &time_ns, text, size)) {
        return false;
    }
    if (simulator->recorder) {
        /* Leave out the leading time, "1.234567 s: ", if there is one */
        const size_t digits = strspn(text, "-0123456789.");
        const bool timed = digits && !strncmp(text + digits, " s: ", 4);

        recorder_event(simulator->recorder, time_ns, (unsigned)(*key >> 32),
                       simulator_event_priority(*key), timed ? text + digits + 4 : text);
    }
    return true;
}

void simulator_record_event(struct simulator *simulator, uint64_t key, const char *text)
{
    if (simulator->recorder) {
        recorder_event(simulator->recorder, event_time_now(simulator), (unsigned)(key >> 32),
                       simulator_event_priority(key), text);
    }
}
