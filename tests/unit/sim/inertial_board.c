/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the inertial board on COMAN's pelvis says on its bus, against the plant: held, the gravity
 * of a pelvis that leans as the rig says; falling without a ground, nothing; limp on the ground,
 * where it topples over, every frame the truth to half a count.
 */
#include "sim/simulator.h"

#include "base/vec3.h"
#include "canbus/frame.h"
#include "tests/test.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { TORSO = 0, TRIPLE = 0x593, QUATERNION = 0x594, SENSORS = 16 };

struct listener {
    struct rig rig;
    struct bus_ports ports;
    struct simulator *simulator;
    double value[SENSORS][4]; /* by sensor: m/s2, uT, degree/s, degree, 1 */
    int count[SENSORS];
    double worst[SENSORS]; /* difference from the truth, in counts */
    double fastest;        /* rate that was seen, rad/s */
    double lean;           /* of the pelvis at the end, rad */
};

/* Against the truth, cut at the range of 16 bits. */
static void listener_compare(struct listener *l, int sensor, const double *truth, double worth)
{
    double same = 0.0, opposite = 0.0;
    int n = sensor == 4 ? 4 : 3;

    for (int i = 0; i < n; i++) {
        double cut = fmax(INT16_MIN * worth, fmin(truth[i], INT16_MAX * worth));

        same = fmax(same, fabs(l->value[sensor][i] - cut) / worth);
        opposite = fmax(opposite, fabs(l->value[sensor][i] + cut) / worth);
    }
    l->worst[sensor] = fmax(l->worst[sensor], n == 4 ? fmin(same, opposite) : same);
}

static void listener_read(struct listener *l, const struct bus_frame *frame)
{
    static const double worth[SENSORS] = {0.01, 0.0625, 0.0625, 0.0625, 1.0 / 16384, 0.01, 0.01};
    const struct imu_sense *truth = &simulator_measured(l->simulator)->imu;
    int sensor = frame->id == QUATERNION ? 4 : frame->data[1];
    double wanted[3];

    if (frame->id != TRIPLE && frame->id != QUATERNION) {
        return;
    }
    for (int i = 0; i < (sensor == 4 ? 4 : 3); i++) {
        l->value[sensor][i] =
            get_i16_le(frame->data + 2 * i + (sensor == 4 ? 0 : 2)) * worth[sensor];
    }
    l->count[sensor]++;
    for (int i = 0; i < 3; i++) {
        wanted[i] = sensor == 1 ? truth->magnetic_t[i] * 1e6 : truth->gyro_rad_s[i] * 180.0 / M_PI;
    }
    if (sensor == 0) {
        listener_compare(l, 0, truth->accel_m_s2, worth[0]);
    } else if (sensor == 1 || sensor == 2) {
        listener_compare(l, sensor, wanted, worth[sensor]);
    } else if (sensor == 4) {
        listener_compare(l, 4, truth->quaternion, worth[4]);
    }
    l->fastest = fmax(l->fastest, vec3_norm(truth->gyro_rad_s));
}

static void listener_step(void *context, int64_t now_ns)
{
    static const struct bus_frame start[] = {
        {.id = 0x209, .len = 4, .data = {0x34, 0x7f, 0x80, 1}},
        {.id = 0x209, .len = 2, .data = {0x35, 5}},
    };
    struct listener *l = context;
    struct bus_frame frame;

    if (now_ns == 0) {
        can_send(l->ports.port[TORSO], start, 2);
        return;
    }
    while (can_receive(l->ports.port[TORSO], &frame, 1) == 1) {
        listener_read(l, &frame);
    }
}

static void listen(struct listener *l, bool ground, enum rig_hold hold, uint64_t ticks)
{
    const struct simulator_observer observer = {l, listener_step};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .hold = hold,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = ticks,
                                      .observer = &observer,
                                      .guests = 1,
                                      .row_period_ns = 1000000};
    struct simulator_status status;
    struct realtime_report report;
    const struct rig *rig;
    char notice[256];
    struct arena arena;
    struct error error;

    memset(l, 0, sizeof *l);
    assert_int_equal(arena_init(&arena, (size_t)1 << 30, &error), ERROR_NONE);
    if (rig_load(HIL_SOURCE_DIR "/config/rigs/coman-imu.yaml", &arena, &rig, &error)) {
        fail_msg("%s", error.text);
    }
    l->rig = *rig;
    config.rig = &l->rig;
    if (!ground) {
        l->rig.contact_engine = RIG_CONTACT_NONE;
        l->rig.contact = (struct contact_config){0};
        l->rig.nlisted_pair = 0;
    }
    if (simulator_create(&config, &arena, &l->simulator, notice, &error) ||
        simulator_join(l->simulator, &l->ports, &error) ||
        simulator_start(l->simulator, &report, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(simulator_run(l->simulator), LOOP_END_LENGTH);
    assert_true(simulator_read(l->simulator, &status));
    l->lean = acos(1.0 - 2.0 * (status.base[4] * status.base[4] + status.base[5] * status.base[5]));
    bus_ports_close(&l->ports);
    simulator_destroy(l->simulator);
    arena_fini(&arena);
}

/* The sensor's z is the pelvis's x: with the file's angles its axes x, y, z are the pelvis's y, z,
 * x. A pelvis that leans by a about y sees up as (-sin a, 0, cos a). */
TEST(held_it_reads_gravity)
{
    static struct listener l;
    double lean, s, c;

    listen(&l, true, RIG_HOLD_ENABLED, 3000);
    lean = l.lean;
    s = sin(lean);
    c = cos(lean);
    print_message("# leaning %.4f rad, %.2f %.2f %.2f m/s2\n", lean, l.value[0][0], l.value[0][1],
                  l.value[0][2]);
    assert_true(fabs(lean - 0.2) < 0.02);
    assert_true(fabs(vec3_norm(l.value[0]) - 9.81) < 0.02);
    for (int sensor = 0; sensor <= 6; sensor += 6) {
        assert_true(fabs(l.value[sensor][0]) < 0.02);
        assert_true(fabs(l.value[sensor][1] - 9.81 * c) < 0.02);
        assert_true(fabs(l.value[sensor][2] + 9.81 * s) < 0.02);
    }
    assert_true(vec3_norm(l.value[5]) < 0.03);
    assert_true(vec3_norm(l.value[2]) < 0.1);
    for (int sensor = 0; sensor <= 6; sensor++) {
        assert_int_equal(l.count[sensor], 599);
    }
    assert_int_equal(l.count[15], 599);
}

TEST(in_free_fall_it_reads_nothing)
{
    static struct listener l;

    listen(&l, false, RIG_HOLD_NONE, 300);
    assert_true(vec3_norm(l.value[0]) == 0.0);
    assert_true(vec3_norm(l.value[2]) == 0.0);
    assert_true(fabs(vec3_norm(l.value[5]) - 9.81) < 0.01); /* down */
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(l.value[5][i] + l.value[6][i]) < 1e-9);
    }
}

TEST(a_robot_that_topples_is_followed_to_half_a_count)
{
    static struct listener l;

    listen(&l, true, RIG_HOLD_NONE, 1500);
    print_message("# up to %.2f rad/s, at the end leaning %.2f rad; off by up to %.3f %.3f %.3f "
                  "%.3f counts\n",
                  l.fastest, l.lean, l.worst[0], l.worst[1], l.worst[2], l.worst[4]);
    assert_true(l.fastest > 1.0 && l.lean > 0.5);
    for (int sensor = 0; sensor <= 4; sensor++) {
        assert_true(l.count[sensor] >= 299);
        assert_true(l.worst[sensor] <= 0.5 + 1e-9);
    }
}
