/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loop's end of rt/requests.h: takes requests, answers them and publishes the state that other
 * threads may read. All in the loop's thread, RT-safe.
 */
#ifndef RT_REQUESTS_PRIVATE_H
#define RT_REQUESTS_PRIVATE_H

#include "rt/request_machine.h"

const struct request_machine *requests_machine(const struct requests *requests);

/* Takes the next request, if one waits and there is room for its answer; checks whether that is
 * so. */
bool requests_next(struct requests *requests, struct loop_request *request);
bool requests_waits(const struct requests *requests);

/* Answers a request that was taken, with tick and virtual time at which it was carried out. */
void requests_reply(struct requests *requests, uint64_t ticket, enum request_verdict verdict,
                    uint64_t tick, int64_t now_ns);

/* Publishes whether the loop is paused and its speed. */
void requests_publish(struct requests *requests, bool paused, double speed);

/* Publishes the values of the tunables; without `all` only when some may have changed. */
void requests_publish_values(struct requests *requests, bool all);

/* Takes no more requests: what waits is answered REQUEST_UNAVAILABLE. */
void requests_close(struct requests *requests, uint64_t tick, int64_t now_ns);

/* Begin and end a sleep until a request comes: between them the returned descriptor becomes
 * readable when one does. -1 = a request waits already. */
int requests_sleep_begin(struct requests *requests);
void requests_sleep_end(struct requests *requests, bool readable);

#endif
