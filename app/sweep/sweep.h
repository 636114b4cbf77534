/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sweeps: scenarios run over many values of their parameters. A sweep is a YAML file
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
 * whose cases are numbered from 1: by scenario, then every combination of grid and words, then the
 * samples of what is drawn. A parameter is one that every scenario declares (${NAME}); those that
 * the sweep does not name keep their values. The same file gives the same cases everywhere: numbers
 * are drawn by portable functions and kept as text of nine digits. Not RT-safe.
 */
#ifndef APP_SWEEP_SWEEP_H
#define APP_SWEEP_SWEEP_H

#include "app/scenario/scenario.h"
#include "base/yaml.h"

enum { SWEEP_CASES_MAX = 100000 };

enum sweep_sampling { SWEEP_RANDOM, SWEEP_LATIN_HYPERCUBE };

/* A parameter of a sweep. */
struct sweep_parameter {
    struct yaml_mark mark;
    const char *name;
    double uniform[2]; /* from, to */
    double normal[2];  /* mean, standard deviation */
    double limits[2];  /* where a normal distribution is cut off */
    size_t ngrid, nword;
    double *grid;
    struct yaml_name *word;
    char (*drawn)[SCENARIO_VALUE_MAX]; /* derived: samples of them; NULL for a grid or words */
};

/* A sweep as read, with its samples. */
struct sweep {
    struct yaml_mark mark;
    uint64_t hash;
    const char *name, *description, *program;
    size_t nscenario, nparameter;
    struct yaml_name *scenario;
    struct sweep_parameter *parameter;
    int64_t seed, samples;
    int sampling;
    size_t combinations; /* derived: of the values of grids and words */
};

extern const struct yaml_schema sweep_file_schema;

/* Reads and checks a sweep, and draws its samples. Everything lives in arena. Errors carry
 * file:line:column. */
enum error_code sweep_read(const char *path, struct arena *arena, struct sweep *sweep,
                           struct error *error);

/* Writes the values of a combination and a sample, both from 0; value has room for
 * sweep->nparameter. Texts live in arena. */
enum error_code sweep_values(const struct sweep *sweep, size_t combination, size_t sample,
                             struct arena *arena, struct scenario_value *value,
                             struct error *error);

/* Computes the quantile of the standard normal distribution: the number below which it lies with
 * the probability p, 0 < p < 1. */
double sweep_normal_quantile(double p);

#endif
