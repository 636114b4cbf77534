/* SPDX-License-Identifier: Apache-2.0 */
/* A motor behind the bridge of axis 0 of node 4 that is not the simulator's: a rotor with a winding
 * of R and back-EMF Kw, integrated in steps of 10 us. */
#ifndef TESTS_UNIT_BOARDS_CIA402_CIA402_MOTOR_H
#define TESTS_UNIT_BOARDS_CIA402_CIA402_MOTOR_H

#include "tests/unit/boards/cia402/cia402_bench.h"

#define R_OHM 0.664
#define KW 4.1
#define J_KG_M2 0.127 /* J R / (Kt Kw) = 5 ms */

struct motor {
    struct board_bench bench;
    double angle, velocity, current, load_nm;
    bool jammed;
};

/* A tick with the rotor's motion in it. */
static inline void turn(struct motor *motor, int ticks)
{
    struct board_bench *bench = &motor->bench;

    while (ticks-- > 0) {
        const struct motor_command *command = &bench->motor[0];
        double wanted_a;

        bench_control(bench);
        wanted_a = command->law.on ? motor->current + bench_lacking_a(bench, 0) : 0.0;
        for (int i = 0; i < 100; i++) {
            motor->current = !command->bridge_on ? 0.0
                             : command->law.on
                                 ? wanted_a
                                 : (command->voltage_v - KW * motor->velocity) / R_OHM;
            motor->velocity += (KW * motor->current - motor->load_nm) / J_KG_M2 * 1e-5;
            motor->velocity = motor->jammed ? 0.0 : motor->velocity;
            motor->angle += motor->velocity * 1e-5;
        }
        bench->sense[0].q = bench->sense[0].qm = motor->angle;
        bench->sense[0].current_a = motor->current;
        bench_transmit(bench);
    }
}

/* Objects of axis 0 of node 4, beside the bus's time: the answer comes with the next tick. */
static inline void put(struct motor *motor, unsigned index, unsigned sub, unsigned bytes,
                       int64_t value)
{
    struct bus_frame frame = {.id = CIA402_SDO_REQUEST + 4, .len = 8};

    frame.data[0] = (uint8_t)(0x23 | (4 - bytes) << 2);
    put_u16_le(frame.data + 1, (uint16_t)index);
    frame.data[3] = (uint8_t)sub;
    put_u32_le(frame.data + 4, (uint32_t)value);
    boards_receive(motor->bench.boards, motor->bench.now_ns, 0, &frame);
    turn(motor, 1);
    assert_int_equal(bench_find(&motor->bench, 0, CIA402_SDO_REPLY + 4)->data[0], 0x60);
}

/* Writes the controlword of axis 0 and runs this number of ticks. */
static inline void control(struct motor *motor, unsigned word, int ticks)
{
    put(motor, 0x6040, 0, 2, word);
    turn(motor, ticks);
}

/* Writes a target position, then the controlword, and runs this number of ticks. */
static inline void go(struct motor *motor, int64_t target, unsigned word, int ticks)
{
    put(motor, 0x607a, 0, 4, target);
    control(motor, word, ticks);
}

static inline int64_t get(struct motor *motor, unsigned index)
{
    struct bus_frame frame = {.id = CIA402_SDO_REQUEST + 4, .len = 8, .data = {0x40}};
    const struct bus_frame *answer;

    put_u16_le(frame.data + 1, (uint16_t)index);
    boards_receive(motor->bench.boards, motor->bench.now_ns, 0, &frame);
    turn(motor, 1);
    answer = bench_find(&motor->bench, 0, CIA402_SDO_REPLY + 4);
    return answer->data[0] == 0x4b ? get_i16_le(answer->data + 4) : get_i32_le(answer->data + 4);
}

/* Starts a bench that is configured, and switches axis 0 on in a mode. */
static inline void start_motor(struct motor *motor, int mode)
{
    motor->bench.board[0].command_timeout_ns = 50000000;
    bench_start(&motor->bench);
    turn(motor, 1);
    put(motor, 0x6060, 0, 1, mode);
    put(motor, 0x6040, 0, 2, 0x06);
    put(motor, 0x6040, 0, 2, 0x07);
    control(motor, 0x0f, 3);
    assert_int_equal(get(motor, 0x6061) & 0xff, mode & 0xff);
}

static inline void enable(struct motor *motor, int mode)
{
    memset(motor, 0, sizeof *motor);
    configure(&motor->bench);
    start_motor(motor, mode);
}

static struct motor the_motor; /* of the present test */

FIXTURE(motor_tear_down)
{
    bench_stop(&the_motor.bench);
    return 0;
}

#endif
