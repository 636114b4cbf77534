/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a whole simulator in checkpoints: which memory it is, and what waits on local
 * buses. checkpoint.c copies the memory. */
#include "sim/robot_requests_private.h"

#include "base/ring.h"
#include "canbus/wire/wire.h"

#include <string.h>

/* Leaves a ring out of checkpoints: its reader, another thread, writes it too. */
static void hole_add_ring(struct span *hole, size_t *count, const struct ring *ring)
{
    hole[(*count)++] = (struct span){(void *)(uintptr_t)ring, sizeof *ring};
    hole[(*count)++] = (struct span){ring->slots, ring->slot_size * ((size_t)ring->mask + 1)};
}

/* Creates the checkpoint slots over all memory that changes in virtual time, less what other
 * threads write in it. */
enum error_code robot_checkpoint_create(struct robot_requests *s, struct arena *arena,
                                        struct error *error)
{
    const struct robot_requests_config *config = &s->config;
    enum { OWN_SPANS = 3, OWN_HOLES = 5 };
    struct span *moving =
        arena_alloc(arena, config->nmoving + RIG_BUSES_MAX + OWN_SPANS, sizeof *moving);
    struct span *hole = arena_alloc(arena, config->nhole + OWN_HOLES, sizeof *hole);
    size_t nmoving = config->nmoving, nhole = config->nhole;

    if (!moving || !hole) {
        return error_set(error, ERROR_MEMORY, "no memory left for the requests");
    }

    /* Memory that changes: the caller's, the requests' own, the wires */
    memcpy(moving, config->moving, nmoving * sizeof *moving);
    memcpy(hole, config->hole, nhole * sizeof *hole);
    moving[nmoving++] = (struct span){&s->moving, sizeof s->moving};
    moving[nmoving++] = (struct span){s->push_until, robot_body_count(s) * sizeof *s->push_until};
    moving[nmoving++] =
        (struct span){s->pretension, config->rig->robot->njoint * sizeof *s->pretension};
    for (size_t b = 0; b < config->rig->nbus; b++) {
        if (config->buses->wire[b]) {
            struct span *wire = &moving[nmoving++];

            wire->memory = wire_memory(config->buses->wire[b], &wire->size);
        }
    }

    /* Holes: what other threads write in it */
    hole_add_ring(hole, &nhole, boards_event_ring(config->boards));
    hole_add_ring(hole, &nhole, faults_event_ring(config->faults));

    /* What the plant remembers of the last contact evaluation is valid for any state */
    hole[nhole].memory = plant_contact_memory(config->plant, &hole[nhole].size);
    nhole++;
    return checkpoint_create(moving, nmoving, hole, nhole, CHECKPOINT_SLOTS, arena, &s->checkpoint,
                             error);
}

/* Allocates room for the frames on local buses of each slot; false = no memory. */
bool robot_checkpoint_create_buses(struct robot_requests *s, struct arena *arena)
{
    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        struct local_bus *bus = s->config.buses->bus[b];

        for (size_t slot = 0; bus && slot < CHECKPOINT_SLOTS; slot++) {
            s->bus_moment[slot][b] = arena_alloc(arena, 1, local_bus_save_size(bus));
            if (!s->bus_moment[slot][b]) {
                return false;
            }
        }
    }
    return true;
}

/* Saves the state to a slot: frames on local buses, then memory. */
enum request_verdict robot_save(void *context, size_t slot)
{
    struct robot_requests *s = context;

    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        if (s->bus_moment[slot][b] &&
            !local_bus_save(s->config.buses->bus[b], s->config.own, s->bus_moment[slot][b])) {
            return REQUEST_UNAVAILABLE;
        }
    }
    checkpoint_save(s->checkpoint, slot);
    return REQUEST_OK;
}

/* Restores the state of a slot: memory, frames on local buses, then the ports' view of it. */
void robot_restore(void *context, size_t slot)
{
    struct robot_requests *s = context;

    checkpoint_restore(s->checkpoint, slot);
    for (size_t b = 0; b < s->config.rig->nbus; b++) {
        if (s->bus_moment[slot][b]) {
            local_bus_restore(s->config.buses->bus[b], s->config.own, s->bus_moment[slot][b]);
        }
    }
    fault_injection_restored(s->config.injection);
}
