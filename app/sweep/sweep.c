/* SPDX-License-Identifier: Apache-2.0 */
/* Reads sweeps, and draws samples of their parameters. */
#include "app/sweep/sweep.h"

#include "base/portable_math.h"
#include "base/random.h"
#include "base/text.h"

#include <math.h>

/* Default limits of a normal distribution, in standard deviations from the mean. */
#define SWEEP_NORMAL_END 6.0

/* ---- the form of a file ---- */

static const struct word sampling_words[] = {
    {"random", SWEEP_RANDOM}, {"latin_hypercube", SWEEP_LATIN_HYPERCUBE}, {NULL, 0}};

static const struct yaml_field parameter_fields[] = {
    {"grid", YAML_REAL_LIST, false, offsetof(struct sweep_parameter, grid),
     .count_offset = offsetof(struct sweep_parameter, ngrid)},
    {"words", YAML_NAME_LIST, false, offsetof(struct sweep_parameter, word),
     .count_offset = offsetof(struct sweep_parameter, nword)},
    YAML_NUMBERS("uniform", false, sweep_parameter, uniform, 2, -1e9, 1e9),
    YAML_NUMBERS("normal", false, sweep_parameter, normal, 2, -1e9, 1e9),
    YAML_NUMBERS("limits", false, sweep_parameter, limits, 2, -1e10, 1e10),
};
YAML_TABLE(parameter, "a parameter", sweep_parameter,
           .name_offset = offsetof(struct sweep_parameter, name));

static const struct yaml_field sweep_fields[] = {
    YAML_TEXT("name", true, sweep, name, 1, 63),
    YAML_TEXT("description", false, sweep, description, 1, 1000),
    {"scenarios", YAML_NAME_LIST, true, offsetof(struct sweep, scenario),
     .count_offset = offsetof(struct sweep, nscenario)},
    YAML_TEXT("program", false, sweep, program, 1, 1000),
    {"seed", YAML_INT, false, offsetof(struct sweep, seed), .min = 0, .max = 9e15},
    {"samples", YAML_INT, false, offsetof(struct sweep, samples), .min = 1, .max = SWEEP_CASES_MAX},
    {"sampling", YAML_ENUM, false, offsetof(struct sweep, sampling), .names = sampling_words},
    YAML_ENTRIES("parameters", YAML_DICT, false, sweep, parameter, nparameter, parameter_schema),
};
static const struct sweep sweep_defaults = {.samples = 1, .sampling = SWEEP_LATIN_HYPERCUBE};
const struct yaml_schema sweep_file_schema = YAML_SCHEMA(
    "the sweep", struct sweep, sweep_fields, .hash_offset = offsetof(struct sweep, hash),
    .defaults = &sweep_defaults, .format_version = 1);

/* ---- checks ---- */

/* Checks the bounds of a distribution, and sets default limits of a normal distribution. */
static enum error_code check_distribution(struct sweep_parameter *parameter, struct error *error)
{
    double *limits = parameter->limits;

    if (yaml_has(&parameter->mark, "uniform") && !(parameter->uniform[0] < parameter->uniform[1])) {
        return yaml_error(error, &parameter->mark,
                          "found uniform [%g, %g], expected the lower end first",
                          parameter->uniform[0], parameter->uniform[1]);
    }
    if (!yaml_has(&parameter->mark, "normal")) {
        return ERROR_NONE;
    }
    if (!(parameter->normal[1] > 0.0)) {
        return yaml_error(error, &parameter->mark,
                          "found a standard deviation of %g, expected more than 0",
                          parameter->normal[1]);
    }
    if (!yaml_has(&parameter->mark, "limits")) {
        limits[0] = parameter->normal[0] - SWEEP_NORMAL_END * parameter->normal[1];
        limits[1] = parameter->normal[0] + SWEEP_NORMAL_END * parameter->normal[1];
    }

    /* Refuse limits far out in a tail, where the probability is 0 */
    if (!(limits[0] < limits[1]) ||
        limits[0] > parameter->normal[0] + SWEEP_NORMAL_END * parameter->normal[1] ||
        limits[1] < parameter->normal[0] - SWEEP_NORMAL_END * parameter->normal[1]) {
        return yaml_error(error, &parameter->mark,
                          "found limits [%g, %g], expected the lower one first, and both sides of "
                          "them within six standard deviations of the mean",
                          limits[0], limits[1]);
    }
    return ERROR_NONE;
}

/* Checks that a parameter has a valid name and exactly one kind of values. */
static enum error_code check_parameter(struct sweep_parameter *parameter, struct error *error)
{
    int forms = (parameter->ngrid > 0) + (parameter->nword > 0) +
                yaml_has(&parameter->mark, "uniform") + yaml_has(&parameter->mark, "normal");

    if (!text_is_name(parameter->name) || forms != 1 ||
        (yaml_has(&parameter->mark, "limits") && !yaml_has(&parameter->mark, "normal"))) {
        return yaml_error(error, &parameter->mark,
                          "found parameter \"%.40s\" of no known form, expected a plain name and "
                          "one of grid, words, uniform and normal, the last with limits or without",
                          parameter->name);
    }
    for (size_t i = 0; i < parameter->nword; i++) {
        if (!text_is_name(parameter->word[i].name)) {
            return yaml_error(error, &parameter->word[i].mark,
                              "found word \"%.60s\", expected letters, digits and _ - . only",
                              parameter->word[i].name);
        }
    }
    return check_distribution(parameter, error);
}

/* Checks a sweep, and counts the combinations of grid values and words. */
static enum error_code check_sweep(struct sweep *sweep, struct error *error)
{
    sweep->combinations = 1;
    if (!text_is_name(sweep->name) || !sweep->nscenario) {
        return yaml_error(error, &sweep->mark,
                          "found name \"%.63s\" and %zu scenarios, expected letters, digits, _ - "
                          "and . only, and at least one scenario",
                          sweep->name, sweep->nscenario);
    }
    if (sweep->nparameter > SCENARIO_PARAMETERS_MAX) {
        return yaml_error(error, &sweep->mark, "found %zu parameters, expected at most %d",
                          sweep->nparameter, SCENARIO_PARAMETERS_MAX);
    }
    for (size_t i = 0; i < sweep->nparameter; i++) {
        struct sweep_parameter *parameter = &sweep->parameter[i];
        size_t values = parameter->ngrid + parameter->nword;

        if (check_parameter(parameter, error)) {
            return ERROR_INPUT;
        }
        values = values ? values : 1;

        /* Compare before multiplying, to avoid an overflow */
        if (values > SWEEP_CASES_MAX / (sweep->combinations * (size_t)sweep->samples)) {
            return yaml_error(error, &parameter->mark, "found more than %d cases, expected fewer",
                              SWEEP_CASES_MAX);
        }
        sweep->combinations *= values;
    }
    return ERROR_NONE;
}

/* ---- drawing ---- */

/* Computes the distribution function of the standard normal variable for |x| <= 8, to 1e-15, by a
 * series of positive terms (Abramowitz and Stegun, 26.2.11). */
static double normal_probability(double x)
{
    double term = fabs(x), sum = term;

    for (int k = 3; term > sum * 1e-17; k += 2) {
        term *= x * x / k;
        sum += term;
    }
    sum *= portable_exp(-0.5 * x * x) * 0.3989422804014327;
    return x < 0.0 ? 0.5 - sum : 0.5 + sum;
}

double sweep_normal_quantile(double p)
{
    double low = -8.0, high = 8.0;

    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);

        if (normal_probability(middle) < p) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}

/* Computes the quantile of a parameter's distribution: the value below which a share u of the
 * samples lies. A normal distribution is truncated to its limits. */
static double parameter_quantile(const struct sweep_parameter *parameter, double u)
{
    const double *normal = parameter->normal, *limits = parameter->limits;
    double below, above, value;

    if (yaml_has(&parameter->mark, "uniform")) {
        return parameter->uniform[0] + u * (parameter->uniform[1] - parameter->uniform[0]);
    }
    below = normal_probability(fmax(-8.0, (limits[0] - normal[0]) / normal[1]));
    above = normal_probability(fmin(8.0, (limits[1] - normal[0]) / normal[1]));
    value = normal[0] + normal[1] * sweep_normal_quantile(below + u * (above - below));
    return fmin(fmax(value, limits[0]), limits[1]);
}

/* Draws the samples of a parameter. Each parameter has its own random stream, so that a new
 * parameter in the file does not change the samples of others. */
static enum error_code draw_parameter(const struct sweep *sweep, struct sweep_parameter *parameter,
                                      struct arena *arena, struct error *error)
{
    struct random_stream stream = random_named((uint64_t)sweep->seed, parameter->name);
    size_t count = (size_t)sweep->samples;
    size_t *stratum = arena_alloc(arena, count, sizeof *stratum);

    parameter->drawn = arena_alloc(arena, count, sizeof *parameter->drawn);
    if (!stratum || !parameter->drawn) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu samples", count);
    }

    /* Latin hypercube: one sample in each of `count` equally likely strata, in random order (McKay,
     * Beckman, Conover 1979; shuffled after Fisher and Yates) */
    for (size_t i = 0; i < count; i++) {
        size_t k = (size_t)(random_uniform(&stream) * (double)(i + 1));

        stratum[i] = stratum[k];
        stratum[k] = i;
    }
    for (size_t i = 0; i < count; i++) {
        double u = random_uniform(&stream);

        if (sweep->sampling == SWEEP_LATIN_HYPERCUBE) {
            u = ((double)stratum[i] + u) / (double)count;
        }
        snprintf(parameter->drawn[i], sizeof parameter->drawn[i], "%.9g",
                 parameter_quantile(parameter, u));
    }
    return ERROR_NONE;
}

enum error_code sweep_read(const char *path, struct arena *arena, struct sweep *sweep,
                           struct error *error)
{
    enum error_code code = yaml_read_file(path, &sweep_file_schema, arena, sweep, error);

    code = code ? code : check_sweep(sweep, error);
    for (size_t i = 0; i < sweep->nparameter && !code; i++) {
        if (!sweep->parameter[i].ngrid && !sweep->parameter[i].nword) {
            code = draw_parameter(sweep, &sweep->parameter[i], arena, error);
        }
    }
    return code;
}

enum error_code sweep_values(const struct sweep *sweep, size_t combination, size_t sample,
                             struct arena *arena, struct scenario_value *value, struct error *error)
{
    /* The digits of the combination's number select the values; the last parameter varies
     * fastest */
    for (size_t i = sweep->nparameter; i-- > 0;) {
        const struct sweep_parameter *parameter = &sweep->parameter[i];
        size_t values = parameter->ngrid + parameter->nword;
        char text[SCENARIO_VALUE_MAX];

        if (parameter->drawn) {
            snprintf(text, sizeof text, "%s", parameter->drawn[sample]);
        } else if (parameter->nword) {
            snprintf(text, sizeof text, "%s", parameter->word[combination % values].name);
        } else {
            snprintf(text, sizeof text, "%.9g", parameter->grid[combination % values]);
        }
        combination /= values ? values : 1;
        value[i] = (struct scenario_value){parameter->name, arena_strdup(arena, text)};
        if (!value[i].text) {
            return error_set(error, ERROR_MEMORY, "no memory left for the values of a case");
        }
    }
    return ERROR_NONE;
}
