/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's side of the contact engine: the motions that it is asked with, a memory of its last
 * evaluation, and what it costs.
 *
 * The sensors at the end of a tick and the first stage of the next ask for the same motion, and an
 * engine's answer depends on nothing but the motion and the bristles: the second time it comes from
 * the memory. The engine's patches and tangents are then still those of that motion.
 */
#include "model/plant_private.h"

#include <string.h>

/* The wrenches of the last evaluation lie behind the motions that it was for. */
static struct contact_wrench *remembered_wrench(const struct plant *plant)
{
    return (struct contact_wrench *)(plant->contact_memory->motion + plant->config.ncontact);
}

/* Behind them its bristles, then their rates. */
static double *remembered_bristles(const struct plant *plant)
{
    return (double *)(remembered_wrench(plant) + plant->config.ncontact);
}

static size_t contact_memory_size(const struct plant *plant)
{
    return sizeof *plant->contact_memory +
           plant->config.ncontact * (sizeof(struct body_motion) + sizeof(struct contact_wrench)) +
           2 * plant->nbristle * sizeof(double);
}

bool plant_contact_create(struct plant *plant, struct arena *arena)
{
    plant->contact_memory = arena_alloc(arena, 1, contact_memory_size(plant));
    return plant->contact_memory;
}

/* Reading of the stopwatch; 0 without one. */
static int64_t stopwatch_ns(const struct plant *plant)
{
    return plant->config.now_ns ? plant->config.now_ns(plant->config.clock) : 0;
}

/* Whether the memory's bristles are those of a state, so far ahead; they are from now on. */
static bool remember_bristles(struct plant *plant, const double *state, double ahead_s)
{
    struct plant_contact_memory *memory = plant->contact_memory;
    const double *bristle = state + plant->at.bristle;
    size_t bytes = plant->nbristle * sizeof *bristle;
    bool same = plant->nbristle == 0 || (ahead_s == memory->ahead_s &&
                                         memcmp(remembered_bristles(plant), bristle, bytes) == 0);

    memory->ahead_s = ahead_s;
    memcpy(remembered_bristles(plant), bristle, bytes);
    return same;
}

enum error_code plant_contact_evaluate(struct plant *plant, const double *state, double ahead_s)
{
    const struct plant_config *config = &plant->config;
    struct plant_contact_memory *memory = plant->contact_memory;
    struct contact_world *engine = config->contact;
    bool answered = remember_bristles(plant, state, ahead_s) && memory->valid;

    /* The motions, in the engine's order; is it the question that it has answered last? */
    config->dynamics->ops->kinematics(config->dynamics, plant->q, state + plant->at.v,
                                      plant->motion);
    for (size_t c = 0; c < config->ncontact; c++) {
        const struct body_motion *motion = &plant->motion[config->contact_body[c]];

        if (memcmp(&memory->motion[c], motion, sizeof *motion) != 0) {
            memory->motion[c] = *motion;
            answered = false;
        }
    }

    if (!answered) {
        const struct contact_bristles bristles = {remembered_bristles(plant), ahead_s,
                                                  remembered_bristles(plant) + plant->nbristle};
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
    }
    memcpy(plant->contact_wrench, remembered_wrench(plant),
           config->ncontact * sizeof *plant->contact_wrench);
    memcpy(plant->bristle_rate, remembered_bristles(plant) + plant->nbristle,
           plant->nbristle * sizeof *plant->bristle_rate);
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
