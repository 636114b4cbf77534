/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans: the frozen list of a sweep's cases, a file of JSON, one object a line. The first line
 * says what the plan is, each other one a case:
 *
 *     {"plan": 1, "name": "squat", "cases": 500, "program": "", "id": "..."}
 *     {"case": 1, "scenario": "../squat.yaml", "name": "squat", "values": {"mass_kg": "1.5"},
 *      "seed": 123, "hash": "..."}
 *
 * A case's hash is that of its scenario with the values put in, of the rig's and robot's files and
 * meshes, of its seed and the program under test; the plan's id that of all its cases. Scenarios
 * are named relative to the folder of the plan. Results stand in the folder PLAN.results, a file
 * NUMBER.json each, complete or not there. The same sweep gives the same bytes, and so do the
 * results of a case, wherever and however often it runs. Not RT-safe.
 */
#ifndef APP_SWEEP_PLAN_H
#define APP_SWEEP_PLAN_H

#include "app/scenario/jobs.h"
#include "app/sweep/sweep.h"

#include <limits.h>

enum {
    PLAN_HASH = 17, /* bytes of a hash as text, with the end */
    PLAN_NAMES_MAX = 64,
    /* "plan" of a plan, "format_version" of a result, where it is 1 when there is none; files of
     * a newer one are refused */
    PLAN_FORMAT_VERSION = 1,
};

/* A case of a plan. */
struct plan_case {
    size_t number;           /* from 1 */
    const char *scenario;    /* path by which the program finds it */
    const char *file, *name; /* path as in the plan; name of the scenario */
    size_t nvalue;
    struct scenario_value *value;
    uint64_t seed;
    char hash[PLAN_HASH];
};

/* A plan, with the cases that were read. */
struct plan {
    const char *path, *name, *description;
    const char *program; /* command of the program under test, NULL = none */
    size_t ncase;
    char id[PLAN_HASH];
    struct plan_case *list; /* the cases that were asked for */
    size_t nlist;
};

/* Makes the plan of a sweep's file. ncase receives the number of its cases. ERROR_INPUT carries
 * file:line:column. */
enum error_code plan_write(const char *sweep, const char *path, size_t *ncase, struct error *error);

/* Loads the rig of a scenario, binds the scenario to it, and returns the rig's hash. Errors carry
 * file:line:column. */
enum error_code plan_check_rig(struct scenario *scenario, uint64_t *hash, struct error *error);

/* Reports a file in a newer format. */
enum error_code plan_newer(const char *path, struct error *error);

/* Reads a plan with the cases from first to last; 0 and 0 stand for all. Everything lives in arena.
 * ERROR_INPUT when it has no such cases. */
enum error_code plan_read(const char *path, size_t first, size_t last, struct arena *arena,
                          struct plan *plan, struct error *error);

/* Computes the hash of a case whose scenario was read with its values. */
void plan_hash_case(const struct scenario *scenario, uint64_t rig_hash, uint64_t seed,
                    const char *program, char hash[PLAN_HASH]);

/* The result of a case. */
struct plan_result {
    size_t number;
    char plan[PLAN_HASH], hash[PLAN_HASH], binary[64];
    enum scenario_status status;
    uint64_t state_hash;
    double virtual_s;
    bool has_margin;
    double margin;   /* least margin of its expectations, see struct scenario_verdict */
    double failed_s; /* virtual time at which the first expectation was not met, s; -1 = none */
    const char *message;
};

/* Words of the statuses. */
enum { PLAN_STATUSES = SCENARIO_BROKEN + 1 };
extern const char *const plan_status_word[PLAN_STATUSES];

/* How cases are run. */
struct plan_run_options {
    size_t parallel;    /* processes at a time */
    const char *record; /* folder for recordings of failures; NULL = none */
    /* Called for each case, in their order, as soon as it and all before it have ended. result is
     * NULL when there is none; then why says the reason: ERROR_INPUT when the scenario or the rig
     * is not that of the plan, ERROR_SYSTEM when the process died or took too long. */
    void (*ended)(void *context, const struct plan_case *one, const struct plan_result *result,
                  const struct error *why);
    void *context;
};

/* Runs the cases that were read and writes their results, except for those that have one already.
 * Each runs in a process of its own, forked from this one, and gives what it gives alone. With
 * record all of them run, must give the result that is there, and leave a recording when they fail.
 * An error is one of this process: then some cases have not run. */
enum error_code plan_run_cases(const struct plan *plan, const struct plan_run_options *options,
                               struct error *error);

/* Writes the path of the folder with the results, PLAN.results. */
void plan_results_folder(const struct plan *plan, char path[PATH_MAX]);

/* Reads the file of a result. Everything lives in arena. */
enum error_code plan_read_result(const char *path, struct arena *arena, struct plan_result *result,
                                 struct error *error);

/* Writes PLAN.xml (JUnit), PLAN.csv and PLAN.html. failed receives the number of cases that did not
 * pass. */
enum error_code plan_merge(const char *path, size_t *ncase, size_t *failed, struct error *error);

/* List the parameters' names of all cases that were read, each once, and return their number;
 * return the value of one in a case, "" when it has none. */
size_t plan_names(const struct plan *plan, const char *name[PLAN_NAMES_MAX]);
const char *plan_value(const struct plan_case *one, const char *name);

/* Writes the page, a part of plan_merge. */
enum error_code plan_page_write(const struct plan *plan, const struct plan_result *result,
                                const char *path, struct error *error);

/* Computes the bounds of a share of which passed of count were seen, with 95 % confidence (Wilson
 * 1927). */
void plan_wilson_interval(size_t passed, size_t count, double *low, double *high);

#endif
