/* SPDX-License-Identifier: Apache-2.0 */
/* Attitude filter of the inertial sensor against closed forms of its errors, and the axes of gyro
 * and accelerometer that are turned. */
#include "tests/unit/boards/sensing/sensing_bench.h"

#include "base/vec3.h"

static const double pi = 3.14159265358979323846, g = 9.81;

/* Puts the sensor at rest in an attitude R, sensor to world, in a field 61 degrees down. */
static void rest(struct bench *bench, const double R[9])
{
    const double up[3] = {0.0, 0.0, g}, field[3] = {22.8e-6, 0.0, -41.1e-6};
    struct imu_sense *imu = &bench->truth.imu;

    *imu = (struct imu_sense){0};
    mat3_apply_transposed(R, up, imu->accel_m_s2);
    mat3_apply_transposed(R, field, imu->magnetic_t);
    quaternion_from_mat3(R, imu->quaternion);
}

/* Returns the pitch that the sensor tells, about its y axis, turned by the heading. */
static double pitch_of(const double q[4])
{
    return asin(2.0 * (q[0] * q[2] - q[3] * q[1]));
}

static double yaw_of(const double q[4])
{
    return atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
}

TEST_ON(at_rest_it_tells_the_attitude, set_up, bench)
{
    const double rpy[][3] = {
        {0, 0, 0}, {0.3, -0.4, 2.5}, {1.5707963, 0, 1.5707963}, {3.0, 1.2, -3}};

    for (size_t i = 0; i < sizeof rpy / sizeof *rpy; i++) {
        double R[9];

        bench->config.imu.ahrs = (struct ahrs_config){true, 1.0, 1.0, 0.1};
        mat3_from_rpy(rpy[i], R);
        rest(bench, R);
        start(bench);
        for (int k = 0; k < 500; k++) {
            double same = 0.0;

            tick(bench);
            for (int c = 0; c < 4; c++) {
                same += bench->measured->imu.quaternion[c] * bench->truth.imu.quaternion[c];
            }
            assert_close(fabs(same), 1.0, 1e-14);
        }
    }
}

/* Level, accelerated by a along x from the second sample on: it pitches toward
 * -atan(a / g) = p with tan((p - pitch) / 2) = tan(p / 2) exp(-kp t), one step of 1 ms behind. */
TEST_ON(steady_acceleration_tilts_it_as_the_closed_form, set_up, bench)
{
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, kp = 0.5, a = 3.0, p = -atan(a / g);

    bench->config.imu.ahrs = (struct ahrs_config){.on = true, .accel_per_s = kp};
    rest(bench, R);
    start(bench);
    tick(bench);
    bench->truth.imu.accel_m_s2[0] = a;
    for (int i = 1; i <= 20000; i++) {
        double left;

        tick(bench);
        left = 2.0 * atan(tan(0.5 * p) * exp(-kp * i * 1e-3));
        /* Explicit steps: an error of the order kp dt / 2 of the way */
        assert_close(pitch_of(bench->measured->imu.quaternion), p - left, 3e-4 * fabs(p));
    }
    assert_close(pitch_of(bench->measured->imu.quaternion), p, 2e-5);
}

/* Swaying at 1 Hz, a sine of the acceleration, it errs by atan(A / g) through a low pass of the
 * first order, kp / sqrt(kp^2 + w^2). */
TEST_ON(swaying_tilts_it_through_a_low_pass, set_up, bench)
{
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, kp = 1.0, A = 0.3, w = 2.0 * pi;
    double in_phase = 0.0, quadrature = 0.0;

    bench->config.imu.ahrs = (struct ahrs_config){.on = true, .accel_per_s = kp};
    rest(bench, R);
    start(bench);
    for (int i = 0; i < 20000; i++) {
        double phase = w * i * 1e-3, pitch;

        bench->truth.imu.accel_m_s2[0] = A * sin(phase);
        tick(bench);
        pitch = pitch_of(bench->measured->imu.quaternion);
        in_phase += i >= 10000 ? 2e-4 * pitch * sin(phase) : 0.0;
        quadrature += i >= 10000 ? 2e-4 * pitch * cos(phase) : 0.0;
    }
    assert_close(hypot(in_phase, quadrature), A / g * kp / hypot(kp, w), 1e-3 * A / g);
}

/* A gyro's bias of b tilts it by asin(b / kp), and not at all once it is estimated; the heading by
 * asin(b / km). */
TEST_ON(bias_of_the_gyro_tilts_and_turns_it, set_up, bench)
{
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, b = 0.02;

    for (int estimated = 0; estimated < 2; estimated++) {
        bench->config.imu.gyro.offset = b;
        bench->config.imu.ahrs = (struct ahrs_config){true, 0.5, 0.25, estimated ? 0.05 : 0.0};
        rest(bench, R);
        bench->truth.imu.magnetic_t[2] = 0.0; /* level: tilts do not turn it */
        start(bench);
        for (int i = 0; i < 120000; i++) {
            tick(bench);
        }
        if (estimated) {
            assert_close(pitch_of(bench->measured->imu.quaternion), 0.0, 1e-4);
            assert_close(yaw_of(bench->measured->imu.quaternion), 0.0, 1e-4);
        } else {
            /* Both tilts at once: each a little less than alone */
            assert_close(pitch_of(bench->measured->imu.quaternion), asin(b / 0.5), 4e-3);
            assert_close(yaw_of(bench->measured->imu.quaternion), asin(b / 0.25), 4e-3);
        }
    }
}

/* In a field with a dip of d a tilt of e about north, which nothing corrects, is taken for a
 * heading of e tan(d). */
TEST_ON(tilt_leaks_into_the_heading_by_the_dip, set_up, bench)
{
    const double level[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e = 0.002;
    double R[9];

    bench->config.imu.ahrs = (struct ahrs_config){.on = true, .magnetic_per_s = 2.0};
    rest(bench, level);
    start(bench);
    tick(bench);
    mat3_from_rpy((const double[3]){e, 0, 0}, R); /* it rolls, and no gyro tells */
    rest(bench, R);
    for (int i = 0; i < 20000; i++) {
        tick(bench);
    }
    assert_close(yaw_of(bench->measured->imu.quaternion), e * 41.1 / 22.8, 0.01 * e);
}

/* Turning about the vertical by a turn and a half without any correction: the integral of a
 * constant rate is exact. */
TEST_ON(integrates_the_rate, set_up, bench)
{
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, rate = 3.0;

    bench->config.imu.ahrs = (struct ahrs_config){.on = true};
    rest(bench, R);
    bench->truth.imu.gyro_rad_s[2] = rate;
    start(bench);
    tick(bench);
    for (int i = 1; i <= 3000; i++) {
        double turned = rate * i * 1e-3;
        const double *q;

        tick(bench);
        q = bench->measured->imu.quaternion;
        assert_close(fabs(q[0] * cos(turned / 2) + q[3] * sin(turned / 2)), 1.0, 1e-12);
    }
}

/* Axes that are turned by a small vector r show x - r x x. */
TEST_ON(misaligned_axes_are_turned, set_up, bench)
{
    const double gyro[3] = {0.004, -0.003, 0.002}, accel[3] = {-0.001, 0.005, 0.003};
    const double rate[3] = {1.0, 2.0, -0.5}, force[3] = {0.4, -0.2, g};
    double shown[3];

    memcpy(bench->config.imu.gyro_misalignment_rad, gyro, sizeof gyro);
    memcpy(bench->config.imu.accel_misalignment_rad, accel, sizeof accel);
    memcpy(bench->truth.imu.gyro_rad_s, rate, sizeof rate);
    memcpy(bench->truth.imu.accel_m_s2, force, sizeof force);
    start(bench);
    tick(bench);
    for (int i = 0; i < 2; i++) {
        const double *truth = i ? force : rate,
                     *seen = i ? bench->measured->imu.accel_m_s2 : bench->measured->imu.gyro_rad_s;

        vec3_cross(i ? accel : gyro, truth, shown);
        for (int k = 0; k < 3; k++) {
            assert_close(seen[k], truth[k] - shown[k], 2e-5 * vec3_norm(truth));
        }
        assert_close(vec3_norm(seen), vec3_norm(truth), 1e-12);
        assert_true(seen[0] != truth[0]);
    }
}

TEST_ON(without_field_and_force_nothing_is_corrected, set_up, bench)
{
    bench->config.imu.ahrs = (struct ahrs_config){true, 1.0, 1.0, 0.1};
    bench->truth.imu.quaternion[0] = 1.0;
    start(bench);
    for (int i = 0; i < 10; i++) {
        tick(bench);
        assert_true(bench->measured->imu.quaternion[0] == 1.0);
    }
}

/* What a fault makes of gyro, accelerometer or field is no end of the attitude. */
TEST_ON(readings_beyond_all_numbers_are_left_out, set_up, bench)
{
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    double *const reading[] = {bench->truth.imu.gyro_rad_s, bench->truth.imu.accel_m_s2,
                               bench->truth.imu.magnetic_t};

    bench->config.imu.ahrs = (struct ahrs_config){true, 1.0, 1.0, 0.1};
    rest(bench, R);
    start(bench);
    tick(bench);
    for (size_t i = 0; i < sizeof reading / sizeof *reading; i++) {
        double kept = reading[i][1];

        reading[i][1] = 1e300;
        tick(bench);
        reading[i][1] = kept;
        for (int k = 0; k < 5; k++) {
            tick(bench);
        }
        assert_close(bench->measured->imu.quaternion[0], 1.0, 1e-12);
    }
}

TEST_ON(refuses_impossible_filters, set_up, bench)
{
    struct error error;

    bench->config.imu.ahrs = (struct ahrs_config){.on = true, .accel_per_s = -1.0};
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
    bench->config.imu.ahrs.accel_per_s = 0.0;
    bench->config.imu.gyro_misalignment_rad[1] = (double)NAN;
    assert_int_equal(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                     ERROR_INPUT);
}
