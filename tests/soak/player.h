/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The controller of a soak: moves every joint for ever, switches axes on again that have switched
 * off, and restarts like a program would when boards have lost their settings. It sees frames only.
 */
#ifndef SOAK_PLAYER_H
#define SOAK_PLAYER_H

#include "base/random.h"
#include "sim/buses.h"
#include "tasks/host.h"
#include "tasks/servo.h"

enum { PLAYER_AXES_MAX = 64 };

struct player_axis {
    double amplitude_rad, frequency_hz, phase_rad;
    int64_t retry_ns; /* when to switch it on again */
    bool was_off, told_off;
    int tries;     /* to switch it on */
    int64_t on_ns; /* when it was last on */
};

struct player {
    const struct rig *rig;
    struct bus_ports ports;
    struct arena arena; /* of the present host */
    struct host *host;
    struct servo *servo;
    struct random_stream random;
    bool ready;
    int64_t ready_ns, resume_ns;      /* since when; when it tries again after a failure */
    double from_rad[PLAYER_AXES_MAX]; /* where the joints were then */
    struct player_axis axis[PLAYER_AXES_MAX];
    uint64_t starts, switched_on; /* hosts started, axes switched on again */
};

/* The ports are joined by the caller, who closes them. */
enum error_code player_init(struct player *player, const struct rig *rig, uint64_t seed,
                            struct error *error);
void player_fini(struct player *player);

/* One control period at a virtual time; silent: listens, but sends nothing. */
enum error_code player_step(struct player *player, int64_t time_ns, bool silent,
                            struct error *error);

/* Whether every motor has been on since, and told where it is; else which has not, and how it
 * is. */
bool player_all_back(const struct player *player, int64_t since_ns, char *text, size_t size);

#endif
