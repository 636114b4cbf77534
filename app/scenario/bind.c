/* SPDX-License-Identifier: Apache-2.0 */
/* Looks up the names of a scenario in its rig. */
#include "app/scenario/private.h"

enum { NAMES_MAX = 256 };

/* Finds the index of a bus. */
static enum error_code bind_bus(const struct rig *rig, const char *name,
                                const struct yaml_mark *mark, int *index, struct error *error)
{
    return yaml_find_name(YAML_NAMES(rig->bus, rig->nbus, name), "bus", name, mark, index, error);
}

/* Finds the index of a driven joint among the rig's axes. */
static enum error_code bind_axis(const struct rig *rig, const char *name,
                                 const struct yaml_mark *mark, int *index, struct error *error)
{
    return yaml_find_name(YAML_NAMES(rig->axis, rig->naxis, joint), "driven joint", name, mark,
                          index, error);
}

/* Finds the index of a body. The robot's bodies come first, then the free bodies. */
static enum error_code bind_body(const struct rig *rig, const char *name,
                                 const struct yaml_mark *mark, int *index, struct error *error)
{
    const char *names[NAMES_MAX];
    size_t count = 0;

    for (size_t i = 0; i < rig->robot->nbody && count < NAMES_MAX; i++) {
        names[count++] = rig->robot->body[i].name;
    }
    for (size_t i = 0; i < rig->nfree && count < NAMES_MAX; i++) {
        names[count++] = rig->free[i].name;
    }
    return yaml_find_name((struct yaml_names){names, count, sizeof *names, 0}, "body", name, mark,
                          index, error);
}

/* Finds the bus, joint or body of a stimulus. */
static enum error_code bind_stimulus(struct scenario_stimulus *stimulus, const struct rig *rig,
                                     struct error *error)
{
    const double tick_s = (double)rig->tick_ns * 1e-9;

    if (stimulus->every_s > 0.0 && stimulus->every_s <= tick_s * (1.0 - 1e-9)) {
        return yaml_error(error, &stimulus->mark,
                          "found every_s %g, expected the tick of %g s or more", stimulus->every_s,
                          tick_s);
    }
    switch (stimulus->action) {
    case SCENARIO_FRAME:
        if (bind_bus(rig, stimulus->frame.bus, &stimulus->frame.mark, &stimulus->frame.bus_index,
                     error)) {
            return ERROR_INPUT;
        }
        if (stimulus->frame.fd && !rig->bus[stimulus->frame.bus_index].fd) {
            return yaml_error(error, &stimulus->frame.mark,
                              "found an FD frame, but bus %s is classic", stimulus->frame.bus);
        }
        return ERROR_NONE;
    case SCENARIO_VOLTAGE:
        return bind_axis(rig, stimulus->voltage.joint, &stimulus->voltage.mark,
                         &stimulus->voltage.axis, error);
    case SCENARIO_MOTOR:
        /* -1 stands for all motors */
        stimulus->motor.axis = -1;
        return strcmp(stimulus->motor.joint, "all") == 0
                   ? ERROR_NONE
                   : bind_axis(rig, stimulus->motor.joint, &stimulus->motor.mark,
                               &stimulus->motor.axis, error);
    case SCENARIO_PUSH:
        return bind_body(rig, stimulus->push.body, &stimulus->push.mark, &stimulus->push.index,
                         error);
    default:
        return ERROR_NONE;
    }
}

/* Checks all fault lines: of the scenario, of its stimuli, and of its mutations. */
static enum error_code bind_faults(const struct scenario *scenario, const struct rig *rig,
                                   struct error *error)
{
    enum error_code code = ERROR_NONE;
    struct fault fault;

    for (size_t i = 0; !code && i < scenario->nfault; i++) {
        code = rig_check_fault(rig, &scenario->fault[i], &fault, error);
    }
    for (size_t i = 0; !code && i < scenario->nstimulus; i++) {
        const struct scenario_stimulus *stimulus = &scenario->stimulus[i];

        if (stimulus->action != SCENARIO_FAULT) {
            continue;
        }
        code = rig_check_fault(rig, &(struct yaml_name){stimulus->mark, stimulus->fault}, &fault,
                               error);
        /* The stimulus sets name and time, so the fault line must not have them */
        if (!code && (fault.timed || fault.name[0])) {
            code = yaml_error(error, &stimulus->mark,
                              "found fault \"%.140s\" with a %s, expected one without: %s",
                              stimulus->fault, fault.timed ? "time" : "name",
                              fault.timed ? "it is active from at_s of the stimulus on, for for_s"
                                          : "it is switched by the stimulus");
        }
    }
    for (size_t i = 0; !code && i < scenario->nmutation; i++) {
        const struct scenario_mutation *mutation = &scenario->mutation[i];

        if (mutation->fault) {
            code = rig_check_fault(rig, &(struct yaml_name){mutation->mark, mutation->fault},
                                   &fault, error);
        }
    }
    return code;
}

enum error_code scenario_bind(struct scenario *scenario, const struct rig *rig, struct error *error)
{
    enum error_code code = bind_faults(scenario, rig, error);

    if (code) {
        return code;
    }
    for (size_t i = 0; i < scenario->nstimulus; i++) {
        if (bind_stimulus(&scenario->stimulus[i], rig, error)) {
            return ERROR_INPUT;
        }
    }

    /* An expectation observes a bus or a signal. Some signals need a host that receives them */
    for (size_t i = 0; i < scenario->nexpectation; i++) {
        struct scenario_expectation *expectation = &scenario->expectation[i];
        struct scenario_signal signal;

        if (expectation->frame.bus &&
            bind_bus(rig, expectation->frame.bus, &expectation->frame.mark,
                     &expectation->frame.bus_index, error)) {
            return ERROR_INPUT;
        }
        if (expectation->signal &&
            scenario_signal_find(expectation->signal, rig, &expectation->mark, &signal, error)) {
            return ERROR_INPUT;
        }
        if (expectation->signal && signal.host && scenario->host == SCENARIO_HOST_NONE) {
            return yaml_error(error, &expectation->mark,
                              "found signal \"%.80s\", expected host: enabled in the scenario",
                              expectation->signal);
        }
    }
    return ERROR_NONE;
}
