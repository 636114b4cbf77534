/* SPDX-License-Identifier: Apache-2.0 */
/* Completes a loop's configuration with its defaults, and a machine with functions that do
 * nothing where it has none. With them in place the loop calls every phase without checking for
 * NULL. */
#include "rt/loop_private.h"

/* ---- a machine that does nothing ---- */

static void idle_receive(void *context, int64_t now_ns, size_t bus, const struct bus_frame *frame)
{
    (void)context, (void)now_ns, (void)bus, (void)frame;
}

static void idle_phase(void *context, int64_t now_ns)
{
    (void)context, (void)now_ns;
}

static bool idle_model(void *context, int64_t now_ns)
{
    (void)context, (void)now_ns;
    return true;
}

static size_t idle_transmit(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                            size_t max)
{
    (void)context, (void)now_ns, (void)bus, (void)frames, (void)max;
    return 0;
}

static bool idle_fault(void *context)
{
    (void)context;
    return false;
}

static void idle_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    (void)context, (void)now_ns, (void)stats;
}

static void idle_wait(void *context)
{
    (void)context;
}

/* Puts a function that does nothing in the place of each one that the machine lacks. */
static void complete_machine(struct loop_machine *machine)
{
    machine->begin = machine->begin ? machine->begin : idle_phase;
    machine->receive = machine->receive ? machine->receive : idle_receive;
    machine->control = machine->control ? machine->control : idle_phase;
    machine->plant = machine->plant ? machine->plant : idle_model;
    machine->sample = machine->sample ? machine->sample : idle_model;
    machine->transmit = machine->transmit ? machine->transmit : idle_transmit;
    machine->fault = machine->fault ? machine->fault : idle_fault;
    machine->publish = machine->publish ? machine->publish : idle_publish;
    machine->idle = machine->idle ? machine->idle : idle_wait;
    machine->shut_down = machine->shut_down ? machine->shut_down : idle_phase;
}

/* ---- the configuration ---- */

/* Sets the default identifiers (equal ones mean unset) and the default time-out of lockstep. */
static void complete_lockstep(struct loop_lockstep *lockstep)
{
    if (lockstep->step_id == lockstep->done_id) {
        lockstep->step_id = LOCKSTEP_STEP_ID;
        lockstep->done_id = LOCKSTEP_DONE_ID;
    }
    if (lockstep->partner_timeout_ns == 0) {
        lockstep->partner_timeout_ns = CLOCK_SECOND;
    }
}

bool loop_complete_config(struct loop_config *config, struct arena *arena)
{
    config->tick_ns = config->tick_ns ? config->tick_ns : CLOCK_MS;
    config->stop_after = config->stop_after ? config->stop_after : 1;
    config->time = config->time ? config->time : clock_monotonic();
    complete_lockstep(&config->lockstep);
    complete_machine(&config->machine);
    if (!config->transmit_max) {
        size_t *most = arena_alloc(arena, config->nbus + 1, sizeof *most);

        for (size_t b = 0; most && b < config->nbus; b++) {
            most[b] = LOOP_TRANSMIT_DEFAULT;
        }
        config->transmit_max = most;
    }
    return config->transmit_max != NULL;
}
