/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Watches the robot's mechanics and reports events, once per occurrence:
 *
 *   a joint past one of its limits, with the largest depth within WATCH_RISE_NS. It is reported
 *     again after the joint was within its range by WATCH_BACK for WATCH_QUIET_NS;
 *   a series spring at its stop. It is reported again after the deflection was below 90 % of the
 *     stop's deflection for the same time;
 *   a fall of a floating, unclamped robot. Criteria: the base is tilted by more than 60 degrees;
 *     its height above the lowest observed body (robot_body.observed) is less than half of the
 *     height at the start; or a body touches a surface of the world. The last body of a chain may
 *     touch it, and so may bodies that supported the robot in its first WATCH_STANDS_NS. Tilt and
 *     height are relative to gravity and to the posture at the last clamp, or at the start. A fall
 *     is reported again after no criterion was true for WATCH_CALM_NS;
 *   energy from nowhere (plant_check_energy), checked each WATCH_ENERGY_NS. It is reported again
 *     after no energy appeared for WATCH_CALM_NS;
 *   a surface too deep in another surface. The largest valid depth is the thickness of both layers
 *     plus 2 cm, or plus a quarter of a radius if that is more. It is checked each WATCH_DEPTH_NS,
 *     and reported again after no surface was too deep for WATCH_CALM_NS.
 *
 * It only reads the plant. SI units, virtual times in ns. One thread creates and steps the watch;
 * another reads the events.
 */
#ifndef SIM_MECHANICS_EVENTS_H
#define SIM_MECHANICS_EVENTS_H

#include "model/plant.h"
#include "rig/rig.h"

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
    WATCH_JOINT,  /* index: joint; value: largest depth; limit: the limit passed */
    WATCH_SPRING, /* index: joint; value: deflection at which the stop begins */
    WATCH_TILT,   /* value: tilt, rad */
    WATCH_SINK,   /* value: present height, m; limit: height at the start */
    WATCH_TOUCH,  /* index: body; surface: surface of the world */
    WATCH_ENERGY, /* value: energy, J; limit: turnover, J; index: 1 = of contact */
    WATCH_DEEP, /* index, surface: the two surfaces; value: depth, limit: largest valid depth, m */
};

struct watch_event {
    int64_t time_ns; /* start of the event */
    enum watch_kind kind;
    size_t index, surface;
    double value, limit;
    int64_t span_ns; /* WATCH_ENERGY only: time span of the check */
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

/* Returns the ring of events. Checkpoints must exclude it, because the reading thread writes it
 * too. */
const struct ring *watch_event_ring(const struct watch *watch);

/* Checks the energy now; watch_step does this each WATCH_ENERGY_NS. Emits one event when energy
 * appears from nowhere, and the next only after none appeared for WATCH_CALM_NS. RT-safe. */
void watch_check_energy(struct watch *watch, int64_t now_ns);

/* Returns whether energy has appeared from nowhere in the run. Any thread. RT-safe. */
bool watch_found_energy(const struct watch *watch);

/* Reads one event; returns false if there is none. RT-safe. */
bool watch_next_event(struct watch *watch, struct watch_event *event);

/* Writes an event as a line of text with its time. */
void watch_event_format(const struct watch *watch, const struct watch_event *event, char *text,
                        size_t size);

#endif
