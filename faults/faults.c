/* SPDX-License-Identifier: Apache-2.0 */
/* Stores the faults, switches them on and off, and records an event at each change. */
#include "faults/faults.h"

#include "base/ring.h"

#include <stdio.h>
#include <string.h>

enum { EVENT_SLOTS = 1024 };

/* Last cause of a fault's state: a command (off or on), or the fault's time window. */
enum hand { HAND_OFF, HAND_ON, BY_CLOCK };

struct faults {
    struct fault *fault;
    enum hand *hand;
    size_t count;
    uint64_t seed;
    struct ring events;
};

enum error_code faults_create(const struct fault *fault, size_t count, uint64_t seed,
                              struct arena *arena, struct faults **out, struct error *error)
{
    struct faults *faults = arena_alloc(arena, 1, sizeof *faults);
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct fault_event));

    if (count > FAULTS_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu faults, expected at most %d", count,
                         FAULTS_MAX);
    }
    if (!faults || !slots) {
        return error_set(error, ERROR_MEMORY, "no memory left for faults");
    }
    faults->fault = arena_alloc(arena, count, sizeof *faults->fault);
    faults->hand = arena_alloc(arena, count, sizeof *faults->hand);
    if (!faults->fault || !faults->hand) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu faults", count);
    }
    ring_init(&faults->events, slots, sizeof(struct fault_event), EVENT_SLOTS);
    faults->seed = seed;

    /* Copy the faults. A fault without a name gets its number as its name. Names must be unique */
    for (size_t i = 0; i < count; i++) {
        struct fault *to = &faults->fault[i];

        *to = fault[i];
        to->active = false;
        faults->hand[i] = BY_CLOCK;
        if (!to->name[0]) {
            snprintf(to->name, sizeof to->name, "%zu", i + 1);
        }
        if (faults_find(faults, to->name) >= 0) {
            return error_set(error, ERROR_INPUT,
                             "fault \"%.159s\": found the name %.64s again, expected another",
                             to->text, to->name);
        }
        faults->count++;
    }
    *out = faults;
    return ERROR_NONE;
}

size_t faults_count(const struct faults *faults)
{
    return faults->count;
}

const struct fault *faults_at(const struct faults *faults, size_t index)
{
    return &faults->fault[index];
}

uint64_t faults_seed(const struct faults *faults)
{
    return faults->seed;
}

int faults_find(const struct faults *faults, const char *name)
{
    for (size_t i = 0; i < faults->count; i++) {
        if (!strcmp(faults->fault[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

/* Switches a fault and records the event, unless the state is unchanged. */
static void faults_switch(struct faults *faults, int64_t now_ns, size_t index, bool active)
{
    struct fault_event event = {.time_ns = now_ns,
                                .fault = index,
                                .active = active,
                                .by_hand = faults->hand[index] != BY_CLOCK};

    if (faults->fault[index].active != active) {
        faults->fault[index].active = active;
        ring_push(&faults->events, &event); /* if the ring is full, only the log line is lost */
    }
}

void faults_step(struct faults *faults, int64_t now_ns)
{
    for (size_t i = 0; i < faults->count; i++) {
        const struct fault *fault = &faults->fault[i];
        bool in_window = now_ns >= fault->from_ns && now_ns < fault->to_ns;

        faults_switch(faults, now_ns, i,
                      faults->hand[i] == BY_CLOCK ? in_window : faults->hand[i] == HAND_ON);
    }
}

bool faults_set(struct faults *faults, int64_t now_ns, size_t index, bool active)
{
    if (index >= faults->count) {
        return false;
    }
    faults->hand[index] = active ? HAND_ON : HAND_OFF;
    faults_switch(faults, now_ns, index, active);
    return true;
}

const struct ring *faults_event_ring(const struct faults *faults)
{
    return &faults->events;
}

bool faults_next_event(struct faults *faults, struct fault_event *event)
{
    return ring_pop(&faults->events, event);
}

void fault_event_format(const struct faults *faults, const struct fault_event *event, char *text,
                        size_t size)
{
    const struct fault *fault = &faults->fault[event->fault];

    snprintf(text, size, "%.6f s: fault %s %s%s: %s", (double)event->time_ns * 1e-9, fault->name,
             event->active ? "begins" : "ends", event->by_hand ? " (by hand)" : "", fault->text);
}
