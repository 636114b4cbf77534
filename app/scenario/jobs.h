/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs scenarios in parallel, each in its own process, and judges them. Each run has one result,
 * which is written to the terminal and as JUnit XML. Not RT-safe.
 */
#ifndef APP_SCENARIO_JOBS_H
#define APP_SCENARIO_JOBS_H

#include "app/scenario/scenario.h"

#include <limits.h>
#include <time.h>

enum { RESULT_NAME = 512, RESULT_MESSAGE = 2048 };

/* One planned run and its outcome. */
struct scenario_job {
    struct scenario *scenario;
    int mutation;    /* index of a mutation, -1 = none */
    bool seed_given; /* false: uses the seed of the scenario or the rig */
    uint64_t seed;
    const char *scratch;   /* folder of the scenario's program; NULL = none */
    char record[PATH_MAX]; /* directory for the recorded repeat of a failed run; "" = none */
    struct scenario_outcome outcome;
    double seconds; /* wall-clock time of the process */
    bool ended;     /* the outcome is final */
};

struct scenario_jobs_options {
    size_t parallel;     /* number of processes at a time */
    bool to_the_end;     /* see struct scenario_options */
    const char *program; /* command of scenarios with host: program; NULL = none */
    /* Called for each job in array order, as soon as this job and all earlier jobs have ended */
    void (*ended)(void *context, const struct scenario_job *job);
    void *context;
};

/* Runs all jobs. Sets outcome.ran = false if a process crashes, exceeds its scenario's cpu_limit_s,
 * or uses no processor time for a minute. No verdict depends on the load of the machine. Returns
 * ERROR_SYSTEM if it cannot create a process. */
enum error_code scenario_jobs_run(struct scenario_job *job, size_t count,
                                  const struct scenario_jobs_options *options, struct error *error);

enum scenario_status { SCENARIO_PASSED, SCENARIO_FAILED, SCENARIO_BROKEN /* no run */ };

/* The verdict on a run. */
struct scenario_result {
    const struct scenario *scenario;
    char name[RESULT_NAME]; /* name of the scenario, with parameters and mutation */
    enum scenario_status status;
    char message[RESULT_MESSAGE]; /* one line per reason for the status */
    const char *record;           /* directory with the recording and the plots; "" = none */
    bool ran;                     /* there was a run; seed and hash are valid */
    uint64_t seed, state_hash;
    double seconds;
};

/* Judges a job. A run without a mutation passes if all expectations are met. A run with a mutation
 * passes if the expectations named by the mutation fail. */
void scenario_judge(const struct scenario_job *job, struct scenario_result *result);

/* Judges `count` jobs, the mutations of one scenario in one case. Passes if each expectation fails
 * in at least one of them. */
void scenario_judge_mutations(const struct scenario_job *job, size_t count,
                              struct scenario_result *result);

/* Writes one testsuite per scenario, and one testcase per result. begun: start time of the runs; 0
 * omits time and host, so that the file is the same on every machine. */
enum error_code scenario_junit_write(const char *path, const struct scenario_result *result,
                                     size_t count, time_t begun, struct error *error);

#endif
