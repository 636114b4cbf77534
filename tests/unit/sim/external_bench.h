/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig whose first board of the second bus is a real one, which the test plays: a simulator and a
 * guest on its buses, asked before each tick. Frames are written by the protocols' pages.
 */
#ifndef TESTS_UNIT_SIM_EXTERNAL_BENCH_H
#define TESTS_UNIT_SIM_EXTERNAL_BENCH_H

#include "boards/foc/protocol.h"
#include "boards/icub/protocol.h"
#include "boards/protocol_list.h"
#include "canbus/frame.h"
#include "model/drives/actuator.h"
#include "tests/rig_run.h"

enum { MS_NS = 1000000, BUS = 1, BOARDS_MAX = 64, TIMEOUT_MS = 20 };

struct bench {
    const char *rig;
    void (*step)(struct bench *bench, int64_t ms); /* before each tick */
    bool stands; /* on the ground, as the rig says; else in the air */
    bool own;    /* the board is the simulator's after all */
    bool torque; /* its torque is followed */
    bool requests;
    const char *task, *record, *stimulus;
    uint64_t ticks;
    void *test; /* of the test */

    struct rig copy;
    struct board_config board[BOARDS_MAX];
    const struct board_config *external;
    int joint;
    struct bus_ports ports;
    struct simulator *simulator;
    struct robot_sea sea; /* of the joint; both also after the run */
    double count;         /* of the angle that the board's frames tell, rad */
    uint64_t hash;
    bool found_energy;
    int silent, heard, silent_ms; /* in the log; the last figure */
};

static inline const struct motor_sense *bench_motor(const struct bench *bench)
{
    return &plant_sensors(simulator_plant(bench->simulator))->motor[bench->joint];
}

static inline double bench_find_count(const struct bench *bench)
{
    const struct board_axis_config *axis = &bench->external->axis[0];
    const struct protocol *protocol = bench->copy.boards.bus[BUS].protocol;

    return protocol == &protocol_foc       ? 2 * M_PI / FOC_ICUBDEG_PER_REV / axis->gear
           : protocol == &protocol_compact ? 1e-5
                                           : 1 / axis->motor_ticks_per_rad;
}

/* Telemetry of the board: the angle of its first motor, on icub of both. */
static inline struct bus_frame bench_angle(const struct bench *bench, double rad)
{
    const struct protocol *protocol = bench->copy.boards.bus[BUS].protocol;
    uint32_t counts = (uint32_t)(int32_t)lrint(rad / bench->count);
    uint32_t address = bench->external->address;
    struct bus_frame frame = {.len = 8};

    if (protocol == &protocol_foc) {
        frame.id = 0x100 | address << 4 | FOC_FEEDBACK;
        put_u32_le(frame.data + 4, counts);
    } else if (protocol == &protocol_compact) {
        frame.id = 0x100; /* TELEMETRY of slot 0 */
        put_u32_le(frame.data, counts & 0x3fffff);
    } else {
        frame.id = 0x100 | address << 4 | ICUB_MOTOR_POSITION;
        put_u32_le(frame.data, counts);
    }
    return frame;
}

static inline void bench_send(struct bench *bench, const struct bus_frame *frame)
{
    assert_int_equal(can_send(bench->ports.port[BUS], frame, 1), 1);
}

static inline void bench_observe(void *context, int64_t now_ns)
{
    struct bench *bench = context;

    bench->step(bench, now_ns / MS_NS);
}

static inline void bench_read_log(struct bench *bench)
{
    char line[512];
    uint64_t key;

    while (simulator_next_event(bench->simulator, &key, line, sizeof line)) {
        const char *silent = strstr(line, "external board silent for ");

        bench->heard += strstr(line, "external board heard") != NULL;
        if (silent) {
            bench->silent++;
            assert_int_equal(sscanf(silent, "external board silent for %d", &bench->silent_ms), 1);
        }
    }
}

/* The rig with its real board; in the air nothing else acts. */
static inline void bench_change_rig(struct bench *bench)
{
    const struct rig *rig = &bench->copy;
    struct board_config *board = &bench->board[rig->bus[BUS].first_board];

    assert_true(rig->boards.nboard <= BOARDS_MAX);
    memcpy(bench->board, rig->boards.board, rig->boards.nboard * sizeof *bench->board);
    bench->copy.boards.board = bench->board;
    bench->external = board;
    bench->joint = board->axis[0].joint;
    bench->sea = rig->robot->joint[bench->joint].sea;
    bench->count = bench_find_count(bench);
    board->external = !bench->own;
    board->external_torque = bench->torque;
    board->external_timeout_ns = (int64_t)TIMEOUT_MS * MS_NS;
    if (!bench->stands) {
        rig_run_without_contact(&bench->copy);
    }
}

static inline void bench_run(struct bench *bench)
{
    const struct simulator_observer observer = {bench, bench_observe};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = bench->ticks,
                                      .task = bench->task,
                                      .observer = bench->step ? &observer : NULL,
                                      .guests = 1,
                                      .requests = bench->requests,
                                      .record = bench->record,
                                      .overwrite = true,
                                      .stimulus = bench->stimulus,
                                      .row_period_ns = MS_NS};
    struct recorder_counters counters;
    struct arena arena;
    struct error error;

    rig_run_load(bench->rig, &arena, &bench->copy);
    bench_change_rig(bench);
    config.rig = &bench->copy;
    config.hold = bench->stands ? bench->copy.hold : RIG_HOLD_NONE;
    config.settle = bench->stands && bench->copy.settle;
    bench->simulator = rig_run_open(&config, &arena, &bench->ports);
    assert_int_equal(simulator_run(bench->simulator), LOOP_END_LENGTH);
    bench_read_log(bench);
    bench->hash = plant_hash(simulator_plant(bench->simulator));
    bench->found_energy = simulator_found_energy(bench->simulator);
    if (bench->record) {
        assert_ok(simulator_finish_recording(bench->simulator, &counters, &error));
    }
    rig_run_close(bench->simulator, &arena, &bench->ports);
}

#endif
