/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a simulator tells others once a tick: the rows of signals by their names, with three free
 * bodies that fly in different poses, and the status, of which each counter has its own value.
 */
#include "sim/simulator_private.h"

#include "tests/rig_run.h"

enum { TICKS = 40, BODIES = 3 };

#define TICK_S 1e-3
#define GRAVITY 9.81

struct bench {
    struct arena arena;
    struct rig rig;
    struct plant_free_body body[BODIES];
    struct simulator_config config;
    struct simulator *simulator;
};

/* COMAN, held, and three bodies that fall without touching anything: the second turns about its x,
 * the third keeps an attitude of its own. */
static inline void open_bench(struct bench *bench)
{
    static const char *const names[BODIES] = {"ball", "crate", "plank"};

    rig_run_load("coman", &bench->arena, &bench->rig);
    for (int i = 0; i < BODIES; i++) {
        bench->body[i] = (struct plant_free_body){
            .name = names[i],
            .inertia = {.mass = 1.0 + i, .I = {1.0, 0.0, 0.0, 2.0, 0.0, 3.0}},
            .position = {3.0 + i, -2.0 * i, 5.0 + 0.5 * i},
            .quaternion = {1.0},
            .v = {0.5 * i, 1.0 - i, 2.0 * i},
        };
    }
    bench->body[1].w[0] = 4.0;
    memcpy(bench->body[2].quaternion, (double[]){0.5, -0.5, 0.5, 0.5}, 4 * sizeof(double));
    bench->rig.free = bench->body;
    bench->rig.nfree = BODIES;
    bench->config = (struct simulator_config){.rig = &bench->rig,
                                              .clock = LOOP_CLOCK_FREE,
                                              .requests = true,
                                              .hold = RIG_HOLD_ALWAYS,
                                              .transport = TRANSPORT_LOCAL,
                                              .ticks = TICKS,
                                              .row_period_ns = bench->rig.tick_ns};
    bench->simulator = rig_run_open(&bench->config, &bench->arena, NULL);
    stream_want(simulator_parts(bench->simulator).stream, 1);
    assert_int_equal(simulator_run(bench->simulator), LOOP_END_LENGTH);
}

static inline void close_bench(struct bench *bench)
{
    rig_run_close(bench->simulator, &bench->arena, NULL);
}

/* The value of a signal, its name in two parts. */
static double value_named(const struct bench *bench, const struct stream_row *row,
                          const char *first, const char *second)
{
    char name[128];

    snprintf(name, sizeof name, "%s%s", first, second);
    for (size_t i = 0; i < simulator_parts(bench->simulator).nsignal; i++) {
        if (strcmp(simulator_parts(bench->simulator).signal[i], name) == 0) {
            return row->value[i];
        }
    }
    fail_msg("no signal %s", name);
    return 0.0;
}

/* Where a body is after t seconds of free fall with its rate about x alone. */
static void body_pose(const struct plant_free_body *body, double t, double pose[7])
{
    const double *q = body->quaternion, half = 0.5 * body->w[0] * t;

    for (int k = 0; k < 3; k++) {
        pose[k] = body->position[k] + body->v[k] * t - (k == 2 ? 0.5 * GRAVITY * t * t : 0.0);
    }
    pose[3] = cos(half) * q[0] - sin(half) * q[1];
    pose[4] = cos(half) * q[1] + sin(half) * q[0];
    pose[5] = q[2];
    pose[6] = q[3];
}

BENCH(open_bench, struct bench, close_bench)

TEST_ON(rows_have_every_body_in_its_columns, open_bench, bench)
{
    static const char *const columns[7] = {"_x_m", "_y_m", "_z_m", "_qw", "_qx", "_qy", "_qz"};
    struct stream *stream = simulator_parts(bench->simulator).stream;
    const struct stream_row *row;
    int rows = 0;

    for (; (row = stream_front(stream)) != NULL; rows++, stream_drop(stream)) {
        const double t = (double)row->time_ns * 1e-9;

        assert_int_equal(row->tick, rows + 1);
        assert_true(fabs(t - (rows + 1) * TICK_S) < 1e-12);
        for (int i = 0; i < BODIES; i++) {
            double pose[7];

            body_pose(&bench->body[i], t, pose);
            for (int k = 0; k < 7; k++) {
                const double value = value_named(bench, row, bench->body[i].name, columns[k]);

                if (fabs(value - pose[k]) > 1e-4) {
                    fail_msg("%s%s at %g s: %.6f, not %.6f", bench->body[i].name, columns[k], t,
                             value, pose[k]);
                }
            }
        }
    }
    assert_int_equal(rows, TICKS);
}

TEST_ON(rows_have_joints_base_and_buses_in_their_columns, open_bench, bench)
{
    static const char *const base[7] = {"base_x_m", "base_y_m", "base_z_m", "base_qw",
                                        "base_qx",  "base_qy",  "base_qz"};
    const struct plant_sensors *sensors = plant_sensors(simulator_plant(bench->simulator));
    const struct stream_row *row = NULL;
    struct simulator_status status;

    for (int i = 0; i < TICKS; i++) {
        row = stream_front(simulator_parts(bench->simulator).stream);
        assert_non_null(row);
        if (i + 1 < TICKS) {
            stream_drop(simulator_parts(bench->simulator).stream);
        }
    }
    assert_true(simulator_read(bench->simulator, &status));
    for (size_t j = 0; j < bench->rig.robot->njoint; j++) {
        const struct motor_sense *motor = &sensors->motor[j];
        char name[96];

        assert_true(status.q[j] == motor->q);
        snprintf(name, sizeof name, "%s_rad", bench->rig.robot->joint[j].name);
        assert_true(value_named(bench, row, "q_", name) == motor->q);
        assert_true(value_named(bench, row, "qm_", name) == motor->qm);
        snprintf(name, sizeof name, "%s_nm", bench->rig.robot->joint[j].name);
        assert_true(value_named(bench, row, "torque_", name) == motor->torque_nm);
    }
    for (int k = 0; k < 7; k++) {
        assert_true(value_named(bench, row, base[k], "") == status.base[k]);
    }
    for (size_t b = 0; b < bench->rig.nbus; b++) {
        const struct can_counters *counters = &simulator_port(bench->simulator, b)->counters;
        char name[96];

        snprintf(name, sizeof name, "%s_frames", bench->rig.bus[b].name);
        assert_true(value_named(bench, row, "rx_", name) == (double)counters->rx_frames);
        assert_true(value_named(bench, row, "tx_", name) == (double)counters->tx_frames);
    }
}

/* Every counter has a value of its own, so that none can stand for another. */
TEST_ON(the_status_has_every_counter_in_its_field, open_bench, bench)
{
    const struct loop_stats *ran = simulator_stats(bench->simulator);
    struct simulator_status status;
    struct loop_stats stats = *ran;

    stats.ticks = 101;
    stats.overrun_total = 102;
    stats.late_ticks = 103;
    stats.lost_ticks = 104;
    stats.pauses = 105;
    stats.pause_ticks = 106;
    stats.events_lost = 107;
    stats.page_faults = 108;
    stats.start_ns = ran->start_ns - 109;
    stats.lockstep = (struct lockstep_counters){
        .steps = 110, .mismatches = 111, .malformed = 112, .silences = 113};
    for (size_t p = 0; p < PHASE_COUNT; p++) {
        stats.overruns[p] = 120 + p;
    }
    simulator_publish(bench->simulator, 114, &stats);
    assert_true(simulator_read(bench->simulator, &status));
    assert_int_equal(status.tick, 101);
    assert_int_equal(status.overruns, 102);
    assert_int_equal(status.late_ticks, 103);
    assert_int_equal(status.lost_ticks, 104);
    assert_int_equal(status.pauses, 105);
    assert_int_equal(status.pause_ticks, 106);
    assert_int_equal(status.events_lost, 107);
    assert_int_equal(status.start_ns, ran->start_ns - 109);
    assert_true(status.elapsed_ns >= 109);
    assert_int_equal(status.time_ns, 114);
    assert_int_equal(status.lockstep.steps, 110);
    assert_int_equal(status.lockstep.mismatches, 111);
    assert_int_equal(status.lockstep.malformed, 112);
    assert_int_equal(status.lockstep.silences, 113);
    for (size_t p = 0; p < PHASE_COUNT; p++) {
        assert_int_equal(status.overruns_by[p], 120 + p);
    }
}

/* The same of what comes from elsewhere: buses, contact, clamp, faults, free bodies. */
TEST_ON(the_status_has_the_buses_and_bodies_in_their_places, open_bench, bench)
{
    const struct loop_stats *stats = simulator_stats(bench->simulator);
    struct simulator_status status;

    for (size_t b = 0; b < bench->rig.nbus; b++) {
        struct can_port *port = simulator_port(bench->simulator, b);

        port->counters.rx_frames = 100 * b + 1;
        port->counters.tx_frames = 100 * b + 2;
        port->counters.rx_dropped = 100 * b + 3;
        port->counters.tx_dropped = 100 * b + 4;
        port->state = b % 2 ? CAN_PORT_STUCK : CAN_PORT_BUS_OFF;
    }
    simulator_publish(bench->simulator, stats->time_ns, stats);
    assert_true(simulator_read(bench->simulator, &status));
    for (size_t b = 0; b < bench->rig.nbus; b++) {
        assert_int_equal(status.bus[b].rx_frames, 100 * b + 1);
        assert_int_equal(status.bus[b].tx_frames, 100 * b + 2);
        assert_int_equal(status.bus[b].rx_dropped, 100 * b + 3);
        assert_int_equal(status.bus[b].tx_dropped, 100 * b + 4);
        assert_int_equal(status.bus[b].state, b % 2 ? CAN_PORT_STUCK : CAN_PORT_BUS_OFF);
    }
    assert_int_equal(status.clamped, 1);
    for (size_t i = 0; i < BODIES; i++) {
        double pose[7];

        body_pose(&bench->body[i], TICKS * TICK_S, pose);
        for (int k = 0; k < 7; k++) {
            assert_true(fabs(status.free[i][k] - pose[k]) < 1e-4);
        }
    }
}
