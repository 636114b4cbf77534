/* SPDX-License-Identifier: Apache-2.0 */
/* Opens benches, runs fits, and computes errors. */

#include "app/identify/identify.h"

#include "base/text.h"

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

/* Sets the parameters that a bench file gives, for all recordings or for groups of recordings. */
static enum error_code set_numbers(struct identify_bench *bench, struct error *error)
{
    const size_t nnumber = bench->bench.nnumber, all = nnumber + bench->bench.ngroup_number;
    struct trial_robot *trial = &bench->trial;

    trial->mount = bench->bench.mount;
    for (size_t i = 0; i < all; i++) {
        const struct yaml_real_entry *number = &bench->bench.number[i];
        struct group_number one =
            i < nnumber ? (struct group_number){number->mark, NULL, number->name, number->value, 0}
                        : bench->bench.group_number[i - nnumber];
        int parameter[TRIAL_JOINTS_MAX];
        size_t count;

        if (parameter_resolve(trial, one.key, parameter, &count, error)) {
            return error_prefix(error, "%s:%d:%d", one.mark.file, one.mark.line, one.mark.column);
        }
        for (size_t k = 0; k < count; k++) {
            one.parameter = parameter[k];
            if (!one.group) {
                parameter_set(trial, &one.parameter, &one.value, 1);
            } else if (trial->ngroup < GROUP_NUMBERS_MAX) {
                parameter_set_group(trial, &one);
            } else {
                return yaml_error(error, &one.mark,
                                  "found more than %d numbers of groups, expected fewer",
                                  GROUP_NUMBERS_MAX);
            }
        }
    }
    return ERROR_NONE;
}

/* Returns the first joint with the drive of joint k of the bench. Two joints share a drive if the
 * bench names the same drive for both. If the bench names a drive for neither, they share a drive
 * if the robot file gives both the same parameters. */
static int find_drive(const struct identify_bench *bench, size_t k)
{
    const struct trial_robot *trial = &bench->trial;
    const struct bench_joint *joint = bench->bench.joint;
    const bool named = bench->bench.njoint > 0 && joint[k].drive;

    for (size_t i = 0; i < k; i++) {
        bool same = !(bench->bench.njoint > 0 && joint[i].drive) && !named;

        for (int p = 0; p < parameter_find("offset_rad") && same; p++) {
            same = parameter_get(trial, trial->at[i] * parameter_count + p) ==
                   parameter_get(trial, trial->at[k] * parameter_count + p);
        }
        if (same || (named && joint[i].drive && !strcmp(joint[i].drive, joint[k].drive))) {
            return trial->drive[trial->at[i]];
        }
    }
    return trial->at[k];
}

/* Copies the robot's joints. Finds the joints to identify, and their drives. */
static enum error_code take_joints(struct identify_bench *bench, struct error *error)
{
    struct trial_robot *trial = &bench->trial;
    const struct robot *robot = &trial->robot;

    memcpy(trial->body, robot->body, robot->nbody * sizeof *robot->body);
    for (size_t j = 0; j < robot->njoint; j++) {
        trial->joint[j] = robot->joint[j];
        trial->drive[j] = -1;
        trial->bench[j].command_gain = 1.0;
        if (robot->joint[j].sea.effects) {
            trial->effects[j] = *robot->joint[j].sea.effects;
        }
        if (bench->bench.njoint == 0 && robot->joint[j].sea.present) {
            trial->at[trial->njoint++] = (int)j;
        }
    }
    for (size_t k = 0; k < bench->bench.njoint; k++) {
        const struct bench_joint *one = &bench->bench.joint[k];
        const int j = TEXT_FIND(robot->joint, robot->njoint, name, one->joint);
        bool again = false;

        for (size_t i = 0; i < k && j >= 0; i++) {
            again |= trial->at[i] == j;
        }
        if (j < 0 || again || !robot->joint[j].sea.present) {
            return yaml_error(error, &one->mark,
                              "found %s joint \"%.63s\", expected each joint of the robot with an "
                              "electric drive once, as \"%.63s\"",
                              j < 0   ? "no"
                              : again ? "again"
                                      : "no drive at",
                              one->joint, robot->joint[0].name);
        }
        trial->at[trial->njoint++] = j;
    }
    for (size_t k = 0; k < trial->njoint; k++) {
        trial->drive[trial->at[k]] = find_drive(bench, k);
    }
    return ERROR_NONE;
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
        bench->trial =
            (struct trial_robot){.joint = {{.name = "the drive", .sea = drive->sea}}, .njoint = 1};
        if (drive->sea.effects) {
            bench->trial.effects[0] = *drive->sea.effects;
        }
        code = set_numbers(bench, error);
    }
    return code;
}

/* Loads the rig and copies its robot. Refuses a robot without electric drives or on a floating
 * base. Also refuses an output that only a robot of one joint can have, if there are several
 * joints. */
static enum error_code load_bench_rig(const char *path, struct arena *arena,
                                      struct identify_bench *bench, struct error *error)
{
    const struct bench_mount *mount = &bench->bench.mount;
    enum error_code code = rig_load(path, arena, &bench->rig, error);
    const struct robot *robot;
    size_t drives = 0;

    if (code) {
        return code;
    }
    robot = bench->rig->robot;
    for (size_t j = 0; j < robot->njoint; j++) {
        drives += robot->joint[j].sea.present;
    }
    if (robot->njoint > TRIAL_JOINTS_MAX || drives == 0 || robot->floating ||
        bench->rig->nfree > 0) {
        return error_set(error, ERROR_INPUT,
                         "%s: found a robot of %zu joints with %zu electric drives%s%s, expected 1 "
                         "to %d joints with drives on a fixed base",
                         robot->file, robot->njoint, drives,
                         robot->floating ? " on a floating base" : "",
                         bench->rig->nfree > 0 ? " and free bodies" : "", TRIAL_JOINTS_MAX);
    }
    if (robot->njoint > 1 && mount->output != OUTPUT_FREE) {
        return yaml_error(error, yaml_place(&bench->bench.mark, "output"),
                          "found an output of a robot with %zu joints, expected \"free\" or one "
                          "joint",
                          robot->njoint);
    }
    bench->trial = (struct trial_robot){.robot = *robot};
    bench->supply_v = bench->rig->supply_v;
    code = take_joints(bench, error);
    for (size_t i = 0; i < COLUMNS && !code && bench->trial.njoint > 1; i++) {
        const char *title = bench->bench.columns.title[i];

        if (title && (i < SIGNALS || (i >= COLUMN_GOAL && i < COLUMN_ENABLED)) &&
            !strchr(title, '*')) {
            code = yaml_error(error, &bench->bench.columns.mark,
                              "found column \"%.80s\" for %zu joints, expected \"*\" in its title "
                              "for the name of the joint",
                              title, bench->trial.njoint);
        }
    }
    return code ? code : set_numbers(bench, error);
}

/* Refuses angles that span much more than the joint's range, for example degrees. */
static enum error_code check_angles(const struct trial_robot *trial,
                                    const struct recording *recording, struct error *error)
{
    const struct robot_joint *joint = &trial->joint[trial->at[recording->place]];
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

/* Refuses more recordings than a result can hold, one per file and joint. */
static enum error_code check_count(const struct identify_bench *bench, size_t files,
                                   struct error *error)
{
    const size_t most = IDENTIFY_RECORDINGS_MAX / bench->trial.njoint;

    return files <= most
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s: found %zu recordings of %zu joints, expected %zu or fewer",
                           bench->bench.name, files, bench->trial.njoint, most);
}

/* Reads all recordings of a bench. */
static enum error_code read_recordings(struct identify_bench *bench, struct arena *arena,
                                       struct error *error)
{
    enum error_code code = ERROR_NONE;

    const size_t njoint = bench->trial.njoint;

    bench->nrecording = bench->bench.nrecording * njoint;
    bench->recording = arena_alloc(arena, bench->nrecording + 1, sizeof *bench->recording);
    if (!bench->recording) {
        return error_set(error, ERROR_MEMORY, "no memory for recordings");
    }
    for (size_t i = 0; i < bench->bench.nrecording && !code; i++) {
        const struct bench_recording *one = &bench->bench.recording[i];
        struct recording *recording = &bench->recording[i * njoint];
        const char *path;

        code = find_recording(bench, one, arena, &path, error);
        if (!code && bench->bench.obtain && access(path, F_OK)) {
            bench->missing = true;
            bench->nrecording = 0;
            return ERROR_NONE;
        }
        code = code ? code : recording_read(bench, path, one->crc32, arena, recording, error);
        for (size_t k = 0; k < njoint && !code; k++) {
            code = check_angles(&bench->trial, &recording[k], error);
            recording[k].group = one->group;
            recording[k].judge = one->judge;
            if (!code) {
                recording_take_zero(&recording[k], (enum bench_zero)one->zero);
            }
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
    code = yaml_resolve_path(yaml_place(&bench->bench.mark, drive ? "drive" : "rig"),
                             drive ? bench->bench.drive : bench->bench.rig, arena, &plant, error);
    code = code ? code : (drive ? load_bench_drive : load_bench_rig)(plant, arena, bench, error);
    code = code ? code : check_count(bench, bench->bench.nrecording, error);
    return code ? code : read_recordings(bench, arena, error);
}

enum error_code identify_open_own(const char *rig, const char *joint, struct arena *arena,
                                  struct identify_bench *bench, struct error *error)
{
    enum error_code code = bench_of_own(joint, arena, &bench->bench, error);

    return code ? code : load_bench_rig(rig, arena, bench, error);
}

enum error_code identify_take_files(struct identify_bench *bench, const char *const *file,
                                    size_t count, struct arena *arena, struct error *error)
{
    const size_t njoint = bench->trial.njoint;
    struct recording *all = arena_alloc(arena, count * njoint, sizeof *all);
    enum error_code code = check_count(bench, count, error);

    if (!all) {
        return error_set(error, ERROR_MEMORY, "no memory for recordings");
    }
    if (bench->bench.npoint > 0) {
        return yaml_error(error, &bench->bench.mark,
                          "found a bench of points, expected one of recordings");
    }
    for (size_t i = 0; i < count && !code; i++) {
        struct recording *one = &all[i * njoint];

        code = recording_read(bench, file[i], NULL, arena, one, error);
        for (size_t k = 0; k < njoint && !code; k++) {
            code = check_angles(&bench->trial, &one[k], error);
        }
        if (!code && !one->is_log && one->voltage_before &&
            one->time[1] - one->time[0] > 1.5e-9 * (double)bench->rig->tick_ns) {
            code = error_set(error, ERROR_INPUT,
                             "%s: found rows every %g s, expected one a tick, whose voltages are "
                             "known (run --record-period 1)",
                             file[i], one->time[1] - one->time[0]);
        }
    }
    bench->recording = all;
    bench->nrecording = count * njoint;
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
    const int j = trial->at[r->place];
    const struct robot_joint *joint = &trial->joint[j];
    const double *measured = r->signal[SIGNAL_POSITION];
    double most[2] = {0.0, 0.0};

    for (size_t i = 0; i < r->count && measured; i++) {
        const double both[2] = {position[i], measured[i]};

        for (int k = 0; k < 2; k++) {
            const double q = both[k] + trial->bench[j].offset_rad;

            most[k] = fmax(most[k], fmax(q - joint->upper, joint->lower - q));
        }
    }
    return most[0] > 0.0 && !(most[1] > 0.0);
}

/* Simulates all recordings with the parameters of a trial, and computes the mean errors of their
 * first signals, or with `share` the RMS errors as shares. failure (may be NULL) receives why the
 * simulation of a fitted recording cannot be used. */
static enum error_code judge_all(const struct identify_bench *bench,
                                 const struct trial_robot *trial, bool share, struct arena *arena,
                                 double *found, struct simulated all[IDENTIFY_RECORDINGS_MAX],
                                 char failure[256], struct error *error)
{
    enum error_code code = ERROR_NONE;

    memset(all, 0, IDENTIFY_RECORDINGS_MAX * sizeof *all);
    for (size_t i = 0; i < bench->nrecording; i++) {
        for (size_t s = 0; s < SIGNALS; s++) {
            const struct recording *r = &bench->recording[i];

            if (r->signal[s] &&
                !(all[i].signal[s] = arena_alloc(arena, r->count, sizeof(double)))) {
                return error_set(error, ERROR_MEMORY, "no memory for simulated recordings");
            }
        }
    }
    for (size_t i = 0; i < bench->nrecording && !code; i += bench->trial.njoint) {
        code = simulate_recording(bench->rig, trial, &bench->bench.law, &bench->recording[i],
                                  &all[i], error);
    }
    for (size_t i = 0; i < bench->nrecording && !code; i++) {
        const struct recording *r = &bench->recording[i];
        const enum signal first = recording_first(r);
        const struct simulation_error off =
            simulation_compare(r->signal[first], all[i].signal[first], r->count);

        found[i] = first == SIGNAL_LOSS ? point_loss_error(r, all[i].signal[first])
                   : share              ? off.share
                                        : off.mean;
        if (failure && !r->judge &&
            (all[i].diverged || leaves_range(trial, r, all[i].signal[SIGNAL_POSITION]))) {
            snprintf(failure, 256, "%.160s: found a fit whose simulation %s", r->file,
                     all[i].diverged ? "diverges" : "leaves the joint's range");
        }
    }
    return code;
}

/* Returns the mean error of the validation recordings (judge), or of the fitted recordings. */
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
    struct simulated simulated[IDENTIFY_RECORDINGS_MAX];
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
    code = code ? code : judge_all(bench, &fit.trial, false, arena, all, simulated, NULL, error);
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
    code = judge_all(bench, &bench->trial, false, arena, result->start, result->simulated, NULL,
                     error);
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
    struct robot_sea sea = trial->joint[0].sea;

    sea.effects = &trial->effects[0];
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
