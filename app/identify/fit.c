/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Least-squares fit to recordings. A parameter p is expressed by an unbounded variable u: p = lower
 * + (upper - lower) (1 + sin u) / 2. If both bounds are positive and at least a decade apart, the
 * formula applies to the logarithm of p.
 */

#include "app/identify/identify.h"

#include <cminpack.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Step in u for finite differences; largest |sin u| of a start value; tolerance of the fit, as
 * relative change of the sum of squares or of the variables. */
#define DIFFERENCE 1e-3
#define NEAREST 0.98
#define TOLERANCE 1e-4

/* Feedback gain from position errors to commands in the first round of a fit of several joints, in
 * units of the largest command per rad. Without this feedback, distant start values end in local
 * minima, where gravity turns a joint over. */
#define GUIDE 10.0

/* The Jacobian is updated, not computed again, while the RMS error of its prediction is at most
 * this share of the RMS change of the residuals. */
#define MISSED 0.3

/* A parameter with a larger |sin u| is at its bound. */
#define AT_BOUND 0.9995

enum { THREADS_MAX = 8, ROUNDS = 2 };

const struct word fit_verdict_words[] = {{"known", FIT_KNOWN},
                                         {"rough", FIT_ROUGH},
                                         {"known only with another number", FIT_PAIRED},
                                         {"at its bound", FIT_BOUND},
                                         {"not told by these recordings", FIT_NOT_TOLD},
                                         {"interim", FIT_INTERIM},
                                         {NULL, 0}};

/* A running fit. */
struct fit {
    const struct fit_problem *problem;
    /* First residual of each recording: one signal after the other */
    size_t first[IDENTIFY_RECORDINGS_MAX];
    size_t nrow;       /* number of residuals of recordings */
    size_t m;          /* number of residuals, priors included */
    enum signal judge; /* first measured signal; residuals have its unit */
    double guide;      /* feedback gain of all simulations (GUIDE) */
    double level;      /* error of one independent measurement, which scales the priors */
    double weight[SIGNALS];
    double *jacobian;             /* the latest Jacobian, in column order; m rows */
    double *last;                 /* residuals at the variables `at` */
    double at[IDENTIFY_FREE_MAX]; /* variables of the latest Jacobian */
    bool known;                   /* jacobian, last and at are valid */
    /* Sets of variables that are simulated in parallel. A job is one recording with one set. */
    const double *u; /* nset sets of nfree variables */
    double *out;     /* nset sets of m residuals */
    size_t nset;
    atomic_size_t job;
    atomic_bool failed;
    atomic_int simulations;
    int step;
    struct error *error;
    enum error_code code;
};

/* ---- variables ---- */

static bool is_logarithmic(const struct bench_free *free)
{
    return free->lower > 0.0 && free->upper > 10.0 * free->lower;
}

static double fit_value(const struct bench_free *free, double u)
{
    const double share = 0.5 * (1.0 + sin(u));

    return is_logarithmic(free) ? free->lower * pow(free->upper / free->lower, share)
                                : free->lower + (free->upper - free->lower) * share;
}

static double fit_variable(const struct bench_free *free, double value)
{
    const double share = is_logarithmic(free)
                             ? log(value / free->lower) / log(free->upper / free->lower)
                             : (value - free->lower) / (free->upper - free->lower);

    return asin(fmax(-NEAREST, fmin(NEAREST, 2.0 * share - 1.0)));
}

/* Returns dp/du. */
static double fit_slope(const struct bench_free *free, double u)
{
    const double half = 0.5 * cos(u);

    return is_logarithmic(free) ? fit_value(free, u) * log(free->upper / free->lower) * half
                                : (free->upper - free->lower) * half;
}

static void set_variables(const struct fit_problem *problem, const double *u,
                          struct trial_robot *trial)
{
    int parameter[IDENTIFY_FREE_MAX];
    double value[IDENTIFY_FREE_MAX];

    size_t count = 0;

    *trial = problem->bench->trial;
    for (size_t i = 0; i < problem->nfree; i++) {
        const struct bench_free *free = &problem->free[i];

        if (free->group) {
            parameter_set_group(trial, &(struct group_number){.group = free->group,
                                                              .parameter = free->parameter,
                                                              .value = fit_value(free, u[i])});
        } else {
            parameter[count] = free->parameter;
            value[count++] = fit_value(free, u[i]);
        }
    }
    parameter_set(trial, parameter, value, count);
}

/* ---- residuals ---- */

/* Returns the square root of the loss of an error. It is about equal to an error far below robust.
 * Far above robust it grows with the square root of the error. */
static double soften_error(double error, double robust)
{
    const double z = robust > 0.0 ? error / robust : 0.0;

    return error * sqrt(2.0 / (1.0 + sqrt(1.0 + z * z)));
}

/* Computes the residuals of the recordings of one file with one set of variables. */
static enum error_code residuals_of(struct fit *fit, size_t recording, const double *u, double *out,
                                    struct error *error)
{
    const struct identify_bench *bench = fit->problem->bench;
    const struct recording *r = &bench->recording[recording];
    const size_t njoint = bench->trial.njoint;
    struct simulated simulated[TRIAL_JOINTS_MAX] = {{.diverged = false}};
    struct trial_robot trial;
    enum error_code code;

    for (size_t k = 0; k < njoint; k++) {
        for (size_t s = 0; s < SIGNALS; s++) {
            simulated[k].signal[s] = r[k].signal[s] ? out : NULL;
            out += r[k].signal[s] ? r[k].count : 0;
        }
    }
    set_variables(fit->problem, u, &trial);
    trial.guide = fit->guide;
    code = simulate_recording(bench->rig, &trial, &bench->bench.law, r, simulated, error);
    for (size_t k = 0; k < njoint * SIGNALS && !code; k++) {
        const struct recording *of = &r[k / SIGNALS];
        const size_t s = k % SIGNALS;
        double *value = simulated[k / SIGNALS].signal[s];

        for (size_t i = 0; i < of->count && value; i++) {
            value[i] = fit->weight[s] * (value[i] - of->signal[s][i]);
            value[i] = s == SIGNAL_POSITION || s == SIGNAL_LOSS
                           ? soften_error(value[i], bench->bench.robust_rad)
                           : value[i];
        }
    }
    atomic_fetch_add(&fit->simulations, 1);
    return code;
}

/* Computes the residuals of the priors. Each prior weighs as one independent measurement. */
static void prior_residuals(const struct fit *fit, const double *u, double *out)
{
    size_t row = fit->nrow;

    for (size_t i = 0; i < fit->problem->nfree; i++) {
        const struct bench_free *free = &fit->problem->free[i];

        if (free->sigma > 0.0) {
            out[row++] = fit->level * (fit_value(free, u[i]) - free->expected) / free->sigma;
        }
    }
}

/* Returns whether the fit uses a recording. */
static bool is_used(const struct fit_problem *problem, size_t recording)
{
    const struct recording *r = &problem->bench->recording[recording];

    return !r->judge && !(problem->left_out && recording_is_with(r, problem->left_out));
}

static void *run_jobs(void *context)
{
    struct fit *fit = context;
    const size_t n = fit->problem->bench->nrecording;
    size_t job;

    while ((job = atomic_fetch_add(&fit->job, 1)) < n * fit->nset) {
        const size_t set = job / n, recording = job % n;
        struct error error;
        enum error_code code;

        if (!is_used(fit->problem, recording) ||
            fit->problem->bench->recording[recording].place > 0) {
            continue;
        }
        code = residuals_of(fit, recording, fit->u + set * fit->problem->nfree,
                            fit->out + set * fit->m + fit->first[recording], &error);
        if (code && !atomic_exchange(&fit->failed, true)) {
            *fit->error = error;
            fit->code = code;
        }
    }
    return NULL;
}

/* Computes the residuals of several sets of variables on all processors. */
static void run_batch(struct fit *fit, const double *u, size_t nset, double *out)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    pthread_t thread[THREADS_MAX];
    int count = 0;

    fit->u = u;
    fit->nset = nset;
    fit->out = out;
    atomic_store(&fit->job, 0);
    while (count + 1 < processors && count + 1 < THREADS_MAX &&
           !pthread_create(&thread[count], NULL, run_jobs, fit)) {
        count++;
    }
    run_jobs(fit);
    while (count > 0) {
        pthread_join(thread[--count], NULL);
    }
}

/* ---- the solver's view ---- */

/* Computes the root mean square of the weighted residuals of each signal; 0 = not measured. */
static void find_rms(const struct fit *fit, const double *residual, double rms[SIGNALS])
{
    double count[SIGNALS] = {0.0};

    memset(rms, 0, SIGNALS * sizeof *rms);
    for (size_t r = 0; r < fit->problem->bench->nrecording; r++) {
        const struct recording *recording = &fit->problem->bench->recording[r];
        const double *x = residual + fit->first[r];

        for (size_t s = 0; s < SIGNALS && is_used(fit->problem, r); s++) {
            for (size_t i = 0; i < recording->count && recording->signal[s]; i++, x++) {
                rms[s] += *x * *x;
                count[s] += 1.0;
            }
        }
    }
    for (size_t s = 0; s < SIGNALS; s++) {
        rms[s] = count[s] > 0.0 ? sqrt(rms[s] / count[s]) : 0.0;
    }
}

/* Updates the Jacobian from the residuals at new variables (Broyden's method). Returns whether it
 * predicted these residuals well. If not, compute the Jacobian again. */
static bool update_jacobian(struct fit *fit, size_t n, const double *u, const double *residual)
{
    double step[IDENTIFY_FREE_MAX], square = 0.0, missed = 0.0, change = 0.0;

    for (size_t i = 0; i < n; i++) {
        step[i] = u[i] - fit->at[i];
        square += step[i] * step[i];
    }
    if (!fit->known || square == 0.0) {
        return fit->known && square == 0.0;
    }
    for (size_t row = 0; row < fit->m; row++) {
        const double y = residual[row] - fit->last[row];
        double rest = y;

        for (size_t i = 0; i < n; i++) {
            rest -= fit->jacobian[i * fit->m + row] * step[i];
        }
        for (size_t i = 0; i < n; i++) {
            fit->jacobian[i * fit->m + row] += rest * step[i] / square;
        }
        missed += rest * rest;
        change += y * y;
    }
    return missed <= MISSED * MISSED * change;
}

/* Computes the Jacobian by forward differences. */
static void compute_jacobian(struct fit *fit, size_t n, const double *u, const double *residual)
{
    double set[IDENTIFY_FREE_MAX * IDENTIFY_FREE_MAX] = {0};

    for (size_t i = 0; i < n; i++) {
        memcpy(set + i * n, u, n * sizeof *set);
        set[i * n + i] += u[i] > 0.0 ? -DIFFERENCE : DIFFERENCE;
    }
    run_batch(fit, set, n, fit->jacobian);
    for (size_t i = 0; i < n; i++) {
        double *column = fit->jacobian + i * fit->m;
        const double step = set[i * n + i] - u[i];

        prior_residuals(fit, set + i * n, column);
        for (size_t row = 0; row < fit->m; row++) {
            column[row] = (column[row] - residual[row]) / step;
        }
    }
}

/* Callback of the solver: computes the residuals (flag 1), or the Jacobian in column order (flag
 * 2). A negative result ends the fit. */
static int fit_evaluate(void *context, int m, int n, const double *u, double *residual,
                        double *jacobian, int stride, int flag)
{
    struct fit *fit = context;

    if (fit->problem->interrupted && *fit->problem->interrupted) {
        return -1;
    }
    if (flag == 1) {
        run_batch(fit, u, 1, residual);
        prior_residuals(fit, u, residual);
        return fit->code ? -1 : 0;
    }
    if (fit->problem->progress) {
        double rms[SIGNALS];

        find_rms(fit, residual, rms);
        fit->problem->progress(++fit->step, rms[fit->judge], fit->judge);
    }
    if (!update_jacobian(fit, (size_t)n, u, residual)) {
        compute_jacobian(fit, (size_t)n, u, residual);
    }
    memcpy(fit->at, u, (size_t)n * sizeof *u);
    memcpy(fit->last, residual, (size_t)m * sizeof *residual);
    fit->known = true;
    for (int i = 0; i < n; i++) {
        memcpy(jacobian + i * stride, fit->jacobian + i * m, (size_t)m * sizeof *jacobian);
    }
    return fit->code ? -1 : 0;
}

/* ---- results of the fit ---- */

/* Returns the number of rows that count as one independent measurement: 1 + 2 times the sum of the
 * residuals' autocorrelation up to its first zero, over the first signals of all recordings. */
static double find_coherence(const struct fit *fit, const double *residual)
{
    double sum = 0.0, all = 0.0;

    for (size_t r = 0; r < fit->problem->bench->nrecording; r++) {
        const double *x = residual + fit->first[r];
        const size_t count = fit->problem->bench->recording[r].count;
        double power = 0.0, length = 1.0;

        if (!is_used(fit->problem, r)) {
            continue;
        }
        for (size_t i = 0; i < count; i++) {
            power += x[i] * x[i];
        }
        for (size_t lag = 1; lag < count && power > 0.0; lag++) {
            double product = 0.0;

            for (size_t i = lag; i < count; i++) {
                product += x[i] * x[i - lag];
            }
            if (product < 0.05 * power) {
                break;
            }
            length += 2.0 * product / power;
        }
        sum += length * power;
        all += power;
    }
    return all > 0.0 ? sum / all : 1.0;
}

int fit_partner(const struct fit_result *result, size_t count, size_t i)
{
    double most = FIT_CORRELATED;
    int partner = -1;

    for (size_t k = 0; k < count; k++) {
        if (k != i && fabs(result->correlation[i][k]) > most) {
            most = fabs(result->correlation[i][k]);
            partner = (int)k;
        }
    }
    return partner;
}

/* Returns the verdict on the uncertainty of a parameter. */
static enum fit_verdict judge_value(const struct bench_free *free, double u, double value,
                                    double sigma, bool paired)
{
    const double range = free->upper - free->lower;

    return fabs(sin(u)) > AT_BOUND                        ? FIT_BOUND
           : !(sigma > 0.0) || 2.0 * sigma >= 0.5 * range ? FIT_NOT_TOLD
           : 2.0 * sigma <= FIT_KNOWN_SHARE * fabs(value) ? (paired ? FIT_PAIRED : FIT_KNOWN)
           : 2.0 * sigma >= fabs(value)                   ? FIT_NOT_TOLD
                                                          : FIT_ROUGH;
}

/* Adds the gradient g of each block of consecutive rows as g g' to sum (n x n). jacobian is in
 * column order. Priors are blocks of one row. */
static void add_blocks(const struct fit *fit, const double *jacobian, const double *residual,
                       size_t length, double sum[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX])
{
    const size_t n = fit->problem->nfree;
    size_t end;

    for (size_t row = 0; row < fit->m; row = end) {
        double gradient[IDENTIFY_FREE_MAX] = {0.0};

        end = row >= fit->nrow ? row + 1 : row + length > fit->nrow ? fit->nrow : row + length;
        for (size_t i = 0; i < n; i++) {
            for (size_t k = row; k < end; k++) {
                gradient[i] += jacobian[i * fit->m + k] * residual[k];
            }
        }
        for (size_t i = 0; i < n; i++) {
            for (size_t k = 0; k < n; k++) {
                sum[i][k] += gradient[i] * gradient[k];
            }
        }
    }
}

/* Computes sigmas and correlations at the solution. factor and pivot are the solver's. Two
 * estimates of the variance exist, and the larger one counts: sum of squares times inverse normal
 * matrix times coherence, and the sandwich of the gradients of blocks of rows, which holds for
 * residuals that are correlated or unequal (White, Econometrica 48, 1980). */
static void find_covariance(struct fit *fit, const double *u, double *residual, double *factor,
                            const int *pivot, struct fit_result *result)
{
    const size_t n = fit->problem->nfree, m = fit->m;
    double work[IDENTIFY_FREE_MAX], blocks[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX] = {{0.0}};
    double inverse[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX], square = 0.0;

    __cminpack_func__(covar)((int)n, factor, (int)m, pivot, 1e-10, work);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < n; k++) {
            inverse[i][k] = factor[k * m + i];
        }
    }
    if (fit_evaluate(fit, (int)m, (int)n, u, residual, factor, (int)m, 2)) {
        return;
    }
    for (size_t i = 0; i < m; i++) {
        square += residual[i] * residual[i] / (double)(m - n);
    }
    add_blocks(fit, factor, residual, (size_t)ceil(2.0 * result->coherence), blocks);
    for (size_t i = 0; i < n; i++) {
        const struct bench_free *free = &fit->problem->free[i];
        double variance = 0.0;

        for (size_t k = 0; k < n; k++) {
            for (size_t l = 0; l < n; l++) {
                variance += inverse[i][k] * blocks[k][l] * inverse[l][i];
            }
            result->correlation[i][k] = inverse[i][i] > 0.0 && inverse[k][k] > 0.0
                                            ? inverse[i][k] / sqrt(inverse[i][i] * inverse[k][k])
                                            : i == k;
        }
        variance = fmax(variance, square * inverse[i][i] * result->coherence);
        result->sigma[i] = sqrt(fmax(0.0, variance)) * fabs(fit_slope(free, u[i]));
    }
    for (size_t i = 0; i < n; i++) {
        result->verdict[i] = judge_value(&fit->problem->free[i], u[i], result->value[i],
                                         result->sigma[i], fit_partner(result, n, i) >= 0);
    }
}

/* Computes rms and coherence of the residuals, and the error of an independent measurement. Gives
 * each signal the weight of its own error, if reweight is set and the bench states no sigmas. */
static void weigh_residuals(struct fit *fit, const double *residual, bool reweight,
                            struct fit_result *result)
{
    const double *sigma = fit->problem->bench->bench.sigmas.signal;
    double rms[SIGNALS];

    find_rms(fit, residual, rms);
    result->first = fit->judge;
    result->coherence = find_coherence(fit, residual);
    fit->level = rms[fit->judge] * sqrt(result->coherence);
    for (size_t s = 0; s < SIGNALS; s++) {
        if (s != fit->judge && sigma[s] * sigma[fit->judge] > 0.0) {
            fit->weight[s] = sigma[fit->judge] / sigma[s];
        } else if (s != fit->judge && reweight && rms[s] * rms[fit->judge] > 0.0) {
            fit->weight[s] *= rms[fit->judge] / rms[s];
        }
    }
}

/* Runs the solver in two rounds, each from a newly computed Jacobian. The second round weighs
 * priors and signals by the errors of the first round. A fit of several joints has a guided round
 * before both. */
static enum error_code run_solver(struct fit *fit, double *u, double *residual, double *jacobian,
                                  double *last, struct fit_result *result)
{
    const int n = (int)fit->problem->nfree, m = (int)fit->m;
    const int first = fit->problem->bench->trial.njoint > 1 ? -1 : 0;
    double diagonal[IDENTIFY_FREE_MAX], qtf[IDENTIFY_FREE_MAX], work[3][IDENTIFY_FREE_MAX];
    int pivot[IDENTIFY_FREE_MAX], evaluations, jacobians;

    fit->guide = first < 0 ? GUIDE : 0.0;
    run_batch(fit, u, 1, residual);
    weigh_residuals(fit, residual, true, result);
    for (int round = first; round < ROUNDS && !fit->code; round++) {
        fit->guide = round < 0 ? GUIDE : 0.0;
        fit->known = false;
        __cminpack_func__(lmder)(fit_evaluate, fit, m, n, u, residual, jacobian, m, TOLERANCE,
                                 TOLERANCE, 0.0, 3 * fit->problem->steps, diagonal, 1, 1.0, 0,
                                 &evaluations, &jacobians, pivot, qtf, work[0], work[1], work[2],
                                 last);
        weigh_residuals(fit, residual, round + 1 < ROUNDS, result);
    }
    for (int i = 0; i < n; i++) {
        result->value[i] = fit_value(&fit->problem->free[i], u[i]);
        result->sigma[i] = NAN;
        result->verdict[i] = FIT_INTERIM;
    }
    if (!fit->code) {
        find_covariance(fit, u, residual, jacobian, pivot, result);
        set_variables(fit->problem, u, &result->trial);
    }
    result->simulations = atomic_load(&fit->simulations);
    return fit->code;
}

enum error_code fit_solve(const struct fit_problem *problem, struct fit_result *result,
                          struct error *error)
{
    struct fit fit = {.problem = problem, .error = error, .judge = SIGNALS};
    double u[IDENTIFY_FREE_MAX], *memory;
    enum error_code code;

    /* Assign residuals to the recordings, then to the priors */
    for (size_t r = 0; r < problem->bench->nrecording; r++) {
        const struct recording *recording = &problem->bench->recording[r];

        fit.first[r] = fit.nrow;
        for (size_t s = 0; s < SIGNALS && is_used(problem, r); s++) {
            if (recording->signal[s]) {
                fit.nrow += recording->count;
                fit.judge = s < fit.judge ? (enum signal)s : fit.judge;
            }
        }
    }
    for (size_t s = 0; s < SIGNALS; s++) {
        fit.weight[s] = 1.0;
    }
    fit.m = fit.nrow;
    for (size_t i = 0; i < problem->nfree; i++) {
        fit.m += problem->free[i].sigma > 0.0;
        u[i] = fit_variable(&problem->free[i], problem->free[i].start);
    }
    if (fit.nrow < problem->nfree) {
        return error_set(error, ERROR_INPUT,
                         "found %zu rows of recordings for %zu numbers, expected more", fit.nrow,
                         problem->nfree);
    }

    memory = calloc(fit.m * (2 * problem->nfree + 3), sizeof *memory);
    if (!memory) {
        return error_set(error, ERROR_MEMORY, "no memory for a fit of %zu rows", fit.m);
    }
    fit.jacobian = memory + fit.m * (problem->nfree + 1);
    fit.last = fit.jacobian + fit.m * problem->nfree;
    code = run_solver(&fit, u, memory, memory + fit.m, fit.last + fit.m, result);
    free(memory);
    return code;
}

/* ---- preparing ---- */

/* Adds a free parameter, unless the problem has it. The default start and bounds depend on the
 * drive. */
static enum error_code add_free(struct fit_problem *problem, const struct bench_free *given,
                                int parameter, struct error *error)
{
    const struct trial_robot *trial = &problem->bench->trial;
    struct bench_free *one = &problem->free[problem->nfree];
    double lower, upper;

    for (size_t k = 0; k < problem->nfree; k++) {
        if (problem->free[k].parameter == parameter &&
            !strcmp(problem->free[k].group ? problem->free[k].group : "",
                    given->group ? given->group : "")) {
            return error_set(error, ERROR_INPUT, "found \"%.63s\" again, expected it once",
                             given->key);
        }
    }
    if (problem->nfree == IDENTIFY_FREE_MAX) {
        return error_set(error, ERROR_INPUT, "found \"%.63s\" behind %d numbers, expected no more",
                         given->key, IDENTIFY_FREE_MAX);
    }
    *one = *given;
    one->parameter = parameter;
    snprintf(one->name, sizeof one->name, "%.40s%s%s",
             trial->njoint > 1 ? trial->joint[parameter / parameter_count].name : "",
             trial->njoint > 1 ? "." : "", parameter_of(parameter)->key);
    parameter_bounds(trial, parameter, problem->bench->supply_v, &lower, &upper);
    one->start = yaml_has(&one->mark, "start") ? one->start : parameter_get(trial, parameter);
    one->lower = yaml_has(&one->mark, "lower") ? one->lower : lower;
    one->upper = yaml_has(&one->mark, "upper") ? one->upper : upper;
    problem->nfree++;
    return one->lower < one->upper
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "found no room for \"%.63s\" between %g and %g, expected bounds for it "
                           "in the bench's file",
                           one->name, one->lower, one->upper);
}

enum error_code fit_prepare(struct fit_problem *problem, const char *const *key, size_t nkey,
                            struct error *error)
{
    const struct bench *bench = &problem->bench->bench;
    enum error_code code = ERROR_NONE;

    problem->nfree = 0;
    for (size_t i = 0; i < (nkey ? nkey : bench->nfree) && !code; i++) {
        struct bench_free one = nkey ? (struct bench_free){.key = key[i]} : bench->free[i];
        int parameter[TRIAL_JOINTS_MAX];
        size_t count;

        code = parameter_resolve(&problem->bench->trial, one.key, parameter, &count, error);
        for (size_t k = 0; k < bench->nfree && nkey && !code; k++) {
            if (!strcmp(bench->free[k].key, one.key) && !bench->free[k].group) {
                one = bench->free[k];
            }
        }
        for (size_t k = 0; k < count && !code; k++) {
            code = add_free(problem, &one, parameter[k], error);
        }
    }
    return code || problem->nfree > 0
               ? code
               : error_set(error, ERROR_INPUT, "found no free numbers, expected --free KEY,...");
}
