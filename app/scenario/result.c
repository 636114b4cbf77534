/* SPDX-License-Identifier: Apache-2.0 */
/* Judges the outcomes of runs. */
#include "app/scenario/jobs.h"

#include <string.h>

/* Composes the name of a result: scenario, values of the parameters, a text and a name. */
static void name_case(const struct scenario *scenario, const char *text, const char *name,
                      struct scenario_result *result)
{
    snprintf(result->name, sizeof result->name, "%s%s%s%s%s%s", scenario->name,
             scenario->values[0] ? " [" : "", scenario->values, scenario->values[0] ? "]" : "",
             text, name);
}

/* Sets the status of a result and adds a line to its message. */
static void result_add_message(struct scenario_result *result, enum scenario_status status,
                               const char *what, const char *text)
{
    size_t used = strlen(result->message);

    result->status = status;
    snprintf(result->message + used, sizeof result->message - used, "%s%s%s%s", used ? "\n" : "",
             what, what[0] ? ": " : "", text);
}

void scenario_judge(const struct scenario_job *job, struct scenario_result *result)
{
    const struct scenario *scenario = job->scenario;
    const struct scenario_outcome *outcome = &job->outcome;
    const char *missed;
    size_t unjudged = 0;
    char text[96];

    *result = (struct scenario_result){.scenario = scenario,
                                       .record = "",
                                       .ran = outcome->ran,
                                       .seed = outcome->seed,
                                       .state_hash = outcome->state_hash,
                                       .seconds = job->seconds};
    name_case(scenario, job->mutation >= 0 ? ", mutation " : "",
              job->mutation >= 0 ? scenario->mutation[job->mutation].name : "", result);

    /* Three cases: no verdicts, a mutation that must fail, and a run that must pass */
    if (!outcome->ran) {
        result_add_message(result, SCENARIO_BROKEN, "", outcome->text);
        return;
    }
    if (job->mutation >= 0) {
        if (!scenario_flipped(scenario, (size_t)job->mutation, outcome, &missed)) {
            result_add_message(result, SCENARIO_FAILED, missed,
                               missed[0] ? "was met in spite of it"
                                         : "every expectation was met in spite of it");
        }
        return;
    }
    for (size_t i = 0; i < outcome->nverdict; i++) {
        if (!outcome->verdict[i].judged) {
            unjudged++;
        } else if (!outcome->verdict[i].met) {
            result_add_message(result, SCENARIO_FAILED, scenario->expectation[i].name,
                               outcome->verdict[i].text);
            result->record = job->record;
        }
    }
    if (outcome->unrecorded[0]) {
        result_add_message(result, result->status, "not recorded", outcome->unrecorded);
        result->record = "";
    }
    if (unjudged) {
        snprintf(text, sizeof text,
                 "the run ended there: %zu of %zu expectations not judged (--to-the-end)", unjudged,
                 outcome->nverdict);
        result_add_message(result, SCENARIO_FAILED, "", text);
    }
}

void scenario_judge_mutations(const struct scenario_job *job, size_t count,
                              struct scenario_result *result)
{
    const struct scenario *scenario = job->scenario;

    *result = (struct scenario_result){.scenario = scenario, .record = ""};
    name_case(scenario, ", every expectation can fail", "", result);

    /* Each expectation must fail in at least one mutation */
    for (size_t i = 0; i < scenario->nexpectation; i++) {
        bool fails = false;

        for (size_t k = 0; k < count; k++) {
            fails = fails ||
                    (job[k].mutation >= 0 && job[k].outcome.ran && !job[k].outcome.verdict[i].met);
        }
        if (!fails) {
            result_add_message(result, SCENARIO_FAILED, scenario->expectation[i].name,
                               "no mutation of the scenario makes it fail");
        }
    }
}
