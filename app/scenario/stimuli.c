/* SPDX-License-Identifier: Apache-2.0 */
/* Executes the stimuli of a scenario, tick by tick. */
#include "app/scenario/private.h"

static const double REFRESH_S = 0.01; /* period at which a voltage is set again */

/* Progress of one stimulus. */
struct state {
    bool left_out; /* the mutation omits this stimulus */
    bool begun, over;
    int64_t begin_ns, next_ns; /* time of the start; time of the next action */
    int fault;                 /* index among the simulator's faults, -1 = not known yet */
};

struct scenario_stimuli {
    const struct scenario *scenario;
    struct state state[SCENARIO_STIMULI_MAX];
    bool silence;
};

/* Writes the name that the simulator uses for a stimulus's fault. */
static void fault_name(size_t stimulus, char name[32])
{
    snprintf(name, 32, "stimulus-%zu", stimulus + 1);
}

/* ---- set-up ---- */

/* Checks whether a mutation omits a stimulus; mutation -1 omits none. */
static bool left_out(const struct scenario *scenario, int mutation, size_t stimulus)
{
    const char *label = scenario->stimulus[stimulus].label;
    const char *without = mutation < 0 ? NULL : scenario->mutation[mutation].without;

    return label && without && strcmp(label, without) == 0;
}

enum error_code scenario_stimuli_create(const struct scenario *scenario, int mutation,
                                        struct arena *arena, struct scenario_stimuli **out,
                                        const char **fault, size_t *nfault, struct error *error)
{
    struct scenario_stimuli *stimuli = arena_alloc(arena, 1, sizeof *stimuli);
    bool good = stimuli != NULL;

    /* Collect the faults of the scenario, of stimuli, and of the mutation. Stimuli switch their
     * faults on and off */
    *nfault = 0;
    for (size_t i = 0; i < scenario->nfault; i++) {
        fault[(*nfault)++] = scenario->fault[i].name;
    }
    for (size_t i = 0; i < scenario->nstimulus && good; i++) {
        const struct scenario_stimulus *stimulus = &scenario->stimulus[i];
        char name[32], line[FAULT_TEXT_SIZE + 64];

        stimuli->state[i] =
            (struct state){.left_out = left_out(scenario, mutation, i), .fault = -1};
        if (stimulus->action == SCENARIO_FAULT) {
            fault_name(i, name);
            snprintf(line, sizeof line, "%s: %s manual", name, stimulus->fault);
            fault[*nfault] = arena_strdup(arena, line);
            good = fault[(*nfault)++] != NULL;
        }
    }
    if (good && mutation >= 0 && scenario->mutation[mutation].fault) {
        char line[FAULT_TEXT_SIZE + 64];

        snprintf(line, sizeof line, "mutation: %s", scenario->mutation[mutation].fault);
        fault[*nfault] = arena_strdup(arena, line);
        good = fault[(*nfault)++] != NULL;
    }
    if (!good) {
        return error_set(error, ERROR_MEMORY, "%s: no memory left for stimuli", scenario->file);
    }
    stimuli->scenario = scenario;
    *out = stimuli;
    return ERROR_NONE;
}

/* ---- the actions ---- */

/* Switches a stimulus's fault on or off. */
static void stimulus_switch_fault(struct scenario_stimuli *stimuli, size_t index,
                                  const struct scenario_view *view, bool active, int64_t time_ns)
{
    struct faults *faults = simulator_parts(view->simulator).faults;
    struct state *state = &stimuli->state[index];
    char name[32];

    if (state->fault < 0) {
        fault_name(index, name);
        state->fault = faults_find(faults, name);
    }
    faults_set(faults, time_ns, (size_t)state->fault, active);
}

/* Sets or ends a push on a body. */
static void stimulus_push(const struct scenario_push *what, const struct scenario_view *view,
                          bool on)
{
    static const double none[3];

    plant_set_push(simulator_plant(view->simulator), what->index, on ? what->force_n : none,
                   on ? what->moment_nm : none);
}

/* Executes the action of a stimulus, also when it is repeated. */
static void stimulus_act(struct scenario_stimuli *stimuli, size_t index,
                         const struct scenario_view *view, const struct bus_ports *ports,
                         int64_t time_ns)
{
    const struct scenario_stimulus *stimulus = &stimuli->scenario->stimulus[index];
    struct bus_frame frame = stimulus->frame.frame;

    switch (stimulus->action) {
    case SCENARIO_FRAME:
        frame.time_ns = time_ns;
        for (int64_t i = 0; i < stimulus->frame.copies; i++) {
            can_send(ports->port[stimulus->frame.bus_index], &frame, 1);
        }
        break;
    case SCENARIO_VOLTAGE:
        host_set_voltage(view->host, (size_t)stimulus->voltage.axis, stimulus->voltage.volts);
        break;
    case SCENARIO_MOTOR:
        /* Make the host switch one motor or all motors */
        for (size_t i = 0; i < view->rig->naxis; i++) {
            if (stimulus->motor.axis < 0 || stimulus->motor.axis == (int)i) {
                host_set_motor(view->host, i, stimulus->motor.on);
            }
        }
        break;
    case SCENARIO_PUSH:
        stimulus_push(&stimulus->push, view, true);
        break;
    case SCENARIO_FAULT:
        stimulus_switch_fault(stimuli, index, view, true, time_ns);
        break;
    case SCENARIO_SILENCE:
    case SCENARIO_MARK:
        break;
    }
}

/* Returns the period of a stimulus's actions, ns; 0 = it acts once. */
static int64_t period_ns(const struct scenario_stimulus *stimulus)
{
    return stimulus->every_s > 0.0                ? scenario_ns(stimulus->every_s)
           : stimulus->action == SCENARIO_VOLTAGE ? scenario_ns(REFRESH_S)
                                                  : 0;
}

/* Starts or continues a stimulus. Returns true if it started, because its label may start another
 * stimulus. */
static bool stimulus_step(struct scenario_stimuli *stimuli, size_t index,
                          const struct scenario_view *view, const struct bus_ports *ports,
                          struct scenario_clock *clock, int64_t time_ns)
{
    const struct scenario_stimulus *stimulus = &stimuli->scenario->stimulus[index];
    struct state *state = &stimuli->state[index];
    int64_t label = clock->label_ns[stimulus->after_index];
    bool begins = !state->begun && label >= 0 && time_ns >= label + scenario_ns(stimulus->at_s);

    if (state->left_out || state->over || (!state->begun && !begins)) {
        return false;
    }

    /* The first stimulus with a label sets it */
    if (begins) {
        state->begun = true;
        state->begin_ns = state->next_ns = time_ns;
        if (stimulus->label_index >= 0 && clock->label_ns[stimulus->label_index] < 0) {
            clock->label_ns[stimulus->label_index] = time_ns;
        }
    }

    /* End after the duration; act at the start, and again after each period */
    if (stimulus->for_s > 0.0 && time_ns >= state->begin_ns + scenario_ns(stimulus->for_s)) {
        /* End the effect of a stimulus */
        if (stimulus->action == SCENARIO_PUSH) {
            stimulus_push(&stimulus->push, view, false);
        } else if (stimulus->action == SCENARIO_FAULT) {
            stimulus_switch_fault(stimuli, index, view, false, time_ns);
        }
        stimuli->state[index].over = true;
    } else if (begins || (period_ns(stimulus) && time_ns >= state->next_ns)) {
        stimulus_act(stimuli, index, view, ports, time_ns);
        state->next_ns += period_ns(stimulus);
    }
    stimuli->silence |= stimulus->action == SCENARIO_SILENCE && !state->over;
    return begins;
}

void scenario_stimuli_step(struct scenario_stimuli *stimuli, const struct scenario_view *view,
                           const struct bus_ports *ports, struct scenario_clock *clock,
                           int64_t time_ns)
{
    bool again = true;

    /* A label of this tick may start a stimulus that is earlier in the list: repeat until none
     * starts */
    stimuli->silence = false;
    for (size_t round = 0; again && round <= stimuli->scenario->nstimulus; round++) {
        again = false;
        for (size_t i = 0; i < stimuli->scenario->nstimulus; i++) {
            again |= stimulus_step(stimuli, i, view, ports, clock, time_ns);
        }
    }
}

bool scenario_stimuli_silence(const struct scenario_stimuli *stimuli)
{
    return stimuli->silence;
}
