/* SPDX-License-Identifier: Apache-2.0 */
/* A contact engine in front of another, with a stopwatch. */
#include "sim/timed_contact.h"

#include <string.h>

static enum error_code timed_evaluate(struct contact_world *world, const struct body_motion *motion,
                                      struct contact_wrench *wrench)
{
    struct timed_contact *timed = (struct timed_contact *)world;
    int64_t begin = clock_now(timed->time);
    enum error_code code;

    if (timed->remembered && memcmp(motion, timed->motion, timed->nbody * sizeof *motion) == 0) {
        memcpy(wrench, timed->wrench, timed->nbody * sizeof *wrench);
        return ERROR_NONE;
    }
    code = timed->engine->ops->evaluate(timed->engine, motion, wrench);
    timed->remembered = !code;
    memcpy(timed->motion, motion, timed->nbody * sizeof *motion);
    memcpy(timed->wrench, wrench, timed->nbody * sizeof *wrench);
    timed->spent_ns += clock_now(timed->time) - begin;
    timed->evaluations++;
    return code;
}

static size_t timed_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    struct timed_contact *timed = (struct timed_contact *)world;

    return timed->engine->ops->patches(timed->engine, patch, max);
}

static size_t timed_tangents(struct contact_world *world, struct contact_tangent *tangent,
                             size_t max)
{
    struct timed_contact *timed = (struct timed_contact *)world;
    int64_t begin = clock_now(timed->time);
    size_t count = timed->engine->ops->tangents(timed->engine, tangent, max);

    timed->spent_ns += clock_now(timed->time) - begin;
    return count;
}

static const char *timed_failure(const struct contact_world *world)
{
    const struct timed_contact *timed = (const struct timed_contact *)world;

    return timed->engine->ops->failure(timed->engine);
}

static void timed_destroy(struct contact_world *world)
{
    struct timed_contact *timed = (struct timed_contact *)world;

    if (timed->engine) {
        timed->engine->ops->destroy(timed->engine);
        timed->engine = NULL;
    }
}

const struct contact_ops timed_contact_ops = {
    .name = "timed",
    .evaluate = timed_evaluate,
    .patches = timed_patches,
    .tangents = timed_tangents,
    .failure = timed_failure,
    .destroy = timed_destroy,
};
