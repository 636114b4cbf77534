/* SPDX-License-Identifier: Apache-2.0 */
/* From references to the bridge: voltages, limits of the PWM, joints that are not ours. */
#include "tests/unit/boards/icub/motor_bench.h"

TEST_ON(voltage_is_the_reference_over_1333_of_the_supply, bench_open, bench)
{
    static const int references[] = {0, 1, -1, 333, -333, 1332, 1333, -1333, 1334, 32767, -32768};

    set_mode(bench, 0x50);
    for (size_t i = 0; i < sizeof references / sizeof *references; i++) {
        int counts = references[i] > 1333 ? 1333 : references[i] < -1333 ? -1333 : references[i];
        char text[32];

        snprintf(text, sizeof text, "72 %02X %02X", references[i] & 0xff,
                 references[i] >> 8 & 0xff);
        bench_say(bench, 0, 0x001, text);
        assert_near(bench->motor[0].voltage_v, counts / 1333.0 * SUPPLY_V, 1e-12);
    }
    bench->sensors.supply_v = 40.0; /* PWM is a ratio: the voltage follows the supply */
    bench_send(bench, 0, 0x001, "72 35 05");
    bench_ticks(bench, 2);
    assert_near(bench->motor[0].voltage_v, 40.0, 1e-12);
}

TEST_ON(the_pwm_limit_cuts_the_voltage, bench_open, bench)
{
    bench_send(bench, 0, 0x001, "2F 64 00");
    bench_send(bench, 0, 0x001, POLICY_7F);
    set_mode(bench, 0x50);
    bench_say(bench, 0, 0x001, "72 38 FF"); /* -200 */
    assert_near(bench->motor[0].voltage_v, -100.0 / 1333.0 * SUPPLY_V, 1e-12);
    bench_tick(bench); /* slot 1: what was asked for and what it became */
    bench_expect(bench, 0, 0x112, "38 FF 00 00 9C FF 00 00");
    bench_say(bench, 0, 0x001, "2F FF FF"); /* a negative limit lets nothing through */
    assert_near(bench->motor[0].voltage_v, 0.0, 0.0);
}

TEST_ON(joints_without_a_board_are_left_alone, bench_configure, bench)
{
    bench->config.nboard = 4;
    bench->motor[3] =
        (struct motor_command){.bridge_on = true, .voltage_v = 7.0, .pretension_m = 0.25};
    bench->motor[0].pretension_m = 0.5;
    bench_start(bench);
    set_mode(bench, 0x50);
    bench_send(bench, 0, 0x002, "89 50"); /* the spare axis may run, too */
    bench_send(bench, 0, 0x002, "F2 35 05");
    bench_ticks(bench, 10);
    assert_true(bench->motor[3].bridge_on);
    assert_near(bench->motor[3].voltage_v, 7.0, 0.0);
    assert_near(bench->motor[0].pretension_m, 0.5, 0.0);
    boards_shut_down(bench->boards, bench->now_ns, &bench->command);
    assert_false(bench->motor[0].bridge_on);
    assert_true(bench->motor[3].bridge_on);
}
