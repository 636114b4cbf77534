/* SPDX-License-Identifier: Apache-2.0 */
/* Dynamic errors of a channel: low pass, hysteresis, instability, temperature, sampling instants,
 * each against its closed form. */
#include "tests/unit/boards/sensing/sensing_bench.h"

static struct error error;

static const double pi = 3.14159265358979323846;

/* Returns the gain and the lag (rad) of the knee's torque for a sine of f_hz, by correlation over
 * whole periods behind the transient. */
static double response(struct bench *bench, double f_hz, double *lag_rad)
{
    const int settle = 2000, count = 10000;
    double in_phase = 0.0, quadrature = 0.0;

    start(bench);
    for (int i = 0; i < settle + count; i++) {
        double phase = 2.0 * pi * f_hz * i * 1e-3;

        bench->motor[1].torque_nm = sin(phase);
        tick(bench);
        if (i >= settle) {
            in_phase += bench->measured->motor[1].torque_nm * sin(phase);
            quadrature += bench->measured->motor[1].torque_nm * cos(phase);
        }
    }
    *lag_rad = -atan2(quadrature, in_phase);
    return 2.0 * hypot(in_phase, quadrature) / count;
}

/* The bilinear transform maps f to tan(pi f T), the corner to itself: a gain of
 * 1 / sqrt(1 + r^4) and a lag of atan2(sqrt(2) r, 1 - r^2), r = tan(pi f T) / tan(pi fc T). */
TEST_ON(low_pass_has_the_response_of_a_butterworth, set_up, bench)
{
    const double frequency[] = {1.0, 20.0, 80.0, 100.0, 250.0, 400.0};

    bench->joint[1].torque.bandwidth_hz = 80.0;
    for (size_t i = 0; i < sizeof frequency / sizeof *frequency; i++) {
        double r = tan(pi * frequency[i] * 1e-3) / tan(pi * 80.0 * 1e-3), lag;

        assert_close(response(bench, frequency[i], &lag), 1.0 / sqrt(1.0 + pow(r, 4)), 1e-9);
        assert_close(lag, atan2(sqrt(2.0) * r, 1.0 - r * r), 1e-6);
    }
}

TEST_ON(low_pass_starts_settled, set_up, bench)
{
    bench->joint[1].torque.bandwidth_hz = 5.0;
    bench->motor[1].torque_nm = 30.0;
    start(bench);
    for (int i = 0; i < 1000; i++) {
        tick(bench);
        assert_close(bench->measured->motor[1].torque_nm, 30.0, 1e-10);
    }
}

/* Six plays of half widths r = F/2, F/4 ... F/64, each of the weight w = h / (2 - 1/32): once
 * around the amplitude A their loops have the area sum 4 w r (A - r), r < A, and in the middle the
 * branches are sum 2 w min(r, A - r) apart. */
TEST_ON(hysteresis_encloses_the_area_of_its_plays, set_up, bench)
{
    const double scale = 80.0, h = 0.01, weight = h / (2.0 - 1.0 / 32.0);
    const double amplitude[] = {80.0, 20.0, 2.0, 1.2};
    const int quarter = 4000;

    bench->joint[1].torque = (struct sensor_error){.hysteresis = h, .full_scale = scale};
    for (size_t k = 0; k < sizeof amplitude / sizeof *amplitude; k++) {
        double A = amplitude[k], area = 0.0, expected = 0.0, apart = 0.0, middle = 0.0;
        double last_x = 0.0, last_y = 0.0;

        for (double r = scale / 2; r > scale / 100; r /= 2) {
            expected += r < A ? 4.0 * weight * r * (A - r) : 0.0;
            middle += r < A ? 2.0 * weight * fmin(r, A - r) : 0.0;
        }
        start(bench);
        for (int i = 0; i <= 9 * quarter; i++) { /* a triangle; the second time around counts */
            int at = i % (4 * quarter);
            double x = A *
                       (at <= quarter       ? at
                        : at <= 3 * quarter ? 2 * quarter - at
                                            : at - 4 * quarter) /
                       quarter;
            double y;

            bench->motor[1].torque_nm = x;
            tick(bench);
            y = bench->measured->motor[1].torque_nm;
            area += i > 5 * quarter ? 0.5 * (y + last_y) * (x - last_x) : 0.0;
            apart += i == 6 * quarter ? y : i == 8 * quarter ? -y : 0.0;
            last_x = x;
            last_y = y;
        }
        assert_close(-area, expected, 1e-6 * scale * scale);
        assert_close(apart, middle, 1e-9 * scale);
        if (A == scale) {
            assert_close(apart, h * scale, 1e-9 * scale);
        }
    }
}

/* Rate-independent, and gone where nothing is hysteretic: below the narrowest play a line. */
TEST_ON(small_loops_have_no_hysteresis, set_up, bench)
{
    const double slope = 1.0 - 6.0 * 0.01 / (2.0 - 1.0 / 32.0);

    bench->joint[1].torque = (struct sensor_error){.hysteresis = 0.01, .full_scale = 64.0};
    start(bench);
    for (int i = 0; i < 1000; i++) {
        bench->motor[1].torque_nm = 0.99 * sin(0.1 * i);
        tick(bench);
        assert_close(bench->measured->motor[1].torque_nm, slope * bench->motor[1].torque_nm, 1e-12);
    }
}

/* A Gauss-Markov process of rms s and correlation time T has the autocovariance
 * s^2 exp(-|t| / T) from the start: over an ensemble, at the first sample and at three lags. The
 * product of two Gaussian numbers of correlation c deviates by sqrt(1 + c^2). */
TEST_ON(instability_has_its_rms_and_correlation, set_up, bench)
{
    enum { LAGS = 4 };
    const double s = 2e-3, T = 0.05;
    const int lag[LAGS] = {0, 10, 50, 150}, rounds = 1500;
    double product[LAGS] = {0.0}, n = 0.0;

    bench->config.imu.gyro = bench->config.imu.accel =
        (struct sensor_error){.instability_rms = s, .instability_s = T};
    for (int round = 0; round < rounds; round++) {
        double first[6] = {0.0};

        bench->config.seed = (uint64_t)round + 1;
        arena_fini(&bench->arena);
        assert_ok(arena_init(&bench->arena, 1 << 20, &error));
        start(bench);
        for (int i = 0, k = 0; i <= lag[LAGS - 1]; i++) {
            tick(bench);
            for (int c = 0; c < 6 && i == lag[k]; c++) {
                double x = c < 3 ? bench->measured->imu.gyro_rad_s[c]
                                 : bench->measured->imu.accel_m_s2[c - 3];

                first[c] = i == 0 ? x : first[c];
                product[k] += first[c] * x / (s * s);
            }
            k += i == lag[k];
        }
        n += 6.0;
    }
    for (int k = 0; k < LAGS; k++) {
        double c = exp(-lag[k] * 1e-3 / T);

        assert_close(product[k] / n, c, 5.0 * sqrt((1.0 + c * c) / n));
    }
}

/* Offset and gain follow rise_k (1 - exp(-t / tau)). */
TEST_ON(warming_moves_offset_and_gain, set_up, bench)
{
    bench->ft[0].force = (struct sensor_error){.offset_per_k = 0.3, .gain_per_k = 1e-3};
    bench->ft[0].warm_up = (struct sensor_warm_up){.rise_k = 12.0, .time_constant_s = 4.0};
    bench->sense.force_n[2] = 250.0;
    start(bench);
    for (int i = 0; i <= 8000; i++) {
        double warm = 12.0 * (1.0 - exp(-i * 1e-3 / 4.0));

        tick(bench);
        assert_close(bench->measured->ft[0].force_n[2], 250.0 * (1.0 + 1e-3 * warm) + 0.3 * warm,
                     1e-9);
        assert_true(bench->measured->ft[0].torque_nm[2] == 0.0);
    }
}

/* Of x = t a board that samples every P shows its last instant: readings are whole multiples of P
 * apart, never newer than now, never older than P, the same on all channels of the board. */
TEST_ON(boards_sample_by_clocks_of_their_own, set_up, bench)
{
    const double ppm = 200.0, rate[] = {1.0, 1.0};
    double period[2] = {0.0}, last[2] = {0.0}, least[2] = {1.0, 1.0}, most[2] = {0.0};
    int samples[2] = {0};

    bench->config.clocks = (struct sensor_clocks){.period_ns = 2500000, .drift_ppm = ppm};
    bench->joint[0].clock = 1;
    bench->joint[1].clock = 2;
    start(bench);
    for (int i = 0; i <= SAMPLES; i++) {
        double now = i * 1e-3;

        for (int j = 0; j < 2; j++) {
            bench->motor[j].q = bench->motor[j].torque_nm = rate[j] * now;
        }
        tick(bench);
        for (int j = 0; j < 2 && i >= 10; j++) {
            double shown = bench->measured->motor[j].torque_nm, step = shown - last[j];

            assert_true(bench->measured->motor[j].q == shown);
            least[j] = fmin(least[j], now - shown);
            most[j] = fmax(most[j], now - shown);
            if (i > 10 && step > 1e-4) {
                samples[j]++;
                period[j] += step;
                assert_close(step, 2.5e-3, 2.5e-3 * ppm * 1e-6 + 3e-9);
            } else if (i > 10) {
                assert_close(step, 0.0, 3e-9); /* stands still between two samples */
            }
            last[j] = shown;
        }
    }
    for (int j = 0; j < 2; j++) {
        assert_true(least[j] > -3e-9 && least[j] < 1e-5);
        assert_close(most[j], 2.5e-3, 1e-5);
        assert_close(period[j] / samples[j], 2.5e-3, 2.5e-3 * ppm * 1e-6);
    }
    /* Two clocks drift apart */
    assert_true(fabs(period[0] / samples[0] - period[1] / samples[1]) > 1e-9);
}

/* What is drawn for a clock goes by its name, whatever boards come before it. */
TEST_ON(clocks_are_drawn_by_their_names, set_up, bench)
{
    static const char *const names[][2] = {{"left/0x01", "left/0x02"}, {"left/0x02", "right/0x01"}};
    double shown[2][2];

    bench->joint[1].clock = 1;
    for (int order = 0; order < 2; order++) {
        bench->config.clocks =
            (struct sensor_clocks){.period_ns = 2500000, .drift_ppm = 100.0, .name = names[order]};
        bench->truth.time_ns = 0;
        start(bench);
        for (int i = 0; i < 100; i++) {
            bench->motor[0].q = bench->motor[1].q = 1e-3 * i;
            tick(bench);
        }
        for (int j = 0; j < 2; j++) {
            shown[order][j] = bench->measured->motor[j].q;
        }
    }
    assert_true(shown[0][1] == shown[1][0]);
    assert_true(shown[0][0] != shown[1][0] && shown[0][1] != shown[1][1]);
}

/* The error of an eccentric ring over a turn is a sine once and one twice a turn, and 0 at 0. */
TEST_ON(eccentric_encoder_errs_once_and_twice_a_turn, set_up, bench)
{
    enum { TURN = 360, PARTS = 4 };
    double cosine[PARTS] = {0.0}, sine[PARTS] = {0.0}, square = 0.0, at_zero = 0.0;

    bench->joint[0].eccentricity_rad[0] = 0.006;
    bench->joint[0].eccentricity_rad[1] = 0.003;
    start(bench);
    for (int i = 0; i < TURN; i++) {
        double q = 2.0 * pi * i / TURN, e;

        bench->motor[0].q = bench->motor[1].q = q;
        tick(bench);
        e = bench->measured->motor[0].q - q;
        at_zero = i == 0 ? e : at_zero;
        for (int k = 0; k < PARTS; k++) {
            cosine[k] += 2.0 / TURN * e * cos(k * q);
            sine[k] += 2.0 / TURN * e * sin(k * q);
        }
        square += e * e / TURN;
        assert_true(bench->measured->motor[1].q == q);
    }
    assert_true(at_zero == 0.0);
    assert_close(hypot(cosine[1], sine[1]), 0.006, 1e-12);
    assert_close(hypot(cosine[2], sine[2]), 0.003, 1e-12);
    assert_close(hypot(cosine[3], sine[3]), 0.0, 1e-12);
    /* Nothing but these and the constant that zero takes out: Parseval */
    assert_close(square, 0.25 * cosine[0] * cosine[0] + 0.5 * (0.006 * 0.006 + 0.003 * 0.003),
                 1e-12);
}

/* A part of each of the moments across the axis, with a sign for each that stays. */
TEST_ON(torque_shows_a_part_of_what_bends_its_sensor, set_up, bench)
{
    double part[2];

    bench->joint[0].crosstalk = 0.02;
    assert_true(sensing_sees_bending(&bench->config));
    start(bench);
    for (int k = 0; k < 2; k++) {
        bench->motor[0].torque_nm = bench->motor[1].torque_nm = 5.0;
        bench->motor[0].bending_nm[k] = bench->motor[1].bending_nm[k] = 50.0;
        tick(bench);
        part[k] = bench->measured->motor[0].torque_nm - 5.0;
        assert_close(fabs(part[k]), 1.0, 1e-12);
        assert_true(bench->measured->motor[1].torque_nm == 5.0);
        bench->motor[0].bending_nm[k] = bench->motor[1].bending_nm[k] = 0.0;
    }
    bench->motor[0].bending_nm[0] = 50.0;
    bench->motor[0].bending_nm[1] = 25.0;
    tick(bench);
    assert_close(bench->measured->motor[0].torque_nm, 5.0 + part[0] + 0.5 * part[1], 1e-12);
    bench->joint[0].crosstalk = 0.0;
    assert_false(sensing_sees_bending(&bench->config));
}

TEST_ON(refuses_what_no_channel_can_do, set_up, bench)
{
    const struct sensor_error wrong[] = {{.bandwidth_hz = 500.0},
                                         {.bandwidth_hz = -1.0},
                                         {.hysteresis = 0.01},
                                         {.instability_rms = 0.1},
                                         {.instability_rms = 0.1, .instability_s = (double)NAN},
                                         {.gain_per_k = (double)INFINITY}};

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        bench->joint[0].torque = wrong[i];
        assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                         ERROR_INPUT);
    }
    bench->joint[0].torque = (struct sensor_error){0};
    bench->joint[0].warm_up.rise_k = 1.0;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->joint[0].warm_up.rise_k = 0.0;
    bench->joint[0].eccentricity_rad[1] = -1e-3;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->joint[0].eccentricity_rad[1] = 0.0;
    bench->joint[0].crosstalk = -1e-3;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->joint[0].crosstalk = 0.0;
    bench->config.clocks.drift_ppm = 1e9;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
}
