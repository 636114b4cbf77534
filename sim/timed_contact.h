/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The contact engine with a stopwatch, for its share of the plant's time is wanted, and a memory of
 * one evaluation: the sensors at the end of a tick and the first stage of the next ask for the same
 * motion, and what the engine answers depends on nothing else.
 */
#ifndef SIM_TIMED_CONTACT_H
#define SIM_TIMED_CONTACT_H

#include "contact/contact.h"
#include "rt/clock.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct timed_contact {
    struct contact_world world;
    struct contact_ops ops; /* without what the engine cannot do */
    struct contact_world *engine;
    struct clock *time;
    size_t nbody;
    struct body_motion *motion; /* of the last evaluation */
    struct contact_wrench *wrench;
    bool remembered;
    uint64_t evaluations;
    int64_t spent_ns;
};

/* What a world with a stopwatch does; one without tangents has to say so in a copy of it. */
extern const struct contact_ops timed_contact_ops;

#endif
