/* SPDX-License-Identifier: Apache-2.0 */
/* Opens benches, runs fits, and computes errors. */

#include "app/identify/identify.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* Largest span of the angles in a recording, as a multiple of the joint's range, because end stops
 * yield. */
static const double RANGES_MAX = 1.5;

/* A fit fails if its mean error exceeds the mean error of the start values by this factor. Priors
 * and measured currents can raise the mean error a little. */
static const double WORSE = 1.05;

/* Copies the effects of the drive, and replaces its numbers by the numbers of a bench. */
static void set_numbers(struct identify_bench *bench)
{
    if (bench->trial.joint.sea.effects) {
        bench->trial.effects = *bench->trial.joint.sea.effects;
    }
    for (size_t i = 0; i < bench->bench.nnumber; i++) {
        const int parameter = parameter_find(bench->bench.number[i].name);

        parameter_set(&bench->trial, &parameter, &bench->bench.number[i].value, 1);
    }
    for (size_t i = 0; i < bench->bench.ngroup_number; i++) {
        parameter_set_group(&bench->trial, &bench->bench.group_number[i]);
    }
    bench->trial.mount = bench->bench.mount;
}

/* Loads a catalogue drive for a bench of points. */
static enum error_code load_bench_drive(const char *path, struct arena *arena,
                                        struct identify_bench *bench, struct error *error)
{
    const struct robot_drive *drive;
    enum error_code code = robot_load_drive(path, arena, &drive, error);

    if (!code && !drive->sea.present) {
        code = yaml_error(error, yaml_place(&bench->bench.mark, "drive"),
                          "found a hydraulic drive, expected an electric one");
    }
    if (!code) {
        bench->supply_v = drive->supply_v;
        bench->trial = (struct trial_robot){.joint = {.name = "the drive", .sea = drive->sea}};
        set_numbers(bench);
    }
    return code;
}

/* Loads the rig and copies its robot. Refuses a robot that does not have exactly one joint, with an
 * electric drive. */
static enum error_code load_bench_rig(const char *path, struct arena *arena,
                                      struct identify_bench *bench, struct error *error)
{
    enum error_code code = rig_load(path, arena, &bench->rig, error);
    const struct robot *robot;

    if (code) {
        return code;
    }
    robot = bench->rig->robot;
    if (robot->njoint != 1 || robot->nbody != 2 || robot->floating ||
        !robot->joint[0].sea.present) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a robot of %zu joints%s, expected one joint with an electric "
                         "drive on a fixed base",
                         robot->file, robot->njoint, robot->floating ? " on a floating base" : "");
    }
    if (bench->rig->nfree > 0) {
        return error_set(error, ERROR_INPUT, "%s: found free bodies, expected a joint alone", path);
    }
    bench->trial = (struct trial_robot){
        .robot = *robot, .joint = robot->joint[0], .bench = {.command_gain = 1.0}};
    memcpy(bench->trial.body, robot->body, sizeof bench->trial.body);
    bench->supply_v = bench->rig->supply_v;
    set_numbers(bench);
    return ERROR_NONE;
}

/* Refuses angles that span much more than the joint's range, for example degrees. */
static enum error_code check_angles(const struct robot_joint *joint,
                                    const struct recording *recording, struct error *error)
{
    const double *position = recording->signal[SIGNAL_POSITION];
    double least = position ? position[0] : 0.0, greatest = least;

    for (size_t i = 1; i < recording->count && position; i++) {
        least = fmin(least, position[i]);
        greatest = fmax(greatest, position[i]);
    }
    if (recording->is_log || greatest - least <= RANGES_MAX * (joint->upper - joint->lower)) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT,
                     "%.200s: found angles from %.4g to %.4g rad, but joint %s turns from %.4g to "
                     "%.4g rad: are they in radians?",
                     recording->file, least, greatest, joint->name, joint->lower, joint->upper);
}

/* Finds the file of a recording. */
static enum error_code find_recording(const struct identify_bench *bench,
                                      const struct bench_recording *one, struct arena *arena,
                                      const char **path, struct error *error)
{
    const char *folder = bench->bench.obtain ? getenv("COMAN_HIL_DATA") : NULL;
    char there[PATH_MAX];

    if (!folder) {
        return yaml_resolve_path(yaml_place(&one->mark, "file"), one->file, arena, path, error);
    }
    snprintf(there, sizeof there, "%.2000s/%.1000s", folder,
             !strncmp(one->file, "data/", 5) ? one->file + 5 : one->file);
    *path = arena_strdup(arena, there);
    return *path ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory for a path");
}

/* Reads all recordings of a bench. */
static enum error_code read_recordings(struct identify_bench *bench, struct arena *arena,
                                       struct error *error)
{
    enum error_code code = ERROR_NONE;

    bench->nrecording = bench->bench.nrecording;
    bench->recording = arena_alloc(arena, bench->nrecording + 1, sizeof *bench->recording);
    if (!bench->recording) {
        return error_set(error, ERROR_MEMORY, "no memory for recordings");
    }
    for (size_t i = 0; i < bench->nrecording && !code; i++) {
        const struct bench_recording *one = &bench->bench.recording[i];
        struct recording *recording = &bench->recording[i];
        const char *path;

        code = find_recording(bench, one, arena, &path, error);
        if (!code && bench->bench.obtain && access(path, F_OK)) {
            bench->missing = true;
            bench->nrecording = 0;
            return ERROR_NONE;
        }
        code = code ? code : recording_read(bench, path, one->crc32, arena, recording, error);
        code = code ? code : check_angles(&bench->trial.joint, recording, error);
        recording->group = one->group;
        recording->judge = one->judge;
        if (!code) {
            recording_take_zero(recording, (enum bench_zero)one->zero);
        }
    }
    return code;
}

enum error_code identify_open(const char *path, struct arena *arena, struct identify_bench *bench,
                              struct error *error)
{
    const char *plant;
    enum error_code code = bench_read(path, arena, &bench->bench, error);
    const bool drive = !code && bench->bench.drive;

    bench->missing = false;
    if (code) {
        return code;
    }
    if (bench->bench.nrecording > IDENTIFY_RECORDINGS_MAX) {
        return yaml_error(error, &bench->bench.mark, "found %zu recordings, expected %d or fewer",
                          bench->bench.nrecording, IDENTIFY_RECORDINGS_MAX);
    }
    code = yaml_resolve_path(yaml_place(&bench->bench.mark, drive ? "drive" : "rig"),
                             drive ? bench->bench.drive : bench->bench.rig, arena, &plant, error);
    code = code ? code : (drive ? load_bench_drive : load_bench_rig)(plant, arena, bench, error);
    return code ? code : read_recordings(bench, arena, error);
}

enum error_code identify_open_own(const char *rig, const char *joint, struct arena *arena,
                                  struct identify_bench *bench, struct error *error)
{
    enum error_code code;

    bench->bench = (struct bench){.name = "own"};
    code = load_bench_rig(rig, arena, bench, error);
    if (!code && joint && strcmp(joint, bench->trial.joint.name) != 0) {
        code =
            error_set(error, ERROR_INPUT, "--joint: found \"%.63s\", but the joint of %s is \"%s\"",
                      joint, rig, bench->trial.joint.name);
    }
    return code ? code : bench_of_own(bench->trial.joint.name, arena, &bench->bench, error);
}

enum error_code identify_take_files(struct identify_bench *bench, const char *const *file,
                                    size_t count, struct arena *arena, struct error *error)
{
    struct recording *all = arena_alloc(arena, count, sizeof *all);
    enum error_code code = ERROR_NONE;

    if (!all) {
        return error_set(error, ERROR_MEMORY, "no memory for recordings");
    }
    if (bench->bench.npoint > 0) {
        return yaml_error(error, &bench->bench.mark,
                          "found a bench of points, expected one of recordings");
    }
    for (size_t i = 0; i < count && !code; i++) {
        code = recording_read(bench, file[i], NULL, arena, &all[i], error);
        code = code ? code : check_angles(&bench->trial.joint, &all[i], error);
        if (!code && !all[i].is_log && all[i].voltage_before &&
            all[i].time[1] - all[i].time[0] > 1.5e-9 * (double)bench->rig->tick_ns) {
            code = error_set(error, ERROR_INPUT,
                             "%s: found rows every %g s, expected one a tick, whose voltages are "
                             "known (run --record-period 1)",
                             file[i], all[i].time[1] - all[i].time[0]);
        }
    }
    bench->recording = all;
    bench->nrecording = count;
    return code;
}

double identify_mean(const double *error, size_t count)
{
    double sum = 0.0, used = 0.0;

    for (size_t i = 0; i < count; i++) {
        if (!isnan(error[i])) {
            sum += error[i];
            used++;
        }
    }
    return sum / used;
}

/* Returns whether simulated angles leave the joint's range and measured ones do not. */
static bool leaves_range(const struct trial_robot *trial, const struct recording *r,
                         const double *position)
{
    const struct robot_joint *joint = &trial->joint;
    const double *measured = r->signal[SIGNAL_POSITION];
    double most[2] = {0.0, 0.0};

    for (size_t i = 0; i < r->count && measured; i++) {
        const double both[2] = {position[i], measured[i]};

        for (int k = 0; k < 2; k++) {
            const double q = both[k] + trial->bench.offset_rad;

            most[k] = fmax(most[k], fmax(q - joint->upper, joint->lower - q));
        }
    }
    return most[0] > 0.0 && !(most[1] > 0.0);
}

/* Simulates all recordings with the parameters of a trial, and computes the mean errors of their
 * first signals, or with `share` the RMS errors as shares. kept and failure may be NULL; failure
 * receives why a simulation of a recording in use is of no use. */
static enum error_code judge_all(const struct identify_bench *bench,
                                 const struct trial_robot *trial, bool share, struct arena *arena,
                                 double *found, struct simulated *kept, char failure[256],
                                 struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < bench->nrecording && !code; i++) {
        const struct recording *r = &bench->recording[i];
        const enum signal first = recording_first(r);
        struct simulated simulated = {.diverged = false};

        for (size_t s = 0; s < SIGNALS; s++) {
            if (r->signal[s] &&
                !(simulated.signal[s] = arena_alloc(arena, r->count, sizeof(double)))) {
                return error_set(error, ERROR_MEMORY, "no memory for simulated recordings");
            }
        }
        code = simulate_recording(bench->rig, trial, &bench->bench.law, r, &simulated, error);
        if (!code) {
            const struct simulation_error off =
                simulation_compare(r->signal[first], simulated.signal[first], r->count);

            found[i] = first == SIGNAL_LOSS ? point_loss_error(r, simulated.signal[first])
                       : share              ? off.share
                                            : off.mean;
        }
        if (!code && failure && !r->judge &&
            (simulated.diverged || leaves_range(trial, r, simulated.signal[SIGNAL_POSITION]))) {
            snprintf(failure, 256, "%.160s: found a fit whose simulation %s", r->file,
                     simulated.diverged ? "diverges" : "leaves the joint's range");
        }
        if (kept) {
            kept[i] = simulated;
        }
    }
    return code;
}

/* Returns the mean error of the recordings that judge, or of those that a fit uses. */
static double mean_where(const struct identify_bench *bench, const double *error, bool judge)
{
    double some[IDENTIFY_RECORDINGS_MAX];

    for (size_t i = 0; i < bench->nrecording; i++) {
        some[i] = bench->recording[i].judge == judge ? error[i] : (double)NAN;
    }
    return identify_mean(some, bench->nrecording);
}

/* Fits to all groups except the group of a recording, and computes the errors of that group. */
static enum error_code run_fold(const struct fit_problem *problem, size_t left_out,
                                struct arena *arena, struct identify_result *result,
                                struct error *error)
{
    const struct identify_bench *bench = problem->bench;
    double all[IDENTIFY_RECORDINGS_MAX];
    struct fit_problem fold = *problem;
    struct fit_result fit;
    size_t used = 0;
    enum error_code code;

    for (size_t i = 0; i < bench->nrecording; i++) {
        used += !bench->recording[i].judge &&
                !recording_is_with(&bench->recording[i], &bench->recording[left_out]);
    }
    if (used == 0) {
        return ERROR_NONE;
    }
    fold.left_out = &bench->recording[left_out];
    code = fit_solve(&fold, &fit, error);
    code = code ? code : judge_all(bench, &fit.trial, false, arena, all, NULL, NULL, error);
    for (size_t i = 0; i < bench->nrecording && !code; i++) {
        if (!bench->recording[i].judge && recording_is_with(&bench->recording[i], fold.left_out)) {
            result->crossed[i] = all[i];
        }
    }
    result->nfold++;
    return code;
}

/* Returns the time of a monotonic clock, s. */
static double now_s(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

enum error_code identify_run(struct fit_problem *problem, bool crossed, struct arena *arena,
                             struct identify_result *result, struct error *error)
{
    const struct identify_bench *bench = problem->bench;
    const double begin = now_s();
    enum error_code code;

    *result = (struct identify_result){.nfold = 0};
    for (size_t i = 0; i < bench->nrecording; i++) {
        result->crossed[i] = NAN;
    }

    /* Fit, then compute the errors of all recordings with the start values and with the fit */
    code = judge_all(bench, &bench->trial, false, arena, result->start, NULL, NULL, error);
    code = code ? code : fit_solve(problem, &result->fit, error);
    code = code ? code
                : judge_all(bench, &result->fit.trial, false, arena, result->fitted,
                            result->simulated, result->failure, error);

    const double before = mean_where(bench, result->start, false),
                 after = mean_where(bench, result->fitted, false);

    if (!code && !result->failure[0] && after > WORSE * before) {
        snprintf(result->failure, sizeof result->failure,
                 "found a fit with a mean error of %.4g %s, more than %.4g %s of the start values",
                 after, signal_kinds[result->fit.first].unit, before,
                 signal_kinds[result->fit.first].unit);
    }

    /* Cross-validate: one fold per group */
    for (size_t i = 0; i < bench->nrecording && crossed && !code && !result->failure[0]; i++) {
        if (!bench->recording[i].judge && !(problem->interrupted && *problem->interrupted) &&
            isnan(result->crossed[i])) {
            code = run_fold(problem, i, arena, result, error);
        }
    }
    result->spent_s = now_s() - begin;
    return code;
}

struct robot_sea trial_drive(const struct trial_robot *trial)
{
    struct robot_sea sea = trial->joint.sea;

    sea.effects = &trial->effects;
    return sea;
}

/* Computes the points of a bench, and their mean relative error. */
static enum error_code judge_points(struct validation *validation, struct arena *arena,
                                    struct error *error)
{
    const struct bench *bench = &validation->bench.bench;
    const struct robot_sea sea = trial_drive(&validation->bench.trial);
    double sum = 0.0;

    validation->ours = arena_alloc(arena, bench->npoint, sizeof *validation->ours);
    if (!validation->ours) {
        return error_set(error, ERROR_MEMORY, "no memory for points");
    }
    for (size_t i = 0; i < bench->npoint; i++) {
        validation->ours[i] = point_compute(&sea, &bench->point[i]);
        sum += fabs(validation->ours[i] / bench->point[i].value - 1.0);
    }
    validation->mean = sum / (double)bench->npoint;
    return ERROR_NONE;
}

const char *validation_verdict(const struct validation *validation)
{
    return validation->bench.missing   ? "missing"
           : !validation->passed       ? "failed"
           : validation->unchecked > 0 ? "unchecked"
                                       : "passed";
}

const char *validation_unit(const struct validation *validation)
{
    const struct identify_bench *bench = &validation->bench;

    return validation->is_share     ? "%"
           : bench->nrecording == 0 ? "rad"
                                    : signal_kinds[recording_first(bench->recording)].unit;
}

enum error_code validation_run(const char *path, struct arena *arena, struct validation *validation,
                               struct error *error)
{
    struct identify_bench *bench = &validation->bench;
    double limit;
    bool any = false, diverged = false;
    enum error_code code = identify_open(path, arena, bench, error);

    if (code) {
        return code;
    }
    validation->unchecked = 0;
    validation->is_share = bench->bench.limit[1] > 0.0 || bench->bench.npoint > 0;
    if (bench->missing) {
        return ERROR_NONE;
    }
    if (bench->nrecording + bench->bench.npoint == 0) {
        return yaml_error(error, &bench->bench.mark, "found no recordings, expected some");
    }
    code = bench->bench.npoint > 0
               ? judge_points(validation, arena, error)
               : judge_all(bench, &bench->trial, validation->is_share, arena, validation->error,
                           validation->simulated, NULL, error);
    if (code) {
        return code;
    }
    for (size_t i = 0; i < bench->nrecording; i++) {
        any |= bench->recording[i].judge;
        validation->unchecked += !bench->recording[i].is_checked;
    }
    for (size_t i = 0; i < bench->nrecording; i++) {
        validation->judges[i] = bench->recording[i].judge || !any;
        diverged |= validation->judges[i] && validation->simulated[i].diverged;
    }
    if (bench->nrecording > 0) {
        validation->mean = mean_where(bench, validation->error, any);
    }
    limit = bench->bench.limit[validation->is_share];
    validation->passed =
        !diverged && isfinite(validation->mean) && (limit == 0.0 || validation->mean <= limit);
    for (size_t i = 0; i < bench->bench.nlimit; i++) {
        const struct bench_limit *one = &bench->bench.limits[i];
        bool found = false;

        for (size_t k = 0; k < bench->nrecording; k++) {
            const double off = limit_error(validation, one, k);

            found |= !isnan(off);
            validation->passed &= !(fabs(off) > one->percent);
        }
        if (!found) {
            return yaml_error(error, &one->mark, "found no recording with \"%s\" that judges",
                              word_of(limit_words, one->what));
        }
    }
    return ERROR_NONE;
}
