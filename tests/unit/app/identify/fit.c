/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive with known numbers, simulated by rk4 in steps of 20 us, is identified from 10 s of its
 * voltages and of its angle with 1 % of noise: each number comes back within 2 %, or is said not
 * to be known so well. What is wrong with benches and recordings is refused with its place.
 */
#include <unistd.h>

#include "app/identify/identify.h"
#include "base/array.h"
#include "base/random.h"
#include "tests/physics/near.h"
#include "tests/unit/app/put_file.h"
#include "tests/unit/arena_fixture.h"

#define RIG HIL_SOURCE_DIR "/config/rigs/xl330-pendulum.yaml"
#define BENCH_FILE HIL_SOURCE_DIR "/config/validation/xl330.yaml"

enum { ROWS = 1500, FREE = 5, SEEDS = 2 };

static struct arena arena;
static struct error error;
static struct identify_bench bench;
static double column[4][ROWS], current[ROWS];
static bool enabled[ROWS];
static struct recording recording = {.file = "made",
                                     .group = "",
                                     .count = ROWS,
                                     .time = column[0],
                                     .signal = {[SIGNAL_POSITION] = column[1]},
                                     .voltage = column[2],
                                     .goal = column[3],
                                     .enabled = enabled,
                                     .gain = 1.0};

/* Names, true values, and where the fit begins. */
static const char *const keys[FREE] = {"R_ohm", "NKt_nm_a", "coulomb_nm", "load_motor",
                                       "Dm_nm_s_rad"};
static const double truth[FREE] = {4.2, 0.45, 0.012, 0.15, 0.008};

/* Adds 1 % of the largest value as noise. */
static void add_noise(double *value, struct random_stream *random)
{
    double most = 0.0;

    for (size_t i = 0; i < ROWS; i++) {
        most = fmax(most, fabs(value[i]));
    }
    for (size_t i = 0; i < ROWS; i++) {
        value[i] += 0.01 * most * random_gaussian(random);
    }
}

/* Fills the recording with voltages of many frequencies and levels, and with the response of the
 * true drive by a finer integration. */
static void make_recording(struct trial_robot *trial, uint64_t seed)
{
    struct rig fine = *bench.rig;
    const struct bench_law none = {0};
    struct random_stream random = random_named(seed, "noise");

    for (size_t i = 0; i < ROWS; i++) {
        const double t = 4e-3 * (double)i;

        column[0][i] = t;
        column[2][i] = 2.2 * sin(2.0 * M_PI * 0.4 * t) + 1.8 * sin(2.0 * M_PI * 1.3 * t + 0.5) +
                       (fmod(t, 2.5) < 1.0 ? 1.2 : -0.8);
        enabled[i] = true;
    }
    fine.integrator = PLANT_RK4;
    fine.substep_ns = 20000;
    fine.substeps = 50;
    assert_ok(simulate_recording(
        &fine, trial, &none, &recording,
        &(struct simulated){.signal = {[SIGNAL_POSITION] = column[1], [SIGNAL_CURRENT] = current}},
        &error));
    add_noise(column[1], &random);
    add_noise(current, &random);
}

/* Prints what a fit found for a number, and returns its relative error. */
static double say_number(const struct fit_result *result, const char *name, size_t i, double is)
{
    const double off = fabs(result->value[i] / is - 1.0);

    print_message("%s: %.5g, true %.5g, off by %.2f %%, sigma %.2f %%, %s\n", name,
                  result->value[i], is, 100.0 * off, 100.0 * result->sigma[i] / result->value[i],
                  word_of(fit_verdict_words, (int)result->verdict[i]));
    return off;
}

/* Fits numbers of a drive to a recording of it with 1 % noise. Voltages and angles determine only
 * NKt/R, so neither number may be called known. With the current both are within 2 %. */
TEST(known_numbers_come_back)
{
    int parameter[FREE];
    struct fit_problem problem;
    static struct fit_result result;
    struct trial_robot made;
    size_t within = 0;

    assert_ok(identify_open_own(RIG, "pivot", &arena, &bench, &error));
    bench.trial.effects[0].thermal = (struct robot_thermal){0};
    bench.recording = &recording;
    bench.nrecording = 1;
    for (size_t i = 0; i < FREE; i++) {
        parameter[i] = parameter_find(keys[i]);
    }
    made = bench.trial;
    parameter_set(&made, parameter, truth, FREE);
    for (uint64_t seed = 0; seed < 2 * SEEDS; seed++) {
        const bool with_current = seed >= SEEDS;

        make_recording(&made, seed);
        recording.signal[SIGNAL_CURRENT] = with_current ? current : NULL;
        problem = (struct fit_problem){.bench = &bench, .steps = 40};
        assert_ok(fit_prepare(&problem, keys, FREE, &error));
        assert_ok(fit_solve(&problem, &result, &error));
        print_message("%d simulations of 6 s, %.1f rows count as one\n", result.simulations,
                      result.coherence);
        for (size_t i = 0; i < FREE; i++) {
            const double off = say_number(&result, keys[i], i, truth[i]);

            within += off * truth[i] <= 2.0 * result.sigma[i];
            if (i < 2) {
                assert_int_equal(result.verdict[i], with_current ? FIT_KNOWN : FIT_PAIRED);
                assert_true(!with_current || off <= 0.02);
                assert_int_equal(fit_partner(&result, FREE, i), with_current ? -1 : 1 - (int)i);
            }
        }
    }
    assert_in_range(within, 9 * FREE * 2 * SEEDS / 10, FREE * 2 * SEEDS);
}

/* A fit whose simulation turns the joint past its range, where the measured one stayed, is of no
 * use: three times the voltage swings the pendulum over. */
TEST(a_fit_that_leaves_the_range_is_a_failure)
{
    static const char *const free[] = {"L_h"};
    static struct identify_result result;
    struct fit_problem problem = {.bench = &bench, .steps = 2};

    for (size_t i = 0; i < ROWS; i++) {
        column[2][i] *= 3.0;
    }
    recording.signal[SIGNAL_CURRENT] = NULL;
    assert_ok(fit_prepare(&problem, free, 1, &error));
    assert_ok(identify_run(&problem, false, &arena, &result, &error));
    assert_string_equal(result.failure,
                        "made: found a fit whose simulation leaves the joint's range");
}

/* A constant torque of the motor, by the gain of its group: on a lock the load cell shows it, and a
 * lock that yields turns by torque / stiffness; an inertia turns by torque t^2 / 2 (J + I). */
TEST(an_output_is_locked_yields_or_turns)
{
    static const struct {
        struct bench_mount mount;
        enum signal signal;
        double expected;
    } rows[] = {
        {{OUTPUT_LOCKED, 0.0, 0.0}, SIGNAL_LOAD_TORQUE, 0.2},
        {{OUTPUT_LOCKED, 0.0, 0.0}, SIGNAL_DEFLECTION, 0.002},
        {{OUTPUT_LOCKED, 0.001, 40.0}, SIGNAL_LOAD_TORQUE, 0.2},
        {{OUTPUT_LOCKED, 0.001, 40.0}, SIGNAL_POSITION, 0.005},
        {{OUTPUT_INERTIA, 40.0, 0.0}, SIGNAL_POSITION, 0.2 * 0.5 * 5.996 * 5.996 / 40.001845},
        {{OUTPUT_INERTIA, 40.0, 0.0}, SIGNAL_CURRENT, 0.2 / 0.344415},
    };
    struct trial_robot trial = bench.trial;
    const struct bench_law none = {0};
    struct recording r = recording;

    trial.effects[0] = (struct robot_effects){0};
    trial.joint[0].sea.Dm = 0.02;
    parameter_set_group(&trial, &(struct group_number){.group = "a",
                                                       .parameter = parameter_find("command_gain"),
                                                       .value = 2.0});
    r.signal[SIGNAL_POSITION] = NULL;
    r.command = COMMAND_TORQUE;
    r.group = "a";
    for (size_t i = 0; i < ROWS; i++) {
        column[2][i] = 0.1;
    }
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct simulated out = {.diverged = false};

        trial.mount = rows[i].mount;
        out.signal[rows[i].signal] = current;
        assert_ok(simulate_recording(bench.rig, &trial, &none, &r, &out, &error));
        assert_near(current[ROWS - 1], rows[i].expected, 2e-3 * rows[i].expected);
    }
}

/* The torque on an output that is nearly weightless: the implicit integrator at 1 ms agrees with
 * dopri5 within 15 % where it cannot resolve the swing of the output on the spring. */
TEST(the_torque_on_a_light_output_is_resolved)
{
    static const double inertia[] = {1e-6, 1e-5, 1e-4, 1e-3};
    const struct bench_law none = {0};
    struct recording r = recording;
    struct trial_robot trial;
    double most[2], mean[2];
    struct rig rig;

    assert_ok(identify_open_own(RIG, "pivot", &arena, &bench, &error));
    trial = bench.trial;
    rig = *bench.rig;
    trial.effects[0] = (struct robot_effects){0};
    trial.joint[0].sea = (struct robot_sea){.present = true,
                                            .J = 0.0318,
                                            .Dm = 1.56,
                                            .Ks = 2425.0,
                                            .Ds = 1.2,
                                            .N = 9.0,
                                            .Kt = 1.393,
                                            .Kw = 1.393,
                                            .R = 0.55,
                                            .L = 2e-4,
                                            .deflection = 1.0};
    r.signal[SIGNAL_POSITION] = NULL;
    r.count = 100;
    for (size_t i = 0; i < r.count; i++) {
        column[0][i] = 1e-3 * (double)i;
        column[2][i] = i > 4 ? 7.4 : 0.0;
        enabled[i] = true;
    }
    for (size_t i = 0; i < 2 * ARRAY_COUNT(inertia); i++) {
        struct simulated out = {.signal = {[SIGNAL_LOAD_TORQUE] = current}};

        rig.integrator = i % 2 ? PLANT_DOPRI5 : PLANT_IMPLICIT;
        trial.mount = (struct bench_mount){OUTPUT_INERTIA, inertia[i / 2], 0.0};
        assert_ok(simulate_recording(&rig, &trial, &none, &r, &out, &error));
        most[i % 2] = mean[i % 2] = 0.0;
        for (size_t k = 0; k < r.count; k++) {
            most[i % 2] = fmax(most[i % 2], fabs(current[k]));
            mean[i % 2] += current[k];
        }
        print_message("%g kg m2: most %g, sum %g\n", inertia[i / 2], most[i % 2], mean[i % 2]);
        if (i % 2) {
            assert_near(most[0], most[1], 0.15 * most[1]);
            assert_near(mean[0], mean[1], 0.08 * mean[1]);
        }
    }
}

/* A trial has room for all group numbers of a file, and for one more per free number of a fit. */
TEST(numbers_of_groups_all_count)
{
    enum { ALL = GROUP_NUMBERS_MAX + IDENTIFY_FREE_MAX };
    const int gain = parameter_find("command_gain");
    struct trial_robot trial = bench.trial;
    char group[ALL][8];

    for (int i = 0; i < ALL; i++) {
        snprintf(group[i], sizeof group[i], "%d", i);
        parameter_set_group(
            &trial, &(struct group_number){.group = group[i], .parameter = gain, .value = 2.0 + i});
    }
    for (int i = 0; i < ALL; i++) {
        parameter_take_group(&trial, group[i]);
        assert_near(parameter_get(&trial, gain), 2.0 + i, 0.0);
    }
}

/* Filter, delay, inertia and damping of a drive behind a spring, and a gain for a group, come back
 * from the load torque of a lock under torque steps. */
TEST(an_elastic_drive_comes_back_from_its_lock)
{
    static const char *const free[] = {"command_filter_s", "command_delay_s", "J_kg_m2",
                                       "Dm_nm_s_rad", "command_gain"};
    static const double true_values[] = {0.03, 0.0042, 0.03, 1.2, 1.1},
                        start[] = {0.02, 0.003, 0.02, 0.6, 1.0};
    struct recording r = recording;
    struct trial_robot made = bench.trial;
    static struct identify_bench locked;
    struct fit_problem problem = {.bench = &locked, .nfree = ARRAY_COUNT(free), .steps = 40};
    struct simulated out = {.signal = {[SIGNAL_LOAD_TORQUE] = current}};
    static struct fit_result result;

    made.effects[0] = (struct robot_effects){0};
    made.joint[0].sea.Ks = 2425.0;
    made.mount = (struct bench_mount){.output = OUTPUT_LOCKED};
    locked =
        (struct identify_bench){.rig = bench.rig, .trial = made, .recording = &r, .nrecording = 1};
    for (size_t i = 0; i < ARRAY_COUNT(free); i++) {
        struct bench_free *of = &problem.free[i];

        *of = (struct bench_free){.parameter = parameter_find(free[i]),
                                  .start = start[i],
                                  .lower = 0.1 * start[i],
                                  .upper = 5.0 * start[i]};
        if (i == 4) {
            of->group = "a";
            parameter_set_group(&made, &(struct group_number){.group = "a",
                                                              .parameter = of->parameter,
                                                              .value = true_values[i]});
        } else {
            parameter_set(&made, &of->parameter, &true_values[i], 1);
        }
    }
    for (size_t i = 0; i < ROWS; i++) {
        column[2][i] = i / 100 % 2 ? 0.2 : -0.1;
    }
    r.signal[SIGNAL_POSITION] = NULL;
    r.command = COMMAND_TORQUE;
    r.group = "a";
    assert_ok(simulate_recording(bench.rig, &made, &locked.bench.law, &r, &out, &error));
    memcpy(column[1], current, sizeof current);
    r.signal[SIGNAL_LOAD_TORQUE] = column[1];
    assert_ok(fit_solve(&problem, &result, &error));
    for (size_t i = 0; i < ARRAY_COUNT(free); i++) {
        assert_near(result.value[i], true_values[i], 0.01 * true_values[i]);
        assert_int_equal(result.verdict[i], FIT_KNOWN);
    }
}

/* An arm of three joints under gravity, in their servos' position loops: yaw and pitch share a
 * drive, the elbow has its own. Positions and currents have 1 % noise. Each number comes back
 * within 2 %, and each drive gets its file. */
TEST(a_fit_recovers_the_drives_of_an_arm)
{
    static const char bench_text[] =
        "{name: arm, source: made, license: own, rig: config/rigs/arm-damiao.yaml,\n"
        " joints: [{joint: yaw, drive: big}, elbow, {joint: "
        "pitch, "
        "drive: big}],\n columns: {time: t, position: q_*, current: i_*, goal: g_*},\n"
        " law: {duty_per_rad: 1.5},\n free: [R_ohm, NKt_nm_a, elbow.J_kg_m2, yaw.coulomb_nm]}\n";
    static const char *const names[] = {"yaw.R_ohm",      "elbow.R_ohm",   "yaw.NKt_nm_a",
                                        "elbow.NKt_nm_a", "elbow.J_kg_m2", "yaw.coulomb_nm"};
    static const double true_number[] = {2.1, 1.4, 4.2, 5.3, 0.041, 0.6};
    static const double goal[3][3] = {{0.0, 0.5, 0.7}, {0.9, 0.5, 1.1}, {0.8, 0.35, 0.5}};
    enum { JOINTS = 3, STEPS = 1200 };
    const char *const path[] = {HIL_BINARY_DIR "/arm-bench.yaml", HIL_BINARY_DIR "/arm.csv"};
    static struct identify_bench arm;
    static struct identify_result result;
    static struct recording made[JOINTS];
    struct simulated out[JOINTS] = {{.diverged = false}};
    struct random_stream random = random_named(7, "arm");
    struct fit_problem problem = {.bench = &arm, .steps = 40};
    const struct robot_drive *drive;
    struct trial_robot trial;
    struct rig fine;
    FILE *file;

    put_file(path[0], bench_text);
    assert_no_error(identify_open(path[0], &arena, &arm, &error), error.text);
    assert_int_equal(arm.trial.njoint, JOINTS);
    assert_no_error(fit_prepare(&problem, NULL, 0, &error), error.text);
    assert_int_equal(problem.nfree, ARRAY_COUNT(names));

    /* Simulate the true arm by a finer integration */
    trial = arm.trial;
    for (size_t i = 0; i < problem.nfree; i++) {
        assert_string_equal(problem.free[i].name, names[i]);
        parameter_set(&trial, &problem.free[i].parameter, &true_number[i], 1);
    }
    assert_true(trial.joint[1].sea.R == 2.1 && trial.joint[2].sea.R == 1.4);
    fine = *arm.rig;
    fine.integrator = PLANT_RK4;
    fine.substep_ns = 50000;
    fine.substeps = 20;
    for (size_t k = 0; k < JOINTS; k++) {
        const bool has[SIGNALS] = {[SIGNAL_POSITION] = true, [SIGNAL_CURRENT] = true};

        made[k] = (struct recording){
            .file = "made", .group = "", .place = k, .count = STEPS, .gain = 1.0};
        assert_ok(recording_alloc(&made[k], STEPS, has, &arena, &error));
        for (size_t i = 0; i < STEPS; i++) {
            const double t = 4e-3 * (double)i;

            made[k].time[i] = t;
            made[k].goal[i] = goal[k][0] + goal[k][1] * sin(2.0 * M_PI * goal[k][2] * t) +
                              (fmod(t + (double)k, 1.7) < 0.8 ? 0.15 : -0.15);
            made[k].enabled[i] = true;
            made[k].signal[SIGNAL_POSITION][i] = goal[k][0];
            made[k].voltage[i] = 0.0;
        }
        memcpy(out[k].signal, made[k].signal, sizeof out[k].signal);
    }
    assert_ok(simulate_recording(&fine, &trial, &arm.bench.law, made, out, &error));
    assert_false(out[0].diverged);

    /* Write what was measured, read it, and fit from other numbers */
    file = fopen(path[1], "w");
    assert_non_null(file);
    fputs("t,q_yaw,i_yaw,g_yaw,q_elbow,i_elbow,g_elbow,q_pitch,i_pitch,g_pitch\n", file);
    for (size_t i = 0; i < STEPS; i++) {
        fprintf(file, "%.4f", made[0].time[i]);
        for (size_t k = 0; k < JOINTS; k++) {
            fprintf(file, ",%.9g,%.9g,%.9g",
                    made[k].signal[SIGNAL_POSITION][i] + 0.01 * random_gaussian(&random),
                    made[k].signal[SIGNAL_CURRENT][i] + 0.05 * random_gaussian(&random),
                    made[k].goal[i]);
        }
        fputs("\n", file);
    }
    fclose(file);
    assert_no_error(identify_take_files(&arm, &path[1], 1, &arena, &error), error.text);
    assert_int_equal(arm.nrecording, JOINTS);
    assert_string_equal(arm.recording[1].name, "arm.csv, elbow");
    assert_no_error(identify_run(&problem, false, &arena, &result, &error), error.text);
    assert_string_equal(result.failure, "");
    for (size_t i = 0; i < problem.nfree; i++) {
        assert_true(say_number(&result.fit, names[i], i, true_number[i]) <= 0.02);
    }
    assert_no_error(
        identify_write_drive(&problem, &result, HIL_BINARY_DIR "/arm-found.yaml", &error),
        error.text);
    assert_no_error(
        robot_load_drive(HIL_BINARY_DIR "/arm-found-elbow.yaml", &arena, &drive, &error),
        error.text);
    assert_near(drive->sea.R, result.fit.value[1], 1e-5);
    assert_no_error(robot_load_drive(HIL_BINARY_DIR "/arm-found-yaw.yaml", &arena, &drive, &error),
                    error.text);
    assert_near(drive->sea.R, result.fit.value[0], 1e-5);
    assert_int_not_equal(access(HIL_BINARY_DIR "/arm-found-pitch.yaml", F_OK), 0);
}

/* A locked drive under a torque loop about its spring settles at these torques. A command that
 * starts in the middle of its row equals a delayed command. */
TEST(a_host_closes_its_loop_about_the_spring)
{
    static const struct {
        struct bench_law law;
        double expected;
    } rows[] = {
        {{.torque_gain = 1.0, .torque_feed_forward = 1.0}, 0.2},
        {{.torque_gain = 2.0, .torque_feed_forward = 1.0}, 0.15},
        {{.torque_gain = 1.0, .torque_feed_forward = 0.0}, 0.2 / 3.0},
        {{.torque_gain = 1.0, .torque_limit_nm = 0.05}, 0.05},
        {{.torque_gain = 1.0, .torque_share = 0.2, .torque_period_s = 0.0625}, 0.2 / 3.0},
    };
    static double late[ROWS];
    const struct bench_law none = {0};
    struct recording r = recording;
    struct trial_robot trial = bench.trial;
    struct simulated out = {.signal = {[SIGNAL_LOAD_TORQUE] = current}};
    struct simulated delayed = {.signal = {[SIGNAL_LOAD_TORQUE] = late}};

    trial.effects[0] = (struct robot_effects){0};
    trial.joint[0].sea.Ks = 2425.0;
    trial.joint[0].sea.J = 0.03;
    trial.joint[0].sea.Dm = 1.2;
    trial.joint[0].sea.command_filter_s = 0.03;
    trial.mount = (struct bench_mount){.output = OUTPUT_LOCKED};
    r.signal[SIGNAL_POSITION] = NULL;
    r.command = COMMAND_TORQUE;
    for (size_t i = 0; i < ROWS; i++) {
        column[2][i] = 0.2;
    }
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct bench_law law = rows[i].law;

        law.torque_kp = 0.5;
        law.torque_delay_s = 0.002;
        law.torque_share = law.torque_share > 0.0 ? law.torque_share : 1.0;
        law.torque_limit_nm = law.torque_limit_nm > 0.0 ? law.torque_limit_nm : 1e9;
        assert_ok(simulate_recording(bench.rig, &trial, &law, &r, &out, &error));
        assert_near(current[ROWS - 1], rows[i].expected, 1e-4);
    }
    for (size_t i = 0; i < ROWS; i++) {
        column[2][i] = i / 100 % 2 ? 0.2 : -0.1;
    }
    r.command_at = 0.5;
    assert_ok(simulate_recording(bench.rig, &trial, &none, &r, &out, &error));
    r.command_at = 0.0;
    trial.bench[0].delay_s = 0.002;
    assert_ok(simulate_recording(bench.rig, &trial, &none, &r, &delayed, &error));
    for (size_t i = 0; i < ROWS; i++) {
        assert_near(current[i], late[i], 0.0);
    }
}

/* A lag of 50 ms with a gain of 2: times of a step are tau ln 1/(1 - share), and the bandwidth of a
 * sweep is where |H| falls to 0.707 of |H| at 1 Hz. */
TEST(responses_are_of_closed_form)
{
    enum { COUNT = 40000 };
    static double time[COUNT], command[2][COUNT], signal[2][COUNT];
    const double tau = 0.05, w1 = 2.0 * M_PI * tau;
    struct response r;

    for (size_t i = 0; i < COUNT; i++) {
        time[i] = 1e-3 * (double)i;
        command[0][i] = i < 1000 ? 0.0 : 3.0;
        command[1][i] = sin(2.0 * M_PI * 0.25 * time[i] * time[i]);
        for (int k = 0; k < 2; k++) {
            const double before = i > 0 ? signal[k][i - 1] : 0.0;

            signal[k][i] = i > 0 ? 2.0 * command[k][i - 1] +
                                       (before - 2.0 * command[k][i - 1]) * exp(-1e-3 / tau)
                                 : 0.0;
        }
    }
    response_compute(time, command[0], signal[0], COUNT, &r);
    assert_near(r.t10, -tau * log(0.9), 2e-5);
    assert_near(r.t63, -tau * log(0.37), 2e-5);
    assert_near(r.t90, -tau * log(0.1), 2e-5);
    assert_near(r.gain, 2.0, 1e-6);
    assert_near(r.overshoot, 0.0, 1e-6);
    response_compute(time, command[1], signal[1], COUNT, &r);
    assert_near(r.gain, 2.0 / sqrt(1.0 + w1 * w1), 0.1);
    assert_near(r.bandwidth, sqrt(2.0 * (1.0 + w1 * w1) - 1.0) / w1, 0.35);
    assert_near(r.peak_hz, 1.0, 0.0);
    assert_true(r.nband >= 19);
    for (size_t i = 2; i < 16; i++) {
        assert_near(r.magnitude[i] * hypot(1.0, w1 * r.band[i]), 2.0, 0.02);
    }
}

/* Limits for the step response of a lag. The simulation has 1.1 times its time constant and 1.05
 * times its gain. A recording of another group, or without the quantity, has no error. */
TEST(each_limit_has_its_own_verdict)
{
    enum { COUNT = 4000 };
    static double time[COUNT], command[COUNT], measured[COUNT], simulated[COUNT];
    static struct validation v;
    static const struct {
        const char *what, *of;
        double percent, error;
        const char *verdict;
    } rows[] = {
        {"t63", NULL, 10.2, 10.0, "wish missed"}, {"t90", NULL, 9.8, 10.0, "limit missed"},
        {"gain", "a", 5.2, 5.0, "held"},          {"gain", "step.csv", 4.8, 5.0, "limit missed"},
        {"bandwidth", NULL, 100.0, NAN, "held"},  {"gain", "b", 100.0, NAN, "held"},
        {"share", NULL, 5.3, 5.0, "held"},
    };
    struct recording r = {.name = "step.csv",
                          .group = "a",
                          .count = COUNT,
                          .time = time,
                          .voltage = command,
                          .signal = {[SIGNAL_LOAD_TORQUE] = measured}};

    for (size_t i = 0; i < COUNT; i++) {
        const double t = 1e-3 * ((double)i - 1000.0);

        time[i] = 1e-3 * (double)i;
        command[i] = i < 1000 ? 0.0 : 3.0;
        measured[i] = i < 1000 ? 0.0 : 6.0 * -expm1(-t / 0.05);
        simulated[i] = i < 1000 ? 0.0 : 6.3 * -expm1(-t / 0.055);
    }
    v.bench.recording = &r;
    v.bench.nrecording = 1;
    v.judges[0] = true;
    v.simulated[0].signal[SIGNAL_LOAD_TORQUE] = simulated;
    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        const struct word *word = limit_words;

        while (strcmp(word->word, rows[i].what) != 0) {
            word++;
        }
        const struct bench_limit limit = {.what = word->value,
                                          .of = rows[i].of,
                                          .percent = rows[i].percent,
                                          .wanted_percent = 6.0};
        const double found = limit_error(&v, &limit, 0);

        assert_int_equal(isnan(found), isnan(rows[i].error));
        assert_true(isnan(found) || fabs(found - rows[i].error) < 0.2);
        assert_string_equal(limit_verdict(&limit, found), rows[i].verdict);
    }
}

/* A number on which the recording does not depend must not be called known. */
TEST(what_the_recording_does_not_tell_is_said)
{
    static const char *const free[] = {"R_ohm", "L_h"}, *const swapped[] = {"R_omh"};
    struct fit_problem problem = {.bench = &bench, .steps = 10};
    static struct fit_result result;

    assert_int_equal(fit_prepare(&problem, swapped, 1, &error), ERROR_INPUT);
    assert_string_equal(error.text, "found \"R_omh\", expected R_ohm");
    assert_ok(fit_prepare(&problem, free, 2, &error));
    assert_ok(fit_solve(&problem, &result, &error));
    assert_int_not_equal(result.verdict[1], FIT_KNOWN);
}

/* Fails unless the last error has these words. */
static void assert_error_has(const char *expected)
{
    if (!strstr(error.text, expected)) {
        fail_msg("found \"%s\", expected \"%s\"", error.text, expected);
    }
}

/* Checks that a bench with this text is refused with the expected error. */
static void refuses(const char *text, const char *expected)
{
    struct bench made;
    const char *path = "identify-bench.yaml";

    put_file(path, text);
    assert_int_equal(bench_read(path, &arena, &made, &error), ERROR_INPUT);
    assert_error_has(expected);
    remove(path);
}

#define HEAD "name: a\nsource: b\nlicense: c\nrig: r.yaml\n"
#define GIVEN HEAD "columns: {time: t, position: q, voltage: v}\n"

TEST(wrong_benches_are_refused_with_their_place)
{
    refuses(HEAD "columns: {time: t, position: q}\n",
            "identify-bench.yaml:5:10: found none or several");
    refuses(HEAD "columns: {time: t, position: q, goal: g}\n", "without key \"law\"");
    refuses(GIVEN "free: [R_omh]\n", "identify-bench.yaml:6:8: found \"R_omh\"");
    refuses(GIVEN "free: [{key: R_ohm, expected: 3}]\n", "bounds or a prior");
    refuses(HEAD, "found no columns");
    refuses(HEAD "columns: {time: t, voltage: v}\n", "no column of a measured signal");
    refuses(GIVEN "output: inertia\n", "found an incomplete output");
    refuses(GIVEN "output: free\nlock_nm_rad: 5\noutput_kg_m2: 1\n", "found an incomplete output");
    refuses(GIVEN "group_numbers: [{group: a, key: R_omh, value: 1}]\n", "found \"R_omh\"");
    /* Numbers that a drive's file refuses, and groups without recordings */
    refuses(GIVEN "numbers: {R_ohm: -5}\n",
            "identify-bench.yaml:6:11: found -5 for \"R_ohm\", expected 0 to 1e+09");
    refuses(GIVEN "numbers: {J_kg_m2: 0}\n", "found 0 for \"J_kg_m2\"");
    refuses(GIVEN "numbers: {presliding_nm_rad: 0, command_delay_s: 0.2}\n",
            "found 0.2 for \"command_delay_s\", expected 0 to 0.1");
    refuses(GIVEN "group_numbers: [{group: a, key: iron_nm_s_rad_a2, value: -1}]\n", "found -1");
    refuses(GIVEN "free: [{key: command_filter_s, lower: -1}]\n", "found -1");
    refuses(GIVEN "free: [{key: saturation_a, upper: -1}]\n", "found -1");
    refuses(GIVEN "free: [{key: L_h, start: 0}]\n", "found 0");
    refuses(GIVEN "group_numbers: [{group: b, key: R_ohm, value: 1}]\n"
                  "recordings: [{file: x, group: a}]\n",
            "found group \"b\", expected a recording's");
    refuses(GIVEN "free: [{key: R_ohm, group: b}]\nrecordings: [{file: x, group: a}]\n",
            "found group \"b\"");
    refuses(GIVEN "limits: [{what: peak, of: b, percent: 1}]\nrecordings: [{file: c/x}]\n",
            "identify-bench.yaml:6:10: found group \"b\"");
    refuses(GIVEN "limits: [{what: peak, of: x, percent: -1}]\nrecordings: [{file: c/x}]\n",
            "found -1");
    refuses("name: a\nsource: b\nlicense: c\ndrive: d\nlimits: [{what: peak, percent: 1}]\n"
            "columns: {load: t, speed: w, supply: v, supply_current: i}\n",
            "identify-bench.yaml:5:10: found limits of steady states");
    refuses(HEAD "columns: {load: t, speed: w, supply: v, supply_current: i}\n",
            "identify-bench.yaml:5:10: found a column \"load\", expected steady states");
}

#define POINT(keys)                                                                                \
    "name: a\nsource: b\nlicense: c\ndrive: d\npoints:\n  - {what: x, value: 1, " keys "}\n"

TEST(wrong_points_are_refused_with_their_place)
{
    refuses(POINT("current_a: 1, load_nm: 0, find: speed_rad_s"),
            "identify-bench.yaml:6:5: found keys that do not tell one steady state");
    refuses(POINT("voltage_v: 1, current_a: 1, find: load_nm"), "one steady state");
    refuses(POINT("voltage_v: 1, speed_rad_s: 0, find: voltage_v"), "one steady state");
    refuses(POINT("voltage_v: 1, load_nm: 0, backdriven: true, find: current_a"), "\"backdriven\"");
    refuses(POINT("voltage_v: 1, speed_rad_s: 0, find: load_nm") "rig: r.yaml\n",
            "found points of a rig and a drive");
}

/* A servo of R = 9.2308 ohm and NKt = 2.6154 N m/A without friction of its gear, but viscous. */
TEST(points_follow_from_two_of_their_quantities)
{
    static struct validation validation;
    const char *path = HIL_SOURCE_DIR "/config/validation/robotis-xh430.yaml";

    assert_no_error(validation_run(path, &arena, &validation, &error), error.text);
    assert_near(validation.ours[0], 11.1 / 9.2308 * 2.6154, 1e-9);
    assert_near(validation.ours[1], 11.1 / 9.2308, 1e-9);
    assert_near(validation.ours[2], 11.1 / (3.8197 + 0.002 * 9.2308 / 2.6154), 1e-9);
    assert_true(validation.passed);
}

/* A motor on a dynamometer: a fit from other numbers to one half of the states comes back to the
 * drive that ships, which tells the losses of the other half. */
TEST(losses_of_a_motor_are_told_from_half_of_its_states)
{
    static const double other[] = {0.3, 1e-4, 0.03, 80.0, 2e-3, 3.0};
    static const double efficiency[] = {0.014, 0.015, 0.0125, 0.035};
    const char *path = HIL_SOURCE_DIR "/config/validation/dyno-u8.yaml";
    static struct validation validation;
    struct fit_result result;
    struct fit_problem problem;

    assert_no_error(validation_run(path, &arena, &validation, &error), error.text);
    assert_true(validation.passed && validation.mean < 0.06);
    for (size_t i = 0; i < validation.bench.nrecording; i++) {
        assert_true(validation.error[i] <= 0.06);
        assert_true(point_efficiency_error(&validation.bench.recording[i],
                                           validation.simulated[i].signal[SIGNAL_LOSS]) <=
                    efficiency[i]);
    }
    validation.bench.nrecording = 1;
    problem = (struct fit_problem){.bench = &validation.bench, .steps = 100};
    assert_no_error(fit_prepare(&problem, NULL, 0, &error), error.text);
    assert_int_equal(problem.nfree, 6);
    for (size_t i = 0; i < problem.nfree; i++) {
        problem.free[i].start = other[i];
    }
    assert_no_error(fit_solve(&problem, &result, &error), error.text);
    for (size_t i = 0; i < problem.nfree; i++) {
        const double ships = parameter_get(&validation.bench.trial, problem.free[i].parameter);

        assert_near(result.value[i], ships, 2.0 * result.sigma[i]);
    }
}

/* A motor that saturates at 1 mA carries none of the loads: without a limit, a bench fails too. */
TEST(a_bench_fails_if_a_simulation_diverges)
{
    static struct validation validation;

    put_file(
        "identify-diverged.yaml",
        "name: a\nsource: b\nlicense: c\ndrive: identify-config/drives/tmotor-u8-pro.yaml\n"
        "columns: {load: torque_nm, speed: speed_rad_s, supply: bus_v, supply_current: bus_a}\n"
        "numbers: {saturation_a: 0.001}\n"
        "recordings: [{file: identify-config/validation/data/dyno-u8/fit.csv}]\n");
    unlink("identify-config");
    assert_int_equal(symlink(HIL_SOURCE_DIR "/config", "identify-config"), 0);
    assert_no_error(validation_run("identify-diverged.yaml", &arena, &validation, &error),
                    error.text);
    assert_false(validation.passed);
    unlink("identify-config");
    remove("identify-diverged.yaml");
}

/* Writes a recording, which must be refused with that. */
static void refuses_rows(const char *text, const char *expected)
{
    const char *path = "identify-rows.csv";
    struct recording made;

    put_file(path, text);
    assert_int_equal(recording_read(&bench, path, NULL, &arena, &made, &error), ERROR_INPUT);
    assert_error_has(expected);
    remove(path);
}

#define SERVO "# kp 100\ntime_s,position_rad,goal_rad,torque_enable,supply_v\n"

TEST(wrong_recordings_are_refused_with_their_line)
{
    assert_ok(identify_open(BENCH_FILE, &arena, &bench, &error));
    refuses_rows("time_s,x\n", "no \"kp\" with a number");
    refuses_rows("# kp 100\ntime_s,position_rad,goal_rad,torque_enable,supply_v,goal_rad\n",
                 "identify-rows.csv:2: found column \"goal_rad\" again, expected it once");
    refuses_rows("\xef\xbb\xbf" SERVO "0,x,0,1,7\n",
                 "identify-rows.csv:3: column 2 (position_rad): found \"x\", expected a number");
    refuses_rows("# kp 100, so\ntime_s,position_rad\n0,1\n", "no column \"goal_rad\"");
    refuses_rows(SERVO "0,0,0,1,7\n0,0,0,1,7\n", "expected a later one");
    refuses_rows(SERVO "0,0,0,1,7\n", "found 1 rows");
    refuses_rows(SERVO "0,0,0,1,7\n5,0,0,1,7\n10,0,0,1,7\n15,0,0,1,7\n20,0,0,1,7\n25,0,0,1,7\n"
                       "30,0,0,1,7\n35,0,0,1,7\n40,0,0,1,7\n45,0,0,1,7\n50,0,0,1,7\n55,0,0,1,7\n"
                       "60,0,0,1,7\n65,0,0,1,7\n70,0,0,1,7\n75,0,0,1,7\n",
                 "found 16 rows in 75 s, expected one in 0.5 s or more: is the time in seconds?");
    assert_int_equal(
        recording_read(&bench, BENCH_FILE, "00000000", &arena, bench.recording, &error),
        ERROR_INPUT);
    assert_non_null(strstr(error.text, "CRC-32"));
}

/* The bench that ships, by the drive that ships. */
TEST(the_measured_servo_is_within_its_limit)
{
    static struct validation validation;

    assert_ok(validation_run(BENCH_FILE, &arena, &validation, &error));
    assert_int_equal(validation.bench.nrecording, 8);
    assert_true(validation.passed);
    print_message("xl330: %.4f rad of what no identification has seen\n", validation.mean);
}

FIXTURE(begin)
{
    return arena_init(&arena, (size_t)1 << 30, &error);
}

FIXTURE(end)
{
    arena_fini(&arena);
    return 0;
}

TEST_GROUP(begin, end)
