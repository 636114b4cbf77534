/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Watches the robot's mechanics and reports events, once per occurrence:
 *
 *   a joint past one of its limits, with the largest depth within WATCH_RISE_NS. It is reported
 *     again after the joint was within its range by WATCH_BACK for WATCH_QUIET_NS;
 *   a series spring at its stop. It is reported again after the spring was off the stop by a tenth
 *     of its room for the same time;
 *   a fall of a floating, unclamped robot. Criteria: the base is tilted by more than 60 degrees;
 *     its height above the lowest observed body (robot_body.observed) is less than half of the
 *     height at the start; or a body touches a surface of the world, where the body is not the end
 *     of a limb (the last body of its chain) and the robot did not stand on it in its first
 *     WATCH_STANDS_NS. Tilt and height are relative to gravity and to the posture at the last
 *     clamp, or at the start. A fall is reported again after no criterion was true for
 *     WATCH_CALM_NS;
 *   energy from nowhere (plant_check_energy), checked each WATCH_ENERGY_NS. It is reported again
 *     after none appeared for WATCH_CALM_NS;
 *   a surface deeper in another one than layers and backing can mean: than the layers' thickness
 *     and 2 cm, or a quarter of a radius. It is checked each WATCH_DEPTH_NS, and reported again
 *     after all were less deep for WATCH_CALM_NS.
 *
 * It only reads the plant. SI units, virtual times in ns. One thread creates and steps the watch;
 * another reads the events.
 */
#ifndef SIM_MECHANICS_EVENTS_H
#define SIM_MECHANICS_EVENTS_H

#include "model/plant.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Depth from which a joint counts as past its limit, and distance within its range that ends the
 * event, rad or m. */
#define WATCH_PAST 1e-4
#define WATCH_BACK 1e-2

#define WATCH_RISE_NS INT64_C(10000000)
#define WATCH_QUIET_NS INT64_C(100000000)
#define WATCH_STANDS_NS INT64_C(100000000)
#define WATCH_CALM_NS INT64_C(1000000000)
#define WATCH_ENERGY_NS INT64_C(25000000)
#define WATCH_DEPTH_NS INT64_C(10000000)

enum watch_kind {
    WATCH_JOINT,  /* index: joint; value: largest depth; limit: which one */
    WATCH_SPRING, /* index: joint; value: deflection at which the stop begins */
    WATCH_TILT,   /* value: tilt, rad */
    WATCH_SINK,   /* value: present height, m; limit: height at the start */
    WATCH_TOUCH,  /* index: body; surface: surface of the world */
    WATCH_ENERGY, /* value: energy from nowhere, J; limit: turnover, J; index: 1 = of contacts */
    WATCH_DEEP,   /* index, surface: both surfaces; value: depth, m; limit: most, m */
};

struct watch_event {
    int64_t time_ns; /* start of the event */
    enum watch_kind kind;
    size_t index, surface;
    double value, limit;
    int64_t span_ns; /* of WATCH_ENERGY */
};

struct watch;
struct ring;

/* Creates the watch in memory from arena; rig and plant are borrowed. The plant must have its
 * first sample. ERROR_INPUT if a surface starts too deep in a surface of the world; the error names
 * surfaces, body and depth. ERROR_MEMORY. Not RT-safe. */
enum error_code watch_create(const struct rig *rig, struct plant *plant, struct arena *arena,
                             struct watch **watch, struct error *error);

/* Checks the plant; call it after each of its samples, with the tick's time. RT-safe. */
void watch_step(struct watch *watch, int64_t now_ns);

/* Returns the ring of events. The reading thread writes it too, so a checkpoint must leave it
 * out. */
const struct ring *watch_event_ring(const struct watch *watch);

/* Checks the energy now, as watch_step does each WATCH_ENERGY_NS: emits one event when energy
 * appears from nowhere, until none did for WATCH_CALM_NS. RT-safe. */
void watch_check_energy(struct watch *watch, int64_t now_ns);

/* Returns whether energy has appeared from nowhere in the run. Any thread. RT-safe. */
bool watch_found_energy(const struct watch *watch);

/* Reads one event; returns false if there is none. RT-safe. */
bool watch_next_event(struct watch *watch, struct watch_event *event);

/* Writes an event as a line of text with its time. */
void watch_event_format(const struct watch *watch, const struct watch_event *event, char *text,
                        size_t size);

#endif
