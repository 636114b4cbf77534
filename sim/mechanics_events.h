/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Looks after the robot's mechanics and tells what a user has to know of them, once an occurrence:
 *   a joint past one of its limits, and how far it got within WATCH_RISE_NS; told again after it
 *     has been back within its range by WATCH_BACK for WATCH_QUIET_NS;
 *   a series spring at its stop; told again after it has been off it by a tenth of its room for as
 *     long;
 *   a fall of a robot with a floating base that is not clamped: its base is tilted by more than 60
 *     degrees, or lower above its lowest observed body (robot_body.observed) than half of what it
 *     was, or a body touches a surface of the world that is not the end of a limb (the last body of
 *     its chain) and that the robot did not stand on in its first WATCH_STANDS_NS. Tilts and
 *     heights are against gravity and refer to where the robot was last clamped, or started. Told
 *     again after none of the three was true for WATCH_CALM_NS.
 * It reads, and changes nothing. SI units, virtual times in ns. One thread makes it and steps it,
 * another takes the events.
 */
#ifndef SIM_MECHANICS_EVENTS_H
#define SIM_MECHANICS_EVENTS_H

#include "model/plant.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Depth from which a joint counts as past its limit, and the way back within its range, rad or
 * m. */
#define WATCH_PAST 1e-4
#define WATCH_BACK 1e-2

#define WATCH_RISE_NS INT64_C(10000000)
#define WATCH_QUIET_NS INT64_C(100000000)
#define WATCH_STANDS_NS INT64_C(100000000)
#define WATCH_CALM_NS INT64_C(1000000000)

enum watch_kind {
    WATCH_JOINT,  /* index: joint; value: greatest depth; limit: which */
    WATCH_SPRING, /* index: joint; value: the deflection at which the stop begins */
    WATCH_TILT,   /* value: rad */
    WATCH_SINK,   /* value: height now, m; limit: at the start */
    WATCH_TOUCH,  /* index: body; surface: of the world */
};

struct watch_event {
    int64_t time_ns; /* when it began */
    enum watch_kind kind;
    size_t index, surface;
    double value, limit;
};

struct watch;
struct ring;

/* Creates the watch in memory from arena; rig and plant are borrowed, the plant has its first
 * sample. ERROR_MEMORY. Not RT-safe. */
enum error_code watch_create(const struct rig *rig, struct plant *plant, struct arena *arena,
                             struct watch **watch, struct error *error);

/* Looks at the plant after each of its samples, with the tick's time. RT-safe. */
void watch_step(struct watch *watch, int64_t now_ns);

/* Returns the ring of events, which the thread that reads them writes too: a checkpoint leaves
 * it alone. */
const struct ring *watch_event_ring(const struct watch *watch);

/* Takes one event; false when none waits. RT-safe. */
bool watch_next_event(struct watch *watch, struct watch_event *event);

/* Writes an event as a line of text with its time. */
void watch_event_format(const struct watch *watch, const struct watch_event *event, char *text,
                        size_t size);

#endif
