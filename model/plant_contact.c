/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's interface to the contact engine: the input motions, a memory of the last evaluation,
 * and the measured cost.
 *
 * The sensors at the end of a tick and the first stage of the next tick need the same evaluation.
 * The engine's result depends only on the motion and the bristles. So the memory provides the
 * result of the second evaluation. The engine's patches and tangents remain valid for that motion.
 */
#include "model/plant_private.h"

#include <math.h>
#include <string.h>

/* Returns the wrenches of the last evaluation, stored behind its motions. */
static struct contact_wrench *remembered_wrench(const struct plant *plant)
{
    return (struct contact_wrench *)(plant->contact_memory->motion + plant->config.ncontact);
}

/* Returns the rates of the bristles, stored behind the wrenches. The bristles of the listed pairs
 * follow. */
static double *remembered_rates(const struct plant *plant)
{
    return (double *)(remembered_wrench(plant) + plant->config.ncontact);
}

static double *remembered_bristles(const struct plant *plant)
{
    return remembered_rates(plant) + plant->nbristle;
}

/* Returns the pairs, stored behind the bristles: pairs listed before the evaluation, then pairs
 * that the engine added. */
static int *remembered_pairs(const struct plant *plant)
{
    return (int *)(remembered_bristles(plant) + plant->nbristle);
}

static size_t contact_memory_size(const struct plant *plant)
{
    return sizeof *plant->contact_memory +
           plant->config.ncontact * (sizeof(struct body_motion) + sizeof(struct contact_wrench)) +
           2 * plant->nbristle * sizeof(double) +
           plant->nbristle / CONTACT_BRISTLE * sizeof *plant->live;
}

bool plant_contact_create(struct plant *plant, struct arena *arena)
{
    plant->contact_memory = arena_alloc(arena, 1, contact_memory_size(plant));
    if (plant->contact_memory) {
        plant->bristle_rate = remembered_rates(plant);
    }
    return plant->contact_memory;
}

/* Reads the configuration's clock. Returns 0 without a clock. */
static int64_t stopwatch_ns(const struct plant *plant)
{
    return plant->config.now_ns ? plant->config.now_ns(plant->config.clock) : 0;
}

/* ---- bristles ---- */

#define BRISTLE_LEAST 1e-15 /* J^0.5 */

enum { BRISTLES_AT_ONCE = 32 * CONTACT_BRISTLE };

/* Returns whether all bristles of a pair are below BRISTLE_LEAST, so that they count as relaxed. */
static bool bristles_are_relaxed(const double y[CONTACT_BRISTLE])
{
    for (int k = 0; k < CONTACT_BRISTLE; k++) {
        if (fabs(y[k]) >= BRISTLE_LEAST) {
            return false;
        }
    }
    return true;
}

/* Zeros, to compare bristles with. */
static const double none[BRISTLES_AT_ONCE];

void plant_find_bristles(struct plant *plant)
{
    const double *y = plant->state + plant->at.bristle;
    size_t end;

    plant->nlive = 0;
    for (size_t from = 0; from < plant->nbristle; from = end) {
        end = from + BRISTLES_AT_ONCE < plant->nbristle ? from + BRISTLES_AT_ONCE : plant->nbristle;
        if (memcmp(y + from, none, (end - from) * sizeof *y) == 0) {
            continue; /* usual case: few of many pairs touch */
        }
        for (size_t i = from; i < end; i += CONTACT_BRISTLE) {
            if (memcmp(y + i, none, CONTACT_BRISTLE * sizeof *y) != 0) {
                plant->live[plant->nlive++] = (int)(i / CONTACT_BRISTLE);
            }
        }
    }
}

void plant_list_bristles(struct plant *plant)
{
    const double *y = plant->state + plant->at.bristle;
    const size_t listed = plant->nlive;

    if (plant->handed_out) {
        plant_find_bristles(plant);
        return;
    }
    plant->nlive = 0;
    for (size_t i = 0; i < listed; i++) {
        const int pair = plant->live[i];
        size_t at = plant->nlive;

        if (memcmp(y + CONTACT_BRISTLE * (size_t)pair, none, CONTACT_BRISTLE * sizeof *y) == 0) {
            continue;
        }
        for (; at > 0 && plant->live[at - 1] > pair; at--) {
            plant->live[at] = plant->live[at - 1];
        }
        plant->live[at] = pair;
        plant->nlive++;
    }
}

void plant_drop_bristles(struct plant *plant)
{
    for (size_t i = 0; i < plant->nlive; i++) {
        double *y = plant->state + plant->at.bristle + CONTACT_BRISTLE * (size_t)plant->live[i];

        if (bristles_are_relaxed(y)) {
            memset(y, 0, CONTACT_BRISTLE * sizeof *y);
        }
    }
}

void plant_keep_state(struct plant *plant)
{
    const size_t each = CONTACT_BRISTLE * sizeof *plant->state;
    const double *y = plant->state + plant->at.bristle;
    double *kept = plant->last_good + plant->at.bristle;

    memcpy(plant->last_good, plant->state, plant->at.bristle * sizeof *plant->state);
    for (size_t i = 0; i < plant->nkept; i++) {
        memset(kept + CONTACT_BRISTLE * (size_t)plant->kept[i], 0, each);
    }
    for (size_t i = 0; i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        memcpy(kept + from, y + from, each);
        plant->kept[i] = plant->live[i];
    }
    plant->nkept = plant->nlive;
}

void plant_return_state(struct plant *plant)
{
    double *y = plant->state + plant->at.bristle;
    const double *kept = plant->last_good + plant->at.bristle;

    memcpy(plant->state, plant->last_good, plant->at.bristle * sizeof *plant->state);
    for (size_t i = 0; i < plant->nlive; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)plant->live[i];

        memcpy(y + from, kept + from, CONTACT_BRISTLE * sizeof *y);
    }
}

/* Stores the live bristles and the time ahead in the memory. Returns whether the memory already had
 * the same values. */
static bool remember_bristles(struct plant *plant, const double *bristle, double ahead_s)
{
    struct plant_contact_memory *memory = plant->contact_memory;
    const size_t n = plant->nlive, each = CONTACT_BRISTLE * sizeof *bristle;
    bool same = ahead_s == memory->ahead_s && n == memory->nasked &&
                memcmp(remembered_pairs(plant), plant->live, n * sizeof *plant->live) == 0;

    for (size_t i = 0; i < n; i++) {
        const double *y = bristle + CONTACT_BRISTLE * (size_t)plant->live[i];
        double *own = remembered_bristles(plant) + CONTACT_BRISTLE * i;

        same = same && memcmp(own, y, each) == 0;
        memcpy(own, y, each);
    }
    memory->ahead_s = ahead_s;
    memory->nasked = n;
    return same;
}

/* ---- evaluations ---- */

enum error_code plant_contact_evaluate(struct plant *plant, const double *v, const double *bristle,
                                       double ahead_s)
{
    const struct plant_config *config = &plant->config;
    struct plant_contact_memory *memory = plant->contact_memory;
    struct contact_world *engine = config->contact;
    bool answered = remember_bristles(plant, bristle, ahead_s) && memory->valid;

    /* Compute the motions in the engine's order, and compare them with the last evaluation */
    config->dynamics->ops->kinematics(config->dynamics, plant->q, v, plant->motion);
    for (size_t c = 0; c < config->ncontact; c++) {
        const struct body_motion *motion = &plant->motion[config->contact_body[c]];

        if (!answered || memcmp(&memory->motion[c], motion, sizeof *motion) != 0) {
            memory->motion[c] = *motion;
            answered = false;
        }
    }

    if (!answered) {
        struct contact_bristles bristles = {bristle, ahead_s, remembered_rates(plant), plant->live,
                                            plant->nlive};
        int64_t begin = stopwatch_ns(plant);
        enum error_code code =
            engine->ops->evaluate(engine, memory->motion, plant->nbristle > 0 ? &bristles : NULL,
                                  remembered_wrench(plant));

        memory->cost.spent_ns += stopwatch_ns(plant) - begin;
        memory->cost.evaluations++;
        memory->valid = code == ERROR_NONE;
        if (code != ERROR_NONE) {
            plant->failure = engine->ops->failure(engine);
            return code;
        }
        memory->nlive = bristles.npair;
        memcpy(remembered_pairs(plant), plant->live, memory->nlive * sizeof *plant->live);
    }

    /* Copy the pairs that the engine added, and the results, from the memory */
    memcpy(plant->live, remembered_pairs(plant), memory->nlive * sizeof *plant->live);
    plant->nlive = memory->nlive;
    plant->bristles_follow = true;
    memcpy(plant->contact_wrench, remembered_wrench(plant),
           config->ncontact * sizeof *plant->contact_wrench);
    return ERROR_NONE;
}

size_t plant_contact_tangents(struct plant *plant, struct contact_tangent *tangent, size_t max)
{
    struct contact_world *engine = plant->config.contact;
    int64_t begin = stopwatch_ns(plant);
    size_t count = engine->ops->tangents(engine, tangent, max);

    plant->contact_memory->cost.spent_ns += stopwatch_ns(plant) - begin;
    return count;
}

const struct plant_contact_cost *plant_contact_cost(const struct plant *plant)
{
    return &plant->contact_memory->cost;
}

void *plant_contact_memory(const struct plant *plant, size_t *size)
{
    *size = contact_memory_size(plant);
    return plant->contact_memory;
}
