/* SPDX-License-Identifier: Apache-2.0 */
/* Sensors of two joints, a force-torque and an inertial sensor, and the truth before them. */
#ifndef TESTS_UNIT_BOARDS_SENSING_SENSING_BENCH_H
#define TESTS_UNIT_BOARDS_SENSING_SENSING_BENCH_H

#include "boards/sensing/sensing.h"
#include "tests/test.h"

enum { JOINTS = 2, FTS = 1, TICK_NS = 1000000, SAMPLES = 100000 };

struct bench {
    struct arena arena;
    struct sensor_joint joint[JOINTS];
    struct sensor_ft ft[FTS];
    struct sensing_config config;
    struct sensing *sensing;
    struct faults *faults;
    struct plant_sensors truth;
    struct motor_sense motor[JOINTS];
    struct ft_sense sense;
    const struct plant_sensors *measured;
};

static inline void assert_close(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) {
        fail_msg("found %.12g, expected %.12g within %g", value, expected, tolerance);
    }
}

static inline void set_up(struct bench *bench)
{
    struct error error;

    assert_ok(arena_init(&bench->arena, 8 << 20, &error));
    bench->joint[0].name = "hip";
    bench->joint[1].name = "knee";
    bench->ft[0].name = "foot";
    bench->config = (struct sensing_config){.njoint = JOINTS,
                                            .nft = FTS,
                                            .joint = bench->joint,
                                            .ft = bench->ft,
                                            .tick_ns = TICK_NS,
                                            .seed = 1};
    bench->truth = (struct plant_sensors){
        .supply_v = 48.0, .njoint = JOINTS, .nft = FTS, .motor = bench->motor, .ft = &bench->sense};
}

static inline void tear_down(struct bench *bench)
{
    arena_fini(&bench->arena);
}

BENCH(set_up, struct bench, tear_down)

static inline void start(struct bench *bench)
{
    struct error error;

    assert_no_error(sensing_create(&bench->config, &bench->arena, &bench->sensing, &error),
                    error.text);
}

static inline void tick(struct bench *bench)
{
    if (bench->faults) {
        faults_step(bench->faults, bench->truth.time_ns);
    }
    bench->measured = sensing_sample(bench->sensing, bench->truth.time_ns, &bench->truth);
    bench->truth.time_ns += TICK_NS;
}

#endif
