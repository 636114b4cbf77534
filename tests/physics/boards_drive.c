/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Boards around the plant, at 1 kHz, of each protocol that has a mode of voltage: a voltage
 * gives the motor's speed, a current gives the torque N Kt I, and a current loop arrives in the
 * time it was made for. The references are the closed solutions of the paper's equations (2) to
 * (4).
 */
#include "base/array.h"
#include "boards/board.h"
#include "boards/cia402/protocol.h"
#include "boards/foc/protocol.h"
#include "boards/protocol_list.h"
#include "tests/physics/plant_rig.h"
#include "tests/protocol_file.h"

enum { HIP = 0, TICK_NS = 1000000, SUBSTEP_NS = 100000 };

#define GEAR 100.0

/* Whose frames command() knows: the current of icub's boards has no loop. */
static const struct protocol *const spoken[] = {&protocol_icub, &protocol_foc, &protocol_compact,
                                                &protocol_cia402};

struct bench {
    struct plant_rig rig;
    struct arena arena;
    struct boards *boards;
    const struct protocol *protocol;
    struct robot_sea sea;
};

static void fail_unless_close(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) {
        fail_msg("found %.12g, expected %.12g within %g", value, expected, tolerance);
    }
}

static void send(struct bench *bench, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame frame = frame_make(id, len, data);

    boards_receive(bench->boards, plant_time_ns(bench->rig.plant), 0, &frame);
}

static void tick(struct bench *bench)
{
    struct bus_frame frames[256];

    boards_control(bench->boards, plant_time_ns(bench->rig.plant), plant_command(bench->rig.plant));
    assert_ok(plant_step(bench->rig.plant, TICK_NS / SUBSTEP_NS));
    assert_ok(plant_sample(bench->rig.plant));
    boards_sample(bench->boards, plant_time_ns(bench->rig.plant), plant_sensors(bench->rig.plant));
    boards_transmit(bench->boards, plant_time_ns(bench->rig.plant), 0, frames, 256);
}

static const struct motor_sense *hip(const struct bench *bench)
{
    return &plant_sensors(bench->rig.plant)->motor[HIP];
}

/* The walker's own drives, or in the hip this one, without a ground. */
static void start_with(struct bench *bench, const struct protocol *protocol,
                       const struct robot_sea *sea)
{
    struct boards_bus_config bus = {.protocol = protocol};
    struct board_config board = {.name = "hip", .kind = BOARD_MOTOR, .address = 1};
    struct boards_config config = {
        .nboard = 1, .board = &board, .nbus = 1, .bus = &bus, .njoint = 8, .tick_ns = TICK_NS};
    struct error error;

    memset(bench, 0, sizeof *bench);
    toy_walker(&bench->rig.toy);
    if (sea) {
        bench->rig.toy.joint[HIP].sea = *sea;
    }
    plant_rig_start(&bench->rig, false, sea ? PLANT_IMPLICIT : PLANT_RK4, SUBSTEP_NS);
    plant_clamp(bench->rig.plant, true);
    plant_rig_reset(&bench->rig, 1.0);
    assert_ok(plant_sample(bench->rig.plant));
    bench->protocol = protocol;
    bench->sea = bench->rig.toy.joint[HIP].sea;
    for (int i = 0; i < BOARD_AXES_MAX; i++) {
        board.axis[i].joint = -1;
    }
    board.axis[0] = (struct board_axis_config){
        .joint = HIP,
        .joint_ticks_per_rad = 1e5,
        .motor_ticks_per_rad = 409600.0 / (2.0 * M_PI),
        .lower_rad = -1e3,
        .upper_rad = 1e3,
        .current_limit_a = 20.0,
        .gear = GEAR,
        .winding_ohm = bench->sea.R,
        .winding_h = bench->sea.L,
        .bemf_v_s_rad = bench->sea.Kw,
        .current_loop_hz = bench->sea.current_loop_hz,
    };
    assert_ok(arena_init(&bench->arena, 1 << 23, &error));
    bus.described = protocol->text ? protocol_file(protocol->name) : NULL;
    assert_no_error(boards_create(&config, &bench->arena, &bench->boards, &error), error.text);
    boards_sample(bench->boards, plant_time_ns(bench->rig.plant), plant_sensors(bench->rig.plant));
}

static void start(struct bench *bench, const struct protocol *protocol)
{
    start_with(bench, protocol, NULL);
}

static void stop(struct bench *bench)
{
    arena_fini(&bench->arena);
    plant_rig_fini(&bench->rig);
}

/* An object of one or two bytes is written. */
static void write_object(struct bench *bench, unsigned index, unsigned bytes, uint16_t value)
{
    uint8_t data[8] = {(uint8_t)(0x23 | (4 - bytes) << 2)};

    put_u16_le(data + 1, (uint16_t)index);
    put_u16_le(data + 4, value);
    send(bench, CIA402_SDO_REQUEST + 1, 8, data);
}

static void enable(struct bench *bench, bool current)
{
    uint8_t mode = (uint8_t)(current ? ICUB_MODE_CURRENT : ICUB_MODE_OPEN_LOOP);

    if (bench->protocol == &protocol_compact) {
        mode = (uint8_t)(current ? 2 : 1);
        send(bench, 0x020, 5, (const uint8_t[]){mode, 1, 0, 0, 0});
        return;
    }
    if (bench->protocol == &protocol_cia402) {
        tick(bench); /* it switches itself to "switch on disabled" */
        write_object(bench, 0x6060, 1,
                     (uint8_t)(current ? CIA402_CYCLIC_TORQUE : CIA402_VOLTAGE_MODE));
        write_object(bench, 0x6040, 2, CIA402_CW_SHUTDOWN);
        write_object(bench, 0x6040, 2, CIA402_CW_SWITCH_ON_ONLY);
        write_object(bench, 0x6040, 2, CIA402_CW_ENABLE);
        return;
    }
    if (bench->protocol == &protocol_foc) {
        /* Gains of a PI law for steps of 1 ms, with shift 15. The board uses kp / L as bandwidth */
        double a = exp(-1e-3 * bench->sea.R / bench->sea.L);
        double sum = 0.5 * bench->sea.R / ((1.0 - a) * 48.0);
        /* kp + ki / 2 */
        int kp = (int)lrint(sum * (1.0 + a) / 2.0 * 32768.0);
        int half_ki = (int)lrint(sum * (1.0 - a) / 2.0 * 32768.0);
        uint8_t pid[8] = {FOC_SET_CURRENT_PID, 0, 0, 0, 0, 0, 0, 15};
        uint8_t limit[8] = {FOC_SET_CURRENT_LIMIT};

        put_u16_le(pid + 1, (uint16_t)kp);
        put_u16_le(pid + 3, (uint16_t)(2 * half_ki));
        put_u16_le(limit + 2, (uint16_t)(20.0 * 1e3));
        put_u16_le(limit + 4, 30000);
        put_u16_le(limit + 6, 32000);
        send(bench, 0x001, 3, (const uint8_t[]){FOC_GET_FIRMWARE_VERSION, 1, 6});
        send(bench, 0x001, 7, (const uint8_t[]){FOC_SET_MOTOR_CONFIG, 1, 0, 16, 0, 0, 14});
        send(bench, 0x001, 8, limit);
        send(bench, 0x001, 8, pid);
    }
    send(bench, 0x001, 2, (const uint8_t[]){ICUB_SET_CONTROL_MODE, mode});
}

/* Volts or amperes */
static void command(struct bench *bench, bool current, double value)
{
    uint8_t data[8] = {ICUB_SET_OPEN_LOOP};
    bool per_mille = current && bench->protocol == &protocol_cia402; /* of 20 A */
    double scale = per_mille                           ? 1e3 / 20.0
                   : current                           ? 1e3
                   : bench->protocol == &protocol_icub ? ICUB_PWM_FULL_SCALE / 48.0
                   : bench->protocol == &protocol_foc  ? FOC_PWM_FULL_SCALE / 48.0
                                                       : 1.0 / 2e-3;
    uint16_t counts = (uint16_t)(int16_t)lrint(value * scale);

    if (bench->protocol == &protocol_icub) {
        put_u16_le(data + 1, counts);
        send(bench, 0x001, 3, data);
    } else if (bench->protocol == &protocol_foc) {
        put_u16_le(data, counts);
        send(bench, FOC_DESIRED_TARGETS_ID, 2, data);
    } else if (bench->protocol == &protocol_cia402) { /* volts by 2 mV as the compact boards */
        write_object(bench, current ? 0x6071 : CIA402_O_TARGET_VOLTAGE, 2, counts);
    } else { /* compact */
        put_u16_le(data, counts);
        send(bench, 0x040, 2, data);
    }
}

/* A motor without its spring runs at V Kt / (R Dm + Kt Kw). */
TEST(a_voltage_gives_the_motor_s_speed)
{
    for (size_t p = 0; p < ARRAY_COUNT(spoken); p++) {
        struct bench bench;
        double speed;

        start(&bench, spoken[p]);
        plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_SPRING_BREAK;
        speed = bench.sea.Kt * 6.0 / (bench.sea.R * bench.sea.Dm + bench.sea.Kt * bench.sea.Kw);
        enable(&bench, false);
        for (int t = 0; t < 300; t++) {
            command(&bench, false, 6.0);
            tick(&bench);
        }
        /* The quantum of the voltage: 48 V / 1333, 48 V / 1000, 2 mV */
        fail_unless_close(hip(&bench)->qmd, speed, speed * 0.5 * 0.048 / 6.0 + 1e-6);
        assert_true(plant_command(bench.rig.plant)->motor[HIP].bridge_on);
        stop(&bench);
    }
}

/* Against a clamped link the spring comes to rest at N Kt I. */
TEST(a_current_gives_the_torque)
{
    for (size_t p = 1; p < ARRAY_COUNT(spoken); p++) { /* all but icub */
        struct bench bench;
        double torque = 0.0, current = 0.0;

        start(&bench, spoken[p]);
        enable(&bench, true);
        for (int t = 0; t < 8000; t++) {
            command(&bench, true, 2.0);
            tick(&bench);
            torque += t >= 6000 ? hip(&bench)->torque_nm / 2000.0 : 0.0;
            current += t >= 6000 ? hip(&bench)->current_a / 2000.0 : 0.0;
        }
        fail_unless_close(current, 2.0, 0.005);
        fail_unless_close(torque, bench.sea.Kt * 2.0, 0.01 * bench.sea.Kt * 2.0);
        stop(&bench);
    }
}

/* A step arrives with 1 kHz, and the speed does not disturb it any more. */
TEST(the_compact_current_loop_arrives_with_its_bandwidth)
{
    struct bench bench;

    start(&bench, &protocol_compact);
    plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_JAM;
    enable(&bench, true);
    for (int t = 1; t <= 12; t++) {
        command(&bench, true, 4.0);
        tick(&bench);
        fail_unless_close(hip(&bench)->current_a, -4.0 * expm1(-2.0 * M_PI * t), 1e-3);
    }
    stop(&bench);
    start(&bench, &protocol_compact);
    plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_SPRING_BREAK;
    enable(&bench, true);
    for (int t = 0; t < 100; t++) { /* 4 A speed it up to 11 rad/s, of the 11.7 that 48 V give */
        command(&bench, true, 4.0);
        tick(&bench);
        if (t > 12 && t < 60) {
            fail_unless_close(hip(&bench)->current_a, 4.0, 0.1 * 4.0);
        }
    }
    stop(&bench);
}

/* The bandwidth is kp / L, as boards/foc/private.h says. */
TEST(the_foc_current_loop_has_the_bandwidth_of_its_gain)
{
    struct bench bench;
    double a, w;

    start(&bench, &protocol_foc);
    a = exp(-1e-3 * bench.sea.R / bench.sea.L);
    w = 0.25 * bench.sea.R * (1.0 + a) / (1.0 - a) / bench.sea.L;
    plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_JAM;
    enable(&bench, true);
    tick(&bench);
    for (int t = 1; t <= 12; t++) {
        command(&bench, true, 4.0);
        tick(&bench);
        fail_unless_close(hip(&bench)->current_a, -4.0 * expm1(-1e-3 * w * t), 0.01);
    }
    stop(&bench);
}

/* The host's PWM limit also holds in current mode: it limits the current of a locked rotor. */
TEST(the_icub_pwm_limit_limits_the_current_mode)
{
    static const double shares[] = {1.0, 0.05, 0.0};

    for (size_t i = 0; i < ARRAY_COUNT(shares); i++) {
        uint8_t limit[8] = {ICUB_SET_PWM_LIMIT}, torque[8] = {ICUB_SET_DESIRED_TORQUE};
        const long pwm = lrint(shares[i] * ICUB_PWM_FULL_SCALE);
        struct bench bench;

        start(&bench, &protocol_icub);
        plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_JAM;
        put_u16_le(limit + 1, (uint16_t)pwm);
        put_u16_le(torque + 1, 4000); /* mA */
        send(&bench, 0x001, 3, limit);
        send(&bench, 0x001, 2, (const uint8_t[]){ICUB_SET_CONTROL_MODE, ICUB_MODE_CURRENT});
        send(&bench, 0x001, 5, torque);
        for (int t = 0; t < 100; t++) {
            tick(&bench);
        }
        fail_unless_close(hip(&bench)->current_a,
                          fmin(4.0, 48.0 * (double)pwm / ICUB_PWM_FULL_SCALE / bench.sea.R), 1e-3);
        stop(&bench);
    }
}

/* The current of a locked rotor rises with the drive's bandwidth, or with kp / L if the host has
 * written kp. The board stores kp in mV/A. */
TEST(the_cia402_current_loop_has_the_bandwidth_of_the_drive_or_of_its_gain)
{
    static const struct {
        double hz, henry;
        int gain; /* mV/A; -1 = the host writes none */
    } rows[] = {{10.0, 2e-5, -1},  {10.0, 1.2e-4, -1}, {40.0, 1e-3, -1}, {300.0, 1e-3, -1},
                {40.0, 1e-3, 500}, {40.0, 1e-3, 0},    {1.0, 5e-5, -1}};

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(400.0);
        double w = 2.0 * M_PI * rows[i].hz;
        struct bench bench;

        sea.L = rows[i].henry;
        sea.current_loop_hz = rows[i].hz;
        start_with(&bench, &protocol_cia402, &sea);
        plant_command(bench.rig.plant)->motor[HIP].condition = DRIVE_JAM;
        if (rows[i].gain >= 0) {
            uint8_t data[8] = {
                0x23, 0x14, 0x40, 1, (uint8_t)rows[i].gain, (uint8_t)(rows[i].gain >> 8)};

            tick(&bench);
            send(&bench, CIA402_SDO_REQUEST + 1, 8, data);
            w = 1e-3 * rows[i].gain / sea.L;
        }
        enable(&bench, true);
        for (int t = 1; t <= 40; t++) {
            command(&bench, true, 4.0);
            tick(&bench);
            fail_unless_close(hip(&bench)->current_a, -4.0 * expm1(-1e-3 * w * t), 1e-5);
        }
        stop(&bench);
    }
}

/* A light rotor in a gear with play, swinging against its link: without a torque it only loses
 * speed. A loop of steps of 1 ms made it rattle by several A. */
TEST(a_torque_of_0_is_quiet_on_a_light_rotor_with_play)
{
    const struct robot_effects effects = {.backlash = 4e-3, .coulomb = 0.02, .breakaway = 0.02};
    struct robot_sea sea = toy_drive(1500.0);
    double sum = 0.0, square = 0.0;
    struct bench bench;

    sea.J = 2e-3;
    sea.Dm = 0.01;
    sea.effects = &effects;
    start_with(&bench, &protocol_cia402, &sea);
    enable(&bench, true);
    /* The rotor turns through its play */
    bench.rig.state[bench.rig.toy.robot.nq + bench.rig.toy.robot.nv + DRIVE_MOTOR_SPEED] = 0.5;
    for (int t = 0; t < 2000; t++) {
        double torque;

        command(&bench, true, 0.0);
        tick(&bench);
        torque = sea.Kt * hip(&bench)->current_a;
        sum += torque / 2000.0;
        square += torque * torque / 2000.0;
    }
    fail_unless_close(sqrt(fmax(0.0, square - sum * sum)), 0.0, 0.02);
    stop(&bench);
}
