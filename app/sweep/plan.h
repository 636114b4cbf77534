/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A plan is the fixed list of a sweep's cases: a file with one JSON object per line. The first line
 * describes the plan, each further line a case:
 *
 *     {"plan": 1, "name": "squat", "cases": 500, "program": "", "id": "..."}
 *     {"case": 1, "scenario": "../squat.yaml", "name": "squat", "values": {"mass_kg": "1.5"},
 *      "seed": 123, "hash": "..."}
 *
 * The hash of a case covers its scenario with the values, the files and meshes of rig and robot,
 * the seed, and the program under test. The id of a plan is a hash of all its cases. Paths of
 * scenarios are relative to the plan's folder. The folder PLAN.results has one file NUMBER.json per
 * result, which is complete or missing. The same sweep gives the same bytes. A case gives the same
 * result on every machine and on every run. Not RT-safe.
 */
#ifndef APP_SWEEP_PLAN_H
#define APP_SWEEP_PLAN_H

#include "app/scenario/jobs.h"
#include "app/sweep/sweep.h"

#include <limits.h>

enum {
    PLAN_HASH = 17, /* size of a hash as text, bytes, with the final 0 */
    PLAN_NAMES_MAX = 64,
    /* "plan" of a plan and "format_version" of a result, which defaults to 1; files of a newer
     * version are refused */
    PLAN_FORMAT_VERSION = 1,
};

struct plan_case {
    size_t number;           /* from 1 */
    const char *scenario;    /* path for opening the file */
    const char *file, *name; /* path as in the plan; name of the scenario */
    size_t nvalue;
    struct scenario_value *value;
    uint64_t seed;
    char hash[PLAN_HASH];
};

/* A plan, and the requested cases. */
struct plan {
    const char *path, *name, *description;
    const char *program; /* command of the program under test, NULL = none */
    size_t ncase;
    char id[PLAN_HASH];
    struct plan_case *list; /* the requested cases */
    size_t nlist;
};

/* Writes the plan of a sweep file. *ncase receives the number of cases. ERROR_INPUT has
 * file:line:column. */
enum error_code plan_write(const char *sweep, const char *path, size_t *ncase, struct error *error);

/* Loads the rig of a scenario, binds the scenario to it, and computes the rig's hash. Errors have
 * file:line:column. */
enum error_code plan_check_rig(struct scenario *scenario, uint64_t *hash, struct error *error);

/* Sets the error for a file in a newer format, and returns its code. */
enum error_code plan_newer(const char *path, struct error *error);

/* Reads a plan, and its cases from first to last; 0 and 0 request all cases. Memory is from arena.
 * ERROR_INPUT if the plan does not have these cases. */
enum error_code plan_read(const char *path, size_t first, size_t last, struct arena *arena,
                          struct plan *plan, struct error *error);

/* Computes the hash of a case. Its scenario must have been read with the case's values. */
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
    double margin;   /* least margin of all expectations, see struct scenario_verdict */
    double failed_s; /* virtual time of the first expectation that was not met, s; -1 = none */
    const char *message;
};

/* The words for the statuses. */
enum { PLAN_STATUSES = SCENARIO_BROKEN + 1 };
extern const char *const plan_status_word[PLAN_STATUSES];

/* Options for running cases. */
struct plan_run_options {
    size_t parallel;    /* number of parallel processes */
    const char *record; /* folder for recordings of failed cases; NULL = none */
    /* Called for each case in order, as soon as this case and all cases before it have ended. If
     * there is no result, result is NULL and why has the reason. ERROR_INPUT: the scenario or rig
     * differs from the plan. ERROR_SYSTEM: the process died or took too long. */
    void (*ended)(void *context, const struct plan_case *one, const struct plan_result *result,
                  const struct error *why);
    void *context;
};

/* Runs the requested cases and writes their results. Skips cases that have a result. Each case runs
 * in its own forked process, so its result does not depend on other cases. With record, runs all
 * cases, compares them with existing results, and records those that fail. Returns an error only if
 * this process fails; then some cases have not run. */
enum error_code plan_run_cases(const struct plan *plan, const struct plan_run_options *options,
                               struct error *error);

/* Writes the path of the folder with the results, PLAN.results. */
void plan_results_folder(const struct plan *plan, char path[PATH_MAX]);

/* Reads a result file. Memory is from arena. */
enum error_code plan_read_result(const char *path, struct arena *arena, struct plan_result *result,
                                 struct error *error);

/* Writes PLAN.xml (JUnit), PLAN.csv and PLAN.html. *failed receives the number of cases that did
 * not pass. */
enum error_code plan_merge(const char *path, size_t *ncase, size_t *failed, struct error *error);

/* plan_names lists the parameter names of all requested cases, each once, and returns their number.
 * plan_value returns the value of a parameter in a case, "" if the case does not have it. */
size_t plan_names(const struct plan *plan, const char *name[PLAN_NAMES_MAX]);
const char *plan_value(const struct plan_case *one, const char *name);

/* Writes the HTML page; plan_merge calls it. */
enum error_code plan_page_write(const struct plan *plan, const struct plan_result *result,
                                const char *path, struct error *error);

/* Computes the 95 % confidence interval of a share, if `passed` of `count` cases have passed
 * (Wilson 1927). */
void plan_wilson_interval(size_t passed, size_t count, double *low, double *high);

#endif
