/* SPDX-License-Identifier: Apache-2.0 */
/* Pushes of a robot's bodies: taken from requests, given to the plant, ended when they are over. */
#include "sim/robot_requests_private.h"

#include <math.h>

/* Largest component of a push, N and N m. */
#define PUSH_MAX_N 1e6

/* Returns the number of bodies: the robot's, then free ones. */
size_t robot_body_count(const struct robot_requests *s)
{
    return s->config.rig->robot->nbody + s->config.rig->nfree;
}

/* Checks that each component of a push is finite and within PUSH_MAX_N. */
static bool push_is_bounded(const double vector[3])
{
    for (int i = 0; i < 3; i++) {
        if (!(fabs(vector[i]) <= PUSH_MAX_N)) {
            return false;
        }
    }
    return true;
}

/* Pushes a body with force and moment (world frame), for a duration (at least a tick) or until
 * changed. */
enum request_verdict robot_push_body(void *context, const struct loop_request *request,
                                     int64_t now_ns)
{
    struct robot_requests *s = context;
    int64_t tick_ns = s->config.rig->tick_ns, duration_ns = request->duration_ns;

    if (request->index >= robot_body_count(s) || duration_ns < 0 ||
        duration_ns > INT64_MAX - now_ns || !push_is_bounded(request->force_n) ||
        !push_is_bounded(request->moment_nm)) {
        return REQUEST_RANGE;
    }
    plant_set_push(s->config.plant, (int)request->index, request->force_n, request->moment_nm);
    s->moving.pushing = s->moving.pushing || duration_ns > 0;
    s->push_until[request->index] =
        duration_ns == 0 ? 0 : now_ns + (duration_ns > tick_ns ? duration_ns : tick_ns);
    return REQUEST_OK;
}

/* Ends the pushes whose duration is over. */
void robot_end_pushes(struct robot_requests *s, int64_t now_ns)
{
    const double none[3] = {0.0, 0.0, 0.0};

    s->moving.pushing = false;
    for (size_t b = 0; b < robot_body_count(s); b++) {
        if (s->push_until[b] > 0 && now_ns >= s->push_until[b]) {
            s->push_until[b] = 0;
            plant_set_push(s->config.plant, (int)b, none, none);
        }
        s->moving.pushing = s->moving.pushing || s->push_until[b] > 0;
    }
}

/* Returns the name of a body: the robot's first, then free ones. */
const char *robot_body_name(void *context, size_t index)
{
    const struct robot_requests *s = context;
    const struct robot *robot = s->config.rig->robot;

    return index < robot->nbody ? robot->body[index].name
                                : s->config.rig->free[index - robot->nbody].name;
}
