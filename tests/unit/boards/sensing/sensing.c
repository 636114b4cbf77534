/* SPDX-License-Identifier: Apache-2.0 */
/* Sensors as real ones: each error against its statistics or its closed form, each fault against
 * what it says, and nothing at all where nothing was asked for. */
#include "tests/unit/boards/sensing/sensing_bench.h"

static struct error error;

/* Arms the faults of the lines given, up to the NULL. */
static void arm(struct bench *bench, const char *const *line)
{
    static const char *const joint[] = {"hip", "knee"};
    static const char *const ft[] = {"foot"};
    static const bool driven[] = {true, true}, hydraulic[] = {false, false};
    const struct fault_names names = {.njoint = JOINTS,
                                      .joint = joint,
                                      .driven = driven,
                                      .hydraulic = hydraulic,
                                      .nft = FTS,
                                      .ft = ft,
                                      .imu = true};
    struct fault fault[8];
    size_t count = 0;

    for (; line && line[count]; count++) {
        assert_no_error(fault_parse(line[count], &names, &fault[count], &error), error.text);
    }
    assert_ok(faults_create(fault, count, 3, &bench->arena, &bench->faults, &error));
    bench->config.faults = bench->faults;
}

/* ---- errors ---- */

TEST_ON(ideal_sensors_hand_on_the_truth_itself, set_up, bench)
{
    arm(bench, NULL);
    start(bench);
    tick(bench);
    assert_ptr_equal(bench->measured, &bench->truth);
}

TEST_ON(ideal_channels_beside_a_real_one_are_true_to_the_last_bit, set_up, bench)
{
    bench->joint[0].torque.noise_rms = 0.05;
    start(bench);
    for (int i = 0; i < 10; i++) {
        bench->motor[0] = (struct motor_sense){.q = 0.1 * i,
                                               .qd = 1.0 / 3.0,
                                               .qm = sin(i),
                                               .qmd = 0.7,
                                               .current_a = 1.1,
                                               .torque_nm = 2.2,
                                               .voltage_v = 3.3};
        bench->motor[1] = bench->motor[0];
        bench->sense.force_n[2] = 10.0 / 3.0;
        tick(bench);
        assert_memory_equal(&bench->measured->motor[1], &bench->motor[1], sizeof bench->motor[1]);
        assert_memory_equal(&bench->measured->ft[0], &bench->sense, sizeof bench->sense);
        assert_true(bench->measured->motor[0].q == bench->motor[0].q);
        assert_true(bench->measured->motor[0].qmd == bench->motor[0].qmd);
        assert_true(bench->measured->motor[0].torque_nm != bench->motor[0].torque_nm);
        assert_true(bench->measured->supply_v == 48.0);
    }
}

/* Bounds of five standard deviations of each statistic of SAMPLES independent normal numbers. */
TEST_ON(noise_is_white_and_gaussian_of_the_size_asked_for, set_up, bench)
{
    static double x[SAMPLES];
    const double sigma = 0.05, n = SAMPLES;
    double sum = 0.0, square = 0.0, fourth = 0.0, lag = 0.0;
    int beyond = 0;

    bench->joint[1].torque.noise_rms = sigma;
    bench->motor[1].torque_nm = 7.0;
    start(bench);
    for (int i = 0; i < SAMPLES; i++) {
        tick(bench);
        x[i] = (bench->measured->motor[1].torque_nm - 7.0) / sigma;
        sum += x[i];
        square += x[i] * x[i];
        fourth += pow(x[i], 4);
        lag += i ? x[i] * x[i - 1] : 0.0;
        beyond += fabs(x[i]) > 1.959964;
    }
    assert_close(sum / n, 0.0, 5.0 / sqrt(n));
    assert_close(square / n, 1.0, 5.0 * sqrt(2.0 / n));
    assert_close(fourth / n, 3.0, 5.0 * sqrt(96.0 / n));
    assert_close(lag / n, 0.0, 5.0 / sqrt(n));
    assert_close(beyond / n, 0.05, 5.0 * sqrt(0.05 * 0.95 / n));
}

TEST_ON(noise_depends_on_the_seed_and_on_no_other_channel, set_up, bench)
{
    double first[50], second[50], seeded[50];

    for (int round = 0; round < 3; round++) {
        bench->joint[1].torque.noise_rms = 1.0;
        if (round == 1) { /* much more noise elsewhere, and other faults */
            bench->joint[0].torque.noise_rms = 2.0;
            bench->joint[1].current.noise_rms = 1.0;
            bench->config.imu.gyro.noise_rms = 1.0;
            arm(bench, (const char *const[]){"sensor imu garbage 1", NULL});
        }
        bench->config.seed = round == 2 ? 2 : 1;
        start(bench);
        for (int i = 0; i < 50; i++) {
            tick(bench);
            (round == 0   ? first
             : round == 1 ? second
                          : seeded)[i] = bench->measured->motor[1].torque_nm;
        }
    }
    assert_memory_equal(first, second, sizeof first);
    assert_memory_not_equal(first, seeded, sizeof first);
}

TEST_ON(channels_are_independent_of_each_other, set_up, bench)
{
    const double n = SAMPLES;
    double product = 0.0;

    bench->joint[0].torque.noise_rms = bench->joint[1].torque.noise_rms = 1.0;
    start(bench);
    for (int i = 0; i < SAMPLES; i++) {
        tick(bench);
        product += bench->measured->motor[0].torque_nm * bench->measured->motor[1].torque_nm;
    }
    assert_close(product / n, 0.0, 5.0 / sqrt(n));
}

/* The peak of the correlation between truth and reading is at the latency. */
TEST_ON(latency_is_a_delay_line_also_between_ticks, set_up, bench)
{
    bench->joint[0].link_encoder.latency_ns = 3 * TICK_NS;
    bench->joint[0].motor_encoder.latency_ns = 5 * TICK_NS / 2;
    bench->joint[0].current.latency_ns = 1;
    bench->motor[0] = (struct motor_sense){.q = 1.0, .qm = 1.0};
    start(bench);
    for (int i = 0; i < 100; i++) {
        bench->motor[0].q = bench->motor[0].qm = 1.0 + i;
        bench->motor[0].current_a = i;
        tick(bench);
        assert_close(bench->measured->motor[0].q, 1.0 + (i < 3 ? 0 : i - 3), 1e-12);
        assert_close(bench->measured->motor[0].qm, 1.0 + (i < 3 ? fmax(0.0, i - 2.5) : i - 2.5),
                     1e-12);
        assert_close(bench->measured->motor[0].current_a, i == 0 ? 0 : i - 1e-6, 1e-9);
    }
}

TEST_ON(converter_saturates_and_rounds_to_its_steps, set_up, bench)
{
    bench->joint[0].current = (struct sensor_error){.full_scale = 20.0, .lsb = 0.01};
    start(bench);
    bench->motor[0].current_a = 1.2345;
    tick(bench);
    assert_close(bench->measured->motor[0].current_a, 1.23, 1e-12);
    bench->motor[0].current_a = 1.2351;
    tick(bench);
    assert_close(bench->measured->motor[0].current_a, 1.24, 1e-12);
    bench->motor[0].current_a = -25.0;
    tick(bench);
    assert_true(bench->measured->motor[0].current_a == -20.0);
}

TEST_ON(gain_and_offset_come_before_the_converter, set_up, bench)
{
    bench->ft[0].force = (struct sensor_error){.gain_error = 0.02, .offset = -3.0, .lsb = 1.0};
    start(bench);
    bench->sense.force_n[1] = 100.0;
    bench->sense.peak_n[1] = 150.0;
    tick(bench);
    assert_true(bench->measured->ft[0].force_n[1] == 99.0);
    assert_true(bench->measured->ft[0].peak_n[1] == 149.0);
    assert_true(bench->measured->ft[0].force_n[0] == -3.0);
    assert_true(bench->measured->ft[0].torque_nm[0] == 0.0);
}

/* A random walk of k per root second has the variance k^2 t; the ramp is exact. */
TEST_ON(drift_grows_as_a_random_walk_and_a_ramp, set_up, bench)
{
    const double k = 0.5, seconds = 0.2;
    double square = 0.0;
    int walks = 0;

    for (int round = 0; round < 100; round++) {
        bench->joint[0].torque.drift_per_sqrt_s = bench->joint[1].torque.drift_per_sqrt_s = k;
        bench->config.imu.gyro.ramp_per_s = 0.25;
        bench->config.imu.accel.drift_per_sqrt_s = k;
        bench->config.seed = (uint64_t)round;
        start(bench);
        for (int i = 0; i <= 200; i++) {
            tick(bench);
            if (i == 0) {
                assert_true(bench->measured->motor[0].torque_nm == 0.0);
            }
        }
        assert_close(bench->measured->imu.gyro_rad_s[2], 0.25 * seconds, 1e-12);
        for (int i = 0; i < 2; i++, walks++) {
            square += pow(bench->measured->motor[i].torque_nm, 2) / (k * k * seconds);
        }
        for (int i = 0; i < 3; i++, walks++) {
            square += pow(bench->measured->imu.accel_m_s2[i], 2) / (k * k * seconds);
        }
    }
    assert_close(square / walks, 1.0, 5.0 * sqrt(2.0 / walks));
}

/* Turning about one axis at a constant rate through the angle where w changes its sign in the
 * plant's convention: 20.5 ms late is the attitude of 20.5 ms ago, on the arc between two ticks. */
TEST_ON(late_orientation_turns_through_the_sign_change, set_up, bench)
{
    const double rate = 30.0, late_s = 0.0205;

    bench->config.imu.orientation.latency_ns = 20500000;
    bench->config.imu.magnetic.offset = 1e-6;
    start(bench);
    for (int i = 0; i < 400; i++) {
        double half = 0.5 * rate * i * 1e-3, then = half - 0.5 * rate * late_s;
        double sign = cos(half) < 0.0 ? -1.0 : 1.0;
        double *q = bench->truth.imu.quaternion;
        const double *seen;

        q[0] = sign * cos(half);
        q[2] = sign * sin(half);
        tick(bench);
        seen = bench->measured->imu.quaternion;
        assert_close(seen[0] * seen[0] + seen[2] * seen[2], 1.0, 1e-12);
        if (i > 21) {
            assert_close(fabs(seen[0] * cos(then) + seen[2] * sin(then)), 1.0, 1e-12);
        }
        assert_true(bench->measured->imu.magnetic_t[1] == 1e-6);
    }
}

/* An error of s / 2 in each component is one of s rad about each axis: the angle between truth and
 * reading is s times the root of a chi-square with three degrees of freedom. */
TEST_ON(orientation_noise_is_half_its_angle, set_up, bench)
{
    const double s = 0.01;
    double square = 0.0;

    bench->config.imu.orientation.noise_rms = 0.5 * s;
    bench->truth.imu.quaternion[0] = 0.6;
    bench->truth.imu.quaternion[3] = 0.8;
    start(bench);
    for (int i = 0; i < SAMPLES; i++) {
        const double *q;
        double x, y, z;

        tick(bench);
        q = bench->measured->imu.quaternion;
        x = 0.6 * q[1] - 0.8 * q[2]; /* of the conjugate truth times the reading */
        y = 0.6 * q[2] + 0.8 * q[1];
        z = 0.6 * q[3] - 0.8 * q[0];
        square += pow(2.0 * asin(sqrt(x * x + y * y + z * z)) / s, 2);
    }
    assert_close(square / SAMPLES, 3.0, 5.0 * sqrt(6.0 / SAMPLES) + 1e-3);
}

TEST_ON(orientation_that_is_off_is_not_known, set_up, bench)
{
    arm(bench, (const char *const[]){"sensor imu off", NULL});
    bench->truth.imu = (struct imu_sense){{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 0, 0, 0}};
    start(bench);
    tick(bench);
    assert_memory_equal(&bench->measured->imu, &(struct imu_sense){0}, sizeof(struct imu_sense));
}

TEST_ON(encoder_that_counts_from_its_start_shows_no_angle_at_first, set_up, bench)
{
    bench->joint[0].incremental = true;
    bench->motor[0].qm = 0.7;
    bench->motor[1].qm = 0.7;
    start(bench);
    tick(bench);
    assert_true(bench->measured->motor[0].qm == 0.0);
    assert_true(bench->measured->motor[1].qm == 0.7);
    bench->motor[0].qm = 0.9;
    tick(bench);
    assert_close(bench->measured->motor[0].qm, 0.2, 1e-15);
}

TEST_ON(rate_of_a_real_encoder_is_that_of_its_readings, set_up, bench)
{
    bench->joint[0].link_encoder.lsb = 0.01;
    start(bench);
    tick(bench);
    bench->motor[0].q = 0.012;
    bench->motor[0].qd = 12.0;
    tick(bench);
    assert_close(bench->measured->motor[0].qd, 10.0, 1e-9);
}

/* A drive that warms up in the plant has one temperature: the sensor reads that. */
TEST_ON(winding_of_the_plant_is_read_as_it_is, set_up, bench)
{
    bench->joint[0].temperature.offset = 2.0;
    bench->motor[0].winding_c = 55.0;
    bench->motor[0].current_a = 6.0;
    start(bench);
    tick(bench);
    assert_true(bench->measured->motor[0].winding_c == 57.0);
}

/* T - ambient = R I^2 Rth (1 - exp(-t/tau)) */
TEST_ON(winding_heats_with_the_square_of_the_current, set_up, bench)
{
    const struct sensor_thermal thermal = {
        .ambient_c = 25.0, .resistance_ohm = 0.664, .k_per_w = 1.5, .time_constant_s = 20.0};

    bench->joint[0].thermal = thermal;
    bench->motor[0].current_a = bench->motor[1].current_a = 6.0;
    start(bench);
    for (int i = 0; i <= 10000; i++) {
        tick(bench);
        if (i == 0) {
            assert_true(bench->measured->motor[0].winding_c == 25.0);
        }
    }
    assert_close(bench->measured->motor[0].winding_c, 25.0 + 0.664 * 36.0 * 1.5 * (1.0 - exp(-0.5)),
                 1e-9);
    assert_true(bench->measured->motor[1].winding_c == 0.0);
}

TEST_ON(crosstalk_shows_the_same_part_of_full_scale_on_every_other_channel, set_up, bench)
{
    bench->ft[0].crosstalk = 0.01;
    bench->ft[0].force.full_scale = 2000.0;
    bench->ft[0].torque.full_scale = 40.0;
    bench->sense.force_n[2] = 1000.0;
    start(bench);
    tick(bench);
    assert_true(bench->measured->ft[0].force_n[2] == 1000.0);
    for (int i = 0; i < 3; i++) {
        assert_close(fabs(bench->measured->ft[0].torque_nm[i]), 0.2, 1e-12);
    }
    assert_close(fabs(bench->measured->ft[0].force_n[0]), 10.0, 1e-12);
}

TEST_ON(refuses_impossible_errors, set_up, bench)
{
    bench->joint[1].torque.noise_rms = -1.0;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    assert_non_null(strstr(error.text, "knee"));
    bench->joint[1].torque = (struct sensor_error){.latency_ns = 2 * SENSING_LATENCY_MAX_NS};
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->joint[1].torque = (struct sensor_error){.offset = (double)NAN};
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->joint[1].torque = (struct sensor_error){0};
    bench->ft[0].crosstalk = 0.1;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
}

/* ---- faults ---- */

/* Torque of the knee while truth is 1 + the number of the sample; the fault from sample 10 to
 * 20. */
static void record(struct bench *bench, const char *line, double *torque, int count)
{
    arm(bench, (const char *const[]){line, NULL});
    start(bench);
    for (int i = 0; i < count; i++) {
        bench->motor[1].torque_nm = 1.0 + i;
        tick(bench);
        torque[i] = bench->measured->motor[1].torque_nm;
        if (i < 10 || i >= 20) {
            assert_true(torque[i] == 1.0 + i);
        }
    }
}

/* The truth of the samples 10 to 19 is 11 to 20. */
TEST(a_fault_shows_its_own_values)
{
    static const struct {
        const char *line;
        double shown[10];
    } cases[] = {
        {"sensor knee.torque off 0.01..0.02", {0}},
        {"sensor knee.torque stuck 0.01..0.02", {10, 10, 10, 10, 10, 10, 10, 10, 10, 10}},
        {"sensor knee.torque wrong gain=-2 offset=0.5 0.01..0.02",
         {-21.5, -23.5, -25.5, -27.5, -29.5, -31.5, -33.5, -35.5, -37.5, -39.5}},
        {"sensor knee.torque slow 0.004 0.01..0.02", {11, 11, 11, 11, 15, 15, 15, 15, 19, 19}},
        {"sensor knee.torque delayed 0.003 0.01..0.02", {8, 9, 10, 11, 12, 13, 14, 15, 16, 17}},
    };

    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        static struct bench bench;
        double torque[30];

        memset(&bench, 0, sizeof bench);
        set_up(&bench);
        record(&bench, cases[n].line, torque, 30);
        for (int i = 0; i < 10; i++) {
            assert_close(torque[10 + i], cases[n].shown[i], 1e-12);
        }
        tear_down(&bench);
    }
}

TEST_ON(garbage_stays_within_its_amplitude_and_repeats_with_the_seed, set_up, bench)
{
    double torque[30], again[30];

    record(bench, "sensor knee.torque garbage 3 0.01..0.02", torque, 30);
    for (int i = 10; i < 20; i++) {
        assert_true(fabs(torque[i]) <= 3.0 && torque[i] != 1.0 + i);
        assert_true(torque[i] != torque[i - 1]);
    }
    bench->truth.time_ns = 0;
    record(bench, "sensor knee.torque garbage 3 0.01..0.02", again, 30);
    assert_memory_equal(torque, again, sizeof torque);
}

/* Gaps of a mean length of 20 ms that fill half of the time: about 25 gaps a second. */
TEST_ON(intermittent_sensor_is_gone_for_its_share_of_the_time, set_up, bench)
{
    int zero = 0, gaps = 0;
    bool was = false;

    arm(bench, (const char *const[]){"sensor knee.torque intermittent 0.5 dwell=0.02", NULL});
    start(bench);
    bench->motor[1].torque_nm = 1.0;
    for (int i = 0; i < SAMPLES; i++) {
        bool gone;

        tick(bench);
        gone = bench->measured->motor[1].torque_nm == 0.0;
        zero += gone;
        gaps += gone && !was;
        was = gone;
    }
    /* five standard deviations: each gap's length is geometric, of mean and deviation 20 */
    assert_close((double)zero / SAMPLES, 0.5, 0.04);
    assert_close(gaps, 2500.0, 250.0);
}

TEST_ON(fault_of_a_whole_sensor_takes_all_its_channels, set_up, bench)
{
    arm(bench, (const char *const[]){"sensor foot off", "sensor imu.accel_z wrong offset=1", NULL});
    for (int i = 0; i < 3; i++) {
        bench->sense.force_n[i] = bench->sense.torque_nm[i] = 5.0;
        bench->sense.peak_n[i] = bench->sense.peak_nm[i] = 7.0;
    }
    start(bench);
    tick(bench);
    for (int i = 0; i < 3; i++) {
        assert_true(bench->measured->ft[0].force_n[i] == 0.0);
        assert_true(bench->measured->ft[0].peak_n[i] == 0.0);
        assert_true(bench->measured->ft[0].peak_nm[i] == 0.0);
        assert_true(bench->measured->ft[0].torque_nm[i] == 0.0);
        assert_true(bench->measured->imu.accel_m_s2[i] == (i == 2 ? 1.0 : 0.0));
    }
}

TEST_ON(faults_on_one_channel_act_in_their_order, set_up, bench)
{
    arm(bench, (const char *const[]){"sensor knee.torque wrong offset=1",
                                     "sensor knee.torque wrong gain=2", NULL});
    start(bench);
    bench->motor[1].torque_nm = 3.0;
    tick(bench);
    assert_true(bench->measured->motor[1].torque_nm == 8.0);
}
