/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loop's end of rt/steering.h: takes requests, answers them and publishes the state that other
 * threads may read. All in the loop's thread, RT-safe.
 */
#ifndef RT_STEERING_PRIVATE_H
#define RT_STEERING_PRIVATE_H

#include "rt/steering_machine.h"

const struct steering_machine *steering_machine(const struct steering *steering);

/* The next request, when one waits and there is room for its answer. */
bool steering_next(struct steering *steering, struct steer_request *request);
bool steering_waits(const struct steering *steering);

/* Answers a request that was taken; tick and virtual time at which it was carried out. */
void steering_reply(struct steering *steering, uint64_t ticket, enum steer_verdict verdict,
                    uint64_t tick, int64_t now_ns);

/* Publishes whether the loop is paused and its speed. */
void steering_publish(struct steering *steering, bool paused, double speed);

/* Publishes the values of the tunables; without `all` only when some may have changed. */
void steering_publish_values(struct steering *steering, bool all);

/* Takes no more requests: what waits is answered STEER_UNAVAILABLE. */
void steering_close(struct steering *steering, uint64_t tick, int64_t now_ns);

/* Sleeping until a request comes: between begin and end the returned descriptor becomes readable
 * when one does. -1: a request waits already. */
int steering_sleep_begin(struct steering *steering);
void steering_sleep_end(struct steering *steering, bool readable);

#endif
