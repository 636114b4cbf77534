/* SPDX-License-Identifier: Apache-2.0 */
/* What inertial boards derive, against rotations composed from their three angles. */
#include "base/vec3.h"
#include "boards/sensing/inertial.h"
#include "tests/test.h"

static void assert_close(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) {
        fail_msg("found %.12g, expected %.12g within %g", value, expected, tolerance);
    }
}

/* a b, Hamilton's product */
static void multiply(const double a[4], const double b[4], double c[4])
{
    c[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    c[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    c[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    c[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

/* Yaw about z, then pitch about the new y, then roll about the new x. */
static void compose(double roll, double pitch, double yaw, double q[4])
{
    const double x[4] = {cos(roll / 2), sin(roll / 2), 0, 0};
    const double y[4] = {cos(pitch / 2), 0, sin(pitch / 2), 0};
    const double z[4] = {cos(yaw / 2), 0, 0, sin(yaw / 2)};
    double zy[4];

    multiply(z, y, zy);
    multiply(zy, x, q);
}

TEST(angles_of_a_composed_rotation_come_back)
{
    for (double roll = -3.0; roll < 3.1; roll += 0.75) {
        for (double pitch = -1.5; pitch < 1.6; pitch += 0.5) {
            for (double yaw = -3.0; yaw < 3.1; yaw += 0.75) {
                struct imu_sense sense = {.accel_m_s2 = {0.0, 0.0, 0.0}};
                struct inertial_values v;

                compose(roll, pitch, yaw, sense.quaternion);
                inertial_derive(&sense, true, &v);
                assert_true(v.oriented && v.quaternion[0] >= 0.0);
                assert_close(v.euler_rad[0], roll, 1e-12);
                assert_close(v.euler_rad[1], pitch, 1e-12);
                assert_close(v.euler_rad[2], yaw, 1e-12);
                /* Up as the turned sensor sees it */
                assert_close(v.gravity_m_s2[0], -9.81 * sin(pitch), 1e-12);
                assert_close(v.gravity_m_s2[1], 9.81 * cos(pitch) * sin(roll), 1e-12);
                assert_close(v.gravity_m_s2[2], 9.81 * cos(pitch) * cos(roll), 1e-12);
                /* Free fall: the accelerometer reads 0, the sensor accelerates downward */
                assert_close(v.linear_m_s2[2], -v.gravity_m_s2[2], 1e-12);
            }
        }
    }
}

TEST(pitch_of_a_right_angle_gives_angles_that_are_numbers)
{
    struct imu_sense sense = {.accel_m_s2 = {-9.81, 0.0, 0.0}};
    struct inertial_values v;

    compose(0.0, M_PI / 2, 0.0, sense.quaternion);
    inertial_derive(&sense, true, &v);
    assert_close(v.euler_rad[1], M_PI / 2, 1e-7);
    assert_true(isfinite(v.euler_rad[0]) && isfinite(v.euler_rad[2]));
    assert_close(vec3_norm(v.linear_m_s2), 0.0, 1e-12);
}

TEST(without_orientation_all_that_needs_it_is_zero)
{
    static const double none[][4] = {{0, 0, 0, 0}, {NAN, 0, 0, 1}, {INFINITY, 0, 0, 0}};

    for (int i = 0; i < 4; i++) {
        struct imu_sense sense = {.accel_m_s2 = {1.0, 2.0, 3.0}, .quaternion = {1.0}};
        struct inertial_values v;

        if (i < 3) {
            memcpy(sense.quaternion, none[i], sizeof sense.quaternion);
        }
        inertial_derive(&sense, i < 3, &v);
        assert_false(v.oriented);
        assert_close(v.acceleration_m_s2[2], 3.0, 0.0);
        for (int k = 0; k < 3; k++) {
            assert_true(v.euler_rad[k] == 0.0 && v.gravity_m_s2[k] == 0.0);
            assert_true(v.linear_m_s2[k] == 0.0 && v.quaternion[k] == 0.0);
        }
    }
}

TEST(counts_are_cut_at_16_bits)
{
    int64_t counts = 7;
    bool bad = false;

    assert_true(inertial_quantize(9.814, 0.01, &counts, &bad));
    assert_int_equal(counts, 981);
    assert_false(inertial_quantize(-400.0, 0.01, &counts, &bad));
    assert_int_equal(counts, INT16_MIN);
    assert_false(bad);
    inertial_quantize(NAN, 0.01, &counts, &bad);
    assert_true(bad);
    assert_int_equal(counts, INT16_MIN);
}
