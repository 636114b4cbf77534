/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A sweep runs scenarios with many values of their parameters. It is a YAML file:
 *
 *     name: squat_margins
 *     scenarios: [squat.yaml]
 *     seed: 1
 *     samples: 500
 *     sampling: latin_hypercube
 *     parameters:
 *       mass_kg: {uniform: [-1, 3]}
 *       friction: {normal: [0.6, 0.15], limits: [0.1, 1.2]}
 *       delay_s: {grid: [0, 0.002, 0.004]}
 *       rig: {words: [coman, walk-slope]}
 *
 * Cases are numbered from 1: by scenario, then by combination of grid values and words, then by
 * sample. Each parameter must be declared by every scenario (${NAME}). Parameters that the sweep
 * does not name keep their values. The same file gives the same cases on every machine: values are
 * drawn by portable functions and stored as text with nine digits. Not RT-safe.
 */
#ifndef APP_SWEEP_SWEEP_H
#define APP_SWEEP_SWEEP_H

#include "app/scenario/scenario.h"
#include "base/yaml.h"

enum { SWEEP_CASES_MAX = 100000 };

enum sweep_sampling { SWEEP_RANDOM, SWEEP_LATIN_HYPERCUBE };

struct sweep_parameter {
    struct yaml_mark mark;
    const char *name;
    double uniform[2]; /* lower and upper bound */
    double normal[2];  /* mean, standard deviation */
    double limits[2];  /* lower and upper limit of a normal distribution */
    size_t ngrid, nword;
    double *grid;
    struct yaml_name *word;
    char (*drawn)[SCENARIO_VALUE_MAX]; /* derived: the samples; NULL for a grid or words */
};

/* A sweep file, with its samples. */
struct sweep {
    struct yaml_mark mark;
    uint64_t hash;
    const char *name, *description, *program;
    size_t nscenario, nparameter;
    struct yaml_name *scenario;
    struct sweep_parameter *parameter;
    int64_t seed, samples;
    int sampling;
    size_t combinations; /* derived: number of combinations of grid values and words */
};

extern const struct yaml_schema sweep_file_schema;

/* Reads and checks a sweep, and draws its samples. Memory is from arena. Errors have
 * file:line:column. */
enum error_code sweep_read(const char *path, struct arena *arena, struct sweep *sweep,
                           struct error *error);

/* Writes the parameter values of a combination and a sample, both counted from 0. value has room
 * for sweep->nparameter values. Their texts are from arena. */
enum error_code sweep_values(const struct sweep *sweep, size_t combination, size_t sample,
                             struct arena *arena, struct scenario_value *value,
                             struct error *error);

/* Computes the quantile of the standard normal distribution for the probability p, 0 < p < 1. */
double sweep_normal_quantile(double p);

#endif
