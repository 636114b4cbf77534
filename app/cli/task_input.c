/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the options of the tasks sweep, excite and follow. */
#include "app/cli/task_input.h"

#include <string.h>

const struct word task_interpolation_words[] = {
    {"cubic", TRAJECTORY_CUBIC}, {"linear", TRAJECTORY_LINEAR}, {0}};

/* Refuses an option that the task does not have, and says which tasks have it. */
static enum error_code task_input_refuse(const char *option, const char *task, struct error *error)
{
    return error_set(error, ERROR_INPUT, "found %s with %s%s, expected it with %s only", option,
                     task ? "the task " : "no task", task ? task : "",
                     strcmp(option, "--joint") == 0    ? "sweep and excite"
                     : strcmp(option, "--report") == 0 ? "sweep and follow"
                                                       : "follow");
}

enum error_code task_input_read(const struct task_options *options, const char *task,
                                const struct rig *rig, struct arena *arena,
                                struct task_input *input, struct error *error)
{
    bool sweep = task && strcmp(task, "sweep") == 0, follow = task && strcmp(task, "follow") == 0;
    bool excite = task && strcmp(task, "excite") == 0;

    *input = (struct task_input){.joint = options->joint};
    if (options->joint && !sweep && !excite) {
        return task_input_refuse("--joint", task, error);
    }
    if (options->trajectory && !follow) {
        return task_input_refuse("--trajectory", task, error);
    }
    if (options->interpolation && !follow) {
        return task_input_refuse("--interpolation", task, error);
    }
    if (options->report && !sweep && !follow) {
        return task_input_refuse("--report", task, error);
    }
    return options->trajectory
               ? rig_read_trajectory(rig, options->trajectory,
                                     (enum trajectory_interpolation)options->interpolation, arena,
                                     &input->trajectory, error)
               : ERROR_NONE;
}
